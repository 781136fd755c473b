//! Shares of a line's time: what operators' writes, and requests to devices that do not answer, may take from polls that
//! are due.

use std::time::Duration;

use crate::plant::{number::to_u64, time::elapsed};
use jiff::Timestamp;

/// Share of the line's time for writes, while polls are due.
pub const WRITE_SHARE: f64 = 0.2;
/// Share of the line's time for live reads, beside polls.
pub const LIVE_SHARE: f64 = 0.2;
/// Share of the line's time for requests to devices that do not answer, all of them together.
pub const PROBE_SHARE: f64 = 0.05;
/// What may be spent at once after a quiet time: some sixteen writes with their reading back at 9600 baud, or one timeout.
const SAVED_MAX: Duration = Duration::from_secs(1);
/// What waited for its timeout is not paid for longer than this, at the usual share.
const OWED_MAX: Duration = Duration::from_secs(1);

/// A bucket that fills with time: it allows spending while there is something in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    share: f64,
    /// Seconds; below zero while what was spent is being paid for.
    saved: f64,
    at: Timestamp,
}

impl Budget {
    /// Full, with a share of 0–1.
    pub fn new(share: f64, now: Timestamp) -> Budget {
        Budget { share: share.clamp(0.01, 1.0), saved: SAVED_MAX.as_secs_f64(), at: now }
    }

    /// May some of the line's time be spent now?
    pub fn allows(&self, now: Timestamp) -> bool {
        self.affords(Duration::ZERO, now)
    }

    /// May more of the line's time be spent now than this?
    pub fn affords(&self, time: Duration, now: Timestamp) -> bool {
        time.as_secs_f64() < self.saved_at(now)
    }

    /// From when on it allows spending, if nothing more is spent.
    pub fn allows_from(&self) -> Timestamp {
        // A microsecond more: at zero it does not allow yet.
        let missing = Duration::from_micros(to_u64(-self.saved / self.share * 1e6) + 1);
        if 0.0 < self.saved { self.at } else { self.at + missing }
    }

    /// So much of the line's time has been taken.
    pub fn spent(&mut self, time: Duration, now: Timestamp) {
        self.saved = (self.saved_at(now) - time.as_secs_f64()).max(-OWED_MAX.as_secs_f64());
        self.at = now;
    }

    fn saved_at(&self, now: Timestamp) -> f64 {
        let passed = elapsed(self.at, now);
        (self.saved + passed.as_secs_f64() * self.share).min(SAVED_MAX.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(ms: u64) -> Timestamp {
        Timestamp::from_millisecond(ms as i64).expect("a small number")
    }

    #[test]
    fn a_flood_of_writes_leaves_four_fifths_of_the_line_to_polls() {
        let mut budget = Budget::new(WRITE_SHARE, at(0));
        let (mut now, mut writes, mut polls) = (0, 0, 0);
        while now < 100_000 {
            if budget.allows(at(now)) {
                budget.spent(Duration::from_millis(60), at(now + 60));
                writes += 60;
            } else {
                polls += 60;
            }
            now += 60;
        }
        assert!((20_000..=21_100).contains(&writes), "{writes} ms for writes, {polls} ms for polls");
    }

    #[test]
    fn what_was_spent_is_paid_for_with_time() {
        let mut budget = Budget::new(PROBE_SHARE, at(0));
        assert_eq!(budget.allows_from(), at(0));
        budget.spent(Duration::from_millis(1_100), at(2_000));
        let from = budget.allows_from();
        assert!(at(4_000) < from && from <= at(4_001), "a tenth of a second at a twentieth: {from}");
        assert!(budget.allows(from) && !budget.allows(at(4_000)));
    }

    proptest! {
        #[test]
        fn an_operator_never_waits_longer_than_the_debt_takes(spent in proptest::collection::vec(1u64..60_000, 1..20)) {
            let mut budget = Budget::new(WRITE_SHARE, at(0));
            let mut now = 0;
            for ms in spent {
                now += ms;
                budget.spent(Duration::from_millis(ms), at(now));
            }
            prop_assert!(budget.allows(at(now + 5_001)), "a second at a fifth");
        }
    }
}
