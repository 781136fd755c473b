//! The data of one curve: columns from the history, then the live values that came after; past and live are one curve.

use std::{collections::VecDeque, time::Duration};

use jiff::{SignedDuration, Timestamp};

use crate::{
    history::{Bucket, Series},
    plant::{
        exact::Exact,
        number::{to_i64, to_u32, to_usize},
    },
};

/// Live values kept while no newer answer comes; the oldest go first, and the history has them.
const LIVE_MAX: usize = 4096;

/// What is known of one tag over time. A value holds until the next one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    past: Option<Series>,
    live: VecDeque<(Timestamp, Option<Exact>)>,
}

/// What a curve did within one column of dots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    pub min: f64,
    pub max: f64,
    /// At the end of the column.
    pub last: f64,
}

impl Trace {
    /// Nothing is known.
    pub const EMPTY: Trace = Trace { past: None, live: VecDeque::new() };

    /// Takes an answer of the history that surely holds all that happened before `sure`: older live values are given
    /// up, except the one that still held then.
    pub fn set_past(&mut self, series: Series, sure: Timestamp) {
        self.past = Some(series);
        while self.live.get(1).is_some_and(|(at, _)| *at <= sure) {
            self.live.pop_front();
        }
        if let Some(first) = self.live.front_mut() {
            first.0 = first.0.max(sure);
        }
    }

    /// Adds a live value if it is news; `None` is "no good value". A value that is not newer than the last one counts
    /// from just after it.
    pub fn push(&mut self, at: Timestamp, value: Option<Exact>) {
        let value = value.filter(|value| value.is_finite());
        let at = match self.live.back() {
            Some((_, held)) if *held == value => return,
            Some((last, _)) if *last >= at => last.checked_add(SignedDuration::from_micros(1)).unwrap_or(at),
            _ => at,
        };
        if self.live.len() == LIVE_MAX {
            self.live.pop_front();
        }
        self.live.push_back((at, value));
    }

    /// The answer of the history, if there is one.
    pub fn past(&self) -> Option<&Series> {
        self.past.as_ref()
    }

    /// Was this instant read, with or without a value in it?
    pub fn covers(&self, at: Timestamp) -> bool {
        let live = self.live.front().is_some_and(|(first, _)| *first <= at);
        let past = self.past.as_ref().is_some_and(|past| {
            let width = past.step.checked_mul(to_u32(past.buckets.len())).unwrap_or(Duration::MAX);
            past.from <= at
                && at.duration_since(past.from) < SignedDuration::try_from(width).unwrap_or(SignedDuration::MAX)
        });
        live || past
    }

    /// The value at an instant: the live value that held, or the last one of its column in the history.
    pub fn value_at(&self, at: Timestamp) -> Option<Exact> {
        if self.live.front().is_some_and(|(first, _)| *first <= at) {
            let after = self.live.partition_point(|(live, _)| *live <= at);
            return self.live[after - 1].1;
        }
        let past = self.past.as_ref()?;
        let step = micros(past.step).max(1);
        let n = usize::try_from((at.as_microsecond() - past.from.as_microsecond()).div_euclid(step)).ok()?;
        past.buckets.get(n).copied().flatten().map(|bucket| bucket.last)
    }

    /// The curve in `count` columns from `from` to `to`; nothing from `now` on. `None` is a gap.
    /// Every column of the history falls into a column of dots, so that no spike is lost.
    pub fn columns(&self, from: Timestamp, to: Timestamp, now: Timestamp, count: usize) -> Vec<Option<Span>> {
        let (start, width) = (from.as_microsecond(), (to.as_microsecond() - from.as_microsecond()).max(0));
        let edge = |n: usize| start + to_i64(i128::from(width) * n as i128 / count.max(1) as i128);
        let now = now.as_microsecond();
        let live_from = self.live.front().map_or(i64::MAX, |(at, _)| at.as_microsecond());
        let column = |n: usize| {
            let (a, b) = (edge(n), edge(n + 1).min(now));
            if a >= now || width == 0 {
                return None;
            }
            join(self.past_span(a, edge(n + 1), live_from), self.live_span(a, b))
        };
        (0..count).map(column).collect()
    }

    /// The history between `a` and `b`: the columns whose middle lies there; of columns wider than that, the one that
    /// covers the middle. What the live values already tell is left to them.
    fn past_span(&self, a: i64, b: i64, live_from: i64) -> Option<Span> {
        let past = self.past.as_ref()?;
        let (from, step) = (past.from.as_microsecond(), micros(past.step).max(1));
        let index = |at: i64| (at - from).div_euclid(step);
        let (first, last) = if step > b - a {
            let middle = index(a + (b - a) / 2);
            (middle, if a < live_from { middle } else { middle - 1 })
        } else {
            (index(a + step - step / 2 - 1), index(b + step - step / 2 - 1) - 1)
        };
        let wanted = first.max(0)..=last.min(past.buckets.len() as i64 - 1);
        let known = wanted.filter(|n| from + n * step < live_from);
        known.filter_map(|n| past.buckets[to_usize(n)].and_then(span)).fold(None, |sum, next| join(sum, Some(next)))
    }

    /// The live values between `a` and `b`, with the one that held at `a`.
    fn live_span(&self, a: i64, b: i64) -> Option<Span> {
        let first = self.live.partition_point(|(at, _)| at.as_microsecond() <= a).saturating_sub(1);
        let values = self.live.iter().skip(first).take_while(|(at, _)| at.as_microsecond() < b);
        let span = |value: f64| Span { min: value, max: value, last: value };
        let spans = values.map(|(_, value)| value.map(|value| span(value.near())));
        spans.fold(None, join)
    }
}

/// Both together, `b` being the later; one that is a gap counts for nothing.
fn join(a: Option<Span>, b: Option<Span>) -> Option<Span> {
    match (a, b) {
        (Some(a), Some(b)) => Some(Span { min: a.min.min(b.min), max: a.max.max(b.max), last: b.last }),
        (a, b) => b.or(a),
    }
}

/// A column of the history, unless it is not a number.
fn span(bucket: Bucket) -> Option<Span> {
    let finite = bucket.min.is_finite() && bucket.max.is_finite() && bucket.last.is_finite();
    finite.then_some(Span { min: bucket.min, max: bucket.max, last: bucket.last.near() })
}

fn micros(step: Duration) -> i64 {
    i64::try_from(step.as_micros()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::def::TagId;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number of seconds")
    }

    /// A history of 10 s columns from second 0; NAN is a gap.
    fn past(values: &[f64]) -> Series {
        let bucket = |v: &f64| v.is_finite().then_some(Bucket { min: *v, max: *v, mean: *v, last: (*v).into() });
        Series {
            tag: TagId(0),
            from: at(0),
            step: Duration::from_secs(10),
            buckets: values.iter().map(bucket).collect(),
            summary: None,
            counted: None,
            good: 1.0,
        }
    }

    fn trace(values: &[f64], live: &[(i64, f64)]) -> Trace {
        let mut trace = Trace { past: Some(past(values)), ..Trace::default() };
        live.iter().for_each(|(second, value)| trace.push(at(*second), Some((*value).into())));
        trace
    }

    /// Columns from 0 s to `to`, written `min-max`, or `-` for a gap.
    fn check(trace: &Trace, to: i64, now: i64, count: usize, expect: &str) {
        let text = |span: &Option<Span>| match span {
            None => "-".to_owned(),
            Some(span) if span.min == span.max => format!("{}", span.min),
            Some(span) => format!("{}…{}", span.min, span.max),
        };
        let columns: Vec<String> = trace.columns(at(0), at(to), at(now), count).iter().map(text).collect();
        assert_eq!(columns.join(" "), expect);
    }

    #[test]
    fn columns_of_the_history_become_columns_of_dots() {
        const GAP: f64 = f64::NAN;
        check(&trace(&[1., 2., 3.], &[]), 30, 30, 3, "1 2 3");
        check(&trace(&[1., 9., 3., 4.], &[]), 40, 40, 2, "1…9 3…4");
        check(&trace(&[1., 2.], &[]), 20, 20, 4, "1 1 2 2");
        check(&trace(&[1., GAP, GAP, 4.], &[]), 40, 40, 4, "1 - - 4");
        check(&trace(&[1., GAP], &[]), 40, 40, 4, "1 - - -");
        check(&Trace::default(), 40, 40, 4, "- - - -");
        check(&trace(&[1.], &[]), 0, 40, 2, "- -");
    }

    #[test]
    fn nothing_is_drawn_after_now() {
        check(&trace(&[1., 2., 3., 4.], &[]), 40, 20, 4, "1 2 - -");
        check(&trace(&[1.], &[(10, 5.)]), 40, 20, 4, "1 5 - -");
    }

    #[test]
    fn live_values_continue_the_past_and_hold_until_the_next() {
        check(&trace(&[1., 2.], &[(20, 7.), (35, 8.)]), 40, 40, 4, "1 2 7 7…8");
        check(&trace(&[1., 2., 3., 4.], &[(15, 7.)]), 40, 40, 4, "1 2…7 7 7");
        check(&trace(&[1., 2.], &[(12, 7.)]), 20, 20, 8, "1 1 1 1 2…7 7 7 7");
        let mut gap = trace(&[1.], &[(10, 5.)]);
        gap.push(at(20), None);
        gap.push(at(30), Some(6.0.into()));
        check(&gap, 40, 40, 4, "1 5 - 6");
    }

    #[test]
    fn an_answer_takes_over_from_the_live_values_that_it_covers() {
        let mut trace = trace(&[], &[(0, 1.), (10, 2.), (20, 3.), (30, 4.)]);
        trace.set_past(past(&[1., 2., 3.]), at(28));
        assert_eq!(trace.live, [(at(28), Some(3.0.into())), (at(30), Some(4.0.into()))]);
        check(&trace, 40, 40, 4, "1 2 3 4");
    }

    #[test]
    fn the_value_at_an_instant_is_the_one_that_held() {
        let trace = trace(&[1., f64::NAN], &[(20, 7.), (30, 8.)]);
        for (second, expect) in
            [(-1, None), (0, Some(1.)), (9, Some(1.)), (10, None), (20, Some(7.)), (29, Some(7.)), (99, Some(8.))]
        {
            assert_eq!(trace.value_at(at(second)).map(Exact::near), expect, "at {second} s");
        }
    }

    #[test]
    fn no_data_and_not_read_yet_are_two_things() {
        let trace = trace(&[1., f64::NAN], &[(30, 7.)]);
        for (second, expect) in [(-1, false), (0, true), (15, true), (20, false), (29, false), (30, true), (99, true)] {
            assert_eq!(trace.covers(at(second)), expect, "at {second} s");
        }
        assert!(!Trace::default().covers(at(0)));
    }

    #[test]
    fn live_values_are_bounded_and_in_order() {
        let mut trace = Trace::default();
        (0..5000).for_each(|second| trace.push(at(second), Some((second as f64).into())));
        trace.push(at(5000), Some(4999.0.into()));
        assert_eq!((trace.live.len(), trace.live.back()), (LIVE_MAX, Some(&(at(4999), Some(4999.0.into())))));
        trace.push(at(10), None);
        assert!(trace.live.back().is_some_and(|(last, value)| *last > at(4999) && value.is_none()));
    }

    proptest! {
        /// However many columns the screen has: the greatest and least value of the history are on it.
        #[test]
        fn no_spike_is_lost(values in prop::collection::vec(-1e6..1e6f64, 1..200), count in 1usize..300) {
            let width = 10 * values.len() as i64;
            let columns = trace(&values, &[]).columns(at(0), at(width), at(width), count);
            let shown = columns.into_iter().flatten();
            let (low, high) = shown.fold((f64::MAX, f64::MIN), |(l, h), s| (l.min(s.min), h.max(s.max)));
            prop_assert_eq!(low, values.iter().copied().fold(f64::MAX, f64::min));
            prop_assert_eq!(high, values.iter().copied().fold(f64::MIN, f64::max));
        }
    }
}
