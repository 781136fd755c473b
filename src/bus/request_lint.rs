//! What is wrong with a request before it is sent: counts, addresses, values and lengths that no device can take.

use super::{frame, names};
use crate::plant::line::Framing;

/// Why a request should not be sent. Raw bytes can still be sent with an explicit override.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// Not even unit and function.
    #[error("{bytes}, expected unit and function at least", bytes = names::counted(*.0, "byte"))]
    TooShort(usize),
    /// Longer than 254 bytes of unit and PDU.
    #[error("{0} bytes of unit and PDU, at most 254 are allowed")]
    TooLong(usize),
    /// A unit that no device on a serial line has.
    #[error("unit {0} is reserved on serial lines, expected 1–247, or 0 for a broadcast")]
    Unit(u8),
    /// A broadcast that wants an answer.
    #[error("no unit answers a broadcast: unit 0 takes writes only")]
    ReadFromAll,
    /// An exception cannot be asked for.
    #[error("function {0} / 0x{0:02X} is an exception, no request")]
    Exception(u8),
    /// Fewer or more bytes than the function has.
    #[error("{got} bytes of unit and PDU, function {function} / 0x{function:02X} has {expected}")]
    Length {
        /// Function.
        function: u8,
        /// As typed.
        got: usize,
        /// As the standard has it.
        expected: usize,
    },
    /// A count of none or of more than the function can do.
    #[error("count {got} {what}, expected 1–{most}")]
    Count {
        /// `to read` or `to write`.
        what: &'static str,
        /// As typed.
        got: u16,
        /// The limit of the function.
        most: u16,
    },
    /// The block runs past the last address.
    #[error("{what}: {count} from address {address} / 0x{address:04X} run past 65535 / 0xFFFF")]
    PastTheEnd {
        /// `to read` or `to write`.
        what: &'static str,
        /// First wire address.
        address: u16,
        /// As typed.
        count: u16,
    },
    /// The byte count does not fit the count.
    #[error("byte count says {got}, {count} {what} take {expected}")]
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
    #[error("coil value {0:04X}, expected FF00 (on) or 0000 (off)")]
    CoilValue(u16),
    /// A function that the standard does not know.
    #[error("function {0} / 0x{0:02X} is not in the standard")]
    Unknown(u8),
}

/// Everything that is wrong with a request message (unit and PDU) before it is sent.
pub fn check_request(message: &[u8], framing: Framing) -> Vec<RequestError> {
    let &[unit, function, ..] = message else { return vec![RequestError::TooShort(message.len())] };
    let mut errors = Vec::new();
    if frame::MESSAGE_MAX < message.len() {
        errors.push(RequestError::TooLong(message.len()));
    }
    if framing != Framing::Mbap {
        match unit {
            0 if !is_write(function) => errors.push(RequestError::ReadFromAll),
            0..=247 => {}
            248..=255 => errors.push(RequestError::Unit(unit)),
        }
    }
    if 0x80 <= function {
        errors.push(RequestError::Exception(function));
    } else if names::function(function).is_none() {
        errors.push(RequestError::Unknown(function));
    } else if let Some(expected) = request_length(message).filter(|expected| *expected != message.len()) {
        errors.push(RequestError::Length { function, got: message.len(), expected });
    }
    errors.extend(check_data(message, function));
    errors
}

fn is_write(function: u8) -> bool {
    matches!(function, 0x05 | 0x06 | 0x08 | 0x0F | 0x10 | 0x15 | 0x16)
}

/// Length of a request message, as its function and counts say; `None` if they do not tell.
fn request_length(message: &[u8]) -> Option<usize> {
    let counted = |at: usize| Some(at + 1 + usize::from(*message.get(at)?));
    match message.get(1)? {
        0x01..=0x06 => Some(6),
        0x07 | 0x0B | 0x0C | 0x11 => Some(2),
        0x0F | 0x10 => counted(6).or(Some(7)),
        0x14 | 0x15 => counted(2).or(Some(3)),
        0x16 => Some(8),
        0x17 => counted(10).or(Some(11)),
        0x18 => Some(4),
        _ => None,
    }
}

/// Counts, addresses and values, as far as they are there.
fn check_data(message: &[u8], function: u8) -> Vec<RequestError> {
    let word = |at: usize| Some(u16::from_be_bytes([*message.get(at)?, *message.get(at + 1)?]));
    let block = |at: usize, what: &'static str, most: u16| {
        let (Some(address), Some(count)) = (word(at), word(at + 2)) else { return Vec::new() };
        let range = (!(1..=most).contains(&count)).then_some(RequestError::Count { what, got: count, most });
        let past = 0x1_0000 < u32::from(address) + u32::from(count);
        range.into_iter().chain(past.then_some(RequestError::PastTheEnd { what, address, count })).collect()
    };
    let bytes = |at: usize, what: &'static str, count: Option<u16>| {
        let (&got, count) = (message.get(at)?, count?);
        let expected = if what == "coils" { usize::from(count).div_ceil(8) } else { 2 * usize::from(count) };
        (usize::from(got) != expected).then_some(RequestError::ByteCount { got, count, what, expected })
    };
    match function {
        0x01 | 0x02 => block(2, "to read", 2000),
        0x03 | 0x04 => block(2, "to read", 125),
        0x05 => word(4).filter(|value| !matches!(value, 0 | 0xFF00)).map(RequestError::CoilValue).into_iter().collect(),
        0x0F => block(2, "to write", 1968).into_iter().chain(bytes(6, "coils", word(4))).collect(),
        0x10 => block(2, "to write", 123).into_iter().chain(bytes(6, "registers", word(4))).collect(),
        0x17 => {
            let blocks = block(2, "to read", 125).into_iter().chain(block(6, "to write", 121));
            blocks.chain(bytes(10, "registers", word(8))).collect()
        }
        _ => Vec::new(),
    }
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
        says(&[0, 3, 0, 0, 0, 1], &["no unit answers a broadcast: unit 0 takes writes only"]);
        says(&[0, 6, 0, 0, 0, 1], &[]);
        says(&[248, 6, 0, 0, 0, 1], &["unit 248 is reserved on serial lines, expected 1–247, or 0 for a broadcast"]);
        says(&[1, 1, 0, 0, 0x07, 0xD0], &[]);
        says(&[1, 1, 0, 0, 0x07, 0xD1], &["count 2001 to read, expected 1–2000"]);
        says(&[1, 3, 0, 0, 0, 125], &[]);
        says(&[1, 3, 0, 0, 0, 126], &["count 126 to read, expected 1–125"]);
        says(&[1, 4, 0, 0, 0, 0], &["count 0 to read, expected 1–125"]);
        says(&[1, 3, 0xFF, 0xFF, 0, 1], &[]);
        says(&[1, 3, 0xFF, 0xFF, 0, 2], &["to read: 2 from address 65535 / 0xFFFF run past 65535 / 0xFFFF"]);
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
        says(&[1], &["1 byte, expected unit and function at least"]);
        says(&[1, 0x83, 2], &["function 131 / 0x83 is an exception, no request"]);
        says(&[1, 0x41, 2], &["function 65 / 0x41 is not in the standard"]);
        assert_eq!(check_request(&[0, 3, 0, 0, 0, 1], Framing::Mbap), []);
        assert_eq!(check_request(&[255, 3, 0, 0, 0, 1], Framing::Mbap), []);
    }
}
