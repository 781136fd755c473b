//! Requests on a serial line as a slave finds them: what comes between two silences is one frame, whatever its function says.

use super::ascii::{self, SlaveRequest};
use crate::bus::frame::crc16;

/// The longest frame of a serial line (Modbus serial line V1.02, 2.5.1).
const BYTES_MAX: usize = 256;

/// Collects received characters into requests.
#[derive(Debug, Clone)]
pub enum FrameReceiver {
    /// For RTU.
    Rtu(Receiver),
    /// For ASCII.
    Ascii(ascii::Receiver),
}

impl FrameReceiver {
    /// For RTU, or for ASCII with this many data bits.
    pub fn new(ascii: bool, data_bits: u8) -> FrameReceiver {
        if ascii {
            FrameReceiver::Ascii(ascii::Receiver::new(data_bits))
        } else {
            FrameReceiver::Rtu(Receiver::default())
        }
    }

    /// Adds characters as they arrive.
    pub fn push(&mut self, characters: &[u8]) {
        match self {
            FrameReceiver::Rtu(receiver) => receiver.push(characters),
            FrameReceiver::Ascii(receiver) => receiver.push(characters),
        }
    }

    /// The next thing that is complete without a silence: a request, or `None` in its place if it could not be read.
    pub fn take(&mut self) -> Option<Option<SlaveRequest>> {
        match self {
            FrameReceiver::Rtu(_) => None,
            FrameReceiver::Ascii(receiver) => receiver.take(),
        }
    }

    /// How many characters there are, if they would be a request with a right check were the line silent from now on.
    pub fn whole(&self) -> Option<usize> {
        match self {
            FrameReceiver::Rtu(receiver) => receiver.is_whole().then_some(receiver.bytes.len()),
            FrameReceiver::Ascii(_) => None,
        }
    }

    /// The line was silent for long enough to end a frame.
    pub fn on_silent_interval(&mut self) -> Option<Option<SlaveRequest>> {
        match self {
            FrameReceiver::Rtu(receiver) if receiver.is_empty() => None,
            FrameReceiver::Rtu(receiver) => Some(receiver.on_silent_interval().map(request)),
            FrameReceiver::Ascii(receiver) => {
                receiver.on_silent_interval();
                receiver.take()
            }
        }
    }

    /// Whether nothing waits for its rest.
    pub fn is_empty(&self) -> bool {
        match self {
            FrameReceiver::Rtu(receiver) => receiver.is_empty(),
            FrameReceiver::Ascii(receiver) => receiver.is_empty(),
        }
    }
}

fn request(mut frame: Vec<u8>) -> SlaveRequest {
    let characters = frame.len();
    frame.truncate(characters.saturating_sub(2));
    SlaveRequest { message: frame, characters }
}

/// Collects the bytes of RTU up to the next silence.
#[derive(Debug, Clone, Default)]
pub struct Receiver {
    bytes: Vec<u8>,
}

impl Receiver {
    /// Adds bytes as they arrive. What is longer than any frame is none, however it goes on.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
        self.bytes.truncate(BYTES_MAX + 1);
    }

    /// The line was silent: what is here is one request with a right check, or rubbish.
    pub fn on_silent_interval(&mut self) -> Option<Vec<u8>> {
        let is_whole = self.is_whole();
        let frame = std::mem::take(&mut self.bytes);
        is_whole.then_some(frame)
    }

    /// Whether nothing waits for the silence.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Whether it is a request with a right check, if the line is silent from now on.
    pub fn is_whole(&self) -> bool {
        (4..=BYTES_MAX).contains(&self.bytes.len()) && crc16(&self.bytes) == 0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bus::frame::with_crc;

    const READ: &[u8] = &[1, 3, 3, 0xEA, 0, 1];

    proptest! {
        #[test]
        fn a_frame_is_what_comes_between_two_silences(
            message in prop::collection::vec(any::<u8>(), 2..255),
            cuts in prop::collection::vec(1_usize..20, 1..40),
        ) {
            let (mut receiver, frame) = (Receiver::default(), with_crc(&message));
            let mut rest = &frame[..];
            for cut in cuts.iter().cycle() {
                let (now, later) = rest.split_at((*cut).min(rest.len()));
                receiver.push(now);
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert_eq!(receiver.on_silent_interval(), Some(frame));
            prop_assert!(receiver.is_empty());
        }

        #[test]
        fn rubbish_is_forgotten_at_the_next_silence(rubbish in prop::collection::vec(any::<u8>(), 0..1200)) {
            let mut receiver = Receiver::default();
            receiver.push(&rubbish);
            receiver.on_silent_interval();
            receiver.push(&with_crc(READ));
            prop_assert_eq!(receiver.on_silent_interval(), Some(with_crc(READ)));
        }
    }

    #[test]
    fn what_is_sent_without_a_silence_is_no_request() {
        let (read, corrupt) = (with_crc(READ), [1, 3, 3, 0xEA, 0, 1, 0, 0]);
        let long = with_crc(&[2; 255]);
        for frames in [[&read[..], &read].concat(), [&read[..], &[7]].concat(), [&corrupt[..], &read].concat(), long] {
            let mut receiver = Receiver::default();
            receiver.push(&frames);
            assert_eq!(receiver.on_silent_interval(), None, "{frames:02X?}");
            assert!(receiver.is_empty());
        }
    }
}
