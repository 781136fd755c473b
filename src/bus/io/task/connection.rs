//! The port of a line from one opening to the next: opened, served, left, waited for.

use super::{LinkExit, Task};
use crate::{
    bus::{
        backoff::Backoff,
        io::{link::Link, transport::Opened},
        schedule::{Patience, Schedule},
    },
    plant::{line_state::LineState, line_trouble::LineTrouble},
};

impl Task<'_> {
    /// Opens, serves and waits until the station ends.
    pub(super) async fn connect_loop(mut self) -> Result<(), LinkExit> {
        let mut backoff = Backoff::for_ports();
        let mut schedule = self.schedule.clone();
        // The last connection has ended without a word, and its values stay.
        let mut is_quiet = false;
        loop {
            if !is_quiet {
                self.publish_state(LineState::Connecting).await?;
            }
            let exit = match self.open().await {
                Ok(port) => {
                    self.memory.counters.opens += 1;
                    if is_quiet {
                        self.identification.goes_on();
                    } else {
                        self.identification.reopened(self.clock.now());
                        self.publish_state(LineState::Connected).await?;
                        tracing::info!(line = self.settings.name, transport = %self.settings.transport, "connected");
                    }
                    schedule.reopened(!is_quiet, self.clock.now());
                    let (answers, exit) = self.serve(port, &mut schedule).await;
                    // A port that fails right after opening is retried with backoff.
                    if 0 < answers {
                        backoff.reset();
                        self.unheard = 0;
                    }
                    self.ended(&mut schedule, answers, exit).await?
                }
                Err(exit) => self.refuse_waiting().await.err().unwrap_or(exit),
            };
            is_quiet = matches!(exit, LinkExit::UsedUp);
            if !matches!(exit, LinkExit::Reopen | LinkExit::Shutdown | LinkExit::UsedUp) {
                self.give_up_unconfirmed().await?;
            }
            match exit {
                LinkExit::Shutdown => return Err(exit),
                LinkExit::Reopen => backoff.reset(),
                LinkExit::Redefined => self.redefine(None, &mut schedule).await?,
                LinkExit::UsedUp => {
                    let waited = self.wait_until_due(&mut schedule).await;
                    self.unless_redefined(waited, &mut schedule).await?;
                }
                LinkExit::Diagnostic => {
                    self.publish_state(LineState::Testing).await?;
                    let tested = self.run_diagnostic_alone().await;
                    self.unless_redefined(tested, &mut schedule).await?;
                }
                LinkExit::Closed => {
                    self.end_diagnostic(LineTrouble::LineClosed).await?;
                    self.publish_state(LineState::Disconnected).await?;
                    self.publish_report(None).await?;
                    self.wait(None, &mut schedule).await?;
                }
                LinkExit::PortFailed(why) | LinkExit::Gone(why) => {
                    self.end_diagnostic(why.clone()).await?;
                    tracing::warn!(line = self.settings.name, %why, "not connected");
                    let retry_at = self.clock.now() + backoff.fail();
                    self.publish_state(LineState::Waiting { why, retry_at }).await?;
                    self.publish_report(None).await?;
                    self.wait(Some(retry_at), &mut schedule).await?;
                }
            }
        }
    }

    /// A port was left. One that is gone without a fault of the line is [`LinkExit::UsedUp`].
    async fn ended(&mut self, schedule: &mut Schedule, answers: u64, exit: LinkExit) -> Result<LinkExit, LinkExit> {
        let exit = match exit {
            LinkExit::Gone(why) if self.settings.transport.has_connection() => {
                tracing::debug!(line = self.settings.name, %why, answers, "the connection has ended");
                if self.on_hangup(schedule, answers).await? {
                    self.end_diagnostic(why.clone()).await?;
                    LinkExit::UsedUp
                } else {
                    LinkExit::PortFailed(why)
                }
            }
            exit => exit,
        };
        self.cut_off(schedule);
        // What waits is served by the next connection, if that may take the place of this one.
        if !matches!(exit, LinkExit::UsedUp) {
            self.stats.rest(&mut self.memory.counters);
            self.refuse_waiting().await?;
        }
        Ok(exit)
    }

    /// Serves an open port until it is left; says how many answers came over it.
    async fn serve(&mut self, opened: Opened, schedule: &mut Schedule) -> (u64, LinkExit) {
        let mut link = Link::new(opened, &self.settings, self.clock, self.memory.clone());
        schedule.set_patience(Patience::of(&self.settings, self.clock.speed()));
        self.allow_in_flight(&mut link);
        link.set_alone(!self.hangups.is_clear());
        (self.closed_at, self.opened_at, self.heard) = (self.clock.now(), self.clock.now(), false);
        self.timeouts_before = link.counters().timeouts;
        let exit = loop {
            let Err(exit) = self.serve_loop(&mut link, schedule).await;
            match exit {
                LinkExit::Redefined => match self.redefine(Some(&mut link), schedule).await {
                    Ok(()) => {}
                    Err(exit) => break exit,
                },
                exit => break exit,
            }
        };
        self.collect_stats(&mut link);
        (link.answers(), exit)
    }

    /// How many requests may be under way to each device.
    pub(super) fn allow_in_flight(&self, link: &mut Link) {
        for device in self.def.devices.iter().filter(|device| device.line == self.line) {
            link.state_request_gap(device.unit, device.gap);
            link.allow(device.unit, self.in_flight.limit(device.unit, device.limits.in_flight_max));
        }
    }
}
