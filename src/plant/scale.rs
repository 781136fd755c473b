//! Raw numbers to values in engineering units and back.

use super::tag::{Encoding, TagDef};
use crate::plant::number::to_f32;

/// The value of a raw number: `raw · scale · 10^-decimals + offset`. `decimals` are those that the device
/// announces for this tag ([`super::tag::Decimals::From`]), 0 for all others.
pub fn to_value(tag: &TagDef, raw: f64, decimals: u8) -> f64 {
    multiply(multiply(raw, tag.scale), 10f64.powi(-i32::from(decimals))) + tag.offset
}

/// The raw number to write for a value, rounded to what the type can hold; `None` if it does not fit the type.
pub fn to_raw(tag: &TagDef, value: f64, decimals: u8) -> Option<f64> {
    let exact = (value - tag.offset) / (tag.scale * 10f64.powi(-i32::from(decimals)));
    let raw = match tag.point.kind.encoding() {
        Encoding::Float => as_stored(tag, exact),
        Encoding::Bit | Encoding::Unsigned | Encoding::Signed | Encoding::Bcd => exact.round(),
        Encoding::Text => return None,
    };
    let (low, high) = limits(tag);
    (raw.is_finite() && low <= raw && raw <= high).then_some(raw)
}

/// The value as the device will hold it once it is written: rounded to what the type can hold; `None` if it does not fit.
pub fn rounded_to_device(tag: &TagDef, value: f64, decimals: u8) -> Option<f64> {
    to_raw(tag, value, decimals).map(|raw| to_value(tag, raw, decimals))
}

/// Do two raw numbers of a tag mean the same stored value?
pub fn same_raw(tag: &TagDef, one: f64, other: f64) -> bool {
    match tag.point.kind.encoding() {
        // What was lost in scaling forth and back is lost in the value, which an offset makes much larger than the raw number.
        Encoding::Float if tag.point.kind.registers() == 4 => {
            alike(one, other) || alike(to_value(tag, one, 0), to_value(tag, other, 0))
        }
        Encoding::Float => as_stored(tag, one) == as_stored(tag, other),
        Encoding::Bit => (one != 0.0) == (other != 0.0),
        Encoding::Text => false,
        Encoding::Unsigned | Encoding::Signed | Encoding::Bcd => one == other,
    }
}

/// A float in the precision of its type.
fn as_stored(tag: &TagDef, exact: f64) -> f64 {
    if tag.point.kind.registers() == 2 { f64::from(to_f32(exact)) } else { exact }
}

/// The same number but for what scaling forth and back rounds: within two units in the last place.
pub fn alike(one: f64, other: f64) -> bool {
    (one - other).abs() <= 2.0 * f64::EPSILON * one.abs().max(other.abs())
}

/// Is a value that a device will hold between its bounds, where there are any?
pub fn is_inside(min: Option<f64>, max: Option<f64>, held: f64) -> bool {
    let at_most = |low: f64, high: f64| low <= high || alike(low, high);
    held.is_finite() && min.is_none_or(|min| at_most(min, held)) && max.is_none_or(|max| at_most(held, max))
}

/// Lowest and highest raw number of a tag's type or bit field.
fn limits(tag: &TagDef) -> (f64, f64) {
    if let Some((_, bits)) = tag.point.field {
        return (0.0, 2f64.powi(i32::from(bits)) - 1.0);
    }
    // An f64 counts whole numbers up to 2^53; beyond, a 64-bit value would silently become another one.
    let exact = 2f64.powi(53);
    match (tag.point.kind.whole_range(), tag.point.kind.encoding(), tag.point.kind.registers()) {
        (Some((low, high)), ..) => (low.max(-exact), high.min(exact)),
        (None, Encoding::Float, 2) => (f64::from(f32::MIN), f64::from(f32::MAX)),
        (None, Encoding::Float, _) => (f64::MIN, f64::MAX),
        // An empty range: nothing is inside.
        (None, ..) => (0.0, -1.0),
    }
}

/// `raw · factor`, dividing where the factor is one over a whole number: 724 · 0.1 is 72.4, not 72.400000000000006.
fn multiply(raw: f64, factor: f64) -> f64 {
    let divisor = (1.0 / factor).round();
    if 1.0 < divisor && (1.0 / divisor - factor).abs() < 1e-12 { raw / divisor } else { raw * factor }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{fixture, tag::DataType};

    #[test]
    fn values_come_out_as_a_person_would_write_them() {
        let mut tag = fixture::plant().tags[0].clone();
        for (scale, offset, decimals, raw, value) in [
            (1.0, 0.0, 1, 724.0, 72.4),
            (0.1, 0.0, 0, 3.0, 0.3),
            (0.01, 0.0, 0, 1234.0, 12.34),
            (2.5, -10.0, 0, 8.0, 10.0),
        ] {
            (tag.scale, tag.offset) = (scale, offset);
            assert_eq!(to_value(&tag, raw, decimals), value);
            assert_eq!(to_raw(&tag, value, decimals), Some(raw));
        }
    }

    #[test]
    fn a_value_beyond_its_type_is_refused() {
        let mut tag = fixture::plant().tags[0].clone();
        for (kind, value, raw) in [
            (DataType::I16, 3_276.7, Some(32_767.0)),
            (DataType::I16, 3_276.8, None),
            (DataType::U16, -0.1, None),
            (DataType::Bcd16, 1_000.0, None),
            (DataType::U32, f64::NAN, None),
        ] {
            tag.point.kind = kind;
            assert_eq!(to_raw(&tag, value, 1), raw, "{kind:?} {value}");
        }
    }
}
