//! Faults of the station itself: its history, its disk, its files, its clock.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

/// The name of the station as the subject of its alarms.
pub const STATION: &str = "station";
keyword_enum! {
    /// A fault of the station itself.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum StationFault: "station fault" {
        /// The history takes no records; they wait in memory.
        NotRecording => "history not recording",
        /// Records were dropped.
        RecordsLost => "history records lost",
        /// A part of the history is damaged, missing or set aside.
        HistoryDamaged => "history damaged",
        /// Closed hours are not archived.
        NotArchived => "history not archived",
        /// The disk of the history is nearly full.
        DiskSpace => "disk nearly full",
        /// The audit log cannot be written or sealed, or is damaged.
        AuditLog => "audit log fault",
        /// The alarm state cannot be saved.
        AlarmState => "alarm state not saved",
        /// The users file is missing or cannot be read.
        UsersFile => "users file unusable",
        /// The clock has stepped, or is behind the last record.
        Clock => "clock wrong or stepped",
        /// The task of a line ended by itself and was started again.
        LineTask => "line task restarted",
        /// A report was not made or not delivered.
        Reports => "automatic report fault",
        /// What is stored has not reached the broker for too long, or the broker refuses it.
        DataOut => "data out delayed",
        /// A procedure has failed, or the station stopped meanwhile.
        Procedure => "procedure failed",
    }
}

/// What is known of a fault.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum FaultState {
    /// It lasts, with the details for the operator.
    Active(Arc<str>),
    /// It happened: the alarm is raised, returns by itself and waits for an acknowledgement.
    Occurred(Arc<str>),
    /// It is over.
    Cleared,
}

impl FaultState {
    /// It lasts as long as there are words for it.
    pub fn lasting(words: Option<String>) -> FaultState {
        words.map_or(FaultState::Cleared, |words| FaultState::Active(words.into()))
    }
}
