//! The one clock of a station: plant time, which a demonstration may run faster than real time.
//!
//! Plant time is steady: nothing that the station waits for comes early or late when the system clock is set. What leaves
//! the station (records, snapshots) is in UTC: plant time and the steps of the system clock since the start.

use std::{
    sync::atomic::{AtomicI64, Ordering},
    time::{Duration, Instant as RealInstant, SystemTime},
};

use crate::plant::{number::to_i64, time::elapsed};
use jiff::{SignedDuration, Timestamp};
use tokio::time::Instant;

/// A system clock that moves more than this against the steady one was set.
const STEP_MIN: SignedDuration = SignedDuration::from_millis(500);

/// Reads plant time, steady also when the system clock is stepped, and UTC.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    base: Timestamp,
    start: Instant,
    speed: f64,
    /// `None` for a clock that is no wall clock: faster than real time, or virtual.
    system: Option<System>,
}

/// The system clock at the start, and what it was set by since then, in microseconds.
#[derive(Debug, Clone, Copy)]
struct System {
    wall: SystemTime,
    steady: RealInstant,
    // Shared by all copies of the clock for as long as the process lives, which has one or two clocks.
    steps: &'static AtomicI64,
    /// In a simulation, what the system clock is set by: that of the computer is not looked at.
    simulated: Option<&'static AtomicI64>,
}

impl Clock {
    /// Virtual time, with a system clock that is off by some microseconds.
    pub fn simulated(base: Timestamp, set_by: &'static AtomicI64) -> Clock {
        let clock = Clock { base, ..Clock::real() };
        Clock { system: clock.system.map(|system| System { simulated: Some(set_by), ..system }), ..clock }
    }

    /// Plant time begins at `base` and runs `speed` times as fast as real time.
    pub fn starting_at(base: Timestamp, speed: f64) -> Clock {
        Clock { base, start: Instant::now(), speed, system: None }
    }

    /// Real time, which follows the system clock: see [`Clock::follow`].
    pub fn real() -> Clock {
        let steps = Box::leak(Box::new(AtomicI64::new(0)));
        let system = System { wall: SystemTime::now(), steady: RealInstant::now(), steps, simulated: None };
        Clock { system: Some(system), ..Clock::starting_at(Timestamp::now(), 1.0) }
    }

    /// What plant time lacks of UTC.
    pub fn behind_utc(&self) -> SignedDuration {
        SignedDuration::from_micros(self.system.map_or(0, |system| system.steps.load(Ordering::Relaxed)))
    }

    /// UTC now, as far as the system clock is right.
    pub fn utc(&self) -> Timestamp {
        self.to_utc(self.now())
    }

    /// The UTC of an instant of plant time.
    pub fn to_utc(&self, at: Timestamp) -> Timestamp {
        at.checked_add(self.behind_utc()).unwrap_or(at)
    }

    /// Looks at the system clock: if it was set, [`Clock::utc`] follows at once, in all copies of this clock. Gives the step.
    pub fn follow(&self) -> Option<SignedDuration> {
        match self.system?.simulated {
            Some(set_by) => self.stepped(SignedDuration::from_micros(set_by.load(Ordering::Relaxed))),
            None => self.follow_at(SystemTime::now(), RealInstant::now()),
        }
    }

    pub(crate) fn follow_at(&self, wall: SystemTime, steady: RealInstant) -> Option<SignedDuration> {
        let System { wall: wall_before, steady: steady_before, .. } = self.system?;
        let passed = SignedDuration::try_from(steady.saturating_duration_since(steady_before)).ok()?;
        let moved = match wall.duration_since(wall_before) {
            Ok(ahead) => SignedDuration::try_from(ahead).ok()?,
            Err(back) => -SignedDuration::try_from(back.duration()).ok()?,
        };
        self.stepped(moved - passed)
    }

    /// The system clock is so far from the steady one.
    fn stepped(&self, set_by: SignedDuration) -> Option<SignedDuration> {
        let step = set_by - self.behind_utc();
        if step.abs() < STEP_MIN {
            return None;
        }
        self.system?.steps.fetch_add(i64::try_from(step.as_micros()).ok()?, Ordering::Relaxed);
        Some(step)
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
        self.base + SignedDuration::from_micros(to_i64(micros))
    }

    /// Plant seconds per real second.
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// The real time that a span of plant time takes.
    pub fn real_span(&self, plant: Duration) -> Duration {
        plant.div_f64(self.speed)
    }

    /// The plant time in which a span of real time passes.
    pub fn plant_span(&self, real: Duration) -> Duration {
        real.mul_f64(self.speed)
    }

    /// Sleeps until a moment of plant time; returns at once if it has passed.
    pub async fn sleep_until(&self, at: Timestamp) {
        let ahead = elapsed(self.base, at);
        tokio::time::sleep_until(self.start + self.real_span(ahead)).await;
    }

    /// The same; for ever without a moment.
    pub async fn sleep_until_if_any(&self, at: Option<Timestamp>) {
        match at {
            Some(at) => self.sleep_until(at).await,
            None => std::future::pending().await,
        }
    }

    /// Sleeps for a span of plant time.
    pub async fn sleep(&self, plant: Duration) {
        tokio::time::sleep(self.real_span(plant)).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_was_set_is_followed_and_one_that_drifts_is_not() {
        let clock = Clock::real();
        let copy = clock;
        let System { wall, steady, .. } = clock.system.expect("a real clock");
        let (seconds, drift) = (Duration::from_secs, Duration::from_millis(400));
        assert_eq!(clock.follow_at(wall + seconds(5) + drift, steady + seconds(5)), None);
        let two_years = seconds(2 * 365 * 86_400);
        let years = SignedDuration::from_hours(2 * 365 * 24);
        assert_eq!(clock.follow_at(wall + seconds(6) + two_years, steady + seconds(6)), Some(years));
        assert_eq!(copy.behind_utc(), years, "every copy follows");
        assert_eq!(copy.to_utc(Timestamp::UNIX_EPOCH), Timestamp::UNIX_EPOCH + years);
        assert_eq!(clock.follow_at(wall + seconds(7) + two_years, steady + seconds(7)), None, "once");
        assert_eq!(clock.follow_at(wall + seconds(8) - two_years, steady + seconds(8)), Some(-years - years));
        assert_eq!(clock.behind_utc(), -years);
        let demo = Clock::starting_at(Timestamp::UNIX_EPOCH, 60.0);
        assert_eq!((demo.follow(), demo.behind_utc()), (None, SignedDuration::ZERO), "no wall clock");
    }
}
