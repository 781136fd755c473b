//! Backups and imports: permitted here, done by the history, on record before and after.

use std::path::{Component, Path};

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Requester,
    audit_entries::{clean, record},
};
use crate::plant::{record::ActionRecord, recorded_action::RecordedAction, request_refusal::RequestRefusal};

impl AccessControl {
    pub(super) fn begin_backup(&mut self, requester: Requester, folder: String, at: Timestamp) -> Vec<Effect> {
        self.begin_history_job(requester, RecordedAction::BackUpHistory, absolute(&folder), folder, Effect::Backup, at)
    }

    pub(super) fn begin_import(&mut self, requester: Requester, file: String, at: Timestamp) -> Vec<Effect> {
        self.begin_history_job(requester, RecordedAction::ImportSamples, plain_name(&file), file, Effect::Import, at)
    }

    fn begin_history_job(
        &mut self,
        requester: Requester,
        action: RecordedAction,
        checked: Result<(), RequestRefusal>,
        path: String,
        effect: fn(u64, String) -> Effect,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Err(why) = checked {
            return self.refuse(requester, action, &clean(&path), why, at);
        }
        let Some(session) = self.sessions.get(&requester.terminal) else { return Vec::new() };
        let entry = record(session, action, &clean(&path), "permitted", at);
        self.history_jobs.insert(requester.ticket, entry.clone());
        vec![Effect::Record(entry), effect(requester.ticket, path)]
    }

    /// A backup or an import is done, or failed; `done` says what it has, or why.
    pub fn on_history_job_done(&mut self, ticket: u64, done: Result<String, String>, at: Timestamp) -> Vec<Effect> {
        let Some(entry) = self.history_jobs.remove(&ticket) else { return Vec::new() };
        let outcome = match &done {
            Ok(what) => format!("done: {what}"),
            Err(why) => format!("failed: {why}"),
        };
        let entry = ActionRecord { at, outcome: clean(&outcome).into(), ..entry };
        vec![Effect::Record(entry), Effect::Reply(ticket, done.map(drop).map_err(RequestRefusal::Failed))]
    }
}

/// The station stands in a folder of its own.
fn absolute(path: &str) -> Result<(), RequestRefusal> {
    match Path::new(path).is_absolute() {
        true => Ok(()),
        false => Err(RequestRefusal::PathNotAbsolute(path.to_owned())),
    }
}

/// A file of the import folder: the station reads no other of its user's files for whoever asks.
fn plain_name(path: &str) -> Result<(), RequestRefusal> {
    let mut parts = Path::new(path).components();
    match (parts.next(), parts.next()) {
        (Some(Component::Normal(name)), None) if name == path => Ok(()),
        _ => Err(RequestRefusal::PathNotName(path.to_owned())),
    }
}
