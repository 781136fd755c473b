//! Step-hold interpolation: a stored sample is valid until the next one, and at most for [`HOLD_MAX`].
//!
//! ```text
//!   stored      27.1      27.4   bad          27.6                  (nothing more)
//!   held        ├─ 27.1 ──┤─27.4─┤            ├──── 27.6 ────┤
//!                                  no value        HOLD_MAX     no value
//! ```

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::{
    exact::Exact,
    sample::{Quality, Sample},
};

/// The plant stores every change of quality, and of value beyond the deadband, at once, and an unchanged value at least every 60 s. A value
/// without a successor for longer than this was therefore not stored any more: from here on it is not known.
pub const HOLD_MAX: Duration = Duration::from_secs(150);

/// A span with one good value; never empty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldInterval {
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub to: Timestamp,
    /// The value.
    pub value: Exact,
}

impl HoldInterval {
    /// How long, in seconds.
    pub fn seconds(self) -> f64 {
        self.to.duration_since(self.from).as_secs_f64()
    }
}

/// The spans of good values within `from..until`, in order. The samples come in order of time and should begin
/// [`HOLD_MAX`] before `from`, so that the value standing there is known. Nothing is held beyond `until`.
#[derive(Debug, Clone)]
pub struct StepSeries {
    from: Timestamp,
    until: Timestamp,
    current: Option<Sample>,
}

impl StepSeries {
    /// Nothing has come yet.
    pub fn new(from: Timestamp, until: Timestamp) -> StepSeries {
        StepSeries { from, until, current: None }
    }

    /// The span that ends with the next sample.
    pub fn next(&mut self, sample: Sample) -> Option<HoldInterval> {
        let before = self.current.replace(sample)?;
        self.span(before, sample.at)
    }

    /// The span that nothing comes after.
    pub fn end(mut self) -> Option<HoldInterval> {
        let last = self.current.take()?;
        self.span(last, self.until)
    }

    fn span(&self, sample: Sample, successor: Timestamp) -> Option<HoldInterval> {
        let value = good_exact(sample)?;
        let to = successor.min(expiry(sample)).min(self.until);
        let from = sample.at.max(self.from);
        (from < to).then_some(HoldInterval { from, to, value })
    }
}

/// Finds the sample in force at rising instants. The samples come in the order in which they were stored and should begin
/// [`HOLD_MAX`] before the first.
#[derive(Debug, Clone)]
pub struct ValuesAt {
    instants: Arc<[Timestamp]>,
    current: Option<Sample>,
    values: Vec<Option<Sample>>,
}

impl ValuesAt {
    /// At instants in order of time.
    pub fn new(instants: Arc<[Timestamp]>) -> ValuesAt {
        ValuesAt { values: Vec::with_capacity(instants.len()), instants, current: None }
    }

    /// The next sample. One that is earlier than the one before it was stored after a clock was set back: from there on what was stored
    /// later counts.
    pub fn next(&mut self, sample: Sample) {
        if self.current.is_some_and(|current| sample.at < current.at) {
            self.values.truncate(self.instants.partition_point(|at| *at < sample.at));
        }
        self.up_to(sample.at);
        self.current = Some(sample);
    }

    /// By instant the sample in force; `None` if there was none, or it was too old.
    pub fn end(mut self) -> Vec<Option<Sample>> {
        self.up_to(Timestamp::MAX);
        self.values
    }

    fn up_to(&mut self, next: Timestamp) {
        while let Some(at) = self.instants.get(self.values.len()).filter(|at| **at < next) {
            self.values.push(self.current.filter(|sample| *at < expiry(*sample)));
        }
    }
}

/// A stored value and its quality, held up to an instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldValue {
    /// In the tag's unit; `None` exactly when the quality is bad.
    pub value: Option<Exact>,
    /// How far to trust it.
    pub quality: Quality,
}

impl From<Sample> for HeldValue {
    fn from(sample: Sample) -> HeldValue {
        HeldValue { value: sample.exact(), quality: sample.quality }
    }
}

/// Extremes, time-weighted mean and last value of spans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntervalStats {
    /// Least.
    pub min: Exact,
    /// Greatest.
    pub max: Exact,
    /// Time-weighted mean.
    pub mean: f64,
    /// Latest.
    pub last: Exact,
    /// Time with a good value, in seconds.
    pub seconds: f64,
}

impl From<HoldInterval> for IntervalStats {
    fn from(span: HoldInterval) -> IntervalStats {
        let HoldInterval { value, .. } = span;
        IntervalStats { min: value, max: value, mean: value.near(), last: value, seconds: span.seconds() }
    }
}

impl IntervalStats {
    /// Adds those of a later span to what there is.
    pub fn add(stats: &mut Option<IntervalStats>, later: impl Into<IntervalStats>) {
        match stats {
            Some(stats) => stats.merge(later.into()),
            None => *stats = Some(later.into()),
        }
    }

    /// The mean as it is shown: that of a value which has not changed is the value.
    pub fn shown_mean(&self) -> Exact {
        if self.min == self.max { self.min } else { self.mean.into() }
    }

    /// Adds those of a later span.
    pub fn merge(&mut self, later: IntervalStats) {
        self.seconds += later.seconds;
        self.min = if later.min < self.min { later.min } else { self.min };
        self.max = if later.max > self.max { later.max } else { self.max };
        // Kept as a running mean, so that a constant stays exactly what it is; rounding never leaves the extremes.
        self.mean = (self.mean + (later.mean - self.mean) * (later.seconds / self.seconds))
            .clamp(self.min.near(), self.max.near());
        self.last = later.last;
    }
}

/// A good value that is a number. A stored NaN or infinity is no value, whatever its quality says.
pub fn good_exact(sample: Sample) -> Option<Exact> {
    sample.good_exact().filter(|value| value.is_finite())
}

/// When a sample is not in force any more, even without a successor.
pub(crate) fn expiry(sample: Sample) -> Timestamp {
    sample.at.checked_add(HOLD_MAX).unwrap_or(Timestamp::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{plant::sample::Cause, report::testing::sec};

    fn held(samples: impl Iterator<Item = Sample>, from: Timestamp, until: Timestamp) -> Vec<HoldInterval> {
        let mut steps = StepSeries::new(from, until);
        let mut spans: Vec<HoldInterval> = samples.filter_map(|sample| steps.next(sample)).collect();
        spans.extend(steps.end());
        spans
    }

    fn check(samples: &[(i64, Option<f64>)], window: (i64, i64), expect: &[(i64, i64, f64)]) {
        let samples = samples.iter().map(|&(at, value)| match value {
            Some(value) => Sample::good(value, sec(at)),
            None => Sample::bad(Cause::Timeout, sec(at)),
        });
        let got: Vec<_> = held(samples, sec(window.0), sec(window.1))
            .iter()
            .map(|span| (span.from.as_second(), span.to.as_second(), span.value.near()))
            .collect();
        assert_eq!(got, expect);
    }

    #[test]
    fn a_value_stands_until_the_next_row_and_never_over_a_gap() {
        check(&[], (0, 100), &[]);
        check(&[(0, Some(1.0)), (10, Some(2.0))], (0, 20), &[(0, 10, 1.0), (10, 20, 2.0)]);
        check(&[(0, Some(1.0)), (10, None), (30, Some(2.0))], (0, 40), &[(0, 10, 1.0), (30, 40, 2.0)]);
        // Before the window: only the part inside counts.
        check(&[(-20, Some(1.0)), (5, Some(2.0))], (0, 10), &[(0, 5, 1.0), (5, 10, 2.0)]);
        check(&[(-20, Some(1.0)), (-5, None)], (0, 10), &[]);
        // Nothing stored for long: the value ends after the longest hold.
        check(&[(0, Some(1.0)), (400, Some(2.0))], (0, 900), &[(0, 150, 1.0), (400, 550, 2.0)]);
        // Two rows at one instant: the later row counts.
        check(&[(0, Some(1.0)), (0, Some(2.0))], (0, 10), &[(0, 10, 2.0)]);
        // Not a number is not a value.
        check(&[(0, Some(f64::NAN)), (5, Some(2.0))], (0, 10), &[(5, 10, 2.0)]);
        // Nothing after `until`.
        check(&[(0, Some(1.0)), (20, Some(9.0))], (0, 10), &[(0, 10, 1.0)]);
    }

    #[test]
    fn an_uncertain_value_is_not_counted_as_good() {
        let samples = [Sample::good(5.0, sec(0)), Sample::good(5.0, sec(4)).uncertain(Cause::Stale)];
        assert_eq!(
            held(samples.into_iter(), sec(0), sec(10)),
            [HoldInterval { from: sec(0), to: sec(4), value: 5.0.into() }]
        );
    }

    #[test]
    fn the_value_at_an_instant_is_the_one_that_stood_then() {
        let samples = [Sample::good(1.0, sec(0)), Sample::bad(Cause::Timeout, sec(10)), Sample::good(3.0, sec(20))];
        // The clock was an hour ahead for a while: what was stored after it was set back counts from there on.
        let mut back = ValuesAt::new([0, 10, 20, 30, 3_600].map(sec).into());
        for (at, value) in [(0, 50.0), (5, 60.0), (3_590, 70.0), (15, 80.0), (25, 90.0)] {
            back.next(Sample::good(value, sec(at)));
        }
        let values: Vec<_> = back.end().iter().map(|sample| sample.and_then(|sample| sample.value)).collect();
        assert_eq!(values, [Some(50.0), Some(60.0), Some(80.0), Some(90.0), None]);
        let mut as_of = ValuesAt::new([-1, 0, 9, 10, 19, 20, 169, 170].map(sec).into());
        samples.into_iter().for_each(|sample| as_of.next(sample));
        let got: Vec<_> = as_of.end().into_iter().map(|sample| sample.and_then(Sample::good_value)).collect();
        assert_eq!(got, [None, Some(1.0), Some(1.0), None, None, Some(3.0), Some(3.0), None]);
    }
}
