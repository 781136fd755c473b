//! What an operator wants, how it travels to the bus, and how it ended.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::id::WriteId;
use super::{
    alarm::{AlarmCommand, AlarmRefusal},
    def::{DeviceId, LineDef, LineId, TagId},
    diagnostics::Diagnostic,
    event::{ExceptionCode, Fault},
    restore::RestoreRequest,
};

/// What one operator asks, once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// Chosen by the terminal, so that it finds the outcome in a later snapshot.
    pub id: CommandId,
    /// Who asks.
    pub by: Arc<str>,
    /// From where: `pts/3 from 10.0.0.5, user panel`; empty for the station itself.
    pub from: Arc<str>,
    /// What.
    pub kind: CommandKind,
    /// The value of the tag to be written that he saw when he confirmed.
    pub seen: Option<f64>,
    /// Why, in his words.
    pub note: Option<Arc<str>>,
    /// Why he may not: it is only put on record.
    pub refused: Option<Refusal>,
}

impl Command {
    /// A command that may be carried out, without note.
    pub fn new(id: CommandId, by: impl Into<Arc<str>>, kind: CommandKind) -> Command {
        Command { id, by: by.into(), from: "".into(), kind, seen: None, note: None, refused: None }
    }
}

/// Identifies a command: the terminal's number and its running count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
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

/// How a command stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CommandStatus {
    /// Which.
    pub id: CommandId,
    /// Who.
    pub by: Arc<str>,
    /// From where.
    pub from: Arc<str>,
    /// Why, in his words.
    pub note: Option<Arc<str>>,
    /// What was requested.
    pub kind: CommandKind,
    /// When it was taken.
    pub at: Timestamp,
    /// The tag's value when it was taken, for a write.
    pub old: Option<f64>,
    /// How it stands.
    pub outcome: Outcome,
    /// Its end is in the audit log, on disk. Said of ended commands only.
    pub recorded: bool,
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

/// What the plant asks of a link task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum BusRequest {
    /// Write one tag once, then read it back.
    Write {
        /// Answered by [`super::event::Event::Wrote`].
        id: WriteId,
        /// What.
        tag: TagId,
        /// The raw number, already unscaled.
        raw: f64,
        /// Another tag to write first (raw), if the device needs unlocking.
        unlock: Option<(TagId, f64)>,
        /// Read it back afterwards.
        verify: bool,
        /// It switches something off: it goes before all that waits, see [`super::interlock::is_stop`].
        urgent: bool,
    },
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
