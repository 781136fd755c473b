//! Where a frame begins and ends among bytes whose sender is not known: by length and check.
//!
//! What stands at a place depends on the bytes from there on and on the open request only, never on how they came in pieces.

use crate::{
    bus::{
        ascii,
        frame::{self, Mbap},
        pdu::{self, Length},
    },
    plant::line::Framing,
};

/// Longest RTU frame: a message of 254 bytes and its CRC.
const RTU_MAX: usize = frame::MESSAGE_MAX + 2;

/// What bytes begin with.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// A whole good frame of this length.
    Frame(usize),
    /// Perhaps a frame: more bytes will show.
    Wait,
    /// No frame begins here.
    Noise,
}

/// Looks at the beginning of bytes. `asked` is the request message that has no response yet. `ended`: a silence shows that
/// nothing more belongs to them.
pub(super) fn cut(framing: Framing, bytes: &[u8], asked: Option<&[u8]>, ended: bool) -> Cut {
    let cut = match framing {
        Framing::Rtu => rtu(bytes, asked, ended),
        Framing::Ascii => in_ascii(bytes),
        Framing::Mbap => mbap(bytes, asked),
    };
    if cut == Cut::Wait && ended { Cut::Noise } else { cut }
}

/// A frame is as long as its function says, and its CRC fits. The length of a response is tried first where one is due: the
/// first bytes of a long frame may have the CRC of a short one by chance.
fn rtu(bytes: &[u8], asked: Option<&[u8]>, ended: bool) -> Cut {
    if bytes.len() < 3 {
        return Cut::Wait;
    }
    let mut lengths = [pdu::request_length(bytes), pdu::response_length(bytes)];
    if asked.is_some_and(|asked| may_answer(asked, bytes)) {
        lengths.reverse();
    }
    for length in lengths {
        match length {
            Length::Known(message) if RTU_MAX < message + 2 => {}
            Length::Known(message) => match bytes.get(..message + 2).map(frame::without_crc) {
                Some(Ok(_)) => return Cut::Frame(message + 2),
                None if !ended => return Cut::Wait,
                Some(Err(_)) | None => {}
            },
            Length::TooEarly if !ended => return Cut::Wait,
            Length::TooEarly | Length::BySilence => {}
        }
    }
    Cut::Noise
}

/// Do these bytes begin like the response to a request?
fn may_answer(asked: &[u8], bytes: &[u8]) -> bool {
    let counted = |asked: &[u8]| match asked.get(1) {
        Some(0x01..=0x04 | 0x17) => frame::expected_length(asked).map(|length| length - 3),
        Some(_) | None => None,
    };
    frame::begins_answer(asked, bytes)
        && counted(asked).is_none_or(|count| bytes.get(2).is_some_and(|byte| usize::from(*byte) == count))
}

/// The lengths of frames of functions that are not in the standard: only a silence or the frames around them show where they
/// end. All of the bytes must be such frames.
pub(super) fn of_unknown_functions(bytes: &[u8]) -> Option<Vec<usize>> {
    let (mut lengths, mut rest) = (Vec::new(), bytes);
    while !rest.is_empty() {
        let is_unknown = pdu::request_length(rest) == Length::BySilence;
        let mut ends = (4..=rest.len().min(RTU_MAX)).filter(|_| is_unknown);
        let length = ends.find(|end| frame::without_crc(&rest[..*end]).is_ok())?;
        lengths.push(length);
        rest = &rest[length..];
    }
    Some(lengths)
}

fn in_ascii(bytes: &[u8]) -> Cut {
    let body = bytes.strip_prefix(b":").unwrap_or_default();
    // A second colon begins again.
    let end = body.iter().position(|byte| matches!(byte, b'\n' | b':'));
    match end {
        _ if bytes.first() != Some(&b':') => Cut::Noise,
        Some(end) if ascii::open(&bytes[..end + 2]).is_ok() => Cut::Frame(end + 2),
        None if bytes.len() < ascii::FRAME_MAX => Cut::Wait,
        Some(_) | None => Cut::Noise,
    }
}

/// A header has no check, so the length that it gives must be that of its function; or it answers the request.
fn mbap(bytes: &[u8], asked: Option<&[u8]>) -> Cut {
    if bytes.get(2..4).is_some_and(|protocol| protocol != [0, 0]) {
        return Cut::Noise;
    }
    match frame::mbap(bytes) {
        Mbap::Incomplete => Cut::Wait,
        Mbap::Broken => Cut::Noise,
        Mbap::Whole { end, .. } => {
            let message = &bytes[6..end];
            let fits = |length: Length| match length {
                Length::Known(length) => length == message.len(),
                Length::BySilence => true,
                Length::TooEarly => false,
            };
            let good = fits(pdu::request_length(message))
                || fits(pdu::response_length(message))
                || asked.is_some_and(|asked| frame::answers(Framing::Mbap, asked, message));
            if good { Cut::Frame(end) } else { Cut::Noise }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_frame_is_waited_for_that_would_be_too_long() {
        let begin = |count: u8| [&[1, 3, count][..], &[0x11; 7]].concat();
        let cut_rtu = |count: u8| cut(Framing::Rtu, &begin(count), None, false);
        assert_eq!((cut_rtu(250), cut_rtu(252)), (Cut::Wait, Cut::Noise), "255 and 257 bytes");
        let digits = |count: usize| [&b":"[..], &vec![b'0'; count - 1]].concat();
        let cut_ascii = |count: usize| cut(Framing::Ascii, &digits(count), None, false);
        assert_eq!((cut_ascii(ascii::FRAME_MAX - 1), cut_ascii(ascii::FRAME_MAX)), (Cut::Wait, Cut::Noise));
    }
}
