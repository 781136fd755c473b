//! How many activations the last ten minutes and the last hour had, to the second, and whether that is a flood.

use crate::plant::number::to_usize;

/// The hour that is remembered, seconds.
const HOUR_S: usize = 3_600;
/// The window of a flood, seconds.
const WINDOW_S: i64 = 600;
/// A flood begins with more activations in the window than this (ISA-18.2) …
const FLOOD_ABOVE: u32 = 10;
/// … and ends with fewer than this.
const FLOOD_BELOW: u32 = 5;

/// Counts of each second of the last hour, as a ring.
#[derive(Debug, Clone)]
pub struct Rate {
    pub now: i64,
    counts: Box<[u32; HOUR_S]>,
    pub in_window: u32,
    pub in_hour: u32,
    /// The second in which the flood began.
    flood: Option<i64>,
}

impl Rate {
    /// Nothing yet; the running second is `start`.
    pub fn new(start: i64) -> Rate {
        Rate { now: start, counts: Box::new([0; HOUR_S]), in_window: 0, in_hour: 0, flood: None }
    }

    /// The second in which the flood began that is under way.
    pub fn flood_since(&self) -> Option<i64> {
        self.flood.or_else(|| (FLOOD_ABOVE < self.in_window).then_some(self.now))
    }

    /// An activation in the running second.
    pub fn raised(&mut self) {
        let count = &mut self.counts[place(self.now)];
        *count = count.saturating_add(1);
        self.in_window = self.in_window.saturating_add(1);
        self.in_hour = self.in_hour.saturating_add(1);
    }

    /// Advances to a later second; returns the spans (from, until) of the seconds left that were flooded. A clock that
    /// went back changes nothing until it is where it was.
    pub fn advance(&mut self, to: i64) -> Vec<(i64, i64)> {
        let mut flooded: Vec<(i64, i64)> = Vec::new();
        while self.now < to {
            // A second is evaluated when it is over: only then is it known how many came in it.
            self.flood = match self.flood {
                Some(_) if self.in_window < FLOOD_BELOW => None,
                None if FLOOD_ABOVE < self.in_window => Some(self.now),
                same => same,
            };
            if self.flood.is_some() {
                match flooded.last_mut() {
                    Some((_, until)) if *until == self.now => *until += 1,
                    Some(_) | None => flooded.push((self.now, self.now + 1)),
                }
            }
            // Nothing to forget and nothing under way: the rest of the time passes at once.
            if self.in_hour == 0 {
                self.now = to;
                break;
            }
            self.now += 1;
            self.in_window -= self.counts[place(self.now - WINDOW_S)];
            self.in_hour -= std::mem::take(&mut self.counts[place(self.now)]);
        }
        flooded
    }
}

fn place(second: i64) -> usize {
    to_usize(second.rem_euclid(HOUR_S as i64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Raises one alarm at each of the seconds, then returns the flooded spans until `end`.
    fn floods(seconds: impl IntoIterator<Item = i64>, end: i64) -> Vec<(i64, i64)> {
        let mut rate = Rate::new(0);
        let mut all = Vec::new();
        for second in seconds {
            all.extend(rate.advance(second));
            rate.raised();
        }
        all.extend(rate.advance(end));
        all.dedup();
        all
    }

    fn seconds_of(spans: &[(i64, i64)]) -> i64 {
        spans.iter().map(|(from, until)| until - from).sum()
    }

    #[test]
    fn a_flood_begins_above_ten_alarms_and_ends_below_five() {
        assert_eq!(floods(0..10, 5_000), [], "ten in ten minutes are no flood yet");
        let flood = floods(0..11, 5_000);
        // The eleventh comes in second 10; in second 606 those of 7 to 10 are left.
        assert_eq!((flood[0].0, seconds_of(&flood)), (10, 606 - 10));
        // Between five and ten it goes on: one more each two minutes keeps five or six in the window.
        let kept = floods((0..11).chain((1..20).map(|i| i * 120)), 5_000);
        assert_eq!(seconds_of(&kept), 19 * 120 + 120 - 10);
    }

    #[test]
    fn the_counts_forget_to_the_second_and_leave_nothing_behind() {
        let mut rate = Rate::new(0);
        for second in [0, 0, 599, 600] {
            rate.advance(second);
            rate.raised();
        }
        assert_eq!((rate.in_window, rate.in_hour), (2, 4), "those of second 0 are 600 s old");
        rate.advance(3_600);
        assert_eq!((rate.in_window, rate.in_hour), (0, 2));
        rate.advance(1_000);
        assert_eq!(rate.now, 3_600, "a clock that went back waits");
        rate.advance(i64::MAX / 2);
        assert_eq!((rate.in_window, rate.in_hour, rate.flood_since()), (0, 0, None));
    }

    #[test]
    fn the_flag_shows_in_the_very_second() {
        let mut rate = Rate::new(0);
        (0..10).for_each(|_| rate.raised());
        assert_eq!(rate.flood_since(), None);
        rate.raised();
        assert_eq!(rate.flood_since(), Some(0));
    }
}
