//! What is known of a counter without reading it, and what is read of it.

use jiff::Timestamp;

use crate::plant::{
    data_type::{DataType, Encoding},
    exact::Exact,
    number::to_i8,
    tag::{Decimals, TagDef},
};

/// A fall is less than this many last digits where it is jitter: one, and what a conversion rounds.
const JITTER: f64 = 1.5;

/// What is known of a counter without reading it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CounterRule {
    /// Its last digit.
    pub digit: f64,
    /// It is an IEEE 754 single, of which large numbers are coarser than the last digit.
    pub single: bool,
    /// After so much it shows the same again; the likelier first.
    pub moduli: [Option<f64>; 2],
    /// The most that it counts in an hour.
    pub max_rate: Option<f64>,
}

impl CounterRule {
    /// Of a tag; `decimals` are those that its device announces, where it does.
    pub fn of(tag: &TagDef, decimals: Option<i8>) -> CounterRule {
        let shown = |decimals: i8| 10f64.powi(-i32::from(decimals));
        let scale = match tag.decimals {
            Decimals::Fixed(_) => tag.scale.abs(),
            Decimals::From(_) | Decimals::PowerFrom(_) => tag.scale.abs() * shown(decimals.unwrap_or(0)),
        };
        let kind = tag.point.kind;
        let whole = tag.calculation.is_none().then(|| kind.whole_range()).flatten();
        let digit = match (whole, tag.decimals) {
            (Some(_), _) => scale,
            (None, Decimals::Fixed(decimals)) => shown(to_i8(decimals)),
            (None, Decimals::From(_) | Decimals::PowerFrom(_)) => shown(decimals.unwrap_or(to_i8(Decimals::MAX))),
        };
        let moduli = match (tag.modulus, tag.point.field.filter(|_| whole.is_some()), whole) {
            (Some(modulus), ..) => [Some(modulus), None],
            (None, Some((_, bits)), _) => [Some(scale * 2f64.powi(i32::from(bits))), None],
            (None, None, Some((least, most))) => {
                let range = (most - least + 1) as f64 * scale;
                [Some(range), (kind.encoding() == Encoding::Signed).then_some(range / 2.0)]
            }
            (None, None, None) => [None; 2],
        };
        let single = whole.is_none() && matches!(kind, DataType::F32 | DataType::EnronF32) && tag.calculation.is_none();
        CounterRule { digit, single, moduli, max_rate: tag.max_rate }
    }

    /// A fall of less is jitter at a value.
    pub(super) fn jitter(&self, value: f64) -> f64 {
        let least = if self.single { value.abs() * f64::from(f32::EPSILON) } else { 0.0 };
        JITTER * self.digit.max(least)
    }
}

/// A good value, and for how long it was known to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The value.
    pub value: Exact,
    /// When it was read.
    pub at: Timestamp,
    /// Until when it held, at least.
    pub until: Timestamp,
}

/// What is kept of many readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingSummary {
    /// When it begins.
    pub from: Timestamp,
    /// When it ends.
    pub to: Timestamp,
    /// The first value.
    pub first: Exact,
    /// The last one.
    pub last: Exact,
    /// The least.
    pub min: Exact,
    /// The greatest.
    pub max: Exact,
    /// All its rises, added.
    pub rises: Exact,
}

impl ReadingSummary {
    /// Does it rise from the first to the last value, but for jitter, so that these say all that happened?
    pub(super) fn is_plain(&self, rule: &CounterRule) -> bool {
        let jitter = rule.jitter(self.last.near());
        let falls = self.rises - (self.last - self.first);
        // Also what comes of adding many steps of a number that an f64 rounds.
        let rounded = 1e-9 * self.max.near().abs();
        falls.near() <= jitter + rounded && self.first - self.min <= jitter && self.max - self.last <= jitter
    }

    /// Its readings as far as they are known, in an order that has its extremes.
    pub(super) fn readings(&self, jitter: f64) -> impl Iterator<Item = Reading> {
        let low = Some(self.min).filter(|min| jitter < (self.first - *min).near());
        let high = Some(self.max).filter(|max| jitter < (*max - self.last).near());
        let values = [Some(self.first), low, high, Some(self.last)].into_iter().flatten();
        let (at, until) = (self.from, self.to);
        values.map(move |value| Reading { value, at, until })
    }
}
