//! Whether anything is heard on a line. How long its master pauses is learned.

use std::time::Duration;

use jiff::Timestamp;

use crate::plant::{PlantDef, id::LineId, tag::Poll, time::elapsed};

/// No line is without traffic before this time.
const SILENT_MIN: Duration = Duration::from_secs(10);
/// A master that pauses for longer is not followed.
const PAUSE_MAX: Duration = Duration::from_secs(60);
/// A line is silent after this many pauses, and after this many without one the pauses are forgotten.
const PAUSES: u32 = 3;

/// A line on which no frame is heard for so long has no traffic, as long as nothing else is learned: three of the shortest poll
/// periods of its profiles, and not less than ten seconds.
pub fn silent_after(def: &PlantDef, line: LineId) -> Duration {
    let devices = def.devices.iter().filter(|device| device.line == line);
    let periods = devices.flat_map(|device| def.tags_of(device.id)).filter_map(|tag| match tag.poll {
        Poll::Every(period) if tag.calculation.is_none() => Some(period),
        Poll::Every(_) | Poll::Once | Poll::Never => None,
    });
    (periods.min().unwrap_or_default() * PAUSES).max(SILENT_MIN)
}

/// The traffic of a line.
#[derive(Debug)]
pub struct Traffic {
    silent_after: Duration,
    heard_at: Timestamp,
    /// The last two long pauses, and when the last one ended: one alone may be an outage.
    pauses: [Duration; 2],
    paused_at: Timestamp,
    silent: bool,
}

impl Traffic {
    /// A line of which nothing has been heard since `now`.
    pub fn new(silent_after: Duration, now: Timestamp) -> Traffic {
        Traffic { silent_after, heard_at: now, pauses: [Duration::ZERO; 2], paused_at: now, silent: false }
    }

    /// A frame was heard. `true` if there was no traffic before.
    pub fn hear(&mut self, now: Timestamp) -> bool {
        let pause = elapsed(self.heard_at, now);
        if self.silent_after <= pause * PAUSES {
            self.pauses = [pause, self.pauses[0]];
            self.paused_at = now;
        } else if self.pauses[0] * PAUSES < elapsed(self.paused_at, now) {
            self.pauses = [Duration::ZERO; 2];
        }
        self.heard_at = now;
        std::mem::take(&mut self.silent)
    }

    /// `true` if there is no traffic any more, once.
    pub fn falls_silent(&mut self, now: Timestamp) -> bool {
        let pause = self.pauses[0].min(self.pauses[1]).min(PAUSE_MAX);
        let silent = self.silent_after.max(pause * PAUSES) <= elapsed(self.heard_at, now);
        silent && !std::mem::replace(&mut self.silent, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames at these seconds; the seconds at which the line falls silent up to a minute after the last.
    fn check(frames: &[i64], expect: &[i64]) {
        let at = |second| Timestamp::from_second(second).expect("a small number");
        let mut traffic = Traffic::new(SILENT_MIN, at(0));
        let mut silent = Vec::new();
        for second in 0..frames.last().copied().unwrap_or_default() + 200 {
            if frames.contains(&second) {
                traffic.hear(at(second));
            }
            silent.extend(traffic.falls_silent(at(second)).then_some(second));
        }
        assert_eq!(silent, expect, "{frames:?}");
    }

    #[test]
    fn a_line_is_silent_after_ten_seconds_or_three_pauses() {
        let every = |seconds: i64, until: i64| (0..=until / seconds).map(|n| n * seconds).collect::<Vec<_>>();
        check(&[], &[10]);
        check(&every(1, 60), &[70]);
        // A master that reads every 20 s is silent twice, until that is known.
        check(&every(20, 100), &[10, 30, 160]);
        // An outage is no pause of the master, and one that polls faster from then on is followed.
        let outage: Vec<i64> = every(1, 10).into_iter().chain((100..160).step_by(1)).collect();
        check(&outage, &[20, 169]);
        let faster: Vec<i64> = every(20, 100).into_iter().chain(101..200).collect();
        check(&faster, &[10, 30, 209]);
    }
}
