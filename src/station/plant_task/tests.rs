//! What an operator is told when the disk or the history does not take what he did.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use super::*;
use crate::{
    access::io::{book, recorder},
    history::io::alarm_file::{self, AlarmFile},
    plant::{
        alarm::AlarmCommand,
        command::{Command, Outcome},
        def::TagId,
        event::Fault,
        fixture,
        record::AlarmStep,
    },
};

const ORDER: OrderId = OrderId { terminal: 1, number: 1 };

/// A plant with an alarm that waits for its acknowledgement, beside a history that takes nothing.
struct Station {
    events: mpsc::Sender<Event>,
    orders: mpsc::Sender<Order>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    task: JoinHandle<()>,
    recorder: std::thread::JoinHandle<()>,
    _blocked: mpsc::Receiver<Vec<Record>>,
    _papers: mpsc::Sender<Paper>,
    _requests: mpsc::Receiver<BusRequest>,
}

impl Station {
    async fn start(history: &Path) -> Station {
        let def = fixture::shared();
        let clock = Clock::real();
        let plant = Plant::new(def.clone(), clock.now(), 1.0);
        let (records, blocked) = mpsc::channel(1);
        records.try_send(Vec::new()).unwrap();
        let recorder = recorder::start(history, clock, records.clone()).unwrap();
        let (_, store) = watch::channel(HistoryStatus::default());
        let book = Some(Deeds::new(&recorder));
        let keeping = Keeping { records: Some(records), store, book, sets: None, listener: None };
        let (request, requests) = mpsc::channel(8);
        let (publish, snapshots) = watch::channel(Arc::new(plant.snapshot()));
        let (events, event_queue) = mpsc::channel(8);
        let (orders, order_queue) = mpsc::channel(8);
        let (papers, paper_queue) = mpsc::channel(8);
        let task = PlantTask::new(plant, clock, vec![request], None, keeping, publish);
        let task = tokio::spawn(task.run(event_queue, order_queue, paper_queue));
        let recorder = recorder.join;
        let mut station = Station {
            events,
            orders,
            snapshots,
            task,
            recorder,
            _blocked: blocked,
            _papers: papers,
            _requests: requests,
        };
        let tags: Vec<TagId> = def.tags_of(fixture::TIC).map(|tag| tag.id).collect();
        let silent =
            Event::Failed { at: clock.now(), device: fixture::TIC, tags, fault: Fault::Resting, exchange: None };
        station.events.send(silent).await.unwrap();
        let raised = station.snapshots.wait_for(|snapshot| !snapshot.alarms.is_empty());
        let command = raised.await.unwrap().alarms[0].acknowledge();
        assert!(matches!(command, Command::Alarm(AlarmCommand::Acknowledge { .. })));
        station.orders.send(Order::new(ORDER, "anna", command)).await.unwrap();
        station
    }

    /// The first snapshot in which the acknowledgement has its end, recorded or not.
    async fn told(&mut self, recorded: impl Fn(bool) -> bool) -> Arc<Snapshot> {
        let ended = |snapshot: &Arc<Snapshot>| {
            let own = snapshot.orders.iter().find(|order| order.id == ORDER);
            own.is_some_and(|order| order.outcome == Outcome::Verified && recorded(order.recorded))
        };
        self.snapshots.wait_for(ended).await.unwrap().clone()
    }

    async fn stop(self) {
        let Station { events, task, recorder, _papers, .. } = self;
        drop((events, _papers));
        task.await.unwrap();
        tokio::task::spawn_blocking(move || recorder.join()).await.unwrap().unwrap();
    }
}

fn steps(history: &Path) -> Vec<AlarmStep> {
    let (_, found) = AlarmFile::open(&alarm_file::beside(history), jiff::Timestamp::UNIX_EPOCH);
    found.steps.unwrap_or_default().iter().map(|step| step.step).collect()
}

#[tokio::test]
async fn an_acknowledgement_that_is_shown_is_on_disk_also_while_the_history_takes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    let mut station = Station::start(&history).await;
    let snapshot = station.told(|_| true).await;
    assert!(snapshot.orders[0].recorded);
    // A kill at this very moment leaves these files.
    assert_eq!(steps(&history), [AlarmStep::Raised, AlarmStep::Acknowledged]);
    let log = fs::read_to_string(book::beside(&history)).unwrap();
    assert!(log.contains("\"who\":\"anna\"") && log.contains("\"action\":\"acknowledge\""), "{log}");
    station.stop().await;
}

#[tokio::test]
async fn what_the_disk_does_not_take_is_done_and_shown_as_not_recorded_until_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    // A folder where the file should be: nothing can be written over it.
    let obstacle = alarm_file::beside(&history);
    fs::create_dir(&obstacle).unwrap();
    let mut station = Station::start(&history).await;
    let snapshot = station.told(|_| true).await;
    assert!(!snapshot.orders[0].recorded, "it is done, and nobody is told that it is recorded");
    assert!(!snapshot.alarms[0].state.needs_acknowledgement());
    let trouble = station.snapshots.wait_for(|snapshot| snapshot.history.trouble.is_some()).await.unwrap().clone();
    let trouble = trouble.history.trouble.as_ref().unwrap();
    assert!(trouble.contains("the state of the alarms cannot be written"), "{trouble}");
    fs::remove_dir(&obstacle).unwrap();
    station.told(|recorded| recorded).await;
    assert_eq!(steps(&history), [AlarmStep::Raised, AlarmStep::Acknowledged]);
    station.stop().await;
}
