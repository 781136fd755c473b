//! Connections that come and go: what ended one, and what is due on the next.

use super::{LinkExit, Task};
use crate::{
    bus::{
        hangup::Hangup,
        io::link::Link,
        plan::Block,
        schedule::{Failure, Next, Schedule},
    },
    plant::{
        fault::Fault,
        line_finding::{DeviceFinding, LineFinding},
        time::elapsed,
    },
};

/// Connections in a row that were deaf at first.
const DEAF_TIMES: u32 = 2;
/// More unreadable ranges of a device are not listed.
const FINDINGS_MAX: usize = 200;

impl Task<'_> {
    /// A connection over a network is gone. The block that has ended it is named and waits; `true` if another connection may take its
    /// place without a word.
    pub(super) async fn on_hangup(&mut self, schedule: &mut Schedule, answers: u64) -> Result<bool, LinkExit> {
        let (cut, misfits): (Vec<_>, Vec<_>) = self.cut_off(schedule).into_iter().unzip();
        let Hangup { guilty, is_quiet } = self.hangups.on_end(&cut, answers);
        let Some(block) = guilty else { return Ok(is_quiet) };
        // Where its answer did not fit, that has ended the connection.
        let fault = misfits.into_iter().flatten().next().unwrap_or(Fault::Hangup);
        let now = self.clock.now();
        let device = &self.def.device(block.device).name;
        tracing::warn!(device, table = ?block.table, address = block.address, count = block.count, "{fault}");
        self.publish_failure(now, block.device, block.tags.to_vec(), fault, None).await?;
        let index = self.blocks.iter().position(|planned| *planned == block);
        if schedule.failed(index, block.device, Failure::Hangup, (now, std::time::Duration::ZERO), now) {
            let tags = self.def.tags_of(block.device).map(|tag| tag.id).collect();
            self.publish_failure(now, block.device, tags, Fault::BackedOff, None).await?;
        }
        Ok(is_quiet)
    }

    /// A block was answered: it does not end connections.
    pub(super) fn on_block_answered(&mut self, link: &mut Link, block: &Block) {
        self.hangups.on_answers(link.answers());
        if let Some(together) = self.hangups.answered(block) {
            let together = u16::try_from(together).unwrap_or(u16::MAX);
            let most = self.in_flight.step_down(block.unit, together);
            tracing::warn!(unit = block.unit, together, most, "too many requests at once: in_flight_max is lowered");
            link.allow(block.unit, most);
        }
        link.set_alone(!self.hangups.is_clear());
    }

    /// A request has ended that was sent with others under way; `lost`: without the answer that it had before.
    pub(super) fn note_fate(&mut self, link: &mut Link, block: &Block, beside: usize, lost: bool) {
        let stated = self.def.device(block.device).limits.in_flight_max;
        if let Some(most) = self.in_flight.on_end(block.unit, stated, beside, lost) {
            tracing::warn!(unit = block.unit, most, "requests beside others are lost: in_flight_max is lowered");
            link.allow(block.unit, most);
        }
    }

    /// The first answer over a connection shows how long the other side was deaf.
    pub(super) fn check_deafness(&mut self, link: &mut Link) {
        if self.heard || !self.settings.transport.has_connection() || link.answers() == 0 {
            return;
        }
        self.heard = true;
        let unanswered = link.counters().timeouts - self.timeouts_before;
        let waited = elapsed(self.opened_at, self.clock.now()).max(self.settings.connect_delay);
        self.deaf = match self.deaf {
            Some((longest, count)) if 0 < unanswered => Some((longest.max(waited), count.saturating_add(1))),
            None if 0 < unanswered => Some((waited, 1)),
            Some(_) | None => None,
        };
    }

    /// What was found of devices and connections.
    pub(super) fn findings(&self) -> Vec<LineFinding> {
        let mut findings = Vec::new();
        findings.extend(self.hangups.answers_max().map(LineFinding::AnswersPerConnection));
        let deaf = self.deaf.filter(|(_, count)| DEAF_TIMES <= *count);
        findings.extend(deaf.map(|(longest, _)| LineFinding::DeafAfterConnect(longest)));
        for device in self.def.devices.iter().filter(|device| device.line == self.line) {
            let (id, stated) = (device.id, device.limits.in_flight_max);
            let found = self.in_flight.found(device.unit).filter(|most| *most < stated);
            let found = found.map(|most| DeviceFinding::InFlight { most, stated });
            let gap = self.memory.request_gaps.found(device.unit).map(|gap| DeviceFinding::RequestGap { gap });
            let all = found.into_iter().chain(gap).chain(self.unreadable.of(device.unit)).take(FINDINGS_MAX);
            findings.extend(all.map(|found| LineFinding::Device(id, found)));
        }
        findings
    }

    /// A request on which a connection has ended is the first on the next.
    pub(super) fn suspect_first(&self, link: &Link) -> Option<Next> {
        let suspect = self.hangups.suspect().filter(|_| link.answers() == 0 && self.under_way.is_empty())?;
        self.blocks.iter().position(|planned| planned == suspect).map(Next::Run)
    }

    /// May the other side have had enough of this connection?
    pub(super) fn check_used_up(&mut self, link: &Link) -> Result<(), LinkExit> {
        if self.settings.transport.has_connection()
            && self.under_way.is_empty()
            && self.hangups.answers_max() == Some(link.answers())
            && self.hangups.is_used_up(link.answers())
        {
            return Err(LinkExit::UsedUp);
        }
        Ok(())
    }

    /// Waits without a connection, with the values as they are, until something is due or asked for.
    pub(super) async fn wait_until_due(&mut self, schedule: &mut Schedule) -> Result<(), LinkExit> {
        loop {
            let now = self.clock.now();
            self.publish_report(Some(schedule)).await?;
            let until = match schedule.next(now) {
                Next::Run(_) => return Ok(()),
                Next::WaitUntil(at) => at.min(now + super::REPORT_EVERY),
                Next::Idle => now + super::REPORT_EVERY,
            };
            let (clock, live_from) = (self.clock, self.live_from());
            if self.diagnostic_from().is_some_and(|from| from <= now) || self.is_turn_of_deferred_read_back(now) {
                return Ok(());
            }
            let live = async {
                clock.sleep_until(live_from).await;
                self.live.due(clock).await;
            };
            let request = tokio::select! {
                biased;
                _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
                request = self.requests.recv() => request?,
                () = live => return Ok(()),
                () = clock.sleep_until(until) => continue,
            };
            self.requests.requeue_first(request);
            return Ok(());
        }
    }
}
