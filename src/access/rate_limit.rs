//! A rate limit: a burst at once, then one event an interval. Times count from any fixed instant.

use std::time::Duration;

/// `burst` events at once, and one more each `every`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RateLimit {
    burst: u32,
    every: Duration,
    /// The whole burst is available again from then on.
    full_at: Duration,
}

impl RateLimit {
    pub(crate) const fn new(burst: u32, every: Duration) -> RateLimit {
        RateLimit { burst, every, full_at: Duration::ZERO }
    }

    /// Counts one event; `false` if the limit is reached.
    pub(crate) fn try_acquire(&mut self, now: Duration) -> bool {
        let after = self.full_at.max(now) + self.every;
        let permitted = after <= now + self.every * self.burst;
        if permitted {
            self.full_at = after;
        }
        permitted
    }

    /// Takes one event in any case and gives the time that it must wait.
    pub(crate) fn reserve(&mut self, now: Duration) -> Duration {
        self.full_at = self.full_at.max(now) + self.every;
        self.full_at.saturating_sub(now + self.every * self.burst)
    }

    pub(crate) fn is_full(&self, now: Duration) -> bool {
        self.full_at <= now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_and_then_one_event_an_interval() {
        let seconds = Duration::from_secs;
        let mut limit = RateLimit::new(3, seconds(2));
        let passed = (0..10).filter(|_| limit.try_acquire(seconds(100))).count();
        assert_eq!(passed, 3);
        assert!(
            !limit.try_acquire(seconds(101)) && limit.try_acquire(seconds(102)) && !limit.try_acquire(seconds(102))
        );
        assert!(!limit.is_full(seconds(107)) && limit.is_full(seconds(108)));
        let waits: Vec<u64> = (0..5).map(|_| limit.reserve(seconds(200)).as_secs()).collect();
        assert_eq!(waits, [0, 0, 0, 2, 4]);
    }
}
