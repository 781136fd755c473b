//! Each fault of the station itself is an alarm that every plant has.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use super::{
    alarm_def::{AlarmClass, AlarmDef, Condition, Guidance, Priority, Subject},
    id::AlarmId,
    station_fault::{FaultState, StationFault},
};

/// Ticks for which a fault that has merely occurred is active.
const OCCURRED_TICKS: u8 = 10;

impl StationFault {
    fn priority(self) -> Priority {
        match self {
            StationFault::NotArchived
            | StationFault::DiskSpace
            | StationFault::Clock
            | StationFault::Reports
            | StationFault::DataOut => Priority::Medium,
            _ => Priority::High,
        }
    }

    /// A commit that fails once is retried before anyone is alarmed.
    fn on_delay(self) -> Duration {
        match self {
            StationFault::NotRecording => Duration::from_secs(3),
            _ => Duration::ZERO,
        }
    }

    /// Likely cause, effect, action.
    fn guidance(self) -> [&'static str; 3] {
        match self {
            StationFault::NotRecording => [
                "the disk is full or read-only, the history is used by another process, or its folder is missing",
                "values, alarms and actions are buffered in memory; a full buffer or a power failure loses them",
                "read the details in the banner, free the disk or the file; recording resumes automatically",
            ],
            StationFault::RecordsLost => [
                "the buffer was full: the disk was too slow, or the history did not record for too long",
                "trends and reports have a gap; values and alarms on the screen are correct",
                "note the time in the handover; find the cause of the slow or full disk",
            ],
            StationFault::HistoryDamaged => [
                "a power failure, a failing disk, or a file that was changed, moved or removed manually",
                "a part of the history is missing; recording continues in a new file",
                "bring back what is sound with `sightglass history restore PLANT --set-aside`; check the disk (SMART) and the power supply",
            ],
            StationFault::NotArchived => [
                "the disk is full or read-only, or a part of the history cannot be read",
                "nothing is lost: samples stay in the database, which grows and answers more slowly",
                "free the disk; run `sightglass history verify PLANT`; archiving resumes automatically",
            ],
            StationFault::DiskSpace => [
                "the history, reports or other files have grown",
                "when the disk is full, records wait in memory and are lost when the buffer is full",
                "move old reports and set-aside files away, or give the history a larger disk",
            ],
            StationFault::AuditLog => [
                "the disk is full or read-only, or the file or its sealing key was changed, moved or removed manually",
                "actions are executed, but not recorded, or their records could be changed unnoticed, until it is repaired",
                "free the disk; run `sightglass audit verify`; restore the sealing key, or create one with `audit key`",
            ],
            StationFault::AlarmState => [
                "the disk is full or read-only",
                "after a restart, acknowledged alarms may be unacknowledged again",
                "free the disk; saving resumes automatically",
            ],
            StationFault::UsersFile => [
                "the file is damaged, missing, or not readable by the station",
                "login is disabled; polling and alarms continue",
                "restore the users file from a backup and reload the station",
            ],
            StationFault::Clock => [
                "the clock was set, its battery is empty, or time synchronisation is missing",
                "times in trends, reports and the audit log may be wrong",
                "check date, time and time synchronisation",
            ],
            StationFault::LineTask => [
                "an error in the program; the log has the details",
                "the line was not polled for some seconds",
                "check that its values are good again; report the error with the log",
            ],
            StationFault::Reports => [
                "the folder of the reports is full, missing or read-only, or the command after a report fails",
                "the history has all figures; a report is missing in its folder or at its recipients",
                "read the details; free the disk or repair the command; what is missing is made automatically",
            ],
            StationFault::DataOut => [
                "the broker or the network is down, the broker refuses the station, or the history does not record",
                "systems that receive the values see old ones; nothing is lost, the history has all of them",
                "read the details; check network, broker, user and password; what is missing is sent automatically",
            ],
            StationFault::Procedure => [
                "a write was refused or not verified, a condition was not true in time, or the station stopped meanwhile",
                "the procedure has ended; the plant is in its safe state only where the details say so",
                "read the details; what is missing is written once its device answers",
            ],
        }
    }

    /// Its alarm.
    pub fn alarm(self, id: AlarmId) -> AlarmDef {
        AlarmDef {
            priority: self.priority(),
            class: AlarmClass::System,
            on_delay: self.on_delay(),
            guidance: Guidance::new(self.guidance(), Some(Duration::from_secs(600))),
            ..AlarmDef::new(id, Subject::Station, Condition::Station(self), self.word())
        }
    }
}

/// The faults of the station as they stand.
#[derive(Debug, Clone, Default)]
pub struct StationFaults {
    /// Those that are active; `Some` counts the ticks that are left.
    active: BTreeMap<StationFault, Option<u8>>,
    /// What is known about each, the last that was active.
    pub details: Arc<BTreeMap<StationFault, Arc<str>>>,
}

impl StationFaults {
    /// Takes what is known of a fault.
    pub fn set(&mut self, fault: StationFault, state: FaultState) {
        let (details, ticks) = match state {
            FaultState::Active(details) => (details, None),
            // What lasts is not ended by what merely occurs beside it.
            FaultState::Occurred(details) if self.active.get(&fault) == Some(&None) => (details, None),
            FaultState::Occurred(details) => (details, Some(OCCURRED_TICKS)),
            FaultState::Cleared => {
                self.active.remove(&fault);
                return;
            }
        };
        self.active.insert(fault, ticks);
        if self.details.get(&fault) != Some(&details) {
            Arc::make_mut(&mut self.details).insert(fault, details);
        }
    }

    /// A second has passed, whatever the clock says.
    pub fn tick(&mut self) {
        self.active.retain(|_, ticks| match ticks {
            Some(0) => false,
            Some(left) => {
                *left -= 1;
                true
            }
            None => true,
        });
    }

    /// Is it active until it is cleared?
    pub fn is_lasting(&self, fault: StationFault) -> bool {
        self.active.get(&fault) == Some(&None)
    }

    /// Is it active?
    pub fn is_active(&self, fault: StationFault) -> bool {
        self.active.contains_key(&fault)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_fault_that_occurred_ends_by_itself() {
        let mut faults = StationFaults::default();
        faults.set(StationFault::Clock, FaultState::Occurred("set back".into()));
        faults.set(StationFault::DiskSpace, FaultState::Active("3 % free".into()));
        let active =
            |faults: &StationFaults| (faults.is_active(StationFault::Clock), faults.is_active(StationFault::DiskSpace));
        assert_eq!(active(&faults), (true, true));
        (0..=OCCURRED_TICKS).for_each(|_| faults.tick());
        assert_eq!(active(&faults), (false, true));
        faults.set(StationFault::DiskSpace, FaultState::Cleared);
        assert_eq!(active(&faults), (false, false));
        assert_eq!(&*faults.details[&StationFault::Clock], "set back", "kept for the alarm that waits");
    }
}
