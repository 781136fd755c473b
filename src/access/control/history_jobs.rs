//! Backups and imports: permitted here, done by the history, on record before and after.

use std::path::Path;

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Requester,
    audit_entries::{clean, record},
};
use crate::plant::record::ActionRecord;

impl AccessControl {
    pub(super) fn begin_history_job(
        &mut self,
        requester: Requester,
        action: &str,
        path: String,
        effect: fn(u64, String) -> Effect,
        at: Timestamp,
    ) -> Vec<Effect> {
        if !Path::new(&path).is_absolute() {
            // The station stands in a folder of its own.
            let why = format!("found the path `{path}`, expected an absolute one");
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
        vec![Effect::Record(entry), Effect::Reply(ticket, done.map(drop))]
    }
}
