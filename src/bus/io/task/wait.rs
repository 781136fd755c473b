//! A line without a port: until it is tried again, or an operator opens it.

use jiff::Timestamp;

use super::{LinkExit, Task};
use crate::{
    bus::{diagnostics::Job, io::requests::Interrupt, schedule::Schedule},
    plant::{command::BusRequest, event::WriteResult, fault::Fault, line_state::LineState, line_trouble::LineTrouble},
};

impl Task<'_> {
    /// Waits without a port until a moment, or until an operator opens the line; refuses writes meanwhile.
    pub(super) async fn wait(&mut self, mut until: Option<Timestamp>, schedule: &mut Schedule) -> Result<(), LinkExit> {
        loop {
            let clock = self.clock;
            let request = tokio::select! {
                biased;
                _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
                request = self.requests.recv() => request,
                () = clock.sleep_until_if_any(until) => return Ok(()),
            };
            let request = match request {
                Err(Interrupt::Redefined) => {
                    self.redefine(None, schedule).await?;
                    self.publish_report(None).await?;
                    continue;
                }
                request => request?,
            };
            match request {
                BusRequest::Write(job) => {
                    self.publish_write_result(job.id, WriteResult::NotSent(Fault::NotConnected)).await?
                }
                // An operator does not wait for the next try to open the port.
                BusRequest::Refresh { .. } if until.is_some() => return Ok(()),
                BusRequest::Refresh { .. } | BusRequest::StopTest => {}
                BusRequest::Connect(true) => return Ok(()),
                BusRequest::Connect(false) => {
                    until = None;
                    self.publish_state(LineState::Disconnected).await?;
                }
                BusRequest::Configure(settings) => {
                    self.configure(*settings);
                    self.publish_report(None).await?;
                    if until.is_some() {
                        return Ok(());
                    }
                }
                BusRequest::Test { id, by, diagnostic } => {
                    let job = Job::new(id, by, diagnostic, self.clock.now());
                    let alone = job.is_exclusive();
                    self.job = Some(job);
                    if alone {
                        self.publish_state(LineState::Testing).await?;
                        let tested = self.run_diagnostic_alone().await;
                        self.unless_redefined(tested, schedule).await?;
                        // A line that an operator has closed stays closed.
                        if until.is_some() {
                            return Ok(());
                        }
                        self.publish_state(LineState::Disconnected).await?;
                        continue;
                    }
                    self.end_diagnostic(LineTrouble::NotConnected).await?;
                }
            }
        }
    }
}
