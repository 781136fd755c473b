//! What is wrong with a request before it is sent: counts, addresses, values and lengths that no device can take.

use super::{
    frame,
    names::{self, Counted},
    pdu::{self, Item, Length},
};
use crate::{plant::line::Framing, t, text::translate};

/// Why a request should not be sent. Raw bytes can still be sent with an explicit override.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// Not even unit and function.
    #[error("{}", t!("{bytes}, expected unit and function at least", bytes = names::counted(*.0, Counted::Bytes)))]
    TooShort(usize),
    /// Longer than 254 bytes of unit and PDU.
    #[error("{}", t!("{count} bytes of unit and PDU, at most 254 are allowed", count = .0))]
    TooLong(usize),
    /// A unit that no device on a serial line has.
    #[error("{}", t!("unit {unit} is reserved on serial lines, expected 1–247, or 0 for a broadcast", unit = .0))]
    Unit(u8),
    /// A broadcast that wants an answer.
    #[error("{}", t!("no unit responds to a broadcast: unit 0 accepts writes only"))]
    ReadFromAll,
    /// An exception cannot be asked for.
    #[error("{}", t!("function {code} is an exception, not a request", code = names::code(*.0)))]
    Exception(u8),
    /// Fewer or more bytes than the function has.
    #[error("{}", t!("{got} bytes of unit and PDU, function {code} has {expected}", got = .got, code = names::code(*.function), expected = .expected))]
    Length {
        /// Function.
        function: u8,
        /// As typed.
        got: usize,
        /// As the standard has it.
        expected: usize,
    },
    /// A count of none or of more than the function can do.
    #[error("{}", t!("count {got} {what}, expected 1–{most}", got = .got, what = translate(.what), most = .most))]
    Count {
        /// `to read` or `to write`.
        what: &'static str,
        /// As typed.
        got: u16,
        /// The limit of the function.
        most: u16,
    },
    /// The block runs past the last address.
    #[error("{}", t!("{what}: {count} from address {address} / 0x{hex} extend past 65535 / 0xFFFF", what = translate(.what), count = .count, address = .address, hex = format!("{:04X}", .address)))]
    PastTheEnd {
        /// `to read` or `to write`.
        what: &'static str,
        /// First wire address.
        address: u16,
        /// As typed.
        count: u16,
    },
    /// The byte count does not fit the count.
    #[error("{}", t!("byte count says {got}, {count} {what} take {expected}", got = .got, count = .count, what = translate(.what), expected = .expected))]
    ByteCount {
        /// As typed.
        got: u8,
        /// Bits or registers.
        count: u16,
        /// `coils` or `registers`.
        what: &'static str,
        /// What fits.
        expected: usize,
    },
    /// Neither on nor off.
    #[error("{}", coil_value_words(*.0))]
    CoilValue(u16),
    /// A function that the standard does not know.
    #[error("{}", t!("function {code} is not in the standard", code = names::code(*.0)))]
    Unknown(u8),
}

/// A coil is neither on nor off.
pub(super) fn coil_value_words(value: u16) -> String {
    t!("coil value {value}, expected FF00 (on) or 0000 (off)", value = format!("{value:04X}"))
}

/// Does a request change nothing in a device? The reads, of diagnostics the echo and the counters, and of 2B the device
/// identification, because CANopen may write (V1.1b3, 6).
pub fn only_reads(message: &[u8]) -> bool {
    match (message.get(1), message.get(2..)) {
        (Some(0x08), Some([0, 0x00 | 0x02 | 0x0B..=0x12, ..])) => true,
        (Some(0x2B), data) => data.and_then(|data| data.first()) == Some(&0x0E),
        (Some(0x01..=0x04 | 0x07 | 0x0B | 0x0C | 0x11 | 0x14 | 0x18), _) => true,
        (Some(_) | None, _) => false,
    }
}

/// Everything that is wrong with a request message (unit and PDU) before it is sent.
pub fn check_request(message: &[u8], framing: Framing) -> Vec<RequestError> {
    let &[unit, function, ..] = message else { return vec![RequestError::TooShort(message.len())] };
    let (row, mut errors) = (pdu::function(function), Vec::new());
    if frame::MESSAGE_MAX < message.len() {
        errors.push(RequestError::TooLong(message.len()));
    }
    if framing != Framing::Mbap {
        let may_be_broadcast = |row: &pdu::Function| row.writes() || row.code == 0x08;
        match unit {
            0 if !row.is_some_and(may_be_broadcast) => errors.push(RequestError::ReadFromAll),
            0..=247 => {}
            248..=255 => errors.push(RequestError::Unit(unit)),
        }
    }
    if 0x80 <= function {
        errors.push(RequestError::Exception(function));
    } else if let Some(row) = row {
        let expected = expected_length(row, message).filter(|expected| *expected != message.len());
        errors.extend(expected.map(|expected| RequestError::Length { function, got: message.len(), expected }));
        errors.extend(check_data(message, row.request));
    } else {
        errors.push(RequestError::Unknown(function));
    }
    errors
}

/// Length of a request message, as its function and counts say; `None` where any length is right.
fn expected_length(row: &pdu::Function, message: &[u8]) -> Option<usize> {
    match pdu::request_length(message) {
        // Function 08 takes any data.
        Length::Known(_) if message.get(1) == Some(&0x08) => None,
        Length::Known(length) => Some(length),
        Length::TooEarly => Some(2 + row.request.iter().map(Item::size).sum::<usize>()),
        Length::BySilence => None,
    }
}

/// Counts, addresses and values, as far as they are there.
fn check_data(message: &[u8], items: &[Item]) -> Vec<RequestError> {
    let word = |at: usize| Some(u16::from_be_bytes([*message.get(at)?, *message.get(at + 1)?]));
    let (mut errors, mut at, mut address, mut count) = (Vec::new(), 2, None, None);
    for (index, item) in items.iter().enumerate() {
        match *item {
            Item::Address(_) => address = word(at),
            Item::Count { verb, most, .. } => {
                count = word(at);
                if let (Some(address), Some(count)) = (address, count) {
                    let out_of_range = !(1..=most).contains(&count);
                    errors.extend(out_of_range.then_some(RequestError::Count { what: verb, got: count, most }));
                    let past = 0x1_0000 < u32::from(address) + u32::from(count);
                    errors.extend(past.then_some(RequestError::PastTheEnd { what: verb, address, count }));
                }
            }
            Item::CoilState => {
                errors.extend(word(at).filter(|value| !matches!(value, 0 | 0xFF00)).map(RequestError::CoilValue));
            }
            Item::ByteCount => {
                let (Some(&got), Some(count)) = (message.get(at), count) else { continue };
                let (what, expected) = match items.get(index + 1) {
                    Some(Item::Bits) => (t!("coils"), usize::from(count).div_ceil(8)),
                    _ => (t!("registers"), 2 * usize::from(count)),
                };
                let wrong = usize::from(got) != expected;
                errors.extend(wrong.then_some(RequestError::ByteCount { got, count, what, expected }));
            }
            // Any value is right.
            Item::Register
            | Item::Byte(..)
            | Item::Word(..)
            | Item::OrMask
            | Item::Data
            | Item::WordCount
            | Item::FifoCount
            | Item::Bits
            | Item::Registers
            | Item::Events
            | Item::ServerId
            | Item::FileRequests
            | Item::FileWrites
            | Item::FileRecords
            | Item::MeiType
            | Item::NextObject
            | Item::Objects => {}
        }
        at += item.size();
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_that_must_not_be_sent_are_refused_in_clear_words() {
        let says = |message: &[u8], expect: &[&str]| {
            let words: Vec<String> = check_request(message, Framing::Rtu).iter().map(ToString::to_string).collect();
            assert_eq!(words, expect, "{}", frame::hex(message));
        };
        says(&[0, 3, 0, 0, 0, 1], &["no unit responds to a broadcast: unit 0 accepts writes only"]);
        says(&[0, 6, 0, 0, 0, 1], &[]);
        says(&[248, 6, 0, 0, 0, 1], &["unit 248 is reserved on serial lines, expected 1–247, or 0 for a broadcast"]);
        says(&[1, 1, 0, 0, 0x07, 0xD0], &[]);
        says(&[1, 1, 0, 0, 0x07, 0xD1], &["count 2001 to read, expected 1–2000"]);
        says(&[1, 3, 0, 0, 0, 125], &[]);
        says(&[1, 3, 0, 0, 0, 126], &["count 126 to read, expected 1–125"]);
        says(&[1, 4, 0, 0, 0, 0], &["count 0 to read, expected 1–125"]);
        says(&[1, 3, 0xFF, 0xFF, 0, 1], &[]);
        says(&[1, 3, 0xFF, 0xFF, 0, 2], &["to read: 2 from address 65535 / 0xFFFF extend past 65535 / 0xFFFF"]);
        says(&[1, 5, 0, 0, 0, 1], &["coil value 0001, expected FF00 (on) or 0000 (off)"]);
        says(&[1, 5, 0, 0, 0xFF, 0], &[]);
        says(&[1, 0x0F, 0, 0x13, 0, 0x0A, 2, 0xCD, 1], &[]);
        says(&[1, 0x0F, 0, 0x13, 0, 0x0A, 1, 0xCD], &["byte count says 1, 10 coils take 2"]);
        says(&[1, 0x10, 0, 1, 0, 2, 4, 0, 1, 0, 2], &[]);
        says(&[1, 0x10, 0, 1, 0, 2, 2, 0, 1], &["byte count says 2, 2 registers take 4"]);
        says(&[1, 0x10, 0, 1, 0, 2, 4, 0, 1], &["9 bytes of unit and PDU, function 16 / 0x10 has 11"]);
        says(&[1, 0x17, 0, 3, 0, 6, 0, 14, 0, 1, 2, 0, 255], &[]);
        says(
            &[1, 0x17, 0, 3, 0, 126, 0, 14, 0, 122, 244],
            &[
                "11 bytes of unit and PDU, function 23 / 0x17 has 255",
                "count 126 to read, expected 1–125",
                "count 122 to write, expected 1–121",
            ],
        );
        says(&[1, 3, 0, 0], &["4 bytes of unit and PDU, function 3 / 0x03 has 6"]);
        says(&[1, 0x10, 0, 1, 0, 2], &["6 bytes of unit and PDU, function 16 / 0x10 has 7"]);
        says(&[1], &["1 byte, expected unit and function at least"]);
        says(&[1, 0x83, 2], &["function 131 / 0x83 is an exception, not a request"]);
        says(&[1, 0x41, 2], &["function 65 / 0x41 is not in the standard"]);
        assert_eq!(check_request(&[0, 3, 0, 0, 0, 1], Framing::Mbap), []);
        assert_eq!(check_request(&[255, 3, 0, 0, 0, 1], Framing::Mbap), []);
    }
}
