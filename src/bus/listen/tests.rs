//! Frames, roles and pairs of a line that was heard, whatever the pieces and whatever stood between the frames.

mod evidence;

use jiff::SignedDuration;
use proptest::prelude::*;

use super::*;
use crate::{
    bus::frame::{with_crc, wrap},
    plant::{
        def::LineId,
        line::{Serial, Transport},
    },
};

const READ: &[u8] = &[1, 3, 0, 10, 0, 2];
const VALUES: &[u8] = &[1, 3, 4, 0, 10, 0, 11];
const WRITE: &[u8] = &[1, 6, 0, 10, 0, 5];

fn listener(framing: Framing) -> Listener {
    let transport = match framing {
        Framing::Mbap => Transport::tcp("plc", 502),
        Framing::Rtu | Framing::Ascii => {
            Transport::Serial { port: "p".into(), serial: Serial::USUAL, framing, rs485: Default::default() }
        }
    };
    Listener::new(&LineDef { timeout: Duration::from_millis(500), ..LineDef::new(LineId(0), "L", transport) })
}

fn at(millis: i64) -> Timestamp {
    Timestamp::UNIX_EPOCH + SignedDuration::from_millis(millis)
}

/// `1→` request to unit 1, `1←` its response, `1?` one without request, `~3` noise of three bytes, `1×` a lost response.
fn shown(heard: &[Heard]) -> String {
    let one = |heard: &Heard| match heard {
        Heard::Ended(Ended { request, response: None, .. }) => Some(format!("{}×", request[0])),
        Heard::Ended(_) => None,
        Heard::Frame(HeardFrame { frame, role }) => Some(match (role, frame.unit) {
            (Role::Request, Some(unit)) => format!("{unit}→"),
            (Role::Response { .. }, Some(unit)) => format!("{unit}←"),
            (Role::Unmatched, Some(unit)) => format!("{unit}?"),
            (Role::Request | Role::Response { .. } | Role::Unmatched | Role::Noise, _) => {
                format!("~{}", frame.bytes.len())
            }
        }),
    };
    heard.iter().filter_map(one).collect::<Vec<_>>().join(" ")
}

/// Hears messages, each this many milliseconds after the one before, and a silence behind the last.
fn check_messages(framing: Framing, messages: &[(i64, &[u8])], expect: &str) -> Listener {
    let mut listener = listener(framing);
    let (mut heard, mut now) = (Vec::new(), 0);
    for (number, (after, message)) in (0..).zip(messages) {
        now += after;
        heard.extend(listener.hear(at(now), &wrap(framing, number / 2, message)));
    }
    heard.extend(listener.rest(at(now + 10_000)));
    assert_eq!(shown(&heard), expect, "{framing:?} {messages:02X?}");
    listener
}

#[test]
fn requests_and_responses_are_distinguished_and_paired() {
    let exchanges: &[(i64, &[u8])] = &[
        (0, READ),
        (12, VALUES),
        (50, WRITE),
        (15, WRITE),
        (50, &[2, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2]),
        (9, &[2, 16, 0, 1, 0, 2]),
        (50, &[2, 1, 4, 0xA1, 0, 1]),
        (9, &[2, 0x81, 2]),
        (50, &[1, 1, 3, 5, 0, 20]),
        (9, &[1, 1, 3, 5, 0, 10]),
    ];
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
        let listener = check_messages(framing, exchanges, "1→ 1← 1→ 1← 2→ 2← 2→ 2← 1→ 1←");
        let unit = &listener.units()[&1];
        assert_eq!((unit.requests, unit.ok, unit.response_time.max()), (3, 3, Some(Duration::from_millis(15))));
        let totals = listener.totals();
        assert_eq!((totals.requests, totals.responses, totals.unmatched), (5, 5, 0), "{framing:?}");
        let refused: u64 = listener.units()[&2].exceptions.iter().map(|(_, count)| count).sum();
        assert_eq!((refused, listener.totals().noise_bytes), (1, 0));
    }
}

#[test]
fn a_lost_response_does_not_swap_the_roles() {
    // The next write differs; the same write comes after the timeout; a read comes between two equal writes.
    let other: &[u8] = &[1, 6, 0, 10, 0, 6];
    let differs = &[(0, READ), (9, VALUES), (50, WRITE), (80, other), (9, other), (50, WRITE), (9, WRITE)];
    check_messages(Framing::Rtu, differs, "1→ 1← 1→ 1× 1→ 1← 1→ 1←");
    let repeats = &[(0, READ), (9, VALUES), (50, WRITE), (501, WRITE), (9, WRITE), (50, WRITE), (9, WRITE)];
    let listener = check_messages(Framing::Rtu, repeats, "1→ 1← 1→ 1× 1→ 1← 1→ 1←");
    assert_eq!(listener.units()[&1].timeouts, 1, "{:?}", listener.units());
    let swapped = &[(0, WRITE), (50, WRITE), (9, WRITE), (50, READ), (9, VALUES), (50, WRITE), (9, WRITE)];
    check_messages(Framing::Rtu, swapped, "1→ 1← 1→ 1× 1→ 1← 1→ 1←");
    // A read that is repeated looks like no response, even where its bytes could be one.
    let bits: &[u8] = &[1, 1, 3, 5, 0, 24];
    check_messages(Framing::Rtu, &[(0, READ), (9, VALUES), (50, bits), (80, bits)], "1→ 1← 1→ 1× 1→");
}

#[test]
fn a_corrupt_response_and_noise_are_counted() {
    let corrupt = |message: &[u8]| {
        let mut frame = with_crc(message);
        frame[4] ^= 1;
        frame
    };
    let mut listener = listener(Framing::Rtu);
    let mut heard = listener.hear(at(0), &with_crc(READ));
    heard.extend(listener.hear(at(9), &[&[0xFF, 0, 0x55], &with_crc(VALUES)[..]].concat()));
    heard.extend(listener.hear(at(50), &with_crc(READ)));
    heard.extend(listener.hear(at(59), &corrupt(VALUES)));
    heard.extend(listener.hear(at(150), &with_crc(READ)));
    heard.extend(listener.hear(at(159), &with_crc(VALUES)));
    heard.extend(listener.end());
    assert_eq!(shown(&heard), "1→ ~3 1← 1→ ~9 1× 1→ 1←");
    // What came behind the noise is not certain.
    let unit = &listener.units()[&1];
    assert_eq!((unit.requests, unit.ok, unit.check, unit.timeouts), (3, 1, 1, 1));
    assert_eq!((listener.totals().noise_bytes, listener.totals().noise_runs), (12, 2));
}

#[test]
fn functions_outside_the_standard_are_frames_too() {
    let (asked, answer) = (&[1, 0x41, 7, 7][..], &[1, 0x41, 7, 7, 1, 2, 3][..]);
    check_messages(Framing::Rtu, &[(0, READ), (9, VALUES), (80, asked), (80, answer), (80, READ)], "1→ 1← 1→ 1← 1→");
    // No silence between them.
    check_messages(Framing::Rtu, &[(0, READ), (9, VALUES), (9, asked), (9, answer), (9, READ)], "1→ 1← 1→ 1← 1→");
    check_messages(Framing::Mbap, &[(0, asked), (9, answer)], "1→ 1←");
}

#[test]
fn a_broadcast_waits_for_no_response() {
    let all: &[u8] = &[0, 6, 0, 10, 0, 5];
    let listener =
        check_messages(Framing::Rtu, &[(0, READ), (9, VALUES), (50, all), (50, all), (50, READ)], "1→ 1← 0→ 0→ 1→");
    assert_eq!((listener.units()[&0].requests, listener.waiting()), (2, 1));
}

#[test]
fn over_tcp_several_requests_wait_at_once() {
    let mut listener = listener(Framing::Mbap);
    let frame = |number: u16, message: &[u8]| crate::bus::frame::with_mbap(number, message);
    let stream = [frame(1, READ), frame(2, WRITE), frame(2, WRITE), frame(1, VALUES), frame(9, VALUES)].concat();
    assert_eq!(shown(&listener.hear(at(0), &stream)), "1→ 1→ 1← 1← 1?");
    let lost: Vec<Heard> = (100..200).flat_map(|number| listener.hear(at(1), &frame(number, READ))).collect();
    let lost = lost.iter().filter(|heard| matches!(heard, Heard::Ended(Ended { response: None, .. }))).count();
    assert_eq!((lost, listener.waiting()), (36, 64));
}

#[test]
fn what_is_kept_is_bounded_whatever_comes() {
    for framing in [Framing::Rtu, Framing::Ascii, Framing::Mbap] {
        for byte in [0, 1, 3, b':', b'0', 0xFF] {
            let mut listener = listener(framing);
            for _ in 0..100 {
                listener.hear(at(0), &[byte; 1000]);
                assert!(listener.bytes.len() <= 2 * NOISE_MAX, "{framing:?} {byte:02X}: {}", listener.bytes.len());
            }
            listener.rest(at(10_000));
            let totals = listener.totals();
            assert!(listener.bytes.is_empty() && totals.noise_bytes <= 100_000, "{framing:?} {byte:02X}");
        }
    }
}

/// A frame of a line, or bytes that are none.
fn piece(framing: Framing) -> impl Strategy<Value = Vec<u8>> {
    let message = prop_oneof![
        Just(READ.to_vec()),
        Just(VALUES.to_vec()),
        Just(WRITE.to_vec()),
        Just(vec![2, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2]),
        Just(vec![2, 16, 0, 1, 0, 2]),
        Just(vec![1, 0x83, 2]),
        Just(vec![3, 0x2B, 0x0E, 1, 0]),
        Just(vec![3, 0x41, 1, 2, 3]),
        (1..4_u8, 0..60_u8)
            .prop_map(|(unit, count)| [&[unit, 4, 2 * count][..], &vec![7; 2 * usize::from(count)]].concat()),
    ];
    let noise = prop::collection::vec(any::<u8>(), 1..20);
    prop_oneof![4 => (0..9_u16, message).prop_map(move |(number, message)| wrap(framing, number, &message)), 1 => noise]
}

fn stream() -> impl Strategy<Value = (Framing, Vec<u8>, Vec<usize>)> {
    let framing = prop_oneof![Just(Framing::Rtu), Just(Framing::Ascii), Just(Framing::Mbap)];
    framing.prop_flat_map(|framing| {
        let pieces = prop::collection::vec(piece(framing), 1..12).prop_map(|pieces| pieces.concat());
        (Just(framing), pieces, prop::collection::vec(1..40_usize, 1..60))
    })
}

proptest! {
    #[test]
    fn any_split_of_the_bytes_gives_the_same((framing, bytes, sizes) in stream()) {
        let mut whole = listener(framing);
        let mut expect = whole.hear(at(0), &bytes);
        expect.extend(whole.rest(at(5_000)));
        let mut split = listener(framing);
        let (mut heard, mut rest) = (Vec::new(), &bytes[..]);
        for size in sizes.iter().cycle() {
            let (front, back) = rest.split_at(rest.len().min(*size));
            heard.extend(split.hear(at(0), front));
            rest = back;
            if rest.is_empty() {
                break;
            }
        }
        heard.extend(split.rest(at(5_000)));
        prop_assert_eq!(&heard, &expect);
        // No byte is lost, none is heard twice.
        let again: Vec<u8> = heard.iter().flat_map(|heard| match heard {
            Heard::Frame(heard) => heard.frame.bytes.to_vec(),
            Heard::Ended(_) => Vec::new(),
        }).collect();
        prop_assert_eq!(again, bytes);
    }
}
