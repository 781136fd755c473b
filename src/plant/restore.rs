//! A restore: the device is read, then the writes of a set's plan go out one at a time, until the first that is not
//! verified.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::parameter_set::RestoreRequest;
use super::{
    command::{CommandId, NotConfirmed, Outcome, Refusal},
    def::{DeviceId, PlantDef, TagId},
    parameter_set::{ParameterSet, PlannedChange},
    sample::Sample,
    tag::{Poll, TagDef},
};

/// The device must be read within this (real) time, else nothing is written.
pub const READ_MAX: Duration = Duration::from_secs(60);

/// A restore with its progress.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Restore {
    /// The command behind it.
    pub id: CommandId,
    /// Who requested it.
    pub by: Arc<str>,
    /// Where the values come from.
    pub from: Arc<str>,
    /// The set.
    pub set: Arc<ParameterSet>,
    /// The device that is written.
    pub device: DeviceId,
    /// When it began.
    pub at: Timestamp,
    /// Its writes, in order.
    pub steps: Vec<Step>,
    /// Its state.
    pub state: State,
    /// An operator stopped it; it ends after the write under way.
    pub stopping: bool,
    /// The settings of the line changed meanwhile: another device may answer now.
    pub line_changed: bool,
    /// Why it ended before its first write.
    pub refused: Option<Refusal>,
}

/// One write of a restore.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// What.
    pub change: PlannedChange,
    /// The command that writes it; `None` before its turn.
    pub command: Option<CommandId>,
    /// The outcome of the write; `None` before its end.
    pub outcome: Option<Outcome>,
}

/// State of a restore.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Reading the device first.
    Reading,
    /// Writing.
    Running,
    /// Every write was verified.
    Done,
    /// A write was not verified, or none was begun.
    Failed,
    /// Stopped by an operator.
    Stopped,
}

impl Restore {
    /// A restore that reads its device.
    pub fn new(id: CommandId, by: Arc<str>, request: &RestoreRequest, at: Timestamp) -> Restore {
        let step = |change: &PlannedChange| Step { change: *change, command: None, outcome: None };
        let steps = request.changes.iter().map(step).collect();
        Restore {
            id,
            by,
            from: request.from.clone(),
            set: request.set.clone(),
            device: request.device,
            at,
            steps,
            state: State::Reading,
            stopping: false,
            line_changed: false,
            refused: None,
        }
    }

    /// Is it still reading or writing?
    pub fn at_work(&self) -> bool {
        matches!(self.state, State::Reading | State::Running)
    }

    /// Have all tags of the set, and those it rests on, been read since the restore began?
    pub fn is_read(&self, def: &PlantDef, sample: impl Fn(TagId) -> Sample) -> bool {
        let named = |short: &str| self.set.values.iter().chain(&self.set.given).any(|held| held.tag == short);
        let fresh = |tag: TagId| {
            let sample = sample(tag);
            sample.quality.is_good() && self.at <= sample.at
        };
        // A tag without polling is known from its last write or not at all.
        let asked = |tag: &&TagDef| named(&tag.short) && tag.poll != Poll::Never;
        def.tags_of(self.device).filter(asked).all(|tag| fresh(tag.id))
    }

    /// Begins the writes.
    pub fn begin(&mut self) {
        self.state = State::Running;
    }

    /// Ends it before its first write.
    pub fn give_up(&mut self, why: Refusal) {
        (self.state, self.refused) = (State::Failed, Some(why));
    }

    /// Number of writes that are done.
    pub fn done(&self) -> usize {
        self.steps.iter().filter(|step| step.outcome.as_ref().is_some_and(Outcome::is_done)).count()
    }

    /// The write under way.
    pub fn current(&self) -> Option<CommandId> {
        self.steps.iter().find(|step| step.command.is_some() && step.outcome.is_none()).and_then(|step| step.command)
    }

    /// Ends the write under way.
    pub fn end_write(&mut self, outcome: Outcome) {
        let Some(step) = self.steps.iter_mut().find(|step| step.command.is_some() && step.outcome.is_none()) else {
            return;
        };
        if !outcome.is_done() {
            self.state = State::Failed;
        }
        step.outcome = Some(outcome);
    }

    /// The next write, if none is under way; ends the restore if there is none or it was stopped.
    pub fn begin_next(&mut self) -> Option<&mut Step> {
        if self.state != State::Running || self.current().is_some() {
            return None;
        }
        let next = self.steps.iter().position(|step| step.command.is_none());
        match next {
            None => self.state = State::Done,
            Some(_) if self.stopping => self.state = State::Stopped,
            Some(_) => {}
        }
        next.filter(|_| self.state == State::Running).map(|next| &mut self.steps[next])
    }

    /// The outcome of the restore, once it has ended.
    pub fn outcome(&self, def: &PlantDef) -> Option<Outcome> {
        let (done, all) = (self.done(), self.steps.len());
        let failed = self.steps.iter().find(|step| step.outcome.as_ref().is_some_and(|outcome| !outcome.is_done()));
        match self.state {
            State::Reading | State::Running => None,
            State::Done => Some(Outcome::Verified),
            State::Failed if self.refused.is_some() => self.refused.clone().map(Outcome::Refused),
            // Nothing of it has reached the device.
            State::Failed if done == 0 && matches!(self.steps[0].outcome, Some(Outcome::Refused(_))) => {
                self.steps[0].outcome.clone()
            }
            State::Failed => {
                let failed = failed.map(|step| def.tag(step.change.tag).short.clone()).unwrap_or_default();
                Some(Outcome::NotConfirmed(NotConfirmed::PartlyWritten { done, all, failed: Some(failed) }))
            }
            State::Stopped if done == 0 => Some(Outcome::Refused(Refusal::Stopped)),
            State::Stopped => Some(Outcome::NotConfirmed(NotConfirmed::PartlyWritten { done, all, failed: None })),
        }
    }
}
