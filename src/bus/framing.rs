//! What the bytes that have come over a line are: the response, another frame, noise, or the beginning of a frame.

mod in_ascii;

use std::ops::Range;

use super::{
    frame::{self, Mbap, Request, ShortException},
    pdu::{self, Length},
};
use crate::plant::{
    def::Framing,
    fault::{ExceptionCode, Fault},
    number::to_u16,
};

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

/// The answer among the bytes that came for a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reply {
    /// Its frame, as far as it has come.
    pub range: Range<usize>,
    /// Unit and PDU.
    pub message: Vec<u8>,
    /// A refusal is an answer too.
    pub exception: Option<ExceptionCode>,
}

impl Reply {
    /// `None` where the message does not answer the request.
    fn new(framing: Framing, request: &[u8], message: &[u8], range: Range<usize>) -> Result<Reply, Fault> {
        let exception = match frame::check_answer(framing, request, message) {
            Ok(()) => None,
            Err(Fault::Exception(code)) => Some(code),
            Err(fault) => return Err(fault),
        };
        Ok(Reply { range, message: message.to_vec(), exception })
    }
}

/// Looks for the answer to a request frame in all that came for it, noise and other frames included; `ended`: nothing more
/// comes. `Err` is what is wrong with what came instead.
pub fn find_reply(framing: Framing, request: &[u8], came: &[u8], ended: bool) -> Result<Reply, Fault> {
    match (framing, request.first_chunk::<2>()) {
        (Framing::Mbap, Some(id)) => {
            in_stream(u16::from_be_bytes(*id), request.get(6..).unwrap_or_default(), came, ended)
        }
        _ => in_line(framing, &frame::unwrap(framing, request)?, came, ended),
    }
}

/// Over Modbus TCP the answer has the transaction id of its request; what stands before it may be anything.
fn in_stream(asked: u16, request: &[u8], came: &[u8], ended: bool) -> Result<Reply, Fault> {
    let (mut at, mut misfit) = (0, None);
    // What is wrong with the first bytes that are no whole frame.
    let mut noise = None;
    while at < came.len() {
        let rest = &came[at..];
        let short = frame::short_exception(rest, &|id| (id == asked).then_some(request));
        let end = match frame::mbap(rest) {
            _ if short.is_some_and(|short| ended || short.is_proven) => ShortException::LENGTH,
            Mbap::Whole { end, .. } => end,
            begun @ (Mbap::Incomplete | Mbap::Broken) => {
                noise = noise.or(frame::unwrap(Framing::Mbap, rest).err());
                if begun == Mbap::Incomplete && !ended {
                    break;
                }
                at += 1;
                continue;
            }
        };
        let got = u16::from_be_bytes([rest[0], rest[1]]);
        let reply = match got == asked {
            true => Reply::new(Framing::Mbap, request, &rest[6..end], at..at + end),
            false => Err(Fault::WrongTransaction { got, asked }),
        };
        match (reply, noise) {
            (Ok(reply), _) => return Ok(reply),
            // Inside noise a chance header is no frame.
            (Err(_), Some(_)) => at += 1,
            (Err(fault), None) => {
                misfit = misfit.filter(|_| got != asked).or(Some(fault));
                at += end;
            }
        }
    }
    Err(misfit.or(noise).unwrap_or(Fault::Timeout))
}

/// Over a line without transaction ids, as the link does it.
fn in_line(framing: Framing, request: &[u8], came: &[u8], ended: bool) -> Result<Reply, Fault> {
    let (mut from, mut misfit) = (0, None);
    loop {
        let rest = &came[from..];
        let found = match find_answer(framing, request, rest) {
            FrameMatch::Foreign(end, fault) => {
                from += end;
                misfit = Some(fault);
                continue;
            }
            FrameMatch::Answer(range) => Ok(range),
            FrameMatch::Corrupt(fault) => Err(fault),
            FrameMatch::Nothing | FrameMatch::Begun => Err(misfit.unwrap_or_else(|| left_over(framing, request, rest))),
        };
        let by_silence = || if ended && framing == Framing::Rtu { ended_by_silence(request, rest) } else { None };
        let range = found.or_else(|fault| by_silence().ok_or(fault))?;
        let message = frame::unwrap(framing, &rest[range.clone()])?;
        return Reply::new(framing, request, &message, from + range.start..from + range.end);
    }
}

/// The answer of a function whose answers only a silence ends.
fn ended_by_silence(request: &[u8], bytes: &[u8]) -> Option<Range<usize>> {
    let begins = |start: &usize| {
        let rest = &bytes[*start..];
        frame::begins_answer(request, rest) && pdu::response_length(rest) == Length::BySilence
    };
    (0..bytes.len()).filter(begins).find_map(|start| {
        let end = (start + 4..=bytes.len()).rev().find(|end| frame::without_crc(&bytes[start..*end]).is_ok())?;
        Some(start..end)
    })
}

/// Looks for the answer to a message on a line without transaction ids.
pub fn find_answer<'a>(framing: Framing, message: impl Into<Request<'a>>, buffer: &[u8]) -> FrameMatch {
    let message = message.into();
    match framing {
        Framing::Ascii => in_ascii::find_answer(message, buffer),
        Framing::Rtu | Framing::Mbap => in_bytes(message, buffer),
    }
}

/// Where bytes begin as the answer does.
fn beginnings<'a>(message: &[u8], buffer: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
    (0..buffer.len()).map(|start| &buffer[start..]).filter(|rest| frame::begins_answer(message, rest))
}

/// What is wrong with bytes that begin as the answer and end with a good CRC, but not where they say.
fn misfit(message: Request, buffer: &[u8]) -> Option<Fault> {
    let checked = |rest| frame::check_answer(Framing::Rtu, message, frame::without_crc(rest).ok()?).err();
    beginnings(message.message, buffer).find_map(checked)
}

/// Looks for a frame with a good CRC at the beginning, then behind noise.
fn in_bytes(message: Request, buffer: &[u8]) -> FrameMatch {
    for start in 0..buffer.len() {
        let Some(answer) = good_frame(message, &buffer[start..]) else { continue };
        let end = start + answer.len() + 2;
        match frame::check_answer(Framing::Rtu, message, answer) {
            Ok(()) | Err(Fault::Exception(_)) => return FrameMatch::Answer(start..end),
            // Inside what may be the answer a chance check is no frame: it would cut the answer in two.
            Err(_) if (0..start).any(|earlier| frame::begins_answer(message.message, &buffer[earlier..])) => {}
            Err(fault) => return FrameMatch::Foreign(end, fault),
        }
    }
    // No good frame yet. Is there one of the right beginning and full length, but corrupt?
    let mut beginnings = beginnings(message.message, buffer).peekable();
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
    corrupt.map_or(FrameMatch::Begun, |fault| FrameMatch::Corrupt(misfit(message, buffer).unwrap_or(fault)))
}

/// The message of the frame that bytes begin with, if its check fits: as long as its own bytes or the request say.
fn good_frame<'a>(request: Request, bytes: &'a [u8]) -> Option<&'a [u8]> {
    let good = |frame: &'a [u8]| frame::without_crc(frame).ok();
    // A loopback echoes data of any length, and does not say how much.
    let echo = || match (bytes, request.message) {
        ([unit, 0x08, ..], [asked, 0x08, ..]) if unit == asked => bytes.get(..frame::expected_length(request)? + 2),
        _ => None,
    };
    full_frame(bytes).and_then(good).or_else(|| echo().and_then(good))
}

/// The frame that bytes begin with, check included, if they have its full length.
fn full_frame(bytes: &[u8]) -> Option<&[u8]> {
    bytes.get(..pdu::response_length(bytes).known()? + 2)
}

/// Length of the frame that answers a message.
fn expected_length(framing: Framing, message: Request) -> usize {
    frame::wrapped_length(framing, frame::expected_length(message).unwrap_or(3))
}

/// Names what is left at the deadline.
pub fn left_over<'a>(framing: Framing, message: impl Into<Request<'a>>, buffer: &[u8]) -> Fault {
    let message = message.into();
    if framing == Framing::Ascii {
        return in_ascii::left_over(message, buffer);
    }
    if buffer.is_empty() {
        return Fault::Timeout;
    }
    if let Some(fault) = misfit(message, buffer) {
        return fault;
    }
    let expected = expected_length(framing, message);
    if buffer.len() < expected {
        return Fault::Truncated { got: to_u16(buffer.len()), expected: to_u16(expected) };
    }
    match frame::unwrap(framing, buffer) {
        Err(fault) => fault,
        Ok(_) => Fault::WrongLength { got: to_u16(buffer.len()), asked: to_u16(expected) },
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
        check(&with_crc(&[1, 3, 2, 0, 10]), FrameMatch::Foreign(7, Fault::WrongLength { got: 2, asked: 4 }));
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
    fn a_loopback_of_any_length_is_its_own_answer() {
        let request = [1, 8, 0, 0, 1, 2, 3, 4];
        let whole = with_crc(&request);
        assert_eq!(find_answer(Framing::Rtu, &request, &[&[9, 9], &whole[..]].concat()), FrameMatch::Answer(2..12));
    }

    /// The place of the answer, with its exception code.
    fn reply(framing: Framing, request: &[u8], came: &[u8]) -> Result<(Range<usize>, Option<u8>), Fault> {
        find_reply(framing, request, came, true).map(|reply| (reply.range, reply.exception.map(|code| code.0)))
    }

    #[test]
    fn the_answer_is_found_among_all_that_came() {
        let noise = [0xFF, 0x00, 0x55];
        for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
            let frame = |id, message: &[u8]| frame::wrap(framing, id, message);
            let request = frame(7, &REQUEST);
            let (good, refused) = (frame(7, &[1, 3, 4, 0, 10, 0, 11]), frame(7, &[1, 0x83, 2]));
            let foreign = frame(6, &[2, 3, 4, 0, 10, 0, 11]);
            for before in [&[][..], &noise, &foreign, &[&foreign, &noise[..]].concat()] {
                for behind in [&[][..], &noise, &foreign] {
                    let found = |answer: &[u8]| reply(framing, &request, &[before, answer, behind].concat());
                    let place = |answer: &[u8]| before.len()..before.len() + answer.len();
                    assert_eq!(found(&good), Ok((place(&good), None)), "{framing:?} {before:02X?}");
                    assert_eq!(found(&refused), Ok((place(&refused), Some(2))), "{framing:?} {before:02X?}");
                }
            }
            assert_eq!(reply(framing, &request, &[]), Err(Fault::Timeout));
            let short = frame(7, &[1, 3, 2, 0, 10]);
            assert_eq!(reply(framing, &request, &short), Err(Fault::WrongLength { got: 2, asked: 4 }), "{framing:?}");
            let cut = reply(framing, &request, &good[..good.len() - 1]);
            assert!(matches!(cut, Err(Fault::Truncated { .. })), "{framing:?}: {cut:?}");
        }
    }

    #[test]
    fn an_answer_over_tcp_has_the_transaction_of_its_request() {
        let request = frame::with_mbap(1, &REQUEST);
        let values = [1, 3, 4, 0, 10, 0, 11];
        let next = frame::with_mbap(2, &values);
        let other = Err(Fault::WrongTransaction { got: 2, asked: 1 });
        assert_eq!(reply(Framing::Mbap, &request, &next), other);
        let wrong = frame::with_mbap(1, &[1, 3, 2, 0, 10]);
        let length = Err(Fault::WrongLength { got: 2, asked: 4 });
        assert_eq!(reply(Framing::Mbap, &request, &[&next[..], &wrong, &next].concat()), length, "its own tells more");
        assert_eq!(reply(Framing::Mbap, &request, b"HTTP/1.1 400 Bad Request"), Err(Fault::NoHeader));
        let answer = frame::with_mbap(1, &values);
        for heartbeat in [&b"alive\r\n"[..], &[0; 6], &[0, 0, 0, 0, 0, 40]] {
            let came = [heartbeat, &answer].concat();
            let place = heartbeat.len()..came.len();
            assert_eq!(reply(Framing::Mbap, &request, &came), Ok((place, None)), "{heartbeat:02X?}");
        }
        let cut = Err(Fault::Truncated { got: 9, expected: 13 });
        assert_eq!(reply(Framing::Mbap, &request, &frame::with_mbap(1, &values)[..9]), cut);
    }

    #[test]
    fn an_exception_with_a_wrong_header_answers_in_the_end() {
        let request = frame::with_mbap(1, &REQUEST);
        let refused = [0, 1, 0, 0, 0, 4, 1, 0x83, 2];
        assert_eq!(reply(Framing::Mbap, &request, &refused), Ok((0..9, Some(2))));
        assert!(find_reply(Framing::Mbap, &request, &refused, false).is_err(), "one more byte may come");
        let surplus = [&refused[..], &[0]].concat();
        assert!(find_reply(Framing::Mbap, &request, &surplus, false).is_ok());
    }

    #[test]
    fn a_function_of_a_maker_is_ended_by_silence() {
        let (request, answer) = (with_crc(&[1, 0x41, 7]), with_crc(&[1, 0x41, 1, 2, 3]));
        let came = [&[0x55], &answer[..], &[0x33]].concat();
        assert_eq!(reply(Framing::Rtu, &request, &came), Ok((1..8, None)));
        assert!(find_reply(Framing::Rtu, &request, &came, false).is_err());
        assert!(reply(Framing::Rtu, &request, &with_crc(&[2, 0x41, 1, 2, 3])).is_err(), "another unit");
        assert_eq!(reply(Framing::Rtu, &request, &with_crc(&[1, 0xC1, 1])), Ok((0..5, Some(1))));
    }

    #[test]
    fn a_wrong_byte_count_under_a_good_check_is_no_line_fault() {
        for (count, got) in [(&[][..], 3), (&[0, 4], 5), (&[2], 2)] {
            let bytes = with_crc(&[&[1, 3], count, &[0, 10, 0, 11]].concat());
            check(&bytes, FrameMatch::Corrupt(Fault::WrongLength { got, asked: 4 }));
        }
        // It announces more than comes: only silence shows that this was all.
        let bytes = with_crc(&[1, 3, 74, 0, 10, 0, 11]);
        check(&bytes, FrameMatch::Begun);
        let wrong = Fault::WrongLength { got: 74, asked: 4 };
        assert_eq!(left_over(Framing::Rtu, &REQUEST, &bytes), wrong);
        assert_eq!(reply(Framing::Rtu, &with_crc(&REQUEST), &bytes), Err(wrong), "no silence makes an answer of it");
    }

    #[test]
    fn what_is_left_at_the_deadline_has_a_name() {
        assert_eq!(left_over(Framing::Rtu, &REQUEST, &[]), Fault::Timeout);
        assert_eq!(left_over(Framing::Rtu, &REQUEST, &answer()[..4]), Fault::Truncated { got: 4, expected: 9 });
    }

    #[test]
    fn a_response_behind_one_of_another_transaction_is_found() {
        let request = frame::with_mbap(7, &[1, 3, 0, 0, 0, 1]);
        let (other, own) = (frame::with_mbap(6, &[1, 3, 2, 0, 9]), frame::with_mbap(7, &[1, 3, 2, 0, 5]));
        let came = [other.clone(), own].concat();
        let found = find_reply(Framing::Mbap, &request, &came, true).map(|reply| (reply.range, reply.message));
        assert_eq!(found, Ok((other.len()..came.len(), vec![1, 3, 2, 0, 5])));
    }
}
