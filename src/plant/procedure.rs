//! Procedures: steps of the plant file that the station carries out on request, one procedure at a time.
//!
//! ```text
//!            ┌ write ────── verified ─┐
//!  start ──> │ wait until ─ true ─────┤──> next step … ──> done
//!            │ hold ─────── over ─────┤
//!            └ measurement ───────────┘
//!                 │ refused, not verified, time limit over, or an operator aborts
//!                 └──> safe state: each of its writes, whatever becomes of the others ──> failed or aborted
//!                        └ not verified ──> again once its device answers, until it is, or a person writes or starts
//! ```
//!
//! A station that is stopped aborts its procedure first. One that is killed goes on with nothing but a safe state that was to
//! be written: its successor shows the procedure as interrupted.

mod run;

use std::{fmt, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::procedure_def::{ProcedureDef, ProcedureStep};
use super::{
    command::{CommandId, CommandKind, NotConfirmed, Outcome},
    def::PlantDef,
    exact::digits,
    id::{DeviceId, ProcedureId, TagId},
    record::ActionRecord,
    recorded_action::RecordedAction,
};
use crate::t;

pub(super) use run::{Instruction, View};

/// Is it the record of a start, of what is written before an end, or of an end? The last of them says what a station that was
/// killed has left. A refused start is none.
pub fn is_transition(record: &ActionRecord) -> bool {
    match record.known_action() {
        Some(RecordedAction::StartProcedure) => {
            let done = CommandKind::StartProcedure(ProcedureId(0)).label();
            // So it was called before.
            *record.outcome == *done || *record.outcome == *Outcome::Verified.label()
        }
        Some(RecordedAction::WriteSafeState | RecordedAction::EndProcedure) => true,
        _ => false,
    }
}

/// In the outcome of that, before the writes that are missing.
fn not_safe() -> &'static str {
    t!("safe state NOT complete")
}
/// How the outcome of that begins where the station stopped meanwhile.
pub const INTERRUPTED: &str = "interrupted";

/// A procedure at work, or as it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProcedureRun {
    /// Who started it.
    pub by: Arc<str>,
    /// The place of that user, or of the one who has aborted it.
    pub from: Arc<str>,
    /// When.
    pub started: Timestamp,
    /// The place of the step at work, or of the last one; `None` where a station before this one has carried it out.
    pub step: Option<usize>,
    /// Since when it has been in this step, or in this state.
    pub since: Timestamp,
    /// How it stands.
    pub state: ProcedureState,
    /// The safe state; empty until it is written.
    pub safe: Vec<SafeWrite>,
    /// The step at work has begun.
    begun: bool,
    /// The write of the step at work.
    write: Option<CommandId>,
    /// Measurements that have begun and not ended.
    measuring: Vec<DeviceId>,
}

/// How a procedure stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ProcedureState {
    /// A step is at work.
    Running,
    /// The safe state is being written; then it ends so.
    WritingSafeState(ProcedureEnd),
    /// It has ended.
    Ended(ProcedureEnd),
}

/// How a procedure ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ProcedureEnd {
    /// After its last step.
    Done,
    /// At a step.
    Failed(StepFailure),
    /// By this operator.
    Aborted(Arc<str>),
    /// The station ended before its safe state was written.
    Interrupted,
}

/// Why a step failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum StepFailure {
    /// The write was refused, or not verified.
    #[error("{0}")]
    Write(Outcome),
    /// The write has no outcome any more.
    #[error("{}", t!("the outcome of the write is unknown"))]
    Forgotten,
    /// The condition was not true in time.
    #[error("{}", t!("not true within the time limit"))]
    TimeLimit,
    /// There is no control run that the measurement could have.
    #[error("{}", t!("no control run was recorded"))]
    NotMeasured,
}

/// One write of the safe state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SafeWrite {
    /// What.
    pub tag: TagId,
    /// The value.
    pub value: f64,
    /// The command that writes it; `None` before its turn.
    command: Option<CommandId>,
    /// Its outcome; `None` before its end.
    pub outcome: Option<Outcome>,
    /// How often it was sent in vain; like the two below for the station only.
    #[serde(skip)]
    tries: u32,
    /// When it was sent in vain last.
    #[serde(skip)]
    tried: Timestamp,
    /// A person has decided otherwise: it is not sent again.
    #[serde(skip)]
    is_left: bool,
}

impl SafeWrite {
    fn new((tag, value): (TagId, f64), outcome: Option<Outcome>) -> SafeWrite {
        SafeWrite { tag, value, command: None, outcome, tries: 0, tried: Timestamp::UNIX_EPOCH, is_left: false }
    }

    /// Is it still to be reached?
    fn is_missing(&self) -> bool {
        !self.is_left && !self.outcome.as_ref().is_some_and(Outcome::is_done)
    }

    /// `PLC-1.RUN = STOP`.
    fn words(&self, def: &PlantDef) -> String {
        let tag = def.tag(self.tag);
        let value = tag.label_of(self.value).map_or_else(|| digits(self.value, None), str::to_owned);
        format!("{} = {value}", tag.name)
    }
}

impl ProcedureRun {
    /// Is it still carrying out steps, or writing the safe state?
    pub fn at_work(&self) -> bool {
        match self.state {
            ProcedureState::Running | ProcedureState::WritingSafeState(_) => true,
            ProcedureState::Ended(_) => false,
        }
    }

    /// How it ended, or will once the safe state is written.
    pub fn end(&self) -> Option<&ProcedureEnd> {
        match &self.state {
            ProcedureState::Running => None,
            ProcedureState::WritingSafeState(end) | ProcedureState::Ended(end) => Some(end),
        }
    }

    /// Was every write of the safe state verified? `None` while none is to be written, or not all have ended.
    pub fn is_safe(&self) -> Option<bool> {
        if self.safe.is_empty() || self.safe.iter().any(|write| write.outcome.is_none()) {
            return None;
        }
        Some(self.safe.iter().all(|write| write.outcome.as_ref().is_some_and(Outcome::is_done)))
    }

    /// Who is responsible for what it does now: who has aborted it, else who has started it.
    pub(super) fn actor(&self) -> &Arc<str> {
        match self.end() {
            Some(ProcedureEnd::Aborted(by)) => by,
            Some(ProcedureEnd::Done | ProcedureEnd::Failed(_) | ProcedureEnd::Interrupted) | None => &self.by,
        }
    }

    /// Did it end as it should not have? An abort that reached the safe state is no fault.
    pub fn is_fault(&self) -> bool {
        match self.end() {
            None | Some(ProcedureEnd::Done) => false,
            Some(ProcedureEnd::Failed(_) | ProcedureEnd::Interrupted) => true,
            Some(ProcedureEnd::Aborted(_)) => self.is_safe() == Some(false),
        }
    }

    /// The writes of the safe state that are still to be reached, once it has ended.
    pub(super) fn missing(&self) -> impl Iterator<Item = &SafeWrite> {
        self.safe.iter().filter(|write| !self.at_work() && write.is_missing())
    }

    pub(super) fn times(&mut self) -> impl Iterator<Item = &mut Timestamp> {
        let tried = self.safe.iter_mut().map(|write| &mut write.tried);
        [&mut self.started, &mut self.since].into_iter().chain(tried)
    }

    /// The outcome on record: `failed at step 3 of 9: …; safe state written`.
    pub(super) fn recorded(&self, def: &PlantDef, steps: usize) -> String {
        let end = self.end().map_or(String::new(), ToString::to_string);
        let place = match (self.end(), self.step) {
            (Some(ProcedureEnd::Done) | None, _) | (_, None) => String::new(),
            (Some(_), Some(step)) => format!(", {}", t!("step {step} of {steps}", step = (step + 1).min(steps), steps)),
        };
        format!("{end}{place}{}", self.safe_state(def))
    }

    /// `; safe state written`. What is missing has its name and value.
    pub(super) fn safe_state(&self, def: &PlantDef) -> String {
        let missing: Vec<String> =
            self.safe.iter().filter(|write| write.is_missing()).map(|write| write.words(def)).collect();
        match self.is_safe() {
            Some(true) => format!("; {}", t!("safe state written")),
            None | Some(false) if !missing.is_empty() => format!("; {}: {}", not_safe(), missing.join(", ")),
            None => String::new(),
            Some(false) => format!("; {}, {}", not_safe(), t!("left as it is by an operator")),
        }
    }
}

/// `failed: not true within the time limit`.
impl fmt::Display for ProcedureEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ProcedureEnd::Done => f.write_str(t!("done")),
            ProcedureEnd::Failed(why) => f.write_str(&t!("failed: {why}", why)),
            ProcedureEnd::Aborted(by) => f.write_str(&t!("aborted by {by}", by)),
            ProcedureEnd::Interrupted => f.write_str(t!("interrupted")),
        }
    }
}
