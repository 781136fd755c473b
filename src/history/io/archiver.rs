//! When the archive is worked on: one job at a time, on a connection of its own, while the writer goes on.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use duckdb::InterruptHandle;
use jiff::Timestamp;
use tokio::task::{JoinHandle, spawn_blocking};

use super::{
    BackupRequest,
    archive::{Job, LeftOut},
    reader::stop,
    store::{Store, instant},
};
use crate::history::{HistoryError, retention::Why, tiers::HOUR};

/// Real time between two looks at what is due.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// The same after a failure.
const RETRY_AFTER: Duration = Duration::from_secs(600);

/// What became of a look.
pub enum ArchiveOutcome {
    /// A job was due, and is done.
    Did(Job),
    /// Nothing was due; this is missing of the archive.
    Idle(Option<String>),
    /// A backup was written, or not: who asked for it knows.
    BackedUp,
}

type Done = Result<ArchiveOutcome, (Option<Job>, HistoryError)>;

/// Works on the archive of one store after the other.
pub struct Archiver {
    running: Option<(JoinHandle<Done>, Arc<InterruptHandle>)>,
    /// A backup that begins next: the archive is not worked on while it is copied.
    backup: Option<BackupRequest>,
    /// A backup that is being written ends.
    stopped: Arc<AtomicBool>,
    /// Commits until the next look: a start is not the time for it.
    wait: u32,
    commit_every: Duration,
    /// Hours that cannot be read in the database, and stay there; and merges of files that cannot be read or written, which
    /// are tried again when nothing else is due.
    left: LeftOut,
    /// Why, if there are any.
    skipped: Option<HistoryError>,
}

impl Archiver {
    /// Nothing is due for a minute; the interval is that between two calls of [`Archiver::begin`].
    pub fn new(commit_every: Duration) -> Archiver {
        Archiver {
            running: None,
            backup: None,
            stopped: Arc::default(),
            wait: commits(LOOK_EVERY, commit_every),
            commit_every,
            left: LeftOut::default(),
            skipped: None,
        }
    }

    /// Begins the next job if it is time, on a connection of its own to the store.
    pub fn begin(&mut self, store: Option<&Store>, now: Timestamp) {
        self.wait = self.wait.saturating_sub(1);
        if self.running.is_some() {
            return;
        }
        if let Some(request) = self.backup.take() {
            return self.begin_backup(store, request, now);
        }
        if self.wait > 0 {
            return;
        }
        let Some(Ok(store)) = store.map(Store::try_clone) else { return };
        let (interrupt, left) = (store.interrupt_handle(), self.left.clone());
        let work = move || {
            let nothing = |error| (None, error);
            let Some(job) = store.archive_due(now, &left).map_err(nothing)? else {
                return store.missing_files().map(ArchiveOutcome::Idle).map_err(nothing);
            };
            match store.archive(&job, &mut |_| Ok(())) {
                Ok(()) => Ok(ArchiveOutcome::Did(job)),
                Err(error) => Err((Some(job), error)),
            }
        };
        self.running = Some((spawn_blocking(work), interrupt));
    }

    /// Has a backup written with the next commit; one at a time.
    pub fn back_up(&mut self, request: BackupRequest) {
        if let Some(earlier) = self.backup.replace(request) {
            let why = "another backup was asked for before this one began".to_owned();
            // Who has left needs no answer.
            let _ = earlier.reply.send(Err(HistoryError::Refused(why)));
        }
    }

    fn begin_backup(&mut self, store: Option<&Store>, request: BackupRequest, now: Timestamp) {
        let BackupRequest { to, companions, reply } = request;
        let store = match store.ok_or(HistoryError::NotOpen).and_then(Store::try_clone) {
            Ok(store) => store,
            // Who has left needs no answer.
            Err(error) => return drop(reply.send(Err(error))),
        };
        let (interrupt, stopped) = (store.interrupt_handle(), Arc::clone(&self.stopped));
        let work = move || {
            let mut step = |_| if stopped.load(Ordering::Relaxed) { Err(HistoryError::NotOpen) } else { Ok(()) };
            let written = store.back_up(&to, &companions, now, &mut step);
            match &written {
                Ok(backup) => tracing::info!(to = %to.display(), what = backup.summary(), "backed up"),
                Err(error) => tracing::error!(?error, to = %to.display(), "not backed up"),
            }
            // Who has left needs no answer.
            let _ = reply.send(written);
            Ok(ArchiveOutcome::BackedUp)
        };
        self.running = Some((spawn_blocking(work), interrupt));
    }

    /// Waits for the end of a look, for ever without one. Returns what came of it, or why the archive stands still.
    pub async fn ended(&mut self) -> Result<ArchiveOutcome, HistoryError> {
        let Some((work, _)) = &mut self.running else { return std::future::pending().await };
        let done = work.await;
        self.running = None;
        let (again, looked) = match done {
            Ok(Ok(ArchiveOutcome::Did(job))) => {
                tracing::info!(?job, "archived");
                (pause(&job), Ok(ArchiveOutcome::Did(job)))
            }
            Ok(Ok(ArchiveOutcome::Idle(missing))) => {
                if self.left.merges.is_empty() && self.left.before.is_none() {
                    self.skipped = None;
                }
                self.left.merges.clear();
                (LOOK_EVERY, Ok(ArchiveOutcome::Idle(missing)))
            }
            Ok(Ok(ArchiveOutcome::BackedUp)) => (Duration::ZERO, Ok(ArchiveOutcome::BackedUp)),
            Ok(Err((Some(Job::Hour(hour)), error))) if error.is_damage() => {
                self.left.before = instant(hour + HOUR);
                self.skipped = Some(error.clone());
                (Duration::ZERO, Err(error))
            }
            Ok(Err((Some(Job::Merge(tier, span)), error))) if error.is_damage_of_file() => {
                self.left.merges.push((tier, span));
                self.skipped = Some(error.clone());
                (Duration::ZERO, Err(error))
            }
            Ok(Err((_, error))) => (RETRY_AFTER, Err(error)),
            Err(_) => (RETRY_AFTER, Err(HistoryError::Engine("internal error, see the log".into()))),
        };
        self.wait = commits(again, self.commit_every);
        if let Err(error) = &looked {
            tracing::error!(?error, "the history is not archived");
        }
        match &self.skipped {
            Some(skipped) => looked.and(Err(skipped.clone())),
            None => looked,
        }
    }

    /// Ends what is running: a station that stops does not wait for it, and the next one does it again.
    pub async fn stop(mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        if let Some((work, interrupt)) = &mut self.running {
            stop(work, || interrupt.interrupt()).await;
        }
    }
}

/// Until the next look. A full disk may have another cause, and an alarm stands: an operator has time to free the
/// disk before all that may go is gone.
fn pause(job: &Job) -> Duration {
    match job {
        Job::Delete(deletion) if deletion.why == Why::DiskFull => LOOK_EVERY,
        Job::Delete(_) | Job::Hour(_) | Job::Merge(..) => Duration::ZERO,
    }
}

fn commits(time: Duration, every: Duration) -> u32 {
    u32::try_from(time.as_nanos() / every.as_nanos().max(1)).unwrap_or(u32::MAX)
}
