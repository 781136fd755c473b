//! Numbers with more digits than an `f64` gives back: those of 64-bit registers, and what scaling makes of them.
//!
//! ```text
//!   register      9007199254740993      an `f64` has 9007199254740992 and 9007199254740994
//!   near, rest    9007199254740992, 1   their sum is the number
//! ```

mod digits;

use std::{
    cmp::Ordering,
    fmt,
    ops::{Add, Div, Mul, Neg, Sub},
    str::FromStr,
};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(crate) use digits::digits;

/// What is less than this, and whole, an `f64` gives back with all digits, and carries through any scaling; with decimals
/// it is what has 15 digits in all.
pub(super) const PLAIN: f64 = 1e15;
/// Below this, an `f64` gives back six decimals: the most that is ever shown.
const SMALL: f64 = 1e9;
/// Up to this, an `f64` holds every whole number.
const WHOLE: f64 = (1_u64 << 53) as f64;
/// Below this, an `i128` holds it with all its decimals.
const LARGEST: f64 = 1e29;
/// Decimals of a number of which it is not known how many it has.
const DECIMALS: u32 = 9;

/// A number: the nearest `f64`, and what that lacks of it where more than 15 digits are known.
#[derive(Debug, Clone, Copy, Default)]
pub struct Exact {
    near: f64,
    /// `None`: no more is known than the `f64`, of which 15 digits are shown at most.
    rest: Option<f64>,
}

impl Exact {
    /// What an `f64` says, as one that was computed.
    pub const fn plain(near: f64) -> Exact {
        Exact { near, rest: None }
    }

    /// The nearest `f64`, and what it lacks, as they are stored. A number has one form only: that of up to 15 digits is the
    /// `f64` alone, whichever way it was computed.
    pub fn of_parts(near: f64, rest: Option<f64>) -> Exact {
        let tells = |rest: &f64| rest.is_finite() && (SMALL..LARGEST).contains(&near.abs());
        let long = Exact { near, rest: rest.filter(tells) };
        let is_short = long.rest.and_then(|_| long.as_decimal()).is_some_and(|(mantissa, _)| is_short(mantissa));
        if is_short { Exact::plain(near) } else { long }
    }

    /// A whole number.
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f64 of an i128 is in its range or just above")]
    pub fn whole(number: i128) -> Exact {
        if let Some(small) = i64::try_from(number).ok().map(|small| small as f64).filter(|small| small.abs() < PLAIN) {
            return Exact::plain(small);
        }
        let near = number as f64;
        let rest = number.saturating_sub(near as i128);
        Exact::of_parts(near, Some(rest as f64))
    }

    /// `mantissa · 10^-decimals`; `None` where that is not known exactly.
    pub(super) fn decimal(mantissa: i128, decimals: u32) -> Option<Exact> {
        let near: f64 = format!("{mantissa}e-{decimals}").parse().ok()?;
        if is_short(mantissa) {
            return Some(Exact::plain(near));
        }
        let (whole, part) = shifted(near, decimals)?;
        let lacks = mantissa.checked_sub(whole)? as f64 - part;
        Some(Exact::of_parts(near, Some(lacks / 10f64.powi(i32::try_from(decimals).ok()?))))
    }

    /// The nearest `f64`.
    pub fn near(self) -> f64 {
        self.near
    }

    /// What the nearest `f64` lacks, where that is known.
    pub fn rest(self) -> Option<f64> {
        self.rest
    }

    /// Does the nearest `f64` lack anything of it?
    pub fn is_rounded(self) -> bool {
        self.rest.is_some_and(|rest| rest != 0.0)
    }

    /// It as an `f64` for other programs; `None` where that, as they print it, would not have all the digits that are known.
    pub fn as_f64(self) -> Option<f64> {
        let is_whole = !self.is_rounded() && self.near.abs() <= WHOLE && self.near.fract() == 0.0;
        (self.rest.is_none() || is_whole).then_some(self.near)
    }

    /// Its multiple of `10^-decimals`, rounded; `None` where there is none.
    pub(crate) fn mantissa(self, decimals: u32) -> Option<i128> {
        let shown = || decimal_of(&self.near.to_string()).filter(|(mantissa, _)| is_short(*mantissa));
        if self.rest.is_none()
            && PLAIN <= (self.near * 10f64.powi(i32::try_from(decimals).ok()?)).abs()
            && let Some((mantissa, shown)) = shown()
            && shown <= decimals
        {
            // What the `f64` has beyond its 15 digits is none of the number.
            return mantissa.checked_mul(10i128.checked_pow(decimals - shown)?);
        }
        let (whole, part) = shifted(self.near, decimals)?;
        let rest = self.rest.unwrap_or(0.0) * 10f64.powi(i32::try_from(decimals).ok()?);
        whole.checked_add(rounded(part + rest))
    }

    /// Mantissa and decimals, as a person writes the number; `None` if not all of its digits are known.
    pub(super) fn as_decimal(self) -> Option<(i128, u32)> {
        match self.rest {
            Some(_) => {
                let (mut mantissa, mut decimals) = (self.mantissa(DECIMALS)?, DECIMALS);
                while 0 < decimals && mantissa % 10 == 0 {
                    (mantissa, decimals) = (mantissa / 10, decimals - 1);
                }
                Some((mantissa, decimals))
            }
            None => decimal_of(&self.near.to_string()).filter(|_| self.is_known()),
        }
    }

    /// It as a whole number; `None` if it is none, or not all of its digits are known.
    pub fn as_whole(self) -> Option<i128> {
        self.mantissa(0).filter(|_| self.is_whole())
    }

    /// The bits of a word that holds it, two's complement.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the low 64 bits are what is asked for"
    )]
    pub fn bits(self) -> u64 {
        self.mantissa(0).unwrap_or(0) as u64
    }

    /// Without its sign.
    pub fn abs(self) -> Exact {
        if self.near < 0.0 { -self } else { self }
    }

    /// Is it neither infinite nor none?
    pub fn is_finite(self) -> bool {
        self.near.is_finite()
    }

    /// Is the `f64` not what has rounded it?
    fn is_known(self) -> bool {
        self.rest.is_some() || self.near.abs() < WHOLE
    }

    fn is_whole(self) -> bool {
        self.is_known() && (self.near.fract() + self.rest.unwrap_or(0.0)).fract() == 0.0
    }

    /// A sum that is not in order yet.
    fn sum(high: f64, low: f64) -> Exact {
        let near = high + low;
        Exact::of_parts(near, Some(low - (near - high)))
    }
}

impl From<f64> for Exact {
    fn from(near: f64) -> Exact {
        Exact::plain(near)
    }
}

impl Add for Exact {
    type Output = Exact;

    fn add(self, other: Exact) -> Exact {
        let plain = Exact::plain(self.near + other.near);
        if self.rest.or(other.rest).is_none() {
            return plain;
        }
        let mantissa = |number: Exact| number.mantissa(DECIMALS).filter(|_| number.is_known());
        let sum = mantissa(self).zip(mantissa(other)).and_then(|(one, other)| one.checked_add(other));
        sum.and_then(|sum| Exact::decimal(sum, DECIMALS)).unwrap_or(plain)
    }
}

impl Neg for Exact {
    type Output = Exact;

    fn neg(self) -> Exact {
        Exact { near: -self.near, rest: self.rest.map(f64::neg) }
    }
}

impl Sub for Exact {
    type Output = Exact;

    fn sub(self, other: Exact) -> Exact {
        self + -other
    }
}

/// Exact of whole numbers; else as an `f64`: the factor 0.001 is none that it holds.
impl Mul for Exact {
    type Output = Exact;

    fn mul(self, other: Exact) -> Exact {
        let product = self.near * other.near;
        if self.rest.or(other.rest).is_none() || !(self.is_whole() && other.is_whole()) {
            return Exact::plain(product);
        }
        let lost = self.near.mul_add(other.near, -product);
        Exact::sum(product, lost + self.near * other.rest.unwrap_or(0.0) + self.rest.unwrap_or(0.0) * other.near)
    }
}

/// Exact by a whole number; else as an `f64`.
impl Div for Exact {
    type Output = Exact;

    fn div(self, other: Exact) -> Exact {
        let quotient = self.near / other.near;
        if self.rest.is_none() || other.rest.is_some() || !other.is_whole() {
            return Exact::plain(quotient);
        }
        let lacks = (-quotient).mul_add(other.near, self.near) + self.rest.unwrap_or(0.0);
        Exact::sum(quotient, lacks / other.near)
    }
}

impl PartialEq for Exact {
    fn eq(&self, other: &Exact) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl PartialEq<f64> for Exact {
    fn eq(&self, other: &f64) -> bool {
        *self == Exact::plain(*other)
    }
}

impl PartialEq<Exact> for f64 {
    fn eq(&self, other: &Exact) -> bool {
        other == self
    }
}

impl PartialOrd for Exact {
    fn partial_cmp(&self, other: &Exact) -> Option<Ordering> {
        let rest = || self.rest.unwrap_or(0.0).partial_cmp(&other.rest.unwrap_or(0.0));
        match self.near.partial_cmp(&other.near)? {
            Ordering::Equal => rest(),
            apart => Some(apart),
        }
    }
}

impl PartialOrd<f64> for Exact {
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.partial_cmp(&Exact::plain(*other))
    }
}

/// With as many digits as it has.
impl fmt::Display for Exact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rest {
            Some(_) => f.write_str(&digits(*self, None)),
            None => write!(f, "{}", self.near),
        }
    }
}

/// Not a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not a number")]
pub struct NotANumber;

/// As a person writes it, with all its digits: `18446744073709551.615`.
impl FromStr for Exact {
    type Err = NotANumber;

    fn from_str(text: &str) -> Result<Exact, NotANumber> {
        let near: f64 = text.parse().map_err(|_| NotANumber)?;
        let exact = decimal_of(text).and_then(|(mantissa, decimals)| Exact::decimal(mantissa, decimals));
        Ok(exact.filter(|exact| exact.near == near).unwrap_or(Exact::plain(near)))
    }
}

/// In JSON a number with all its digits, elsewhere its two parts.
impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match (to.is_human_readable(), self.rest) {
            (true, None) => self.near.serialize(to),
            (true, Some(_)) => serde_json::Value::from(*self).serialize(to),
            (false, rest) => (self.near, rest).serialize(to),
        }
    }
}

impl<'a> Deserialize<'a> for Exact {
    fn deserialize<D: Deserializer<'a>>(from: D) -> Result<Exact, D::Error> {
        if !from.is_human_readable() {
            let (near, rest) = Deserialize::deserialize(from)?;
            return Ok(Exact::of_parts(near, rest));
        }
        let number = serde_json::Number::deserialize(from)?;
        let exact: Option<Exact> = number.to_string().parse().ok();
        exact.filter(|exact| exact.is_finite()).ok_or_else(|| serde::de::Error::custom("number out of range"))
    }
}

impl From<Exact> for serde_json::Value {
    fn from(exact: Exact) -> serde_json::Value {
        match exact.rest {
            Some(_) => serde_json::from_str(&exact.to_string()).unwrap_or_default(),
            None => exact.near.into(),
        }
    }
}

/// Does an `f64` give back all digits of it, wherever its decimal point is?
fn is_short(mantissa: i128) -> bool {
    (mantissa as f64).abs() < PLAIN
}

/// The whole number in `near · 10^decimals`, and what is over.
fn shifted(near: f64, decimals: u32) -> Option<(i128, f64)> {
    let whole = near.trunc();
    let shift = 10i128.checked_pow(decimals)?;
    let shifted = rounded(whole).checked_mul(shift).filter(|_| whole.abs() < LARGEST)?;
    Some((shifted, (near - whole) * shift as f64))
}

#[expect(clippy::cast_possible_truncation, reason = "what is too large becomes the largest")]
fn rounded(number: f64) -> i128 {
    number.round() as i128
}

/// Mantissa and decimals of a number that is written without or with an exponent; `None` if it has too many digits.
fn decimal_of(text: &str) -> Option<(i128, u32)> {
    let (number, exponent) = match text.split_once(['e', 'E']) {
        Some((number, exponent)) => (number, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = number.split_once('.').unwrap_or((number, ""));
    let mantissa: i128 = format!("{whole}{part}").parse().ok()?;
    let decimals = i32::try_from(part.len()).ok()? - exponent;
    match u32::try_from(decimals) {
        Ok(decimals) => Some((mantissa, decimals)),
        Err(_) => Some((mantissa.checked_mul(10i128.checked_pow(decimals.unsigned_abs())?)?, 0)),
    }
}

#[cfg(test)]
mod tests;
