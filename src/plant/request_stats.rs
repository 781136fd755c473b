//! Counters of requests: how many, how they ended, how long they took. One kind for a poll, a device and a line.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::fault::{ExceptionCode, Fault};
use crate::plant::number::to_usize;

/// How requests ended.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RequestStats {
    /// Requests sent, retries included.
    pub requests: u64,
    /// Valid normal answers.
    pub ok: u64,
    /// No answer in time.
    pub timeouts: u64,
    /// Answers whose CRC or LRC did not fit.
    pub check: u64,
    /// Answers cut short, of a wrong length, or with characters that cannot be.
    pub length: u64,
    /// Answers of another unit or to another function, or with a wrong echo.
    pub foreign: u64,
    /// Exception answers by code.
    pub exceptions: Vec<(ExceptionCode, u64)>,
    /// Requests that were sent again because the answer was corrupt.
    pub retries: u64,
    /// Answers to requests that had been given up.
    pub late: u64,
    /// From the last byte sent to the first byte received.
    pub response_time: Spread,
    /// What good reads of a poll have taken of the line's time, from the first byte sent to the end of the silence behind
    /// the answer: what the worst case bounds. Empty for a device or a line.
    pub read_time: Spread,
    /// How long after its point of the grid a poll was sent.
    pub jitter: Spread,
    /// Releases of the poll that were skipped because the line had no time.
    pub missed: u64,
    /// The latest outcomes, bit 0 the newest, 1 a failure; see [`RequestStats::recent`].
    pub(super) recent: u64,
}

impl RequestStats {
    /// Counts one request.
    pub fn count(&mut self, outcome: Result<(), Fault>, response_time: Option<Duration>) {
        self.requests += 1;
        if let Some(response_time) = response_time {
            self.response_time.add(response_time);
        }
        self.recent = self.recent << 1 | u64::from(outcome.is_err());
        let Err(fault) = outcome else {
            self.ok += 1;
            return;
        };
        match fault {
            Fault::Timeout | Fault::Hangup | Fault::NotHeard => self.timeouts += 1,
            Fault::Crc { .. } | Fault::Lrc { .. } => self.check += 1,
            Fault::Truncated { .. } | Fault::WrongLength { .. } | Fault::NotHex(_) | Fault::NotANumber => {
                self.length += 1;
            }
            Fault::WrongUnit { .. }
            | Fault::WrongFunction { .. }
            | Fault::WrongTransaction { .. }
            | Fault::NoHeader
            | Fault::WrongEcho
            | Fault::OutOfSync => self.foreign += 1,
            Fault::Exception(code) => match self.exceptions.iter_mut().find(|(known, _)| *known == code) {
                Some((_, count)) => *count += 1,
                None => self.exceptions.push((code, 1)),
            },
            Fault::Unproven => self.ok += 1,
            // Nothing was sent.
            Fault::NotConnected | Fault::BackedOff => self.requests -= 1,
        }
    }

    /// Corrupt answers of all kinds.
    pub fn corrupt(&self) -> u64 {
        self.check + self.length + self.foreign
    }

    /// Failures among the latest 64 requests, and how many requests that were.
    pub fn recent(&self) -> (u32, u32) {
        (self.recent.count_ones(), self.requests.min(64) as u32)
    }

    /// What was counted after `before`; all of it, if the counters have restarted since.
    pub fn since(&self, before: &RequestStats) -> RequestStats {
        let Some(requests) = self.requests.checked_sub(before.requests) else { return self.clone() };
        let earlier = |code| before.exceptions.iter().find(|(known, _)| *known == code).map_or(0, |(_, count)| *count);
        let exceptions = self.exceptions.iter().map(|(code, count)| (*code, count.saturating_sub(earlier(*code))));
        RequestStats {
            requests,
            ok: self.ok.saturating_sub(before.ok),
            timeouts: self.timeouts.saturating_sub(before.timeouts),
            check: self.check.saturating_sub(before.check),
            length: self.length.saturating_sub(before.length),
            foreign: self.foreign.saturating_sub(before.foreign),
            exceptions: exceptions.filter(|(_, count)| 0 < *count).collect(),
            retries: self.retries.saturating_sub(before.retries),
            late: self.late.saturating_sub(before.late),
            response_time: self.response_time.since(&before.response_time),
            read_time: self.read_time.since(&before.read_time),
            jitter: self.jitter.since(&before.jitter),
            missed: self.missed.saturating_sub(before.missed),
            recent: self.recent & 1u64.checked_shl(requests.min(64) as u32).map_or(u64::MAX, |bit| bit - 1),
        }
    }

    /// Have the latest requests failed, this many of them?
    pub fn fails_since(&self, count: u32) -> bool {
        u64::from(count) <= self.requests && count <= self.recent.trailing_ones()
    }

    /// Did the newest request fail?
    pub fn failed_last(&self) -> bool {
        self.recent & 1 == 1
    }
}

/// Buckets of a [`Spread`]: four to every doubling, from 0.1 ms to 6.5 s.
const BUCKETS: usize = 64;
const LEAST_S: f64 = 1e-4;

/// Durations: the last, the greatest, and percentiles to about a fifth of their value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    last: Duration,
    max: Duration,
    count: u64,
    #[serde(with = "serde_big_array::BigArray")]
    buckets: [u32; BUCKETS],
}

impl Default for Spread {
    fn default() -> Self {
        Spread { last: Duration::ZERO, max: Duration::ZERO, count: 0, buckets: [0; BUCKETS] }
    }
}

impl Spread {
    /// Takes one more.
    pub fn add(&mut self, span: Duration) {
        (self.last, self.max) = (span, self.max.max(span));
        self.count += 1;
        let bucket = &mut self.buckets[bucket_of(span)];
        *bucket = bucket.saturating_add(1);
    }

    /// What was added after `before`; all of it, if it has restarted since. The greatest is then known as well as a
    /// percentile is.
    pub fn since(&self, before: &Spread) -> Spread {
        let Some(count) = self.count.checked_sub(before.count) else { return self.clone() };
        let mut buckets = self.buckets;
        for (bucket, before) in buckets.iter_mut().zip(before.buckets) {
            *bucket = bucket.saturating_sub(before);
        }
        let greatest = buckets.iter().rposition(|count| 0 < *count);
        let max = greatest.map_or(Duration::ZERO, |bucket| end_of(bucket).min(self.max));
        Spread { last: self.last.min(max), max, count, buckets }
    }

    /// Adds what another has taken.
    pub fn merge(&mut self, other: &Spread) {
        if 0 < other.count {
            (self.last, self.max) = (other.last, self.max.max(other.max));
        }
        self.count += other.count;
        for (bucket, other) in self.buckets.iter_mut().zip(other.buckets) {
            *bucket = bucket.saturating_add(other);
        }
    }

    /// The last; `None` before the first.
    pub fn last(&self) -> Option<Duration> {
        (0 < self.count).then_some(self.last)
    }

    /// The greatest.
    pub fn max(&self) -> Option<Duration> {
        (0 < self.count).then_some(self.max)
    }

    /// 99 of 100 were not longer than this (the upper end of a bucket, at most a fifth too much).
    pub fn p99(&self) -> Option<Duration> {
        self.percentile(99)
    }

    /// Half of them were not longer than this (to a fifth, as [`Spread::p99`]).
    pub fn median(&self) -> Option<Duration> {
        self.percentile(50)
    }

    fn percentile(&self, percent: u64) -> Option<Duration> {
        let total: u64 = self.buckets.iter().map(|count| u64::from(*count)).sum();
        let rank = (total * percent).div_ceil(100);
        let mut seen = 0;
        let bucket = self.buckets.iter().position(|count| {
            seen += u64::from(*count);
            0 < total && rank <= seen
        })?;
        Some(end_of(bucket).min(self.max))
    }
}

/// The upper end of a bucket.
fn end_of(bucket: usize) -> Duration {
    Duration::from_secs_f64(LEAST_S * ((bucket + 1) as f64 / 4.0).exp2())
}

fn bucket_of(span: Duration) -> usize {
    let doublings = (span.as_secs_f64() / LEAST_S).max(1.0).log2();
    to_usize(4.0 * doublings).min(BUCKETS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_end_is_counted_once() {
        let mut stats = RequestStats::default();
        stats.count(Ok(()), Some(Duration::from_millis(12)));
        stats.count(Err(Fault::Timeout), None);
        stats.count(Err(Fault::Crc { got: 1, computed: 2 }), None);
        stats.count(Err(Fault::WrongUnit { got: 1, asked: 2 }), None);
        stats.count(Err(Fault::Truncated { got: 1, expected: 2 }), None);
        for _ in 0..2 {
            stats.count(Err(Fault::Exception(ExceptionCode(2))), None);
        }
        stats.count(Err(Fault::BackedOff), None);
        let sum =
            stats.ok + stats.timeouts + stats.corrupt() + stats.exceptions.iter().map(|(_, count)| count).sum::<u64>();
        assert_eq!((stats.requests, sum), (7, 7));
        assert_eq!(stats.exceptions, [(ExceptionCode(2), 2)]);
        assert!(stats.failed_last());
    }

    #[test]
    fn one_slow_answer_is_the_maximum_two_the_percentile() {
        let mut spread = Spread::default();
        assert_eq!((spread.last(), spread.p99()), (None, None));
        for _ in 0..99 {
            spread.add(Duration::from_millis(10));
        }
        spread.add(Duration::from_millis(400));
        let p99 = spread.p99().expect("a hundred answers").as_secs_f64() * 1e3;
        assert!((10.0..12.1).contains(&p99), "{p99}");
        assert_eq!(spread.max(), Some(Duration::from_millis(400)));
        spread.add(Duration::from_millis(400));
        assert_eq!(spread.p99(), Some(Duration::from_millis(400)));
    }
}
