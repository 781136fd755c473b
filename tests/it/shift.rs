//! A whole shift in virtual time: the real station on the simulated plant, an alarm, a changed setpoint, and a report
//! that an independent reader checks.

use std::{path::Path, process::Command, sync::Arc, time::Duration};

use jiff::{Timestamp, civil::date, tz::TimeZone};
use sightglass::api::{
    bus::{Clock, Connector},
    history::{Answer, Query, QueryRequest, Store},
    plant::{CommandKind, LineId, Outcome, PlantDef},
    profile::{self, Search},
    report::{self, FORMATS, Style, period_parser},
    sim::{Rig, Simulator, SimulatorHandle, Wire, serve_line},
    station::{self, Session},
};
use tokio::sync::{mpsc, oneshot};

use crate::support::{folder, have};

/// Checks the report with Python's own strict reader and prints what it found.
const READER: &str = r#"
import csv, itertools, sys
rows = list(csv.reader(open(sys.argv[1], newline="", encoding="utf-8"), strict=True))
assert len({len(row) for row in rows}) == 1, "rows of different lengths"
pv = next(row for row in rows if row[0] == "TIC-1.PV")
print("pv", *pv[3:7], *pv[8:10])
start = next(i for i, row in enumerate(rows) if row[:5] == ["time", "offset", "SV", "PV", "ER"]) + 1
record = list(itertools.takewhile(lambda row: row[0], rows[start:]))
bad = [row for row in record if row[4] and abs(float(row[2]) - float(row[3]) - float(row[4])) > 0.051]
print("record", len(record), "wrong", len(bad), "mean", sum(float(row[3]) for row in record if row[3]) / len(record))
for row in rows:
    if "raised" in row or "acknowledged" in row or "write" in row:
        print("event", "|".join(row))
"#;

#[tokio::test(start_paused = true)]
async fn a_shift_of_eight_hours_is_reported_truly() {
    let folder = folder();
    let history = folder.path().join("tank.duckdb");
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let zone = TimeZone::get("Asia/Bangkok").unwrap();
    let start = date(2026, 3, 2).at(5, 58, 0, 0).to_zoned(zone).unwrap().timestamp();
    let clock = Clock::starting_at(start, 1.0);

    let station = start_on_simulation(&def, clock, &history);
    let session = station.session("anna");
    wait(&session, clock, 2 * 3600).await;
    write(&session, &def, "TIC-1.SV", 80.0, 1).await;
    wait(&session, clock, 3600).await;
    let high =
        session.snapshots.borrow().alarms.first().map(|alarm| alarm.acknowledge()).expect("the high alarm is there");
    send_command(&session, high, 2).await;
    write(&session, &def, "TIC-1.SV", 70.0, 3).await;
    wait(&session, clock, 5 * 3600 + 600).await;
    let last = session.snapshots.borrow().clone();
    drop(session);
    station.stop().await;
    assert_eq!(last.history.lost, 0);
    let counters = last.lines[0].counters;
    assert_eq!(
        (counters.timeouts, counters.corrupt, counters.unexpected, counters.missed),
        (0, 0, 0, 0),
        "{counters:?}"
    );

    let store = Store::open_read_only(&history, &def).unwrap();
    let now = clock.now();
    let period = period_parser::period(&def, Some("morning@2026-03-02"), None, None, now).unwrap();
    let line = def.lines[0].id;
    let every_minute = Query::LineMinutes { line, from: period.from, to: period.to, limit: 1_000 };
    let Answer::LineMinutes(minutes) = store.answer(&every_minute, now).unwrap() else { panic!("not minutes") };
    assert_eq!(minutes.len(), 480, "a row a minute");
    assert!(minutes.iter().all(|minute| minute.requests == minute.ok && 60 <= minute.requests), "{:?}", minutes[0]);
    assert!(
        minutes.iter().all(|minute| 0.05 < minute.utilisation && minute.reply_p99_ms.is_some()),
        "{:?}",
        minutes[0]
    );
    let day = last.alarm_metrics.day.clone();
    assert!(1 <= day.annunciated(), "the meter has seen the high alarm");
    assert_eq!(store.alarm_metrics(day.from, day.until, now).unwrap(), *day, "the screen shows what the journal has");
    let report = store.report(&period, now).unwrap();
    let file = folder.path().join("morning.csv");
    std::fs::write(&file, report::render(FORMATS[0], &report, &def, &Style::of(&def)).unwrap()).unwrap();
    if have("python3", "python3") {
        check(&file);
    }
}

fn check(file: &Path) {
    let output = Command::new("python3").args(["-c", READER]).arg(file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    let line = |word: &str| said.lines().find(|line| line.starts_with(word)).unwrap_or_else(|| panic!("{said}"));
    let numbers = |line: &str| line.split(' ').filter_map(|word| word.parse().ok()).collect::<Vec<f64>>();
    let [min, mean, max, _last, in_alarm, good] = numbers(line("pv"))[..] else { panic!("{said}") };
    assert!(26.0 < min && min < mean && mean < max && 75.0 < max && max < 85.0, "{said}");
    assert!(1.0 < in_alarm && in_alarm < 120.0 && 99.9 <= good, "{said}");
    let [rows, wrong, record_mean] = numbers(line("record"))[..] else { panic!("{said}") };
    assert_eq!((rows, wrong), (480.0, 0.0), "{said}");
    assert!((record_mean - mean).abs() < 0.5, "one value a minute gives nearly the mean of all: {said}");
    for (what, count) in [("raised", 1), ("acknowledged|", 1), ("TIC-1.SV", 2), ("verified", 2)] {
        let found = said.lines().filter(|line| line.starts_with("event") && line.contains(what)).count();
        assert!(count <= found, "{what}: {found} of {count} in\n{said}");
    }
}

/// The station on a simulated rig, over a line in memory at the line's own pace.
fn start_on_simulation(def: &Arc<PlantDef>, clock: Clock, history: &Path) -> station::Station {
    let (ours, theirs) = tokio::io::duplex(1024);
    let (ports, streams) = mpsc::channel(1);
    ports.try_send(ours).unwrap();
    let Some(serial) = def.lines[0].transport.serial() else { panic!("the tank has a serial line") };
    let (simulator, wire) =
        (SimulatorHandle::spawn(Simulator::tank(Rig::demo()), clock), Wire { serial, ascii: false });
    tokio::spawn(serve_line(theirs, simulator.line(LineId(0)), wire, Duration::from_secs(86_400)));
    let connectors = vec![Connector::Memory(streams)];
    station::start(station::Options { def: def.clone(), clock, history: history.to_owned(), connectors, file: None })
        .unwrap()
}

/// Lets plant time pass. Virtual time must not run away from the thread that stores: once a plant minute this waits, in
/// real time, until that thread has taken everything in.
async fn wait(session: &Session, clock: Clock, seconds: u64) {
    for _ in 0..seconds / 60 {
        clock.sleep(Duration::from_secs(60)).await;
        let (reply, answer) = oneshot::channel();
        let query = Query::Journal { from: Timestamp::UNIX_EPOCH, to: Timestamp::MAX, limit: 1 };
        session.ask(QueryRequest { query, reply }).unwrap();
        // The query goes through the session server, a task of this very runtime, before the thread can answer it.
        for _ in 0..100 {
            tokio::task::yield_now().await;
        }
        let (done, taken_in) = std::sync::mpsc::channel();
        std::thread::spawn(move || done.send(answer.blocking_recv().is_ok()));
        assert!(taken_in.recv().unwrap(), "the history answers");
    }
}

async fn write(session: &Session, def: &PlantDef, tag: &str, value: f64, number: u32) {
    send_command(session, CommandKind::Write { tag: def.tag_named(tag).unwrap(), value: value.into() }, number).await;
}

/// Sends a command and waits for its good end.
async fn send_command(session: &Session, kind: CommandKind, number: u32) {
    let id = session.send_command(number, kind).unwrap();
    let mut snapshots = session.snapshots.clone();
    let outcome = loop {
        let status = snapshots.borrow_and_update().commands.iter().find(|status| status.command.id == id).cloned();
        match status.map(|status| status.outcome) {
            None | Some(Outcome::Pending) => snapshots.changed().await.unwrap(),
            Some(outcome) => break outcome,
        }
    };
    assert_eq!(outcome, Outcome::Verified);
}
