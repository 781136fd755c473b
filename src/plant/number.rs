//! Numbers in types of another width: what does not fit becomes the nearest that does.

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
}
