//! What the plant leaves behind for the history: samples, steps of alarms, deeds of operators, minutes of lines.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    def::{Priority, TagId},
    line_minute::LineMinute,
    sample::Sample,
};

/// One line of the history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Record {
    /// A stored sample.
    Sample(TagId, Sample),
    /// A step of an alarm.
    Alarm(AlarmRecord),
    /// A deed of an operator.
    Action(ActionRecord),
    /// A minute of a line.
    Line(LineMinute),
}

/// A step in the life of an alarm. Names, not ids: a journal outlives the plant file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AlarmRecord {
    /// When.
    pub at: Timestamp,
    /// Full name of the tag or device: `TIC-1.PV`.
    pub subject: Arc<str>,
    /// `temperature high`.
    pub text: Arc<str>,
    /// How urgent.
    pub priority: Priority,
    /// Which step.
    pub step: AlarmStep,
    /// The value at that moment, in the tag's unit.
    pub value: Option<f64>,
    /// The limit, in the tag's unit.
    pub limit: Option<f64>,
    /// Who, for an acknowledgement.
    pub by: Option<Arc<str>>,
}

/// The steps in the life of an alarm. The words are what the history and CSV hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AlarmStep {
    /// It became active.
    Raised,
    /// An operator acknowledged it.
    Acknowledged,
    /// The condition is gone.
    Returned,
}

impl AlarmStep {
    /// Every step.
    pub const ALL: [AlarmStep; 3] = [AlarmStep::Raised, AlarmStep::Acknowledged, AlarmStep::Returned];
    /// The word in SQL, CSV and on screen.
    pub fn word(self) -> &'static str {
        match self {
            AlarmStep::Raised => "raised",
            AlarmStep::Acknowledged => "acknowledged",
            AlarmStep::Returned => "returned",
        }
    }
    /// The step of a stored word.
    pub fn from_word(word: &str) -> Option<AlarmStep> {
        AlarmStep::ALL.into_iter().find(|step| step.word() == word)
    }
}

/// A deed of an operator, written when its outcome is known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActionRecord {
    /// When the order was taken.
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
    /// Value wished, as text with unit.
    pub new: Option<Arc<str>>,
    /// `verified`, `refused: …`, `not confirmed: …`, `failed: …`.
    pub outcome: Arc<str>,
    /// Why, in his words.
    pub note: Option<Arc<str>>,
    /// Its place in the chained book; `None` until it is there.
    pub seal: Option<Seal>,
}

/// The place of a deed in the chained book.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Seal {
    /// Running number, from 1.
    pub number: u64,
    /// SHA-256 over the line and the seal before it.
    pub hash: [u8; 32],
}
