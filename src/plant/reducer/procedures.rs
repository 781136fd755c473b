//! Procedures in the reducer: what they instruct is done by the same paths as the commands of operators.

#[cfg(test)]
mod tests;

use std::{collections::VecDeque, sync::Arc};

use jiff::Timestamp;

use super::{Effects, Plant, restore::PLANT};
use crate::plant::{
    command::{Command, CommandId, CommandKind, CommandStatus, Outcome, Refusal},
    commands::WriteOrigin,
    control_run::RunState,
    def::{DeviceId, ProcedureId, TagId},
    exact::Exact,
    interlock,
    line_state::DeviceState,
    number::to_u16,
    procedure::{self, Instruction, ProcedureEnd, ProcedureRun, View},
    record::{ActionRecord, Record},
    recorded_action::RecordedAction,
    scale,
    station_fault::{FaultState, StationFault},
};

impl Plant {
    /// Begins a procedure, unless one is at work.
    pub(super) fn start_procedure(&mut self, id: ProcedureId, status: &CommandStatus) -> Result<(), Refusal> {
        if let Some(place) = self.procedure_at_work() {
            return Err(Refusal::ProcedureAtWork(self.def.procedures[place].name.to_string()));
        }
        let def = &self.def;
        let mut trackers = def.procedure(id).measured().filter_map(|(controller, _)| self.tracker_of(controller));
        if trackers.any(|place| !self.runs[place].is_ready()) {
            return Err(Refusal::NotMeasurable);
        }
        // Who starts one has decided about the safe states of all.
        self.procedures.iter_mut().flatten().for_each(|run| _ = Arc::make_mut(run).leave(|_| true));
        let run = ProcedureRun::new(status.by.clone(), status.from.clone(), status.at);
        self.procedures[id.index()] = Some(Arc::new(run));
        Ok(())
    }

    /// Ends the procedure at work. One that was interrupted gets its safe state now, and any other what is missing of it.
    pub(super) fn abort_procedure(
        &mut self,
        id: ProcedureId,
        status: &CommandStatus,
        effects: &mut Effects,
    ) -> Outcome {
        let Some(run) = &self.procedures[id.index()] else { return Outcome::Unchanged };
        if let Some(other) = self.procedure_at_work().filter(|place| *place != id.index()) {
            let name = self.def.procedures[other].name.to_string();
            return Outcome::Refused(Refusal::ProcedureAtWork(name));
        }
        let is_missing = run.missing().next().is_some();
        match run.end() {
            None | Some(ProcedureEnd::Interrupted) => {}
            Some(_) if is_missing => {}
            Some(ProcedureEnd::Done | ProcedureEnd::Failed(_) | ProcedureEnd::Aborted(_)) => return Outcome::Unchanged,
        }
        let mut run = (**run).clone();
        let def = self.def.clone();
        let todo = if is_missing {
            run.write_missing(status.by.clone(), status.at);
            Vec::new()
        } else {
            run.stop(def.procedure(id), ProcedureEnd::Aborted(status.by.clone()), status.at)
        };
        run.from = status.from.clone();
        self.carry_out(id, &mut run, todo, status.at, effects);
        self.procedures[id.index()] = Some(Arc::new(run));
        Outcome::Verified
    }

    /// Lets restores and the procedure at work go on by what is known now.
    pub(super) fn advance_work(&mut self, at: Timestamp, effects: &mut Effects) {
        self.advance_restores(at, effects);
        self.advance_procedures(at, effects);
    }

    /// Lets the procedure at work go on, and those whose safe state is not complete. The alarm stays as long as there are any.
    fn advance_procedures(&mut self, at: Timestamp, effects: &mut Effects) {
        let goes_on = |run: &ProcedureRun| run.at_work() || run.missing().next().is_some();
        for place in 0..self.procedures.len() {
            if self.procedures[place].as_deref().is_some_and(goes_on) {
                self.advance_procedure(place, at, effects);
            }
        }
        let missing = self.def.procedures.iter().zip(&self.procedures).filter_map(|(def, run)| {
            let run = run.as_deref().filter(|run| run.missing().next().is_some())?;
            Some(format!("{}: {}", def.name, run.recorded(&self.def, def.steps.len())))
        });
        let missing: Vec<String> = missing.collect();
        if !missing.is_empty() {
            self.faults.set(StationFault::Procedure, FaultState::Active(missing.join("; ").into()));
        } else if self.faults.is_lasting(StationFault::Procedure) {
            self.faults.set(StationFault::Procedure, FaultState::Cleared);
        }
    }

    fn advance_procedure(&mut self, place: usize, at: Timestamp, effects: &mut Effects) {
        let Some(before) = self.procedures[place].clone() else { return };
        let (id, def, mut run) = (ProcedureId(to_u16(place)), self.def.clone(), (*before).clone());
        loop {
            let (image, commands, devices) = (&self.image, &self.commands, &self.devices);
            let view = View {
                value: &|tag| image.sample(tag).good_exact(),
                outcome: &|id| commands.outcome_of(id).cloned(),
                is_stop: &|tag, value| {
                    interlock::is_stop(&def, tag, value.into(), image.scaling_decimals(def.tag(tag)))
                },
                responds: &|tag| devices[def.tag(tag).device.index()].state == DeviceState::Responding,
                at,
            };
            let todo = run.next(def.procedure(id), &view);
            if todo.is_empty() {
                break;
            }
            self.carry_out(id, &mut run, todo, at, effects);
        }
        if run != *before {
            self.procedures[place] = Some(Arc::new(run));
        }
    }

    /// A person has written this to a tag: a safe state that wants something else there is left as it is.
    pub(super) fn leave_safe_state(&mut self, tag: TagId, value: Exact, at: Timestamp, effects: &mut Effects) {
        let def = self.def.clone();
        let decimals = self.image.scaling_decimals(def.tag(tag)).unwrap_or_default();
        let is_same = |wanted: f64| scale::is_sent_as(def.tag(tag), value, wanted.into(), decimals);
        for place in 0..self.procedures.len() {
            let Some(mut run) = self.procedures[place].as_deref().cloned() else { continue };
            if run.leave(|write| write.tag == tag && !is_same(write.value)) {
                let id = ProcedureId(to_u16(place));
                self.carry_out(id, &mut run, vec![Instruction::Record], at, effects);
                self.procedures[place] = Some(Arc::new(run));
            }
        }
    }

    /// The station stops: the procedure at work ends where it is.
    pub(super) fn stop_procedures(&mut self, effects: &mut Effects) {
        let at = self.at;
        let Some(place) = self.procedure_at_work() else { return };
        let Some(mut run) = self.procedures[place].as_deref().cloned() else { return };
        let todo = run.on_stop(at);
        self.carry_out(ProcedureId(to_u16(place)), &mut run, todo, at, effects);
        self.procedures[place] = Some(Arc::new(run));
    }

    pub(super) fn procedure_at_work(&self) -> Option<usize> {
        self.procedures.iter().position(|run| run.as_ref().is_some_and(|run| run.at_work()))
    }

    /// Shows the procedure that the station before this one left at work: `latest` is the last record of one.
    /// It does not go on. Where its end is not on record, that is returned.
    pub fn restore_procedures(&mut self, latest: Option<&ActionRecord>) -> Vec<Record> {
        let Some(latest) = latest else { return Vec::new() };
        let has_ended = latest.is(RecordedAction::EndProcedure);
        let is_interrupted = !has_ended || latest.outcome.starts_with(procedure::INTERRUPTED);
        let place = self.def.procedures.iter().position(|def| *def.name == *latest.target);
        let mut missing = String::new();
        if let Some(place) = place.filter(|place| self.procedures[*place].is_none()) {
            let run = ProcedureRun::interrupted(latest.by.clone(), latest.from.clone(), latest.at, self.at);
            let run = run.with_missing(&self.def, &self.def.procedures[place], &latest.outcome);
            missing = run.safe_state(&self.def);
            let is_shown = is_interrupted || run.missing().next().is_some();
            self.procedures[place] = is_shown.then(|| Arc::new(run));
        }
        if has_ended {
            return Vec::new();
        }
        let outcome = format!("{}: the station stopped{missing}", procedure::INTERRUPTED);
        self.faults.set(StationFault::Procedure, occurred(&latest.target, &outcome));
        let (at, action, outcome) = (self.at, RecordedAction::EndProcedure.into(), outcome.into());
        vec![Record::Action(ActionRecord { at, action, outcome, chain_hash: None, ..latest.clone() })]
    }

    /// Does what a procedure instructs, and what follows from that.
    fn carry_out(
        &mut self,
        id: ProcedureId,
        run: &mut ProcedureRun,
        todo: Vec<Instruction>,
        at: Timestamp,
        effects: &mut Effects,
    ) {
        let mut todo = VecDeque::from(todo);
        while let Some(instruction) = todo.pop_front() {
            match instruction {
                Instruction::Write { tag, value, safe } => {
                    let command = self.write_for(id, run, (tag, value, safe.is_some()), at, effects);
                    run.sent(safe, command);
                }
                Instruction::Begin(controller, label) => {
                    let tracker = self.tracker_of(controller).map(|place| &mut self.runs[place]);
                    if tracker.is_some_and(|tracker| tracker.begin_measurement(&label)) {
                        effects.records.extend(self.follow_runs(&[]));
                    } else {
                        todo.extend(run.not_measured(self.def.procedure(id), at));
                    }
                }
                Instruction::End(controller) => match self.end_measurement(controller, at, RunState::Ended) {
                    Some(record) => effects.records.push(record),
                    None => todo.extend(run.not_measured(self.def.procedure(id), at)),
                },
                Instruction::Interrupt(controller) => {
                    effects.records.extend(self.end_measurement(controller, at, RunState::Interrupted));
                }
                Instruction::Record => {
                    let def = self.def.procedure(id);
                    let outcome = run.recorded(&self.def, def.steps.len());
                    if run.is_fault() && !run.at_work() {
                        self.faults.set(StationFault::Procedure, occurred(&def.name, &outcome));
                    }
                    let action =
                        if run.at_work() { RecordedAction::WriteSafeState } else { RecordedAction::EndProcedure };
                    let action = ActionRecord::new(at, run.actor().clone(), action, def.name.clone(), outcome);
                    effects.records.push(Record::Action(action));
                }
            }
        }
    }

    /// Gives a write of a procedure to the bus, or records that it is refused.
    fn write_for(
        &mut self,
        id: ProcedureId,
        run: &ProcedureRun,
        (tag, value, is_safe): (TagId, f64, bool),
        at: Timestamp,
        effects: &mut Effects,
    ) -> CommandId {
        self.last_number = self.last_number.wrapping_add(1);
        let command = CommandId { terminal: PLANT, number: self.last_number };
        let value = Exact::from(value);
        let kind = CommandKind::Write { tag, value };
        // It was confirmed with the procedure, whatever the value is that it replaces.
        let expected_value = self.image.sample(tag).exact();
        let note = Some(format!("procedure {}", self.def.procedure(id).name).into());
        let request = Command { expected_value, note, ..Command::new(self.run, command, kind) };
        let status = CommandStatus { from: run.from.clone(), ..CommandStatus::new(request, run.actor().clone(), at) };
        let origin = if is_safe { WriteOrigin::SafeState } else { WriteOrigin::Unconditional };
        effects.write(self.line_of(tag), self.commands.write(&self.image, &status, (tag, value), origin));
        command
    }

    fn end_measurement(&mut self, controller: DeviceId, at: Timestamp, state: RunState) -> Option<Record> {
        let place = self.tracker_of(controller)?;
        let run = self.runs[place].end_measurement(at, state)?;
        Some(Record::Run(Box::new(run)))
    }

    /// The place of the runs of a controller.
    fn tracker_of(&self, controller: DeviceId) -> Option<usize> {
        self.def.runs.iter().position(|def| def.controller == controller)
    }
}

/// The procedure has failed: an alarm that waits for its acknowledgement.
fn occurred(name: &str, outcome: &str) -> FaultState {
    FaultState::Occurred(format!("{name}: {outcome}").into())
}
