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
    half,
    number::{to_f32, to_i16, to_u8, to_u16},
    raw_number::from_mod10k,
    tag::{ByteOrder, DataType, Encoding, Point},
    text_value,
};

/// The number that the words of a point hold; `None` for what is not a number: BCD with a digit above 9, NaN, infinity.
/// `words` has [`Point::words`] words.
#[expect(clippy::cast_possible_truncation, reason = "each kind takes the bits of its own width")]
pub fn decode(point: Point, words: &[u16]) -> Option<Exact> {
    let bytes = to_bytes(point.order, words);
    let bits = bytes.iter().fold(0u64, |bits, byte| (bits << 8) | u64::from(*byte));
    if let Some((low, width)) = point.field {
        let number = i128::from((bits >> low) & mask(width));
        let is_negative = point.kind.is_signed_field(width) && number >> (width - 1) == 1;
        return Some(Exact::whole(if is_negative { number - (1 << width) } else { number }));
    }
    let size = u32::from(point.kind.bits());
    let number = match point.kind.encoding() {
        Encoding::Bit => f64::from(u8::from(bits != 0)),
        Encoding::Unsigned | Encoding::Signed => return whole(point.kind, bits).map(Exact::whole),
        Encoding::SignMagnitude => {
            let magnitude = (bits & mask(to_u8(size - 1))) as f64;
            if bits >> (size - 1) == 1 { -magnitude } else { magnitude }
        }
        Encoding::Mod10k => return from_mod10k(point.kind, &in_order(point.order, words)).map(Exact::whole),
        Encoding::Float if size == 16 => half::value(bits as u16),
        Encoding::Float if size == 32 => f64::from(f32::from_bits(bits as u32)),
        Encoding::Float => f64::from_bits(bits),
        Encoding::Bcd => from_bcd(bits, size / 4)?,
        Encoding::Text => return None,
    };
    number.is_finite().then(|| number.into())
}

/// The whole number in the bits of its registers; `None` where those that are not its own would make it another one.
fn whole(kind: DataType, bits: u64) -> Option<i128> {
    let size = u32::from(kind.bits());
    let signed = i128::from((bits << (64 - size)).cast_signed() >> (64 - size));
    let unsigned = i128::from(bits & mask(kind.bits()));
    let number = if kind.encoding() == Encoding::Signed { signed } else { unsigned };
    let beyond = bits.checked_shr(size).unwrap_or(0);
    let is_filling = beyond == 0 || number < 0 && beyond == mask(to_u8(16 * u32::from(kind.words()) - size));
    (kind.is_half() || is_filling).then_some(number)
}

/// The text that the words of a point hold, as `text_value::decode` shows it; `None` for a point that holds no text.
pub fn decode_text(point: Point, words: &[u16]) -> Option<String> {
    text_value::decode(point.kind, &in_order(point.order, words))
}

/// The words that hold a text, as `text_value::encode` takes it.
pub fn encode_text(point: Point, text: &str) -> Option<Vec<u16>> {
    text_value::encode(point.kind, text).map(|words| in_order(point.order, &words))
}

/// The words to write for a number; `None` if it does not fit the type, is no whole number where one is needed, or the
/// point is a field of bits inside a word (writing it would be a read-modify-write that races with the device).
pub fn encode(point: Point, value: impl Into<Exact>) -> Option<Vec<u16>> {
    let exact = value.into();
    if point.part().is_some() || !exact.is_finite() {
        return None;
    }
    let value = exact.near();
    let whole = || {
        let (low, high) = point.kind.whole_range()?;
        exact.as_whole().filter(|whole| (low..=high).contains(whole)).map(|_| exact.bits())
    };
    let bits = match point.kind.encoding() {
        Encoding::Bit | Encoding::Unsigned | Encoding::Signed => whole()?,
        Encoding::SignMagnitude => {
            let sign = if value < 0.0 { 1 << (point.kind.bits() - 1) } else { 0 };
            whole().map(|_| exact.abs().bits() | sign)?
        }
        Encoding::Mod10k => return whole().map(|_| to_mod10k(point, exact)),
        Encoding::Bcd => to_bcd(whole()?),
        Encoding::Float if point.kind.words() == 1 => half::bits(value)?.into(),
        Encoding::Float if point.kind.words() == 2 => {
            u64::from(Some(to_f32(value)).filter(|value| value.is_finite())?.to_bits())
        }
        Encoding::Float => value.to_bits(),
        Encoding::Text => return None,
    };
    let count = usize::from(point.kind.words()) * 2;
    Some(from_bytes(point.order, &bits.to_be_bytes()[8 - count..]))
}

/// The masks of a mask write (function 22: result = (word AND and) OR (or AND NOT and)) that sets a field of bits inside
/// a word and leaves the other bits to the device (V1.1b3, 6.16).
pub fn field_masks(point: Point, value: impl Into<Exact>) -> Option<(u16, u16)> {
    let (low, width) = point.part().filter(|_| point.kind.words() == 1)?;
    let field = mask(width);
    let (least, most) = point.raw_range()?;
    let value = value.into().as_whole().filter(|value| (least..=most).contains(value))?;
    let on_wire = |bits: u64| from_bytes(point.order, &to_u16(bits).to_be_bytes())[0];
    Some((!on_wire(field << low), on_wire((Exact::whole(value).bits() & field) << low)))
}

/// The registers of a field of bits, or of one byte, once its number is set in what they hold now; `None` if it does not fit.
pub fn modified(point: Point, held: &[u16], value: impl Into<Exact>) -> Option<Vec<u16>> {
    let (low, width) = point.part()?;
    let (least, most) = point.raw_range()?;
    let value = value.into().as_whole().filter(|value| (least..=most).contains(value))?;
    let bytes = to_bytes(point.order, held);
    let bits = bytes.iter().fold(0u64, |bits, byte| (bits << 8) | u64::from(*byte));
    let own = mask(width) << low;
    let set = bits & !own | (Exact::whole(value).bits() << low) & own;
    (bytes.len() == 2 * usize::from(point.kind.words()))
        .then(|| from_bytes(point.order, &set.to_be_bytes()[8 - bytes.len()..]))
}

fn mask(width: u8) -> u64 {
    u64::MAX.checked_shr(64 - u32::from(width)).unwrap_or(0)
}

/// The words of a number, four digits each.
fn to_mod10k(point: Point, number: Exact) -> Vec<u16> {
    let number = number.as_whole().unwrap_or(0);
    let part = |place: u16| (number / 10_000_i128.pow(place.into())) % 10_000;
    let words: Vec<u16> = (0..point.kind.words()).rev().map(|place| to_i16(part(place)).cast_unsigned()).collect();
    in_order(point.order, &words)
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
    in_order(order, words).into_iter().flat_map(u16::to_be_bytes).collect()
}

/// The words of the value, most significant first, and those of the wire again.
fn in_order(order: ByteOrder, words: &[u16]) -> Vec<u16> {
    let swapped = matches!(order, ByteOrder::Badc | ByteOrder::Dcba);
    let word = |word: &u16| if swapped { word.swap_bytes() } else { *word };
    match order {
        ByteOrder::Abcd | ByteOrder::Badc => words.iter().map(word).collect(),
        ByteOrder::Cdab | ByteOrder::Dcba => words.iter().rev().map(word).collect(),
    }
}

fn from_bytes(order: ByteOrder, bytes: &[u8]) -> Vec<u16> {
    let words: Vec<u16> = bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    in_order(order, &words)
}

#[cfg(test)]
mod tests;
