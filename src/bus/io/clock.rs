//! The one clock of a station: plant time, which a demonstration may run faster than real time.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::time::Instant;

/// Reads plant time. Steady between two readings even when the system clock is stepped.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    base: Timestamp,
    start: Instant,
    speed: f64,
}

impl Clock {
    /// Plant time begins at `base` and runs `speed` times as fast as real time.
    pub fn starting_at(base: Timestamp, speed: f64) -> Clock {
        Clock { base, start: Instant::now(), speed }
    }

    /// Real time.
    pub fn real() -> Clock {
        Clock::starting_at(Timestamp::now(), 1.0)
    }

    /// Plant time now, in whole microseconds (what the history stores).
    pub fn now(&self) -> Timestamp {
        self.at(Instant::now())
    }

    /// Plant time at a moment, in whole microseconds; nothing is before the base.
    pub fn at(&self, moment: Instant) -> Timestamp {
        // Rounded, not cut off: who slept until a moment must find that it has come.
        let since = moment.saturating_duration_since(self.start);
        let micros = (since.as_secs_f64() * self.speed * 1e6).round();
        self.base + SignedDuration::from_micros(micros as i64)
    }

    /// Plant seconds per real second.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// The real time that a span of plant time takes.
    pub fn real_span(&self, plant: Duration) -> Duration {
        plant.div_f64(self.speed)
    }

    /// Sleeps until a moment of plant time; returns at once if it has passed.
    pub async fn sleep_until(&self, at: Timestamp) {
        let ahead = Duration::try_from(at.duration_since(self.base)).unwrap_or_default();
        tokio::time::sleep_until(self.start + self.real_span(ahead)).await;
    }

    /// Sleeps for a span of plant time.
    pub async fn sleep(&self, plant: Duration) {
        tokio::time::sleep(self.real_span(plant)).await;
    }
}
