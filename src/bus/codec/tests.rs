//! What is read is what was written, and what is no number is none.

use proptest::prelude::*;

use super::*;
use crate::plant::{tag::Table, visible::is_printable};

fn point(kind: DataType, order: ByteOrder) -> Point {
    Point { table: Table::Holding, address: 0, kind, order, field: None }
}

#[test]
fn the_same_voltage_in_four_orders() {
    let value = f64::from(230.2f32);
    for (order, words) in [
        (ByteOrder::Abcd, [0x4366, 0x3333]),
        (ByteOrder::Cdab, [0x3333, 0x4366]),
        (ByteOrder::Badc, [0x6643, 0x3333]),
        (ByteOrder::Dcba, [0x3333, 0x6643]),
    ] {
        assert_eq!(decode(point(DataType::F32, order), &words), Some(value.into()), "{order:?}");
        assert_eq!(encode(point(DataType::F32, order), value).as_deref(), Some(&words[..]), "{order:?}");
    }
}

#[test]
fn what_is_no_number_is_none() {
    for (kind, words) in [
        (DataType::Bcd16, &[0x12A4][..]),
        (DataType::Bcd32, &[0x1234, 0xF000]),
        (DataType::F32, &[0x7FC0, 0x0000]),
        (DataType::F32, &[0x7F80, 0x0000]),
    ] {
        assert_eq!(decode(point(kind, ByteOrder::Abcd), words), None, "{kind:?} {words:04X?}");
    }
}

#[test]
fn a_counter_too_large_for_a_double_keeps_all_its_digits() {
    let orders = [ByteOrder::Abcd, ByteOrder::Cdab, ByteOrder::Badc, ByteOrder::Dcba];
    let two_53 = 1i128 << 53;
    let unsigned = [two_53 - 1, two_53, two_53 + 1, (1 << 63) - 1, 1 << 63, (1 << 63) + 1, (1 << 64) - 1];
    let signed = [two_53 + 1, -two_53 + 1, -two_53, -two_53 - 1, (1 << 63) - 1, -(1 << 63), -(1 << 63) + 1];
    let unsigned = unsigned.map(|number| (DataType::U64, number));
    for (kind, number) in unsigned.into_iter().chain(signed.map(|number| (DataType::I64, number))) {
        for order in orders {
            let point = point(kind, order);
            let words = from_bytes(order, &Exact::whole(number).bits().to_be_bytes());
            let decoded = decode(point, &words).expect("a number");
            assert_eq!(decoded.to_string(), number.to_string(), "{kind:?} {order:?}");
            assert_eq!(encode(point, decoded), Some(words), "{kind:?} {order:?} {number}");
        }
    }
    let field = Point { field: Some((1, 63)), ..point(DataType::U64, ByteOrder::Abcd) };
    let bits = decode(field, &[0xFFFF; 4]).expect("a field");
    assert_eq!(bits.to_string(), "9223372036854775807");
}

#[test]
fn what_does_not_fit_is_not_written() {
    for (kind, value) in [
        (DataType::U16, -1.0),
        (DataType::U16, 65_536.0),
        (DataType::U16, 0.5),
        (DataType::I16, 32_768.0),
        (DataType::Bcd16, 10_000.0),
        (DataType::F32, 1e300),
        (DataType::F64, f64::NAN),
        (DataType::I64, 1e17),
    ] {
        assert_eq!(encode(point(kind, ByteOrder::Abcd), value), None, "{kind:?} {value}");
    }
}

#[test]
fn text_is_shown_as_it_is_and_what_cannot_be_printed_as_a_dot() {
    let check = |bytes: &[u8], count: u8, expect: &str| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(2), 0xFF);
        let words = from_bytes(ByteOrder::Abcd, &bytes);
        let text = decode_text(point(DataType::Text(count), ByteOrder::Abcd), &words);
        assert_eq!(text.as_deref(), Some(expect), "{bytes:02X?}");
    };
    check(b"PXR4TAY1", 8, "PXR4TAY1");
    check(b"PXR4\0\0  ", 8, "PXR4");
    check(b"V1.2X?", 5, "V1.2X");
    check(b"\0\0\0\0", 4, "");
    check(b"    ", 4, "");
    check(b" A B", 4, " A B");
    check(b"A\0B\x1B", 4, "A·B·");
    check(b"20 \xB0C", 5, "20 ·C");
    check("20 °C".as_bytes(), 6, "20 °C");
    check("ถัง\0".as_bytes(), 10, "ถัง");
    check("AB\u{202E}C".as_bytes(), 6, "AB·C");
    check(b"\x01\xFF\0\0", 4, "01 FF");
    check(b"\x01 \xFF\0", 4, "01 20 FF");
    assert_eq!(decode_text(point(DataType::U16, ByteOrder::Abcd), &[0x4142]), None);
    assert_eq!(decode_text(point(DataType::Text(4), ByteOrder::Abcd), &[0x4142]), None, "too few words");
    assert_eq!(decode(point(DataType::Text(2), ByteOrder::Abcd), &[0x3432]), None, "words are no number");
}

#[test]
fn a_text_with_swapped_bytes_reads_the_same() {
    let swapped = point(DataType::Text(5), ByteOrder::Badc);
    assert_eq!(decode_text(swapped, &[0x5850, 0x3452, 0x0041]).as_deref(), Some("PXR4A"));
    assert_eq!(encode_text(swapped, "PXR4A"), Some(vec![0x5850, 0x3452, 0x0041]));
    for text in ["PXR4TA", "PXR4 ", "P\nX"] {
        assert_eq!(encode_text(swapped, text), None, "{text:?} would not read back");
    }
}

#[test]
fn a_field_of_bits_is_read_and_never_written() {
    let field = Point { field: Some((4, 2)), ..point(DataType::U16, ByteOrder::Abcd) };
    assert_eq!(decode(field, &[0x0020]), Some(2.0.into()));
    assert_eq!(encode(field, 2.0), None);
    assert_eq!(decode(Point { field: Some((0, 16)), ..field }, &[0xFFFF]), Some(65_535.0.into()));
}

#[test]
fn a_field_of_a_signed_type_has_a_sign() {
    let field = Point { field: Some((4, 12)), ..point(DataType::I16, ByteOrder::Abcd) };
    for (word, value) in [(0xFFF0, -1.0), (0x8000, -2_048.0), (0x7FF0, 2_047.0), (0x0010, 1.0)] {
        assert_eq!(decode(field, &[word]), Some(value.into()), "{word:04X}");
        assert_eq!(field_masks(field, value), Some((0x000F, word)), "{word:04X}");
    }
    assert_eq!(field_masks(field, 2_048.0), None);
    let bit = Point { field: Some((15, 1)), ..field };
    assert_eq!(decode(bit, &[0x8000]), Some(1.0.into()), "one bit is set or not");
    let whole = Point { field: Some((0, 64)), ..point(DataType::I64, ByteOrder::Abcd) };
    assert_eq!(decode(whole, &[0xFFFF; 4]), Some((-1.0).into()));
}

#[test]
fn a_field_of_bits_is_set_without_touching_the_others() {
    let field = Point { field: Some((4, 2)), ..point(DataType::U16, ByteOrder::Abcd) };
    assert_eq!(field_masks(field, 2.0), Some((0xFFCF, 0x0020)));
    assert_eq!(field_masks(field, 4.0), None, "two bits hold 0 to 3");
    let swapped = Point { order: ByteOrder::Badc, ..field };
    assert_eq!(field_masks(swapped, 2.0), Some((0xCFFF, 0x2000)));
    for (word, value) in [(0x1234u16, 3.0), (0xFFFF, 0.0), (0, 1.0)] {
        let (and, or) = field_masks(field, value).expect("it fits");
        let set = (word & and) | (or & !and);
        assert_eq!(decode(field, &[set]), Some(value.into()));
        assert_eq!(set & !0x30, word & !0x30);
    }
    assert_eq!(field_masks(point(DataType::U16, ByteOrder::Abcd), 1.0), None);
}

proptest! {
    #[test]
    fn text_reads_back_as_written(
        text in "[ -~°ก-๙]{0,40}", spare in 0u8..8, order in prop::sample::select(vec![ByteOrder::Abcd, ByteOrder::Badc]),
    ) {
        let text = text.trim_end_matches(' ');
        let count = u8::try_from(text.len()).unwrap_or(u8::MAX).saturating_add(spare).max(1);
        let point = point(DataType::Text(count), order);
        if let Some(words) = encode_text(point, text) {
            prop_assert_eq!(words.len(), usize::from(point.words()));
            let back = decode_text(point, &words);
            prop_assert_eq!(back.as_deref(), Some(text));
        } else {
            prop_assert!(text.len() > usize::from(count), "{text:?} fits into {count}");
        }
    }

    #[test]
    fn no_bytes_break_a_screen(words in prop::collection::vec(any::<u16>(), 8)) {
        let text = decode_text(point(DataType::Text(16), ByteOrder::Abcd), &words);
        prop_assert!(text.is_some_and(|text| text.chars().all(is_printable)));
    }

    #[test]
    fn what_is_written_reads_back(
        kind in prop::sample::select(numbers()),
        order in prop::sample::select(ByteOrder::ALL.to_vec()),
        words in prop::array::uniform4(any::<u16>()),
    ) {
        let point = point(kind, order);
        let words = &words[..usize::from(kind.words())];
        if let Some(value) = decode(point, words) {
            let written = encode(point, value).expect("what is read can be written");
            prop_assert_eq!(decode(point, &written), Some(value));
            // −0.0 and 0.0 are one value with two patterns, and 24 bits may be filled up or not; all else has exactly one.
            if value != 0.0 && kind != DataType::I24 {
                prop_assert_eq!(written, words.to_vec());
            }
        }
    }

    #[test]
    fn every_number_of_a_type_is_written_and_read(
        kind in prop::sample::select(numbers()),
        order in prop::sample::select(ByteOrder::ALL.to_vec()),
        part in any::<u64>(),
    ) {
        if let Some((low, high)) = kind.whole_range() {
            let value = Exact::whole(low + i128::from(part) % (high - low + 1));
            let words = encode(point(kind, order), value).expect("it fits");
            prop_assert_eq!(words.len(), usize::from(kind.words()));
            prop_assert_eq!(decode(point(kind, order), &words), Some(value));
            for beyond in [low - 1, high + 1] {
                prop_assert_eq!(encode(point(kind, order), Exact::whole(beyond)), None);
            }
        }
    }

    #[test]
    fn a_pattern_of_bits_is_what_is_read(kind in prop::sample::select(numbers()), words in prop::array::uniform4(any::<u16>())) {
        let point = point(kind, ByteOrder::Abcd);
        let words = &words[..usize::from(kind.words())];
        let pattern = words.iter().fold(0, |bits: u64, word| bits << 16 | u64::from(*word));
        if u32::from(kind.bits()) == 16 * u32::from(kind.words()) {
            let meant = point.raw_number(pattern.into(), true);
            prop_assert_eq!(meant.number(), decode(point, words), "{:?} of {:X}", kind, pattern);
        }
    }

    #[test]
    fn a_byte_is_set_without_touching_the_other(
        kind in prop::sample::select(vec![DataType::I8, DataType::U8]),
        order in prop::sample::select(vec![ByteOrder::Abcd, ByteOrder::Badc]),
        word in any::<u16>(),
        part in any::<u8>(),
    ) {
        let point = point(kind, order);
        let (low, _) = kind.whole_range().expect("a whole number");
        let value = Exact::whole(low + i128::from(part));
        let (and, or) = field_masks(point, value).expect("it fits");
        let set = (word & and) | (or & !and);
        prop_assert_eq!(decode(point, &[set]), Some(value));
        let other = if order == ByteOrder::Abcd { 0xFF00 } else { 0x00FF };
        prop_assert_eq!(set & other, word & other);
    }
}

/// Every type that has registers of its own.
fn numbers() -> Vec<DataType> {
    let all = DataType::NUMBERS.into_iter();
    all.filter(|kind| !kind.is_half() && *kind != DataType::Bool).collect()
}

#[test]
fn rare_types_are_read_as_their_manuals_say() {
    let check = |kind, order, words: &[u16], expect: Option<f64>| {
        assert_eq!(decode(point(kind, order), words), expect.map(Exact::from), "{kind} {order:?} {words:04X?}");
    };
    let abcd = ByteOrder::Abcd;
    check(DataType::U8, abcd, &[0x12F4], Some(244.0));
    check(DataType::I8, abcd, &[0x12F4], Some(-12.0));
    check(DataType::U8, ByteOrder::Badc, &[0x12F4], Some(18.0));
    check(DataType::U24, abcd, &[0x0012, 0x3456], Some(1_193_046.0));
    check(DataType::U24, abcd, &[0x0112, 0x3456], None);
    check(DataType::I24, abcd, &[0x00FF, 0xFFFF], Some(-1.0));
    check(DataType::I24, abcd, &[0xFFFF, 0xFFFF], Some(-1.0));
    check(DataType::I24, abcd, &[0xFF00, 0x0001], None);
    check(DataType::U48, ByteOrder::Cdab, &[0x0001, 0x0000, 0x8000], Some(140_737_488_355_329.0));
    check(DataType::I48, abcd, &[0xFFFF, 0xFFFF, 0xFFFE], Some(-2.0));
    check(DataType::F16, abcd, &[0x4CD3], Some(19.296_875));
    check(DataType::F16, abcd, &[0x7E00], None);
    check(DataType::Sm16, abcd, &[0x8005], Some(-5.0));
    check(DataType::Sm32, abcd, &[0x8000, 0x0005], Some(-5.0));
    check(DataType::Mod10k(2), abcd, &[1234, 5678], Some(12_345_678.0));
    check(DataType::Mod10k(3), ByteOrder::Cdab, &[3, 2, 1], Some(100_020_003.0));
    check(DataType::Mod10k(2), abcd, &[10_000, 0], None);
    check(DataType::Mod10k(2), abcd, &[0xFFFF, 0xFFFF], None);
    check(DataType::SignedMod10k(2), abcd, &[0xFFFF, 0xFFFE], Some(-10_002.0));
    check(DataType::SignedMod10k(2), abcd, &[0xFFFF, 1], None);
    check(DataType::SignedMod10k(2), abcd, &[0x8000, 0], None);
    for half in [DataType::I8, DataType::U8] {
        assert_eq!(encode(point(half, abcd), 1.0), None, "the other byte would be lost");
    }
}

#[test]
fn text_may_end_at_nul_or_have_one_character_a_register() {
    let check = |kind, order, words: &[u16], expect: &str| {
        let point = point(kind, order);
        assert_eq!(decode_text(point, words).as_deref(), Some(expect), "{kind}");
        assert_eq!(encode_text(point, expect).and_then(|words| decode_text(point, &words)).as_deref(), Some(expect));
    };
    let abcd = ByteOrder::Abcd;
    check(DataType::TextToNul(6), abcd, &[0x4142, 0x4300, 0x5A5A], "ABC");
    check(DataType::TextToNul(6), abcd, &[0x0041, 0x4243, 0x4445], "");
    check(DataType::Chars(3), abcd, &[0x0041, 0x0042, 0x0020], "AB");
    check(DataType::Chars(3), ByteOrder::Badc, &[0x4100, 0x4200, 0x4300], "ABC");
    let odd = decode_text(point(DataType::Chars(2), abcd), &[0x0141, 0x0042]);
    assert_eq!(odd.as_deref(), Some("·B"), "no character of one byte");
}

#[test]
fn a_part_is_modified_in_any_register_of_a_word() {
    let high = Point { field: Some((20, 4)), ..point(DataType::U32, ByteOrder::Cdab) };
    let words = modified(high, &[0x1234, 0xABCD], 5.0).expect("it fits");
    assert_eq!(words, [0x1234, 0xAB5D]);
    assert_eq!(decode(high, &words), Some(5.0.into()));
    assert!(modified(high, &[0x1234, 0xABCD], 15.0).is_some(), "four bits hold 0 to 15");
    assert_eq!(modified(high, &[0x1234, 0xABCD], 16.0), None);
    assert_eq!(modified(high, &[0x1234], 5.0), None, "too few registers");
    assert_eq!(modified(point(DataType::I8, ByteOrder::Badc), &[0x1234], -1.0), Some(vec![0xFF34]));
    assert_eq!(modified(point(DataType::U16, ByteOrder::Abcd), &[0x1234], 1.0), None, "it is the whole register");
}
