//! The history and the log complete each other, once after a start, as soon as both are open.

use std::collections::VecDeque;

use super::{Pending, Recorder, is_same};
use crate::{
    access::audit_log::{Comparison, START, compare, fit},
    history::io::{
        chain::{CHAIN_HASHES_MAX, StoredEntries},
        thread::HistoryInput,
    },
    plant::record::ActionRecord,
};

impl Recorder {
    /// The history was opened, and holds these.
    pub(super) fn on_stored(&mut self, entries: StoredEntries) {
        self.entries = Some(entries);
        self.compare();
    }

    /// The log was opened, with these latest entries.
    pub(super) fn on_opened(&mut self, tail: VecDeque<ActionRecord>) {
        if !self.is_compared && self.tail.is_none() {
            self.tail = Some(tail);
            self.compare();
        }
    }

    /// Compares the history with the log as each was when it was first opened, and sends it what it lacks: a station that
    /// was killed had written it here first.
    fn compare(&mut self) {
        let (tail, entries) = match (self.tail.take(), self.entries.take()) {
            (Some(tail), Some(entries)) => (tail, entries),
            waiting => return (self.tail, self.entries) = waiting,
        };
        self.is_compared = true;
        let StoredEntries { chain_hashes: rows, unchained } = entries;
        let last = tail.back().and_then(|entry| entry.chain_hash).unwrap_or(START);
        let Comparison { missing, differing, not_in_log } = compare(&tail, last, &rows, CHAIN_HASHES_MAX);
        let mut wrong = Vec::new();
        if let Some(first) = differing.first() {
            wrong.push(format!("{} entries differ from the history, the first is {first}", differing.len()));
        }
        if let (Some(first), false) = (not_in_log.iter().min(), last == START && rows.is_empty()) {
            wrong.push(format!("it lacks {} entries that the history holds, from {first} on", not_in_log.len()));
        }
        let completed = (!missing.is_empty()).then(|| format!("{} entries were missing in the history", missing.len()));
        // It was killed while the log could not be written.
        let is_in_log = |action: &ActionRecord| tail.iter().any(|entry| is_same(entry, action));
        let lacking: Vec<_> = unchained.into_iter().map(fit).filter(|action| !is_in_log(action)).collect();
        let appended = (!lacking.is_empty()).then(|| format!("{} actions were in the history only", lacking.len()));
        let notes: Vec<_> = wrong.iter().chain(&completed).chain(&appended).map(|words| self.note(words)).collect();
        let lacking = lacking.into_iter().map(|action| Pending { action, stored: true });
        self.pending.extend(lacking.chain(notes.into_iter().map(|action| Pending { action, stored: false })));
        self.found.extend(wrong.iter().map(|words| format!("the audit log does not agree with the history: {words}")));
        self.store(missing);
        if self.history.try_send(HistoryInput::Completed).is_err() {
            tracing::warn!(
                "reports say until the next start that records may be missing: the queue of the history is full"
            );
        }
    }
}
