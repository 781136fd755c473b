//! Line running diagnostic: between polls, or alone on the port when they try other serial parameters.

use std::{pin::pin, sync::Arc};

use jiff::Timestamp;

use super::{LinkExit, Task};
use crate::{
    bus::{
        diagnostics::{Ask, Job, Step, StepResult},
        frame::{self, Mbap},
        io::{
            link::{Link, LinkError},
            testing,
        },
        schedule::Next,
    },
    plant::{
        command::{BusRequest, WriteJob},
        def::{DeviceDef, Framing},
        diagnostics::{Diagnostic, DiagnosticState},
        event::{Event, WriteResult},
        fault::Fault,
        line_trouble::LineTrouble,
        time::elapsed,
    },
};

/// A busy line gives a diagnostic every n-th turn.
pub(super) const POLLS_BETWEEN: u32 = 4;

impl Task<'_> {
    pub(super) fn is_turn_of_diagnostic(&mut self, next: Next) -> bool {
        let idle = !matches!(next, Next::Run(_));
        let is_due = self.diagnostic_from().is_some_and(|from| from <= self.clock.now())
            && (idle || POLLS_BETWEEN <= self.polls_since_step);
        // A long one takes turns with live reads.
        let yields = self.stepped && self.job.as_ref().is_some_and(Job::is_long);
        is_due && !(yields && self.is_turn_of_live_read(next))
    }

    /// From when on the diagnostic may have the line, if it has a next step: a sweep has the share of live reads.
    pub(super) fn diagnostic_from(&self) -> Option<Timestamp> {
        let job = self.job.as_ref().filter(|job| job.next().is_some())?;
        Some(if job.is_sweep() { self.live_from() } else { Timestamp::MIN })
    }

    /// One step of the diagnostic, between polls.
    pub(super) async fn diagnostic_step(&mut self, link: &mut Link) -> Result<(), LinkExit> {
        (self.polls_since_step, self.stepped) = (0, true);
        let Some(step) = self.job.as_ref().and_then(|job| job.next().cloned()) else { return Ok(()) };
        let started = self.clock.now();
        let Some(result) = self.step_unless_cut(link, &step, false).await? else { return Ok(()) };
        let ended = self.clock.now();
        match (result, &mut self.job) {
            (Ok(result), Some(job)) => {
                let (in_sync, done) = (stays_in_sync(link.framing(), &step.ask, &result), job.run().done);
                job.on_result(result);
                if let Diagnostic::Identify { unit } = job.run().diagnostic {
                    let own = |device: &&DeviceDef| (device.line, device.unit) == (self.line, unit);
                    let is_over = job.run().state != DiagnosticState::Running;
                    for device in self.def.devices.iter().filter(own) {
                        self.recheck.identified(device.id);
                        if is_over {
                            self.identification.ask_again(device.id, ended);
                        }
                    }
                }
                if let Some((unit, holes)) = job.take_holes() {
                    self.live_budget.spent(elapsed(started, ended), ended);
                    holes
                        .into_iter()
                        .for_each(|hole| self.unreadable.add(unit, hole.table, hole.range().start, hole.range().end));
                }
                // The steps of a sweep are many, and not each of them shows something new.
                if done != job.run().done || job.run().state != DiagnosticState::Running {
                    self.publish_diagnostic().await?;
                }
                if in_sync { Ok(()) } else { Err(LinkExit::Reopen) }
            }
            (Err(LinkError::Gone(why)), _) => Err(LinkExit::Gone(why)),
            // It would be asked again at once, for ever.
            (Err(LinkError::Fault(fault)), _) => self.end_diagnostic(LineTrouble::Fault(fault)).await,
            (Ok(_), None) => Ok(()),
        }
    }

    /// Carries a step. `None` when it was cut short, and the test with it, by what cannot wait for it: a stop, or what ends
    /// the test anyway.
    async fn step_unless_cut(
        &mut self,
        link: &mut Link,
        step: &Step,
        alone: bool,
    ) -> Result<Option<Result<StepResult, LinkError>>, LinkExit> {
        let cut = {
            let mut result = pin!(testing::step(link, step));
            loop {
                let request = tokio::select! {
                    biased;
                    _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
                    result = &mut result => return Ok(Some(result)),
                    request = self.requests.recv() => request,
                };
                let request = match request {
                    Ok(request) => request,
                    Err(interrupt) => break Err(interrupt),
                };
                if !self.on_request_during_diagnostic(request, alone).await? {
                    break Ok(());
                }
            }
        };
        link.abandon();
        cut.map(|()| None).map_err(LinkExit::from)
    }

    /// The diagnostic has the port for itself, opened with the serial parameters that each step wants.
    pub(super) async fn run_diagnostic_alone(&mut self) -> Result<(), LinkExit> {
        let mut open: Option<Link> = None;
        let mut settings = self.settings.clone();
        while let Some(step) = self.job.as_ref().and_then(|job| job.next().cloned()) {
            if let Some(request) = self.requests.try_recv()? {
                if self.on_request_during_diagnostic(request, true).await? {
                    continue;
                }
                break;
            }
            let wanted = testing::settings_for(&self.settings, &step);
            let mut link = match open.take().filter(|_| wanted == settings) {
                Some(link) => link,
                None => match self.connector.open_as(&wanted.transport).await {
                    Ok(opened) => Link::new(opened, &wanted, self.clock, self.memory.clone()),
                    Err(why) => {
                        self.end_diagnostic(why).await?;
                        break;
                    }
                },
            };
            settings = wanted;
            let result = self.step_unless_cut(&mut link, &step, true).await;
            self.collect_stats(&mut link);
            let Some(result) = result? else { break };
            match (result, &mut self.job) {
                (Ok(result), Some(job)) => job.on_result(result),
                (Err(LinkError::Gone(why)), _) => {
                    self.end_diagnostic(why).await?;
                    break;
                }
                (Err(LinkError::Fault(fault)), _) => self.end_diagnostic(LineTrouble::Fault(fault)).await?,
                (Ok(_), None) => {}
            }
            self.publish_diagnostic().await?;
            open = Some(link);
        }
        self.publish_diagnostic().await
    }

    /// Takes a request while a test is at work, `alone` on the port or between polls; `false` when the test is ended by it.
    async fn on_request_during_diagnostic(&mut self, request: BusRequest, alone: bool) -> Result<bool, LinkExit> {
        match request {
            BusRequest::Write(WriteJob { id, urgent: false, .. }) if alone => {
                self.publish_write_result(id, WriteResult::NotSent(Fault::NotConnected)).await?;
                Ok(true)
            }
            BusRequest::Refresh { .. } if alone => Ok(true),
            BusRequest::Write(WriteJob { urgent: false, .. }) | BusRequest::Refresh { .. } => {
                self.requests.defer(request);
                Ok(true)
            }
            BusRequest::Write(WriteJob { urgent: true, .. }) => {
                self.end_diagnostic(LineTrouble::UrgentStop).await?;
                self.requests.requeue_first(request);
                Ok(false)
            }
            BusRequest::StopTest => {
                self.stop_diagnostic().await?;
                Ok(false)
            }
            BusRequest::Connect(_) | BusRequest::Test { .. } | BusRequest::Configure(_) => {
                self.stop_diagnostic().await?;
                self.requests.requeue_first(request);
                Ok(false)
            }
        }
    }

    /// An operator stops the running diagnostic.
    pub(super) async fn stop_diagnostic(&mut self) -> Result<(), LinkExit> {
        if let Some(job) = &mut self.job {
            job.stop(DiagnosticState::Cancelled);
        }
        self.publish_diagnostic().await
    }

    /// The line cannot go on with the running diagnostic.
    pub(super) async fn end_diagnostic(&mut self, why: LineTrouble) -> Result<(), LinkExit> {
        if let Some(job) = &mut self.job {
            job.stop(DiagnosticState::Failed(why));
        }
        self.publish_diagnostic().await
    }

    /// Tells how the diagnostic stands, and forgets it when it is over.
    pub(super) async fn publish_diagnostic(&mut self) -> Result<(), LinkExit> {
        let Some(job) = &self.job else { return Ok(()) };
        let run = Arc::new(job.run().clone());
        if job.run().state != DiagnosticState::Running {
            self.job = None;
        }
        self.publish(Event::Diagnostic { at: self.clock.now(), line: self.line, run }).await
    }
}

/// Over Modbus TCP bytes that are no whole frame would be taken together with the next request, and an answer that is still
/// to come could carry the transaction of a later one: then only a new connection is in sync.
fn stays_in_sync(framing: Framing, ask: &Ask, result: &StepResult) -> bool {
    let whole = |bytes: &[u8]| matches!(frame::mbap(bytes), Mbap::Whole { end, .. } if end == bytes.len());
    match (framing, ask, result) {
        (Framing::Mbap, Ask::Raw(sent), StepResult::Bytes(received, _)) => whole(sent) && whole(received),
        (Framing::Mbap | Framing::Rtu | Framing::Ascii, _, _) => true,
    }
}
