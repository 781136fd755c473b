//! Answers queries beside the recording: each on a connection of its own, few at a time, each for a bounded time, and
//! never all places for one terminal.
//!
//! ```text
//!   query ──> queue ──> run ──┬── query, connection, time limit ──> answer
//!                             └── query, connection, time limit ──> answer
//!   writer: a fresh store after every opening ──>   <── "commit first", "this cannot be read"
//! ```

use std::{
    collections::{HashMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    task::{JoinHandle, JoinSet},
    time::timeout,
};

use super::{QueryRequest, store::Store};
use crate::{
    bus::io::{
        clock::Clock,
        worker::{HANG_MAX, spawn_blocking},
    },
    history::{Answer, HistoryError, QUERY_TIME_MAX, Query},
};

/// Queries that are answered at a time; the others wait.
pub const QUERIES_IN_WORK_MAX: usize = 3;
/// Of these of one terminal: the others find a place at once.
pub const QUERIES_OF_ONE_MAX: usize = QUERIES_IN_WORK_MAX - 1;
/// The terminal of the station's own queries. One at a time, in a place of its own, and after all others: what people ask is
/// never delayed by it.
pub const STATION: u32 = 0;
/// Queries that wait here; those behind them wait in the queue, which refuses when it is full.
const WAITING_MAX: usize = 64;
/// How long a query waits for the commit of what is pending.
const COMMIT_MAX: Duration = Duration::from_secs(2);
/// Real time between two attempts to interrupt: one that comes between two statements has no effect.
const INTERRUPT_EVERY: Duration = Duration::from_millis(10);

/// Queries on their way, each with the number of its terminal.
pub type Queries = mpsc::Receiver<(u32, QueryRequest)>;

/// What the writer hands over.
pub struct HandedOver {
    /// The store to clone connections from, none before it is closed.
    pub store: Option<Store>,
    /// With another definition of the plant: the queries that know it. Those before it are dropped.
    pub queries: Option<Queries>,
}

/// How a query is answered: [`Store::answer`], except in tests.
pub type Answerer = Arc<dyn Fn(&Store, &Query, Timestamp) -> Result<Answer, HistoryError> + Send + Sync>;

/// What the reader asks of the writer.
#[derive(Debug)]
pub enum WriterRequest {
    /// Store what is pending, and say how many records could not be stored, once that is known.
    Commit(oneshot::Sender<u64>),
    /// Report to the operator what cannot be read.
    Unreadable(String),
}

/// The reading side of a store.
pub struct Reader {
    /// A store after every opening. Ends with the writer.
    pub stores: mpsc::Receiver<HandedOver>,
    /// To the writer.
    pub writer: mpsc::Sender<WriterRequest>,
    /// Plant time.
    pub clock: Clock,
    /// How queries are answered.
    pub answer: Answerer,
}

impl Reader {
    /// Answers until the writer has ended; what cannot be answered any more is dropped with its reply.
    pub async fn run(mut self, mut queries: Queries) {
        let mut store: Option<Store> = None;
        // Queries wait until the first opening has ended, well or not.
        let mut tried = false;
        let (mut opened, _) = watch::channel(());
        let mut running = JoinSet::new();
        let mut waiting = VecDeque::new();
        // The terminal of each query that is being answered.
        let mut terminals = HashMap::new();
        loop {
            // A query that was cancelled needs no place.
            waiting.retain(|(_, query): &(u32, QueryRequest)| !query.reply.is_closed());
            if tried && let Some((terminal, query)) = next(&mut waiting, terminals.values()) {
                match store.as_ref().ok_or(HistoryError::NotOpen).and_then(Store::try_clone) {
                    Ok(own) => {
                        let task = running.spawn(self.ask(own, query, opened.subscribe()));
                        terminals.insert(task.id(), terminal);
                    }
                    // The query may have been cancelled meanwhile.
                    Err(error) => drop(query.reply.send(Err(error))),
                }
                continue;
            }
            tokio::select! {
                biased;
                handed = self.stores.recv() => {
                    // Queries to the old store end now: its file closes with their connections.
                    opened = watch::channel(()).0;
                    let Some(handed) = handed else { break };
                    // Another definition is no opening.
                    tried |= handed.store.is_some() || handed.queries.is_none();
                    store = handed.store;
                    if let Some(others) = handed.queries {
                        queries = others;
                        waiting.clear();
                    }
                }
                Some(ended) = running.join_next_with_id() => {
                    terminals.remove(&ended.map_or_else(|panic| panic.id(), |(id, ())| id));
                }
                Some(asked) = queries.recv(), if waiting.len() < WAITING_MAX => waiting.push_back(asked),
            }
        }
        drop((store, opened));
        while running.join_next().await.is_some() {}
    }

    /// Answers a query until its time is over, it is cancelled (its reply is dropped) or the store closes.
    fn ask(
        &self,
        store: Store,
        query: QueryRequest,
        mut opened: watch::Receiver<()>,
    ) -> impl Future<Output = ()> + use<> {
        let (writer, clock, answer) = (self.writer.clone(), self.clock, Arc::clone(&self.answer));
        let QueryRequest { query, mut reply } = query;
        async move {
            let interrupt = store.interrupt_handle();
            let mut work = None;
            let answered = async {
                let unstored = if counts_a_period(&query) { commit_first(&writer).await } else { Some(0) };
                let now = clock.utc();
                let answer = move || {
                    let mut answer = answer(&store, &query, now);
                    if let Ok(Answer::Report(report)) = &mut answer {
                        report.unstored = unstored;
                    }
                    (answer, store.unreadable.take())
                };
                work.insert(spawn_blocking(answer)).await
            };
            let ended = tokio::select! {
                answered = timeout(QUERY_TIME_MAX, answered) => answered.map_err(|_| HistoryError::TooLong { seconds: QUERY_TIME_MAX.as_secs() }),
                () = reply.closed() => Err(HistoryError::NotOpen),
                _ = opened.changed() => Err(HistoryError::NotOpen),
            };
            let answer = match ended {
                Ok(Ok((answer, unreadable))) => {
                    if let Some(what) = unreadable {
                        // If the writer is too busy, the next query reports it.
                        let _ = writer.try_send(WriterRequest::Unreadable(what));
                    }
                    if let Err(error @ HistoryError::Engine(_)) = &answer {
                        tracing::warn!(?error, "a query has no reply");
                    }
                    answer
                }
                Ok(Err(panic)) => {
                    tracing::error!(%panic, "a query failed");
                    Err(HistoryError::Engine("internal error, see the log".to_owned()))
                }
                Err(why) => {
                    if let Some(work) = &mut work {
                        stop(work, || interrupt.interrupt()).await;
                    }
                    Err(why)
                }
            };
            // The query may have been cancelled meanwhile.
            let _ = reply.send(answer);
        }
    }
}

/// Takes the query that is answered next, if there is a place for one: that of the terminal with the fewest being
/// answered, and of those the one that waits longest; of the station only where no other can be answered.
fn next<'a, T>(waiting: &mut VecDeque<(u32, T)>, answered: impl Iterator<Item = &'a u32> + Clone) -> Option<(u32, T)> {
    let people = answered.clone().filter(|terminal| **terminal != STATION).count();
    let is_station = |place: &usize| waiting[*place].0 == STATION;
    let of_its_terminal = |place: &usize| answered.clone().filter(|terminal| **terminal == waiting[*place].0).count();
    let fits = |place: &usize| match is_station(place) {
        true => of_its_terminal(place) == 0,
        false => people < QUERIES_IN_WORK_MAX && of_its_terminal(place) < QUERIES_OF_ONE_MAX,
    };
    let fitting = (0..waiting.len()).filter(fits);
    let place = fitting.min_by_key(|place| (is_station(place), of_its_terminal(place)))?;
    waiting.remove(place)
}

/// Does a figure of the answer lack what is not committed yet?
fn counts_a_period(query: &Query) -> bool {
    match query {
        Query::Report { .. }
        | Query::AlarmMetrics { .. }
        | Query::Batches { .. }
        | Query::ControlRuns { .. }
        | Query::Reports { .. } => true,
        Query::Series { .. }
        | Query::Values { .. }
        | Query::Journal { .. }
        | Query::Actions { .. }
        | Query::Audit { .. }
        | Query::LineMinutes { .. }
        | Query::SampleTime { .. }
        | Query::Past { .. }
        | Query::Samples { .. }
        | Query::Unarchived { .. }
        | Query::Overview
        | Query::Registers(_) => false,
    }
}

/// Waits until what is pending is stored, and says how many records still wait; a writer that is too busy for it is not
/// waited for: `None`.
async fn commit_first(writer: &mpsc::Sender<WriterRequest>) -> Option<u64> {
    let (done, committed) = oneshot::channel();
    writer.try_send(WriterRequest::Commit(done)).ok()?;
    timeout(COMMIT_MAX, committed).await.ok()?.ok()
}

/// Interrupts work until it has ended; `false` for what hangs in the disk, which is left behind.
pub(super) async fn stop<T>(work: &mut JoinHandle<T>, interrupt: impl Fn()) -> bool {
    let ended = timeout(HANG_MAX, async {
        loop {
            interrupt();
            if timeout(INTERRUPT_EVERY, &mut *work).await.is_ok() {
                break;
            }
        }
    });
    ended.await.inspect_err(|_| tracing::error!("work on the history hangs in the disk and is abandoned")).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of the waiting queries (their terminals) is next, by its place.
    fn place(waiting: &[u32], answered: &[u32]) -> Option<usize> {
        let mut waiting = waiting.iter().copied().zip(0..).collect();
        next(&mut waiting, answered.iter()).map(|(_, place)| place)
    }

    #[test]
    fn one_terminal_never_takes_all_query_slots() {
        for (waiting, answered, expect) in [
            (&[][..], &[][..], None),
            (&[7, 7], &[], Some(0)),
            (&[7, 7], &[7], Some(0)),
            (&[7, 7], &[7, 7], None),
            (&[7, 7, 8], &[7, 7], Some(2)),
            (&[7, 8, 8], &[7, 9], Some(1)),
            (&[7, 8], &[7, 8, 7], None),
            (&[0, 0, 7], &[7], Some(2)),
            (&[0, 7], &[7, 7], Some(0)),
            (&[0, 7], &[7, 8, 9], Some(0)),
            (&[0, 7], &[0, 7, 8], Some(1)),
            (&[0], &[0], None),
        ] {
            assert_eq!(place(waiting, answered), expect, "{waiting:?} while {answered:?} are answered");
        }
    }
}
