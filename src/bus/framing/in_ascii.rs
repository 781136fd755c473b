//! The same on a line of Modbus ASCII, where each frame says where it begins and ends.

use super::FrameMatch;
use crate::{
    bus::{
        ascii::{FRAME_MAX, frames, open, open_frame},
        frame::{self, Request},
    },
    plant::{def::Framing, fault::Fault, number::to_u16},
};

/// What the bytes that have come over an ASCII line are.
pub fn find_answer<'a>(message: impl Into<Request<'a>>, buffer: &[u8]) -> FrameMatch {
    let message = message.into();
    let mut corrupt = None;
    for frame in frames(buffer) {
        let answer = match open(&buffer[frame.clone()]) {
            Ok(answer) => answer,
            Err(fault) => {
                corrupt.get_or_insert(fault);
                continue;
            }
        };
        return match frame::check_answer(Framing::Ascii, message, &answer) {
            Ok(()) | Err(Fault::Exception(_)) => FrameMatch::Answer(frame),
            Err(fault) => FrameMatch::Foreign(frame.end, fault),
        };
    }
    match (open_frame(buffer), corrupt) {
        (Some(open), _) if open.len() <= FRAME_MAX => FrameMatch::Begun,
        (Some(open), _) => {
            FrameMatch::Corrupt(Fault::WrongLength { got: to_u16(open.len()), asked: to_u16(FRAME_MAX) })
        }
        (None, Some(fault)) => FrameMatch::Corrupt(fault),
        (None, None) => FrameMatch::Nothing,
    }
}

/// Names what is left at the deadline.
pub fn left_over<'a>(message: impl Into<Request<'a>>, buffer: &[u8]) -> Fault {
    let corrupt = frames(buffer).find_map(|frame| open(&buffer[frame]).err());
    let expected = 2 * frame::expected_length(message).unwrap_or(3) + 5;
    let cut =
        || Fault::Truncated { got: to_u16(open_frame(buffer).unwrap_or(buffer).len()), expected: to_u16(expected) };
    if buffer.is_empty() { Fault::Timeout } else { corrupt.unwrap_or_else(cut) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::bus::{
        ascii::{encode, lrc},
        framing,
    };

    const REQUEST: [u8; 6] = [1, 3, 0, 10, 0, 2];
    const ANSWER: [u8; 7] = [1, 3, 4, 0, 10, 0, 11];

    fn check(bytes: &[u8], expect: FrameMatch) {
        assert_eq!(find_answer(&REQUEST, bytes), expect, "{}", bytes.escape_ascii());
    }

    #[test]
    fn an_answer_is_found_whole_behind_noise_and_cut_anywhere() {
        let whole = encode(&ANSWER);
        let length = whole.len();
        check(&whole, FrameMatch::Answer(0..length));
        assert_eq!(open(&whole), Ok(ANSWER.to_vec()));
        check(&[], FrameMatch::Nothing);
        check(b"\xFF\x00\r\n0A", FrameMatch::Nothing);
        for cut in 1..whole.len() {
            check(&whole[..cut], FrameMatch::Begun);
            let behind = [&whole[..cut], &whole].concat();
            check(&behind, FrameMatch::Answer(cut..cut + length));
            assert_eq!(left_over(&REQUEST, &whole[..cut]), Fault::Truncated { got: cut as u16, expected: 19 });
        }
        check(&[b"\xFF\r\n0", &whole[..]].concat(), FrameMatch::Answer(4..4 + length));
        check(&whole.to_ascii_lowercase(), FrameMatch::Answer(0..length));
    }

    #[test]
    fn a_refusal_is_an_answer_and_another_unit_is_not() {
        check(&encode(&[1, 0x83, 2]), FrameMatch::Answer(0..11));
        let other = encode(&[2, 3, 4, 0, 10, 0, 11]);
        check(&other, FrameMatch::Foreign(other.len(), Fault::WrongUnit { got: 2, asked: 1 }));
    }

    #[test]
    fn each_way_of_being_corrupt_has_its_name() {
        for (bytes, fault) in [
            (&b":0103FD\r\n"[..], Fault::Lrc { got: 0xFD, computed: 0xFC }),
            (b":01G3FC\r\n", Fault::NotHex(b'G')),
            (b":01 03FC\r\n", Fault::NotHex(b' ')),
            (b":0103F\r\n", Fault::Truncated { got: 5, expected: 6 }),
            (b":01FF\r\n", Fault::Truncated { got: 7, expected: 9 }),
            (b":\r\n", Fault::Truncated { got: 3, expected: 9 }),
        ] {
            check(bytes, FrameMatch::Corrupt(fault));
            assert_eq!(left_over(&REQUEST, bytes), fault);
            // The good answer behind it is taken all the same.
            let behind = [bytes, &encode(&ANSWER)].concat();
            check(&behind, FrameMatch::Answer(bytes.len()..bytes.len() + 19));
        }
        assert_eq!(left_over(&REQUEST, &[]), Fault::Timeout);
    }

    #[test]
    fn a_frame_without_end_is_given_up_at_513_characters() {
        let long = [b":", &[b'0'; 600][..]].concat();
        check(&long[..513], FrameMatch::Begun);
        check(&long[..514], FrameMatch::Corrupt(Fault::WrongLength { got: 514, asked: 513 }));
        let longest = encode(&[1; 254]);
        assert_eq!((longest.len(), open(&longest)), (FRAME_MAX, Ok(vec![1; 254])));
        let longer = encode(&[1; 255]);
        assert_eq!(open(&longer), Err(Fault::WrongLength { got: 515, asked: 513 }));
    }

    /// Rows of the published examples: id, kind, message, CRC and LRC as printed.
    fn vectors() -> Vec<(String, String, Vec<u8>, String, String)> {
        let mut rows = csv::Reader::from_reader(include_str!("../../../tests/vectors/frames.csv").as_bytes());
        rows.records()
            .map(|row| {
                let row = row.unwrap();
                let bytes = row[3].split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect();
                (row[0].to_owned(), row[1].to_owned(), bytes, row[4].to_owned(), row[5].to_owned())
            })
            .collect()
    }

    #[test]
    fn every_published_frame_travels_in_all_three_forms() {
        let (mut in_ascii, mut in_rtu) = (0, 0);
        for (id, kind, message, crc, check) in vectors() {
            let whole = encode(&message);
            assert_eq!(open(&whole), Ok(message.clone()), "{id}");
            let printed = u8::from_str_radix(&check, 16).unwrap();
            assert_eq!(lrc(&message) == printed, kind != "negative", "{id}");
            in_ascii += 1;
            if kind == "negative" {
                let frame = format!(":{}{check}\r\n", frame::hex(&message).replace(' ', ""));
                let fault = Fault::Lrc { got: printed, computed: lrc(&message) };
                assert_eq!(open(frame.as_bytes()), Err(fault), "{id}");
            }
            if !crc.is_empty() {
                let sent = frame::with_crc(&message);
                assert!(frame::hex(&sent).ends_with(&crc), "{id}");
                assert_eq!(frame::without_crc(&sent), Ok(&message[..]), "{id}");
                in_rtu += 1;
            }
            let sent = frame::with_mbap(0x1234, &message);
            assert_eq!(frame::mbap(&sent), frame::Mbap::Whole { transaction: 0x1234, end: sent.len() }, "{id}");
            assert_eq!(sent[6..], message, "{id}");
        }
        assert_eq!((in_ascii, in_rtu), (25, 23));
    }

    /// Each published answer, alone, behind noise and cut at every byte, against every published request.
    #[test]
    fn every_published_answer_belongs_to_its_request_only() {
        let rows = vectors();
        let of = |wanted: &'static str| rows.iter().filter(move |row| row.1 == wanted);
        for (id, _, answer, ..) in of("response") {
            for (other, _, request, ..) in of("request") {
                let (ascii, rtu) = (encode(answer), frame::with_crc(answer));
                for noise in [&b""[..], b"\xFF\x55"] {
                    let in_ascii = find_answer(request, &[noise, &ascii].concat());
                    let in_rtu = framing::find_answer(Framing::Rtu, request, &[noise, &rtu].concat());
                    assert_eq!(matches!(in_ascii, FrameMatch::Answer(_)), id == other, "{id} to {other}: {in_ascii:?}");
                    assert_eq!(matches!(in_rtu, FrameMatch::Answer(_)), id == other, "{id} to {other}: {in_rtu:?}");
                }
                for cut in 0..ascii.len() {
                    assert!(!matches!(find_answer(request, &ascii[..cut]), FrameMatch::Answer(_)), "{id} cut at {cut}");
                }
                for cut in 0..rtu.len() {
                    assert!(
                        !matches!(framing::find_answer(Framing::Rtu, request, &rtu[..cut]), FrameMatch::Answer(_)),
                        "{id} cut at {cut}"
                    );
                }
                let tcp = frame::with_mbap(7, answer);
                for cut in 0..tcp.len() {
                    assert_eq!(frame::mbap(&tcp[..cut]), frame::Mbap::Incomplete, "{id} cut at {cut}");
                }
            }
        }
    }
}
