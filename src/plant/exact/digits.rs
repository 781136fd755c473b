//! Numbers as digits.

use super::Exact;
use crate::plant::number::to_usize;

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
