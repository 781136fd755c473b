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

use crate::plant::tag::{Kind, Order, Point};

/// The number that the words of a point hold; `None` for what is no number: BCD with a digit above 9, NaN, infinity,
/// or a 64-bit integer beyond 2^53, which an `f64` cannot carry exactly. `words` has [`Point::len`] words.
pub fn decode(point: Point, words: &[u16]) -> Option<f64> {
    let bytes = to_bytes(point.order, words);
    let bits = bytes.iter().fold(0u64, |bits, byte| (bits << 8) | u64::from(*byte));
    if let Some((low, width)) = point.field {
        return Some(((bits >> low) & mask(width)) as f64);
    }
    match point.kind {
        Kind::Bool => Some(f64::from(u8::from(bits != 0))),
        Kind::I16 => Some(f64::from(bits as u16 as i16)),
        Kind::U16 => Some(f64::from(bits as u16)),
        Kind::I32 => Some(f64::from(bits as u32 as i32)),
        Kind::U32 => Some(f64::from(bits as u32)),
        Kind::I64 => exact(i128::from(bits as i64)),
        Kind::U64 => exact(i128::from(bits)),
        Kind::F32 => Some(f64::from(f32::from_bits(bits as u32))).filter(|value| value.is_finite()),
        Kind::F64 => Some(f64::from_bits(bits)).filter(|value| value.is_finite()),
        Kind::Bcd16 => from_bcd(bits, 4),
        Kind::Bcd32 => from_bcd(bits, 8),
    }
}

/// The words to write for a number; `None` if it does not fit the type, is no whole number where one is needed, or the
/// point is a field of bits inside a word (writing it would be a read-modify-write that races with the device).
pub fn encode(point: Point, value: f64) -> Option<Vec<u16>> {
    if point.field.is_some() || !value.is_finite() {
        return None;
    }
    let whole = |low: f64, high: f64| (value.fract() == 0.0 && low <= value && value <= high).then_some(value as i64);
    let bits = match point.kind {
        Kind::Bool => whole(0.0, 1.0)? as u64,
        Kind::I16 => whole(f64::from(i16::MIN), f64::from(i16::MAX))? as u64,
        Kind::U16 => whole(0.0, f64::from(u16::MAX))? as u64,
        Kind::I32 => whole(f64::from(i32::MIN), f64::from(i32::MAX))? as u64,
        Kind::U32 => whole(0.0, f64::from(u32::MAX))? as u64,
        Kind::I64 => whole(-EXACT, EXACT)? as u64,
        Kind::U64 => whole(0.0, EXACT)? as u64,
        Kind::F32 => u64::from(Some(value as f32).filter(|value| value.is_finite())?.to_bits()),
        Kind::F64 => value.to_bits(),
        Kind::Bcd16 => to_bcd(whole(0.0, 9_999.0)?),
        Kind::Bcd32 => to_bcd(whole(0.0, 99_999_999.0)?),
    };
    let count = usize::from(point.kind.words()) * 2;
    Some(from_bytes(point.order, &bits.to_be_bytes()[8 - count..]))
}

/// The masks of a mask write (function 22: result = (word AND and) OR (or AND NOT and)) that sets a field of bits inside
/// a word and leaves the other bits to the device (V1.1b3, 6.16).
pub fn field_masks(point: Point, value: f64) -> Option<(u16, u16)> {
    let (low, width) = point.field.filter(|_| point.kind.words() == 1)?;
    let field = mask(width);
    if value.fract() != 0.0 || value < 0.0 || field as f64 <= value - 1.0 {
        return None;
    }
    let on_wire = |bits: u64| from_bytes(point.order, &(bits as u16).to_be_bytes())[0];
    Some((!on_wire(field << low), on_wire((value as u64) << low)))
}

/// Whole numbers up to here an `f64` carries exactly.
const EXACT: f64 = 9_007_199_254_740_992.0;

fn exact(value: i128) -> Option<f64> {
    (value.unsigned_abs() <= EXACT as u128).then_some(value as f64)
}

fn mask(width: u8) -> u64 {
    u64::MAX.checked_shr(64 - u32::from(width)).unwrap_or(0)
}

fn from_bcd(bits: u64, digits: u32) -> Option<f64> {
    let digit = |place: u32| (bits >> (4 * place)) & 0xF;
    (0..digits).rev().try_fold(0.0, |value, place| (digit(place) <= 9).then(|| value * 10.0 + digit(place) as f64))
}

fn to_bcd(value: i64) -> u64 {
    let digit = |place: u32| (value as u64 / 10u64.pow(place)) % 10;
    (0..8).fold(0, |bits, place| bits | (digit(place) << (4 * place)))
}

/// The bytes A B C D … of the value, most significant first.
fn to_bytes(order: Order, words: &[u16]) -> Vec<u8> {
    let in_order: Vec<u16> = match order {
        Order::Abcd | Order::Badc => words.to_vec(),
        Order::Cdab | Order::Dcba => words.iter().rev().copied().collect(),
    };
    let swapped = matches!(order, Order::Badc | Order::Dcba);
    in_order.into_iter().flat_map(|word| if swapped { word.to_le_bytes() } else { word.to_be_bytes() }).collect()
}

fn from_bytes(order: Order, bytes: &[u8]) -> Vec<u16> {
    let swapped = matches!(order, Order::Badc | Order::Dcba);
    let word = |pair: &[u8]| {
        let pair = [pair[0], pair[1]];
        if swapped { u16::from_le_bytes(pair) } else { u16::from_be_bytes(pair) }
    };
    let mut words: Vec<u16> = bytes.chunks_exact(2).map(word).collect();
    if matches!(order, Order::Cdab | Order::Dcba) {
        words.reverse();
    }
    words
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::tag::Table;

    fn point(kind: Kind, order: Order) -> Point {
        Point { table: Table::Holding, address: 0, kind, order, field: None }
    }

    #[test]
    fn the_same_voltage_in_four_orders() {
        let value = f64::from(230.2f32);
        for (order, words) in [
            (Order::Abcd, [0x4366, 0x3333]),
            (Order::Cdab, [0x3333, 0x4366]),
            (Order::Badc, [0x6643, 0x3333]),
            (Order::Dcba, [0x3333, 0x6643]),
        ] {
            assert_eq!(decode(point(Kind::F32, order), &words), Some(value), "{order:?}");
            assert_eq!(encode(point(Kind::F32, order), value).as_deref(), Some(&words[..]), "{order:?}");
        }
    }

    #[test]
    fn what_is_no_number_is_none() {
        for (kind, words) in [
            (Kind::Bcd16, &[0x12A4][..]),
            (Kind::Bcd32, &[0x1234, 0xF000]),
            (Kind::F32, &[0x7FC0, 0x0000]),
            (Kind::F32, &[0x7F80, 0x0000]),
            (Kind::U64, &[0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF]),
        ] {
            assert_eq!(decode(point(kind, Order::Abcd), words), None, "{kind:?} {words:04X?}");
        }
    }

    #[test]
    fn what_does_not_fit_is_not_written() {
        for (kind, value) in [
            (Kind::U16, -1.0),
            (Kind::U16, 65_536.0),
            (Kind::U16, 0.5),
            (Kind::I16, 32_768.0),
            (Kind::Bcd16, 10_000.0),
            (Kind::F32, 1e300),
            (Kind::F64, f64::NAN),
            (Kind::I64, 1e17),
        ] {
            assert_eq!(encode(point(kind, Order::Abcd), value), None, "{kind:?} {value}");
        }
    }

    #[test]
    fn a_field_of_bits_is_read_and_never_written() {
        let field = Point { field: Some((4, 2)), ..point(Kind::U16, Order::Abcd) };
        assert_eq!(decode(field, &[0x0020]), Some(2.0));
        assert_eq!(encode(field, 2.0), None);
        assert_eq!(decode(Point { field: Some((0, 16)), ..field }, &[0xFFFF]), Some(65_535.0));
    }

    #[test]
    fn a_field_of_bits_is_set_without_touching_the_others() {
        let field = Point { field: Some((4, 2)), ..point(Kind::U16, Order::Abcd) };
        assert_eq!(field_masks(field, 2.0), Some((0xFFCF, 0x0020)));
        assert_eq!(field_masks(field, 4.0), None, "two bits hold 0 to 3");
        let swapped = Point { order: Order::Badc, ..field };
        assert_eq!(field_masks(swapped, 2.0), Some((0xCFFF, 0x2000)));
        for (word, value) in [(0x1234u16, 3.0), (0xFFFF, 0.0), (0, 1.0)] {
            let (and, or) = field_masks(field, value).expect("it fits");
            let set = (word & and) | (or & !and);
            assert_eq!(decode(field, &[set]), Some(value));
            assert_eq!(set & !0x30, word & !0x30);
        }
        assert_eq!(field_masks(point(Kind::U16, Order::Abcd), 1.0), None);
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            kind in prop::sample::select(vec![
                Kind::I16, Kind::U16, Kind::I32, Kind::U32, Kind::I64, Kind::U64, Kind::F32, Kind::F64, Kind::Bcd16, Kind::Bcd32,
            ]),
            order in prop::sample::select(vec![Order::Abcd, Order::Cdab, Order::Badc, Order::Dcba]),
            words in prop::array::uniform4(any::<u16>()),
        ) {
            let point = point(kind, order);
            let words = &words[..usize::from(kind.words())];
            if let Some(value) = decode(point, words) {
                // −0.0 and 0.0 are one value with two patterns; every other number has exactly one.
                if value != 0.0 {
                    prop_assert_eq!(encode(point, value), Some(words.to_vec()));
                }
            }
        }
    }
}
