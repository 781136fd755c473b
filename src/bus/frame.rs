//! Frames as bytes: checks, lengths, signatures, and whether an answer belongs to its request.
//!
//! A *message* is unit and PDU without any check: `01 03 03 EA 00 01`. RTU appends a CRC, TCP prepends the MBAP header.

mod answer;
mod mbap;

use super::{
    ascii,
    pdu::{self, Length},
};
use crate::plant::{def::Framing, fault::Fault, number::to_u16};

pub use answer::{
    Request, ResponseSignature, answers, begins_answer, check_answer, expected_length, response_signature,
};
pub use mbap::{Mbap, ShortException, is_out_of_sync, mbap, short_exception};

/// Longest message: unit and 253 bytes of PDU.
pub const MESSAGE_MAX: usize = 254;
/// Longest frame, an ASCII one: two characters for each byte of message and LRC, a colon, the end of the line.
pub const FRAME_MAX: usize = 2 * (MESSAGE_MAX + 1) + 3;

/// CRC-16 of Modbus RTU (polynomial 0xA001 reflected, start 0xFFFF); sent low byte first.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 })
    })
}

/// Appends the CRC to a message.
pub fn with_crc(message: &[u8]) -> Vec<u8> {
    let mut frame = message.to_vec();
    frame.extend_from_slice(&crc16(message).to_le_bytes());
    frame
}

/// The message of an RTU frame, if its CRC fits.
pub fn without_crc(frame: &[u8]) -> Result<&[u8], Fault> {
    let Some((message, check)) = frame.split_last_chunk::<2>() else {
        return Err(Fault::Truncated { got: to_u16(frame.len()), expected: 4 });
    };
    let (got, computed) = (u16::from_le_bytes(*check), crc16(message));
    if got == computed { Ok(message) } else { Err(Fault::Crc { got, computed }) }
}

/// Prepends the MBAP header: transaction, protocol 0, length, then the message.
pub fn with_mbap(transaction: u16, message: &[u8]) -> Vec<u8> {
    let mut frame = Vec::with_capacity(6 + message.len());
    frame.extend_from_slice(&transaction.to_be_bytes());
    frame.extend_from_slice(&[0, 0]);
    frame.extend_from_slice(&to_u16(message.len()).to_be_bytes());
    frame.extend_from_slice(message);
    frame
}

/// A message as a frame of a line; only MBAP uses the transaction.
pub fn wrap(framing: Framing, transaction: u16, message: &[u8]) -> Vec<u8> {
    match framing {
        Framing::Rtu => with_crc(message),
        Framing::Ascii => ascii::encode(message),
        Framing::Mbap => with_mbap(transaction, message),
    }
}

/// The message of a whole frame, if its check fits.
pub fn unwrap(framing: Framing, frame: &[u8]) -> Result<Vec<u8>, Fault> {
    match framing {
        Framing::Rtu => without_crc(frame).map(<[u8]>::to_vec),
        Framing::Ascii => ascii::open(frame),
        Framing::Mbap => match mbap(frame) {
            Mbap::Whole { end, .. } => Ok(frame[6..end].to_vec()),
            Mbap::Incomplete => {
                let length = frame.get(4..6).map_or(2, |length| u16::from_be_bytes([length[0], length[1]]));
                Err(Fault::Truncated { got: to_u16(frame.len()), expected: length.saturating_add(6) })
            }
            Mbap::Broken => Err(Fault::NoHeader),
        },
    }
}

/// Characters on the wire for a message of this length.
pub fn wrapped_length(framing: Framing, message: usize) -> usize {
    match framing {
        Framing::Rtu => message + 2,
        Framing::Ascii => 2 * message + 5,
        Framing::Mbap => message + 6,
    }
}

/// The unit that a frame, or the beginning of one, names.
pub fn unit_of(framing: Framing, frame: &[u8]) -> Option<u8> {
    match framing {
        Framing::Rtu => frame.first().copied(),
        Framing::Ascii => u8::from_str_radix(std::str::from_utf8(frame.get(1..3)?).ok()?, 16).ok(),
        Framing::Mbap => frame.get(6).copied(),
    }
}

/// An unsolicited message with a good check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Unsolicited {
    /// A response of a unit, by its length.
    Response(Vec<u8>),
    /// A request of another master.
    Request(Vec<u8>),
}

/// The whole good frames among unsolicited bytes, on lines without transaction ids.
pub(crate) fn unsolicited(framing: Framing, bytes: &[u8]) -> Vec<Unsolicited> {
    let classify = |message: &[u8]| match message.len() {
        length if pdu::response_length(message) == Length::Known(length) => {
            Some(Unsolicited::Response(message.to_vec()))
        }
        length if pdu::request_length(message) == Length::Known(length) => Some(Unsolicited::Request(message.to_vec())),
        _ => None,
    };
    match framing {
        Framing::Mbap => Vec::new(),
        Framing::Ascii => ascii::messages(bytes).filter_map(|message| classify(&message)).collect(),
        Framing::Rtu => {
            let (mut found, mut rest) = (Vec::new(), bytes);
            while !rest.is_empty() {
                let lengths = [pdu::response_length(rest).known(), pdu::request_length(rest).known()];
                let whole = |length: &usize| rest.get(..length + 2).is_some_and(|frame| without_crc(frame).is_ok());
                let length = lengths.into_iter().flatten().find(whole);
                found.extend(length.and_then(|length| classify(&rest[..length])));
                rest = &rest[length.map_or(1, |length| length + 2)..];
            }
            found
        }
    }
}

/// `01 03 03 EA`.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::plant::fault::ExceptionCode;

    #[test]
    fn the_check_value_of_the_standard() {
        assert_eq!(crc16(b"123456789"), 0x4B37);
        assert_eq!(with_crc(&[0x01, 0x06, 0x03, 0xEA, 0x00, 0x32]), [0x01, 0x06, 0x03, 0xEA, 0x00, 0x32, 0x29, 0xAF]);
    }

    /// Rows of the published examples: kind, message, CRC as sent.
    fn vectors() -> Vec<(String, String, Vec<u8>, String)> {
        let mut rows = csv::Reader::from_reader(include_str!("../../tests/vectors/frames.csv").as_bytes());
        rows.records()
            .map(|row| {
                let row = row.unwrap();
                let bytes = row[3].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
                (row[0].to_owned(), row[1].to_owned(), bytes, row[4].replace(' ', ""))
            })
            .collect()
    }

    #[test]
    fn every_published_frame_has_its_check_and_its_length() {
        let mut seen = 0;
        for (id, kind, message, crc) in vectors() {
            if crc.is_empty() {
                continue;
            }
            let check: String = crc16(&message).to_le_bytes().iter().map(|byte| format!("{byte:02X}")).collect();
            assert_eq!(check, crc, "{id}");
            assert_eq!(without_crc(&with_crc(&message)), Ok(&message[..]), "{id}");
            if kind == "response" || kind == "exception" {
                assert_eq!(pdu::response_length(&message), Length::Known(message.len()), "{id}");
            }
            if kind == "request" {
                assert_eq!(pdu::request_length(&message), Length::Known(message.len()), "{id}");
            }
            seen += 1;
        }
        assert_eq!(seen, 23);
    }

    #[test]
    fn every_published_answer_belongs_to_its_request_only() {
        let rows = vectors();
        let of = |wanted: &'static str| rows.iter().filter(move |row| row.1 == wanted);
        for (id, _, answer, _) in of("response") {
            for (other, _, request, _) in of("request") {
                let verdict = check_answer(Framing::Rtu, request, answer);
                assert_eq!(verdict.is_ok(), id == other, "{id} as an answer to {other}: {verdict:?}");
            }
        }
        let (_, _, request, _) = of("request").find(|row| row.0 == "illegal-address").unwrap();
        let (_, _, exception, _) = of("exception").next().unwrap();
        assert_eq!(check_answer(Framing::Rtu, request, exception), Err(Fault::Exception(ExceptionCode(2))));
    }

    #[test]
    fn lists_of_identification_objects_are_measured() {
        let answer = [1, 0x2B, 0x0E, 1, 1, 0, 0, 2, 0, 3, b'a', b'b', b'c', 1, 1, b'x'];
        assert_eq!(pdu::response_length(&answer), Length::Known(answer.len()));
        assert_eq!(pdu::response_length(&answer[..9]), Length::TooEarly);
    }
}
