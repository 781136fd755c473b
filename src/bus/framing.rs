//! What the bytes that have come over a line are: the response, another frame, noise, or the beginning of a frame.
//! For lines without transaction ids; Modbus TCP has its header.

use super::{ascii, frame, pdu};
use crate::plant::{def::Framing, event::Fault, number::to_u16};

/// What the bytes received so far are.
#[derive(Debug, PartialEq, Eq)]
pub enum FrameMatch {
    /// They hold the answer: this range is its frame, check included.
    Answer(std::ops::Range<usize>),
    /// They begin with a whole good frame that is not the answer and ends here.
    Foreign(usize, Fault),
    /// No bytes, or nothing that looks like the answer.
    Nothing,
    /// The beginning of the answer.
    Begun,
    /// A frame of full length whose check does not fit.
    Corrupt(Fault),
}

/// Looks for the answer to a message.
pub fn find_answer(framing: Framing, message: &[u8], buffer: &[u8]) -> FrameMatch {
    match framing {
        Framing::Ascii => ascii::find_answer(message, buffer),
        Framing::Rtu | Framing::Mbap => in_bytes(framing, message, buffer),
    }
}

/// Looks for a frame with a good CRC at the beginning, then behind noise.
fn in_bytes(framing: Framing, message: &[u8], buffer: &[u8]) -> FrameMatch {
    let begins = |rest: &[u8]| match (rest, message) {
        ([unit, function, ..], [asked_unit, asked, ..]) => unit == asked_unit && function & 0x7F == *asked,
        _ => false,
    };
    for start in 0..buffer.len() {
        let Some(Ok(answer)) = full_frame(&buffer[start..]).map(frame::without_crc) else { continue };
        let end = start + answer.len() + 2;
        match frame::check_answer(framing, message, answer) {
            Ok(()) | Err(Fault::Exception(_)) => return FrameMatch::Answer(start..end),
            // Inside what may be the answer a chance check is no frame: it would cut the answer in two.
            Err(_) if (0..start).any(|earlier| begins(&buffer[earlier..])) => {}
            Err(fault) => return FrameMatch::Foreign(end, fault),
        }
    }
    // No good frame yet. Is there one of the right beginning and full length, but corrupt?
    let mut beginnings = (0..buffer.len()).map(|start| &buffer[start..]).filter(|rest| begins(rest)).peekable();
    if beginnings.peek().is_none() {
        return FrameMatch::Nothing;
    }
    let corrupt = beginnings.find_map(|rest| {
        let frame = full_frame(rest)?;
        let fault = frame::without_crc(frame).err()?;
        // The answer was cut short, and a late one of another unit came right behind it.
        let is_good = |late: &[u8]| full_frame(late) == Some(late) && frame::without_crc(late).is_ok();
        let cut = (2..frame.len()).find(|cut| is_good(&rest[*cut..]));
        let expected = expected_length(Framing::Rtu, message);
        Some(cut.map_or(fault, |got| Fault::Truncated { got: to_u16(got), expected: to_u16(expected) }))
    });
    corrupt.map_or(FrameMatch::Begun, FrameMatch::Corrupt)
}

/// The frame that bytes begin with, check included, if they have its full length.
fn full_frame(bytes: &[u8]) -> Option<&[u8]> {
    bytes.get(..pdu::response_length(bytes).known()? + 2)
}

/// Length of the frame that answers a message.
fn expected_length(framing: Framing, message: &[u8]) -> usize {
    frame::wrapped_length(framing, frame::response_signature(message).map_or(3, |signature| signature.length()))
}

/// Names what is left at the deadline.
pub fn left_over(framing: Framing, message: &[u8], buffer: &[u8]) -> Fault {
    if framing == Framing::Ascii {
        return ascii::left_over(message, buffer);
    }
    if buffer.is_empty() {
        return Fault::Timeout;
    }
    let expected = expected_length(framing, message);
    if buffer.len() < expected {
        return Fault::Truncated { got: to_u16(buffer.len()), expected: to_u16(expected) };
    }
    match frame::unwrap(framing, buffer) {
        Err(fault) => fault,
        Ok(answer) => Fault::WrongLength { got: to_u16(answer.len()), asked: to_u16(expected) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::frame::with_crc;

    const REQUEST: [u8; 6] = [1, 3, 0, 10, 0, 2];

    fn answer() -> Vec<u8> {
        with_crc(&[1, 3, 4, 0, 10, 0, 11])
    }

    fn check(bytes: &[u8], expect: FrameMatch) {
        assert_eq!(find_answer(Framing::Rtu, &REQUEST, bytes), expect, "{}", frame::hex(bytes));
    }

    #[test]
    fn an_answer_is_found_whole_and_behind_noise() {
        check(&[], FrameMatch::Nothing);
        check(&answer(), FrameMatch::Answer(0..9));
        check(&[&[0xFF, 0x00, 0x55], &answer()[..]].concat(), FrameMatch::Answer(3..12));
        for cut in 2..answer().len() {
            check(&answer()[..cut], FrameMatch::Begun);
        }
        check(&[0xFF, 0x00, 0x55], FrameMatch::Nothing);
    }

    #[test]
    fn a_refusal_is_an_answer_and_another_unit_is_not() {
        check(&with_crc(&[1, 0x83, 2]), FrameMatch::Answer(0..5));
        check(&with_crc(&[2, 3, 4, 0, 10, 0, 11]), FrameMatch::Foreign(9, Fault::WrongUnit { got: 2, asked: 1 }));
        check(&with_crc(&[1, 3, 2, 0, 10]), FrameMatch::Foreign(7, Fault::WrongLength { got: 5, asked: 7 }));
    }

    #[test]
    fn a_corrupt_answer_is_named_and_not_taken() {
        let mut corrupt = answer();
        corrupt[4] ^= 1;
        assert!(matches!(find_answer(Framing::Rtu, &REQUEST, &corrupt), FrameMatch::Corrupt(Fault::Crc { .. })));
    }

    #[test]
    fn a_cut_answer_is_named_also_before_a_late_one() {
        let late = with_crc(&[2, 3, 2, 0, 200]);
        for cut in 2..answer().len() {
            let bytes = [&answer()[..cut], &late[..]].concat();
            let fault = Fault::Truncated { got: cut as u16, expected: 9 };
            check(&bytes, FrameMatch::Corrupt(fault));
        }
    }

    #[test]
    fn a_chance_check_inside_the_answer_does_not_cut_it() {
        // The data of the answer begin like a short good frame of another unit.
        let request = [1, 3, 0, 10, 0, 4];
        let inner = with_crc(&[2, 0x83, 2]);
        let whole = with_crc(&[&[1, 3, 8], &inner[..], &[0, 0, 0]].concat());
        assert_eq!(find_answer(Framing::Rtu, &request, &whole[..10]), FrameMatch::Begun);
        assert_eq!(find_answer(Framing::Rtu, &request, &whole), FrameMatch::Answer(0..13));
    }

    #[test]
    fn what_is_left_at_the_deadline_has_a_name() {
        assert_eq!(left_over(Framing::Rtu, &REQUEST, &[]), Fault::Timeout);
        assert_eq!(left_over(Framing::Rtu, &REQUEST, &answer()[..4]), Fault::Truncated { got: 4, expected: 9 });
    }
}
