//! Tracks commands from acceptance to outcome, and makes their audit records.

mod check;
mod outcome;
mod record;

use std::{collections::VecDeque, mem::take, sync::Arc, time::Duration};

use jiff::{Timestamp, Zoned};

use super::{
    command::{
        BusRequest, Command, CommandId, CommandKind, CommandStatus, NotConfirmed, Outcome, Refusal, WriteId, WriteJob,
    },
    def::{LineId, PlantDef, TagId},
    diagnostics::{DiagnosticRun, DiagnosticState},
    event::WriteResult,
    exact::Exact,
    fault::Fault,
    process_image::ProcessImage,
    record::ActionRecord,
    recorded_action::RecordedAction,
    scale, text_value,
};
use crate::plant::time::elapsed;
use outcome::without_read_back;
use record::record;

pub use record::{alarm_action, value_text};

/// Commands in a snapshot.
const SHOWN: usize = 32;
/// A command without a result for so long is given up: a write may or may not have taken effect.
const PENDING_MAX: Duration = Duration::from_secs(120);

/// Where a write comes from: what it may be written over, and which limits of its tag it must keep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteOrigin {
    /// A person, or a request from outside that names a value: over what was seen alone. While a limit is not known nothing is written.
    Person,
    /// A step of a procedure, confirmed with it whatever the value is that it replaces, or a request from outside that names
    /// none. The same limits.
    Unconditional,
    /// The safe state of a procedure: over anything, within the limits that are known. What makes safe is not held back by what
    /// cannot be read.
    SafeState,
}

/// Tracks commands from acceptance to outcome.
#[derive(Debug, Clone)]
pub struct CommandTracker {
    def: Arc<PlantDef>,
    /// Newest first.
    commands: VecDeque<CommandStatus>,
    /// Writes on the bus, each with its command.
    writes: Vec<(CommandId, WriteJob)>,
    /// Tests that lines have taken, until they have ended: at most as many as the queues of the lines hold.
    tests: Vec<CommandStatus>,
    last_write: u64,
}

impl CommandTracker {
    /// A tracker without commands.
    pub fn new(def: Arc<PlantDef>) -> CommandTracker {
        CommandTracker { def, commands: VecDeque::new(), writes: Vec::new(), tests: Vec::new(), last_write: 0 }
    }

    /// The latest commands, newest first.
    pub fn commands(&self) -> impl Iterator<Item = &CommandStatus> {
        self.commands.iter()
    }

    /// The latest commands for a snapshot, newest first.
    pub fn shown(&self) -> Vec<CommandStatus> {
        self.commands.iter().cloned().collect()
    }

    /// Accepts a write. `Ok` is the job for the bus; `Err` records a command that ended at once.
    pub fn write(
        &mut self,
        image: &ProcessImage,
        status: &CommandStatus,
        (tag, value): (TagId, Exact),
        origin: WriteOrigin,
    ) -> Result<WriteJob, Box<ActionRecord>> {
        let checked = self.check(image, status, (tag, value), origin);
        // What is shown and recorded is what the device will hold, not what was typed.
        let def = self.def.tag(tag);
        let rounded = image.scaling_decimals(def).and_then(|decimals| scale::rounded_to_device(def, value, decimals));
        let kind = CommandKind::Write { tag, value: rounded.unwrap_or(value) };
        let command = Command { kind, ..status.command.clone() };
        let status = CommandStatus { command, old: image.sample(tag).exact(), ..status.clone() };
        self.begin_write(&status, checked, image)
    }

    /// Accepts a write of a text over the one that was seen. `now` is the time and the zone of the plant.
    pub fn write_text(
        &mut self,
        image: &ProcessImage,
        status: &CommandStatus,
        (tag, typed, seen): (TagId, &str, Option<&str>),
        now: &Zoned,
    ) -> Result<WriteJob, Box<ActionRecord>> {
        let kind = self.def.tag(tag).point.kind;
        let held = text_value::as_held(kind, typed, now);
        // What is shown and recorded is what the device will show, not what was typed.
        let text = held.as_deref().unwrap_or(typed).into();
        let command = Command {
            kind: CommandKind::WriteText { tag, text, seen: seen.map(Into::into) },
            ..status.command.clone()
        };
        let status = CommandStatus { command, ..status.clone() };
        let checked = self.check_text(image, (tag, held, seen), status.at);
        self.begin_write(&status, checked, image)
    }

    fn begin_write(
        &mut self,
        status: &CommandStatus,
        checked: Result<WriteJob, Outcome>,
        image: &ProcessImage,
    ) -> Result<WriteJob, Box<ActionRecord>> {
        match checked {
            Err(outcome) => Err(Box::new(self.complete_at_once(status, outcome, image))),
            Ok(job) => {
                self.last_write = job.id.0;
                self.writes.push((status.command.id, job.clone()));
                self.accept(status);
                Ok(job)
            }
        }
    }

    /// Accepts a command whose outcome comes later.
    pub fn accept(&mut self, status: &CommandStatus) {
        self.commands.push_front(status.clone());
        // A pending command is never forgotten, however many come after it.
        while SHOWN < self.commands.len() {
            let Some(index) = self.commands.iter().rposition(|status| !status.is_pending()) else { break };
            self.commands.remove(index);
        }
    }

    /// Accepts a command that ends at once.
    pub fn complete_at_once(&mut self, status: &CommandStatus, outcome: Outcome, image: &ProcessImage) -> ActionRecord {
        let status = CommandStatus { outcome, ..status.clone() };
        self.accept(&status);
        record(&self.def, &status, image)
    }

    /// Ends a pending command.
    pub fn complete(
        &mut self,
        id: CommandId,
        outcome: Outcome,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let status = self.commands.iter_mut().find(|status| status.command.id == id && status.is_pending())?;
        (status.outcome, status.outcome_at) = (outcome, at);
        Some(record(&self.def, status, image))
    }

    /// A line is open (or trying to be) or closed: ends the command that asked for it.
    pub fn connected(&mut self, line: LineId, open: bool, image: &ProcessImage, at: Timestamp) -> Option<ActionRecord> {
        let id = self.pending(|status| status.command.kind == CommandKind::Connect(line, open))?;
        self.complete(id, Outcome::Verified, image, at)
    }

    /// The outcome of a command; `None` once it is forgotten.
    pub fn outcome_of(&self, id: CommandId) -> Option<&Outcome> {
        self.commands.iter().find(|status| status.command.id == id).map(|status| &status.outcome)
    }

    /// The tag of a write on the bus.
    pub fn tag_of(&self, id: WriteId) -> Option<TagId> {
        self.writes.iter().find(|(_, job)| job.id == id).map(|(_, job)| job.tag)
    }

    /// Records that the unlock register of a write was sent before it: an action of its own.
    pub fn unlocked(
        &mut self,
        id: WriteId,
        unlock_tag: TagId,
        result: &WriteResult,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let (command, job) = self.writes.iter().find(|(_, job)| job.id == id)?;
        let status = self.commands.iter().find(|status| status.command.id == *command)?;
        let (unlock_tag, tag) = (self.def.tag(unlock_tag), self.def.tag(job.tag));
        Some(ActionRecord {
            at,
            action: RecordedAction::Unlock.into(),
            target: unlock_tag.name.as_str().into(),
            old: image.sample(unlock_tag.id).exact().map(|old| value_text(image, unlock_tag, old).into()),
            new: tag.write_unlock.map(|(_, new)| value_text(image, unlock_tag, new).into()),
            outcome: format!("{}; for {}", without_read_back(result), tag.name).into(),
            note: None,
            ..record(&self.def, status, image)
        })
    }

    /// Ends the command of a write that has ended on the bus.
    pub fn wrote(
        &mut self,
        id: WriteId,
        result: WriteResult,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let (command, job) = self.take_write(id)?;
        let begun = self.commands.iter().find(|status| status.command.id == command).map_or(at, |status| status.at);
        let outcome = outcome::of_write(self.def.tag(job.tag), &job, result, image, elapsed(begun, at));
        self.complete(command, outcome, image, at)
    }

    /// A line has taken a request: ends a command that waits for nothing else.
    pub fn delivered(
        &mut self,
        line: LineId,
        request: &BusRequest,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let id = self.of_line(line, request)?;
        let started = self.complete(id, Outcome::Verified, image, at);
        if matches!(request, BusRequest::Test { .. }) {
            self.tests.extend(self.commands.iter().find(|status| status.command.id == id).cloned());
        }
        started
    }

    /// A line reports on a test: where it has ended its outcome is recorded, beside its start.
    pub fn tested(&mut self, run: &DiagnosticRun, image: &ProcessImage, at: Timestamp) -> Option<ActionRecord> {
        let has_ended = |status: &CommandStatus| status.command.id == run.id && run.state != DiagnosticState::Running;
        let place = self.tests.iter().position(has_ended)?;
        let status = self.tests.remove(place);
        Some(self.end_of_test(&status, run.outcome_text(), image, at))
    }

    /// Ends the tests of lines of which nothing more is heard.
    pub fn end_tests(
        &mut self,
        is_meant: impl Fn(LineId) -> bool,
        outcome: impl Fn(LineId, CommandId) -> String,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Vec<ActionRecord> {
        let line = |status: &CommandStatus| status.command.kind.line(&self.def).filter(|line| is_meant(*line));
        let (ended, rest): (Vec<_>, Vec<_>) = take(&mut self.tests)
            .into_iter()
            .map(|status| (line(&status), status))
            .partition(|(line, _)| line.is_some());
        let ended = ended.into_iter().filter_map(|(line, status)| {
            let outcome = outcome(line?, status.command.id);
            Some(self.end_of_test(&status, outcome, image, at))
        });
        let ended = ended.collect();
        self.tests = rest.into_iter().map(|(_, status)| status).collect();
        ended
    }

    fn end_of_test(
        &self,
        status: &CommandStatus,
        outcome: String,
        image: &ProcessImage,
        at: Timestamp,
    ) -> ActionRecord {
        let (action, outcome) = (RecordedAction::EndTest.into(), outcome.into());
        ActionRecord { at, action, outcome, note: None, ..record(&self.def, status, image) }
    }

    /// The queue of a line was full: refuses the command of the request.
    pub fn undeliverable(
        &mut self,
        line: LineId,
        request: &BusRequest,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Option<ActionRecord> {
        let id = match request {
            BusRequest::Write(job) => self.take_write(job.id)?.0,
            BusRequest::Connect(open) => {
                self.pending(|status| status.command.kind == CommandKind::Connect(line, *open))?
            }
            // A read is not an operator action: it is shown, but not recorded.
            BusRequest::Refresh { command, .. } => {
                let command = (*command)?;
                let status = self.commands.iter_mut().find(|status| status.command.id == command)?;
                (status.outcome, status.outcome_at) = (Outcome::Refused(Refusal::Busy), at);
                return None;
            }
            BusRequest::Configure(_) | BusRequest::Test { .. } | BusRequest::StopTest => self.of_line(line, request)?,
        };
        self.complete(id, Outcome::Refused(Refusal::Busy), image, at)
    }

    /// Ends commands without a result for too long. The bus waits in real time; `speed` is plant seconds per real second.
    pub fn expire(&mut self, at: Timestamp, speed: f64, image: &ProcessImage) -> Vec<ActionRecord> {
        let late = |status: &&CommandStatus| {
            status.is_pending()
                // The writes of a restore expire one by one.
                && !matches!(status.command.kind, CommandKind::Restore(_))
                && PENDING_MAX.mul_f64(speed) < elapsed(status.at, at)
        };
        let outcome = |status: &CommandStatus| match status.command.kind.written_tag() {
            Some(_) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(Fault::Timeout)),
            None => Outcome::Failed(Fault::Timeout),
        };
        let late = self.commands.iter().filter(late).map(|status| (status.command.id, outcome(status)));
        let late: Vec<(CommandId, Outcome)> = late.collect();
        self.writes.retain(|(command, _)| late.iter().all(|(id, _)| id != command));
        late.into_iter().filter_map(|(id, outcome)| self.complete(id, outcome, image, at)).collect()
    }

    /// The station stops: ends every pending command.
    pub fn stop(&mut self, image: &ProcessImage, at: Timestamp) -> Vec<ActionRecord> {
        self.end_pending(|_| true, NotConfirmed::StationStopped, image, at)
    }

    /// Ends the pending commands that are meant, oldest first.
    pub fn end_pending(
        &mut self,
        is_meant: impl Fn(&CommandKind) -> bool,
        why: NotConfirmed,
        image: &ProcessImage,
        at: Timestamp,
    ) -> Vec<ActionRecord> {
        let pending = self.commands.iter().rev().filter(|status| status.is_pending());
        let meant = pending.filter(|status| is_meant(&status.command.kind)).map(|status| status.command.id);
        let ids: Vec<CommandId> = meant.collect();
        self.writes.retain(|(command, _)| !ids.contains(command));
        ids.into_iter().filter_map(|id| self.complete(id, Outcome::NotConfirmed(why.clone()), image, at)).collect()
    }

    /// Goes on under another definition, with those commands that it `knows` as this one does.
    pub fn redefine(&mut self, def: &Arc<PlantDef>, knows: impl Fn(&CommandKind) -> bool) {
        self.commands.retain(|status| knows(&status.command.kind));
        self.def = def.clone();
    }

    /// The record that a write is about to be sent, for the case that the station ends before its outcome.
    pub fn write_requested_record(&self, request: &BusRequest, image: &ProcessImage) -> Option<ActionRecord> {
        let BusRequest::Write(job) = request else { return None };
        let (command, _) = self.writes.iter().find(|(_, write)| write.id == job.id)?;
        let status = self.commands.iter().find(|status| status.command.id == *command)?;
        let outcome = Outcome::Pending.label().into();
        Some(ActionRecord {
            action: RecordedAction::WriteRequested.into(),
            outcome,
            ..record(&self.def, status, image)
        })
    }

    fn take_write(&mut self, id: WriteId) -> Option<(CommandId, WriteJob)> {
        let index = self.writes.iter().position(|(_, job)| job.id == id)?;
        Some(self.writes.swap_remove(index))
    }

    fn pending(&self, is_meant: impl Fn(&CommandStatus) -> bool) -> Option<CommandId> {
        let mut pending = self.commands.iter().filter(|status| status.is_pending());
        pending.find(|status| is_meant(status)).map(|status| status.command.id)
    }

    /// The pending command behind a request that gets no reply from the line.
    fn of_line(&self, line: LineId, request: &BusRequest) -> Option<CommandId> {
        self.pending(|status| match (request, &status.command.kind) {
            (BusRequest::Test { id, .. }, _) => status.command.id == *id,
            (BusRequest::Configure(requested), CommandKind::Configure(settings)) => requested == settings,
            (BusRequest::StopTest, CommandKind::StopTest(tested)) => *tested == line,
            _ => false,
        })
    }
}
