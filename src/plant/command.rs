//! What an operator asks, its way to the bus, and its outcome.

mod bus_request;
mod refusal;

use crate::{
    t,
    text::{file, translate},
};
use std::{fmt, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::id::{CommandId, WriteId};
use super::{
    alarm::{ActiveAlarm, AlarmCommand},
    def::{DeviceId, LineDef, LineId, PlantDef, ProcedureId, TagId},
    diagnostic_request::Diagnostic,
    exact::Exact,
    fault::Fault,
    parameter_set::RestoreRequest,
    procedure_def::ProcedureDef,
};
pub use bus_request::{BusRequest, WriteJob, WriteResult};
pub use refusal::{NotConfirmed, Refusal};

/// What an operator asks. [`CommandStatus`] says what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Chosen by the terminal, which finds the outcome by it in a later snapshot.
    pub id: CommandId,
    /// The run of the station whose snapshot it was made on, see [`Snapshot::run`](super::snapshot::Snapshot::run). The ids in
    /// `kind` mean nothing in another run: the plant file may have changed.
    pub run: u64,
    /// What to do, to what and with which value.
    pub kind: CommandKind,
    /// The value that the operator saw when confirming a write. A write over another value is refused.
    pub expected_value: Option<Exact>,
    /// Its author, a program, named no value that must be there: it is written over whatever is.
    pub is_unconditional: bool,
    /// The operator's reason.
    pub note: Option<Arc<str>>,
}

impl Command {
    /// A command without expected value and note.
    pub fn new(run: u64, id: CommandId, kind: CommandKind) -> Command {
        Command { id, run, kind, expected_value: None, is_unconditional: false, note: None }
    }
}

impl From<CommandKind> for Command {
    /// A command that the terminal has not numbered yet.
    fn from(kind: CommandKind) -> Command {
        Command::new(0, CommandId::default(), kind)
    }
}

/// What a command does, to what and with which value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum CommandKind {
    /// Write a value, in the tag's unit, and verify it.
    Write {
        /// What.
        tag: TagId,
        /// The new value.
        value: Exact,
    },
    /// Write a text, a date, a time or an address, and verify it.
    WriteText {
        /// What.
        tag: TagId,
        /// As it was typed; once accepted, as the device will show it.
        text: Arc<str>,
        /// The text that the operator saw. A write over another one is refused; a clock goes on.
        seen: Option<Arc<str>>,
    },
    /// Acknowledge, silence, reset, shelve: what is done with alarms.
    Alarm(AlarmCommand),
    /// Read all tags of a device now.
    Refresh(DeviceId),
    /// Open (`true`) or close a line.
    Connect(LineId, bool),
    /// Apply other settings to the line of the same id until the station ends, or they are saved or reverted.
    Configure(Box<LineDef>),
    /// Write the settings in use into the plant file.
    SaveSettings(LineId),
    /// Test a line.
    Test(LineId, Diagnostic),
    /// Stop the test of a line.
    StopTest(LineId),
    /// Reload the folder of parameter sets.
    ReadSets,
    /// Save what a device holds as a parameter set.
    SaveSet {
        /// The device.
        device: DeviceId,
        /// Name of the set.
        name: Arc<str>,
        /// Replace a set of the same name.
        replace: bool,
    },
    /// Write the differences of a parameter set to a device, one verified write after the other.
    Restore(Box<RestoreRequest>),
    /// Stop the restore of a device after the write under way.
    StopRestore(DeviceId),
    /// Carry out a procedure of the plant file.
    StartProcedure(ProcedureId),
    /// End the procedure at work, or one that was interrupted, with the writes of its safe state.
    AbortProcedure(ProcedureId),
    /// Correct what a counter has counted; the note of the command is the reason.
    CorrectCounter {
        /// Which.
        tag: TagId,
        /// What is added, in its unit; less than 0 takes away.
        amount: Exact,
    },
    /// Hand the plant over to the next shift; the note of the command is for that shift.
    HandOver,
    /// Take the plant over from the shift before.
    TakeOver,
}

impl CommandKind {
    /// The tag and the value of a write of a number.
    pub fn written(&self) -> Option<(TagId, Exact)> {
        match self {
            CommandKind::Write { tag, value } => Some((*tag, *value)),
            _ => None,
        }
    }

    /// The tag of a write, of a number or of a text.
    pub fn written_tag(&self) -> Option<TagId> {
        match self {
            CommandKind::Write { tag, .. } | CommandKind::WriteText { tag, .. } => Some(*tag),
            _ => None,
        }
    }

    /// What is said of one that went well, the same on screen and on record: only a value is read back, and so verified.
    pub fn label(&self) -> &'static str {
        match self {
            CommandKind::Write { .. } | CommandKind::WriteText { .. } | CommandKind::Restore(_) => "verified",
            // The line has taken it; what comes of it stands on the bus tab.
            CommandKind::Test(..) => "started",
            // Whether they are the right ones only the devices can tell.
            CommandKind::Configure(_) => "in use",
            CommandKind::SaveSettings(_) => "saved to plant file",
            // The line has been asked to; only the device tells whether it answers.
            CommandKind::Refresh(_) => "requested",
            CommandKind::Alarm(_)
            | CommandKind::Connect(..)
            | CommandKind::StopTest(_)
            | CommandKind::ReadSets
            | CommandKind::SaveSet { .. }
            | CommandKind::StopRestore(_)
            | CommandKind::StartProcedure(_)
            | CommandKind::AbortProcedure(_)
            | CommandKind::CorrectCounter { .. }
            | CommandKind::HandOver
            | CommandKind::TakeOver => "done",
        }
    }

    /// The line that it works on; `None` for one that works on none, or on more than one.
    pub fn line(&self, def: &PlantDef) -> Option<LineId> {
        let of_device = |device: DeviceId| Some(def.device(device).line);
        match self {
            CommandKind::Write { tag, .. } | CommandKind::WriteText { tag, .. } => of_device(def.tag(*tag).device),
            CommandKind::Refresh(device) | CommandKind::SaveSet { device, .. } | CommandKind::StopRestore(device) => {
                of_device(*device)
            }
            CommandKind::Restore(request) => of_device(request.device),
            CommandKind::Connect(line, _)
            | CommandKind::SaveSettings(line)
            | CommandKind::Test(line, _)
            | CommandKind::StopTest(line) => Some(*line),
            CommandKind::Configure(settings) => Some(settings.id),
            CommandKind::Alarm(_)
            | CommandKind::ReadSets
            | CommandKind::StartProcedure(_)
            | CommandKind::AbortProcedure(_)
            | CommandKind::CorrectCounter { .. }
            | CommandKind::HandOver
            | CommandKind::TakeOver => None,
        }
    }

    /// Each tag with the number that it gets, `None` for a text: of a write one, of a restore all its changes, of a procedure
    /// those of all steps and of its safe state.
    pub fn writes<'a>(&'a self, def: &'a PlantDef) -> impl Iterator<Item = (TagId, Option<Exact>)> + 'a {
        let changes = match self {
            CommandKind::Restore(request) => &request.changes[..],
            _ => &[],
        };
        let procedure = match self {
            CommandKind::StartProcedure(id) => def.procedures.get(id.index()),
            _ => None,
        };
        let own = self.written_tag().map(|tag| (tag, self.written().map(|(_, value)| value)));
        let changes = changes.iter().map(|change| (change.tag, Some(change.new)));
        let of_procedure = procedure.into_iter().flat_map(ProcedureDef::writes);
        let of_procedure = of_procedure.map(|(tag, value)| (tag, Some(value.into())));
        own.into_iter().chain(changes).chain(of_procedure)
    }
}

/// A command on its way to its outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandStatus {
    /// What was asked. Once accepted, a write has the value that the device will hold.
    pub command: Command,
    /// The user.
    pub by: Arc<str>,
    /// The user's place: `pts/3 from 10.0.0.5, user panel`; empty for the station itself.
    pub from: Arc<str>,
    /// When the plant accepted it.
    pub at: Timestamp,
    /// The tag's value at that time, for a write.
    pub old: Option<Exact>,
    /// Its outcome so far.
    pub outcome: Outcome,
    /// When it got this outcome; when the plant accepted it, while it is pending.
    pub outcome_at: Timestamp,
    /// The audit entry of its outcome is on disk; meaningless while it is pending, and where the terminal itself has lost it.
    pub recorded: bool,
}

impl CommandStatus {
    /// A pending command.
    pub fn new(command: Command, by: impl Into<Arc<str>>, at: Timestamp) -> CommandStatus {
        let (by, from, outcome) = (by.into(), "".into(), Outcome::Pending);
        CommandStatus { command, by, from, at, old: None, outcome, outcome_at: at, recorded: true }
    }

    /// Its outcome in words.
    pub fn outcome_text(&self) -> String {
        match &self.outcome {
            Outcome::Verified => translate(self.command.kind.label()).to_owned(),
            outcome => outcome.to_string(),
        }
    }

    /// Is it still without an outcome?
    pub fn is_pending(&self) -> bool {
        self.outcome == Outcome::Pending
    }
}

/// The outcome of a command. A write is never retried by itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// Under way.
    Pending,
    /// Read back and equal; for commands that write nothing: done.
    Verified,
    /// The device already had this value: nothing was written, memory is spared.
    Unchanged,
    /// A broadcast is on its way to all units of its line: none answers, so nothing can confirm it.
    Sent,
    /// Not done, and certainly without effect on the tag. An unlock register that was sent before has an audit entry of its own.
    Refused(Refusal),
    /// A write that may or may not have taken effect, or had another effect than requested.
    NotConfirmed(NotConfirmed),
    /// No response to a command that writes nothing.
    Failed(Fault),
}

impl Outcome {
    /// Does the device certainly hold the value?
    pub fn is_done(&self) -> bool {
        matches!(self, Outcome::Verified | Outcome::Unchanged)
    }

    /// Has it ended as well as it can?
    pub fn is_success(&self) -> bool {
        self.is_done() || *self == Outcome::Sent
    }

    /// The outcome without its reason, the same on screen, in the history and in CSV.
    pub fn label(&self) -> &'static str {
        match self {
            Outcome::Pending => "pending",
            Outcome::Verified => "verified",
            Outcome::Unchanged => "unchanged",
            Outcome::Sent => "sent",
            Outcome::Refused(_) => "refused",
            Outcome::NotConfirmed(_) => "not confirmed",
            Outcome::Failed(_) => "failed",
        }
    }

    /// Was an action with this outcome on record refused, or is it not known to have had its effect? What a device accepts and never
    /// shows has not failed. What is on record is English, whatever the language of a screen.
    pub fn is_failure(recorded: &str) -> bool {
        let unread = Outcome::NotConfirmed(NotConfirmed::NoReadBack);
        let words =
            [Outcome::Refused(Refusal::ReadOnly).label(), Outcome::Failed(Fault::Timeout).label(), unread.label()];
        words.iter().any(|word| recorded.starts_with(word)) && !recorded.starts_with(&file(|| unread.to_string()))
    }
}

impl From<Result<(), Refusal>> for Outcome {
    fn from(done: Result<(), Refusal>) -> Outcome {
        done.map_or_else(Outcome::Refused, |()| Outcome::Verified)
    }
}

/// The label with the reason: `refused: read only`.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(translate(self.label()))?;
        match self {
            Outcome::Pending | Outcome::Verified => Ok(()),
            Outcome::Unchanged => write!(f, ", {}", t!("not written")),
            Outcome::Sent => write!(f, ", {}", t!("no unit answers a broadcast")),
            Outcome::Refused(why) => write!(f, ": {why}"),
            Outcome::NotConfirmed(why) => write!(f, ": {why}"),
            Outcome::Failed(fault) => write!(f, ": {fault}"),
        }
    }
}

impl ActiveAlarm {
    /// The command to acknowledge it, as it is seen here.
    pub fn acknowledge(&self) -> CommandKind {
        CommandKind::Alarm(AlarmCommand::Acknowledge { alarm: self.id, annunciated_at: self.annunciated_at })
    }

    /// The command to tick a step of the action, or to take its tick back.
    pub fn tick(&self, step: u8, done: bool) -> CommandKind {
        CommandKind::Alarm(AlarmCommand::Tick { alarm: self.id, raised_at: self.raised_at, step, done })
    }
}
