//! The time that a device itself takes for a response: what the worst case of its polls has beside the time on the wire.

use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use crate::t;

/// What a device takes as long as nothing is known of it: most controllers and meters answer within this time.
pub const ASSUMED: Duration = Duration::from_millis(20);
/// A worst case leaves this share of the greatest time seen as a margin …
const MARGIN: u32 = 4;
/// … and not less than this: timers and schedulers of computers are no finer.
const MARGIN_MIN: Duration = Duration::from_millis(2);

/// Where a worst case has the time of the device from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TimeSource {
    /// Its profile states it.
    Profile,
    /// The greatest that was seen on this line since the start, with a margin.
    Seen,
    /// Nothing is stated, and it has not answered since the start.
    Assumed,
}

/// The time of one device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceTime {
    /// What the worst case counts.
    pub bound: Duration,
    /// Where it is from.
    pub source: TimeSource,
    /// What its profile states.
    pub stated: Option<Duration>,
    /// The greatest seen since the start; adapter, gateway and this computer have their share in it.
    pub seen: Option<Duration>,
    /// The same of late, smoothed.
    pub lately: Option<Duration>,
}

impl fmt::Display for TimeSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            TimeSource::Profile => t!("profile"),
            TimeSource::Seen => t!("seen, with a margin"),
            TimeSource::Assumed => t!("assumed"),
        })
    }
}

impl DeviceTime {
    /// The profile is believed until the device has taken longer than that.
    pub fn new(stated: Option<Duration>, seen: SeenTime) -> DeviceTime {
        let (greatest, lately) = (seen.greatest(), seen.lately());
        let (bound, source) = match (stated, greatest) {
            (Some(stated), seen) if seen.is_none_or(|seen| seen <= stated) => (stated, TimeSource::Profile),
            (_, Some(seen)) => (seen + (seen / MARGIN).max(MARGIN_MIN), TimeSource::Seen),
            (_, None) => (ASSUMED, TimeSource::Assumed),
        };
        DeviceTime { bound, source, stated, seen: greatest, lately }
    }

    /// What its profile states, if it takes longer than that again and again.
    pub fn broken_promise(&self) -> Option<Duration> {
        self.stated.filter(|stated| self.lately.is_some_and(|lately| *stated < lately))
    }
}

/// What a device has taken since the start of the station: not kept over a restart, for what was true of another adapter
/// or baud rate would be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SeenTime {
    answers: u64,
    greatest: Duration,
    lately: Duration,
}

impl SeenTime {
    /// One more good response.
    pub fn add(&mut self, time: Duration) {
        self.greatest = self.greatest.max(time);
        // An eighth of the news, as the smoothed cost of a poll.
        self.lately = if self.answers == 0 { time } else { (self.lately * 7 + time) / 8 };
        self.answers += 1;
    }

    fn greatest(self) -> Option<Duration> {
        (0 < self.answers).then_some(self.greatest)
    }

    fn lately(self) -> Option<Duration> {
        (0 < self.answers).then_some(self.lately)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn seen(times: &[u32]) -> SeenTime {
        let mut seen = SeenTime::default();
        times.iter().for_each(|time| seen.add(*time * MS));
        seen
    }

    #[test]
    fn the_profile_counts_until_the_device_takes_longer() {
        let check = |stated: Option<u32>, times: &[u32], bound: Duration, source| {
            let time = DeviceTime::new(stated.map(|ms| ms * MS), seen(times));
            assert_eq!((time.bound, time.source), (bound, source), "{stated:?} {times:?}");
        };
        check(None, &[], ASSUMED, TimeSource::Assumed);
        check(Some(30), &[], 30 * MS, TimeSource::Profile);
        check(Some(30), &[12, 30, 5], 30 * MS, TimeSource::Profile);
        check(Some(30), &[12, 40, 5], 50 * MS, TimeSource::Seen);
        check(None, &[12, 40, 5], 50 * MS, TimeSource::Seen);
        check(None, &[0, 1], 3 * MS, TimeSource::Seen);
    }

    #[test]
    fn one_slow_response_breaks_no_promise() {
        let broken = |times: &[u32]| DeviceTime::new(Some(30 * MS), seen(times)).broken_promise();
        assert_eq!(broken(&[10, 10, 10, 100, 10]), None);
        assert_eq!(broken(&[40, 40, 40, 40]), Some(30 * MS));
        assert_eq!(DeviceTime::new(None, seen(&[400])).broken_promise(), None);
    }
}
