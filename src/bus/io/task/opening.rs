//! A line whose port is being opened: what a host that does not answer must not hold.

use super::{LinkExit, Task};
use crate::{bus::io::transport::Opened, plant::command::BusRequest};

impl Task<'_> {
    /// Opens the port, unless the station ends, or an operator closes the line or has other settings for it meanwhile.
    pub(super) async fn open(&mut self) -> Result<Opened, LinkExit> {
        let request = tokio::select! {
            biased;
            _ = self.stop.wait_for(|stop| *stop) => return Err(LinkExit::Shutdown),
            opened = self.connector.open() => return opened.map_err(LinkExit::PortFailed),
            request = self.requests.recv_end_of_opening() => request?,
        };
        let BusRequest::Configure(settings) = request else { return Err(LinkExit::Closed) };
        self.configure(*settings);
        Err(LinkExit::Reopen)
    }
}
