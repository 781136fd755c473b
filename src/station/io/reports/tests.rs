//! Automatic reports in virtual time: a real store and real files, and the station killed at every message.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeSet, fs, path::PathBuf};

use jiff::SignedDuration;
use tempfile::TempDir;
use tokio::task::JoinHandle;

use super::*;
use crate::{
    access::{Completion, Durability},
    history::io::store::Store,
    plant::{
        def::TagId,
        report::{AutomaticReport, PeriodKind},
        sample::Sample,
    },
    report::{
        calendar,
        testing::{THREE, at, plant},
    },
};

/// A folder with a history and reports, and what was seen of all stations that ran there.
struct Stand {
    folder: TempDir,
    def: Arc<PlantDef>,
    since: Timestamp,
    audited: Vec<ActionRecord>,
    made: Vec<ReportRecord>,
    alarms: Vec<FaultState>,
}

/// A station that runs.
struct Running {
    clock: Clock,
    store: Store,
    task: JoinHandle<()>,
    _stop: watch::Sender<bool>,
    _status: watch::Sender<HistoryStatus>,
    queries: mpsc::Receiver<(u32, QueryRequest)>,
    records: mpsc::Receiver<HistoryInput>,
    audit: mpsc::Receiver<AuditMessage>,
    events: mpsc::Receiver<Event>,
    /// Messages until it is killed.
    lives: usize,
    /// Records that wait for the disk while a report is asked for.
    unstored: Option<u64>,
}

impl Stand {
    fn new(rules: &[(PeriodKind, &str)], since: &str) -> Stand {
        let (folder, since) = (tempfile::tempdir().unwrap(), at(since));
        let mut def = plant("Asia/Bangkok", &THREE);
        def.report.folder = folder.path().join("reports");
        let rule = |(period, format): &(PeriodKind, &str)| AutomaticReport {
            period: *period,
            formats: vec![(*format).to_owned()],
            folder: None,
            keep: None,
            after: Vec::new(),
        };
        def.report.automatic = rules.iter().map(rule).collect();
        let def = Arc::new(def);
        let (audited, made, alarms) = (Vec::new(), Vec::new(), Vec::new());
        let stand = Stand { folder, def, since, audited, made, alarms };
        let sample = |hours: i64| {
            let at = stand.since + SignedDuration::from_hours(hours);
            Record::Sample(TagId(0), Sample::good(20.0 + hours as f64, at))
        };
        let store = Store::open(&stand.history(), &stand.def, since).unwrap().store;
        store.append(&(0..48).map(sample).collect::<Vec<_>>()).unwrap();
        stand
    }

    fn history(&self) -> PathBuf {
        self.folder.path().join("h.duckdb")
    }

    fn start(&self, base: Timestamp, lives: usize) -> Running {
        let clock = Clock::starting_at(base, 1.0);
        let store = Store::open(&self.history(), &self.def, base).unwrap().store;
        let (query_sender, queries) = mpsc::channel(8);
        let (record_sender, records) = mpsc::channel(256);
        let (audit_sender, audit) = mpsc::channel(8);
        let (event_sender, events) = mpsc::channel(8);
        let (_stop, stopped) = watch::channel(false);
        let (_status, status) = watch::channel(HistoryStatus::default());
        let task = ReportTask {
            def: self.def.clone(),
            clock,
            queries: query_sender,
            records: record_sender,
            audit: audit_sender,
            events: event_sender,
            status,
        };
        let task = tokio::spawn(run(task, stopped));
        Running { clock, store, task, _stop, _status, queries, records, audit, events, lives, unstored: Some(0) }
    }

    /// Runs until an instant, or until the station is killed by a message that it does not live to answer.
    async fn follow(&mut self, running: &mut Running, until: Timestamp) {
        loop {
            tokio::select! {
                biased;
                Some(HistoryInput::Records(records)) = running.records.recv() => {
                    if running.dies() { break }
                    running.store.append(&records).unwrap();
                    let of_report = |record| if let Record::Report(report) = record { Some(report) } else { None };
                    self.made.extend(records.into_iter().filter_map(of_report));
                }
                Some(message) = running.audit.recv() => {
                    if running.dies() { break }
                    match message {
                        AuditMessage::Entry(action) => self.audited.push(action),
                        AuditMessage::Reply(reply, _) => {
                            let completed = Completion { durability: Durability::Recorded, summary: None };
                            drop(reply.send(Ok(completed)));
                        }
                        AuditMessage::Lost(_) => {}
                    }
                }
                Some((terminal, QueryRequest { query, reply })) = running.queries.recv() => {
                    assert_eq!(terminal, STATION);
                    if running.dies() { break }
                    let mut answer = running.store.answer(&query, running.clock.utc());
                    if let Ok(Answer::Report(report)) = &mut answer {
                        report.unstored = running.unstored;
                    }
                    let _ = reply.send(answer);
                }
                Some(event) = running.events.recv() => {
                    if let Event::Station { state, .. } = event { self.alarms.push(state) }
                }
                () = running.clock.sleep_until(until) => return,
            }
        }
        running.task.abort();
    }

    /// A whole life of a station.
    async fn live(&mut self, from: &str, to: &str, lives: usize) {
        let mut running = self.start(at(from), lives);
        self.follow(&mut running, at(to)).await;
        running.task.abort();
        let _ = running.task.await;
    }

    /// The files there must be of the periods of a kind that end before an instant, and their checksums.
    fn expected(&self, kind: PeriodKind, to: &str) -> BTreeSet<String> {
        let first = calendar::period_at(&self.def, kind, self.since);
        let periods = std::iter::successors(first, |period| calendar::period_at(&self.def, kind, period.to));
        let names = periods
            .take_while(|period| period.to < at(to))
            .map(|period| report::FORMATS[0].file_name(&self.def, &period, period.to));
        names.flat_map(|name| [format!("{name}.sha256"), name]).collect()
    }

    fn files(&self) -> BTreeSet<String> {
        let entries = fs::read_dir(&self.def.report.folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name().into_string().unwrap()).collect()
    }
}

impl Running {
    fn dies(&mut self) -> bool {
        self.lives = self.lives.saturating_sub(1);
        self.lives == 0
    }
}

const FOREVER: usize = usize::MAX;

/// Whole months are run in `report::automatic`, without a store.
#[tokio::test(start_paused = true)]
async fn a_station_that_is_off_for_three_days_makes_up_for_it() {
    let kinds = [PeriodKind::Shift, PeriodKind::Day, PeriodKind::Week];
    let (end, mut stand) = ("2026-11-09T07:00+07", Stand::new(&kinds.map(|kind| (kind, "csv")), "2026-11-02T06:00+07"));
    stand.live("2026-11-02T06:00+07", "2026-11-04T05:00+07", FOREVER).await;
    stand.live("2026-11-07T05:00+07", end, FOREVER).await;
    let expected = kinds.into_iter().flat_map(|kind| stand.expected(kind, end));
    assert_eq!(stand.files(), expected.collect::<BTreeSet<_>>());
    let ends: Vec<Timestamp> = stand.made.iter().map(|report| report.to).collect();
    assert!(ends.is_sorted(), "in order");
    // 21 shifts, 7 days, a week; each once on record, and once in the audit log.
    assert_eq!((ends.len(), stand.audited.len()), (29, 29));
    assert_eq!(stand.alarms, []);
    for report in &stand.made {
        assert_eq!(sha256(&fs::read(&*report.file).unwrap()), *report.sha256);
    }
}

#[tokio::test(start_paused = true)]
async fn a_station_killed_at_any_message_makes_each_report_once() {
    let (begin, end) = ("2026-11-01T06:00+07", "2026-11-02T07:00+07");
    let stand = || Stand::new(&[(PeriodKind::Shift, "csv")], begin);
    let bytes =
        |stand: &Stand| -> Vec<Vec<u8>> { stand.made.iter().map(|report| fs::read(&*report.file).unwrap()).collect() };
    let mut undisturbed = stand();
    undisturbed.live(begin, end, FOREVER).await;
    // A report takes two queries, two messages to the audit log and one record.
    for lives in 1..=11 {
        let mut stand = stand();
        stand.live("2026-11-01T14:10+07", "2026-11-01T23:00+07", lives).await;
        stand.live("2026-11-02T01:00+07", end, FOREVER).await;
        assert_eq!(stand.files(), stand.expected(PeriodKind::Shift, end), "killed at message {lives}");
        assert!(bytes(&stand) == bytes(&undisturbed), "the bytes are the same, whenever they are written");
        let written = stand.audited.iter().filter(|entry| &*entry.outcome == "done").map(|entry| entry.target.clone());
        let mut written: Vec<_> = written.collect();
        let all = written.len();
        written.dedup();
        assert_eq!(written.len(), all, "killed at message {lives}: a file that was found is no second export");
    }
}

#[tokio::test(start_paused = true)]
async fn a_report_deleted_at_the_end_of_its_time_is_audited() {
    let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
    let mut def = PlantDef::clone(&stand.def);
    def.report.automatic[0].keep = Some(Duration::from_secs(8 * 3_600));
    stand.def = Arc::new(def);
    stand.live("2026-11-01T06:00+07", "2026-11-01T22:10+07", FOREVER).await;
    let made: Vec<_> = stand.made.iter().filter(|report| report.event == ReportEvent::Made).collect();
    let [first, second] = &made[..] else { panic!("{made:?}") };
    let deleted: Vec<&ActionRecord> = stand.audited.iter().filter(|entry| &*entry.action == "delete report").collect();
    let [entry] = &deleted[..] else { panic!("{deleted:?}") };
    assert_eq!((&entry.target, &*entry.outcome, &entry.old), (&first.file, "done", &Some(first.sha256.clone())));
    assert!(!PathBuf::from(&*first.file).exists() && PathBuf::from(&*second.file).exists());
}

#[tokio::test(start_paused = true)]
async fn a_history_that_is_still_empty_is_waited_for() {
    let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
    fs::remove_file(stand.history()).unwrap();
    let mut running = stand.start(stand.since, FOREVER);
    stand.follow(&mut running, at("2026-11-01T07:00+07")).await;
    let sample = Record::Sample(TagId(0), Sample::good(20.0, at("2026-11-01T07:00+07")));
    running.store.append(&[sample]).unwrap();
    stand.follow(&mut running, at("2026-11-01T14:02+07")).await;
    assert_eq!(stand.files(), stand.expected(PeriodKind::Shift, "2026-11-01T14:02+07"));
    running.task.abort();
}

#[tokio::test(start_paused = true)]
async fn a_report_is_not_made_while_records_wait_for_the_disk() {
    for unstored in [Some(3), None] {
        let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
        let mut running = Running { unstored, ..stand.start(at("2026-11-01T06:00+07"), FOREVER) };
        stand.follow(&mut running, at("2026-11-01T14:10+07")).await;
        assert_eq!((&stand.made[..], stand.files()), (&[][..], BTreeSet::new()), "{unstored:?}");
        assert!(
            matches!(&stand.alarms[..], [FaultState::Active(why)] if why.contains("not made")),
            "{:?}",
            stand.alarms
        );
        running.unstored = Some(0);
        stand.follow(&mut running, at("2026-11-01T14:30+07")).await;
        assert_eq!(stand.alarms.last(), Some(&FaultState::Cleared));
        assert_eq!(stand.files(), stand.expected(PeriodKind::Shift, "2026-11-01T14:30+07"));
        running.task.abort();
    }
}

/// The audit log is never opened again: what the report lacks is not known, which it says.
#[tokio::test(start_paused = true)]
async fn a_report_of_which_it_is_unknown_what_it_lacks_is_made() {
    let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
    let mut running = Running { unstored: None, ..stand.start(at("2026-11-01T06:00+07"), FOREVER) };
    stand.follow(&mut running, at("2026-11-01T15:00+07")).await;
    assert_eq!(stand.alarms.last(), Some(&FaultState::Cleared));
    assert_eq!(stand.files(), stand.expected(PeriodKind::Shift, "2026-11-01T15:00+07"));
    running.task.abort();
}

#[tokio::test(start_paused = true)]
async fn a_folder_that_cannot_be_written_is_an_alarm_until_it_can() {
    let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
    fs::write(&stand.def.report.folder, "a file in the place of the folder").unwrap();
    let mut running = stand.start(at("2026-11-01T06:00+07"), FOREVER);
    stand.follow(&mut running, at("2026-11-01T14:10+07")).await;
    assert!(matches!(&stand.alarms[..], [FaultState::Active(why)] if why.contains("not made")), "{:?}", stand.alarms);
    assert_eq!(stand.made, []);
    fs::remove_file(&stand.def.report.folder).unwrap();
    stand.follow(&mut running, at("2026-11-01T14:30+07")).await;
    assert_eq!(stand.alarms.last(), Some(&FaultState::Cleared));
    assert_eq!(stand.files(), stand.expected(PeriodKind::Shift, "2026-11-01T14:30+07"));
    running.task.abort();
}

#[tokio::test(start_paused = true)]
async fn a_clock_set_back_over_the_end_of_a_shift_doubles_nothing() {
    let mut stand = Stand::new(&[(PeriodKind::Shift, "csv")], "2026-11-01T06:00+07");
    stand.live("2026-11-01T06:00+07", "2026-11-01T14:30+07", FOREVER).await;
    stand.live("2026-11-01T13:00+07", "2026-11-01T22:30+07", FOREVER).await;
    let names: Vec<&str> = stand.made.iter().map(|report| &*report.name).collect();
    assert_eq!(names, ["morning 2026-11-01", "afternoon 2026-11-01"]);
}

#[tokio::test]
async fn a_command_gives_its_last_words_when_it_fails() {
    let folder = tempfile::tempdir().unwrap();
    let run = async |words: &[&str]| {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        delivery::run(&words, Some(folder.path())).await
    };
    // Without a shell: an argument is one, whatever is in it.
    assert_eq!(run(&["touch", "a; touch b"]).await, Ok(()));
    assert!(folder.path().join("a; touch b").exists());
    let why = run(&["sh", "-c", "echo one >&2; echo no route to host >&2; exit 3"]).await;
    assert_eq!(why, Err("sh: exit status: 3: no route to host".to_owned()));
    assert_eq!(run(&["false"]).await, Err("false: exit status: 1".to_owned()));
    assert!(run(&["no-such-program"]).await.is_err_and(|why| why.starts_with("no-such-program: ")));
    // What it leaves running in the background is not waited for.
    assert_eq!(run(&["sh", "-c", "sleep 2 & exit 0"]).await, Ok(()));
}

#[tokio::test(start_paused = true)]
async fn a_folder_that_hangs_is_left_alone_until_it_responds() {
    let stand = Stand::new(&[(PeriodKind::Day, "csv")], "2026-11-20T06:00:00Z");
    let Running { clock, _status, .. } = stand.start(at("2026-11-21T06:00:00Z"), 0);
    let ((queries, _queries), (records, _records), (audit, _audit), (events, _events)) =
        (mpsc::channel(1), mpsc::channel(1), mpsc::channel(1), mpsc::channel(1));
    let (def, status) = (stand.def.clone(), _status.subscribe());
    let task = ReportTask { def, clock, queries, records, audit, events, status };
    let mut maker = Maker { task, failures: Failures::default(), fault: None, unsent: None, hung: None };
    let (release, held) = std::sync::mpsc::channel::<()>();
    let hung = maker.on_disk(move || held.recv().is_err());
    let (done, ()) = tokio::join!(hung, tokio::time::advance(2 * DISK_MAX));
    assert!(done.is_none() && maker.hangs());
    assert!(maker.on_disk(|| ()).await.is_none(), "nothing more is begun");
    drop(release);
    while maker.hangs() {
        tokio::task::yield_now().await;
    }
    assert!(maker.on_disk(|| 7).await.is_some_and(|done| done.is_ok_and(|seven| seven == 7)));
}
