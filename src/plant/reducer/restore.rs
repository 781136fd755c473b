//! Parameter sets of devices: captured, stored, and restored one verified write at a time.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use jiff::Timestamp;

use super::{Effects, Plant};
use crate::plant::{
    command::{BusRequest, Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal},
    commands::WriteOrigin,
    def::{DeviceId, LineId, TagId},
    exact::Exact,
    parameter_set::{self, StoredSet},
    process_image::ProcessImage,
    record::Record,
    restore::{READ_MAX, Restore, RestoreRequest, State, Step},
    time::elapsed,
};

/// The terminal number of the writes of restores and procedures; terminals count from 1.
pub(super) const PLANT: u32 = 0;

/// Work with the folder of parameter sets. The station reads the folder after each.
#[derive(Debug, Clone, PartialEq)]
pub enum SetWork {
    /// Read the folder only.
    Read,
    /// Write a set; answered by [`Plant::on_set_written`].
    Write {
        /// The command that asked for it.
        command: CommandId,
        /// The set to write.
        set: Box<parameter_set::ParameterSet>,
        /// Replace a set of the same name.
        replace: bool,
    },
}

impl Plant {
    /// Accepts a command about parameter sets. `None`: it is pending.
    pub(super) fn set_command(&mut self, status: &CommandStatus, effects: &mut Effects) -> Option<Outcome> {
        match &status.command.kind {
            CommandKind::ReadSets => {
                effects.sets = Some(SetWork::Read);
                Some(Outcome::Verified)
            }
            CommandKind::SaveSet { device, name, replace } => {
                let trusted = trusted(&self.image);
                let set = parameter_set::capture(&self.def, *device, name, status.by.clone(), status.at, &trusted);
                if let Err(why) = parameter_set::check_name(name) {
                    return Some(Outcome::Refused(Refusal::NotSaved(why)));
                }
                if set.values.is_empty() {
                    return Some(Outcome::Refused(Refusal::NothingToSave));
                }
                effects.sets =
                    Some(SetWork::Write { command: status.command.id, set: Box::new(set), replace: *replace });
                None
            }
            CommandKind::Restore(request) => self.begin_restore(status, request, effects),
            CommandKind::StopRestore(device) => {
                let mut running = self.restores.iter_mut().filter(|run| run.device == *device && run.at_work());
                let Some(run) = running.next() else { return Some(Outcome::Unchanged) };
                Arc::make_mut(run).stopping = true;
                Some(Outcome::Verified)
            }
            CommandKind::Write { .. }
            | CommandKind::WriteText { .. }
            | CommandKind::Alarm(_)
            | CommandKind::Refresh(_)
            | CommandKind::Connect(..)
            | CommandKind::Configure(_)
            | CommandKind::SaveSettings(_)
            | CommandKind::Test(..)
            | CommandKind::StopTest(_)
            | CommandKind::StartProcedure(_)
            | CommandKind::AbortProcedure(_)
            | CommandKind::CorrectCounter { .. }
            | CommandKind::HandOver
            | CommandKind::TakeOver => None,
        }
    }

    /// The folder of parameter sets was read.
    pub fn on_sets(&mut self, sets: Vec<StoredSet>) {
        self.sets = Arc::new(sets);
    }

    /// A set was written into the folder, or `Err` says why not.
    pub fn on_set_written(&mut self, command: CommandId, result: Result<(), String>) -> Effects {
        Effects::of_actions(self.commands.complete(
            command,
            result.map_err(Refusal::NotSaved).into(),
            &self.image,
            self.at,
        ))
    }

    /// Begins a restore by reading the device: the value of a tag that is polled seldom may be hours old.
    fn begin_restore(
        &mut self,
        status: &CommandStatus,
        request: &RestoreRequest,
        effects: &mut Effects,
    ) -> Option<Outcome> {
        if self.restores.iter().any(|run| run.device == request.device && run.at_work()) {
            return Some(Outcome::Refused(Refusal::UnderWay));
        }
        if let Some(why) = self.mismatch(request.device, &request.set, &request.changes) {
            return Some(Outcome::Refused(why));
        }
        if request.changes.is_empty() {
            return Some(Outcome::Unchanged);
        }
        self.restores.retain(|run| run.device != request.device);
        self.restores.push(Arc::new(Restore::new(status.command.id, status.by.clone(), request, status.at)));
        let look = BusRequest::Refresh { device: request.device, command: Some(status.command.id) };
        effects.bus.push((self.def.device(request.device).line, look));
        None
    }

    /// Why the confirmed changes can no longer be written.
    fn mismatch<'a>(
        &self,
        device: DeviceId,
        set: &parameter_set::ParameterSet,
        confirmed: impl IntoIterator<Item = &'a parameter_set::PlannedChange>,
    ) -> Option<Refusal> {
        match parameter_set::plan(&self.def, device, set, &trusted(&self.image)) {
            Err(problems) => {
                problems.split_first().map(|(first, others)| Refusal::NotFit(Box::new(first.clone()), others.len()))
            }
            Ok(changes) => (!changes.iter().eq(confirmed)).then_some(Refusal::Changed),
        }
    }

    /// The settings of a line change: its restores must not continue.
    pub(super) fn mark_restores_line_changed(&mut self, line: LineId) {
        let def = &self.def;
        let here = |run: &&mut Arc<Restore>| run.at_work() && def.device(run.device).line == line;
        for run in self.restores.iter_mut().filter(here) {
            Arc::make_mut(run).line_changed = true;
        }
    }

    /// The queue of a line was full. Refuses the restore whose first read was lost; `false` if it was another request.
    pub(super) fn refuse_unread_restore(&mut self, request: &BusRequest) -> bool {
        let BusRequest::Refresh { command: Some(id), .. } = request else { return false };
        let reading = |run: &&mut Arc<Restore>| run.id == *id && run.state == State::Reading;
        let Some(run) = self.restores.iter_mut().find(reading) else { return false };
        Arc::make_mut(run).give_up(Refusal::Busy);
        true
    }

    /// Advances every pending restore: ends its write, begins the next, or ends the restore.
    pub(super) fn advance_restores(&mut self, at: Timestamp, effects: &mut Effects) {
        for place in 0..self.restores.len() {
            if self.commands.outcome_of(self.restores[place].id) == Some(&Outcome::Pending) {
                let mut run = (*self.restores[place]).clone();
                self.advance(&mut run, at, effects);
                if run != *self.restores[place] {
                    self.restores[place] = Arc::new(run);
                }
            }
        }
    }

    /// Each turn of the loop ends a write, begins one, or leaves; a restore has a finite number of writes.
    fn advance(&mut self, run: &mut Restore, at: Timestamp, effects: &mut Effects) {
        if run.state == State::Reading {
            self.begin_when_read(run, at);
        }
        loop {
            if let Some(command) = run.current() {
                match self.commands.outcome_of(command) {
                    Some(Outcome::Pending) => return,
                    Some(ended) => run.end_write(ended.clone()),
                    // The command is forgotten: the write may or may not have taken effect.
                    None => run.end_write(Outcome::NotConfirmed(NotConfirmed::NotAnswered(
                        crate::plant::fault::Fault::Timeout,
                    ))),
                }
            }
            let (by, line_changed, number) = (run.by.clone(), run.line_changed, &mut self.last_number);
            let Some(step) = run.begin_next() else { break };
            *number = number.wrapping_add(1);
            let id = CommandId { terminal: PLANT, number: *number };
            step.command = Some(id);
            let (tag, value) = (step.change.tag, step.change.new);
            let expected_value = Some(step.change.old);
            let command = Command { expected_value, ..Command::new(self.run, id, CommandKind::Write { tag, value }) };
            let status = CommandStatus::new(command, by, at);
            let refusal = if line_changed { Some(Refusal::LineChanged) } else { overtaken(step, &self.image) };
            if let Some(why) = refusal {
                let refused = self.commands.complete_at_once(&status, Outcome::Refused(why), &self.image);
                effects.records.push(Record::Action(refused));
                continue;
            }
            effects
                .write(self.line_of(tag), self.commands.write(&self.image, &status, (tag, value), WriteOrigin::Person));
            self.leave_safe_state(tag, value, at, effects);
        }
        if let Some(outcome) = run.outcome(&self.def) {
            let action = self.commands.complete(run.id, outcome, &self.image, at);
            effects.records.extend(action.map(Record::Action));
        }
    }

    /// Begins the writes once the device was read and still needs the confirmed changes.
    fn begin_when_read(&self, run: &mut Restore, at: Timestamp) {
        let waited = elapsed(run.at, at);
        if run.stopping {
            run.state = State::Stopped;
        } else if run.line_changed {
            run.give_up(Refusal::LineChanged);
        } else if run.is_read(&self.def, |tag| self.image.sample(tag)) {
            match self.mismatch(run.device, &run.set, run.steps.iter().map(|step| &step.change)) {
                Some(why) => run.give_up(why),
                None => run.begin(),
            }
        } else if READ_MAX.mul_f64(self.speed) < waited {
            run.give_up(Refusal::NotRead(READ_MAX.as_secs()));
        }
    }

    /// The latest restore of a device.
    #[cfg(test)]
    fn restore_of(&self, device: DeviceId) -> Option<&Restore> {
        self.restores.iter().find(|run| run.device == device).map(Arc::as_ref)
    }
}

/// The good values by tag.
fn trusted(image: &ProcessImage) -> impl Fn(TagId) -> Option<Exact> + '_ {
    |tag| image.sample(tag).good_exact()
}

/// Why a step would overwrite another value than the confirmed one.
fn overtaken(step: &Step, image: &ProcessImage) -> Option<Refusal> {
    match image.sample(step.change.tag).good_exact() {
        None => Some(Refusal::NotKnownNow),
        Some(now) if now != step.change.old => Some(Refusal::ChangedSince),
        Some(_) => None,
    }
}
