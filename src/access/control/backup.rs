//! Backups: permitted here, written by the history, on record before and after.

use std::path::Path;

use jiff::Timestamp;

use super::{
    AccessControl, Asker, Effect,
    audit_entries::{clean, record},
};
use crate::plant::record::{ActionRecord, BACKUP};

impl AccessControl {
    pub(super) fn begin_backup(&mut self, asker: Asker, folder: String, at: Timestamp) -> Vec<Effect> {
        if !Path::new(&folder).is_absolute() {
            // The station stands in a folder of its own.
            let why = format!("found the folder `{folder}`, expected an absolute path");
            return self.refuse(asker, BACKUP, &clean(&folder), why, at);
        }
        let Some(session) = self.sessions.get(&asker.terminal) else { return Vec::new() };
        let entry = record(session, BACKUP, &clean(&folder), "permitted", at);
        self.backups.insert(asker.ticket, entry.clone());
        vec![Effect::Record(entry), Effect::Backup(asker.ticket, folder)]
    }

    /// A backup is written, or failed; `done` says what it has, or why.
    pub fn on_backed_up(&mut self, ticket: u64, done: Result<String, String>, at: Timestamp) -> Vec<Effect> {
        let Some(entry) = self.backups.remove(&ticket) else { return Vec::new() };
        let outcome = match &done {
            Ok(what) => format!("done: {what}"),
            Err(why) => format!("failed: {why}"),
        };
        let entry = ActionRecord { at, outcome: clean(&outcome).into(), ..entry };
        vec![Effect::Record(entry), Effect::Reply(ticket, done.map(drop))]
    }
}
