//! What the history thread does, without the thread: gathers records, commits, retries, keeps the status.

mod redefine;

use std::{
    path::PathBuf,
    sync::{Arc, Weak},
    time::Duration,
};

use jiff::Timestamp;
use tokio::sync::mpsc;

use super::{
    archiver::ArchiveOutcome,
    files,
    open::{Opened, Restored},
    reader::{HandedOver, Queries},
    store::Store,
};
use crate::{
    history::{HistoryError, words::joined},
    plant::{def::PlantDef, record::Record, snapshot::HistoryStatus},
    profile::io::atomic::with_suffix,
};

/// Records kept while the store cannot take them: more than half an hour of a hundred a second.
pub const PENDING_MAX: usize = 200_000;
/// Commits between two checkpoints: five minutes of one a second.
const CHECKPOINT_EVERY: u32 = 300;
/// A longer log is written into the file at the next commit.
const LOG_MAX: u64 = 4 << 20;
/// A clock that is behind the last record by more than this has been set back or lost its time. The end of the curves
/// of a dead station alone may lie a second ahead.
const CLOCK_STEP: Duration = Duration::from_secs(5);
/// Commits until the first one, and until the next after one that failed.
const CHECKPOINT_FIRST: u32 = 10;
/// Between two attempts to open the store pass 1, 2, 4 and at most 8 commits.
const RETRY_SHIFT_MAX: u32 = 3;
/// Stores on their way to the reader, which takes them at once: one is handed over at an opening, and taken back before
/// the next.
const STORES_MAX: usize = 8;

/// The writing side of a store.
#[derive(Default)]
pub struct Writer {
    /// Gone while it is not open: before the first opening, after a fatal error, while another process has it.
    store: Option<Store>,
    /// What the station restores from the store, until it is taken.
    restored: Option<Restored>,
    /// The audit log may have entries that the store lacks: they are not compared yet.
    lacks_entries: bool,
    /// Where each store goes that is opened, and none before one is closed.
    reader: Option<mpsc::Sender<HandedOver>>,
    /// The store that was closed: readers may still have connections to it.
    closed: Weak<()>,
    path: PathBuf,
    def: Arc<PlantDef>,
    /// When the station started.
    started: Timestamp,
    pending: Vec<Record>,
    status: HistoryStatus,
    /// What was found damaged when the store was opened; stays until the station ends.
    damaged: Option<String>,
    /// The clock was behind the last record at the start.
    clock: Option<String>,
    /// What is wrong now; goes when it works again.
    failing: Option<String>,
    /// What was wrong with the last checkpoint; goes with the next good one.
    unchecked: Option<String>,
    /// Why the last job of the archive failed; goes with the next good one.
    unarchived: Option<String>,
    /// What a query could not read; stays until the station ends.
    unreadable: Option<String>,
    /// What is missing of the archive; goes when it is there again.
    missing: Option<String>,
    /// A store was open before.
    was_open: bool,
    /// Attempts to open it that failed in a row, and commits until the next.
    attempts: u32,
    wait: u32,
    /// Since the last checkpoint.
    commits: u32,
}

impl Writer {
    /// A writer without a store yet: records wait until one is open.
    pub fn new(path: PathBuf, def: Arc<PlantDef>, started: Timestamp) -> Writer {
        let mut writer = Writer { path, def, started, ..Writer::default() };
        // Not that of its disk, which may hang.
        writer.describe_store();
        writer
    }

    /// A writer with an open store. Errors as [`Store::open`].
    #[cfg(test)]
    pub fn open(path: PathBuf, def: Arc<PlantDef>, now: Timestamp) -> Result<Writer, HistoryError> {
        let mut writer = Writer::new(path, def, now);
        let opened = (writer.opener(now))();
        writer.opened(Ok(opened?), now);
        Ok(writer)
    }

    /// How the store stands.
    pub fn status(&self) -> &HistoryStatus {
        &self.status
    }

    /// What a station restores from its history, once after it was opened for the first time.
    pub fn take_restored(&mut self) -> Option<Restored> {
        let restored = self.restored.take()?;
        self.lacks_entries = restored.entries.is_some();
        Some(restored)
    }

    /// What was missing of the audit log has been taken.
    pub fn completed(&mut self) {
        self.lacks_entries = false;
    }

    /// How many records wait for the store; `None` where entries of the audit log may be missing in it, too.
    pub fn unstored(&self) -> Option<u64> {
        (!self.lacks_entries).then_some(self.status.waiting)
    }

    /// Whether a store should be opened now: there is none, all connections to the last one are closed, and the last
    /// attempt is long enough ago.
    pub fn wants_store(&self) -> bool {
        // Two stores of one process on one file would not see each other's locks.
        self.store.is_none() && self.closed.strong_count() == 0 && self.wait == 0
    }

    /// The work of opening the store, for a thread that may wait: replaying a log takes seconds.
    pub fn opener(&self, now: Timestamp) -> impl FnOnce() -> Result<Opened<Restored>, HistoryError> + Send + use<> {
        let (path, def, started, again) = (self.path.clone(), Arc::clone(&self.def), self.started, self.was_open);
        move || match again {
            false => Store::open_at_start(&path, &def, started),
            true => Store::open(&path, &def, now).map(|Opened { store, trouble, read: () }| Opened {
                store,
                trouble,
                read: Restored::default(),
            }),
        }
    }

    /// Takes the store that was opened and stores what waits, or notes why there is none.
    pub fn opened(&mut self, result: Result<Opened<Restored>, HistoryError>, now: Timestamp) {
        match result {
            Ok(Opened { store, trouble, read }) => {
                if !self.was_open {
                    let ahead = store.last_written().filter(|last| *last > self.started + CLOCK_STEP);
                    let words = |last| format!("the clock is behind the last record, {last:.0}: is it right?");
                    self.clock = ahead.map(words);
                    if self.clock.is_some() {
                        self.pending.insert(0, Record::ClockSet);
                    }
                    self.restored = Some(read);
                }
                self.damaged = trouble.or(self.damaged.take());
                (self.store, self.was_open, self.attempts) = (Some(store), true, 0);
                (self.failing, self.unchecked) = (None, None);
                self.redefine_store();
                // The first checkpoint soon: a block that it cannot read is found while little depends on it.
                self.commits = CHECKPOINT_EVERY - CHECKPOINT_FIRST;
                self.hand_over();
                self.commit(now);
            }
            Err(error) => {
                self.wait = 1 << self.attempts.min(RETRY_SHIFT_MAX);
                self.attempts += 1;
                self.fail(&error);
                self.hand_over();
                self.describe();
            }
        }
    }

    /// Takes records to be stored with the next commit; drops and counts the oldest samples where too much waits. `true`
    /// if that commit should be now: what an operator has done with an alarm is not to be missing in the journal.
    pub fn accept(&mut self, records: Vec<Record>) -> bool {
        let now = records.iter().any(|record| matches!(record, Record::Alarm(event) if event.by.is_some()));
        self.pending.extend(records);
        let lost = shed(&mut self.pending, PENDING_MAX);
        if lost > 0 {
            self.status.lost += lost;
            self.describe();
        }
        now
    }

    /// Stores what is pending, all or nothing; what could not be stored stays pending. Called once a second.
    pub fn commit(&mut self, now: Timestamp) {
        self.commits = self.commits.wrapping_add(1);
        self.wait = self.wait.saturating_sub(1);
        if self.store.as_ref().is_some_and(|store| !store.is_in_place()) {
            self.damaged = Some(format!("{} was removed or replaced while the station ran", self.path.display()));
            self.close();
        }
        match &self.store {
            None if self.failing.is_none() && 1 < self.commits => self.failing = Some("is being opened".into()),
            None => {}
            Some(_) if self.pending.is_empty() && self.failing.is_none() => self.stored(now),
            Some(store) => match store.append(&self.pending) {
                Ok(()) => self.stored(now),
                Err(error) => {
                    if error.is_fatal() {
                        self.close();
                    }
                    self.fail(&error);
                }
            },
        }
        self.describe();
    }

    /// Notes why it takes no records, in words for the operator; those of the engine go to the log, once.
    fn fail(&mut self, error: &HistoryError) {
        let words = Some(error.words());
        if self.failing != words {
            tracing::error!(?error, "the history accepts no records");
        }
        self.failing = words;
    }

    /// All that waited is stored.
    fn stored(&mut self, now: Timestamp) {
        let rows = self.pending.drain(..).filter(|record| !matches!(record, Record::ClockSet)).count() as u64;
        if rows > 0 {
            self.status.rows += rows;
            self.status.committed_at = Some(now);
            tracing::debug!(rows, total = self.status.rows, "committed");
        }
        self.failing = None;
        // A log that was removed by hand would take its commits with it: they go into the file at once.
        let no_log = rows > 0 && !files::has_log(&self.path);
        if no_log || self.commits >= CHECKPOINT_EVERY || LOG_MAX < self.log_bytes() {
            self.checkpoint();
        }
    }

    fn log_bytes(&self) -> u64 {
        with_suffix(&self.path, files::LOGS[0]).metadata().map_or(0, |log| log.len())
    }

    /// The stores that queries are answered from: this one, and each that is opened after it.
    pub fn stores(&mut self) -> mpsc::Receiver<HandedOver> {
        let (reader, stores) = mpsc::channel(STORES_MAX);
        self.reader = Some(reader);
        if self.store.is_some() {
            self.hand_over();
        }
        stores
    }

    /// Takes the store back from the reader for good.
    pub fn end_reading(&mut self) {
        self.reader = None;
    }

    fn hand_over(&self) {
        self.send_to_reader(HandedOver { store: self.clone_for_reader(), queries: None });
    }

    fn clone_for_reader(&self) -> Option<Store> {
        let clone = self.store.as_ref()?.try_clone();
        clone.inspect_err(|error| tracing::error!(%error, "queries cannot be answered")).ok()
    }

    fn send_to_reader(&self, handed: HandedOver) {
        if self.reader.as_ref().is_some_and(|reader| reader.try_send(handed).is_err()) {
            tracing::error!("the reader of the history does not accept the store");
        }
    }

    /// Notes what a query could not read.
    pub fn unreadable(&mut self, what: String) {
        self.unreadable = Some(what);
        self.describe();
    }

    /// Notes how a look at the archive ended.
    pub fn archived(&mut self, looked: Result<ArchiveOutcome, HistoryError>) {
        match looked {
            Ok(ArchiveOutcome::Did(_)) => self.unarchived = None,
            Ok(ArchiveOutcome::Answered(_) | ArchiveOutcome::ToImport(_)) => {}
            Ok(ArchiveOutcome::Idle(missing)) => (self.missing, self.unarchived) = (missing, None),
            Err(error) => self.unarchived = Some(format!("it is not archived: {}", error.words())),
        }
        self.describe();
    }

    /// The orderly end: everything stored, every curve ended, the log written into the file.
    pub fn finish(&mut self, now: Timestamp) {
        // Some tries, because this is the last chance; what still fails is lost, and said so.
        if self.wants_store() || 0 < self.wait {
            let opened = (self.opener(now))();
            self.opened(opened, now);
        }
        for _ in 0..3 {
            self.commit(now);
            if self.pending.is_empty() {
                break;
            }
        }
        if !self.pending.is_empty() {
            tracing::error!(records = self.pending.len(), "the history accepted nothing until the end: records lost");
        }
        self.status.lost += self.pending.len() as u64;
        self.pending.clear();
        if let Err(error) = self.store().and_then(|store| store.mark_station_off(now)) {
            self.fail(&error);
        }
        self.checkpoint();
        self.describe();
    }

    pub(super) fn store(&self) -> Result<&Store, HistoryError> {
        self.store.as_ref().ok_or(HistoryError::NotOpen)
    }

    fn checkpoint(&mut self) {
        let Some(store) = &self.store else { return };
        match store.checkpoint() {
            Ok(()) => (self.unchecked, self.commits) = (None, 0),
            // A query stood in the way: with the next commit again, and said only when that goes on for long.
            Err(error) if error.is_of_queries() && self.commits < 2 * CHECKPOINT_EVERY => {}
            Err(error) => {
                let words = Some(format!("its log grows: {}", error.words()));
                if self.unchecked != words {
                    tracing::error!(?error, "the log of the history is not written into its file");
                }
                (self.unchecked, self.commits) = (words, CHECKPOINT_EVERY - CHECKPOINT_FIRST);
            }
        }
    }

    /// After a fatal error DuckDB answers nothing more until the file is opened again.
    pub(super) fn close(&mut self) {
        if let Some(store) = self.store.take() {
            self.closed = store.alive();
            self.hand_over();
        }
    }

    fn describe(&mut self) {
        self.describe_store();
        self.status.disk = files::disk(&self.path).and_then(|disk| files::disk_nearly_full(disk, self.def.history));
        self.status.file_bytes = files::size(&self.path);
    }

    fn describe_store(&mut self) {
        let lost = (self.status.lost > 0).then(|| format!("{} records lost", self.status.lost));
        // A start has said already what it missed.
        let missing =
            self.missing.clone().filter(|words| self.damaged.as_ref().is_none_or(|said| !said.contains(words)));
        let damaged = joined([&self.unreadable, &missing, &self.damaged]);
        self.status.trouble = joined([&self.failing, &self.unchecked, &self.unarchived, &lost, &damaged, &self.clock]);
        self.status.epoch = self.store.as_ref().map_or(self.status.epoch, Store::epoch);
        (self.status.waiting, self.status.waiting_max) = (self.pending.len() as u64, PENDING_MAX as u64);
        self.status.failing.clone_from(&self.failing);
        self.status.damaged = damaged;
        self.status.unarchived.clone_from(&self.unarchived);
        self.status.clock.clone_from(&self.clock);
    }
}

/// Brings a list down to three quarters of `max` if it is longer: the oldest samples go first, then the oldest of all.
/// Alarm events and operator actions are worth more than any sample. Returns how many went.
fn shed(pending: &mut Vec<Record>, max: usize) -> u64 {
    if pending.len() <= max {
        return 0;
    }
    let mut excess = pending.len() - max * 3 / 4;
    let lost = excess as u64;
    pending.retain(|record| {
        let goes = excess > 0 && matches!(record, Record::Sample(..));
        excess -= usize::from(goes);
        !goes
    });
    pending.drain(..excess);
    lost
}

#[cfg(test)]
mod tests;
