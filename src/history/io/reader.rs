//! Answers questions beside the recording: each on a connection of its own, few at a time, each for a bounded time.
//!
//! ```text
//!   Query ──> queue ──> run ──┬── question, connection, time limit ──> answer
//!                             └── question, connection, time limit ──> answer
//!   writer: a fresh store after every opening ──>   <── "commit first", "this cannot be read"
//! ```

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    task::{JoinHandle, JoinSet, spawn_blocking},
    time::timeout,
};

use super::{Query, store::Store};
use crate::{
    bus::io::clock::Clock,
    history::{Answer, HistoryError, Question},
};

/// Questions that are answered at a time; the others wait in their queue.
pub const QUESTIONS_MAX: usize = 2;
/// Real time for one question.
pub const TIME_MAX: Duration = Duration::from_secs(20);
/// How long a question waits for the commit of what is pending.
const COMMIT_MAX: Duration = Duration::from_secs(2);
/// Real time between two attempts to interrupt: one that comes between two statements has no effect.
const INTERRUPT_EVERY: Duration = Duration::from_millis(10);

/// How a question is answered: [`Store::answer`], except in tests.
pub type Answerer = Arc<dyn Fn(&Store, &Question, Timestamp) -> Result<Answer, HistoryError> + Send + Sync>;

/// What the reader asks of the writer.
#[derive(Debug)]
pub enum Request {
    /// Store what is pending, and say when that is done.
    Commit(oneshot::Sender<()>),
    /// Tell the operator what cannot be read.
    Unreadable(String),
}

/// The reading side of a store.
pub struct Reader {
    /// A store to clone connections from after every opening, `None` before it is closed. Ends with the writer.
    pub stores: mpsc::Receiver<Option<Store>>,
    /// To the writer.
    pub writer: mpsc::Sender<Request>,
    /// Plant time.
    pub clock: Clock,
    /// How questions are answered.
    pub answer: Answerer,
}

impl Reader {
    /// Answers until the writer has ended; what cannot be answered any more is dropped with its reply.
    pub async fn run(mut self, mut queries: mpsc::Receiver<Query>) {
        let mut store: Option<Store> = None;
        // Questions wait until the first opening has ended, well or not.
        let mut tried = false;
        let (mut opened, _) = watch::channel(());
        let mut running = JoinSet::new();
        loop {
            tokio::select! {
                biased;
                handed = self.stores.recv() => {
                    // Questions to the old store end now: its file closes with their connections.
                    opened = watch::channel(()).0;
                    let Some(handed) = handed else { break };
                    (store, tried) = (handed, true);
                }
                Some(_) = running.join_next() => {}
                Some(query) = queries.recv(), if tried && running.len() < QUESTIONS_MAX => {
                    match store.as_ref().ok_or(HistoryError::NotOpen).and_then(Store::try_clone) {
                        Ok(own) => drop(running.spawn(self.ask(own, query, opened.subscribe()))),
                        // An asker that has left needs no answer.
                        Err(error) => drop(query.reply.send(Err(error))),
                    }
                }
            }
        }
        drop((store, opened));
        while running.join_next().await.is_some() {}
    }

    /// Answers a question until its time is over, its asker has left or the store closes.
    fn ask(&self, store: Store, query: Query, mut opened: watch::Receiver<()>) -> impl Future<Output = ()> + use<> {
        let (writer, clock, answer) = (self.writer.clone(), self.clock, Arc::clone(&self.answer));
        let Query { question, mut reply } = query;
        async move {
            let interrupt = store.interrupt_handle();
            let mut work = None;
            let answered = async {
                if counts_a_period(&question) {
                    commit_first(&writer).await;
                }
                let now = clock.utc();
                work.insert(spawn_blocking(move || (answer(&store, &question, now), store.unreadable.take()))).await
            };
            let ended = tokio::select! {
                answered = timeout(TIME_MAX, answered) => answered.map_err(|_| HistoryError::TooLong { seconds: TIME_MAX.as_secs() }),
                () = reply.closed() => Err(HistoryError::NotOpen),
                _ = opened.changed() => Err(HistoryError::NotOpen),
            };
            let answer = match ended {
                Ok(Ok((answer, unreadable))) => {
                    if let Some(what) = unreadable {
                        // A writer that is too busy hears of it from the next question.
                        let _ = writer.try_send(Request::Unreadable(what));
                    }
                    answer
                }
                Ok(Err(panic)) => {
                    tracing::error!(%panic, "a question ended badly");
                    Err(HistoryError::Engine("internal error, see the log".to_owned()))
                }
                Err(why) => {
                    if let Some(work) = &mut work {
                        stop(work, || interrupt.interrupt()).await;
                    }
                    Err(why)
                }
            };
            // An asker that has left needs no answer.
            let _ = reply.send(answer);
        }
    }
}

/// Does a figure of the answer lack what is not committed yet?
fn counts_a_period(question: &Question) -> bool {
    match question {
        Question::Report { .. } | Question::AlarmQuality { .. } => true,
        Question::Series { .. }
        | Question::Values { .. }
        | Question::Journal { .. }
        | Question::Actions { .. }
        | Question::Audit { .. }
        | Question::LineMinutes { .. } => false,
    }
}

/// Waits until what is pending is stored; a writer that is too busy for it is not waited for.
async fn commit_first(writer: &mpsc::Sender<Request>) {
    let (done, committed) = oneshot::channel();
    if writer.try_send(Request::Commit(done)).is_ok() {
        let _ = timeout(COMMIT_MAX, committed).await;
    }
}

/// Interrupts work until it has ended.
async fn stop<T>(work: &mut JoinHandle<T>, interrupt: impl Fn()) {
    loop {
        interrupt();
        if timeout(INTERRUPT_EVERY, &mut *work).await.is_ok() {
            break;
        }
    }
}
