//! The time that a device itself takes for a response: what the worst case of its polls has beside the time on the wire.

use std::{collections::VecDeque, fmt, time::Duration};

use serde::{Deserialize, Serialize};

use crate::t;

/// What a device takes as long as nothing is known of it: most controllers and meters answer within this time.
pub const ASSUMED: Duration = Duration::from_millis(20);
/// A worst case leaves this share of the greatest time seen as a margin …
const MARGIN: u32 = 4;
/// … and not less than this: timers and schedulers of computers are no finer.
const MARGIN_MIN: Duration = Duration::from_millis(2);
/// This many of the latest responses show whether a device keeps to what its profile states: one or two minutes of usual polls.
const LATEST: usize = 256;
/// Fewer than these say nothing: an adapter may need some time at the start.
const LATEST_MIN: usize = 32;
/// Fewer slow responses than these are pauses of an adapter, a gateway or this computer …
const SLOW_MIN: usize = 3;
/// … and so are those that are not more than one of this many.
const SLOW_OF: usize = 100;

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
    /// The greatest of the latest responses, while it takes longer than the profile states again and again.
    pub above_stated: Option<Duration>,
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
    pub fn new(seen: &SeenTime) -> DeviceTime {
        let (stated, greatest) = (seen.stated, seen.greatest());
        let (bound, source) = match (stated, greatest) {
            (Some(stated), seen) if seen.is_none_or(|seen| seen <= stated) => (stated, TimeSource::Profile),
            (_, Some(seen)) => (seen + (seen / MARGIN).max(MARGIN_MIN), TimeSource::Seen),
            (_, None) => (ASSUMED, TimeSource::Assumed),
        };
        let above_stated = seen.latest.iter().max().copied().filter(|_| seen.is_slow);
        DeviceTime { bound, source, stated, seen: greatest, above_stated }
    }
}

/// What a device has taken since the start of the station: not kept over a restart, for what was true of another adapter
/// or baud rate would be believed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SeenTime {
    /// What the profile states.
    stated: Option<Duration>,
    greatest: Duration,
    /// The newest last, at most [`LATEST`].
    latest: VecDeque<Duration>,
    /// It takes longer than stated, again and again.
    is_slow: bool,
}

impl SeenTime {
    /// No response yet of a device whose profile states this.
    pub fn new(stated: Option<Duration>) -> SeenTime {
        SeenTime { stated, ..SeenTime::default() }
    }

    /// Forgets every response.
    pub fn clear(&mut self) {
        *self = SeenTime::new(self.stated);
    }

    /// One more good response.
    pub fn add(&mut self, time: Duration) {
        self.greatest = self.greatest.max(time);
        if self.latest.len() == LATEST {
            self.latest.pop_front();
        }
        self.latest.push_back(time);
        let slow = self.stated.map_or(0, |stated| self.latest.iter().filter(|time| stated < **time).count());
        self.is_slow = is_slow(self.is_slow, slow, self.latest.len());
    }

    fn greatest(&self) -> Option<Duration> {
        (!self.latest.is_empty()).then_some(self.greatest)
    }
}

/// Whether a device is slower than stated, where `slow` of the latest `of` responses were: more than one of a hundred, for a
/// pause of an adapter or of this computer is not the device's. Once it is, it stays so until none of them is slow any more, so
/// that it cannot flutter.
fn is_slow(was: bool, slow: usize, of: usize) -> bool {
    if was { 0 < slow } else { LATEST_MIN <= of && SLOW_MIN <= slow && of < slow * SLOW_OF }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn seen(stated: Option<u32>, times: &[u32]) -> SeenTime {
        let mut seen = SeenTime::new(stated.map(|ms| ms * MS));
        times.iter().for_each(|time| seen.add(*time * MS));
        seen
    }

    #[test]
    fn the_profile_counts_until_the_device_takes_longer() {
        let check = |stated: Option<u32>, times: &[u32], bound: Duration, source| {
            let time = DeviceTime::new(&seen(stated, times));
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
    fn slow_responses_count_when_they_come_again_and_again() {
        let above = |stated, times: &[u32]| DeviceTime::new(&seen(stated, times)).above_stated;
        let start = |slow: &[u32]| [slow, &[10; 30]].concat();
        assert_eq!(above(Some(30), &start(&[100, 90])), None, "two pauses");
        assert_eq!(above(Some(30), &[90; 31]), None, "too few responses");
        assert_eq!(above(Some(30), &start(&[45, 41, 43])), Some(45 * MS));
        assert_eq!(above(Some(30), &[30; 300]), None, "as long as stated");
        assert_eq!(above(None, &[400; 300]), None, "nothing is stated");
        let mut one_of_a_hundred = [10; 250];
        one_of_a_hundred[..2].fill(40);
        assert_eq!(above(Some(30), &one_of_a_hundred), None);
        // Three of 302, but they left the window long ago.
        assert_eq!(above(Some(30), &[&[40, 40, 40][..], &[10; 299]].concat()), None);
    }

    #[test]
    fn it_is_slow_until_no_response_is_slow_any_more() {
        let mut seen = seen(Some(30), &[]);
        let mut changes = Vec::new();
        for answer in 0..2_000u32 {
            // One of fifty is slow for a while, then one of two hundred, then none.
            let slow = match answer {
                0..500 => answer % 50 == 0,
                500..1_000 => answer % 200 == 0,
                _ => false,
            };
            let before = seen.is_slow;
            seen.add(if slow { 40 * MS } else { 10 * MS });
            if seen.is_slow != before {
                changes.push((answer, seen.is_slow));
            }
        }
        assert_eq!(changes, [(100, true), (800 + LATEST as u32, false)], "no flutter");
    }
}
