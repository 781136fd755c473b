//! The header of Modbus TCP: where a frame of a stream ends, and the exception answer whose header counts too many bytes.

use super::{MESSAGE_MAX, check_answer};
use crate::plant::{def::Framing, fault::Fault};

/// What stands at the beginning of a TCP stream.
#[derive(Debug, PartialEq, Eq)]
pub enum Mbap {
    /// Not all of it has come yet.
    Incomplete,
    /// A whole frame: its transaction and the end of its message (which begins at byte 6).
    Whole {
        /// Transaction id.
        transaction: u16,
        /// End of the message in the buffer.
        end: usize,
    },
    /// No MBAP header: the stream is out of sync and must be closed.
    Broken,
}

/// Looks at the beginning of a TCP stream.
pub fn mbap(buffer: &[u8]) -> Mbap {
    let Some((header, _)) = buffer.split_first_chunk::<6>() else { return Mbap::Incomplete };
    let length = usize::from(u16::from_be_bytes([header[4], header[5]]));
    if header[2..4] != [0, 0] || !(2..=MESSAGE_MAX).contains(&length) {
        return Mbap::Broken;
    }
    if buffer.len() < 6 + length {
        return Mbap::Incomplete;
    }
    Mbap::Whole { transaction: u16::from_be_bytes([header[0], header[1]]), end: 6 + length }
}

/// Does a TCP stream go on with anything but whole frames and the beginning of one?
pub fn is_out_of_sync(mut stream: &[u8]) -> bool {
    loop {
        match mbap(stream) {
            Mbap::Whole { end, .. } => stream = &stream[end..],
            // Of a header that has begun the protocol is 0, and so is the first byte of its length.
            Mbap::Incomplete => return stream.iter().take(5).skip(2).any(|byte| *byte != 0),
            Mbap::Broken => return true,
        }
    }
}

/// An exception answer whose header counts more bytes than it has: some devices count one too many, some the header too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ShortException {
    /// Transaction id.
    pub transaction: u16,
    /// A header stands behind it. Otherwise nothing does: more of the frame may still come, and only time decides.
    pub is_proven: bool,
}

impl ShortException {
    /// Its bytes, the message from byte 6 on; the next header begins behind them.
    pub const LENGTH: usize = 9;
}

/// The short exception that a TCP stream begins with, to be looked for before [`mbap`], which would wait for bytes that never
/// come, or take them from the next frame. `asked` gives the request message (unit and PDU) of an expected transaction.
pub fn short_exception<'a>(stream: &[u8], asked: &impl Fn(u16) -> Option<&'a [u8]>) -> Option<ShortException> {
    let (&[high, low, protocol_high, protocol_low, length_high, length_low, unit, function, code], rest) =
        stream.split_first_chunk::<{ ShortException::LENGTH }>()?;
    let (transaction, length) = (u16::from_be_bytes([high, low]), u16::from_be_bytes([length_high, length_low]));
    if [protocol_high, protocol_low] != [0, 0] || length <= 3 {
        return None;
    }
    let answer = check_answer(Framing::Mbap, asked(transaction)?, &[unit, function, code]);
    let is_header = |at: usize| stream.get(at..).is_some_and(|rest| 6 <= rest.len() && mbap(rest) != Mbap::Broken);
    // A header where this one says the next stands: it is right, the exception has bytes behind its code.
    let is_right = is_header(6 + usize::from(length));
    let is_proven = is_header(ShortException::LENGTH) || short_exception(rest, asked).is_some();
    let is_short = matches!(answer, Err(Fault::Exception(_))) && !is_right && (rest.is_empty() || is_proven);
    is_short.then_some(ShortException { transaction, is_proven })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::{bus::frame::with_mbap, plant::fault::ExceptionCode};

    const ASKED: [u8; 6] = [1, 3, 0x7D, 0x64, 0, 5];

    /// An exception to transaction 7 whose header counts `length` bytes.
    fn exception(length: u16) -> Vec<u8> {
        [&[0, 7, 0, 0][..], &length.to_be_bytes(), &[1, 0x83, 2]].concat()
    }

    fn short(stream: &[u8]) -> Option<bool> {
        let asked = |transaction| (transaction == 7).then_some(&ASKED[..]);
        short_exception(stream, &asked).map(|short| short.is_proven)
    }

    #[test]
    fn a_tcp_stream_is_cut_by_its_header() {
        let frame = with_mbap(7, &[1, 3, 2, 0, 5]);
        assert_eq!(mbap(&frame), Mbap::Whole { transaction: 7, end: 11 });
        for cut in 0..frame.len() {
            assert_eq!(mbap(&frame[..cut]), Mbap::Incomplete, "cut at {cut}");
        }
        assert_eq!(mbap(&[0, 1, 9, 9, 0, 5]), Mbap::Broken);
        assert_eq!(mbap(&[0, 1, 0, 0, 255, 255]), Mbap::Broken);
        let two = [&frame[..], &frame].concat();
        for cut in 0..two.len() {
            assert!(!is_out_of_sync(&two[..cut]), "cut at {cut}");
        }
        assert!(is_out_of_sync(&[&frame[..], &[0, 1, 9, 9]].concat()));
    }

    #[test]
    fn an_exception_with_a_too_large_length_is_recognised() {
        // One or more too many, the header counted too, the two bytes of the length exchanged.
        for length in [4, 5, 9, 12, 0x0300] {
            assert_eq!(short(&exception(length)), Some(false), "nothing behind it, length {length}");
            for next in
                [with_mbap(8, &[1, 3, 2, 0, 5]), exception(length), with_mbap(8, &[1, 3, 2, 0, 5])[..6].to_vec()]
            {
                assert_eq!(short(&[exception(length), next].concat()), Some(true), "length {length}");
            }
            for cut in 0..9 {
                assert_eq!(short(&exception(length)[..cut]), None, "length {length} cut at {cut}");
            }
        }
    }

    #[test]
    fn what_may_be_a_frame_as_its_header_says_is_no_short_exception() {
        let next = with_mbap(8, &[1, 3, 2, 0, 5]);
        for (stream, why) in [
            (exception(3), "its length is right"),
            ([exception(4), vec![0]].concat(), "as long as its header says"),
            ([exception(4), vec![0], next.clone()].concat(), "as long as its header says, with the next behind"),
            ([exception(7), vec![0; 4], next].concat(), "the next stands where the header says"),
            ([exception(6), vec![9, 9]].concat(), "what follows is no header"),
            ([exception(40), vec![9; 20]].concat(), "what follows is no header"),
            (with_mbap(7, &[1, 3, 2, 0, 5]), "no exception"),
            ([&[0, 7, 0, 1, 0, 4, 1, 0x83, 2][..]].concat(), "another protocol"),
            ([&[0, 9, 0, 0, 0, 4, 1, 0x83, 2][..]].concat(), "a transaction that nobody asked for"),
            ([&[0, 7, 0, 0, 0, 4, 2, 0x83, 2][..]].concat(), "another unit"),
            ([&[0, 7, 0, 0, 0, 4, 1, 0x84, 2][..]].concat(), "another function"),
        ] {
            assert_eq!(short(&stream), None, "{why}");
        }
    }

    #[test]
    fn surplus_bytes_are_allowed_behind_an_exception_over_tcp_only() {
        let refused = Err(Fault::Exception(ExceptionCode(2)));
        for surplus in [&[][..], &[0], &[0, 0], &[1, 2, 3, 4, 5, 6]] {
            let answer = [&[1, 0x83, 2], surplus].concat();
            assert_eq!(check_answer(Framing::Mbap, &ASKED, &answer), refused, "{surplus:?}");
            for framing in [Framing::Rtu, Framing::Ascii] {
                assert_eq!(check_answer(framing, &ASKED, &answer) == refused, surplus.is_empty(), "{surplus:?}");
            }
        }
        let values = [1, 3, 10, 0, 1, 0, 2, 0, 3, 0, 4, 0, 5];
        assert_eq!(check_answer(Framing::Mbap, &ASKED, &values), Ok(()));
        assert!(check_answer(Framing::Mbap, &ASKED, &[&values[..], &[0]].concat()).is_err(), "no normal answer");
        let without_code = Err(Fault::Exception(ExceptionCode::NONE));
        assert_eq!(check_answer(Framing::Mbap, &ASKED, &[1, 0x83]), without_code);
        assert_ne!(check_answer(Framing::Rtu, &ASKED, &[1, 0x83]), without_code, "only a header says that this is all");
    }
}
