//! Requests of diagnostics: raw bytes, and the loopback that resynchronises a unit.

use std::time::Duration;

use tokio::time::Instant;

use super::{Link, LinkError, receive::RECEIVE_MAX};
use crate::{
    bus::{frame, framing},
    plant::{def::Framing, fault::Fault, number::to_u32, traffic::FrameResult},
};

impl Link {
    /// Sends bytes as they are and gives everything that comes back until the line is silent: for tests of the line.
    pub async fn send_raw(&mut self, bytes: &[u8]) -> Result<(Vec<u8>, Option<Duration>), LinkError> {
        let framing = self.framing();
        // What comes next would be shown as the answer.
        self.finish_all().await?;
        let request = frame::unwrap(framing, bytes).unwrap_or_default();
        let sent_at = self.send(&request, bytes).await?;
        self.note_sent(bytes.into());
        let deadline = sent_at + self.timeout + self.wire.char_time * to_u32(frame::MESSAGE_MAX);
        let proof = framing != Framing::Mbap && !self.wire.replies.is_ambiguous(&request);
        let (mut buffer, mut response_time) = (Vec::new(), None);
        let mut until = deadline;
        let answered = loop {
            if !self.wire.receive(until, &mut buffer).await? || RECEIVE_MAX <= buffer.len() {
                break false;
            }
            response_time.get_or_insert(Instant::now().saturating_duration_since(sent_at));
            // One frame answers a request; after other bytes only silence ends the response.
            if request.is_empty() {
                until = (Instant::now() + self.frame_timeout).min(deadline);
                continue;
            }
            if framing::find_reply(framing, bytes, &buffer, false).is_ok() {
                break true;
            }
        };
        self.asked = None;
        if !buffer.is_empty() {
            self.wire.record(false, buffer[..].into(), FrameResult::Unchecked);
        }
        self.wire.hold_off(self.wire.silent_interval);
        // What was sent may have been a request whose answer is still to come.
        if framing != Framing::Mbap && !request.is_empty() && !(answered && proof) {
            self.expect_late(&request);
        }
        Ok((buffer, response_time))
    }

    /// Resynchronises a unit by a loopback, where no read can: after it nothing older can come any more.
    pub async fn loopback(&mut self, unit: u8) -> Result<(), LinkError> {
        let proves = self.outstanding(unit).refusal_proves();
        let loopback = self.wire.replies.next_loopback(unit);
        match self.exchange(&loopback).await {
            Ok(_) => Ok(()),
            Err(LinkError::Fault(Fault::Exception(_))) if proves => {
                if !self.is_unsettled(unit) {
                    self.wire.replies.clear(unit, self.wire.uptime());
                }
                Ok(())
            }
            // It may be the answer to an earlier loopback: the unit is alive, but not in sync.
            Err(LinkError::Fault(Fault::Exception(_))) => Err(Fault::Timeout.into()),
            Err(error) => Err(error),
        }
    }
}
