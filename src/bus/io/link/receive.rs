//! Receives bytes until they are the answer or the deadline passes.

use std::{sync::Arc, time::Duration};

use tokio::time::Instant;

use super::{Link, LinkError};
use crate::{
    bus::{
        frame,
        framing::{self, FrameMatch},
    },
    plant::{
        def::Framing,
        fault::Fault,
        number::to_u32,
        traffic::{FrameFault, FrameResult},
    },
};

/// Characters of an ASCII frame may be this far apart (Modbus over serial line V1.02, 2.5.2.1).
const ASCII_PAUSE: Duration = Duration::from_secs(1);
/// Most bytes received for one answer, noise included; more is no Modbus.
pub(super) const RECEIVE_MAX: usize = 4_096;

/// What was received for one request.
#[derive(Debug, Clone)]
pub(super) struct Received {
    pub answer: Result<Vec<u8>, Fault>,
    /// As it was on the wire.
    pub frame: Arc<[u8]>,
    pub response_time: Option<Duration>,
}

impl Received {
    pub fn nothing(answer: Result<Vec<u8>, Fault>) -> Received {
        Received { answer, frame: Arc::default(), response_time: None }
    }
}

impl Link {
    /// Receives until a frame has come that answers the message. Whole frames that do not (another unit, an outstanding reply)
    /// are dropped, and waiting goes on inside the same deadline.
    pub(super) async fn receive(
        &mut self,
        message: &[u8],
        sent: &[u8],
        sent_at: Instant,
    ) -> Result<Received, LinkError> {
        let framing = self.framing();
        let mut echo = self.expects_echo(message).then_some(sent);
        let request = self.wire.replies.request(message);
        let longest = frame::expected_length(request).unwrap_or(frame::MESSAGE_MAX);
        let deadline = sent_at + self.timeout + self.wire.char_time * to_u32(frame::wrapped_length(framing, longest));
        let mut buffer: Vec<u8> = Vec::new();
        // What came and did not fit: it names the fault if nothing better comes.
        let mut misfit: Option<Fault> = None;
        let mut response_time = None;
        loop {
            // An adapter that gives back what it sends: its echo is no answer, however much it looks like one.
            if let Some(sent) = echo.filter(|sent| buffer.starts_with(sent)) {
                self.wire.record(false, buffer.drain(..sent.len()).collect(), FrameResult::Wrong(FrameFault::Echo));
                (self.echoes, echo) = (true, None);
            }
            let echo_begun = self.echoes && echo.is_some_and(|sent| sent.starts_with(&buffer));
            let verdict =
                if echo_begun { FrameMatch::Nothing } else { framing::find_answer(framing, request, &buffer) };
            let wait_until = match verdict {
                FrameMatch::Answer(range) => {
                    self.wire.drop_unexpected(&buffer[..range.start]);
                    let frame: Arc<[u8]> = buffer[range].into();
                    self.wire.record(false, frame.clone(), FrameResult::Good);
                    let answer = frame::unwrap(framing, &frame)
                        .and_then(|answer| frame::check_answer(framing, request, &answer).map(|()| answer));
                    return Ok(Received { answer, frame, response_time });
                }
                FrameMatch::Foreign(end, fault) => {
                    self.wire.drop_unexpected(&buffer[..end]);
                    buffer.drain(..end);
                    misfit = Some(fault);
                    continue;
                }
                // Nothing, or noise: the answer may still come.
                FrameMatch::Nothing => deadline,
                // Its rest would have come with it; the answer may come in another.
                FrameMatch::Begun if self.in_datagrams => {
                    misfit = Some(framing::left_over(framing, request, &buffer));
                    let cut = FrameResult::Wrong(FrameFault::CutShort);
                    self.wire.record(false, std::mem::take(&mut buffer).into(), cut);
                    continue;
                }
                // The frame may still grow, or it is corrupt; silence decides.
                FrameMatch::Begun if framing == Framing::Ascii => (Instant::now() + ASCII_PAUSE).min(deadline),
                // A network may hold the rest of a frame back as long as any answer.
                FrameMatch::Begun if self.is_network => deadline,
                FrameMatch::Begun | FrameMatch::Corrupt(_) => (Instant::now() + self.frame_timeout).min(deadline),
            };
            if self.wire.receive(wait_until, &mut buffer).await? && buffer.len() <= RECEIVE_MAX {
                response_time.get_or_insert(Instant::now().saturating_duration_since(sent_at));
                continue;
            }
            let fault = match verdict {
                FrameMatch::Corrupt(fault) => fault,
                _ => misfit.unwrap_or_else(|| framing::left_over(framing, request, &buffer)),
            };
            let frame: Arc<[u8]> = buffer.into();
            if !frame.is_empty() {
                self.wire.record(false, frame.clone(), FrameResult::Wrong(FrameFault::NoResponse(fault)));
            }
            return Ok(Received { answer: Err(fault), frame, response_time });
        }
    }

    /// Could the sent bytes come back from the adapter? A read cannot be answered by itself, so its echo gives the adapter
    /// away; from then on the echo of every request is expected.
    fn expects_echo(&self, message: &[u8]) -> bool {
        self.echoes || matches!(message.get(1), Some(0x01..=0x04 | 0x17))
    }
}
