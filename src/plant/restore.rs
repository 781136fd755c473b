//! A restore: the device is read, then the writes of a set's plan go out one at a time, until the first that is not
//! verified.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    command::{CommandId, NotConfirmed, Outcome, Refusal},
    def::{DeviceId, PlantDef, TagId},
    parameter_set::{Change, ParameterSet},
    sample::Sample,
    tag::{Poll, TagDef},
};

/// The device must have been read anew after this time, else nothing is written: real time, as the bus works in it.
pub const READ_MAX: Duration = Duration::from_secs(60);

/// What an operator has confirmed: this set, and the changes that it meant when he looked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestoreRequest {
    /// The device that is written.
    pub device: DeviceId,
    /// Where the values come from, in words: `winter`, `copy of TIC-2`.
    pub from: Arc<str>,
    /// The values.
    pub set: Arc<ParameterSet>,
    /// The changes that were confirmed, in their order. Should the device need others by now, nothing is written.
    pub changes: Vec<Change>,
}

/// A restore as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Restore {
    /// The command that it carries out.
    pub id: CommandId,
    /// Who requested it.
    pub by: Arc<str>,
    /// Where the values come from.
    pub from: Arc<str>,
    /// The very set that is written.
    pub set: Arc<ParameterSet>,
    /// The device that is written.
    pub device: DeviceId,
    /// When it was begun.
    pub at: Timestamp,
    /// Its writes, in order.
    pub steps: Vec<Step>,
    /// Running, or how it ended.
    pub state: State,
    /// An operator wants it to stop after the write under way.
    pub stopping: bool,
    /// The settings of the device's line were changed meanwhile: who answers now may be another device.
    pub line_changed: bool,
    /// Why it was given up before its first write.
    pub refused: Option<Refusal>,
}

/// One write of a restore.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// What.
    pub change: Change,
    /// The command that writes it; `None` before its turn.
    pub command: Option<CommandId>,
    /// How that ended; `None` before it has.
    pub outcome: Option<Outcome>,
}

/// How a restore stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// The device is read first: nobody knows how old what is on the image is.
    Reading,
    /// Writing.
    Running,
    /// Every write was verified.
    Done,
    /// A write was not, or none was begun; those after it were not begun.
    Failed,
    /// An operator has stopped it.
    Stopped,
}

impl Restore {
    /// Begins with reading the device.
    pub fn new(id: CommandId, by: Arc<str>, request: &RestoreRequest, at: Timestamp) -> Restore {
        let step = |change: &Change| Step { change: *change, command: None, outcome: None };
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

    /// Has it not ended yet?
    pub fn at_work(&self) -> bool {
        matches!(self.state, State::Reading | State::Running)
    }

    /// Has every tag of the set been read since it was requested, and what the set rests on too?
    pub fn is_read(&self, def: &PlantDef, sample: impl Fn(TagId) -> Sample) -> bool {
        let named = |short: &str| self.set.values.iter().chain(&self.set.given).any(|held| held.tag == short);
        let fresh = |tag: TagId| {
            let sample = sample(tag);
            sample.quality.is_good() && self.at <= sample.at
        };
        // What is never read by itself is known from its last write or not at all.
        let asked = |tag: &&TagDef| named(&tag.short) && tag.poll != Poll::Never;
        def.tags_of(self.device).filter(asked).all(|tag| fresh(tag.id))
    }

    /// What was confirmed is what is needed now: the writes may begin.
    pub fn begin(&mut self) {
        self.state = State::Running;
    }

    /// Gives it up before its first write.
    pub fn give_up(&mut self, why: Refusal) {
        (self.state, self.refused) = (State::Failed, Some(why));
    }

    /// Writes that are done.
    pub fn done(&self) -> usize {
        self.steps.iter().filter(|step| step.outcome.as_ref().is_some_and(is_done)).count()
    }

    /// The write under way.
    pub fn current(&self) -> Option<CommandId> {
        self.steps.iter().find(|step| step.command.is_some() && step.outcome.is_none()).and_then(|step| step.command)
    }

    /// The write under way has ended.
    pub fn take(&mut self, outcome: Outcome) {
        let Some(step) = self.steps.iter_mut().find(|step| step.command.is_some() && step.outcome.is_none()) else {
            return;
        };
        if !is_done(&outcome) {
            self.state = State::Failed;
        }
        step.outcome = Some(outcome);
    }

    /// The write whose turn it is, if nothing is under way; ends the restore if there is none or nobody wants more.
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

    /// The outcome of the whole, once it has ended.
    pub fn outcome(&self, def: &PlantDef) -> Option<Outcome> {
        let (done, all) = (self.done(), self.steps.len());
        let failed = self.steps.iter().find(|step| step.outcome.as_ref().is_some_and(|outcome| !is_done(outcome)));
        match self.state {
            State::Reading | State::Running => None,
            State::Done => Some(Outcome::Verified),
            State::Failed if self.refused.is_some() => self.refused.clone().map(Outcome::Refused),
            // Nothing of it has reached the device.
            State::Failed if done == 0 && matches!(self.steps[0].outcome, Some(Outcome::Refused(_))) => {
                self.steps[0].outcome.clone()
            }
            State::Failed => {
                let at = failed.map_or("", |step| &def.tag(step.change.tag).short);
                Some(Outcome::NotConfirmed(NotConfirmed::Partly(format!("{done} of {all} written, then {at} failed"))))
            }
            State::Stopped if done == 0 => Some(Outcome::Refused(Refusal::Stopped)),
            State::Stopped => {
                Some(Outcome::NotConfirmed(NotConfirmed::Partly(format!("{done} of {all} written, then stopped"))))
            }
        }
    }
}

/// The device holds the value.
fn is_done(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Verified | Outcome::Unchanged)
}
