//! How fast a counter counts, by its own history.

use std::collections::VecDeque;

use jiff::Timestamp;

/// It does not count this many times what it usually counts in an hour at once, or in an hour.
pub const UNUSUAL: f64 = 24.0;
/// This many times what it usually counts in an hour is likely after a rollover or a reset.
pub const LIKELY: f64 = 4.0;
/// While no hour is over: it does not count this many times its greatest step at once, or in a minute.
pub const UNHEARD: f64 = 1_000.0;
/// Hours of history that matter: a week.
pub const HOURS: i64 = 168;

/// An hour since 1970, and what was read in it last.
type Hour = (i64, f64);

/// What a counter counted in the hours of a week in which it counted.
#[derive(Debug, Clone, Default)]
pub struct Pace {
    /// The hour under way, what was read in it last, and what was read last in the hour before.
    hour: Option<(i64, f64, Option<Hour>)>,
    counted: VecDeque<(i64, f64)>,
    /// Of `counted`, the middle one.
    usual: Option<f64>,
    greatest: Option<f64>,
}

impl Pace {
    /// A reading, false or not: what is rare does not move the middle.
    pub fn note(&mut self, at: Timestamp, value: f64) {
        let now = at.as_second().div_euclid(3_600);
        match &mut self.hour {
            Some((hour, last, _)) if *hour == now => *last = value,
            Some((hour, last, before)) => {
                let (ended, last) = (*hour, *last);
                if let Some((hour, begun)) = before.filter(|(_, begun)| *begun < last) {
                    self.counted.push_back((ended, (last - begun) / (ended - hour).max(1) as f64));
                }
                self.hour = Some((now, value, Some((ended, last))));
                self.forget(now);
            }
            None => self.hour = Some((now, value, None)),
        }
    }

    /// A plain step.
    pub fn counted(&mut self, step: f64) {
        if 0.0 < step {
            self.greatest = Some(self.greatest.map_or(step, |greatest| greatest.max(step)));
        }
    }

    /// What it counts in the middle one of the hours in which it counts.
    pub fn usual(&self) -> Option<f64> {
        self.usual
    }

    /// Its greatest plain step.
    pub fn greatest(&self) -> Option<f64> {
        self.greatest
    }

    fn forget(&mut self, now: i64) {
        while self.counted.front().is_some_and(|(hour, _)| *hour < now - HOURS) {
            self.counted.pop_front();
        }
        let mut all: Vec<f64> = self.counted.iter().map(|(_, counted)| *counted).collect();
        all.sort_by(f64::total_cmp);
        self.usual = all.get(all.len().saturating_sub(1) / 2).copied();
    }
}
