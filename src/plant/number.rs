//! Numbers in types of another width: what does not fit becomes the nearest that does.

use super::exact::Exact;

/// A number that the functions of this module take.
pub(crate) trait Number {
    /// The whole part; 0 of NaN.
    fn whole(self) -> i128;
}

macro_rules! numbers {
    ($($source:ident)*) => { $(
        impl Number for $source {
            fn whole(self) -> i128 {
                self.into()
            }
        }
    )* };
}

numbers! { u8 u16 u32 u64 i8 i16 i32 i64 i128 }

impl Number for u128 {
    fn whole(self) -> i128 {
        i128::try_from(self).unwrap_or(i128::MAX)
    }
}

impl Number for usize {
    fn whole(self) -> i128 {
        self as i128
    }
}

impl Number for isize {
    fn whole(self) -> i128 {
        self as i128
    }
}

impl Number for f64 {
    #[expect(clippy::cast_possible_truncation, reason = "cuts the fraction off; what is too large becomes the largest")]
    fn whole(self) -> i128 {
        self as i128
    }
}

impl Number for f32 {
    fn whole(self) -> i128 {
        f64::from(self).whole()
    }
}

macro_rules! conversions {
    ($($name:ident $target:ident;)*) => { $(
        pub(crate) fn $name(number: impl Number) -> $target {
            let whole = number.whole();
            $target::try_from(whole).unwrap_or(if whole < 0 { $target::MIN } else { $target::MAX })
        }
    )* };
}

conversions! {
    to_i8 i8;
    to_u8 u8;
    to_u16 u16;
    to_u32 u32;
    to_u64 u64;
    to_usize usize;
    to_i16 i16;
    to_i32 i32;
    to_i64 i64;
}

/// The nearest `f32`; infinite if there is none.
#[expect(clippy::cast_possible_truncation, reason = "rounds to nearest, as IEEE 754 has it")]
pub(crate) fn to_f32(number: f64) -> f32 {
    number as f32
}

/// Most digits that an `f64` gives back of a decimal number.
const DIGITS: usize = 15;

/// The digits of a number that are known, with this many decimals at most; of one that is so large or small that most of them
/// say nothing, those that do and its exponent. What rounds to nothing has no sign.
pub(crate) fn digits(number: impl Into<Exact>, decimals: Option<u8>) -> String {
    let exact = number.into();
    let known = exact.rest().and_then(|_| match decimals {
        Some(decimals) => Some((exact.mantissa(decimals.into())?, decimals.into())),
        None => exact.as_decimal(),
    });
    if let Some((mantissa, decimals)) = known {
        return placed(mantissa, decimals);
    }
    let number = exact.near();
    let size = number.abs();
    match decimals {
        _ if 1e15 <= size && size.is_finite() => {
            let text = format!("{number:.*e}", DIGITS - 1);
            let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
            format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
        }
        Some(decimals) => {
            let whole = if size < 10.0 { 1 } else { 1 + to_usize(size.log10()) };
            let text = format!("{number:.*}", usize::from(decimals).min(DIGITS.saturating_sub(whole)));
            match text.strip_prefix('-') {
                Some(rest) if rest.chars().all(|letter| matches!(letter, '0' | '.')) => rest.to_owned(),
                Some(_) | None => text,
            }
        }
        None if size < 1e-9 && number != 0.0 => format!("{number:e}"),
        None => number.to_string(),
    }
}

/// `mantissa · 10^-decimals` in digits.
fn placed(mantissa: i128, decimals: u32) -> String {
    let (sign, size) = (if mantissa < 0 { "-" } else { "" }, mantissa.unsigned_abs());
    let shift = 10u128.pow(decimals);
    let width = to_usize(decimals);
    match decimals {
        0 => format!("{sign}{size}"),
        _ => format!("{sign}{}.{:0width$}", size / shift, size % shift),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_becomes_the_nearest() {
        assert_eq!((to_u8(255_usize), to_u8(256_usize), to_u8(-1_i64)), (255, 255, 0));
        assert_eq!((to_i16(-40_000.7), to_i16(1.9), to_i16(-1.9), to_i16(f64::NAN)), (i16::MIN, 1, -1, 0));
        assert_eq!((to_u64(1e30), to_u64(-0.5), to_u64(u128::MAX)), (u64::MAX, 0, u64::MAX));
        assert_eq!((to_i64(f64::INFINITY), to_usize(-1_isize), to_u16(7_f32)), (i64::MAX, 0, 7));
        assert_eq!((to_f32(0.1), to_f32(1e300)), (0.1_f32, f32::INFINITY));
    }

    #[test]
    fn digits_that_say_nothing_are_not_written() {
        for (number, decimals, expect) in [
            (1e308, Some(1), "1e308"),
            (-1e308, None, "-1e308"),
            (1e-300, None, "1e-300"),
            (1e-300, Some(2), "0.00"),
            (123_456_789_012.25, Some(1), "123456789012.2"),
            (72.4, None, "72.4"),
            (0.0, None, "0"),
            (f64::INFINITY, Some(1), "inf"),
            (-0.04, Some(1), "0.0"),
            (1_999_999_999_999_999.0, None, "2e15"),
            (18_446_744_073_709_551_615.0, Some(0), "1.84467440737096e19"),
            (9_007_199_254_740.993, Some(3), "9007199254740.99"),
        ] {
            assert_eq!(digits(number, decimals), expect);
        }
    }
}
