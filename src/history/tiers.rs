//! Aggregates of a minute and of an hour, formed from stored samples, and which of them answer a query; pure.
//!
//! ```text
//!   asked        ├──────────────────────────────────────────────────┤
//!   hours           ├───────┼───────┼───────┤                              what closed hours keep
//!   minutes       ├┼┤                       ├┼┼┼┤                          of them, towards the edges
//!   samples      ├┤                             ├────────────────────┤     the edges, and what is not archived
//! ```

use std::ops::Range;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::{
    plant::{counter::ReadingSummary, exact::Exact, number::to_i64, sample::Sample},
    report::step_series::{HoldInterval, IntervalStats, StepSeries},
};

/// How finely values are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Tier {
    /// Every stored sample.
    Raw,
    /// A row a minute.
    Minute,
    /// A row an hour.
    Hour,
}

/// Microseconds of an hour: what is archived at a time.
pub const HOUR: i64 = 3_600_000_000;
/// Microseconds of a minute.
pub const MINUTE: i64 = 60_000_000;

impl Tier {
    /// All, finest first.
    pub const ALL: [Tier; 3] = [Tier::Raw, Tier::Minute, Tier::Hour];

    /// As it is called in paths and in SQL.
    pub fn word(self) -> &'static str {
        match self {
            Tier::Raw => "raw",
            Tier::Minute => "m1",
            Tier::Hour => "h1",
        }
    }

    /// The tier of that name.
    pub fn from_word(word: &str) -> Option<Tier> {
        Tier::ALL.into_iter().find(|tier| tier.word() == word)
    }

    /// Microseconds of a row; `None` for samples.
    pub fn step(self) -> Option<i64> {
        match self {
            Tier::Raw => None,
            Tier::Minute => Some(MINUTE),
            Tier::Hour => Some(HOUR),
        }
    }

    /// The widest tier whose rows are not wider than a column, in microseconds.
    pub fn within(column: i64) -> Tier {
        Tier::ALL.into_iter().rev().find(|tier| tier.step().is_none_or(|step| step <= column)).unwrap_or(Tier::Raw)
    }

    fn finer(self) -> Tier {
        match self {
            Tier::Raw | Tier::Minute => Tier::Raw,
            Tier::Hour => Tier::Minute,
        }
    }
}

/// What is kept of a tag for a minute or an hour. There is none for a time without any good value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aggregate {
    /// When it begins; microseconds since 1970.
    pub at: i64,
    /// Of its good values; `seconds` is the time that they stood.
    pub stats: IntervalStats,
    /// The first good value.
    pub first: Exact,
    /// All its rises from the first to the last value, added: how often something on or off was switched on; and of what only
    /// counts up, how far.
    pub gain: Exact,
    /// Samples that were stored in it, good or not.
    pub samples: u32,
}

impl Aggregate {
    fn new(at: i64, part: HoldInterval) -> Aggregate {
        Aggregate { at, stats: part.into(), first: part.value, gain: Exact::default(), samples: 0 }
    }

    /// Was it good all the time, and did it never fall?
    pub fn only_rises(&self, step: i64) -> bool {
        let IntervalStats { min, max, last, .. } = self.stats;
        self.is_whole(step) && min == self.first && max == last && self.gain == last - self.first
    }

    /// Was it good all the time? `step` is how long that is.
    pub fn is_whole(&self, step: i64) -> bool {
        step <= to_i64((self.stats.seconds * 1e6).round())
    }

    /// The share of it that lies in a span, as if it had been the same all the time; `step` is how long it is.
    pub fn share(self, span: Range<i64>, step: i64) -> Aggregate {
        let (from, to) = (self.at.max(span.start), (self.at + step).min(span.end));
        let seconds = self.stats.seconds * (to - from).max(0) as f64 / step as f64;
        Aggregate { at: from, stats: IntervalStats { seconds, ..self.stats }, ..self }
    }

    /// What it says of a counter.
    pub fn summary(&self) -> ReadingSummary {
        let Aggregate { at, stats, first, gain, .. } = *self;
        let good = to_i64((stats.seconds * 1e6).round());
        let (from, to) = (instant(at), instant(at + good));
        ReadingSummary { from, to, first, last: stats.last, min: stats.min, max: stats.max, rises: gain }
    }

    /// Adds a later one.
    pub fn merge(&mut self, later: Aggregate) {
        self.gain = self.gain + rise(self.stats.last, later.first) + later.gain;
        self.stats.merge(later.stats);
        self.samples += later.samples;
    }
}

/// A part of a curve: a value that stood, or what is kept of a minute or an hour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CurvePart {
    /// A good value, for as long as it stood.
    Held(HoldInterval),
    /// An aggregate.
    Aggregate(Aggregate),
}

/// Forms the minutes of one tag from its samples, which come in the order in which they were stored and begin
/// [`HOLD_MAX`](crate::report::step_series::HOLD_MAX) before the span; where the clock was set back, a minute comes once for each
/// epoch. Times count in whole milliseconds.
#[derive(Debug, Clone)]
pub struct Minutes {
    steps: StepSeries,
    current: Option<Aggregate>,
    /// The minute in which samples are counted, and how many they are.
    counted: (i64, u32),
}

impl Minutes {
    /// Of a span of whole minutes.
    pub fn new(from: Timestamp, to: Timestamp) -> Minutes {
        Minutes { steps: StepSeries::new(from, to), current: None, counted: (i64::MIN, 0) }
    }

    /// The next sample; hands over what it completes.
    pub fn next(&mut self, sample: Sample, mut each: impl FnMut(Aggregate)) {
        let sample = Sample { at: in_milliseconds(sample.at), ..sample };
        if let Some(held) = self.steps.next(sample) {
            self.add(held, &mut each);
        }
        let minute = floor(sample.at.as_microsecond(), MINUTE);
        if minute != self.counted.0 {
            // A clock that was set back goes to an earlier one.
            if self.current.is_some_and(|current| current.at != minute) {
                self.close(&mut each);
            }
            self.counted = (minute, 0);
        }
        self.counted.1 += 1;
    }

    /// Nothing comes any more.
    pub fn end(mut self, mut each: impl FnMut(Aggregate)) {
        if let Some(held) = self.steps.clone().end() {
            self.add(held, &mut each);
        }
        self.close(&mut each);
    }

    fn add(&mut self, held: HoldInterval, each: &mut impl FnMut(Aggregate)) {
        let (mut from, to) = (held.from.as_microsecond(), held.to.as_microsecond());
        while from < to {
            let minute = floor(from, MINUTE);
            let until = to.min(minute + MINUTE);
            let part = HoldInterval { from: instant(from), to: instant(until), ..held };
            if self.current.is_some_and(|current| current.at != minute) {
                self.close(each);
            }
            match &mut self.current {
                None => self.current = Some(Aggregate::new(minute, part)),
                Some(current) => current.merge(Aggregate::new(minute, part)),
            }
            from = until;
        }
    }

    fn close(&mut self, each: &mut impl FnMut(Aggregate)) {
        if let Some(closed) = self.current.take() {
            let samples = if closed.at == self.counted.0 { self.counted.1 } else { 0 };
            each(Aggregate { samples, ..closed });
        }
    }
}

/// Adds minutes of one tag, in order of time, up to hours.
#[derive(Debug, Clone, Default)]
pub struct Hours(Option<Aggregate>);

impl Hours {
    /// The next minute; the hour that it completes.
    pub fn next(&mut self, minute: Aggregate) -> Option<Aggregate> {
        let at = floor(minute.at, HOUR);
        match &mut self.0 {
            Some(hour) if hour.at == at => {
                hour.merge(minute);
                None
            }
            _ => self.0.replace(Aggregate { at, ..minute }),
        }
    }

    /// The last hour.
    pub fn end(self) -> Option<Aggregate> {
        self.0
    }
}

/// A part of a span, and what answers for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// How finely.
    pub tier: Tier,
    /// From, inclusive; microseconds.
    pub from: i64,
    /// To, exclusive.
    pub to: i64,
}

/// Cuts a span into pieces, in order of time: each from the widest tier, `widest` at most, that has it whole. `kept` tells
/// the spans that the files of a tier cover, sorted.
pub fn pieces(from: i64, to: i64, widest: Tier, kept: &impl Fn(Tier) -> Vec<Range<i64>>) -> Vec<Piece> {
    let Some(step) = widest.step() else {
        return (from < to).then_some(Piece { tier: Tier::Raw, from, to }).into_iter().collect();
    };
    let (low, high) = (floor(from + step - 1, step), floor(to, step));
    let (mut all, mut next) = (Vec::new(), from);
    for span in kept(widest) {
        let span = span.start.max(low).max(next)..span.end.min(high);
        if span.start < span.end {
            all.extend(pieces(next, span.start, widest.finer(), kept));
            all.push(Piece { tier: widest, from: span.start, to: span.end });
            next = span.end;
        }
    }
    all.extend(pieces(next, to, widest.finer(), kept));
    all
}

/// How far a value is above the one before it.
pub fn rise(last: Exact, value: Exact) -> Exact {
    if last < value { value - last } else { Exact::default() }
}

/// The multiple of `step` at or before an instant.
pub fn floor(at: i64, step: i64) -> i64 {
    at.div_euclid(step) * step
}

/// An instant as it is stored: in whole milliseconds, never later than it was.
pub fn in_milliseconds(at: Timestamp) -> Timestamp {
    instant(floor(at.as_microsecond(), 1_000))
}

fn instant(micros: i64) -> Timestamp {
    Timestamp::from_microsecond(micros).unwrap_or(Timestamp::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{plant::sample::Cause, report::testing::sec};

    /// Minutes as (begin in s, min, mean, max, first, last, gain, good in s, samples), of samples (at in s, value).
    type Row = (i64, f64, f64, f64, f64, f64, f64, f64, u32);

    fn row(aggregate: Aggregate) -> Row {
        let Aggregate { at, stats, first, gain, samples } = aggregate;
        let IntervalStats { min, max, mean, last, seconds } = stats;
        let [min, max, first, last, gain] = [min, max, first, last, gain].map(Exact::near);
        (at / 1_000_000, min, mean, max, first, last, gain, seconds, samples)
    }

    fn minutes(samples: &[(i64, Option<f64>)], to: i64) -> Vec<Aggregate> {
        let (mut forming, mut all) = (Minutes::new(sec(0), sec(to)), Vec::new());
        for &(at, value) in samples {
            let sample = value.map_or(Sample::bad(Cause::Timeout, sec(at)), |value| Sample::good(value, sec(at)));
            forming.next(sample, |minute| all.push(minute));
        }
        forming.end(|minute| all.push(minute));
        all
    }

    #[test]
    fn a_minute_keeps_what_stood_in_it() {
        let check = |samples: &[(i64, Option<f64>)], to, expect: &[Row]| {
            assert_eq!(minutes(samples, to).into_iter().map(row).collect::<Vec<_>>(), expect);
        };
        check(&[], 120, &[]);
        // Held from before, over a minute without a sample, and no longer than a sample holds.
        check(
            &[(-30, Some(5.0))],
            240,
            &[(0, 5.0, 5.0, 5.0, 5.0, 5.0, 0.0, 60.0, 0), (60, 5.0, 5.0, 5.0, 5.0, 5.0, 0.0, 60.0, 0)],
        );
        check(
            &[(0, Some(1.0)), (15, Some(3.0)), (30, None), (90, Some(7.0)), (90, Some(8.0))],
            120,
            &[(0, 1.0, 2.0, 3.0, 1.0, 3.0, 2.0, 30.0, 3), (60, 8.0, 8.0, 8.0, 8.0, 8.0, 0.0, 30.0, 2)],
        );
        // A sample at the edge belongs to the new minute.
        check(
            &[(0, Some(1.0)), (60, Some(2.0))],
            120,
            &[(0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 60.0, 1), (60, 2.0, 2.0, 2.0, 2.0, 2.0, 0.0, 60.0, 1)],
        );
        // What has fallen in between is seen by its rises.
        check(&[(0, Some(6.0)), (20, Some(10.0)), (40, Some(2.0))], 60, &[(0, 2.0, 6.0, 10.0, 6.0, 2.0, 4.0, 60.0, 3)]);
    }

    #[test]
    fn hours_are_made_of_minutes() {
        let samples: Vec<(i64, Option<f64>)> = (0..240).map(|n| (n * 30, Some(n as f64))).collect();
        let (mut hours, mut all) = (Hours::default(), Vec::new());
        all.extend(minutes(&samples, 7_200).into_iter().filter_map(|minute| hours.next(minute)));
        all.extend(hours.end());
        let rows: Vec<Row> = all.into_iter().map(row).collect();
        assert_eq!(
            rows,
            [
                (0, 0.0, 59.5, 119.0, 0.0, 119.0, 119.0, 3_600.0, 120),
                (3_600, 120.0, 179.5, 239.0, 120.0, 239.0, 119.0, 3_600.0, 120)
            ]
        );
    }

    #[test]
    fn each_piece_is_answered_by_the_widest_tier_that_has_it() {
        let kept = |tier: Tier| match tier {
            Tier::Raw => vec![],
            Tier::Minute | Tier::Hour => vec![2 * HOUR..5 * HOUR, 6 * HOUR..7 * HOUR],
        };
        let piece = |tier, from: i64, to: i64| Piece { tier, from: from * MINUTE, to: to * MINUTE };
        let (raw, minute, hour) = (Tier::Raw, Tier::Minute, Tier::Hour);
        let cut = |from: i64, to: i64, widest| pieces(from * MINUTE, to * MINUTE, widest, &kept);
        assert_eq!(cut(0, 480, raw), [piece(raw, 0, 480)]);
        assert_eq!(
            cut(0, 480, minute),
            [
                piece(raw, 0, 120),
                piece(minute, 120, 300),
                piece(raw, 300, 360),
                piece(minute, 360, 420),
                piece(raw, 420, 480)
            ]
        );
        assert_eq!(
            cut(150, 390, hour),
            [piece(minute, 150, 180), piece(hour, 180, 300), piece(raw, 300, 360), piece(minute, 360, 390)]
        );
        let ends = pieces(3 * HOUR + 7, 3 * HOUR + 2 * MINUTE + 9, hour, &kept);
        let edge = |tier, from, to| Piece { tier, from: 3 * HOUR + from, to: 3 * HOUR + to };
        assert_eq!(
            ends,
            [edge(raw, 7, MINUTE), edge(minute, MINUTE, 2 * MINUTE), edge(raw, 2 * MINUTE, 2 * MINUTE + 9)]
        );
        assert_eq!(pieces(7, 9, hour, &kept), [Piece { tier: raw, from: 7, to: 9 }]);
        assert_eq!(pieces(7, 7, hour, &kept), []);
    }

    #[test]
    fn a_column_takes_the_widest_rows_that_fit() {
        for (column, expect) in [(1, Tier::Raw), (MINUTE - 1, Tier::Raw), (MINUTE, Tier::Minute), (HOUR, Tier::Hour)] {
            assert_eq!(Tier::within(column), expect);
            assert_eq!(Tier::from_word(expect.word()), Some(expect));
        }
    }
}
