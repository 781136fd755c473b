//! Answers of every function, as the standard has them and as devices get them wrong.

use std::ops::Range;

use proptest::prelude::*;

use super::*;

/// A request, its answer, and the bytes of the answer that neither the request nor the answer itself determines.
struct Row(&'static [u8], &'static [u8], &'static [Range<usize>]);

/// Every function; the examples of V1.1b3, 6, where it has some.
// One place is a list of places as well.
#[allow(clippy::single_range_in_vec_init)]
const ROWS: [Row; 24] = [
    Row(&[1, 0x01, 0, 0x13, 0, 0x13], &[1, 0x01, 3, 0xCD, 0x6B, 5], &[3..6]),
    Row(&[1, 0x02, 0, 0xC4, 0, 0x16], &[1, 0x02, 3, 0xAC, 0xDB, 0x35], &[3..6]),
    Row(&[1, 0x03, 0, 0x6B, 0, 3], &[1, 0x03, 6, 2, 0x2B, 0, 0, 0, 0x64], &[3..9]),
    Row(&[1, 0x04, 0, 8, 0, 1], &[1, 0x04, 2, 0, 10], &[3..5]),
    Row(&[1, 0x05, 0, 0xAC, 0xFF, 0], &[1, 0x05, 0, 0xAC, 0xFF, 0], &[]),
    Row(&[1, 0x06, 0, 1, 0, 3], &[1, 0x06, 0, 1, 0, 3], &[]),
    Row(&[1, 0x07], &[1, 0x07, 0x6D], &[2..3]),
    Row(&[1, 0x08, 0, 0, 0xA5, 0x37], &[1, 0x08, 0, 0, 0xA5, 0x37], &[]),
    Row(&[1, 0x08, 0, 0, 1, 2, 3, 4, 5, 6], &[1, 0x08, 0, 0, 1, 2, 3, 4, 5, 6], &[]),
    Row(&[1, 0x08, 0, 1, 0xFF, 0], &[1, 0x08, 0, 1, 0xFF, 0], &[]),
    Row(&[1, 0x08, 0, 0x0B, 0, 0], &[1, 0x08, 0, 0x0B, 0, 0x17], &[4..6]),
    Row(&[1, 0x0B], &[1, 0x0B, 0xFF, 0xFF, 1, 8], &[2..6]),
    Row(&[1, 0x0C], &[1, 0x0C, 8, 0, 0, 1, 8, 1, 0x21, 0x20, 0], &[3..11]),
    Row(&[1, 0x0F, 0, 0x13, 0, 10, 2, 0xCD, 1], &[1, 0x0F, 0, 0x13, 0, 10], &[]),
    Row(&[1, 0x10, 0, 1, 0, 2, 4, 0, 10, 1, 2], &[1, 0x10, 0, 1, 0, 2], &[]),
    Row(&[1, 0x11], &[1, 0x11, 3, b'A', b'B', 0xFF], &[3..6]),
    Row(
        &[1, 0x14, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 3, 0, 9, 0, 2],
        &[1, 0x14, 12, 5, 6, 0x0D, 0xFE, 0, 0x20, 5, 6, 0x33, 0xCD, 0, 0x40],
        &[5..9, 11..15],
    ),
    Row(
        &[1, 0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D],
        &[1, 0x15, 13, 6, 0, 4, 0, 7, 0, 3, 6, 0xAF, 4, 0xBE, 0x10, 0x0D],
        &[],
    ),
    Row(&[1, 0x16, 0, 4, 0, 0xF2, 0, 0x25], &[1, 0x16, 0, 4, 0, 0xF2, 0, 0x25], &[]),
    Row(&[1, 0x17, 0, 3, 0, 2, 0, 14, 0, 3, 6, 0, 255, 0, 255, 0, 255], &[1, 0x17, 4, 0, 0xFE, 0x0A, 0xCD], &[3..7]),
    Row(&[1, 0x18, 4, 0xDE], &[1, 0x18, 0, 6, 0, 2, 1, 0xB8, 0x12, 0x84], &[6..10]),
    Row(
        &[1, 0x2B, 0x0E, 1, 0],
        &[1, 0x2B, 0x0E, 1, 1, 0, 0, 2, 0, 2, b'a', b'b', 1, 1, b'x'],
        &[4..7, 8..9, 10..13, 14..15],
    ),
    Row(&[1, 0x2B, 0x0E, 4, 0x80], &[1, 0x2B, 0x0E, 4, 0x83, 0, 0, 1, 0x80, 2, b'a', b'b'], &[4..7, 10..12]),
    Row(&[1, 0x2B, 0x0D, 0, 0], &[1, 0x2B, 0x0D, 1, 2, 3], &[3..6]),
];

fn on(framing: Framing, request: &[u8], answer: &[u8]) -> Result<(), Fault> {
    check_answer(framing, request, answer)
}

const FRAMINGS: [Framing; 3] = [Framing::Rtu, Framing::Ascii, Framing::Mbap];

#[test]
fn every_function_has_its_answer_and_no_byte_of_it_may_differ() {
    for Row(request, answer, free) in ROWS {
        for framing in FRAMINGS {
            assert_eq!(on(framing, request, answer), Ok(()), "{request:02X?}");
            for at in 0..answer.len() {
                let mut other = answer.to_vec();
                other[at] ^= 1;
                let is_free = free.iter().any(|range| range.contains(&at));
                assert_eq!(answers(framing, request, &other), is_free, "{request:02X?}: byte {at} of {other:02X?}");
            }
        }
    }
    let known: std::collections::BTreeSet<u8> = ROWS.iter().map(|row| row.0[1]).collect();
    let all = (0..=0x7F).filter(|code| pdu::function(*code).is_some());
    assert!(all.eq(known), "a function without a row");
}

#[test]
fn no_answer_may_be_longer_or_shorter() {
    for Row(request, answer, _) in ROWS.iter().filter(|row| !row.0.starts_with(&[1, 0x2B, 0x0D])) {
        for framing in FRAMINGS {
            let longer = [answer, &[0][..]].concat();
            let faults = [on(framing, request, &answer[..answer.len() - 1]), on(framing, request, &longer)];
            let is_length = |fault| matches!(fault, Err(Fault::WrongLength { .. } | Fault::Truncated { .. }));
            assert!(faults.into_iter().all(is_length), "{request:02X?}: {faults:?}");
        }
    }
}

#[test]
fn each_way_of_being_wrong_has_its_name() {
    let check = |request: &[u8], answer: &[u8], fault: Fault| {
        for framing in FRAMINGS {
            assert_eq!(on(framing, request, answer), Err(fault), "{answer:02X?}");
        }
    };
    let length = |got, asked| Fault::WrongLength { got, asked };
    let read = [1, 3, 0, 10, 0, 2];
    check(&read, &[2, 3, 4, 0, 1, 0, 2], Fault::WrongUnit { got: 2, asked: 1 });
    check(&read, &[1, 4, 4, 0, 1, 0, 2], Fault::WrongFunction { got: 4, asked: 3 });
    check(&read, &[1, 0x84, 2], Fault::WrongFunction { got: 0x84, asked: 3 });
    check(&read, &[1, 3, 2, 0, 1], length(2, 4));
    check(&read, &[1, 3, 2, 0, 1, 0, 2], length(2, 4));
    check(&read, &[1, 0x83, 2], Fault::Exception(ExceptionCode(2)));
    // Where a header says that this was all, it is a refusal without a code.
    let cut = Err(Fault::Truncated { got: 2, expected: 3 });
    assert_eq!([Framing::Rtu, Framing::Ascii].map(|framing| on(framing, &read, &[1, 0x83])), [cut, cut]);
    assert_eq!(on(Framing::Mbap, &read, &[1, 0x83]), Err(Fault::Exception(ExceptionCode::NONE)));
    // Writes as devices answer them: without the address, with another value, of another register, with a byte too many.
    let write = [1, 6, 0, 100, 0, 7];
    check(&write, &[1, 6, 0, 7], length(2, 4));
    check(&write, &[1, 6, 0, 100, 0, 1], Fault::WrongEcho);
    check(&write, &[1, 6, 0, 101, 0, 7], Fault::WrongEcho);
    check(&write, &[1, 6, 0, 100, 0, 7, 6], length(5, 4));
    check(&write, &[1, 1, 0], Fault::WrongFunction { got: 1, asked: 6 });
    check(&write, &[1, 0x86, 0x80], Fault::Exception(ExceptionCode(0x80)));
    let block = [1, 16, 0, 104, 0, 2, 4, 0, 1, 0, 2];
    check(&block, &[1, 16, 0, 104, 0, 1], Fault::WrongEcho);
    check(&block, &block, length(9, 4));
    // The mask write of which another mask comes back was not done.
    check(&[1, 0x16, 0, 111, 0xFF, 0, 0, 0x12], &[1, 0x16, 0, 111, 0xFF, 0, 0, 0], Fault::WrongEcho);
    // Five registers, of which the byte count says eleven bytes.
    let both = [1, 0x17, 0, 0, 0, 5, 0, 10, 0, 1, 2, 0, 5];
    check(&both, &[&[1, 0x17, 11][..], &[0; 10]].concat(), length(11, 10));
    check(&both, &[&[1, 0x17, 8][..], &[0; 8]].concat(), length(8, 10));
    check(&[1, 0x08, 0, 0x0B, 0, 0], &[1, 0x08, 0, 0x0C, 0, 5], Fault::WrongEcho);
    check(&[1, 0x18, 0, 1], &[1, 0x18, 0, 6, 0, 3, 0, 1, 0, 2], length(4, 6));
    check(&[1, 0x18, 0, 1], &[1, 0x18, 0, 0], length(2, 4));
    check(&[1, 0x0C], &[1, 0x0C, 4, 0, 0, 0, 1], length(4, 6));
    let file = [1, 0x14, 7, 6, 0, 4, 0, 1, 0, 2];
    check(&file, &[1, 0x14, 6, 5, 7, 0, 1, 0, 2], Fault::WrongEcho);
    check(&file, &[1, 0x14, 6, 4, 6, 0, 1, 0, 2], length(4, 5));
    check(&[1, 0x2B, 0x0E, 4, 1], &[1, 0x2B, 0x0E, 4, 0x81, 0, 0, 1, 2, 1, b'x'], Fault::WrongEcho);
    check(&[1, 0x2B, 0x0E, 4, 1], &[1, 0x2B, 0x0E, 4, 0x81, 0, 0, 2, 1, 1, b'x', 2, 1, b'y'], Fault::WrongEcho);
    check(&[1, 0x2B, 0x0E, 2, 3], &[1, 0x2B, 0x0E, 1, 0x81, 0, 0, 1, 3, 1, b'x'], Fault::WrongEcho);
    check(&[1, 0x2B, 0x0D, 0], &[1, 0x2B, 0x0E, 0], Fault::Truncated { got: 4, expected: 5 });
}

#[test]
fn functions_of_a_maker_are_known_by_unit_and_function() {
    let request = [1, 0x41, 1, 2];
    for framing in FRAMINGS {
        assert_eq!(on(framing, &request, &[1, 0x41, 9, 9, 9]), Ok(()));
        assert_eq!(on(framing, &request, &[1, 0xC1, 1]), Err(Fault::Exception(ExceptionCode(1))));
        assert_eq!(on(framing, &request, &[1, 0x42, 9]), Err(Fault::WrongFunction { got: 0x42, asked: 0x41 }));
    }
}

#[test]
fn only_what_is_alike_has_the_same_signature() {
    let signature = |request: &[u8]| response_signature(request);
    assert_eq!(signature(&[1, 3, 0, 1, 0, 2]), signature(&[1, 3, 0, 9, 0, 2]));
    assert_ne!(signature(&[1, 3, 0, 1, 0, 2]), signature(&[1, 3, 0, 1, 0, 3]));
    let mask = |or| [1, 0x16, 0, 4, 0, 0xF2, 0, or];
    assert_ne!(signature(&mask(1)), signature(&mask(2)), "the whole echo counts");
    assert!(signature(&mask(1)).is_some_and(|signature| signature.fits(&mask(1)) && !signature.fits(&mask(2))));
    // The counters of diagnostics are no loopback: two answers look alike.
    for request in [&[1, 8, 0, 0x0B, 0, 0][..], &[1, 7], &[1, 0x11], &[1, 0x2B, 0x0E, 1, 0]] {
        assert_eq!(signature(request), None, "{request:02X?}");
    }
}

proptest! {
    /// Neither a broken request nor a broken answer is beyond a name; what fits a signature is an answer.
    #[test]
    fn whatever_came_has_a_verdict(
        request in proptest::collection::vec(any::<u8>(), 0..20),
        answer in proptest::collection::vec(any::<u8>(), 0..40),
        begin in 0..ROWS.len(),
        take in 0..16_usize,
    ) {
        let begun = [&ROWS[begin].0[..take.min(ROWS[begin].0.len())], &request].concat();
        for framing in FRAMINGS {
            let verdict = check_answer(framing, &begun, &[&ROWS[begin].1[..take.min(ROWS[begin].1.len())], &answer].concat());
            prop_assert!(verdict.err().is_none_or(|fault| !fault.to_string().is_empty()));
        }
        if let Some(signature) = response_signature(&begun) {
            prop_assert_eq!(Some(signature.length), expected_length(&begun));
        }
    }
}
