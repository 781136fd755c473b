//! When the archive is worked on: one job at a time, on a connection of its own, while the writer goes on.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering},
    },
    time::Duration,
};

use jiff::Timestamp;
use tokio::{sync::oneshot, task::JoinHandle};

use super::{
    HistoryJob, JobRequest,
    archive::{Job, LeftOut},
    import::{Importing, read_placed_rows},
    interrupt::Interrupt,
    reader::stop,
    store::{Store, instant},
};
use crate::{
    bus::io::worker::{HANG_MAX, spawn_blocking},
    history::{HistoryError, retention::Why, tiers::HOUR},
};

/// Real time between two looks at what is due.
const LOOK_EVERY: Duration = Duration::from_secs(60);
/// The same after a failure.
const RETRY_AFTER: Duration = Duration::from_secs(600);

/// A job that was asked for and takes no step for so long is given up; a step is a file, or the database.
const STEP_MAX: Duration = Duration::from_secs(600);
/// Jobs may hang in this many disks while others are begun: each keeps a thread.
const HUNG_MAX: usize = 2;

/// What became of a look.
pub enum ArchiveOutcome {
    /// A job was due, and is done.
    Did(Job),
    /// Nothing was due; this is missing of the archive.
    Idle(Option<String>),
    /// A job that a station was asked for has ended, and how.
    Answered(Result<String, HistoryError>),
    /// These samples of a file are to be stored.
    ToImport(Box<Importing>),
}

type JobReply = oneshot::Sender<Result<String, HistoryError>>;

type Done = Result<ArchiveOutcome, (Option<Job>, HistoryError)>;

/// Work beside the writer.
struct Running {
    work: JoinHandle<Done>,
    interrupt: Interrupt,
    /// For a job that was asked for.
    reply: Option<JobReply>,
    watched: Arc<Watched>,
    /// The step that it was at, and commits since.
    step: u32,
    commits: u32,
    /// Commits since its answer is not awaited any more.
    left: u32,
}

/// What a job and whoever watches it share.
#[derive(Default)]
struct Watched {
    steps: AtomicU32,
    cancelled: AtomicBool,
}

impl Watched {
    /// A step begins; none does any more of a job that is cancelled.
    fn step(&self) -> Result<(), HistoryError> {
        self.steps.fetch_add(1, Ordering::Relaxed);
        if self.cancelled.load(Ordering::Relaxed) { Err(HistoryError::NotOpen) } else { Ok(()) }
    }
}

/// Works on the archive of one store after the other.
pub struct Archiver {
    running: Option<Running>,
    /// Jobs that were given up and hang in the disk.
    hung: Vec<JoinHandle<Done>>,
    /// What the station is asked for, to begin next: the archive is not worked on meanwhile.
    asked: Option<JobRequest>,
    /// An import that is being stored, a piece with each commit.
    import: Option<(Box<Importing>, JobReply)>,
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
            asked: None,
            import: None,
            hung: Vec::new(),
            wait: commits(LOOK_EVERY, commit_every),
            commit_every,
            left: LeftOut::default(),
            skipped: None,
        }
    }

    /// Begins the next job if it is time, on a connection of its own to the store; stores the next piece of an import.
    pub fn begin(&mut self, store: Option<&Store>, now: Timestamp) {
        self.wait = self.wait.saturating_sub(1);
        if self.running.is_some() {
            return self.watch();
        }
        if let Some((importing, reply)) = self.import.take() {
            return self.import_piece(store, importing, reply);
        }
        if let Some(request) = self.asked.take() {
            return self.begin_asked(store, request, now);
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
            match store.archive(&job) {
                Ok(()) => Ok(ArchiveOutcome::Did(job)),
                Err(error) => Err((Some(job), error)),
            }
        };
        self.run(spawn_blocking(work), interrupt, None, Arc::default());
    }

    fn run(&mut self, work: JoinHandle<Done>, interrupt: Interrupt, reply: Option<JobReply>, watched: Arc<Watched>) {
        self.running = Some(Running { work, interrupt, reply, watched, step: 0, commits: 0, left: 0 });
    }

    /// Cancels a job that was asked for and whose answer is not awaited any more, and gives up one that hangs.
    fn watch(&mut self) {
        let (step_max, cancel_max) = (commits(STEP_MAX, self.commit_every), commits(HANG_MAX, self.commit_every));
        let Some(running) = self.running.as_mut().filter(|running| running.reply.is_some()) else { return };
        let step = running.watched.steps.load(Ordering::Relaxed);
        running.commits = if step == running.step { running.commits + 1 } else { 0 };
        running.step = step;
        running.left += u32::from(running.reply.as_ref().is_some_and(JobReply::is_closed));
        let hangs = step_max <= running.commits || cancel_max < running.left;
        if hangs || 0 < running.left {
            running.watched.cancelled.store(true, Ordering::Relaxed);
            running.interrupt.interrupt();
        }
        if hangs && let Some(Running { work, reply, .. }) = self.running.take() {
            let why = format!("given up: nothing was done for {} min, does the disk hang?", STEP_MAX.as_secs() / 60);
            tracing::error!(why, "a job of the history");
            // Who has left needs no answer.
            let _ = reply.map(|reply| reply.send(Err(HistoryError::Refused(why))));
            self.hung.push(work);
        }
    }

    /// Begins a job with the next commit; one at a time.
    pub fn take_up(&mut self, request: JobRequest) {
        if let Some(earlier) = self.asked.replace(request) {
            let why = "another backup or import was asked for before this one began".to_owned();
            // Who has left needs no answer.
            let _ = earlier.reply.send(Err(HistoryError::Refused(why)));
        }
    }

    fn begin_asked(&mut self, store: Option<&Store>, JobRequest { job, reply }: JobRequest, now: Timestamp) {
        self.hung.retain(|hung| !hung.is_finished());
        let free = match self.hung.len() < HUNG_MAX {
            true => store.ok_or(HistoryError::NotOpen).and_then(Store::try_clone),
            false => Err(HistoryError::Refused("earlier backups or imports still hang in the disk".to_owned())),
        };
        let store = match free {
            Ok(store) => store,
            // Who has left needs no answer.
            Err(error) => return drop(reply.send(Err(error))),
        };
        let (interrupt, watched) = (store.interrupt_handle(), Arc::<Watched>::default());
        let steps = Arc::clone(&watched);
        let work = move || {
            let ended = match job {
                HistoryJob::Backup { to, companions } => {
                    let written = store.back_up(&to, &companions, now, &mut |_| steps.step());
                    log(&written.map(|backup| backup.summary()), "backup", &to)
                }
                HistoryJob::Import { file } => match to_import(&store, &file, now) {
                    Ok(Some(importing)) => return Ok(ArchiveOutcome::ToImport(Box::new(importing))),
                    Ok(None) => Ok("nothing: a value is stored already at each of its rows".to_owned()),
                    Err(error) => log(&Err(error), "import", &file),
                },
            };
            Ok(ArchiveOutcome::Answered(ended))
        };
        self.run(spawn_blocking(work), interrupt, Some(reply), watched);
    }

    /// On the connection that writes: two would not see each other's last commit.
    fn import_piece(&mut self, store: Option<&Store>, mut importing: Box<Importing>, reply: JobReply) {
        if reply.is_closed() {
            tracing::info!(done = importing.done(), "an import was cancelled");
            return;
        }
        let ended = match store.ok_or(HistoryError::NotOpen).and_then(|store| {
            let more = store.import_piece(&mut importing)?;
            Ok((more, importing.summary(&store.def)))
        }) {
            Ok((true, _)) => {
                self.import = Some((importing, reply));
                return;
            }
            Ok((false, summary)) => Ok(summary),
            Err(error) => Err(error),
        };
        let ended = log(&ended, "import", importing.import.file.as_ref());
        // Who has left needs no answer.
        let _ = reply.send(ended);
    }

    /// Waits for the end of a look, for ever without one. Returns what came of it, or why the archive stands still.
    pub async fn ended(&mut self) -> Result<ArchiveOutcome, HistoryError> {
        let Some(running) = &mut self.running else { return std::future::pending().await };
        let done = (&mut running.work).await;
        let reply = self.running.take().and_then(|running| running.reply);
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
            Ok(Ok(ArchiveOutcome::ToImport(importing))) => {
                self.import = reply.map(|reply| (importing, reply));
                return Ok(ArchiveOutcome::Answered(Ok(String::new())));
            }
            Ok(Ok(ArchiveOutcome::Answered(ended))) => {
                // Who has left needs no answer.
                let _ = reply.map(|reply| reply.send(ended.clone()));
                (Duration::ZERO, Ok(ArchiveOutcome::Answered(ended)))
            }
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
        if let Some(Running { work, interrupt, watched, .. }) = &mut self.running {
            watched.cancelled.store(true, Ordering::Relaxed);
            stop(work, || interrupt.interrupt()).await;
        }
    }
}

/// Reads a file and decides what of it fills a gap.
fn to_import(store: &Store, file: &Path, now: Timestamp) -> Result<Option<Importing>, HistoryError> {
    let refused = |problems: Vec<String>| HistoryError::Refused(problems.join("; "));
    let rows = read_placed_rows(file, &store.def, store.importable_from()?, now).map_err(refused)?;
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    store.importing(rows, &name, now)
}

fn log(ended: &Result<String, HistoryError>, job: &str, path: &Path) -> Result<String, HistoryError> {
    match ended {
        Ok(done) => tracing::info!(job, path = %path.display(), done, "done"),
        Err(error) => tracing::error!(job, path = %path.display(), ?error, "not done"),
    }
    ended.clone()
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

#[cfg(test)]
mod tests {
    use tokio::sync::oneshot::Receiver;

    use super::*;
    use crate::plant::fixture;

    fn asked(to: &Path) -> (JobRequest, Receiver<Result<String, HistoryError>>) {
        let (reply, answer) = oneshot::channel();
        (JobRequest { job: HistoryJob::Backup { to: to.to_owned(), companions: Vec::new() }, reply }, answer)
    }

    #[tokio::test]
    async fn a_cancelled_job_that_hangs_lets_others_begin() {
        let folder = tempfile::tempdir().expect("a folder");
        let now = Timestamp::UNIX_EPOCH;
        let store = Store::open(&folder.path().join("h.duckdb"), &fixture::shared(), now).expect("a new store").store;
        let mut archiver = Archiver::new(Duration::from_secs(1));
        let mut release = Vec::new();
        for hung in 1..=HUNG_MAX {
            let ((gate, held), (reply, answer)) = (std::sync::mpsc::channel::<()>(), oneshot::channel());
            release.push(gate);
            let work = spawn_blocking(move || {
                let _ = held.recv();
                Ok(ArchiveOutcome::Answered(Err(HistoryError::NotOpen)))
            });
            archiver.run(work, store.interrupt_handle(), Some(reply), Arc::default());
            archiver.begin(Some(&store), now);
            assert!(archiver.running.is_some(), "its answer is awaited");
            drop(answer);
            (0..=HANG_MAX.as_secs()).for_each(|_| archiver.begin(Some(&store), now));
            assert!(archiver.running.is_none() && archiver.hung.len() == hung);
        }
        let (request, mut answer) = asked(&folder.path().join("one"));
        archiver.take_up(request);
        archiver.begin(Some(&store), now);
        let refused = answer.try_recv().expect("at once").expect_err("as many hang as may");
        assert!(refused.to_string().contains("hang in the disk"), "{refused}");
        drop(release.pop());
        while archiver.hung.iter().all(|hung| !hung.is_finished()) {
            tokio::task::yield_now().await;
        }
        let (request, mut answer) = asked(&folder.path().join("two"));
        archiver.take_up(request);
        archiver.begin(Some(&store), now);
        assert!(matches!(archiver.ended().await, Ok(ArchiveOutcome::Answered(Ok(_)))));
        assert!(answer.try_recv().is_ok_and(|written| written.is_ok()));
    }
}
