//! What the plant leaves behind for the history: samples, alarm events, operator actions, minutes of lines, batches, runs.

use std::{fmt, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    batch::BatchRecord,
    control_run::ControlRun,
    def::{Priority, TagId},
    exact::Exact,
    keyword::{Keyword, keyword_enum},
    line_minute::LineMinute,
    recorded_action::RecordedAction,
    report::ReportRecord,
    sample::Sample,
};

/// One line of the history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// A stored sample.
    Sample(TagId, Sample),
    /// An alarm event.
    Alarm(AlarmRecord),
    /// An operator action.
    Action(ActionRecord),
    /// A minute of a line.
    Line(LineMinute),
    /// A change of a batch.
    Batch(BatchRecord),
    /// A control run as it stands.
    Run(Box<ControlRun>),
    /// An event of an automatic report.
    Report(ReportRecord),
    /// The system clock was set: what follows is of the next epoch, whatever its times say.
    ClockSet,
}

/// An alarm event as it is journaled. Names, not ids: a journal outlives the plant file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AlarmRecord {
    /// When.
    pub at: Timestamp,
    /// Full name of the tag or device: `TIC-1.PV`.
    pub subject: Arc<str>,
    /// `temperature high`.
    pub message: Arc<str>,
    /// How urgent.
    pub priority: Priority,
    /// What happened.
    pub event: AlarmEvent,
    /// The value at that moment, in the tag's unit.
    pub value: Option<Exact>,
    /// The limit, in the tag's unit.
    pub limit: Option<f64>,
    /// Who, for what an operator did.
    pub by: Option<Arc<str>>,
    /// The note of an acknowledgement, the reason for suppressing it.
    pub reason: Option<Arc<str>>,
    /// When a shelved alarm comes back.
    pub until: Option<Timestamp>,
    /// Its place among the alarms that were raised together.
    pub first_out: Option<FirstOut>,
    /// Which alarm it is, however it is called; the state file keeps it, the journal does not.
    #[serde(default)]
    pub identity: Option<AlarmIdentity>,
}

impl AlarmRecord {
    /// An event without operator, value and limit.
    pub fn new(at: Timestamp, subject: &str, message: &str, priority: Priority, event: AlarmEvent) -> AlarmRecord {
        let (subject, message) = (subject.into(), message.into());
        let (value, limit, by, reason, until, first_out, identity) = (None, None, None, None, None, None, None);
        AlarmRecord { at, subject, message, priority, event, value, limit, by, reason, until, first_out, identity }
    }
}

/// What an alarm is, apart from its wording: two plant files have the same alarm where these are the same.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AlarmIdentity {
    /// Its `id` in the plant file, else subject and condition: `TIC-1.PV high`.
    pub name: Arc<str>,
    /// What is watched by its line, unit and register, with the condition: known under any name. `None` where another alarm
    /// of its plant file is there too.
    #[serde(default)]
    pub place: Option<Arc<str>>,
    /// It stays until it is reset.
    pub latches: bool,
}

/// The place of an alarm among those that were raised within a short time of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FirstOut {
    /// When the first of them was raised; identifies the group.
    pub began: Timestamp,
    /// From 1: the first-out, which is likely to be the cause of the others.
    pub rank: u32,
}

keyword_enum! {
    /// What happens to an alarm. The words are what the history and CSV hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum AlarmEvent: "alarm event" {
        /// It became active and was annunciated.
        Raised => "raised",
        /// An operator acknowledged it.
        Acknowledged => "acknowledged",
        /// The condition is gone.
        ReturnedToNormal => "RTN",
        /// It became active while suppressed: not annunciated.
        RaisedSuppressed => "raised (suppressed)",
        /// Its condition cleared while suppressed.
        ReturnedSuppressed => "RTN (suppressed)",
        /// Acknowledged long ago and still active: it waits for an acknowledgement again.
        ReAlarmed => "re-alarmed",
        /// An operator reset it after its condition was gone.
        Reset => "reset",
        /// An operator shelved it.
        Shelved => "shelved",
        /// Its time on the shelf is over, or an operator took it back.
        Unshelved => "unshelved",
        /// What enables it became false.
        SuppressedByDesign => "suppressed by design",
        /// What enables it is no longer false.
        Unsuppressed => "unsuppressed",
        /// An operator took it out of service.
        OutOfService => "out of service",
        /// An operator put it back.
        InService => "in service",
        /// An operator did a step of its action; the reason of the event is the step.
        StepDone => "step done",
        /// The operator took that back.
        StepUndone => "step undone",
        /// The plant file has it no more, or has it by another name, which is the reason of the event.
        Removed => "removed with the plant file",
        /// It goes on under another name: the alarm whose name is the reason of the event, no new activation.
        CarriedOver => "carried over",
    }
}

impl AlarmEvent {
    /// Does it belong to an alarm that is not annunciated?
    pub fn is_suppressed(self) -> bool {
        matches!(self, AlarmEvent::RaisedSuppressed | AlarmEvent::ReturnedSuppressed)
    }

    /// Nothing was annunciated: it began or ended a suppression by design, or happened to an alarm that is suppressed. Lists
    /// count these and show the others.
    pub fn is_quiet(self) -> bool {
        self.is_suppressed() || matches!(self, AlarmEvent::SuppressedByDesign | AlarmEvent::Unsuppressed)
    }

    /// Is it about a step of the action?
    pub fn is_of_step(self) -> bool {
        matches!(self, AlarmEvent::StepDone | AlarmEvent::StepUndone)
    }

    /// Is the condition of its alarm active from here on? `None`: as before.
    pub fn active(self) -> Option<bool> {
        match self {
            AlarmEvent::Raised | AlarmEvent::RaisedSuppressed | AlarmEvent::CarriedOver => Some(true),
            AlarmEvent::ReturnedToNormal | AlarmEvent::ReturnedSuppressed | AlarmEvent::Removed => Some(false),
            AlarmEvent::Acknowledged
            | AlarmEvent::ReAlarmed
            | AlarmEvent::Reset
            | AlarmEvent::Shelved
            | AlarmEvent::Unshelved
            | AlarmEvent::SuppressedByDesign
            | AlarmEvent::Unsuppressed
            | AlarmEvent::OutOfService
            | AlarmEvent::InService
            | AlarmEvent::StepDone
            | AlarmEvent::StepUndone => None,
        }
    }

    /// The event that takes this one back, where it suppresses: an alarm may be suppressed for several reasons at a time.
    pub fn ended_by(self) -> Option<AlarmEvent> {
        match self {
            AlarmEvent::Shelved => Some(AlarmEvent::Unshelved),
            AlarmEvent::SuppressedByDesign => Some(AlarmEvent::Unsuppressed),
            AlarmEvent::OutOfService => Some(AlarmEvent::InService),
            _ => None,
        }
    }

    /// An active alarm is annunciated no longer: its condition cleared, it was suppressed, or it is there no more.
    pub fn ends_annunciation(self) -> bool {
        self.active() == Some(false) || self.ended_by().is_some()
    }
}

/// An operator action, written when its outcome is known; a write also before it is sent ([`RecordedAction::WriteRequested`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionRecord {
    /// When the command was taken.
    pub at: Timestamp,
    /// Who.
    pub by: Arc<str>,
    /// From where: `pts/3 from 10.0.0.5, user panel`; empty for the station itself.
    pub from: Arc<str>,
    /// `write`, `acknowledge`, `connect`, …
    pub action: Arc<str>,
    /// Tag, alarm, line or device by name.
    pub target: Arc<str>,
    /// Value before, as text with unit.
    pub old: Option<Arc<str>>,
    /// Value requested, as text with unit.
    pub new: Option<Arc<str>>,
    /// `verified`, `refused: …`, `not confirmed: …`, `failed: …`.
    pub outcome: Arc<str>,
    /// Why, in their own words.
    pub note: Option<Arc<str>>,
    /// Its place in the audit log; `None` until it is written.
    pub chain_hash: Option<ChainHash>,
}

impl ActionRecord {
    /// An action of which no more is to be said; from the station itself.
    pub fn new(
        at: Timestamp,
        by: impl Into<Arc<str>>,
        action: RecordedAction,
        target: impl Into<Arc<str>>,
        outcome: impl Into<Arc<str>>,
    ) -> ActionRecord {
        let (by, action, target, outcome) = (by.into(), action.into(), target.into(), outcome.into());
        let (from, old, new, note, chain_hash) = ("".into(), None, None, None, None);
        ActionRecord { at, by, from, action, target, old, new, outcome, note, chain_hash }
    }

    /// What was done; `None` where another version called it so.
    pub fn known_action(&self) -> Option<RecordedAction> {
        RecordedAction::from_word(&self.action)
    }

    /// Did it change the plant, or was it meant to?
    pub fn changes_plant(&self) -> bool {
        self.known_action().is_none_or(RecordedAction::changes_plant)
    }

    /// Was it on the process? See [`RecordedAction::is_on_process`].
    pub fn is_on_process(&self) -> bool {
        RecordedAction::words_beside_process().all(|word| *word != *self.action)
    }

    /// Is it this action?
    pub fn is(&self, action: RecordedAction) -> bool {
        &*self.action == action.word()
    }
}

/// The place of an entry in the hash chain of the audit log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChainHash {
    /// Running number, from 1.
    pub number: u64,
    /// SHA-256 over the line and the hash before it.
    pub hash: [u8; 32],
}

impl ChainHash {
    /// The hash in hexadecimal digits.
    pub fn hash_hex(&self) -> String {
        hex(&self.hash)
    }
}

/// Number and hash: `17 5f0c…`.
impl fmt::Display for ChainHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.number, self.hash_hex())
    }
}

/// Bytes in hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
