//! Control runs: what a control loop did after each change of its setpoint, program step or start of a batch, as it happens.
//!
//! ```text
//!          overshoot ─ ─╭╮
//!   SV  ┌───────┬──────╯─╰──╮╭──────  ± band
//!   90 %│· · · ·│· ╭╯       ╰╯
//!   10 %│· · ╭──┼─╯  first at SV      steady from: in the band ever since, for five minutes at least
//!   ────┘────╯                        PV at the begin
//!      begin  ├rise┤
//! ```
//!
//! Only good values count. What happened in a gap of more than ten seconds is unknown; overshoot, IAE and energy are then lower
//! bounds.

mod figures;
#[cfg(test)]
mod tests;
mod tracker;

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::run_def::RunDef;
use super::{keyword::keyword_enum, time::elapsed};

pub use tracker::RunTracker;
pub(super) use tracker::View;

/// A run that the next one follows sooner is not kept: the setpoint was still being set.
pub const LEAST: Duration = Duration::from_secs(10);
/// A run that goes on is stored at most so often, and at least so often.
pub const STORED: (Duration, Duration) = (Duration::from_secs(60), Duration::from_secs(300));
/// How long PV stays in the band before it is called steady, unless the plant file says otherwise.
pub const STEADY_FOR: Duration = Duration::from_secs(300);
/// A run ends after this time, unless the plant file says otherwise.
pub const DURATION_MAX: Duration = Duration::from_secs(4 * 3_600);
/// SV and PV may be without a good value for so long: what happens meanwhile still has its time, known to that.
pub const GAP_MAX: Duration = Duration::from_secs(10);
/// This share of good time is all of it.
pub const WHOLE: f64 = 0.9995;
/// The default band: this share of the way from PV to SV, and of the range of PV at least.
const BAND: (f64, f64) = (0.02, 0.005);

keyword_enum! {
    /// What began a run. The words are what the history and CSV hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum RunCause: "cause of a run" {
        /// The setpoint was changed.
        Setpoint => "setpoint",
        /// A step of the ramp/soak program.
        Program => "program step",
        /// The start of a batch.
        Batch => "batch",
        /// A procedure that measures.
        Procedure => "procedure",
    }
}

keyword_enum! {
    /// How a run stands. The words are what the history and CSV hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum RunState: "state of a run" {
        /// It goes on.
        Running => "running",
        /// The next one began, or its time was over.
        Ended => "ended",
        /// The station stopped, or the procedure that measured it: its figures are as they were last stored.
        Interrupted => "interrupted",
    }
}

/// A figure that is a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Figure {
    /// It has not come to that.
    #[default]
    NotYet,
    /// Seen.
    After(Duration),
    /// It happened while no good value was there.
    Unknown,
}

#[cfg(test)]
impl Figure {
    /// The time, if it is known.
    pub fn known(self) -> Option<Duration> {
        match self {
            Figure::After(time) => Some(time),
            Figure::NotYet | Figure::Unknown => None,
        }
    }
}

/// A run and its figures so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ControlRun {
    /// Name of the controller.
    pub controller: Arc<str>,
    /// From 1 for each controller of a history.
    pub number: u32,
    /// Its place among the records of this run, from 0; the last one holds.
    pub place: u32,
    /// How it stands.
    pub state: RunState,
    /// What began it.
    pub cause: RunCause,
    /// `step 2`, `hot-water-17`, the name of the procedure; empty for a setpoint.
    pub detail: Arc<str>,
    /// Its begin was seen: else it began earlier.
    pub seen: bool,
    /// Begin.
    pub from: Timestamp,
    /// Until when these figures are.
    pub until: Timestamp,
    /// The setpoint before; `None` where it was not known.
    pub sv_before: Option<f64>,
    /// The setpoint.
    pub sv: f64,
    /// PV at the begin, or the first one known.
    pub pv: Option<f64>,
    /// Unit of these.
    pub unit: Arc<str>,
    /// Decimals of PV.
    pub decimals: u8,
    /// PV so near to SV is at SV.
    pub band: f64,
    /// Control parameters at the begin: `P 5.0, I 240, D 60, PID`; those not known are missing.
    pub settings: Arc<str>,
    /// They were changed meanwhile.
    pub settings_changed: bool,
    /// When PV was first at SV or beyond it, after the begin.
    pub at_sv: Figure,
    /// From when PV has stayed at SV.
    pub steady: Figure,
    /// From 10 % to 90 % of the way from PV to SV.
    pub rise: Figure,
    /// The most that PV was beyond SV, seen from where it came; `None` without any good value.
    pub overshoot: Option<f64>,
    /// SV less PV at the end; `None` while PV is not known.
    pub offset: Option<f64>,
    /// Integral of the absolute error, in unit minutes.
    pub iae: f64,
    /// Energy in kWh, and the share of the time in which it was known, 0–1; `None` without such a tag or any good value.
    pub energy: Option<(f64, f64)>,
    /// Share of the time in which SV and PV were good, 0–1.
    pub good: f64,
}

impl ControlRun {
    /// Controller and number as one word: `TIC-1-17`.
    pub fn label(&self) -> String {
        format!("{}-{}", self.controller, self.number)
    }
    /// How long it has lasted.
    pub fn lasted(&self) -> Duration {
        elapsed(self.from, self.until)
    }
    /// A part of its time had no good value: sums and extremes are at least so much.
    pub fn is_partial(&self) -> bool {
        self.good < WHOLE
    }
    /// As it stands once it is known that the station which followed it has ended; `None` if it had ended before.
    pub fn interrupted(&self) -> Option<ControlRun> {
        let interrupted = || ControlRun { state: RunState::Interrupted, place: self.place + 1, ..self.clone() };
        self.is_running().then(interrupted)
    }

    /// It goes on.
    pub fn is_running(&self) -> bool {
        self.state == RunState::Running
    }
}
