//! Audit entries of the station itself: start, stop, plant file, users file, clock steps.

use std::sync::Arc;

use jiff::Timestamp;

use crate::{
    access::{Users, audit_log::sha256, io::audit_log::Opened},
    plant::{record::ActionRecord, recorded_action::RecordedAction},
    profile::PlantFile,
};

/// The hashes of plant file and users file that were recorded last.
#[derive(Debug, Default)]
pub(super) struct RecordedFiles {
    plant: Option<Arc<str>>,
    plant_since: Option<Timestamp>,
    users: Option<Arc<str>>,
}

impl RecordedFiles {
    pub fn new(opened: &Opened) -> RecordedFiles {
        let (plant, plant_since) = (opened.plant_file.clone(), opened.plant_file_since);
        RecordedFiles { plant, plant_since, users: opened.users_file.clone() }
    }

    /// Since when the plant file is as it is now; `None` if it is not the last one recorded.
    pub fn plant_file_since(&self, file: Option<&PlantFile>) -> Option<Timestamp> {
        let same = file.is_some_and(|file| self.plant.as_deref() == Some(&sha256(file.bytes())));
        self.plant_since.filter(|_| same)
    }

    /// The first entries of a station: its start, then plant file and users if they differ from the last ones recorded. `users`
    /// is their [`crate::access::Users::digest`]; `None` without login.
    pub fn started(
        &mut self,
        plant: &str,
        file: Option<&PlantFile>,
        users: Option<String>,
        at: Timestamp,
    ) -> Vec<ActionRecord> {
        let version = concat!("sightglass ", env!("CARGO_PKG_VERSION"));
        let start =
            ActionRecord { new: Some(version.into()), ..entry(at, RecordedAction::StartStation, plant, "done") };
        let changed = file.and_then(|file| self.plant_file(file, at));
        let users = users.and_then(|users| self.users_file(users, at));
        [start].into_iter().chain(changed).chain(users).collect()
    }

    /// Were there users when they were recorded last?
    pub fn had_users(&self) -> bool {
        self.users.as_ref().is_some_and(|users| **users != *Users::default().digest())
    }

    /// The entry of users that were found in their file; `None` if they are the last ones recorded.
    pub fn users_file(&mut self, digest: String, at: Timestamp) -> Option<ActionRecord> {
        let change = replace(&mut self.users, digest)?;
        Some(with_change(entry(at, RecordedAction::UsersFile, "users", "done: found"), change))
    }

    /// The entry of a plant file; `None` if it is the last one recorded.
    pub fn plant_file(&mut self, file: &PlantFile, at: Timestamp) -> Option<ActionRecord> {
        let change = replace(&mut self.plant, sha256(file.bytes()))?;
        Some(with_change(entry(at, RecordedAction::PlantFile, &file.path().display().to_string(), "done"), change))
    }
}

/// The old hash and the new one.
type Change = (Option<Arc<str>>, Arc<str>);

/// Replaces a hash; `None` if it is the same.
fn replace(recorded: &mut Option<Arc<str>>, new: String) -> Option<Change> {
    let new: Arc<str> = new.into();
    (recorded.as_ref() != Some(&new)).then(|| (recorded.replace(new.clone()), new))
}

fn with_change(entry: ActionRecord, (old, new): Change) -> ActionRecord {
    ActionRecord { old, new: Some(new), ..entry }
}

/// The system clock was set, from `old` to `new`.
pub(super) fn clock_step(old: Timestamp, new: Timestamp) -> ActionRecord {
    let text = |at: Timestamp| at.strftime("%Y-%m-%dT%H:%M:%SZ").to_string().into();
    with_change(
        entry(new, RecordedAction::ClockStep, "system clock", "done: applied at once"),
        (Some(text(old)), text(new)),
    )
}

/// The station has written a report, or found it where a station that was killed had written it.
pub(super) fn report_exported(file: &str, sha256: &str, is_new: bool, at: Timestamp) -> ActionRecord {
    let outcome = if is_new { "done" } else { "done: found" };
    ActionRecord { new: Some(sha256.into()), ..entry(at, RecordedAction::Export, file, outcome) }
}

/// The station has deleted a report whose time is over, or left it alone because it has other bytes.
pub(super) fn report_deleted(file: &str, sha256: &str, is_deleted: bool, at: Timestamp) -> ActionRecord {
    let outcome = if is_deleted { "done" } else { "failed: left alone" };
    ActionRecord { old: Some(sha256.into()), ..entry(at, RecordedAction::DeleteReport, file, outcome) }
}

/// The plant goes on as its file says now.
pub(super) fn reloaded(plant: &str, summary: &str, at: Timestamp) -> ActionRecord {
    entry(at, RecordedAction::Reload, plant, &format!("done: {summary}"))
}

/// The last entry of a station.
pub(super) fn stopped(plant: &str, at: Timestamp) -> ActionRecord {
    entry(at, RecordedAction::StopStation, plant, "done")
}

fn entry(at: Timestamp, action: RecordedAction, target: &str, outcome: &str) -> ActionRecord {
    ActionRecord::new(at, "station", action, target, outcome)
}
