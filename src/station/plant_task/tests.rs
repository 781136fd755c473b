//! What is shown of an action while the disk or the history does not take its record.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use super::*;
use crate::{
    access::io::{audit_log, recorder},
    bus::io::worker::Worker,
    history::io::alarm_file::{self, AlarmFile},
    plant::{
        alarm::AlarmCommand,
        command::{Command, CommandId, CommandKind, CommandStatus, Outcome},
        def::{AlarmId, TagId},
        fault::Fault,
        fixture,
        record::{AlarmEvent, ChainHash},
    },
};

const COMMAND: CommandId = CommandId { terminal: 1, number: 1 };

/// A plant with an alarm that waits for its acknowledgement, beside a history that takes nothing.
struct Station {
    events: mpsc::Sender<Event>,
    commands: mpsc::Sender<CommandStatus>,
    store: watch::Sender<HistoryStatus>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    task: JoinHandle<()>,
    recorder: Worker<Option<ChainHash>>,
    _blocked: mpsc::Receiver<HistoryInput>,
    messages: mpsc::Sender<AuditMessage>,
    _requests: mpsc::Receiver<BusRequest>,
}

impl Station {
    async fn start(history: &Path) -> Station {
        Station::start_with(history, Clock::real()).await
    }

    async fn start_with(history: &Path, clock: Clock) -> Station {
        let mut def = fixture::plant();
        let own = def.alarms.len();
        def.alarms.extend((own..).zip(StationFault::ALL).map(|(id, fault)| fault.alarm(AlarmId(id as u16))));
        let def = Arc::new(def);
        let plant = Plant::new(def.clone(), clock.now(), 1.0);
        let (records, blocked) = mpsc::channel(1);
        records.try_send(Vec::new().into()).unwrap();
        let recorder = recorder::start(history, clock, records.clone());
        let (how_it_stands, store) = watch::channel(HistoryStatus::default());
        let audit = Some(AuditQueue::new(&recorder));
        let persistence = Persistence {
            records: Some(records),
            store,
            past: None,
            audit,
            sets: None,
            found: None,
            observer: None,
            succession: Default::default(),
            file_since: None,
        };
        let (request, requests) = mpsc::channel(8);
        let (publish, snapshots) = watch::channel(Arc::new(plant.snapshot()));
        let (events, event_queue) = mpsc::channel(8);
        let (commands, command_queue) = mpsc::channel(8);
        let ((messages, message_queue), (_, reloads)) = (mpsc::channel(8), mpsc::channel(1));
        let task = PlantTask::new(plant, clock, vec![request], None, persistence, publish);
        let inputs = Inputs { events: event_queue, commands: command_queue, messages: message_queue, reloads };
        let task = tokio::spawn(task.run(inputs));
        let recorder = recorder.join.unwrap();
        let station = Station {
            events,
            commands,
            store: how_it_stands,
            snapshots,
            task,
            recorder,
            _blocked: blocked,
            messages,
            _requests: requests,
        };
        let tags: Vec<TagId> = def.tags_of(fixture::TIC).map(|tag| tag.id).collect();
        let silent =
            Event::Failed { at: clock.now(), device: fixture::TIC, tags, fault: Fault::BackedOff, exchange: None };
        station.events.send(silent).await.unwrap();
        station
    }

    /// Acknowledges the alarm as it is shown.
    async fn acknowledge(&mut self) {
        let is_silent = |snapshot: &Arc<Snapshot>| snapshot.alarms.iter().any(|alarm| alarm.id == fixture::SILENT);
        let snapshot = self.snapshots.wait_for(is_silent).await.unwrap().clone();
        let silent = snapshot.alarms.iter().find(|alarm| alarm.id == fixture::SILENT).unwrap();
        let kind = silent.acknowledge();
        assert!(matches!(kind, CommandKind::Alarm(AlarmCommand::Acknowledge { .. })));
        let status = CommandStatus::new(Command::new(1, COMMAND, kind), "anna", Timestamp::UNIX_EPOCH);
        self.commands.send(status).await.unwrap();
    }

    /// The first snapshot in which the acknowledgement has its end, recorded or not.
    async fn ended(&mut self, recorded: impl Fn(bool) -> bool) -> Arc<Snapshot> {
        let ended = |snapshot: &Arc<Snapshot>| {
            let own = snapshot.commands.iter().find(|status| status.command.id == COMMAND);
            own.is_some_and(|status| status.outcome == Outcome::Verified && recorded(status.recorded))
        };
        self.snapshots.wait_for(ended).await.unwrap().clone()
    }

    async fn stop(self) {
        let Station { events, task, recorder, messages, .. } = self;
        drop((events, messages));
        task.await.unwrap();
        recorder.ended().await.unwrap();
    }
}

fn alarm_events(history: &Path) -> Vec<AlarmEvent> {
    let (_, found) = AlarmFile::open(&alarm_file::beside(history), jiff::Timestamp::UNIX_EPOCH);
    let alarm_events = found.events.unwrap_or_default();
    alarm_events.iter().filter(|event| &*event.subject == "TIC-1").map(|event| event.event).collect()
}

#[tokio::test]
async fn a_snapshot_is_of_the_time_at_which_it_is_published() {
    let folder = tempfile::tempdir().unwrap();
    let clock = Clock::real();
    let mut station = Station::start_with(&folder.path().join("fixture.duckdb"), clock).await;
    let is_silent = |snapshot: &Arc<Snapshot>| snapshot.alarms.iter().any(|alarm| alarm.id == fixture::SILENT);
    let first = station.snapshots.wait_for(is_silent).await.unwrap().clone();
    // An event of a moment ago: the clock of a terminal must not go back to it.
    let (before, at) = (clock.now(), first.at);
    let event = Event::Failed { at, device: fixture::PLC, tags: Vec::new(), fault: Fault::BackedOff, exchange: None };
    station.events.send(event).await.unwrap();
    station.snapshots.changed().await.unwrap();
    let shown = station.snapshots.borrow_and_update().at;
    assert!(shown >= before, "{shown} is before {before}");
    station.stop().await;
}

#[tokio::test]
async fn a_shown_acknowledgement_is_on_disk_without_a_history() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    let mut station = Station::start(&history).await;
    station.acknowledge().await;
    let snapshot = station.ended(|_| true).await;
    assert!(snapshot.commands[0].recorded);
    // A kill at this very moment leaves these files.
    assert_eq!(alarm_events(&history), [AlarmEvent::Raised, AlarmEvent::Acknowledged]);
    let log = fs::read_to_string(audit_log::beside(&history)).unwrap();
    assert!(log.contains("\"who\":\"anna\"") && log.contains("\"action\":\"acknowledge\""), "{log}");
    station.stop().await;
}

#[tokio::test]
async fn unwritten_actions_are_shown_as_not_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    // A folder where the file should be: nothing can be written over it.
    let obstacle = alarm_file::beside(&history);
    fs::create_dir(&obstacle).unwrap();
    let mut station = Station::start(&history).await;
    station.acknowledge().await;
    let snapshot = station.ended(|_| true).await;
    assert!(!snapshot.commands[0].recorded, "it is done, and not shown as recorded");
    let silent = snapshot.alarms.iter().find(|alarm| alarm.id == fixture::SILENT).unwrap();
    assert!(!silent.state.needs_acknowledgement());
    assert!(!silent.acknowledged.as_ref().unwrap().recorded, "and the alarm says so");
    let trouble = station.snapshots.wait_for(|snapshot| snapshot.history.trouble.is_some()).await.unwrap().clone();
    let trouble = trouble.history.trouble.as_ref().unwrap();
    assert!(trouble.contains("the state of the alarms cannot be written"), "{trouble}");
    fs::remove_dir(&obstacle).unwrap();
    let snapshot = station.ended(|recorded| recorded).await;
    let silent = snapshot.alarms.iter().find(|alarm| alarm.id == fixture::SILENT).unwrap();
    assert!(silent.acknowledged.as_ref().unwrap().recorded);
    assert_eq!(alarm_events(&history), [AlarmEvent::Raised, AlarmEvent::Acknowledged]);
    station.stop().await;
}

#[tokio::test]
async fn a_login_is_reported_as_not_recorded_without_a_disk() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    let obstacle = alarm_file::beside(&history);
    fs::create_dir(&obstacle).unwrap();
    let mut station = Station::start(&history).await;
    let answer = |messages: &mpsc::Sender<AuditMessage>| {
        let (reply, answer) = tokio::sync::oneshot::channel();
        messages.try_send(AuditMessage::Entry(entries::stopped("login", jiff::Timestamp::UNIX_EPOCH))).unwrap();
        messages.try_send(AuditMessage::Reply(reply, Ok(None))).unwrap();
        async { answer.await.unwrap().map(|completion| completion.durability) }
    };
    let unwritten = |snapshot: &Arc<Snapshot>| {
        let trouble = snapshot.history.trouble.as_ref();
        trouble.is_some_and(|trouble| trouble.contains("the state of the alarms cannot be written"))
    };
    station.snapshots.wait_for(unwritten).await.unwrap();
    assert_eq!(answer(&station.messages).await, Ok(Durability::NotRecorded));
    fs::remove_dir(&obstacle).unwrap();
    // A slow disk may need more than one.
    let recorded = async { while answer(&station.messages).await != Ok(Durability::Recorded) {} };
    tokio::time::timeout(Duration::from_secs(60), recorded).await.unwrap();
    station.stop().await;
}

#[tokio::test]
async fn a_clock_step_is_followed_recorded_and_alarmed() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("fixture.duckdb");
    // The station begins two years ahead of the system clock, which is as if it was set back then.
    let (years, clock) = (Duration::from_secs(2 * 365 * 86_400), Clock::real());
    clock.follow_at(std::time::SystemTime::now() + years, std::time::Instant::now()).unwrap();
    let wrong = clock.utc();
    let mut station = Station::start_with(&history, clock).await;
    let stepped = |snapshot: &Arc<Snapshot>| {
        snapshot.alarms.iter().any(|alarm| snapshot.def.alarm(alarm.id).message == StationFault::Clock.word())
    };
    let snapshot = station.snapshots.wait_for(stepped).await.unwrap().clone();
    let right = jiff::Timestamp::now();
    let off = |at: jiff::Timestamp| at.duration_since(right).abs();
    assert!(off(snapshot.at) < jiff::SignedDuration::from_secs(60), "{} is not {right}", snapshot.at);
    assert!(snapshot.alarms.iter().all(|alarm| off(alarm.raised_at) < jiff::SignedDuration::from_secs(60)));
    station.acknowledge().await;
    let snapshot = station.ended(|_| true).await;
    assert!(off(snapshot.commands[0].at) < jiff::SignedDuration::from_secs(60));
    station.stop().await;
    let log = fs::read_to_string(audit_log::beside(&history)).unwrap();
    let line = log.lines().find(|line| line.contains("clock step")).unwrap_or_else(|| panic!("{log}"));
    let day = |at: jiff::Timestamp| at.strftime("%Y-%m-%dT").to_string();
    assert!(line.contains(&format!("\"old\":\"{}", day(wrong))), "{line}");
    assert!(line.contains(&format!("\"new\":\"{}", day(right))), "{line}");
    assert!(log.lines().last().unwrap().contains(&format!("\"utc\":\"{}", day(right))), "the stop, on the right day");
}

#[tokio::test(start_paused = true)]
async fn a_history_that_says_nothing_is_named_until_it_speaks() {
    let folder = tempfile::tempdir().unwrap();
    let mut station = Station::start(&folder.path().join("fixture.duckdb")).await;
    let begun = Instant::now();
    let is_recording = |snapshot: &Arc<Snapshot>| snapshot.history.failing.is_none();
    let snapshot = station.snapshots.wait_for(|snapshot| !is_recording(snapshot)).await.unwrap().clone();
    assert_eq!(snapshot.history.failing.as_deref(), Some(SILENT));
    assert!(snapshot.history.trouble.as_ref().is_some_and(|trouble| trouble.starts_with(SILENT)));
    assert!(SILENT_MAX <= begun.elapsed() && begun.elapsed() < 2 * SILENT_MAX);
    station.store.send_replace(HistoryStatus::default());
    station.snapshots.wait_for(is_recording).await.unwrap();
    station.stop().await;
}
