//! Queries beside the recording: they do not delay it, and end when they are cancelled or their time is over.

use std::sync::mpsc as std_mpsc;

use tokio::sync::{mpsc, oneshot};

use super::*;
use crate::history::{
    QUERY_TIME_MAX,
    io::{
        read::ROWS_MAX,
        reader::{Answerer, HandedOver, QUERIES_IN_WORK_MAX, QUERIES_OF_ONE_MAX, Reader, WriterRequest},
        thread::{COMMIT_EVERY, HistoryInput},
    },
};

/// Answers that never end by themselves, and two queues that say when one has begun and how it ended.
fn endless() -> (Answerer, std_mpsc::Receiver<()>, std_mpsc::Receiver<String>) {
    let ((begins, begun), (ends, ended)) = (std_mpsc::channel(), std_mpsc::channel());
    let answer = move |store: &Store, _: &Query, _: Timestamp| {
        begins.send(()).unwrap();
        let result = store.db.execute_batch("SELECT count(*) FROM range(1000000000000000)");
        let why = result.unwrap_err().to_string();
        ends.send(why.clone()).unwrap();
        Err(HistoryError::Engine(why))
    };
    (Arc::new(answer), begun, ended)
}

fn query() -> (QueryRequest, oneshot::Receiver<Result<Answer, HistoryError>>) {
    let (reply, answer) = oneshot::channel();
    (QueryRequest { query: Query::Journal { from: sec(0), to: sec(9), limit: 1 }, reply }, answer)
}

#[test]
fn records_are_committed_while_a_query_runs() {
    let (_folder, db) = folder();
    let (answer, begun, ended) = endless();
    let handle = thread::start_with(&db, def(), Clock::starting_at(sec(10), 1.0), COMMIT_EVERY, answer).unwrap();
    let queries: Vec<_> = (0..QUERIES_IN_WORK_MAX as u32).map(|terminal| (terminal, query())).collect();
    let mut answers = Vec::new();
    for (terminal, (query, answer)) in queries {
        handle.queries.blocking_send((terminal, query)).unwrap();
        begun.recv().unwrap();
        answers.push(answer);
    }
    handle.records.blocking_send(vec![good(PV, 5, 27.0)].into()).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    let mut status = handle.status.clone();
    let committed =
        async { tokio::time::timeout(Duration::from_secs(30), status.wait_for(|status| status.rows == 1)).await };
    assert!(runtime.block_on(committed).is_ok(), "no commit while queries run");
    // A cancelled query is not worked on any longer.
    drop(answers);
    assert!((0..QUERIES_IN_WORK_MAX).all(|_| ended.recv().unwrap().contains("INTERRUPT")));
    handle.stop();
}

#[test]
fn a_terminal_that_asks_without_pause_keeps_no_other_waiting() {
    let (_folder, db) = folder();
    let (answer, begun, ended) = endless();
    let handle = thread::start_with(&db, def(), Clock::starting_at(sec(10), 1.0), COMMIT_EVERY, answer).unwrap();
    let ask = |terminal: u32| {
        let (query, answer) = query();
        handle.queries.blocking_send((terminal, query)).unwrap();
        answer
    };
    let mut greedy: Vec<_> = (0..10).map(|_| ask(1)).collect();
    let other = ask(2);
    // Two of the first terminal, and the one of the second, though nine were before it.
    (0..QUERIES_IN_WORK_MAX).for_each(|_| begun.recv().unwrap());
    drop(other);
    assert!(ended.recv().unwrap().contains("INTERRUPT"));
    // Another one of the first terminal does not take its place: only when one of its own has ended.
    assert!(begun.try_recv().is_err());
    greedy.remove(0);
    assert!(ended.recv().unwrap().contains("INTERRUPT"));
    begun.recv().unwrap();
    // What was cancelled before its turn is never begun.
    greedy.into_iter().rev().for_each(drop);
    handle.stop();
    assert_eq!((begun.try_iter().count(), ended.try_iter().count()), (0, QUERIES_OF_ONE_MAX));
}

#[test]
fn a_station_that_stops_ends_the_queries_and_closes_the_file() {
    let (_folder, db) = folder();
    let (answer, begun, ended) = endless();
    let handle = thread::start_with(&db, def(), Clock::starting_at(sec(10), 1.0), COMMIT_EVERY, answer).unwrap();
    let (query, answer) = query();
    handle.queries.blocking_send((1, query)).unwrap();
    begun.recv().unwrap();
    handle.stop();
    assert!(ended.recv().unwrap().contains("INTERRUPT"));
    assert_eq!(answer.blocking_recv(), Ok(Err(HistoryError::NotOpen)));
    open(&db, 100);
}

#[test]
fn alarms_and_actions_fit_when_samples_fill_the_queue() {
    let (queue, mut waiting) = mpsc::channel(thread::RECORDS_MAX);
    let mut lost = 0;
    let mut sent = 0;
    while lost == 0 {
        lost = thread::offer(&queue, vec![good(PV, sent, 27.0)]);
        sent += 1;
    }
    assert!(lost == 1 && queue.capacity() > 0);
    let alarm = Record::Alarm(step(sent, "high", AlarmEvent::Raised));
    assert_eq!(thread::offer(&queue, vec![good(PV, sent, 27.0), alarm.clone()]), 1, "the sample alone is lost");
    assert_eq!(thread::offer(&queue, vec![Record::Action(action(sent))]), 0);
    assert_eq!(thread::offer(&queue, vec![]), 0);
    drop(queue);
    let records = || match waiting.blocking_recv()? {
        HistoryInput::Records(records) => Some(records),
        other @ (HistoryInput::Definition(_) | HistoryInput::Completed) => panic!("{other:?}"),
    };
    let batches: Vec<_> = std::iter::from_fn(records).skip(sent as usize - 1).collect();
    assert_eq!(batches, [vec![alarm], vec![Record::Action(action(sent))]]);
}

/// A reader by itself: where stores are handed over, and where queries go.
struct Alone {
    stores: mpsc::Sender<HandedOver>,
    queries: mpsc::Sender<(u32, QueryRequest)>,
    requests: mpsc::Receiver<WriterRequest>,
}

fn alone(answer: Answerer) -> Alone {
    let ((stores, stores_in), (queries, queries_in)) = (mpsc::channel(4), mpsc::channel(4));
    let (writer, requests) = mpsc::channel(4);
    let reader = Reader { stores: stores_in, writer, clock: Clock::starting_at(sec(10), 1.0), answer };
    tokio::spawn(reader.run(queries_in));
    Alone { stores, queries, requests }
}

impl Alone {
    async fn hand_over(&self, store: Option<Store>) {
        self.stores.send(HandedOver { store, queries: None }).await.unwrap();
    }
}

#[tokio::test(start_paused = true)]
async fn a_query_that_takes_too_long_is_ended_and_says_so() {
    let (_folder, db) = folder();
    let (answer, begun, ended) = endless();
    let reader = alone(answer);
    reader.hand_over(Some(open(&db, 0))).await;
    let (query, answer) = query();
    reader.queries.send((1, query)).await.unwrap();
    tokio::task::spawn_blocking(move || begun.recv().unwrap()).await.unwrap();
    tokio::time::advance(QUERY_TIME_MAX + Duration::from_secs(1)).await;
    // Virtual time stands still while a thread works; an interruption that comes before the statement is repeated.
    let mut answer = answer;
    let answered = loop {
        tokio::select! {
            biased;
            answered = &mut answer => break answered,
            () = tokio::time::advance(Duration::from_millis(10)) => {}
        }
    };
    assert_eq!(answered, Ok(Err(HistoryError::TooLong { seconds: QUERY_TIME_MAX.as_secs() })));
    assert!(ended.recv().unwrap().contains("INTERRUPT"));
}

#[tokio::test]
async fn without_a_store_a_query_is_answered_with_the_reason() {
    let (_folder, db) = folder();
    let reader = alone(Arc::new(Store::answer));
    let ask = async || {
        let (query, answer) = query();
        reader.queries.send((1, query)).await.unwrap();
        answer.await.unwrap()
    };
    reader.hand_over(None).await;
    assert_eq!(ask().await, Err(HistoryError::NotOpen));
    reader.hand_over(Some(open(&db, 0))).await;
    assert_eq!(ask().await, Ok(Answer::Journal(vec![])));
    reader.hand_over(None).await;
    assert_eq!(ask().await, Err(HistoryError::NotOpen));
}

#[tokio::test]
async fn queries_of_a_definition_before_are_not_answered_by_the_next() {
    let (_folder, db) = folder();
    let reader = alone(Arc::new(Store::answer));
    let (sender, others) = mpsc::channel(4);
    let (early, early_answer) = query();
    let (query, answer) = query();
    reader.queries.send((1, early)).await.unwrap();
    sender.send((1, query)).await.unwrap();
    reader.stores.send(HandedOver { store: Some(open(&db, 0)), queries: Some(others) }).await.unwrap();
    assert!(early_answer.await.is_err(), "its ids mean something else now");
    assert_eq!(answer.await.unwrap(), Ok(Answer::Journal(vec![])));
}

#[tokio::test(start_paused = true)]
async fn a_report_waits_for_the_commit_but_not_for_ever() {
    let (_folder, db) = folder();
    let mut reader = alone(Arc::new(Store::answer));
    reader.hand_over(Some(open(&db, 0))).await;
    for stored in [Some(0), Some(7), None] {
        let (reply, mut answer) = oneshot::channel();
        let period = Period::free(sec(0), sec(10));
        reader.queries.send((1, QueryRequest { query: Query::Report { period }, reply })).await.unwrap();
        let Some(WriterRequest::Commit(done)) = reader.requests.recv().await else { panic!("no commit asked for") };
        assert!(answer.try_recv().is_err(), "answered before the commit");
        if let Some(waiting) = stored {
            done.send(waiting).unwrap();
        }
        let Ok(Ok(Answer::Report(report))) = answer.await else { panic!("no report") };
        assert_eq!(report.unstored, stored, "what is missing in it is said");
    }
}

#[tokio::test]
async fn a_report_at_the_start_waits_until_the_log_was_compared() {
    let (_folder, db) = folder();
    let mut handle = thread::start(&db, def(), Clock::starting_at(sec(10), 1.0)).unwrap();
    assert!(handle.restored.take().unwrap().await.unwrap().entries.is_some());
    let (reply, answer) = oneshot::channel();
    let period = Period::free(sec(0), sec(9));
    handle.queries.send((1, QueryRequest { query: Query::Report { period }, reply })).await.unwrap();
    // What the log had more, and that this was all.
    handle.records.send(vec![good(PV, 5, 27.0)].into()).await.unwrap();
    handle.records.send(HistoryInput::Completed).await.unwrap();
    let Ok(Ok(Answer::Report(report))) = answer.await else { panic!("no report") };
    assert_eq!((report.unstored, report.until), (Some(0), sec(9)));
    handle.ended().await;
}

#[test]
fn a_store_reopens_after_the_last_query_to_the_old_one() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    let mut stores = writer.stores();
    let asked = stores.try_recv().unwrap().store.unwrap();
    writer.close();
    assert!(stores.try_recv().unwrap().store.is_none(), "taken back");
    assert!(matches!(writer.store(), Err(HistoryError::NotOpen)));
    assert!(!writer.wants_store());
    drop(asked);
    assert!(writer.wants_store());
    let opened = writer.opener(sec(2))();
    writer.opened(opened, sec(2));
    let fresh = stores.try_recv().unwrap().store.unwrap();
    assert_eq!(fresh.restore(), Ok(vec![]));
    writer.accept(vec![good(PV, 3, 27.0)]);
    writer.commit(sec(3));
    assert_eq!(writer.status().rows, 1);
    assert_eq!(means(&fresh, PV, 3, 4, 1), [Some(27.0)]);
}

#[test]
fn a_checkpoint_runs_between_endless_queries() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let (_folder, db) = folder();
    let mut writer = Writer::open(db.clone(), def(), sec(0)).unwrap();
    let rows = 30_000;
    writer.store().unwrap().append(&(0..rows).map(|at| good(PV, at, at as f64)).collect::<Vec<_>>()).unwrap();
    let readers: Vec<Store> = (0..QUERIES_IN_WORK_MAX).map(|_| writer.store().unwrap().try_clone().unwrap()).collect();
    let (answered, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for reader in readers {
            let (answered, done) = (&answered, &done);
            scope.spawn(move || {
                let query = Query::Series { tags: vec![PV], from: sec(0), to: sec(rows), buckets: 100 };
                while done.load(Ordering::Relaxed) == 0 {
                    assert!(matches!(reader.answer(&query, sec(rows)), Ok(Answer::Series(_))));
                    answered.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
        let mut logged = 0;
        for at in rows..rows + 600 {
            // As many queries as commits: they overlap, and none of them pauses.
            while answered.load(Ordering::Relaxed) < (at - rows) as usize / 10 {
                std::thread::yield_now();
            }
            writer.accept(vec![good(PV, at, 27.0)]);
            writer.commit(sec(at));
            logged = if files::has_log(&db) { logged + 1 } else { 0 };
            if logged > 320 || writer.status().trouble.is_some() {
                break;
            }
        }
        done.store(1, Ordering::Relaxed);
        assert!(logged <= 320, "{logged} commits without a checkpoint");
    });
    assert_eq!(writer.status().trouble, None);
}

#[test]
fn a_query_that_takes_all_memory_costs_no_record() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    let reader = writer.store().unwrap().try_clone().unwrap();
    // More in one list than the whole engine may use.
    let greedy = "SELECT list(i) FROM range(1000000000) t(i)";
    let working = std::thread::spawn(move || reader.db.execute_batch(greedy).unwrap_err().to_string());
    let mut at = 0;
    while !working.is_finished() {
        at += 1;
        writer.accept(vec![good(PV, at, 27.0), Record::Alarm(step(at, "high", AlarmEvent::Raised))]);
        writer.commit(sec(at));
    }
    let why = working.join().unwrap();
    assert!(why.contains("Out of Memory"), "{why}");
    // A commit may have had no memory meanwhile, not even for its rollback: what it was to store waits for the next,
    // in the store that is then opened again.
    while writer.store().is_err() {
        writer.commit(sec(at + 1));
        if writer.wants_store() {
            let opened = (writer.opener(sec(at + 1)))();
            writer.opened(opened, sec(at + 1));
        }
    }
    writer.commit(sec(at + 1));
    let status = writer.status();
    assert_eq!((status.rows, status.lost, &status.trouble), (2 * at as u64, 0, &None));
    assert_eq!(means(writer.store().unwrap(), PV, at, at + 1, 1), [Some(27.0)]);
}

#[test]
fn a_transaction_that_was_left_open_does_not_stop_the_recording() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.db.execute_batch("BEGIN").unwrap();
    assert!(store.db.execute_batch("INSERT INTO schema_version VALUES (NULL)").is_err(), "now it is aborted");
    store.append(&[good(PV, 1, 27.0)]).unwrap();
    assert_eq!(means(&store, PV, 1, 2, 1), [Some(27.0)]);
}

#[test]
fn the_longest_lists_fit_in_the_engines_memory() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let rows = format!(
        "INSERT INTO alarm_journal
            SELECT make_timestamp(i * 100000), 'UNIT-' || i % 1000 || '.PV', 'temperature high for long, heater off',
                1 + i % 4, ['raised', 'acknowledged', 'RTN'][1 + i % 3], i / 7, 70, 'anna', 'seen, waits for spare part',
                NULL, NULL, NULL, 0, NULL
            FROM range({ROWS_MAX}) t(i);
        INSERT INTO operator_action
            SELECT make_timestamp(i * 100000), 'anna', 'write', 'UNIT-' || i % 1000 || '.SV', '70.0 °C', '75.0 °C',
                'done: verified', 'pts/3 from 10.0.0.5, user panel', 'asked for by the laboratory', i, NULL, 0
            FROM range({ROWS_MAX}) t(i)"
    );
    store.db.execute_batch(&rows).unwrap();
    let (from, to) = (sec(0), sec(8 * 3_600));
    let period = Period::free(from, to);
    let Ok(Answer::Report(report)) = store.answer(&Query::Report { period }, to) else { panic!("no report") };
    assert_eq!((report.alarms.len() as u64, report.actions.len() as u64), (ROWS_MAX, ROWS_MAX));
    let lists = [
        Query::AlarmMetrics { from, to },
        Query::Journal { from, to, limit: ROWS_MAX as usize },
        Query::Actions { from, to, limit: ROWS_MAX as usize },
    ];
    for list in lists {
        let answer = store.answer(&list, to);
        assert!(answer.is_ok(), "{:?}", answer.err());
    }
    assert_eq!(store.restore().unwrap().len(), 3_000, "three steps of each alarm");
    store.recent(to).unwrap();
}
