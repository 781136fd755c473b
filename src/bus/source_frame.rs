//! Where the number of a tag stands in the answer that brought it, and what to do about an answer that did not.

use std::ops::Range;

use super::{codec, dissect::message_of, names};
use crate::plant::{
    exact::Exact,
    fault::Fault,
    line::Framing,
    tag::{DataType, Point},
    traffic::Exchange,
};

/// The part of an answer that is one tag's.
#[derive(Debug, Clone, PartialEq)]
pub struct TagBytes {
    /// Its place in the answer as it was on the wire (characters of an ASCII frame). A bit has its whole byte.
    pub range: Range<usize>,
    /// Its words as they came; of a bit: 0 or 1.
    pub words: Vec<u16>,
    /// The number they mean, if they mean one.
    pub raw: Option<Exact>,
}

/// Looks a tag up in an exchange; `None` if the answer does not hold it.
pub fn find(point: Point, exchange: &Exchange) -> Option<TagBytes> {
    match exchange.outcome {
        Ok(()) | Err(Fault::NotANumber) => {}
        Err(_) => return None,
    }
    let request = message_of(&exchange.request, exchange.framing)?;
    let answer = message_of(&exchange.answer, exchange.framing)?;
    let function = point.table.read_fc();
    if request.get(1) != Some(&function) || answer.get(1) != Some(&function) {
        return None;
    }
    let word = |at: usize| Some(u16::from_be_bytes([*request.get(at)?, *request.get(at + 1)?]));
    let offset = usize::from(point.address.checked_sub(word(2)?)?);
    if usize::from(word(4)?) < offset + usize::from(point.len()) {
        return None;
    }
    // Unit, function and byte count come first.
    let (first, bytes) = match point.table.is_bits() {
        true => (3 + offset / 8, 1),
        false => (3 + 2 * offset * usize::from(point.kind.address_words()), 2 * usize::from(point.words())),
    };
    let own = answer.get(first..first + bytes)?;
    let words: Vec<u16> = match point.table.is_bits() {
        true => vec![u16::from(own[0] >> (offset % 8) & 1)],
        false => own.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect(),
    };
    let raw = match point.table.is_bits() {
        true => codec::decode(Point { kind: DataType::Bool, field: None, ..point }, &words),
        false => codec::decode(point, &words),
    };
    let (start, step) = match exchange.framing {
        Framing::Rtu => (0, 1),
        Framing::Ascii => (1, 2),
        Framing::Mbap => (6, 1),
    };
    Some(TagBytes { range: start + step * first..start + step * (first + bytes), words, raw })
}

/// What a technician does about a fault, most likely first.
pub fn advice(fault: Fault) -> &'static str {
    match fault {
        Fault::Timeout => {
            "check supply, cable and unit address of the device, then baud rate, parity and mode of the line (c), then its timeout"
        }
        Fault::Crc { .. } | Fault::Lrc { .. } | Fault::NotHex(_) | Fault::Truncated { .. } => {
            "check parity and baud rate, wires A and B, terminators at both ends and noise; check for a duplicate address"
        }
        Fault::WrongUnit { .. } => {
            "another unit answered: check the unit address of the device, for a gateway that changes it, and for a second master"
        }
        Fault::WrongFunction { .. } | Fault::WrongLength { .. } | Fault::WrongEcho => {
            "response to another request: increase the timeout of the line (c), check for a second master or a duplicate address"
        }
        Fault::WrongTransaction { .. } => {
            "the device does not repeat the transaction id of a request: update its firmware, or use rtu-over-tcp if it can"
        }
        Fault::Hangup => {
            "the device cannot answer this request: check address and count of the block, lower read_registers_max or gap_registers_max"
        }
        Fault::NoHeader => {
            "check the mode of the line (tcp, or rtu-over-tcp for a serial gateway), the TCP port, then the gateway"
        }
        Fault::OutOfSync => {
            "check for a second master on the line, a duplicate address, or a repeater that repeats each response"
        }
        Fault::NotANumber => {
            "the registers were received correctly but do not hold a value of this type: check type, word order and address in the profile"
        }
        Fault::Exception(code) => names::advice(code.0),
        Fault::NotConnected => "check that the port or host exists and that no other program uses it; settings: c",
        Fault::BackedOff => "it is retried at growing intervals; find out why it stopped responding",
        Fault::NotHeard => {
            "check wires A and B, ground and position of the tap: the other master hears more than this port"
        }
        Fault::Unproven => "wait until the other master reads it again",
    }
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::{
        bus::frame,
        plant::tag::{ByteOrder, Table},
    };

    fn exchange(framing: Framing, request: &[u8], answer: &[u8]) -> Exchange {
        Exchange {
            at: Timestamp::UNIX_EPOCH,
            framing,
            request: frame::wrap(framing, 7, request).into(),
            answer: frame::wrap(framing, 7, answer).into(),
            outcome: Ok(()),
            response_time: None,
            tries: 1,
        }
    }

    fn point(table: Table, address: u16, kind: DataType) -> Point {
        Point { table, address, kind, order: ByteOrder::Abcd, field: None }
    }

    /// Three registers from 1000: 724, and 230.2 V as a float.
    const ASKED: [u8; 6] = [1, 3, 0x03, 0xE8, 0, 3];
    const CAME: [u8; 9] = [1, 3, 6, 0x02, 0xD4, 0x43, 0x66, 0x33, 0x33];

    #[test]
    fn the_bytes_of_a_value_are_found_in_every_framing() {
        for (framing, range) in [(Framing::Rtu, 5..9), (Framing::Ascii, 11..19), (Framing::Mbap, 11..15)] {
            let exchange = exchange(framing, &ASKED, &CAME);
            let found = find(point(Table::Holding, 1_001, DataType::F32), &exchange).expect("it is there");
            assert_eq!(found.range, range, "{framing:?}");
            assert_eq!(found.words, [0x4366, 0x3333]);
            assert_eq!(found.raw, Some(f64::from(230.2f32).into()));
            let of_wire = &exchange.answer[found.range];
            let expect: &[u8] = if framing == Framing::Ascii { b"43663333" } else { &[0x43, 0x66, 0x33, 0x33] };
            assert_eq!(of_wire, expect);
        }
    }

    #[test]
    fn what_is_not_in_the_answer_is_not_found_in_it() {
        let check = |point: Point, exchange: &Exchange| assert_eq!(find(point, exchange), None);
        let read = exchange(Framing::Rtu, &ASKED, &CAME);
        check(point(Table::Holding, 999, DataType::U16), &read);
        check(point(Table::Holding, 1_003, DataType::U16), &read);
        check(point(Table::Holding, 1_002, DataType::F32), &read);
        check(point(Table::Input, 1_000, DataType::U16), &read);
        let refused = Exchange {
            outcome: Err(Fault::Exception(crate::plant::fault::ExceptionCode(2))),
            ..exchange(Framing::Rtu, &ASKED, &[1, 0x83, 2])
        };
        check(point(Table::Holding, 1_000, DataType::U16), &refused);
        check(point(Table::Holding, 1_000, DataType::U16), &Exchange { answer: [].into(), ..read });
    }

    #[test]
    fn an_address_of_32_bits_is_found_by_its_own_count() {
        let came = [1, 3, 8, 0, 0, 0, 7, 0x43, 0x66, 0x33, 0x33];
        let exchange = exchange(Framing::Rtu, &[1, 3, 0x1B, 0x59, 0, 2], &came);
        let found = find(point(Table::Holding, 7_002, DataType::EnronF32), &exchange).expect("it is there");
        assert_eq!((found.range, found.raw), (7..11, Some(f64::from(230.2f32).into())));
        assert_eq!(find(point(Table::Holding, 7_003, DataType::EnronF32), &exchange), None);
    }

    #[test]
    fn a_bit_is_found_in_its_byte() {
        let exchange = exchange(Framing::Rtu, &[2, 1, 0x0C, 0x00, 0, 12], &[2, 1, 2, 0b0000_0101, 0b0000_0010]);
        for (address, range, raw) in [(3_072, 3..4, 1.0), (3_073, 3..4, 0.0), (3_081, 4..5, 1.0)] {
            let found = find(point(Table::Coil, address, DataType::Bool), &exchange).expect("it is there");
            assert_eq!((found.range, found.raw), (range, Some(raw.into())), "{address}");
        }
        assert_eq!(find(point(Table::Coil, 3_084, DataType::Bool), &exchange), None);
    }
}
