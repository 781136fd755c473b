//! What is left out on a line with too much to do: idle polls first, then periods of soft polls. Hard polls never.
//!
//! ```text
//!            demand > 1 for 2 s, or a hard poll late three times running
//!   normal ───────────────────────────────────────────────> overload: idle shed, hard first, soft every k-th period
//!          <───────────────────────────────────────────────
//!            demand of the milder state ≤ 0.95 for the hold time (10 s, doubled each time it comes back too soon)
//! ```

use std::time::Duration;

use jiff::Timestamp;

/// The reads that are kept should take at most this share of the line's time.
pub const FITS: f64 = 0.95;
/// Soft polls are read at least each so many periods.
pub const FACTOR_MAX: u32 = 32;
/// A demand above this is overload.
const FULL: f64 = 1.0;
/// A short peak, such as a device that is about to be given up, is ridden out.
const OVER_FOR: Duration = Duration::from_secs(2);
const HOLD: Duration = Duration::from_secs(10);
const HOLD_MAX: Duration = Duration::from_secs(640);

/// Shares of the line's time that polls want at their full rate, by class.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    /// Alarm inputs.
    pub hard: f64,
    /// Process values.
    pub soft: f64,
    /// Identification that is read again and again.
    pub idle: f64,
}

impl Demand {
    fn under(self, load: Load) -> f64 {
        match load {
            Load::Normal => self.hard + self.soft + self.idle,
            Load::Overload { factor } => self.hard + self.soft / f64::from(factor),
        }
    }

    /// The mildest state in which the line is at most so full.
    fn mildest(self, full: f64) -> Load {
        let stretched = (1..=FACTOR_MAX).map(|factor| Load::Overload { factor });
        let worst = Load::Overload { factor: FACTOR_MAX };
        std::iter::once(Load::Normal).chain(stretched).find(|load| self.under(*load) <= full).unwrap_or(worst)
    }
}

/// How a line copes. Ordered: the milder is less.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Load {
    /// Every poll at its period.
    Normal,
    /// Idle polls are shed, hard polls go first, soft ones are read each so many periods.
    Overload {
        /// 1 to [`FACTOR_MAX`].
        factor: u32,
    },
}

impl std::fmt::Display for Load {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Load::Normal => f.write_str("every poll at its period"),
            Load::Overload { factor: 1 } => f.write_str("too much to do: identification is left out"),
            Load::Overload { factor } => {
                write!(f, "too much to do: identification is left out, process values are read every {factor} periods")
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
    /// When it was last made milder.
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

    /// Judges the present demand; `late` when a hard poll cannot keep its period. The state may change.
    pub fn judge(&mut self, demand: Demand, late: bool, now: Timestamp) -> Load {
        let over = FULL < demand.under(self.load);
        self.over_since = over.then(|| self.over_since.unwrap_or(now));
        let persists = self.over_since.is_some_and(|since| OVER_FOR <= span(since, now));
        let worse = if persists { demand.mildest(FITS) } else { Load::Normal };
        let worse = if late { worse.max(Load::Overload { factor: 1 }) } else { worse };
        if self.load < worse {
            let too_soon = self.eased_at.is_some_and(|eased| span(eased, now) <= 2 * self.hold);
            self.hold = if too_soon { (2 * self.hold).min(HOLD_MAX) } else { HOLD };
            (self.load, self.over_since) = (worse, None);
        }
        let milder = demand.mildest(FITS);
        if late || self.load <= milder {
            self.easy_since = None;
        } else if self.hold <= span(*self.easy_since.get_or_insert(now), now) {
            (self.load, self.easy_since, self.eased_at) = (milder, None, Some(now));
        }
        self.load
    }
}

fn span(from: Timestamp, to: Timestamp) -> Duration {
    Duration::try_from(to.duration_since(from)).unwrap_or_default()
}
