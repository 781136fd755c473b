//! Frames among pasted bytes, in each framing.

use proptest::prelude::*;

use super::*;
use crate::bus::frame::{hex, with_crc, with_mbap, wrap};

const FRAMINGS: [Framing; 3] = [Framing::Rtu, Framing::Ascii, Framing::Mbap];
const READ: &[u8] = &[1, 3, 0, 10, 0, 2];
const VALUES: &[u8] = &[1, 3, 4, 0, 10, 0, 11];
const NOISE: &[u8] = &[0xFF, 0x00, 0x55];

fn read_alone(bytes: &[u8]) -> Paste {
    read(bytes, None, None, &mut Asked::default())
}

/// The parts: `~3` bytes that are no frame, else the summary of a frame.
fn shown(paste: &Paste) -> String {
    let part = |part: &Part| match &part.dissection {
        Some(dissection) => dissection.summary.clone(),
        None => format!("~{}", part.range.len()),
    };
    paste.parts.iter().map(part).collect::<Vec<_>>().join(" | ")
}

#[test]
fn frames_are_found_with_noise_before_between_and_behind() {
    for framing in FRAMINGS {
        let [asked, answer] = [READ, VALUES].map(|message| wrap(framing, 7, message));
        let paste = read_alone(&[NOISE, &asked, NOISE, NOISE, &answer, NOISE].concat());
        let request = "unit 1 read holding registers 40011–40012 (0x000A, 2)";
        assert_eq!(shown(&paste), format!("~3 | {request} | ~6 | 2 registers: 000A 000B | ~3"), "{framing:?}");
        let why = if framing == Framing::Mbap { Why::Header } else { Why::Check };
        assert_eq!((paste.framing, paste.why), (Some(framing), why));
        // The answer has the addresses of its request, and its place in what was pasted.
        let last = &paste.parts[3];
        assert_eq!(last.asked.as_deref(), Some(READ), "{framing:?}");
        let first = last
            .dissection
            .as_ref()
            .map(|dissection| dissection.fields.iter().any(|field| field.name.starts_with("40011")));
        assert_eq!(first, Some(true));
        assert_eq!(paste.parts.iter().map(|part| part.range.len()).sum::<usize>(), 12 + asked.len() + answer.len());
        // A cut frame before a whole one is no part of it.
        let paste = read_alone(&[&asked[..asked.len() - 3], &asked].concat());
        assert!(shown(&paste).ends_with(&format!(" | {request}")), "{framing:?}: {}", shown(&paste));
    }
}

#[test]
fn a_damaged_frame_between_good_ones_is_named() {
    let mut damaged = with_crc(VALUES);
    damaged[4] ^= 1;
    let paste = read_alone(&[&with_crc(READ), &damaged[..], &with_crc(READ)].concat());
    let wrong: Vec<bool> =
        paste.parts.iter().map(|part| part.dissection.as_ref().is_some_and(|known| known.wrong.is_some())).collect();
    assert_eq!(wrong, [false, true, false], "{}", shown(&paste));
}

#[test]
fn the_reading_that_explains_most_is_preferred() {
    let check = |bytes: &[u8], framing: Option<Framing>, why: Why, expect: &str, instead: &str| {
        let paste = read_alone(bytes);
        assert_eq!((paste.framing, paste.why), (framing, why), "{}: {}", hex(bytes), shown(&paste));
        assert_eq!(shown(&paste), expect, "{}", hex(bytes));
        let other = paste.instead.map_or_else(String::new, |instead| instead.summary);
        assert_eq!(other, instead, "{}", hex(bytes));
    };
    let rtu = Some(Framing::Rtu);
    // A read of two registers from 0, whose CRC looks like a request behind a header.
    let two = with_crc(&[1, 3, 0, 0, 0, 2]);
    let pair = "unit 1 read holding registers 40001–40002 (0x0000, 2)";
    check(&two, rtu, Why::Check, pair, "unit 196 get comm event counter");
    check(&[1, 3, 0, 0, 0, 2], None, Why::Message, pair, "");
    let write = [1, 16, 0, 0, 0, 2, 4, 0, 1, 0, 2];
    check(&write, None, Why::Message, "unit 1 write registers 40001–40002 (0x0000, 2): 0001 0002", "");
    let coils = [1, 15, 0, 0, 0, 2, 1, 3];
    check(&coils, None, Why::Message, "unit 1 write coils 00001–00002 (0x0000, 2): 11", "");
    // A header before a message whose transaction looks like one.
    let loopback = [0, 8, 0, 0, 0, 6, 1, 3, 0, 0, 0, 2];
    check(
        &loopback,
        Some(Framing::Mbap),
        Why::Header,
        pair,
        "broadcast diagnostics return query data (loopback), data 00 06 01 03 00 00 00 02",
    );
    // Noise that would be the beginning of an answer.
    let behind = [&[0xFF, 3, 8][..], &two].concat();
    check(&behind, rtu, Why::Check, &format!("~3 | {pair}"), "4 registers: 0103 0000 0002 C40B");
    // A few bytes of a message that are a frame by chance.
    let inside = [&[1, 3, 24][..], &with_crc(&[1, 7]), &[0; 20]].concat();
    assert_eq!(read_alone(&inside).why, Why::Message);
    let mut damaged = with_crc(READ);
    damaged[7] ^= 1;
    assert_eq!(read_alone(&damaged).why, Why::BadCheck);
    assert_eq!(read_alone(&[0, 1, 0, 0, 0, 4, 1, 0x83, 2]).why, Why::BadHeader);
    assert_eq!(read_alone(&[0x55, 0x55, 0x55]).why, Why::Nothing);
    assert_eq!(
        read(&two, Some(Framing::Mbap), None, &mut Asked::default()).framing,
        Some(Framing::Mbap),
        "as it was told"
    );
}

#[test]
fn an_answer_over_tcp_belongs_to_its_transaction() {
    let frames = [with_mbap(1, READ), with_mbap(2, &[1, 3, 0, 20, 0, 2]), with_mbap(1, VALUES), with_mbap(2, VALUES)];
    let paste = read_alone(&frames.concat());
    let asked: Vec<Option<u8>> = paste.parts.iter().map(|part| part.asked.as_ref().map(|asked| asked[3])).collect();
    assert_eq!(asked, [None, None, Some(10), Some(20)]);
    // The echo of a write is its answer, a second one is not.
    let write = with_crc(&[1, 6, 0, 1, 0, 3]);
    let paste = read_alone(&write.repeat(3));
    let asked: Vec<bool> = paste.parts.iter().map(|part| part.asked.is_some()).collect();
    assert_eq!(asked, [false, true, false]);
}

proptest! {
    /// Whatever is pasted, every byte stands in one part, and a frame is found whatever stands around it.
    #[test]
    fn every_byte_has_its_part(
        before in proptest::collection::vec(any::<u8>(), 0..40),
        behind in proptest::collection::vec(any::<u8>(), 0..40),
        framing in proptest::sample::select(FRAMINGS.to_vec()),
    ) {
        let frame = wrap(framing, 0x1234, &[17, 16, 0x12, 0x34, 0, 4, 8, 1, 2, 3, 4, 5, 6, 7, 8]);
        let bytes = [&before[..], &frame, &behind].concat();
        let paste = read(&bytes, Some(framing), None, &mut Asked::default());
        let mut at = 0;
        for part in &paste.parts {
            prop_assert_eq!(part.range.start, at);
            at = part.range.end;
        }
        prop_assert_eq!(at, bytes.len());
        let place = before.len()..before.len() + frame.len();
        prop_assert!(framing == Framing::Mbap || paste.parts.iter().any(|part| part.range == place));
    }
}
