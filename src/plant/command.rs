//! What an operator asks, its way to the bus, and its outcome.

use std::{fmt, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::id::WriteId;
use super::{
    alarm::{AlarmCommand, AlarmRefusal},
    def::{DeviceId, LineDef, LineId, TagId},
    diagnostics::Diagnostic,
    event::{ExceptionCode, Fault},
    restore::RestoreRequest,
    snapshot::Snapshot,
};

/// What an operator asks. [`CommandStatus`] says what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Chosen by the terminal, which finds the outcome by it in a later snapshot.
    pub id: CommandId,
    /// The run of the station whose snapshot it was made on, see [`Snapshot::run`]. The ids in `kind` mean nothing in
    /// another run: the plant file may have changed.
    pub run: u64,
    /// What to do, to what and with which value.
    pub kind: CommandKind,
    /// The value that the operator saw when confirming a write. A write over another value is refused.
    pub expected_value: Option<f64>,
    /// The operator's reason.
    pub note: Option<Arc<str>>,
}

impl Command {
    /// A command without expected value and note.
    pub fn new(run: u64, id: CommandId, kind: CommandKind) -> Command {
        Command { id, run, kind, expected_value: None, note: None }
    }

    /// A command on the plant as a snapshot shows it.
    pub fn on(snapshot: &Snapshot, id: CommandId, kind: CommandKind) -> Command {
        Command { expected_value: snapshot.expected_value(&kind), ..Command::new(snapshot.run, id, kind) }
    }
}

impl From<CommandKind> for Command {
    /// A command that the terminal has not numbered yet.
    fn from(kind: CommandKind) -> Command {
        Command::new(0, CommandId::default(), kind)
    }
}

/// Identifies a command: the terminal's number and its running count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct CommandId {
    /// Which terminal.
    pub terminal: u32,
    /// Its running count.
    pub number: u32,
}

/// What a command does, to what and with which value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum CommandKind {
    /// Write a value, in the tag's unit, and verify it.
    Write {
        /// What.
        tag: TagId,
        /// The new value.
        value: f64,
    },
    /// Acknowledge, silence, reset, shelve: what is done with alarms.
    Alarm(AlarmCommand),
    /// Read all tags of a device now.
    Refresh(DeviceId),
    /// Open (`true`) or close a line.
    Connect(LineId, bool),
    /// Try other settings on the line of the same id, until the station ends or they are saved or taken back.
    Configure(Box<LineDef>),
    /// Write the settings in use into the plant file.
    SaveSettings(LineId),
    /// Test a line.
    Test(LineId, Diagnostic),
    /// Stop the test of a line.
    StopTest(LineId),
    /// Read the folder of parameter sets anew.
    ReadSets,
    /// Save what a device holds as a parameter set.
    SaveSet {
        /// Of which device.
        device: DeviceId,
        /// Under which name.
        name: Arc<str>,
        /// A set of this name may be there already.
        replace: bool,
    },
    /// Write a parameter set to a device: what differs, one verified write after the other.
    Restore(Box<RestoreRequest>),
    /// Stop the restore of a device after the write under way.
    StopRestore(DeviceId),
    /// Hand the plant over to the next shift; the note of the command tells it what to know.
    HandOver,
    /// Take the plant over from the shift before.
    TakeOver,
}

impl CommandKind {
    /// The tag and the value that it writes, if it writes one.
    pub fn written(&self) -> Option<(TagId, f64)> {
        match self {
            CommandKind::Write { tag, value } => Some((*tag, *value)),
            CommandKind::Alarm(_)
            | CommandKind::Refresh(_)
            | CommandKind::Connect(..)
            | CommandKind::Configure(_)
            | CommandKind::SaveSettings(_)
            | CommandKind::Test(..)
            | CommandKind::StopTest(_)
            | CommandKind::ReadSets
            | CommandKind::SaveSet { .. }
            | CommandKind::Restore(_)
            | CommandKind::StopRestore(_)
            | CommandKind::HandOver
            | CommandKind::TakeOver => None,
        }
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
    pub old: Option<f64>,
    /// Its outcome by now.
    pub outcome: Outcome,
    /// Its end is in the audit log, on disk. Said of ended commands only.
    pub recorded: bool,
}

impl CommandStatus {
    /// A pending command.
    pub fn new(command: Command, by: impl Into<Arc<str>>, at: Timestamp) -> CommandStatus {
        let (by, from, outcome) = (by.into(), "".into(), Outcome::Pending);
        CommandStatus { command, by, from, at, old: None, outcome, recorded: true }
    }

    /// Has it no outcome yet?
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
    /// Not done, and certainly without effect on what was to be written; a key that was sent before it has a line of its own
    /// in the journal.
    Refused(Refusal),
    /// A write that may or may not have taken effect, or has taken another one than was requested.
    NotConfirmed(NotConfirmed),
    /// No answer to what is no write.
    Failed(Fault),
}

impl Outcome {
    /// The outcome without its reason, the same on screen, in the history and in CSV.
    pub fn label(&self) -> &'static str {
        match self {
            Outcome::Pending => "pending",
            Outcome::Verified => "verified",
            Outcome::Unchanged => "unchanged",
            Outcome::Refused(_) => "refused",
            Outcome::NotConfirmed(_) => "not confirmed",
            Outcome::Failed(_) => "failed",
        }
    }
}

/// The label with the reason: `refused: read only`.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.label())?;
        match self {
            Outcome::Pending | Outcome::Verified => Ok(()),
            Outcome::Unchanged => f.write_str(", not written"),
            Outcome::Refused(why) => write!(f, ": {why}"),
            Outcome::NotConfirmed(why) => write!(f, ": {why}"),
            Outcome::Failed(fault) => write!(f, ": {fault}"),
        }
    }
}

/// Why a command was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum Refusal {
    /// His role does not permit it, or nobody is logged in.
    #[error("{0}")]
    NotPermitted(String),
    /// The tag requires a password or a second user, which is missing or wrong.
    #[error("{0}")]
    NotReauthenticated(String),
    /// Somebody or something has changed the value since the operator looked; this is what it is now.
    #[error("it was changed to {0} since you looked")]
    ChangedTo(String),
    /// The command does not say which value it replaces; this is what it is now.
    #[error("it is {0} now; look and confirm again")]
    NotSeen(String),
    /// The profile says read-only.
    #[error("read only")]
    ReadOnly,
    /// Not a number, or outside the permitted range.
    #[error("outside {min} … {max}")]
    OutOfRange {
        /// Lowest permitted, as text in the tag's unit; `−∞` if none.
        min: String,
        /// Highest permitted.
        max: String,
    },
    /// A bound, the decimals or the present value is not known, so the write cannot be checked.
    #[error("{0} is not known")]
    Unknown(String),
    /// Not one of the values of the enumeration.
    #[error("not one of the values of this tag")]
    NotAChoice,
    /// The device said no.
    #[error("{0}")]
    Exception(ExceptionCode),
    /// Nothing was sent: line closed, device in backoff.
    #[error("{0}")]
    NotSent(Fault),
    /// The station's queue to the line is full.
    #[error("line too busy")]
    Busy,
    /// Another write to this tag is still under way.
    #[error("a write to this tag is under way")]
    UnderWay,
    /// It still waited when a stop of the same tag came, and would have undone it.
    #[error("a stop came before it, nothing was sent")]
    Overtaken,
    /// The plant file knows that it would have no effect now.
    #[error("interlock: {0}")]
    Interlock(String),
    /// A parameter set cannot be written to this device.
    #[error("{0}")]
    NotFit(String),
    /// What was confirmed is not what would be written now.
    #[error("the device has changed since you looked; look again")]
    Changed,
    /// What a step of a restore would write over is another value than the one that was confirmed.
    #[error("changed since you confirmed")]
    ChangedSince,
    /// What a step of a restore would write over is not known.
    #[error("not known now")]
    NotKnownNow,
    /// The settings of the line were changed while a restore was at work.
    #[error("the settings of the line were changed meanwhile")]
    LineChanged,
    /// The device had to be read before a restore, and was not in time.
    #[error("the device could not be read within {0} s")]
    NotRead(u64),
    /// Stopped by an operator before anything was written.
    #[error("stopped before anything was written")]
    Stopped,
    /// The settings could not be written into the plant file, or a parameter set into its folder.
    #[error("not saved: {0}")]
    NotSaved(String),
    /// No line has this name and place.
    #[error("no such line")]
    NotALine,
    /// Settings or a test that a line cannot have.
    #[error("{0}")]
    NotValid(String),
    /// What was requested of an alarm makes no sense or is not allowed.
    #[error("{0}")]
    Alarm(AlarmRefusal),
}

/// Why a write is not confirmed.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
pub enum NotConfirmed {
    /// No valid answer: it may or may not have taken effect.
    #[error("{0}; it may have taken effect")]
    NotAnswered(Fault),
    /// No valid answer, and the device holds another value.
    #[error("no answer, not applied: the device holds {0}")]
    NotApplied(f64),
    /// Read back, and different.
    #[error("read back {0}")]
    Different(f64),
    /// Could not be read back.
    #[error("not read back: {0}")]
    NotRead(Fault),
    /// Of several writes only some are done.
    #[error("{0}")]
    Partly(String),
    /// The station was stopped before anybody answered for it.
    #[error("the station stopped; it may have taken effect")]
    StationStopped,
    /// The terminal has lost the station before it knew the outcome.
    #[error("connection to the station lost; it may have taken effect")]
    ConnectionLost,
    /// The profile wants no read-back.
    #[error("accepted, not read back")]
    NoReadBack,
}

/// A checked write of one tag, as the bus performs it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WriteJob {
    /// Identifies the write in events.
    pub id: WriteId,
    /// The tag to write.
    pub tag: TagId,
    /// The raw number, already unscaled.
    pub raw: f64,
    /// A key to write first (tag and raw number), if the device needs unlocking.
    pub unlock: Option<(TagId, f64)>,
    /// Read the value back afterwards.
    pub verify: bool,
    /// It switches something off and goes before all that waits, see [`super::interlock::is_stop`].
    pub urgent: bool,
}

/// What the plant asks of a link task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum BusRequest {
    /// Write one tag once, then read it back. Answered by [`super::event::Event::Wrote`].
    Write(WriteJob),
    /// Read every block of a device as soon as possible.
    Refresh {
        /// Which.
        device: DeviceId,
        /// The command it comes by; `None` for one of the plant itself.
        command: Option<CommandId>,
    },
    /// Open or close the port.
    Connect(bool),
    /// Use these settings from now on.
    Configure(Box<LineDef>),
    /// Start a diagnostic; the one at work is stopped.
    Test {
        /// The command it comes by.
        id: CommandId,
        /// Who requested it.
        by: Arc<str>,
        /// What.
        diagnostic: Diagnostic,
    },
    /// Stop the running diagnostic.
    StopTest,
}
