//! What a plant file says about an alarm: condition, priority, delays, guidance.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::plant::{
    expr::Expr,
    id::{AlarmId, DeviceId, LineId, TagId},
    ne107::Signal,
    station::StationFault,
};

/// An alarm: a condition on a tag, device or line, with what the operator should know and do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AlarmDef {
    /// Its place.
    pub id: AlarmId,
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
    /// An alarm that is raised within this time after another belongs to the same first-out group.
    pub first_out_window: Duration,
}

impl Default for AlarmRules {
    /// A shift of eight hours, and ten seconds.
    fn default() -> Self {
        AlarmRules { shelve_max: Duration::from_secs(8 * 3600), first_out_window: Duration::from_secs(10) }
    }
}

/// Whose trouble an alarm tells. System trouble is kept apart, so that it does not flood the list of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum AlarmClass {
    /// The process.
    Process,
    /// What watches it: devices, lines.
    System,
}

impl AlarmClass {
    /// The word in TOML and on screen.
    pub fn word(self) -> &'static str {
        match self {
            AlarmClass::Process => "process",
            AlarmClass::System => "system",
        }
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

/// When an alarm is active. Limits and deadbands are in the tag's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Condition {
    /// A fixed limit; it returns when the value is back by the deadband.
    Limit {
        /// Which side, which level.
        level: Level,
        /// The limit.
        limit: f64,
        /// How far back inside before it returns.
        deadband: f64,
    },
    /// The value is further than `limit` from another tag (its SV), either side.
    Deviation {
        /// The tag to compare with.
        from: TagId,
        /// Greatest distance.
        limit: f64,
        /// How far back inside before it returns.
        deadband: f64,
    },
    /// A discrete tag has this value.
    State {
        /// The abnormal value.
        is: f64,
    },
    /// This bit of a word is set.
    Bit {
        /// From 0, the lowest.
        bit: u8,
    },
    /// The value rises faster than a limit above 0, or falls faster than one below.
    Rate {
        /// Tag's unit per minute.
        limit: f64,
        /// The time over which the rate is measured.
        over: Duration,
        /// How much slower before it returns, tag's unit per minute.
        deadband: f64,
    },
    /// The value has stayed within `deadband` for so long, as if stuck.
    NoChange {
        /// So long.
        lasts: Duration,
        /// What is no change.
        deadband: f64,
    },
    /// There has been no good value for so long.
    NoUpdate {
        /// So long.
        lasts: Duration,
    },
    /// The value has changed so often within a time.
    Changes {
        /// So often, 2 to 100.
        count: u32,
        /// Within this time.
        within: Duration,
        /// What is no change.
        deadband: f64,
    },
    /// The device does not answer, or gives no values.
    NotAnswering,
    /// The device has this signal of NE 107.
    Health {
        /// Which.
        signal: Signal,
    },
    /// The line is not connected although it should be.
    NotConnected,
    /// The line has no time for all of its polls: some are read less often.
    Overloaded,
    /// The station has this fault.
    Station(StationFault),
}

impl Condition {
    /// Looks back in time: begins anew when the alarm is enabled.
    pub fn looks_back(self) -> bool {
        match self {
            Condition::Rate { .. }
            | Condition::NoChange { .. }
            | Condition::NoUpdate { .. }
            | Condition::Changes { .. } => true,
            Condition::Limit { .. }
            | Condition::Deviation { .. }
            | Condition::State { .. }
            | Condition::Bit { .. }
            | Condition::NotAnswering
            | Condition::Health { .. }
            | Condition::NotConnected
            | Condition::Overloaded
            | Condition::Station(_) => false,
        }
    }

    /// The tag that the value is compared with.
    pub fn reference(self) -> Option<TagId> {
        match self {
            Condition::Deviation { from, .. } => Some(from),
            Condition::Limit { .. }
            | Condition::State { .. }
            | Condition::Bit { .. }
            | Condition::Rate { .. }
            | Condition::NoChange { .. }
            | Condition::NoUpdate { .. }
            | Condition::Changes { .. }
            | Condition::NotAnswering
            | Condition::Health { .. }
            | Condition::NotConnected
            | Condition::Overloaded
            | Condition::Station(_) => None,
        }
    }

    /// The limit that stands on the scale of the value itself.
    pub fn on_scale(self) -> Option<f64> {
        match self {
            Condition::Limit { limit, .. } => Some(limit),
            Condition::Deviation { .. }
            | Condition::State { .. }
            | Condition::Bit { .. }
            | Condition::Rate { .. }
            | Condition::NoChange { .. }
            | Condition::NoUpdate { .. }
            | Condition::Changes { .. }
            | Condition::NotAnswering
            | Condition::Health { .. }
            | Condition::NotConnected
            | Condition::Overloaded
            | Condition::Station(_) => None,
        }
    }
}

/// The four levels of a limit alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Level {
    /// Above the high-high limit.
    HighHigh,
    /// Above the high limit.
    High,
    /// Below the low limit.
    Low,
    /// Below the low-low limit.
    LowLow,
}

/// Priority of an alarm, the most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Priority {
    /// `[1]!`
    Critical,
    /// `‹2›!`
    High,
    /// `(3)`
    Medium,
    /// ` 4 `
    Low,
}

impl Priority {
    /// 1 (critical) to 4 (low).
    pub fn number(self) -> u8 {
        match self {
            Priority::Critical => 1,
            Priority::High => 2,
            Priority::Medium => 3,
            Priority::Low => 4,
        }
    }
    /// The word in TOML, SQL, CSV and on screen.
    pub fn word(self) -> &'static str {
        match self {
            Priority::Critical => "critical",
            Priority::High => "high",
            Priority::Medium => "medium",
            Priority::Low => "low",
        }
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
