//! What a technician reads about a frame.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::{
    bus::{
        ascii,
        frame::{with_crc, with_mbap},
    },
    plant::{
        tag::{DataType, Table},
        traffic::FrameResult,
    },
};

/// Message in hex; request in hex or nothing; the summary expected.
fn check(message: &str, asked: &str, summary: &str) -> Dissection {
    let bytes = |text: &str| text.split_whitespace().map(|b| u8::from_str_radix(b, 16).unwrap()).collect::<Vec<u8>>();
    let (message, asked) = (bytes(message), bytes(asked));
    let asked = (!asked.is_empty()).then_some(&asked[..]);
    let mut all = Vec::new();
    for frame in [with_crc(&message), ascii::encode(&message), with_mbap(1, &message), message.clone()] {
        let dissection = dissect(&frame, None, None, asked);
        assert_eq!(dissection.summary, summary);
        assert_eq!(dissection.wrong, None, "{summary}");
        assert_eq!(dissection.message, message);
        // Every byte is described, once and in order.
        let mut at = 0;
        for field in &dissection.fields {
            assert_eq!(field.range.start, at, "{summary}: {field:?}");
            at = field.range.end;
        }
        assert_eq!(at, frame.len(), "{summary}");
        all.push(dissection);
    }
    assert_eq!(
        all.iter().map(|one| one.framing).collect::<Vec<_>>(),
        [Some(Framing::Rtu), Some(Framing::Ascii), Some(Framing::Mbap), None]
    );
    all.remove(0)
}

#[test]
fn requests_are_reported_with_both_forms_of_the_address() {
    for (message, summary) in [
        ("01 03 03 EA 00 0A", "unit 1 read holding registers 41003–41012 (0x03EA, 10)"),
        ("01 04 00 00 00 01", "unit 1 read input registers 30001 (0x0000, 1)"),
        ("11 01 00 13 00 25", "unit 17 read coils 00020–00056 (0x0013, 37)"),
        ("02 02 08 00 00 08", "unit 2 read discrete inputs 12049–12056 (0x0800, 8)"),
        ("11 05 00 AC FF 00", "unit 17 write coil 00173 on (0x00AC)"),
        ("01 06 03 EA 00 32", "unit 1 write register 41003 = 50 (0x03EA, 0x0032)"),
        ("11 07", "unit 17 read exception status"),
        ("11 08 00 00 A5 37", "unit 17 diagnostics return query data (loopback), data A5 37"),
        ("11 0B", "unit 17 get comm event counter"),
        ("11 0F 00 13 00 0A 02 CD 01", "unit 17 write coils 00020–00029 (0x0013, 10): 1011 0011 10"),
        ("11 10 00 01 00 02 04 00 0A 01 02", "unit 17 write registers 40002–40003 (0x0001, 2): 000A 0102"),
        ("11 11", "unit 17 report server id"),
        ("11 14 07 06 00 04 00 01 00 02", "unit 17 read file record file 4 record 1, 2 registers"),
        ("11 15 09 06 00 04 00 07 00 01 06 AF", "unit 17 write file record file 4 record 7, 1 register: 06AF"),
        ("11 16 00 04 00 F2 00 25", "unit 17 mask write 40005 and 00F2 or 0025 (0x0004)"),
        (
            "11 17 00 03 00 06 00 0E 00 01 02 00 FF",
            "unit 17 read 40004–40009 (0x0003, 6), write 40015 (0x000E, 1): 00FF",
        ),
        ("11 18 04 DE", "unit 17 read FIFO queue 41247 (0x04DE)"),
        ("11 2B 0E 01 00", "unit 17 read device identification, basic identification from VendorName"),
        ("01 03 41 FF 00 01", "unit 1 read holding registers 416896 (0x41FF, 1)"),
        ("01 41 DE AD", "unit 1 function 65 / 0x41: DE AD"),
    ] {
        check(message, "", summary);
    }
}

#[test]
fn answers_are_reported_with_the_addresses_of_their_request() {
    for (message, asked, summary) in [
        ("01 03 04 00 C8 FF FE", "01 03 03 EA 00 02", "2 registers: 00C8 FFFE"),
        ("11 01 05 CD 6B B2 0E 1B", "11 01 00 13 00 25", "37 bits: 1011 0011 1101 0110 0100 1101 0111 0000 1101 1"),
        ("0A 81 02", "", "exception 02 illegal data address"),
        ("01 83 02", "01 03 03 EA 00 02", "exception 02 illegal data address"),
        ("11 05 00 AC FF 00", "11 05 00 AC FF 00", "written: coil 00173 on"),
        ("01 06 03 EA 00 32", "01 06 03 EA 00 32", "written: 41003 = 50"),
        ("11 10 00 01 00 02", "11 10 00 01 00 02 04 00 0A 01 02", "written: 40002–40003 (0x0001, 2)"),
        ("11 07 6D", "11 07", "exception status 6D (01101101)"),
        ("11 0B FF FF 01 08", "11 0B", "busy, 264 events"),
        ("11 0C 08 00 00 01 08 01 21 20 00", "11 0C", "ready, 264 events, 289 messages"),
        ("11 11 05 50 58 52 34 FF", "11 11", "server id \"PXR4\\xff\""),
        ("11 14 06 05 06 0D FE 00 20", "11 14 07 06 00 04 00 01 00 02", "file records 0DFE 0020"),
        ("11 18 00 06 00 02 01 B8 12 84", "11 18 04 DE", "2 queued: 01B8 1284"),
        ("01 2B 0E 01 01 00 00 02 00 03 41 42 43 01 01 58", "01 2B 0E 01 00", "VendorName \"ABC\", ProductCode \"X\""),
    ] {
        check(message, asked, summary);
    }
    let dissection = check("01 03 04 00 C8 FF FE", "01 03 03 EA 00 02", "2 registers: 00C8 FFFE");
    let of = |name: &str| dissection.fields.iter().find(|field| field.name == name).unwrap().words.clone();
    assert_eq!(of("41003 / 0x03EA"), "0x00C8  200");
    assert_eq!(of("41004 / 0x03EB"), "0xFFFE  65534 or -2");
    let dissection = check("01 03 04 00 C8 FF FE", "", "2 registers: 00C8 FFFE");
    assert_eq!((dissection.direction, dissection.fields[3].name.as_str()), (Some(Direction::Answer), "register 1"));
}

/// Enron and Daniel: four bytes for each address that is counted, where the plant says so; else it is what it always was, wrong.
#[test]
fn addresses_of_32_bits_are_named_by_their_own_count() {
    let mut def = crate::plant::fixture::plant();
    let pv = &mut def.tags[crate::plant::fixture::PV.index()].point;
    (pv.table, pv.address, pv.kind) = (Table::Holding, 7_001, DataType::EnronF32);
    let (line, unit) = (def.lines[0].id, def.devices[0].unit);
    let wide = WideAddresses::of(&def, line);
    let read = [unit, 3, 0x1B, 0x59, 0, 2];
    let answer = [unit, 3, 8, 0, 0, 0, 7, 0x43, 0x66, 0x33, 0x33];
    let dissected = |wide, message: &[u8], direction, asked| {
        dissect_with(wide, &with_crc(message), Some(Framing::Rtu), Some(direction), asked)
    };
    let good = dissected(&wide, &answer, Direction::Answer, Some(&read[..]));
    assert_eq!((&*good.summary, good.wrong), ("2 registers of 32 bits: 0000 0007 4366 3333", None));
    let names: Vec<&str> = good.fields[3..7].iter().map(|field| &*field.name).collect();
    let [first, second] = ["47002 / 0x1B59", "47003 / 0x1B5A"];
    let expect = [(first, 1), (first, 2), (second, 1), (second, 2)];
    assert_eq!(names, expect.map(|(place, word)| format!("{place} word {word}")));
    let write = [unit, 16, 0x1B, 0x59, 0, 1, 4, 0x43, 0x66, 0x33, 0x33];
    assert_eq!(dissected(&wide, &write, Direction::Request, None).wrong, None);

    let none = WideAddresses::default();
    let wrong = dissected(&none, &answer, Direction::Answer, Some(&read[..])).wrong;
    assert_eq!(wrong.as_deref(), Some("response with 8 data bytes, expected 4"));
    let wrong = dissected(&none, &write, Direction::Request, None).wrong;
    assert_eq!(wrong.as_deref(), Some("byte count says 4, 2 fit"));
    // Of a device that counts so, two bytes for each address are wrong.
    let short = [unit, 3, 4, 0, 0, 0, 7];
    let wrong = dissected(&wide, &short, Direction::Answer, Some(&read[..])).wrong;
    assert_eq!(wrong.as_deref(), Some("response with 4 data bytes, expected 8"));
}

#[test]
fn an_answer_without_any_object_is_named_all_the_same() {
    let answer = dissect(&with_crc(&[1, 0x2B, 0x0E, 1, 1, 0, 0, 0]), None, Some(Direction::Answer), None);
    assert_eq!(answer.summary, "encapsulated interface transport");
}

#[test]
fn unit_0_is_a_broadcast_on_a_serial_line_only() {
    let message = [0, 6, 0, 1, 0, 3];
    let rtu = dissect(&with_crc(&message), None, None, None);
    assert_eq!(rtu.summary, "broadcast write register 40002 = 3 (0x0001, 0x0003)");
    assert!(rtu.fields[0].words.contains("none responds"));
    assert!(dissect(&with_mbap(1, &message), None, None, None).fields[3].words.contains("the device itself"));
}

#[test]
fn unit_58_is_not_taken_for_the_colon_of_ascii() {
    check("3A 03 00 00 00 01", "", "unit 58 read holding registers 40001 (0x0000, 1)");
    check("3A 2B 0E 01 00", "", "unit 58 read device identification, basic identification from VendorName");
}

#[test]
fn what_may_be_two_things_says_so() {
    let dissection = check("01 06 03 EA 00 32", "", "unit 1 write register 41003 = 50 (0x03EA, 0x0032)");
    assert_eq!(
        (dissection.direction, dissection.also.as_deref()),
        (None, Some("the response repeats the request: these bytes may be either"))
    );
    // Eight bytes that begin 01 01 03: a request from 00769, or 24 coils.
    let dissection = check("01 01 03 00 00 05", "", "unit 1 read coils 00769–00773 (0x0300, 5)");
    assert_eq!(dissection.also.as_deref(), Some("a response: 24 bits: 0000 0000 0000 0000 1010 0000"));
    // A request for 27397 coils would be refused: this is an answer.
    let dissection = check("01 01 03 CD 6B 05", "", "24 bits: 1011 0011 1101 0110 1010 0000");
    assert!(dissection.also.unwrap().starts_with("a request: unit 1 read coils"));
    let dissection = check("01 03 03 EA 00 01", "", "unit 1 read holding registers 41003 (0x03EA, 1)");
    assert_eq!(dissection.also, None);
}

#[test]
fn broken_frames_say_what_is_wrong_and_what_it_should_be() {
    let wrong = |bytes: &[u8]| dissect(bytes, None, None, None).wrong.unwrap();
    assert_eq!(wrong(&[1, 3, 3, 0xEA, 0, 1, 0xA5, 0xBB]), "CRC error: got A5 BB, computed A5 BA");
    assert_eq!(wrong(b":010303EA00010F\r\n"), "LRC error: got 0F, computed 0E");
    assert_eq!(wrong(b":010303EA00010E"), "CR LF missing at the end");
    let end = |bytes: &[u8]| dissect(bytes, None, None, None).fields.last().map(|field| field.words.clone());
    assert_eq!(end(b":010303EA00010E\r\n").as_deref(), Some("CR LF"));
    assert_eq!(end(b":010303EA00010E\n").as_deref(), Some("must be CR LF"));
    assert_eq!(wrong(b":01G303EA00010E\r\n"), "`G` at character 4 is not a hex digit");
    assert_eq!(wrong(&[1, 3, 3, 0xEA, 0]), "cut short: 1 byte of count missing");
    assert_eq!(wrong(&[1, 3, 4, 0, 1]), "cut short: 2 bytes of register 2 missing");
    assert_eq!(wrong(&[1, 6, 0, 1, 0, 1, 9]), "1 byte too many");
    assert_eq!(wrong(&[]), "cut short: 1 byte of unit missing");
    let tcp = |bytes: &[u8]| dissect(bytes, Some(Framing::Mbap), None, None).wrong.unwrap();
    assert_eq!(tcp(&[0, 1, 0, 0, 0, 9, 1, 3, 0, 0, 0, 1]), "MBAP length says 9, 6 bytes follow");
    assert_eq!(tcp(&[0, 1, 0, 7, 0, 6, 1, 3, 0, 0, 0, 1]), "MBAP protocol 7, expected 0");
    let swapped = dissect(&[1, 3, 3, 0xEA, 0, 1, 0xBA, 0xA5], None, None, None);
    assert!(swapped.fields.last().unwrap().words.starts_with("bytes swapped: A5 BA is right"));
    let asked = [1, 3, 0, 0, 0, 1];
    let answer = dissect(&with_crc(&[2, 3, 2, 0, 1]), None, None, Some(&asked));
    assert_eq!(answer.wrong.as_deref(), Some("unit 2 answered in place of unit 1"));
}

#[test]
fn an_answer_on_a_line_finds_its_request_before_it() {
    let frame = |sent: bool, message: &[u8], transaction: u16| Frame {
        at: jiff::Timestamp::UNIX_EPOCH,
        sent,
        bytes: with_mbap(transaction, message).into(),
        framing: Framing::Mbap,
        result: FrameResult::Good,
        unit: Some(1),
        number: 0,
    };
    let line = [frame(true, &[1, 3, 0, 10, 0, 1], 1), frame(true, &[1, 3, 0, 20, 0, 1], 2)];
    let dissection = in_traffic(&WideAddresses::default(), &frame(false, &[1, 3, 2, 0, 5], 1), line.iter().rev());
    assert_eq!(dissection.fields[6].name, "40011 / 0x000A");
    let dissection = in_traffic(&WideAddresses::default(), &frame(false, &[1, 3, 2, 0, 5], 3), line.iter().rev());
    assert_eq!(dissection.fields[6].name, "register 1");
}

proptest::proptest! {
    /// Whatever came over the line is described, byte by byte.
    #[test]
    fn no_bytes_are_beyond_words(
        bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..300),
        framing in proptest::option::of(proptest::sample::select(vec![Framing::Rtu, Framing::Ascii, Framing::Mbap])),
        direction in proptest::option::of(proptest::sample::select(vec![Direction::Request, Direction::Answer])),
    ) {
        let dissection = dissect(&bytes, framing, direction, None);
        proptest::prop_assert!(!dissection.summary.is_empty() && dissection.wrong.is_none_or(|wrong| !wrong.is_empty()));
        let mut at = 0;
        for field in &dissection.fields {
            proptest::prop_assert_eq!(field.range.start, at);
            at = field.range.end;
        }
        proptest::prop_assert_eq!(at, bytes.len());
    }
}
