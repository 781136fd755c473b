//! A restore: the writes of a set's plan, one at a time, until the first that is not verified.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    command::{NotConfirmed, OrderId, Outcome, Refusal},
    def::{DeviceId, PlantDef},
    parameter_set::{Change, ParameterSet},
};

/// What an operator has confirmed: this set, and the changes that it meant when he looked.
#[derive(Debug, Clone, PartialEq)]
pub struct RestoreWish {
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
#[derive(Debug, Clone, PartialEq)]
pub struct Restore {
    /// The order that it carries out.
    pub id: OrderId,
    /// Who wished it.
    pub by: Arc<str>,
    /// Where the values come from.
    pub from: Arc<str>,
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
}

/// One write of a restore.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// What.
    pub change: Change,
    /// The order that writes it; `None` before its turn.
    pub order: Option<OrderId>,
    /// How that ended; `None` before it has.
    pub outcome: Option<Outcome>,
}

/// How a restore stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Writing.
    Running,
    /// Every write was verified.
    Done,
    /// A write was not; those after it were not begun.
    Failed,
    /// An operator has stopped it.
    Stopped,
}

impl Restore {
    /// Begins with the first write.
    pub fn new(id: OrderId, by: Arc<str>, wish: &RestoreWish, at: Timestamp) -> Restore {
        let step = |change: &Change| Step { change: *change, order: None, outcome: None };
        let steps = wish.changes.iter().map(step).collect();
        let (from, device) = (wish.from.clone(), wish.device);
        Restore { id, by, from, device, at, steps, state: State::Running, stopping: false }
    }

    /// Writes that are done.
    pub fn done(&self) -> usize {
        self.steps.iter().filter(|step| step.outcome.as_ref().is_some_and(is_done)).count()
    }

    /// The write under way.
    pub fn current(&self) -> Option<OrderId> {
        self.steps.iter().find(|step| step.order.is_some() && step.outcome.is_none()).and_then(|step| step.order)
    }

    /// The write under way has ended.
    pub fn take(&mut self, outcome: Outcome) {
        let Some(step) = self.steps.iter_mut().find(|step| step.order.is_some() && step.outcome.is_none()) else {
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
        let next = self.steps.iter().position(|step| step.order.is_none());
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
            State::Running => None,
            State::Done => Some(Outcome::Verified),
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
