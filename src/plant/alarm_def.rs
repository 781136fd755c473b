//! What a plant file says about an alarm: condition, priority, delays, guidance.

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

pub use super::condition::{Condition, Level};
use super::{
    expr::Expr,
    id::{AlarmId, DeviceId, LineId, TagId},
    keyword::keyword_enum,
};

/// An alarm: a condition on a tag, device or line, with what the operator should know and do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AlarmDef {
    /// Its place.
    pub id: AlarmId,
    /// Its `id` in the plant file: the same alarm under whatever name.
    pub key: Option<Arc<str>>,
    /// What it watches.
    pub subject: Subject,
    /// When it is active.
    pub condition: Condition,
    /// How urgent.
    pub priority: Priority,
    /// The process, or the system that watches it.
    pub class: AlarmClass,
    /// Part of the plant that it belongs to: `TK-1`; empty if the file does not say.
    pub area: String,
    /// The condition must hold this long before the alarm is raised.
    pub on_delay: Duration,
    /// The condition must be gone this long before the alarm returns.
    pub off_delay: Duration,
    /// Acknowledged and still active after this time, it waits for an acknowledgement again.
    pub re_alarm: Option<Duration>,
    /// Once raised it stays in the list until it is reset, also when the condition is gone.
    pub latch: bool,
    /// Whoever acknowledges it must write a note.
    pub ack_comment: bool,
    /// While this is certainly false the alarm is suppressed by design.
    pub enabled_when: Option<Expr>,
    /// `temperature high`.
    pub message: String,
    /// Cause, effect, action.
    pub guidance: Guidance,
}

impl AlarmDef {
    /// A process alarm of high priority without delays, latch, suppression or guidance.
    pub fn new(id: AlarmId, subject: Subject, condition: Condition, message: impl Into<String>) -> AlarmDef {
        AlarmDef {
            id,
            key: None,
            subject,
            condition,
            priority: Priority::High,
            class: AlarmClass::Process,
            area: String::new(),
            on_delay: Duration::ZERO,
            off_delay: Duration::ZERO,
            re_alarm: None,
            latch: false,
            ack_comment: false,
            enabled_when: None,
            message: message.into(),
            guidance: Guidance::default(),
        }
    }
}

/// What holds for all alarms of a plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct AlarmRules {
    /// An alarm can be shelved for at most this long.
    pub shelve_max: Duration,
    /// An alarm that is raised within this time after the first of a first-out group of its line belongs to it.
    pub first_out_window: Duration,
}

impl Default for AlarmRules {
    /// A shift of eight hours, and ten seconds.
    fn default() -> Self {
        AlarmRules { shelve_max: Duration::from_secs(8 * 3600), first_out_window: Duration::from_secs(10) }
    }
}

keyword_enum! {
    /// What an alarm is about. System alarms are listed apart, so that they do not flood the process list.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum AlarmClass: "class of alarms" {
        /// The process.
        Process => "process",
        /// What watches it: devices, lines.
        System => "system",
    }
}

/// What an alarm watches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Subject {
    /// A tag.
    Tag(TagId),
    /// A device as a whole.
    Device(DeviceId),
    /// A line as a whole.
    Line(LineId),
    /// The station itself.
    Station,
}

keyword_enum! {
    /// Priority of an alarm, the most urgent first.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum Priority: "priority" {
        /// `[1]!`
        Critical = 1 => "critical",
        /// `‹2›!`
        High = 2 => "high",
        /// `(3)`
        Medium = 3 => "medium",
        /// ` 4 `
        Low = 4 => "low",
    }
}

impl Priority {
    /// 1 (critical) to 4 (low).
    pub fn number(self) -> u8 {
        self as u8
    }
}

/// What an operator should know about an alarm. Empty strings where the profile is silent.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Guidance {
    /// Likely causes.
    pub cause: String,
    /// What happens if nothing is done.
    pub effect: String,
    /// What to do.
    pub action: String,
    /// How soon.
    pub response_time: Option<Duration>,
}

impl Guidance {
    /// Likely cause, effect, action.
    pub fn new([cause, effect, action]: [&str; 3], response_time: Option<Duration>) -> Guidance {
        Guidance { cause: cause.into(), effect: effect.into(), action: action.into(), response_time }
    }

    /// The steps of the action, which its text separates by semicolons.
    pub fn steps(&self) -> impl Iterator<Item = &str> {
        self.action.split(';').map(str::trim).filter(|step| !step.is_empty())
    }
}
