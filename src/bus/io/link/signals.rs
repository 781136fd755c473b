//! A signal of the port, held by hand for a test.

use super::{Link, LinkError, PortWatch};
use crate::plant::port_signals::{LOOK, OutputSignal, PortSignals};

impl Link {
    /// Holds a signal until the next look, and says how all of them stand then; `Err` where the port has none.
    pub async fn hold_signal(
        &mut self,
        signal: OutputSignal,
        on: bool,
    ) -> Result<Result<PortSignals, String>, LinkError> {
        if self.held.is_none() {
            let held = self.watch.as_ref().map(|watch| watch.hold(signal, on));
            match held {
                Some(Ok(held)) => self.held = Some(held),
                Some(Err(_)) | None => return Ok(Err(no_signals())),
            }
        }
        tokio::time::sleep(LOOK).await;
        self.signals()
    }

    /// Puts the signal that is held back as it was.
    pub fn put_back_signal(&mut self) -> Result<Result<PortSignals, String>, LinkError> {
        self.held = None;
        self.signals()
    }

    fn signals(&self) -> Result<Result<PortSignals, String>, LinkError> {
        // It had some: an adapter that was unplugged has none any more.
        let now = self.watch.as_ref().and_then(PortWatch::signals);
        now.map(Ok).ok_or_else(|| LinkError::Gone("the port is gone".to_owned()))
    }
}

fn no_signals() -> String {
    "this port has no RTS and DTR: a pseudo-terminal, or a driver without them".to_owned()
}
