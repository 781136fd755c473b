//! Modbus ASCII as a slave receives it: characters become requests.

use crate::bus::ascii::{self, FRAME_MAX};

/// A request as a slave found it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlaveRequest {
    /// Unit and PDU, without the check.
    pub message: Vec<u8>,
    /// How many characters it took on the wire.
    pub characters: usize,
}

/// Collects characters and cuts whole requests with a right check out of them.
#[derive(Debug, Clone)]
pub struct Receiver {
    /// A UART with seven data bits never delivers an eighth.
    mask: u8,
    /// From `:` on.
    frame: Vec<u8>,
    /// What is complete but not taken yet: `None` if it could not be read.
    done: Vec<Option<SlaveRequest>>,
}

impl Receiver {
    /// For 7 or 8 data bits.
    pub fn new(data_bits: u8) -> Receiver {
        Receiver { mask: if data_bits == 7 { 0x7F } else { 0xFF }, frame: Vec::new(), done: Vec::new() }
    }

    /// Adds characters as they arrive. What stands before a `:` is dropped; a `:` inside begins a new message.
    pub fn push(&mut self, characters: &[u8]) {
        for character in characters {
            let character = character & self.mask;
            match character {
                b':' => {
                    self.break_off();
                    self.frame.push(b':');
                }
                _ if self.frame.is_empty() => {}
                b'\n' if self.frame.ends_with(b"\r") => {
                    self.frame.push(b'\n');
                    let message = ascii::open(&self.frame).ok();
                    self.done.push(message.map(|message| SlaveRequest { message, characters: self.frame.len() }));
                    self.frame.clear();
                }
                _ if self.frame.len() >= FRAME_MAX => self.break_off(),
                _ => self.frame.push(character),
            }
        }
    }

    /// The next frame that ended: a request, or `None` in its place if it could not be read.
    pub fn take(&mut self) -> Option<Option<SlaveRequest>> {
        (!self.done.is_empty()).then(|| self.done.remove(0))
    }

    /// The line was silent for longer than characters of a frame may be apart: what has come of it is lost.
    pub fn on_silent_interval(&mut self) {
        self.break_off();
    }

    /// Whether nothing waits for its rest.
    pub fn is_empty(&self) -> bool {
        self.frame.is_empty()
    }

    fn break_off(&mut self) {
        if !self.frame.is_empty() {
            self.frame.clear();
            self.done.push(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn check(data_bits: u8, heard: &[u8], expect: &[Option<&[u8]>]) {
        let mut receiver = Receiver::new(data_bits);
        receiver.push(heard);
        let taken: Vec<_> = std::iter::from_fn(|| receiver.take()).map(|it| it.map(|it| it.message)).collect();
        let taken: Vec<_> = taken.iter().map(Option::as_deref).collect();
        assert_eq!(taken, expect, "heard {}", String::from_utf8_lossy(heard));
    }

    const READ: &[u8] = &[0x11, 3, 0, 0x6B, 0, 3];

    #[test]
    fn requests_are_read_and_corrupt_ones_noticed() {
        check(8, b":1103006B00037E\r\n", &[Some(READ)]);
        check(8, b":1103006b00037e\r\n", &[Some(READ)]);
        check(8, b"\xFF\x00noise:1103006B00037E\r\n", &[Some(READ)]);
        check(8, b":1103:1103006B00037E\r\n:1103006B00037E\r\n", &[None, Some(READ), Some(READ)]);
        check(8, b":1103006B00037F\r\n", &[None]);
        check(8, b":1103006B0003 7E\r\n", &[None]);
        check(8, b":1103006B0003E\r\n", &[None]);
        check(8, b":\r\n", &[None]);
        check(8, b"1103006B00037E\r\n", &[]);
        check(8, b":1103006B00037E\n", &[]);
    }

    #[test]
    fn the_eighth_bit_counts_only_where_there_is_one() {
        let parity: Vec<u8> = b":1103006B00037E\r\n".iter().map(|character| character | 0x80).collect();
        check(7, &parity, &[Some(READ)]);
        check(8, &parity, &[]);
    }

    proptest! {
        #[test]
        fn what_is_spelled_is_read(message in prop::collection::vec(any::<u8>(), 2..254)) {
            check(7, &ascii::encode(&message), &[Some(&message)]);
        }

        #[test]
        fn rubbish_is_bounded_and_forgotten(rubbish in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut receiver = Receiver::new(8);
            receiver.push(&rubbish);
            prop_assert!(receiver.frame.len() <= FRAME_MAX);
            receiver.on_silent_interval();
            prop_assert!(receiver.is_empty());
            while receiver.take().is_some() {}
            receiver.push(&ascii::encode(READ));
            prop_assert_eq!(receiver.take().flatten().map(|it| it.message), Some(READ.to_vec()));
        }
    }
}
