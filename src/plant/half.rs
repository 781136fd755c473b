//! IEEE 754 half precision, in which some devices keep a number in one register.

use super::number::{to_i32, to_u16};

/// The greatest number that it holds.
pub const MAX: f64 = 65_504.0;
/// Bits of the fraction.
const FRACTION: i32 = 10;
/// The exponent of the smallest number that is not short of digits.
const EXPONENT_MIN: i32 = -14;

/// The number of a pattern of bits; infinite or none where it is so.
pub fn value(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> FRACTION & 0x1F), f64::from(bits & 0x3FF));
    sign * match exponent {
        0 => fraction * 2f64.powi(EXPONENT_MIN - FRACTION),
        0x1F if fraction == 0.0 => f64::INFINITY,
        0x1F => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

/// The pattern of the nearest number that it holds, of two the even one; `None` where there is none.
pub fn bits(number: f64) -> Option<u16> {
    let size = number.abs();
    // Halfway to what would follow the greatest.
    if size.is_nan() || 65_520.0 <= size {
        return None;
    }
    let exponent = if size < 2f64.powi(EXPONENT_MIN) { EXPONENT_MIN } else { to_i32(size.log2().floor()) };
    let steps = to_u16((size / 2f64.powi(exponent - FRACTION)).round_ties_even());
    // Below the first whole power there are as many steps as the fraction says; a step too many carries into the exponent.
    let above = to_u16(exponent - EXPONENT_MIN);
    let sign = if number.is_sign_negative() { 1 << 15 } else { 0 };
    Some(sign | ((above << FRACTION) + steps))
}

/// The nearest number that it holds; infinite where there is none.
pub fn rounded(number: f64) -> f64 {
    bits(number).map_or(f64::INFINITY.copysign(number), value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_is_that_of_the_standard() {
        for (pattern, number) in [
            (0x3C00, 1.0),
            (0x3555, 0.333_251_953_125),
            (0xC000, -2.0),
            (0x7BFF, 65_504.0),
            (0x0400, 2f64.powi(-14)),
            (0x0001, 2f64.powi(-24)),
            (0x03FF, 1023.0 * 2f64.powi(-24)),
            (0x0000, 0.0),
        ] {
            assert_eq!((value(pattern), bits(number)), (number, Some(pattern)), "{pattern:04X}");
        }
        assert!(value(0x7E00).is_nan() && value(0xFC00) == f64::NEG_INFINITY);
        assert_eq!((bits(65_519.0), bits(65_520.0), bits(f64::NAN)), (Some(0x7BFF), None, None));
        assert_eq!((bits(2_049.0), bits(2_051.0)), (bits(2_048.0), bits(2_052.0)), "to the even one");
    }

    #[test]
    fn every_half_reads_back_as_written() {
        for pattern in 0..=u16::MAX {
            let number = value(pattern);
            let back = bits(number);
            assert!(!number.is_finite() || back == Some(pattern), "{pattern:04X} is {number}, back {back:?}");
        }
    }
}
