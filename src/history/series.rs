//! Stored samples reduced to the columns of a curve.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::{
    Bucket, Series,
    tiers::{CurvePart, Tier, floor},
};
use crate::{
    plant::{def::TagId, sample::Sample},
    report::step_series::{HoldInterval, IntervalStats, StepSeries},
};

/// The span of a curve; `from < to`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Start of the first column.
    pub from: Timestamp,
    /// End of the last column.
    pub to: Timestamp,
    /// Nothing is known from here on: now, where the span reaches into the future.
    pub until: Timestamp,
}

/// A curve of more columns than these may have down to half of those asked for, where wider aggregates make it then: a week
/// of eight pens comes from 1,344 rows in place of 80,640.
const COLUMNS_ENOUGH: i64 = 120;
/// What asks for more than a screen draws measures them, as a step response does: it has them all.
const COLUMNS_DRAWN: i64 = 1_000;

/// The grid of a curve of at most `buckets` columns, and the widest aggregates that it may be made of, `finest` at least:
/// where these are minutes or hours, columns begin and end with them, and the span is a little longer than asked. A single
/// column begins and ends as asked: its ends come from samples, for as long as these are kept.
pub fn grid(span: Span, buckets: usize, finest: Tier) -> (Span, usize, Tier) {
    let (from, to) = (span.from.as_microsecond(), span.to.as_microsecond());
    let count = i64::try_from(buckets.max(1)).unwrap_or(i64::MAX);
    let least = if count <= COLUMNS_DRAWN { count.min(COLUMNS_ENOUGH.max(count / 2)) } else { count };
    let tier = Tier::within((to - from) / least).max(finest);
    let Some(step) = (if count == 1 { finest } else { tier }).step() else { return (span, buckets, tier) };
    let from = floor(from, step);
    let column = ceil_div(ceil_div(to - from, count), step) * step;
    let count = ceil_div(to - from, column);
    let instant = |micros| Timestamp::from_microsecond(micros).ok();
    match (instant(from), instant(from + count * column)) {
        (Some(from), Some(to)) => (Span { from, to, ..span }, usize::try_from(count).unwrap_or(buckets), tier),
        _ => (span, buckets, Tier::Raw),
    }
}

fn ceil_div(number: i64, by: i64) -> i64 {
    -(-number).div_euclid(by)
}

/// Computes a curve of at most `buckets` columns. The samples come in order of time and begin
/// [`HOLD_MAX`](crate::report::step_series::HOLD_MAX) before the span, so that the value standing at its start is known.
pub struct Curve {
    tag: TagId,
    from: Timestamp,
    columns: Columns,
    steps: StepSeries,
    stats: Vec<Option<IntervalStats>>,
    whole: Option<IntervalStats>,
}

impl Curve {
    /// Nothing has come yet.
    pub fn new(tag: TagId, span: Span, buckets: usize) -> Curve {
        let columns = Columns::new(span, buckets);
        let stats = vec![None; columns.count];
        let steps = StepSeries::new(span.from, span.until.min(span.to));
        Curve { tag, from: span.from, columns, steps, stats, whole: None }
    }

    /// The next sample.
    pub fn next(&mut self, sample: Sample) {
        if let Some(piece) = self.steps.next(sample) {
            self.add(CurvePart::Held(piece));
        }
    }

    /// The curve, when the last sample has come.
    pub fn end(mut self) -> Series {
        if let Some(piece) = self.steps.clone().end() {
            self.add(CurvePart::Held(piece));
        }
        let Curve { tag, from, columns, stats, whole, steps: _ } = self;
        let bucket = |stats: IntervalStats| Bucket {
            min: stats.min.near(),
            max: stats.max.near(),
            mean: stats.mean,
            last: stats.last,
        };
        Series {
            tag,
            from,
            step: columns.step(),
            buckets: stats.into_iter().map(|stats| stats.map(bucket)).collect(),
            summary: whole.map(|stats| (stats.min, stats.shown_mean(), stats.max)),
            counted: None,
            good: whole.map_or(0.0, |stats| (stats.seconds * 1e9 / columns.nanos as f64).clamp(0.0, 1.0)),
        }
    }

    /// The next part: a value that stood, or an aggregate that lies in one column.
    pub fn add(&mut self, part: CurvePart) {
        let Curve { columns, stats, whole, .. } = self;
        match part {
            CurvePart::Held(piece) => {
                IntervalStats::add(whole, piece);
                columns.cut(piece, |column, part| IntervalStats::add(&mut stats[column], part));
            }
            CurvePart::Aggregate(aggregate) => {
                let Ok(at) = Timestamp::from_microsecond(aggregate.at) else { return };
                IntervalStats::add(whole, aggregate.stats);
                IntervalStats::add(&mut stats[columns.column_of(at)], aggregate.stats);
            }
        }
    }
}

/// Columns of equal width over a span. Their edges are computed each from the start, so that no rounding adds up.
struct Columns {
    from: Timestamp,
    nanos: i128,
    count: usize,
}

impl Columns {
    fn new(span: Span, buckets: usize) -> Columns {
        let nanos = span.to.duration_since(span.from).as_nanos().max(1);
        // Never narrower than the microsecond that is stored.
        let count = buckets.clamp(1, usize::try_from(nanos / 1_000).unwrap_or(usize::MAX).max(1));
        Columns { from: span.from, nanos, count }
    }

    fn step(&self) -> Duration {
        let nanos = self.nanos / self.count as i128;
        Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
    }

    fn edge(&self, column: usize) -> Timestamp {
        let nanos = self.nanos * column as i128 / self.count as i128;
        self.from.checked_add(SignedDuration::from_nanos_i128(nanos)).unwrap_or(Timestamp::MAX)
    }

    fn column_of(&self, at: Timestamp) -> usize {
        let nanos = at.duration_since(self.from).as_nanos();
        usize::try_from(nanos * self.count as i128 / self.nanos).unwrap_or(0).min(self.count - 1)
    }

    /// Cuts a piece at the edges of the columns that it lies in.
    fn cut(&self, piece: HoldInterval, mut each: impl FnMut(usize, HoldInterval)) {
        let mut from = piece.from;
        let mut column = self.column_of(from);
        while from < piece.to && column < self.count {
            let to = self.edge(column + 1).min(piece.to);
            if from < to {
                each(column, HoldInterval { from, to, ..piece });
                from = to;
            }
            column += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{plant::sample::Cause, report::testing::sec};

    fn samples(rows: &[(i64, Option<f64>)]) -> Vec<Sample> {
        let row = |&(at, value): &(i64, Option<f64>)| {
            value.map_or(Sample::bad(Cause::DeviceDown, sec(at)), |value| Sample::good(value, sec(at)))
        };
        rows.iter().map(row).collect()
    }

    #[test]
    fn one_column_begins_and_ends_as_it_is_asked() {
        let asked = span(7, 100_003);
        let check = |buckets, finest, expect: (i64, i64)| {
            let (got, count, tier) = grid(asked, buckets, finest);
            assert_eq!((got.from, got.to, count, tier), (sec(expect.0), sec(expect.1), buckets, Tier::Hour));
        };
        check(1, Tier::Raw, (7, 100_003));
        check(2, Tier::Raw, (0, 100_800));
        check(1, Tier::Minute, (0, 100_020));
    }

    fn span(from: i64, to: i64) -> Span {
        Span { from: sec(from), to: sec(to), until: sec(to) }
    }

    #[test]
    fn many_columns_give_way_to_wider_aggregates() {
        let (hour, day) = (3_600, 86_400);
        for (seconds, asked, columns, tier) in [
            (2 * hour, 300, 300, Tier::Raw),
            (3 * hour, 300, 180, Tier::Minute),
            (5 * hour, 300, 300, Tier::Minute),
            (6 * day, 300, 298, Tier::Minute),
            (7 * day, 300, 168, Tier::Hour),
            (30 * day, 300, 240, Tier::Hour),
            (7 * day, 140, 84, Tier::Hour),
            // Of few columns none is given away.
            (hour, 100, 100, Tier::Raw),
            (7 * day, 200, 168, Tier::Hour),
            (15 * hour, 24, 24, Tier::Minute),
            // Nor of more than a screen draws.
            (day, 2_000, 2_000, Tier::Raw),
        ] {
            let got = grid(span(0, seconds), asked, Tier::Raw);
            assert_eq!((got.1, got.2), (columns, tier), "{seconds} s in {asked} columns");
        }
    }

    fn series(tag: TagId, samples: impl Iterator<Item = Sample>, span: Span, buckets: usize) -> Series {
        let mut curve = Curve::new(tag, span, buckets);
        samples.for_each(|sample| curve.next(sample));
        curve.end()
    }

    /// Buckets as (min, mean, max, last) of 0..40 s in four columns.
    fn check(rows: &[(i64, Option<f64>)], expect: [Option<(f64, f64, f64, f64)>; 4], good: f64) {
        let got = series(TagId(0), samples(rows).into_iter(), span(0, 40), 4);
        let buckets: Vec<_> = got.buckets.iter().map(|b| b.map(|b| (b.min, b.mean, b.max, b.last.near()))).collect();
        assert_eq!(buckets, expect);
        assert!((got.good - good).abs() < 1e-9, "{}", got.good);
        assert_eq!(got.step, Duration::from_secs(10));
    }

    #[test]
    fn a_column_shows_what_stood_in_it_and_a_gap_stays_a_gap() {
        let flat = |value| Some((value, value, value, value));
        check(&[], [None; 4], 0.0);
        check(&[(0, Some(5.0))], [flat(5.0); 4], 1.0);
        check(&[(-60, Some(5.0))], [flat(5.0); 4], 1.0);
        check(
            &[(0, Some(0.0)), (5, Some(10.0))],
            [Some((0.0, 5.0, 10.0, 10.0)), flat(10.0), flat(10.0), flat(10.0)],
            1.0,
        );
        check(&[(0, Some(5.0)), (12, None), (30, Some(7.0))], [flat(5.0), flat(5.0), None, flat(7.0)], 22.0 / 40.0);
        // The last good value of a column is shown even if the column ends without one.
        check(&[(0, Some(1.0)), (4, Some(4.0)), (8, None)], [Some((1.0, 2.5, 4.0, 4.0)), None, None, None], 0.2);
        // Not stored any more: the curve ends, it does not run on.
        check(&[(-145, Some(5.0))], [flat(5.0), None, None, None], 5.0 / 40.0);
    }

    #[test]
    fn nothing_is_drawn_into_the_future() {
        let window = Span { until: sec(20), ..span(0, 40) };
        let got = series(TagId(0), samples(&[(0, Some(5.0))]).into_iter(), window, 4);
        assert_eq!(got.buckets.iter().map(Option::is_some).collect::<Vec<_>>(), [true, true, false, false]);
        assert_eq!(got.good, 0.5);
    }

    proptest! {
        #[test]
        fn no_peak_is_lost_and_columns_agree_with_the_whole(
            rows in proptest::collection::vec((1i64..40, proptest::option::weighted(0.8, -1e3f64..1e3)), 0..60),
            length in 1i64..700,
            buckets in 1usize..200,
        ) {
            let mut at = -20;
            let rows: Vec<_> = rows.into_iter().map(|(wait, value)| { at += wait; (at, value) }).collect();
            let got = series(TagId(0), samples(&rows).into_iter(), span(0, length), buckets);
            prop_assert_eq!(got.buckets.len(), buckets);
            let columns: Vec<Bucket> = got.buckets.iter().flatten().copied().collect();
            let (min, max) = (columns.iter().map(|b| b.min).reduce(f64::min), columns.iter().map(|b| b.max).reduce(f64::max));
            prop_assert_eq!(got.summary.map(|s| (s.0.near(), s.2.near())), min.zip(max));
            for b in &columns {
                prop_assert!(b.min <= b.mean && b.mean <= b.max && (b.min..=b.max).contains(&b.last.near()));
            }
            prop_assert!(!columns.is_empty() || got.good == 0.0);
            // One column over everything has the mean of the summary.
            let one = series(TagId(0), samples(&rows).into_iter(), span(0, length), 1);
            prop_assert_eq!(one.buckets[0].map(|b| b.mean), got.summary.map(|s| s.1.near()));
        }
    }
}
