//! Requests on a serial line as a slave finds them: by the length that the function tells, by silence where it does not.

use super::ascii;
use crate::bus::{
    frame::crc16,
    pdu::{self, Length},
};

/// Twice the longest frame of a serial line (Modbus serial line V1.02, 2.5.1): one whole and the beginning of a next.
const BYTES_MAX: usize = 2 * 256;

/// A request as a slave found it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlaveRequest {
    /// Unit and PDU, without the check.
    pub message: Vec<u8>,
    /// How many characters it took on the wire.
    pub characters: usize,
}

/// Collects received characters into requests.
#[derive(Debug, Clone)]
pub enum FrameReceiver {
    /// For RTU.
    Rtu(Receiver),
    /// For ASCII.
    Ascii(ascii::Receiver),
}

impl FrameReceiver {
    /// For RTU, or for ASCII with so many data bits.
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

    /// The next thing that is complete: a request, or `None` in its place if it could not be read.
    pub fn take(&mut self) -> Option<Option<SlaveRequest>> {
        match self {
            FrameReceiver::Rtu(receiver) => receiver.take().map(|frame| Some(request(frame))),
            FrameReceiver::Ascii(receiver) => receiver.take(),
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

/// Collects the bytes of RTU and cuts whole frames with a right check out of them.
#[derive(Debug, Clone, Default)]
pub struct Receiver {
    bytes: Vec<u8>,
    lost: bool,
}

impl Receiver {
    /// Adds bytes as they arrive. Once the place of a frame is lost, everything up to the next silence is thrown away.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
        self.lost |= self.bytes.len() > BYTES_MAX;
        if self.lost {
            self.bytes.truncate(1);
        }
    }

    /// The next request that is complete by its length.
    pub fn take(&mut self) -> Option<Vec<u8>> {
        match self.length() {
            Length::Known(length) if !self.lost && self.bytes.len() >= length => {
                self.lost = crc16(&self.bytes[..length]) != 0;
                (!self.lost).then(|| self.bytes.drain(..length).collect())
            }
            Length::Known(_) | Length::TooEarly | Length::BySilence => None,
        }
    }

    /// The line was silent: what is here is one whole request, or rubbish.
    pub fn on_silent_interval(&mut self) -> Option<Vec<u8>> {
        let (frame, lost) = (std::mem::take(&mut self.bytes), std::mem::take(&mut self.lost));
        (!lost && frame.len() >= 4 && crc16(&frame) == 0).then_some(frame)
    }

    /// Whether nothing waits for its rest.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Length of the request with its check.
    fn length(&self) -> Length {
        match pdu::request_length(&self.bytes) {
            Length::Known(length) if self.bytes.get(1) != Some(&0x08) => Length::Known(length + 2),
            // An echo may be of any length; with two bytes of data, as is usual, the check fits here.
            Length::Known(length) => match self.bytes.get(..length + 2).map(crc16) {
                Some(0) | None => Length::Known(length + 2),
                Some(_) => Length::BySilence,
            },
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bus::frame::with_crc;

    fn requests() -> Vec<Vec<u8>> {
        let messages: [&[u8]; 8] = [
            &[1, 3, 3, 0xEA, 0, 1],
            &[2, 15, 12, 0, 0, 9, 2, 0xFF, 1],
            &[1, 16, 3, 0xED, 0, 2, 4, 0, 50, 0, 0],
            &[2, 0x11],
            &[2, 0x18, 4, 0],
            &[2, 8, 0, 0, 0xA5, 0x37],
            &[2, 0x2B, 14, 1, 0],
            &[2, 0x17, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0],
        ];
        messages.iter().map(|message| with_crc(message)).collect()
    }

    fn take_all(receiver: &mut Receiver) -> Vec<Vec<u8>> {
        std::iter::from_fn(|| receiver.take()).collect()
    }

    proptest! {
        #[test]
        fn requests_are_found_however_they_are_cut(cuts in prop::collection::vec(1_usize..20, 1..40)) {
            let stream = requests().concat();
            let (mut receiver, mut found, mut rest) = (Receiver::default(), Vec::new(), &stream[..]);
            for cut in cuts.iter().cycle() {
                let (now, later) = rest.split_at((*cut).min(rest.len()));
                receiver.push(now);
                found.extend(take_all(&mut receiver));
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert_eq!(found, requests());
            prop_assert!(receiver.is_empty());
        }

        #[test]
        fn rubbish_is_forgotten_at_the_next_silence(rubbish in prop::collection::vec(any::<u8>(), 0..1200)) {
            let mut receiver = Receiver::default();
            receiver.push(&rubbish);
            take_all(&mut receiver);
            receiver.on_silent_interval();
            receiver.push(&requests()[0]);
            prop_assert_eq!(receiver.take(), Some(requests()[0].clone()));
        }
    }

    #[test]
    fn a_wrong_check_corrupts_everything_up_to_the_silence() {
        let mut receiver = Receiver::default();
        receiver.push(&[1, 3, 3, 0xEA, 0, 1, 0, 0]);
        assert_eq!(receiver.take(), None);
        receiver.push(&requests()[0]);
        assert_eq!(receiver.take(), None);
        assert_eq!(receiver.on_silent_interval(), None);
        receiver.push(&requests()[0]);
        assert_eq!(receiver.take(), Some(requests()[0].clone()));
    }

    #[test]
    fn a_request_of_unknown_length_ends_with_the_silence() {
        for message in [&[1, 0x42, 14, 1, 0][..], &[2, 8, 0, 0, 1, 2, 3, 4, 5], &[2, 0x2B, 13, 1, 2, 3]] {
            let (mut receiver, frame) = (Receiver::default(), with_crc(message));
            receiver.push(&frame);
            assert_eq!(receiver.take(), None);
            assert_eq!(receiver.on_silent_interval(), Some(frame));
        }
    }
}
