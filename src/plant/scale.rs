//! Raw numbers to values in engineering units and back.

use super::{
    exact::{Exact, PLAIN, digits},
    half,
    number::{to_f32, to_u32},
    tag::{Encoding, TagDef},
};

/// Least and greatest value, where there are any.
pub type Bounds = (Option<Exact>, Option<Exact>);

/// The value of a raw number: `raw · scale · 10^-decimals + offset`. `decimals` are those that the device
/// announces for this tag ([`TagDef::scaling_decimals`]), below 0 for a multiple of ten, 0 for all others.
pub fn to_value(tag: &TagDef, raw: impl Into<Exact>, decimals: i8) -> Exact {
    scaled(raw.into(), tag.scale, tag.offset, decimals)
}

/// The same of any scale and offset.
pub fn scaled(raw: Exact, scale: f64, offset: f64, decimals: i8) -> Exact {
    let exact = raw.rest().and_then(|_| Scaling::new(scale, offset, decimals)?.value(raw.as_whole()?));
    exact.unwrap_or_else(|| (multiply(multiply(raw.near(), scale), 10f64.powi(-i32::from(decimals))) + offset).into())
}

/// The raw number to write for a value, rounded to what the type can hold; `None` if it does not fit the type.
pub fn to_raw(tag: &TagDef, value: impl Into<Exact>, decimals: i8) -> Option<Exact> {
    let value = value.into();
    let raw = match tag.point.kind.encoding() {
        Encoding::Float => {
            let held = as_stored(tag, unscaled(value, tag.scale, tag.offset, decimals));
            // A zero has no sign: its bits would be those of another number to a device that compares words.
            return (held.abs() <= float_max(tag)).then(|| (held + 0.0).into());
        }
        Encoding::Text => return None,
        Encoding::Bit
        | Encoding::Unsigned
        | Encoding::Signed
        | Encoding::Bcd
        | Encoding::SignMagnitude
        | Encoding::Mod10k => whole_raw(value, tag.scale, tag.offset, decimals)?,
    };
    let (low, high) = tag.point.raw_range()?;
    (low..=high).contains(&raw).then(|| Exact::whole(raw))
}

/// The whole raw number that is nearest to a value; `None` if not all of its digits are known.
pub fn whole_raw(value: Exact, scale: f64, offset: f64, decimals: i8) -> Option<i128> {
    match unscaled(value, scale, offset, decimals) {
        near if near.abs() < PLAIN => Exact::from(near.round()).as_whole(),
        // By way of an `f64` it would silently become another number.
        _ => Scaling::new(scale, offset, decimals)?.raw(value),
    }
}

fn unscaled(value: Exact, scale: f64, offset: f64, decimals: i8) -> f64 {
    (value.near() - offset) / (scale * 10f64.powi(-i32::from(decimals)))
}

/// The value as the device will hold it once it is written: rounded to what the type can hold; `None` if it does not fit.
pub fn rounded_to_device(tag: &TagDef, value: impl Into<Exact>, decimals: i8) -> Option<Exact> {
    to_raw(tag, value, decimals).map(|raw| to_value(tag, raw, decimals))
}

/// Noise of the arithmetic of a scale, as a share of the greatest number in it.
const NOISE: f64 = 1e-12;

/// Does a device that holds the second number hold what was meant by the first? Whole numbers are as good as their scale; a
/// floating-point one is as good as the digits that were given, or as those that its type always has.
pub fn is_held(tag: &TagDef, value: Exact, held: Exact) -> bool {
    if value.rest().is_some() {
        return held == value;
    }
    let (value, held) = (value.near(), held.near());
    let always = match (tag.point.kind.encoding(), tag.point.kind.words()) {
        (Encoding::Float, 1) => 3,
        (Encoding::Float, 2) => 6,
        (Encoding::Float, _) => 15,
        _ => return (held - value).abs() <= NOISE * value.abs().max(tag.offset.abs()).max(1.0),
    };
    let given = format!("{value:e}").bytes().take_while(|sign| *sign != b'e').filter(u8::is_ascii_digit).count();
    let digits = given.max(always) - 1;
    format!("{value:.digits$e}") == format!("{held:.digits$e}")
}

/// The bounds within which a tag can be written, in words: where none is stated, those of its type.
pub fn bounds_text(tag: &TagDef, (min, max): Bounds, decimals: i8, shown: Option<u8>) -> (String, String) {
    let raw = tag.point.raw_range().map(|(low, high)| [low, high].map(Exact::whole));
    let raw = raw.unwrap_or_else(|| [-float_max(tag), float_max(tag)].map(Exact::from));
    let [one, other] = raw.map(|raw| to_value(tag, raw, decimals));
    let of_type = if one <= other { (one, other) } else { (other, one) };
    let is_float = tag.point.kind.encoding() == Encoding::Float;
    let text = |bound: Exact| {
        let (near, rounded) = (bound.near(), digits(bound, shown));
        // No one reads a number of forty digits; and one that is rounded may lie beyond the bound.
        match rounded.parse::<f64>() {
            _ if is_float && 1e15 <= near.abs() => format!("{near:e}"),
            Ok(other) if NOISE * near.abs().max(1.0) < (other - near).abs() => digits(bound, None),
            Ok(_) | Err(_) => rounded,
        }
    };
    (text(min.unwrap_or(of_type.0)), text(max.unwrap_or(of_type.1)))
}

/// The greatest number that a floating-point type holds.
fn float_max(tag: &TagDef) -> f64 {
    match tag.point.kind.words() {
        1 => half::MAX,
        2 => f64::from(f32::MAX),
        _ => f64::MAX,
    }
}

/// The raw number to write for a value within bounds; `None` if the type cannot hold it, or if the value, or what the device
/// will hold, is beyond a bound: rounding must not lead there, nor hide that more was asked for.
pub fn raw_within(tag: &TagDef, value: Exact, decimals: i8, (min, max): Bounds) -> Option<Exact> {
    let raw = to_raw(tag, value, decimals)?;
    let inside = |value| is_inside(min, max, value);
    (inside(value) && inside(to_value(tag, raw, decimals))).then_some(raw)
}

/// Does a device get the same raw number for two values? What is sent decides, not what was typed: 3.4 is 3 in a register
/// without decimals, and a single-precision one has no 0.1.
pub fn is_sent_as(tag: &TagDef, value: Exact, other: Exact, decimals: i8) -> bool {
    let raw = |value| to_raw(tag, value, decimals);
    raw(value).zip(raw(other)).is_some_and(|(one, other)| same_raw(tag, one, other))
}

/// Do two raw numbers of a tag mean the same stored value?
pub fn same_raw(tag: &TagDef, one: Exact, other: Exact) -> bool {
    match tag.point.kind.encoding() {
        // What was lost in scaling forth and back is lost in the value, which an offset makes much larger than the raw number.
        Encoding::Float if tag.point.kind.words() == 4 => {
            alike(one.near(), other.near()) || alike(to_value(tag, one, 0).near(), to_value(tag, other, 0).near())
        }
        Encoding::Float => as_stored(tag, one.near()) == as_stored(tag, other.near()),
        Encoding::Bit => (one != 0.0) == (other != 0.0),
        Encoding::Text => false,
        Encoding::Unsigned | Encoding::Signed | Encoding::Bcd | Encoding::SignMagnitude | Encoding::Mod10k => {
            one == other
        }
    }
}

/// A float in the precision of its type.
fn as_stored(tag: &TagDef, exact: f64) -> f64 {
    match tag.point.kind.words() {
        1 => half::rounded(exact),
        2 => f64::from(to_f32(exact)),
        _ => exact,
    }
}

/// The same number but for what scaling forth and back rounds: within two units in the last place.
pub fn alike(one: f64, other: f64) -> bool {
    (one - other).abs() <= 2.0 * f64::EPSILON * one.abs().max(other.abs())
}

/// Is a value that a device will hold between its bounds, where there are any?
pub fn is_inside(min: Option<Exact>, max: Option<Exact>, held: Exact) -> bool {
    let at_most =
        |low: Exact, high: Exact| low <= high || low.rest().or(high.rest()).is_none() && alike(low.near(), high.near());
    held.is_finite() && min.is_none_or(|min| at_most(min, held)) && max.is_none_or(|max| at_most(held, max))
}

/// How the raw numbers of a tag are scaled, all in units of `10^-decimals`: as the profile writes it, not as an `f64` has it.
struct Scaling {
    scale: i128,
    offset: i128,
    decimals: u32,
}

impl Scaling {
    fn new(scale: f64, offset: f64, decimals: i8) -> Option<Scaling> {
        let (scale, of_scale) = Exact::from(scale).as_decimal()?;
        let (offset, of_offset) = Exact::from(offset).as_decimal()?;
        let of_scale = i32::try_from(of_scale).ok()? + i32::from(decimals);
        let scale = scale.checked_mul(10i128.checked_pow(to_u32(-of_scale))?)?;
        let of_scale = to_u32(of_scale);
        let decimals = of_scale.max(of_offset);
        let shifted = |mantissa: i128, from: u32| mantissa.checked_mul(10i128.checked_pow(decimals - from)?);
        Some(Scaling { scale: shifted(scale, of_scale)?, offset: shifted(offset, of_offset)?, decimals })
    }

    fn value(&self, raw: i128) -> Option<Exact> {
        Exact::decimal(raw.checked_mul(self.scale)?.checked_add(self.offset)?, self.decimals)
    }

    /// The nearest raw number; `None` if not all digits of the value are known.
    fn raw(&self, value: Exact) -> Option<i128> {
        value.as_decimal()?;
        let scaled = value.mantissa(self.decimals)?.checked_sub(self.offset)?;
        let (size, over) = (self.scale.checked_abs().filter(|size| 0 < *size)?, scaled.checked_abs()?);
        Some((over + size / 2) / size * scaled.signum() * self.scale.signum())
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
            assert_eq!(to_raw(&tag, value, decimals), Some(raw.into()));
        }
    }

    #[test]
    fn a_number_is_held_that_no_digit_of_is_lost() {
        let mut tag = fixture::plant().tags[0].clone();
        for (kind, scale, value, is_held) in [
            (DataType::U32, 10.0, 12_345_670.0, true),
            (DataType::U32, 10.0, 12_345_675.0, false),
            (DataType::U32, 0.3, 1_000_000.0, false),
            (DataType::U32, 0.3, 999_999.9, true),
            (DataType::U32, 0.1, 0.3, true),
            (DataType::I16, 0.5, 72.3, false),
            (DataType::Bcd32, 100.0, 12_345_600.0, true),
            (DataType::Bcd32, 100.0, 12_345_601.0, false),
            (DataType::F32, 1.0, 0.1, true),
            (DataType::F32, 1.0, 9.96e9, true),
            (DataType::F32, 1.0, 16_777_217.0, false),
            (DataType::F32, 1.0, 123_456.789, true),
            (DataType::F64, 1.0, 16_777_217.1, true),
            (DataType::F16, 1.0, 0.1, true),
            (DataType::F16, 1.0, 2_049.0, false),
        ] {
            (tag.point.kind, tag.scale) = (kind, scale);
            let held = rounded_to_device(&tag, value, 0).expect("it fits");
            assert_eq!(super::is_held(&tag, value.into(), held), is_held, "{kind:?} x{scale}: {value} as {held:?}");
        }
        (tag.point.kind, tag.scale, tag.offset) = (DataType::I16, 0.1, 273.15);
        let held = rounded_to_device(&tag, 293.25, 0).expect("it fits");
        assert!(super::is_held(&tag, 293.25.into(), held), "what scaling adds is no digit: {held:?}");
    }

    #[test]
    fn bounds_that_are_not_stated_are_those_of_the_type() {
        let mut tag = fixture::plant().tags[0].clone();
        let rounded = bounds_text(&tag, (Some((-50.05).into()), Some(99.95.into())), 0, Some(1));
        assert_eq!(rounded, ("-50.05".to_owned(), "99.95".to_owned()), "never beyond it");
        let mut check = |kind, scale, bounds: Bounds, min: &str, max: &str| {
            (tag.point.kind, tag.scale, tag.offset) = (kind, scale, 0.0);
            let words = bounds_text(&tag, bounds, 0, None);
            assert_eq!((words.0.as_str(), words.1.as_str()), (min, max), "{kind:?}");
        };
        check(DataType::U16, 1.0, (None, None), "0", "65535");
        check(DataType::I16, -0.5, (None, None), "-16383.5", "16384");
        check(DataType::U16, 1.0, (Some(5.0.into()), None), "5", "65535");
        check(DataType::Bcd16, 1.0, (None, Some(500.0.into())), "0", "500");
        check(DataType::Bool, 1.0, (None, None), "0", "1");
        check(DataType::F16, 0.5, (None, None), "-32752", "32752");
        check(DataType::F32, 1.0, (Some(0.0.into()), None), "0", "3.4028234663852886e38");
        check(DataType::U64, 1.0, (None, None), "0", "18446744073709551615");
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
            assert_eq!(to_raw(&tag, value, 1), raw.map(Exact::from), "{kind:?} {value}");
        }
    }

    #[test]
    fn a_counter_of_64_bits_is_scaled_to_its_last_digit_and_back() {
        let mut tag = fixture::plant().tags[0].clone();
        for (kind, scale, offset, decimals, raw, value) in [
            (DataType::U64, 1.0, 0.0, 0, "9007199254740993", "9007199254740993"),
            (DataType::U64, 0.001, 0.0, 0, "9007199254740991", "9007199254740.991"),
            (DataType::U64, 0.001, 0.0, 0, "9007199254740993", "9007199254740.993"),
            (DataType::U64, 0.001, 0.0, 0, "18446744073709551615", "18446744073709551.615"),
            (DataType::U64, 1.0, 0.0, 3, "18446744073709551615", "18446744073709551.615"),
            (DataType::U64, 0.001, 0.5, 0, "18446744073709551615", "18446744073709552.115"),
            (DataType::U64, 2.5, -10.0, 0, "18446744073709551615", "46116860184273879027.5"),
            (DataType::I64, 10.0, 0.0, 0, "-9223372036854775807", "-92233720368547758070"),
            (DataType::I64, -0.01, 0.0, 0, "-9223372036854775808", "92233720368547758.08"),
        ] {
            (tag.point.kind, tag.scale, tag.offset) = (kind, scale, offset);
            let parsed = |text: &str| text.parse::<Exact>().expect("a number");
            assert_eq!(to_value(&tag, parsed(raw), decimals).to_string(), value, "{raw} · {scale}");
            assert_eq!(
                to_raw(&tag, parsed(value), decimals).map(|raw| raw.to_string()).as_deref(),
                Some(raw),
                "{value}"
            );
        }
    }

    #[test]
    fn what_an_f64_has_rounded_is_not_written() {
        let mut tag = fixture::plant().tags[0].clone();
        (tag.point.kind, tag.scale, tag.offset) = (DataType::U64, 1.0, 0.0);
        assert_eq!(to_raw(&tag, 2f64.powi(53) + 2.0, 0), None);
        let at_most = "18446744073709551615".parse::<Exact>().expect("a number");
        let beyond = "18446744073709551616".parse::<Exact>().expect("a number");
        assert_eq!((to_raw(&tag, at_most, 0), to_raw(&tag, beyond, 0)), (Some(at_most), None));
        let limit = Some(Exact::from(2f64.powi(53)));
        let above = "9007199254740993".parse::<Exact>().expect("a number");
        assert!(!is_inside(None, limit, above) && is_inside(limit, None, above), "one more than the limit");
    }
}
