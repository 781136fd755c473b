//! Raw words and bits to numbers and back: one codec for both directions.
//!
//! ```text
//!  230.2 V as float32 is 43 66 33 33
//!  order   word 0  word 1
//!  ABCD    4366    3333      big-endian, the default of the Modbus world
//!  CDAB    3333    4366      low word first (DirectLOGIC)
//!  BADC    6643    3333      bytes swapped inside words
//!  DCBA    3333    6643      little-endian
//! ```

use crate::plant::{
    exact::Exact,
    number::{to_f32, to_u16},
    tag::{ByteOrder, DataType, Encoding, Point},
    visible::is_printable,
};

/// The number that the words of a point hold; `None` for what is not a number: BCD with a digit above 9, NaN, infinity.
/// `words` has [`Point::len`] words.
#[expect(clippy::cast_possible_truncation, reason = "each kind takes the bits of its own width")]
pub fn decode(point: Point, words: &[u16]) -> Option<Exact> {
    let bytes = to_bytes(point.order, words);
    let bits = bytes.iter().fold(0u64, |bits, byte| (bits << 8) | u64::from(*byte));
    if let Some((low, width)) = point.field {
        let number = i128::from((bits >> low) & mask(width));
        let is_negative = point.kind.is_signed_field(width) && number >> (width - 1) == 1;
        return Some(Exact::whole(if is_negative { number - (1 << width) } else { number }));
    }
    let size = 16 * u32::from(point.kind.registers());
    let number = match point.kind.encoding() {
        Encoding::Bit => f64::from(u8::from(bits != 0)),
        Encoding::Unsigned => return Some(Exact::whole(bits.into())),
        Encoding::Signed => return Some(Exact::whole(((bits << (64 - size)).cast_signed() >> (64 - size)).into())),
        Encoding::Float if size == 32 => f64::from(f32::from_bits(bits as u32)),
        Encoding::Float => f64::from_bits(bits),
        Encoding::Bcd => from_bcd(bits, size / 4)?,
        Encoding::Text => return None,
    };
    number.is_finite().then(|| number.into())
}

/// What stands for a byte that is no part of a printable character.
pub const UNPRINTABLE: char = '·';

/// The text that the words of a point hold, two characters a word, in UTF-8 (which plain ASCII is): NULs and blanks at
/// its end are filling, each byte or character that cannot be printed is shown as [`UNPRINTABLE`], and text of which
/// nothing can be printed as the hex of its bytes. `None` for a point that holds no text.
pub fn decode_text(point: Point, words: &[u16]) -> Option<String> {
    let DataType::Text(count) = point.kind else { return None };
    let bytes = to_bytes(point.order, words);
    let bytes = bytes.get(..usize::from(count))?;
    let end = bytes.iter().rposition(|byte| !matches!(byte, 0 | b' ')).map_or(0, |last| last + 1);
    let bytes = &bytes[..end];
    let mut text = String::new();
    for chunk in bytes.utf8_chunks() {
        text.extend(chunk.valid().chars().map(|letter| if is_printable(letter) { letter } else { UNPRINTABLE }));
        text.extend(chunk.invalid().iter().map(|_| UNPRINTABLE));
    }
    let nothing = !text.is_empty() && text.chars().all(|letter| letter == UNPRINTABLE || letter == ' ');
    Some(if nothing { bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ") } else { text })
}

/// The words that hold a text, filled with NULs; `None` if it is too long, ends in what would be taken for filling, or
/// has characters that cannot be printed.
pub fn encode_text(point: Point, text: &str) -> Option<Vec<u16>> {
    let DataType::Text(count) = point.kind else { return None };
    let fits = text.len() <= usize::from(count) && !text.ends_with(' ') && text.chars().all(is_printable);
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(usize::from(point.kind.registers()) * 2, 0);
    fits.then(|| from_bytes(point.order, &bytes))
}

/// The words to write for a number; `None` if it does not fit the type, is no whole number where one is needed, or the
/// point is a field of bits inside a word (writing it would be a read-modify-write that races with the device).
pub fn encode(point: Point, value: impl Into<Exact>) -> Option<Vec<u16>> {
    let exact = value.into();
    if point.field.is_some() || !exact.is_finite() {
        return None;
    }
    let value = exact.near();
    let whole = || {
        let (low, high) = point.kind.whole_range()?;
        exact.as_whole().filter(|whole| (low..=high).contains(whole)).map(|_| exact.bits())
    };
    let bits = match point.kind.encoding() {
        Encoding::Bit | Encoding::Unsigned | Encoding::Signed => whole()?,
        Encoding::Bcd => to_bcd(whole()?),
        Encoding::Float if point.kind.registers() == 2 => {
            u64::from(Some(to_f32(value)).filter(|value| value.is_finite())?.to_bits())
        }
        Encoding::Float => value.to_bits(),
        Encoding::Text => return None,
    };
    let count = usize::from(point.kind.registers()) * 2;
    Some(from_bytes(point.order, &bits.to_be_bytes()[8 - count..]))
}

/// The masks of a mask write (function 22: result = (word AND and) OR (or AND NOT and)) that sets a field of bits inside
/// a word and leaves the other bits to the device (V1.1b3, 6.16).
pub fn field_masks(point: Point, value: impl Into<Exact>) -> Option<(u16, u16)> {
    let (low, width) = point.field.filter(|_| point.kind.registers() == 1)?;
    let field = mask(width);
    let (least, most) = point.raw_range()?;
    let value = value.into().as_whole().filter(|value| (least..=most).contains(value))?;
    let on_wire = |bits: u64| from_bytes(point.order, &to_u16(bits).to_be_bytes())[0];
    Some((!on_wire(field << low), on_wire((Exact::whole(value).bits() & field) << low)))
}

fn mask(width: u8) -> u64 {
    u64::MAX.checked_shr(64 - u32::from(width)).unwrap_or(0)
}

fn from_bcd(bits: u64, digits: u32) -> Option<f64> {
    let digit = |place: u32| (bits >> (4 * place)) & 0xF;
    (0..digits).rev().try_fold(0.0, |value, place| (digit(place) <= 9).then(|| value * 10.0 + digit(place) as f64))
}

fn to_bcd(value: u64) -> u64 {
    let digit = |place: u32| (value / 10u64.pow(place)) % 10;
    (0..8).fold(0, |bits, place| bits | (digit(place) << (4 * place)))
}

/// The bytes A B C D … of the value, most significant first.
fn to_bytes(order: ByteOrder, words: &[u16]) -> Vec<u8> {
    let in_order: Vec<u16> = match order {
        ByteOrder::Abcd | ByteOrder::Badc => words.to_vec(),
        ByteOrder::Cdab | ByteOrder::Dcba => words.iter().rev().copied().collect(),
    };
    let swapped = matches!(order, ByteOrder::Badc | ByteOrder::Dcba);
    in_order.into_iter().flat_map(|word| if swapped { word.to_le_bytes() } else { word.to_be_bytes() }).collect()
}

fn from_bytes(order: ByteOrder, bytes: &[u8]) -> Vec<u16> {
    let swapped = matches!(order, ByteOrder::Badc | ByteOrder::Dcba);
    let word = |pair: &[u8]| {
        let pair = [pair[0], pair[1]];
        if swapped { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) }
    };
    let mut words: Vec<u16> = bytes.chunks_exact(2).map(word).collect();
    if matches!(order, ByteOrder::Cdab | ByteOrder::Dcba) {
        words.reverse();
    }
    words
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::tag::Table;

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
                prop_assert_eq!(words.len(), usize::from(point.len()));
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
            kind in prop::sample::select(vec![
                DataType::I16, DataType::U16, DataType::I32, DataType::U32, DataType::I64, DataType::U64, DataType::F32, DataType::F64, DataType::Bcd16, DataType::Bcd32,
            ]),
            order in prop::sample::select(vec![ByteOrder::Abcd, ByteOrder::Cdab, ByteOrder::Badc, ByteOrder::Dcba]),
            words in prop::array::uniform4(any::<u16>()),
        ) {
            let point = point(kind, order);
            let words = &words[..usize::from(kind.registers())];
            if let Some(value) = decode(point, words) {
                // −0.0 and 0.0 are one value with two patterns; every other number has exactly one.
                if value != 0.0 {
                    prop_assert_eq!(encode(point, value), Some(words.to_vec()));
                }
            }
        }
    }
}
