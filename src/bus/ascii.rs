//! Modbus ASCII: `:`, the message in hexadecimal digits, LRC, CR LF.

use std::ops::Range;

use crate::plant::{
    fault::Fault,
    number::{to_u8, to_u16},
};

/// Longest frame, from `:` to LF (Modbus over serial line V1.02, 2.5.2.1).
pub const FRAME_MAX: usize = 513;

const END: &[u8] = b"\r\n";

/// The longitudinal redundancy check: two's complement of the sum of all bytes, without carry.
pub fn lrc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)).wrapping_neg()
}

/// The frame of a message (unit and PDU): `01 03 …` becomes `:0103…` with LRC and CR LF.
pub fn encode(message: &[u8]) -> Vec<u8> {
    let digits = |byte: &u8| format!("{byte:02X}").into_bytes();
    let mut frame = b":".to_vec();
    frame.extend(message.iter().flat_map(digits));
    frame.extend(digits(&lrc(message)));
    frame.extend(END);
    frame
}

/// The bytes that hexadecimal digits of either case stand for.
///
/// # Errors
/// [`Fault::NotHex`] names the first other character; [`Fault::Truncated`] an odd count.
pub fn decode(digits: &[u8]) -> Result<Vec<u8>, Fault> {
    let value = |digit: &u8| char::from(*digit).to_digit(16).map(to_u8).ok_or(Fault::NotHex(*digit));
    let values = digits.iter().map(value).collect::<Result<Vec<u8>, Fault>>()?;
    let (pairs, odd) = values.as_chunks::<2>();
    match odd {
        [] => Ok(pairs.iter().map(|[high, low]| high << 4 | low).collect()),
        [..] => Err(Fault::Truncated { got: to_u16(digits.len()), expected: to_u16(digits.len()) + 1 }),
    }
}

/// The message of a whole frame (`:` to LF), if it is well formed and its LRC fits.
pub fn open(frame: &[u8]) -> Result<Vec<u8>, Fault> {
    let cut = Fault::Truncated { got: to_u16(frame.len()), expected: to_u16(frame.len()) + 2 };
    let digits = frame.strip_prefix(b":").and_then(|rest| rest.strip_suffix(END)).ok_or(cut)?;
    if frame.len() > FRAME_MAX {
        return Err(Fault::WrongLength { got: to_u16(frame.len()), asked: to_u16(FRAME_MAX) });
    }
    let mut message = decode(digits)?;
    let got = message.pop().ok_or(Fault::Truncated { got: to_u16(frame.len()), expected: 9 })?;
    let computed = lrc(&message);
    match message.len() {
        0 | 1 => Err(Fault::Truncated { got: to_u16(frame.len()), expected: 9 }),
        _ if got == computed => Ok(message),
        _ => Err(Fault::Lrc { got, computed }),
    }
}

/// The messages of all whole good frames.
pub fn messages(buffer: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    frames(buffer).filter_map(|frame| open(&buffer[frame]).ok())
}

/// Every run from a `:` to its CR LF. A second `:` restarts; what stands between frames is noise.
pub(super) fn frames(buffer: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let ends = (0..=buffer.len()).filter(|end| buffer[..*end].ends_with(END));
    let mut from = 0;
    ends.filter_map(move |end| {
        // Each byte is looked at once, also where no frame has begun.
        let from = std::mem::replace(&mut from, end);
        let start = from + buffer[from..end].iter().rposition(|byte| *byte == b':')?;
        Some(start..end)
    })
}

/// The beginning of a frame that has not ended.
pub fn open_frame(buffer: &[u8]) -> Option<&[u8]> {
    let start = buffer.iter().rposition(|byte| *byte == b':')?;
    let rest = &buffer[start..];
    (!rest.windows(END.len()).any(|pair| pair == END)).then_some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_looks_as_the_standard_writes_it() {
        assert_eq!(encode(&[0x01, 0x03, 0x03, 0xEA, 0x00, 0x01]), b":010303EA00010E\r\n");
        assert_eq!(open(b":010303ea00010e\r\n"), Ok(vec![0x01, 0x03, 0x03, 0xEA, 0x00, 0x01]));
        assert_eq!(lrc(&[]), 0);
    }

    #[test]
    fn the_lrc_of_every_printed_vector_is_right() {
        let table = include_str!("../../tests/vectors/frames.csv");
        let mut seen = 0;
        for row in csv::Reader::from_reader(table.as_bytes()).records() {
            let row = row.expect("a row");
            let bytes = |cell: &str| -> Vec<u8> {
                cell.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("two hex digits")).collect()
            };
            if row[1] != *"negative" {
                assert_eq!(vec![lrc(&bytes(&row[3]))], bytes(&row[5]), "{row:?}");
                seen += 1;
            }
        }
        assert!(seen > 15, "{seen} vectors");
    }
}
