//! What a procedure does next: a state machine without I/O and clock.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    NotConfirmed, PlantDef, ProcedureDef, ProcedureEnd, ProcedureRun, ProcedureState, ProcedureStep, SafeWrite,
    StepFailure, not_safe,
};
use crate::plant::{
    command::{CommandId, Outcome},
    exact::Exact,
    fault::Fault,
    id::{DeviceId, TagId},
    time::elapsed,
};

/// A write of the safe state that was sent in vain is sent again after this time, then after twice as long, and so on.
const AGAIN_MIN: Duration = Duration::from_secs(5);
/// At the latest after this.
const AGAIN_MAX: Duration = Duration::from_secs(600);

/// What a procedure looks at.
pub(in crate::plant) struct View<'a> {
    /// The good value of a tag.
    pub value: &'a dyn Fn(TagId) -> Option<Exact>,
    /// The outcome of a write; `None` once it is forgotten.
    pub outcome: &'a dyn Fn(CommandId) -> Option<Outcome>,
    /// Does this value of a tag switch something off, so that it is sent whatever is under way?
    pub is_stop: &'a dyn Fn(TagId, f64) -> bool,
    /// Does the device of a tag answer?
    pub responds: &'a dyn Fn(TagId) -> bool,
    /// Now.
    pub at: Timestamp,
}

/// What the plant must do for a procedure.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::plant) enum Instruction {
    /// Write for the step at work, or for the safe state (its place there); [`ProcedureRun::sent`] answers.
    Write { tag: TagId, value: f64, safe: Option<usize> },
    /// Begin a control run under this name; [`ProcedureRun::not_measured`] answers where that is not possible.
    Begin(DeviceId, Arc<str>),
    /// End it; the same answer where there is none.
    End(DeviceId),
    /// Interrupt it.
    Interrupt(DeviceId),
    /// It has ended, or writes its safe state now: put that on record.
    Record,
}

impl ProcedureRun {
    /// One that begins with its first step.
    pub fn new(by: Arc<str>, from: Arc<str>, at: Timestamp) -> ProcedureRun {
        ProcedureRun {
            by,
            from,
            started: at,
            step: Some(0),
            since: at,
            state: ProcedureState::Running,
            safe: Vec::new(),
            begun: false,
            write: None,
            measuring: Vec::new(),
        }
    }

    /// One of a station that stopped meanwhile.
    pub(in crate::plant) fn interrupted(
        by: Arc<str>,
        from: Arc<str>,
        started: Timestamp,
        at: Timestamp,
    ) -> ProcedureRun {
        let state = ProcedureState::Ended(ProcedureEnd::Interrupted);
        ProcedureRun { step: None, since: at, state, ..ProcedureRun::new(by, from, started) }
    }

    /// The same, with what its station has put on record as missing: those writes are still to be reached.
    pub(in crate::plant) fn with_missing(self, plant: &PlantDef, def: &ProcedureDef, recorded: &str) -> ProcedureRun {
        let missing = recorded.split_once(&format!("{}: ", not_safe())).map_or("", |(_, missing)| missing);
        let stopped = || Some(Outcome::NotConfirmed(NotConfirmed::StationStopped));
        let safe = def.safe.iter().map(|write| SafeWrite::new(*write, stopped()));
        let is_named = |write: &SafeWrite| missing.split(", ").any(|named| named == write.words(plant));
        ProcedureRun { safe: safe.filter(is_named).collect(), ..self }
    }

    /// The same, where its steps mean nothing any more, and the tags of its safe state are those that `tag` says.
    pub(in crate::plant) fn without_step(&self, tag: impl Fn(TagId) -> Option<TagId>) -> ProcedureRun {
        let missing = self.missing().filter_map(|write| Some(SafeWrite { tag: tag(write.tag)?, ..write.clone() }));
        ProcedureRun { step: None, safe: missing.collect(), measuring: Vec::new(), ..self.clone() }
    }

    /// Writes what is missing of the safe state at once, as this person has asked.
    pub(in crate::plant) fn write_missing(&mut self, by: Arc<str>, at: Timestamp) {
        (self.state, self.since) = (ProcedureState::WritingSafeState(ProcedureEnd::Aborted(by)), at);
        for write in self.safe.iter_mut().filter(|write| write.is_missing()) {
            (write.command, write.outcome) = (None, None);
        }
    }

    /// A person has decided otherwise about a tag, or about all: what is missing there is not written any more. `false`: nothing is.
    pub(in crate::plant) fn leave(&mut self, is_meant: impl Fn(&SafeWrite) -> bool) -> bool {
        let has_ended = !self.at_work();
        let left = self.safe.iter_mut().filter(|write| has_ended && write.is_missing() && is_meant(write));
        left.map(|write| write.is_left = true).count() > 0
    }

    /// The next things to do; empty while it waits, and once it has ended in its safe state. Each step comes up once, so that
    /// who asks again until nothing is to be done comes to an end.
    pub(in crate::plant) fn next(&mut self, def: &ProcedureDef, view: &View) -> Vec<Instruction> {
        match &self.state {
            ProcedureState::Running => self.next_step(def, view),
            ProcedureState::WritingSafeState(_) | ProcedureState::Ended(_) => {
                self.next_safe(self.under_way(def, view), view)
            }
        }
    }

    /// Its write was given to the plant.
    pub(in crate::plant) fn sent(&mut self, safe: Option<usize>, command: CommandId) {
        match safe.and_then(|place| self.safe.get_mut(place)) {
            Some(write) => write.command = Some(command),
            None => self.write = Some(command),
        }
    }

    /// A measurement could not begin or end: it fails.
    pub(in crate::plant) fn not_measured(&mut self, def: &ProcedureDef, at: Timestamp) -> Vec<Instruction> {
        self.stop(def, ProcedureEnd::Failed(StepFailure::NotMeasured), at)
    }

    /// Ends it at once, and writes the safe state.
    pub(in crate::plant) fn stop(&mut self, def: &ProcedureDef, end: ProcedureEnd, at: Timestamp) -> Vec<Instruction> {
        self.safe = def.safe.iter().map(|write| SafeWrite::new(*write, None)).collect();
        (self.state, self.since) = (ProcedureState::WritingSafeState(end), at);
        let mut todo = self.interrupt();
        todo.extend((!self.safe.is_empty()).then_some(Instruction::Record));
        todo
    }

    /// The station stops: ends it where it is.
    pub(in crate::plant) fn on_stop(&mut self, at: Timestamp) -> Vec<Instruction> {
        (self.state, self.since) = (ProcedureState::Ended(ProcedureEnd::Interrupted), at);
        let mut last = self.interrupt();
        last.push(Instruction::Record);
        last
    }

    fn interrupt(&mut self) -> Vec<Instruction> {
        self.measuring.drain(..).map(Instruction::Interrupt).collect()
    }

    fn next_step(&mut self, def: &ProcedureDef, view: &View) -> Vec<Instruction> {
        loop {
            let place = self.step.unwrap_or_default();
            let Some(step) = def.steps.get(place) else {
                self.step = Some(place.saturating_sub(1));
                (self.state, self.since) = (ProcedureState::Ended(ProcedureEnd::Done), view.at);
                return vec![Instruction::Record];
            };
            if !self.begun {
                (self.begun, self.since) = (true, view.at);
                let begun = self.begin(step);
                if !begun.is_empty() {
                    return begun;
                }
            }
            match self.is_over(step, view) {
                Ok(false) => return Vec::new(),
                Ok(true) => (self.step, self.begun, self.write) = (Some(place + 1), false, None),
                Err(why) => {
                    let mut last = self.stop(def, ProcedureEnd::Failed(why), view.at);
                    last.extend(self.next(def, view));
                    return last;
                }
            }
        }
    }

    fn begin(&mut self, step: &ProcedureStep) -> Vec<Instruction> {
        match step {
            ProcedureStep::Write { tag, value } => vec![Instruction::Write { tag: *tag, value: *value, safe: None }],
            ProcedureStep::WaitUntil { .. } | ProcedureStep::Hold(_) => Vec::new(),
            ProcedureStep::BeginMeasurement { controller, label } => {
                self.measuring.push(*controller);
                vec![Instruction::Begin(*controller, label.clone())]
            }
            ProcedureStep::EndMeasurement { controller } => {
                self.measuring.retain(|measured| measured != controller);
                vec![Instruction::End(*controller)]
            }
        }
    }

    /// Has the step that has begun done its part?
    fn is_over(&self, step: &ProcedureStep, view: &View) -> Result<bool, StepFailure> {
        let lasted = elapsed(self.since, view.at);
        match step {
            ProcedureStep::Write { .. } => match self.write.and_then(view.outcome) {
                Some(Outcome::Pending) => Ok(false),
                Some(outcome) if outcome.is_done() => Ok(true),
                Some(outcome) => Err(StepFailure::Write(outcome)),
                None => Err(StepFailure::Forgotten),
            },
            ProcedureStep::WaitUntil { condition, limit, .. } => match condition.holds(&view.value) {
                Some(true) => Ok(true),
                Some(false) | None if lasted < *limit => Ok(false),
                Some(false) | None => Err(StepFailure::TimeLimit),
            },
            ProcedureStep::Hold(time) => Ok(*time <= lasted),
            // They are done with their instruction.
            ProcedureStep::BeginMeasurement { .. } | ProcedureStep::EndMeasurement { .. } => Ok(true),
        }
    }

    /// The tag that the step writes to, while that write is under way.
    fn under_way(&self, def: &ProcedureDef, view: &View) -> Option<TagId> {
        let is_pending = self.write.and_then(view.outcome) == Some(Outcome::Pending);
        match def.steps.get(self.step?)? {
            ProcedureStep::Write { tag, .. } if is_pending => Some(*tag),
            ProcedureStep::Write { .. }
            | ProcedureStep::WaitUntil { .. }
            | ProcedureStep::Hold(_)
            | ProcedureStep::BeginMeasurement { .. }
            | ProcedureStep::EndMeasurement { .. } => None,
        }
    }

    /// Every write of the safe state is sent, whatever becomes of the others; it ends once all have an outcome. What is missing
    /// then is sent again when its device answers.
    fn next_safe(&mut self, under_way: Option<TagId>, view: &View) -> Vec<Instruction> {
        let mut todo = Vec::new();
        let (at_work, was_missing) = (self.at_work(), self.missing().next().is_some());
        for (place, write) in self.safe.iter_mut().enumerate() {
            if !at_work && write.is_due(view) {
                (write.command, write.outcome) = (None, None);
            }
            match write.command {
                _ if write.outcome.is_some() => {}
                // A write of a step to the same tag may be under way: another one would be refused.
                None if under_way == Some(write.tag) && !(view.is_stop)(write.tag, write.value) => {}
                None => todo.push(Instruction::Write { tag: write.tag, value: write.value, safe: Some(place) }),
                Some(command) => {
                    let outcome = (view.outcome)(command).unwrap_or(Outcome::Failed(Fault::Timeout));
                    write.outcome = Some(outcome).filter(|outcome| *outcome != Outcome::Pending);
                    (write.tries, write.tried) = (write.tries + u32::from(write.outcome.is_some()), view.at);
                }
            }
        }
        match &self.state {
            ProcedureState::WritingSafeState(end) if self.safe.iter().all(|write| write.outcome.is_some()) => {
                (self.state, self.since) = (ProcedureState::Ended(end.clone()), view.at);
                todo.push(Instruction::Record);
            }
            ProcedureState::Ended(_) if was_missing && self.missing().next().is_none() => {
                todo.push(Instruction::Record);
            }
            ProcedureState::Running | ProcedureState::WritingSafeState(_) | ProcedureState::Ended(_) => {}
        }
        todo
    }
}

impl SafeWrite {
    /// Is it to be sent again?
    fn is_due(&self, view: &View) -> bool {
        let doubled = AGAIN_MIN.saturating_mul(2u32.saturating_pow(self.tries.saturating_sub(1)));
        let pause = if self.tries == 0 { Duration::ZERO } else { doubled.min(AGAIN_MAX) };
        let is_over = self.outcome.is_some() && self.is_missing() && pause <= elapsed(self.tried, view.at);
        is_over && (view.responds)(self.tag)
    }
}
