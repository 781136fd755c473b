//! A signal of the port, held by hand for a test.

use super::{Link, LinkError, PortWatch};
use crate::plant::{
    line_trouble::LineTrouble,
    port_signals::{LOOK, OutputSignal, PortSignals},
};

impl Link {
    /// Holds a signal until the next look, and says how all of them stand then; `Err` where the port has none.
    pub async fn hold_signal(
        &mut self,
        signal: OutputSignal,
        on: bool,
    ) -> Result<Result<PortSignals, LineTrouble>, LinkError> {
        if self.held.is_none() {
            let held = self.watch.as_ref().map(|watch| watch.hold(signal, on));
            match held {
                Some(Ok(held)) => self.held = Some(held),
                Some(Err(_)) | None => return Ok(Err(LineTrouble::NoSignals)),
            }
        }
        tokio::time::sleep(LOOK).await;
        self.signals()
    }

    /// Puts the signal that is held back as it was.
    pub fn put_back_signal(&mut self) -> Result<Result<PortSignals, LineTrouble>, LinkError> {
        self.held = None;
        self.signals()
    }

    fn signals(&self) -> Result<Result<PortSignals, LineTrouble>, LinkError> {
        // It had some: an adapter that was unplugged has none any more.
        let now = self.watch.as_ref().and_then(PortWatch::signals);
        now.map(Ok).ok_or(LinkError::Gone(LineTrouble::PortGone))
    }
}
