//! What gives way on a line with too much to do: background polls are left out, normal polls are stretched. Critical polls never.
//!
//! ```text
//!            demand > 1 for 2 s, or a critical poll late three times running
//!   normal ───────────────────────────────────────────────> overload: background shed, critical first, normal share what is left
//!          <───────────────────────────────────────────────
//!            demand ≤ 0.95 for the hold time (10 s, doubled each time it comes back too soon)
//! ```
//!
//! All normal periods grow by one factor, so that what the critical polls leave is shared alike and nearly all of it is used.

use std::time::Duration;

use crate::plant::time::elapsed;
use jiff::Timestamp;

/// The line is back to normal when the reads take at most this share of its time.
const FITS: f64 = 0.95;
/// Normal polls are stretched at most to this many times their period.
pub const FACTOR_MAX: f64 = 32.0;
/// A demand above this is overload.
const FULL: f64 = 1.0;
/// A short peak is ridden out.
const OVER_FOR: Duration = Duration::from_secs(2);
const HOLD: Duration = Duration::from_secs(10);
const HOLD_MAX: Duration = Duration::from_secs(640);
/// The factor follows the demand in steps of this share …
const FACTOR_STEP: f64 = 0.01;
/// … and is greater by this one: were it too small, the shortest periods alone would be missed.
const FACTOR_SPARE: f64 = 0.02;

/// Shares of the line's time that polls want at their full rate, by class.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    /// Alarm inputs.
    pub critical: f64,
    /// Process values.
    pub normal: f64,
    /// Identification that is read again and again.
    pub background: f64,
}

impl Demand {
    /// Of all polls.
    pub fn total(self) -> f64 {
        self.critical + self.normal + self.background
    }

    /// By what normal periods grow where background polls are left out; 1 is not at all.
    pub fn factor(self) -> f64 {
        let left = FULL - self.critical;
        let normal = self.normal * (1.0 + FACTOR_SPARE);
        if left <= normal / FACTOR_MAX { FACTOR_MAX } else { (normal / left).max(1.0) }
    }
}

/// How a line copes. Ordered: the milder is less.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum Load {
    /// Every poll at its period.
    Normal,
    /// Background polls are shed, critical polls go first, normal ones share what is left.
    Overload {
        /// By what normal periods grow, 1 to [`FACTOR_MAX`].
        factor: f64,
    },
}

impl std::fmt::Display for Load {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Load::Normal => f.write_str("every poll at its period"),
            Load::Overload { factor } if *factor < 1.05 => f.write_str("line overloaded: identification polls skipped"),
            Load::Overload { factor } => {
                write!(f, "line overloaded: identification polls skipped, process values every {factor:.1} periods")
            }
        }
    }
}

/// Moves between the states with hysteresis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overload {
    load: Load,
    over_since: Option<Timestamp>,
    easy_since: Option<Timestamp>,
    hold: Duration,
    /// When it last went back to normal.
    eased_at: Option<Timestamp>,
}

impl Default for Overload {
    fn default() -> Self {
        Overload { load: Load::Normal, over_since: None, easy_since: None, hold: HOLD, eased_at: None }
    }
}

impl Overload {
    /// The present state.
    pub fn load(&self) -> Load {
        self.load
    }

    /// Judges the present demand; `late` when a critical poll cannot keep its period. `true` if the state has changed.
    pub fn evaluate(&mut self, demand: Demand, late: bool, now: Timestamp) -> bool {
        let (before, total) = (self.load, demand.total());
        match self.load {
            Load::Normal => {
                self.over_since = (FULL < total).then(|| self.over_since.unwrap_or(now));
                if late || self.over_since.is_some_and(|since| OVER_FOR <= elapsed(since, now)) {
                    let too_soon = self.eased_at.is_some_and(|eased| elapsed(eased, now) <= 2 * self.hold);
                    self.hold = if too_soon { (2 * self.hold).min(HOLD_MAX) } else { HOLD };
                    self.load = Load::Overload { factor: demand.factor() };
                    self.easy_since = None;
                }
            }
            Load::Overload { factor } => {
                let wanted = demand.factor();
                if FACTOR_STEP < (wanted / factor - 1.0).abs() {
                    self.load = Load::Overload { factor: wanted };
                }
                if late || FITS < total {
                    self.easy_since = None;
                } else if self.hold <= elapsed(*self.easy_since.get_or_insert(now), now) {
                    (self.load, self.over_since, self.eased_at) = (Load::Normal, None, Some(now));
                }
            }
        }
        self.load != before
    }
}
