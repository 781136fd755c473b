//! The one thread that owns the store: records in, one commit a second, questions between commits.

use std::{path::Path, sync::Arc, thread::JoinHandle, time::Duration};

use tokio::{
    sync::{mpsc, watch},
    time::MissedTickBehavior,
};

use super::{Query, quality::Recent, writer::Writer};
use crate::{
    bus::io::clock::Clock,
    history::HistoryError,
    plant::{
        def::PlantDef,
        record::{AlarmRecord, Record},
        snapshot::HistoryStatus,
    },
};

/// Batches of records on their way to the thread; a full queue is the sender's to count.
pub const RECORDS_MAX: usize = 1024;
/// Questions on their way to the thread.
pub const QUERIES_MAX: usize = 64;
/// Real time between two commits: what a power failure may cost.
const COMMIT_EVERY: Duration = Duration::from_secs(1);

/// The station's end of the history thread.
#[derive(Debug)]
pub struct Handle {
    /// Records to store. When the last sender is dropped the thread stores what it has and ends.
    pub records: mpsc::Sender<Vec<Record>>,
    /// Questions; those that the thread can no longer answer are dropped with their reply.
    pub queries: mpsc::Sender<Query>,
    /// How the store stands, after every commit.
    pub status: watch::Receiver<HistoryStatus>,
    /// Steps of alarms by operators that are committed; told before `status` is.
    pub settled: watch::Receiver<u64>,
    /// The alarm steps that the plant restores at its start.
    pub restored: Vec<AlarmRecord>,
    /// What the quality meter of the alarms must know of the last day.
    pub recent: Recent,
    /// The thread.
    pub join: JoinHandle<()>,
}

impl Handle {
    /// Drops this end and waits until everything is stored. Blocks for as long as other senders of records exist.
    pub fn stop(self) {
        let Handle { records, queries, status, settled, restored: _, recent: _, join } = self;
        drop((records, queries, status, settled));
        // A panic of the thread has already been reported by the panic hook.
        let _ = join.join();
    }
}

/// Opens the store and starts its thread. Errors as [`Store::open`](super::store::Store::open).
pub fn start(path: &Path, def: Arc<PlantDef>, clock: Clock) -> Result<Handle, HistoryError> {
    let writer = Writer::open(path.to_owned(), def, clock.now())?;
    let restored = writer.restore()?;
    // A plant must start even if its journal is too long to be measured.
    let recent = writer.recent(clock.now()).unwrap_or_else(|error| {
        tracing::warn!(%error, "the quality meter of the alarms begins anew");
        Recent::default()
    });
    let (records, records_in) = mpsc::channel(RECORDS_MAX);
    let (queries, queries_in) = mpsc::channel(QUERIES_MAX);
    let (status_out, status) = watch::channel(writer.status().clone());
    let (settled_out, settled) = watch::channel(0);
    let tell = Tell { settled: settled_out, status: status_out };
    let trouble = |error: std::io::Error| HistoryError::Engine(format!("thread: {error}"));
    // A runtime of its own only to wait for two queues and a tick at once; nothing else ever runs on it.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().map_err(trouble)?;
    let work = move || runtime.block_on(run(writer, clock, records_in, queries_in, tell));
    let join = std::thread::Builder::new().name("history".into()).spawn(work).map_err(trouble)?;
    Ok(Handle { records, queries, status, settled, restored, recent, join })
}

/// Where the thread tells how it stands.
struct Tell {
    settled: watch::Sender<u64>,
    status: watch::Sender<HistoryStatus>,
}

impl Tell {
    fn tell(&self, writer: &Writer) {
        self.settled.send_replace(writer.settled());
        self.status.send_replace(writer.status().clone());
    }
}

async fn run(
    mut writer: Writer,
    clock: Clock,
    mut records: mpsc::Receiver<Vec<Record>>,
    mut queries: mpsc::Receiver<Query>,
    tell: Tell,
) {
    let mut tick = tokio::time::interval(COMMIT_EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            // In this order: a commit is never late for a question, and a question sees the records before it.
            biased;
            _ = tick.tick() => {
                writer.commit(clock.now());
                tell.tell(&writer);
            }
            batch = records.recv() => {
                let Some(batch) = batch else { break };
                if writer.accept(batch) {
                    writer.commit(clock.now());
                    tell.tell(&writer);
                }
            }
            Some(query) = queries.recv() => reply(&mut writer, query, &clock),
        }
    }
    while let Ok(query) = queries.try_recv() {
        reply(&mut writer, query, &clock);
    }
    writer.finish(clock.now());
    tell.tell(&writer);
}

fn reply(writer: &mut Writer, query: Query, clock: &Clock) {
    // Nobody waits any more: the work is spared.
    if query.reply.is_closed() {
        return;
    }
    let answer = writer.answer(&query.question, clock.now());
    let _ = query.reply.send(answer);
}
