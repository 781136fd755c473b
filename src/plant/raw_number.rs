//! Raw numbers as a manual gives them, as numbers or as patterns of bits: for `bad_if`, `enum`, signatures and states.

pub use super::bad_span::BadSpan;
use super::{
    exact::Exact,
    half,
    number::{to_f32, to_u16},
    tag::{DataType, Encoding, Point},
};

/// What a number of a manual is to a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RawNumber {
    /// The point reads as this.
    Is(Exact),
    /// A pattern that is no number of the type, and is never shown as one.
    NotANumber,
    /// The point can never hold it.
    Impossible,
}

impl RawNumber {
    /// What it reads as, if that is a number.
    pub fn number(self) -> Option<Exact> {
        match self {
            RawNumber::Is(number) => Some(number),
            RawNumber::NotANumber | RawNumber::Impossible => None,
        }
    }
}

impl DataType {
    /// Lowest and highest raw number, of a whole value or of a field of this many bits. A field of a signed type is signed,
    /// a single bit of it is not.
    pub fn raw_range(self, field: Option<u8>) -> Option<(i128, i128)> {
        match field {
            Some(bits) if self.is_signed_field(bits) => Some((-(1 << (bits - 1)), (1 << (bits - 1)) - 1)),
            Some(bits) => Some((0, (1 << bits) - 1)),
            None => self.whole_range(),
        }
    }

    /// Has a field of this many bits a sign?
    pub fn is_signed_field(self, bits: u8) -> bool {
        self.encoding() == Encoding::Signed && 1 < bits
    }
}

impl Point {
    /// Lowest and highest raw number; `None` for floats and texts.
    pub fn raw_range(self) -> Option<(i128, i128)> {
        self.kind.raw_range(self.field.map(|(_, bits)| bits))
    }

    /// The raw numbers among these whose bits, read without a sign, are outside a range.
    pub fn outside(self, least: Option<i128>, most: Option<i128>) -> Vec<BadSpan> {
        let (modulus, half) = (1_i128 << self.kind.bits(), 1_i128 << (self.kind.bits() - 1));
        let below = (0, least.unwrap_or(0).min(modulus) - 1);
        let above = (most.unwrap_or(modulus).max(-1) + 1, modulus - 1);
        // Where the sign bit is set the numbers are others, and may go the other way.
        let with_sign = |pattern: i128| match self.kind.encoding() {
            Encoding::Signed => pattern - modulus,
            Encoding::SignMagnitude => half - pattern,
            Encoding::Bit
            | Encoding::Unsigned
            | Encoding::Bcd
            | Encoding::Float
            | Encoding::Mod10k
            | Encoding::Text => pattern,
        };
        let mut spans: Vec<(i128, i128)> = Vec::new();
        for (first, last) in [below, above] {
            let plain = (first, last.min(half - 1));
            let signed = (first.max(half), last);
            spans.extend((plain.0 <= plain.1).then_some(plain));
            let ends = [with_sign(signed.0), with_sign(signed.1)];
            spans.extend((signed.0 <= signed.1).then(|| (ends[0].min(ends[1]), ends[0].max(ends[1]))));
        }
        joined(spans)
            .into_iter()
            .map(|(first, last)| BadSpan { first: Exact::whole(first), last: Exact::whole(last) })
            .collect()
    }

    /// A raw number as a profile and a list write it: one that is not whole as the pattern of its bits.
    pub fn raw_text(self, raw: Exact) -> String {
        let is_minus_zero = raw.near() == 0.0 && raw.near().is_sign_negative();
        if raw.as_whole().is_some() && !is_minus_zero {
            return raw.to_string();
        }
        match self.kind.bits() {
            16 if is_minus_zero => "0x8000".to_owned(),
            16 => format!("0x{:04X}", half::bits(raw.near()).unwrap_or(0x7E00)),
            32 => format!("0x{:08X}", to_f32(raw.near()).to_bits()),
            _ => format!("0x{:016X}", raw.near().to_bits()),
        }
    }

    /// What a number means here: `-32768`, `32768` and the pattern `0x8000` are one for an int16. Of a float and a BCD
    /// number only a pattern is one of bits: 9999 is the number.
    pub fn raw_number(self, written: i128, is_pattern: bool) -> RawNumber {
        if self.kind.is_text() {
            return RawNumber::Impossible;
        }
        let bits = u32::from(self.field.map_or(self.kind.bits(), |(_, bits)| bits));
        let bits = if self.table.is_bits() || self.kind == DataType::Bool { 1 } else { bits };
        let is_inside = |range: Option<(i128, i128)>| range.is_some_and(|(low, high)| (low..=high).contains(&written));
        let is_pattern_of = (0..1 << bits).contains(&written);
        match self.kind.encoding() {
            Encoding::Bit | Encoding::Unsigned | Encoding::Signed => {
                let modulus = 1_i128 << bits;
                let same = [written, written - modulus, written + modulus];
                let is_as_wide = -(modulus / 2) <= written && written < modulus;
                let (low, high) = self.raw_range().unwrap_or((0, 1));
                let found = same.into_iter().find(|number| is_as_wide && (low..=high).contains(number));
                found.map_or(RawNumber::Impossible, |number| RawNumber::Is(Exact::whole(number)))
            }
            Encoding::Bcd if is_pattern => match from_bcd(written, bits / 4) {
                _ if !is_pattern_of => RawNumber::Impossible,
                Some(number) => RawNumber::Is(Exact::whole(number)),
                None => RawNumber::NotANumber,
            },
            Encoding::SignMagnitude if is_pattern => {
                let sign = 1 << (bits - 1);
                match is_pattern_of {
                    // A sign without a size reads as −0, which is a mark of its own.
                    true if written == sign => RawNumber::Is(Exact::plain(-0.0)),
                    true if written < sign => RawNumber::Is(Exact::whole(written)),
                    true => RawNumber::Is(Exact::whole(sign - written)),
                    false => RawNumber::Impossible,
                }
            }
            Encoding::Mod10k if is_pattern && !is_pattern_of => RawNumber::Impossible,
            Encoding::Mod10k if is_pattern => {
                let words: Vec<u16> = (0..bits / 16).rev().map(|n| to_u16((written >> (16 * n)) & 0xFFFF)).collect();
                let number = from_mod10k(self.kind, &words);
                number.map_or(RawNumber::NotANumber, |number| RawNumber::Is(Exact::whole(number)))
            }
            Encoding::Bcd | Encoding::Mod10k | Encoding::SignMagnitude if is_inside(self.raw_range()) => {
                RawNumber::Is(Exact::whole(written))
            }
            Encoding::Bcd | Encoding::Mod10k | Encoding::SignMagnitude | Encoding::Text => RawNumber::Impossible,
            Encoding::Float if is_pattern && !is_pattern_of => RawNumber::Impossible,
            Encoding::Float => {
                let number = match (is_pattern, u64::try_from(written), bits) {
                    (true, Ok(pattern), 32) => {
                        u32::try_from(pattern).map_or(f64::NAN, |bits| f32::from_bits(bits).into())
                    }
                    (true, Ok(pattern), 16) => half::value(to_u16(pattern)),
                    (true, Ok(pattern), _) => f64::from_bits(pattern),
                    (_, _, 16) => half::rounded(Exact::whole(written).near()),
                    (_, _, 32) => f64::from(to_f32(Exact::whole(written).near())),
                    _ => Exact::whole(written).near(),
                };
                let is_held = is_pattern || Exact::from(number) == Exact::whole(written);
                match (number.is_finite(), is_held) {
                    (true, true) => RawNumber::Is(number.into()),
                    (false, true) => RawNumber::NotANumber,
                    (_, false) => RawNumber::Impossible,
                }
            }
        }
    }
}

/// The same numbers in as few spans as hold them.
pub fn joined(mut spans: Vec<(i128, i128)>) -> Vec<(i128, i128)> {
    spans.sort_unstable();
    let mut all: Vec<(i128, i128)> = Vec::new();
    for (first, last) in spans {
        match all.last_mut().filter(|before| first <= before.1 + 1) {
            Some(before) => before.1 = before.1.max(last),
            None => all.push((first, last)),
        }
    }
    all
}

/// The number in words of four decimal digits each, the first the highest; `None` where one has more, or another sign.
pub(crate) fn from_mod10k(kind: DataType, words: &[u16]) -> Option<i128> {
    let is_signed = matches!(kind, DataType::SignedMod10k(_));
    let part = |word: &u16| if is_signed { i128::from(word.cast_signed()) } else { i128::from(*word) };
    let parts: Vec<i128> = words.iter().map(part).collect();
    let fits = parts.iter().all(|part| part.abs() < 10_000);
    let has_both = parts.iter().any(|part| *part < 0) && parts.iter().any(|part| 0 < *part);
    (fits && !has_both).then(|| parts.iter().fold(0, |number, part| number * 10_000 + part))
}

fn from_bcd(pattern: i128, digits: u32) -> Option<i128> {
    let digit = |place: u32| (pattern >> (4 * place)) & 0xF;
    (0..digits).rev().try_fold(0, |value, place| (digit(place) <= 9).then(|| value * 10 + digit(place)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::tag::{ByteOrder, Table};

    #[test]
    fn a_pattern_of_the_types_width_is_the_number_it_reads_as() {
        let check = |kind: DataType, field, written: i128, is_pattern: bool, expect: Result<f64, RawNumber>| {
            let point = Point { table: Table::Holding, address: 0, kind, order: ByteOrder::Abcd, field };
            let expect = expect.map_or_else(|found| found, |number| RawNumber::Is(number.into()));
            assert_eq!(point.raw_number(written, is_pattern), expect, "{kind} {field:?} {written}");
        };
        let never = Err(RawNumber::Impossible);
        check(DataType::I16, None, 0x8000, true, Ok(-32_768.0));
        check(DataType::I16, None, 32_768, false, Ok(-32_768.0));
        check(DataType::I16, None, -32_768, false, Ok(-32_768.0));
        check(DataType::I16, None, 0x7FFF, true, Ok(32_767.0));
        check(DataType::I16, None, 0x1_8000, true, never);
        check(DataType::I16, None, -40_000, false, never);
        check(DataType::U16, None, 0xFFFF, true, Ok(65_535.0));
        check(DataType::U16, None, -1, false, Ok(65_535.0));
        check(DataType::I32, None, 0x8000_0000, true, Ok(-2_147_483_648.0));
        check(DataType::U32, None, 0x1_0000_0000, true, never);
        check(DataType::I16, Some((0, 8)), 0xFF, true, Ok(-1.0));
        check(DataType::U16, Some((0, 8)), 0x100, true, never);
        check(DataType::I16, Some((3, 1)), 1, false, Ok(1.0));
        check(DataType::Bcd16, None, 0x9999, true, Ok(9_999.0));
        check(DataType::Bcd16, None, 9_999, false, Ok(9_999.0));
        check(DataType::Bcd16, None, 0xFFFF, true, Err(RawNumber::NotANumber));
        check(DataType::Bcd16, None, 10_000, false, never);
        check(DataType::F32, None, 0xFF7F_FFFF, true, Ok(f64::from(f32::MIN)));
        check(DataType::F32, None, 0x7FC0_0000, true, Err(RawNumber::NotANumber));
        check(DataType::F32, None, -9_999, false, Ok(-9_999.0));
        check(DataType::F32, None, 16_777_217, false, never);
        check(DataType::F64, None, 0xC0C3_8780_0000_0000, true, Ok(-9_999.0));
    }

    #[test]
    fn all_bits_of_a_64_bit_register_are_kept() {
        let of = |kind| Point { table: Table::Holding, address: 0, kind, order: ByteOrder::Abcd, field: None };
        let all = RawNumber::Is(Exact::whole(u64::MAX.into()));
        assert_eq!(of(DataType::U64).raw_number(u64::MAX.into(), true), all);
        assert_eq!(of(DataType::U64).raw_number(-1, false), all);
        assert_eq!(of(DataType::I64).raw_number(1 << 63, true), RawNumber::Is(Exact::whole(i64::MIN.into())));
    }
}
