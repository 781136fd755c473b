//! The thread that writes: records in, one commit a second; and the thread beside it that answers queries.

use std::{path::Path, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::MissedTickBehavior,
};

use super::{
    JobRequest, QueryRequest,
    archiver::Archiver,
    files,
    open::{Opened, Restored},
    reader::{Answerer, QUERIES_IN_WORK_MAX, Queries, Reader, WriterRequest},
    store::Store,
    writer::Writer,
};
use crate::{
    bus::io::{
        clock::Clock,
        worker::{HANG_MAX, Worker, spawn, spawn_blocking, within},
    },
    history::HistoryError,
    plant::{def::PlantDef, record::Record, snapshot::HistoryStatus},
};

/// Batches of records on their way to the thread; see [`offer`].
pub const RECORDS_MAX: usize = 1024;
/// Places of that queue that samples may not take.
const KEPT_FOR_EVENTS: usize = 128;
/// Queries that wait for their turn; a full queue refuses more.
pub const QUERIES_MAX: usize = 64;
/// Requests of queries on their way to the writer: each that is being answered has one at most.
const REQUESTS_MAX: usize = 2 * (QUERIES_IN_WORK_MAX + 1);
/// Jobs that wait; more are refused.
const JOBS_MAX: usize = 2;
/// One for a query of the station.
const BLOCKING_THREADS: usize = QUERIES_IN_WORK_MAX + 1;
/// Real time between two commits: what a power failure may cost.
pub(super) const COMMIT_EVERY: Duration = Duration::from_secs(1);

/// What the thread takes in, in this order.
#[derive(Debug)]
pub enum HistoryInput {
    /// To be stored.
    Records(Vec<Record>),
    /// The plant has another definition: what follows has its ids.
    Definition(Definition),
    /// What it lacked of the audit log at the start was sent before this.
    Completed,
}

impl From<Vec<Record>> for HistoryInput {
    fn from(records: Vec<Record>) -> HistoryInput {
        HistoryInput::Records(records)
    }
}

/// Another definition of the plant.
#[derive(Debug)]
pub struct Definition {
    /// The definition.
    pub def: Arc<PlantDef>,
    /// The queries that know it; `None` where its ids are those of before.
    pub queries: Option<Queries>,
    /// Gets what the plant goes on from in what it did not follow before.
    pub restored: Option<oneshot::Sender<Restored>>,
}

/// The station's end of the history thread.
#[derive(Debug)]
pub struct Handle {
    /// Records to store. When the last sender is dropped the thread stores what it has and ends.
    pub records: mpsc::Sender<HistoryInput>,
    /// Queries, each with the number of its terminal; those that can no longer be answered are dropped with their reply.
    pub queries: mpsc::Sender<(u32, QueryRequest)>,
    /// Backups to be written, files to be imported.
    pub jobs: mpsc::Sender<JobRequest>,
    /// How the store stands, after every commit.
    pub status: watch::Receiver<HistoryStatus>,
    /// What the plant restores from its history, as soon as it is open for the first time.
    pub restored: Option<oneshot::Receiver<Restored>>,
    /// The thread; `None` where the system gave none.
    pub join: Option<Worker<()>>,
}

impl Handle {
    /// Drops this end and waits until everything is stored. Blocks for as long as other senders of records exist.
    pub fn stop(self) {
        let Handle { records, queries, jobs, status, restored: _, join } = self;
        drop((records, queries, jobs, status));
        let _ = join.and_then(Worker::join);
    }

    /// The same for who must not block.
    pub async fn ended(self) {
        let Handle { records, queries, jobs, status, restored: _, join } = self;
        drop((records, queries, jobs, status));
        if let Some(join) = join {
            join.ended().await;
        }
    }

    /// Of a station without a history: every record is lost and counted, and the status says why.
    fn without_thread(why: &HistoryError) -> Handle {
        tracing::error!(%why, "the station runs without its history");
        let (records, queries, jobs) = (mpsc::channel(1).0, mpsc::channel(1).0, mpsc::channel(1).0);
        let failing = Some(format!("{}; restart the station", why.words()));
        let status = HistoryStatus { trouble: failing.clone(), failing, ..HistoryStatus::default() };
        Handle { records, queries, jobs, status: watch::channel(status).1, restored: None, join: None }
    }
}

/// Puts records into the queue, as far as it has room; alarms and operator actions never wait behind samples, which have no
/// more room when the queue is nearly full. Returns how many records are lost.
pub fn offer(queue: &mpsc::Sender<HistoryInput>, mut records: Vec<Record>) -> u64 {
    let all = records.len();
    if queue.capacity() <= KEPT_FOR_EVENTS {
        records.retain(|record| !matches!(record, Record::Sample(..)));
    }
    let kept = records.len();
    let taken = kept == 0 || queue.try_send(HistoryInput::Records(records)).is_ok();
    if taken { (all - kept) as u64 } else { all as u64 }
}

/// Starts the threads, which open the store while the station already polls. [`HistoryError::Foreign`] for a file that is
/// something else; what can change, such as a full disk, is retried and shown.
pub fn start(path: &Path, def: Arc<PlantDef>, clock: Clock) -> Result<Handle, HistoryError> {
    match start_with(path, def, clock, COMMIT_EVERY, Arc::new(Store::answer)) {
        // The system gives no thread: polls and alarms go on.
        Err(error @ HistoryError::Engine(_)) => Ok(Handle::without_thread(&error)),
        started => started,
    }
}

/// The same with another interval between commits and other answers.
pub fn start_with(
    path: &Path,
    def: Arc<PlantDef>,
    clock: Clock,
    commit_every: Duration,
    answer: Answerer,
) -> Result<Handle, HistoryError> {
    let file = path.to_owned();
    // A disk that hangs is met again when the store is opened.
    within(HANG_MAX, move || files::refuse_foreign(&file)).unwrap_or(Ok(()))?;
    let mut writer = Writer::new(path.to_owned(), def, clock.utc());
    let (records, records_in) = mpsc::channel(RECORDS_MAX);
    let (queries, queries_in) = mpsc::channel(QUERIES_MAX);
    let (jobs, jobs_in) = mpsc::channel(JOBS_MAX);
    let (status_out, status) = watch::channel(writer.status().clone());
    let (restored_out, restored) = oneshot::channel();
    let mut outputs = Outputs { status: status_out, restored: Some(restored_out) };
    let trouble = |error: std::io::Error| HistoryError::Engine(format!("thread: {error}"));
    let (requests, requests_in) = mpsc::channel(REQUESTS_MAX);
    let reader = Reader { stores: writer.stores(), writer: requests, clock, answer };
    let reading = spawn("history-reader", BLOCKING_THREADS, || reader.run(queries_in)).map_err(trouble)?;
    let writing = move || async move {
        let opening = run(&mut writer, clock, commit_every, records_in, requests_in, jobs_in, &mut outputs).await;
        writer.end_reading();
        reading.ended().await;
        finish(&mut writer, clock, opening, &mut outputs).await;
    };
    let join = spawn("history", BLOCKING_THREADS, writing).map_err(trouble)?;
    Ok(Handle { records, queries, jobs, status, restored: Some(restored), join: Some(join) })
}

/// Stores what waits.
async fn finish(writer: &mut Writer, clock: Clock, opening: Option<Opening>, outputs: &mut Outputs) {
    if let Some(opening) = opening {
        // A log that is replayed just now is waited for: what waits would be lost.
        writer.opened(ended(opening.await), clock.utc());
    }
    writer.finish(clock.utc());
    outputs.publish(writer);
}

/// What the thread publishes.
struct Outputs {
    status: watch::Sender<HistoryStatus>,
    restored: Option<oneshot::Sender<Restored>>,
}

impl Outputs {
    fn publish(&mut self, writer: &mut Writer) {
        if let Some(restored) = writer.take_restored()
            && let Some(station) = self.restored.take()
        {
            // A station that has ended restores nothing.
            let _ = station.send(restored);
        }
        self.status.send_replace(writer.status().clone());
    }
}

async fn run(
    writer: &mut Writer,
    clock: Clock,
    commit_every: Duration,
    mut records: mpsc::Receiver<HistoryInput>,
    mut requests: mpsc::Receiver<WriterRequest>,
    mut jobs: mpsc::Receiver<JobRequest>,
    outputs: &mut Outputs,
) -> Option<Opening> {
    let (mut opening, mut restoring, mut asked) = (None, None, Vec::new());
    let mut archiver = Archiver::new(commit_every);
    let mut tick = tokio::time::interval(commit_every);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        if opening.is_none() && writer.wants_store() {
            opening = Some(spawn_blocking(writer.opener(clock.utc())));
        }
        restore_followed(writer, &mut restoring);
        tokio::select! {
            // In this order: a query sees the records before it.
            biased;
            _ = tick.tick() => {
                writer.commit(clock.utc());
                archiver.begin(writer.store().ok(), clock.utc());
                outputs.publish(writer);
            }
            looked = archiver.ended() => {
                writer.archived(looked);
                outputs.publish(writer);
            }
            result = opened(&mut opening) => {
                writer.opened(result, clock.utc());
                outputs.publish(writer);
            }
            input = records.recv() => match input {
                None => {
                    archiver.stop().await;
                    return opening;
                }
                Some(HistoryInput::Records(batch)) => if writer.accept(batch) {
                    writer.commit(clock.utc());
                    outputs.publish(writer);
                },
                Some(HistoryInput::Completed) => {
                    writer.completed();
                    commit_and_answer(writer, clock.utc(), outputs, &mut asked);
                }
                Some(HistoryInput::Definition(Definition { def, queries, restored })) => {
                    writer.redefine(def, queries, clock.utc());
                    restoring = restored.or(restoring);
                    outputs.publish(writer);
                }
            },
            // One that comes while the store is being opened waits for it, as queries do.
            Some(request) = jobs.recv(), if opening.is_none() => archiver.take_up(request),
            Some(request) = requests.recv() => match request {
                WriterRequest::Commit(done) => {
                    asked.push(done);
                    commit_and_answer(writer, clock.utc(), outputs, &mut asked);
                }
                WriterRequest::Unreadable(what) => {
                    writer.unreadable(what);
                    outputs.publish(writer);
                }
            }
        }
    }
}

/// Stores what is pending and answers those who wait for it, once it is known what the store lacks: a start compares it with
/// the audit log.
fn commit_and_answer(
    writer: &mut Writer,
    now: Timestamp,
    outputs: &mut Outputs,
    asked: &mut Vec<oneshot::Sender<u64>>,
) {
    writer.commit(now);
    outputs.publish(writer);
    // A query may have been cancelled meanwhile, or waits no longer.
    asked.retain(|done| !done.is_closed());
    if let Some(records) = writer.unstored() {
        for done in asked.drain(..) {
            let _ = done.send(records);
        }
    }
}

/// Reads beside the thread what a plant goes on from under another definition, as soon as there is a store.
fn restore_followed(writer: &Writer, restoring: &mut Option<oneshot::Sender<Restored>>) {
    let Some(store) = restoring.as_ref().and_then(|_| writer.store().ok()?.try_clone().ok()) else { return };
    let Some(sender) = restoring.take() else { return };
    spawn_blocking(move || match store.restore_followed() {
        // A station that has ended restores nothing.
        Ok(restored) => drop(sender.send(restored)),
        Err(error) => tracing::error!(?error, "batches, runs and totals that are new do not go on from the history"),
    });
}

/// The store on its way, opened on a thread of its own: records are taken in meanwhile.
type Opening = tokio::task::JoinHandle<Result<Opened<Restored>, HistoryError>>;

/// Waits for the end of an opening; for ever without one.
async fn opened(opening: &mut Option<Opening>) -> Result<Opened<Restored>, HistoryError> {
    let Some(work) = opening else { return std::future::pending().await };
    let result = ended(work.await);
    *opening = None;
    result
}

/// A panic of the opening has been reported by the panic hook; the next attempt may go better.
fn ended(
    result: Result<Result<Opened<Restored>, HistoryError>, tokio::task::JoinError>,
) -> Result<Opened<Restored>, HistoryError> {
    result.unwrap_or_else(|_| Err(HistoryError::Engine("internal error while it was opened, see the log".into())))
}
