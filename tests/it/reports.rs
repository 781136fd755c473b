//! Reports and exports as a user gets them: from a damaged history, with suppressed alarms, beside a running station.

use std::{path::Path, process::Output, sync::Arc, time::Instant};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    access::{
        audit_log::{AuditLog, beside},
        own_user,
    },
    history::Store,
    plant::{ActionRecord, AlarmEvent, AlarmRecord, PlantDef, Priority, Record, RecordedAction, Sample},
    profile::{self, Search},
};

use crate::support::{Process, TIMEOUT, folder, sightglass, sockets};

/// The instant of the first record.
const START: &str = "2026-03-02T06:00:00Z";

/// Exit code, standard output and standard error of a command about a history file.
fn run(command: &str, history: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } =
        sightglass().args([command, "tank"]).args(args).arg("--history").arg(history).output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// A closed history of the tank with these records.
fn history(path: &Path, records: impl Fn(&PlantDef, Timestamp) -> Vec<Record>) {
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let start: Timestamp = START.parse().unwrap();
    let store = Store::open(path, &def, start).unwrap().store;
    for part in records(&def, start).chunks(50_000) {
        store.append(part).unwrap();
    }
    store.checkpoint().unwrap();
}

/// Rows of a CSV file as cells.
fn cells(text: &str) -> Vec<Vec<String>> {
    let reader = csv::ReaderBuilder::new().has_headers(false).flexible(false).from_reader(text.as_bytes());
    reader.into_records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
}

#[test]
fn a_report_over_a_damaged_span_names_it_and_has_the_rest() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    let seconds = 400_000;
    history(&path, |def, start| {
        let pv = def.tag_named("TIC-1.PV").unwrap();
        // Numbers that do not compress: many blocks.
        let value = |at: i64| f64::from((at as u32).wrapping_mul(2_654_435_761)) / 7.0;
        let sample = |at: i64| Record::Sample(pv, Sample::good(value(at), start + SignedDuration::from_secs(at)));
        (0..seconds).map(sample).collect()
    });
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2 + 1_000;
    bytes[middle] ^= 4;
    std::fs::write(&path, bytes).unwrap();

    let end = (START.parse::<Timestamp>().unwrap() + SignedDuration::from_secs(seconds)).to_string();
    let period = ["--from", START, "--to", &end];
    let (code, out, err) = run("report", &path, &[&period[..], &["--out", "-"]].concat());
    assert_eq!(code, Some(0), "{err}");
    assert!(err.contains("the history cannot be read from 2026-03-0") && err.contains("checksum"), "{err}");
    let rows = cells(&out);
    // From, offset, to, offset, minutes, what, why.
    let at = |cells: &[String]| cells.concat().replace(' ', "T").replace("UTC", "").parse::<Timestamp>().unwrap();
    let gaps = rows.iter().filter(|row| row.get(5).is_some_and(|what| what == "not readable, not counted"));
    let lost: i64 = gaps.map(|row| at(&row[2..4]).duration_since(at(&row[..2])).as_secs()).sum();
    assert!(0 < lost && lost < seconds / 2, "{lost} s in\n{out}");
    let pv = rows.iter().find(|row| row[0] == "TIC-1.PV").expect("PV is in the report");
    let good = 100.0 - lost as f64 / seconds as f64 * 100.0;
    assert!((pv[9].parse::<f64>().unwrap() - good).abs() < 1.0, "{pv:?}, expected {good} % good");

    let (code, out, err) = run("export", &path, &[&period[..], &["--tags", "TIC-1.PV", "--every", "1min"]].concat());
    assert_eq!(code, Some(0), "{err}");
    let minutes = out.lines().filter(|line| line.ends_with(",,bad: history damaged")).count() as i64;
    // Either gives up 800 s too much at each end, at the most.
    assert!((minutes - lost / 60).abs() <= 2 * 800 / 60 + 2, "{minutes} minutes of {lost} s");
    let (code, _, err) = run("alarms", &path, &[&period[..], &["--stats"]].concat());
    assert_eq!(code, Some(0), "{err}");
}

/// A station that was killed has them in its log, and its history gets them at the next start.
#[test]
fn a_report_says_which_entries_only_the_audit_log_has() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    history(&path, |_, _| Vec::new());
    let at = |second| START.parse::<Timestamp>().unwrap() + SignedDuration::from_secs(second);
    let mut entries = [60, 120, 5_000]
        .map(|second| ActionRecord::new(at(second), "anna", RecordedAction::Write, "TIC-1.SV", "verified"));
    AuditLog::open(&beside(&path)).unwrap().0.append(&mut entries).unwrap();
    let period = ["--from", START, "--to", "2026-03-02T07:00:00Z", "--out", "-"];
    let missing = |stored: &[ActionRecord]| {
        let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
        let store = Store::open(&path, &def, at(9_000)).unwrap().store;
        store.append(&stored.iter().cloned().map(Record::Action).collect::<Vec<_>>()).unwrap();
        store.checkpoint().unwrap();
        drop(store);
        let (code, out, err) = run("report", &path, &period);
        assert_eq!(code, Some(0), "{err}");
        let row = cells(&out).into_iter().find(|row| row[0].starts_with("records not stored yet"));
        assert_eq!(row.is_some(), err.contains("only the audit log has"), "{err}");
        row.map(|row| row[1].clone())
    };
    assert_eq!(missing(&[]).as_deref(), Some("2"), "the third is of the next period");
    assert_eq!(missing(&entries[..1]).as_deref(), Some("1"));
    assert_eq!(missing(&entries[1..2]), None);
    std::fs::write(beside(&path), "not a log\n").unwrap();
    assert_eq!(missing(&[]).as_deref(), Some("?"));
}

#[test]
fn suppressed_and_annunciated_alarms_are_counted_apart() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    history(&path, |_, start| {
        use AlarmEvent::{
            Raised, RaisedSuppressed, ReturnedSuppressed, ReturnedToNormal, SuppressedByDesign, Unsuppressed,
        };
        let steps = [
            (10, "temperature high", Raised),
            (70, "temperature high", ReturnedToNormal),
            (100, "level low", SuppressedByDesign),
            (120, "level low", RaisedSuppressed),
            (420, "level low", ReturnedSuppressed),
            (500, "level low", RaisedSuppressed),
            (560, "level low", ReturnedSuppressed),
            (600, "level low", Unsuppressed),
        ];
        let record = |(at, text, step)| {
            let at = start + SignedDuration::from_secs(at);
            Record::Alarm(AlarmRecord::new(at, "TIC-1.PV", text, Priority::High, step))
        };
        steps.map(record).into()
    });
    let period = ["--from", START, "--to", "2026-03-02T08:00:00Z"];
    let (code, out, err) = run("alarms", &path, &[&period[..], &["--stats"]].concat());
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains(": 1 alarms, 2 more while suppressed"), "{out}");
    let (code, out, err) = run("alarms", &path, &[&period[..], &["--stats", "--json"]].concat());
    assert_eq!(code, Some(0), "{err}");
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((json["raised"].as_u64(), json["suppressed"].as_u64()), (Some(1), Some(2)), "{out}");
    let (code, out, err) = run("report", &path, &[&period[..], &["--out", "-"]].concat());
    assert_eq!(code, Some(0), "{err}");
    let row = |first: &str, second: &str| cells(&out).into_iter().find(|row| row[0] == first && row[1] == second);
    assert!(row("high", "1").is_some_and(|row| row[2] == "2"), "{out}");
    let suppressed = row("high", "TIC-1.PV").expect("a row of suppressed alarms");
    assert_eq!(suppressed[2..5], ["level low", "2", "6.0"], "{out}");
}

#[test]
fn a_report_names_the_last_entry_of_the_audit_log() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    let begun = Timestamp::now();
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--for", "1s", "--port", "L1=/dev/none", "--history"])
            .arg(&path)
            .env("XDG_STATE_HOME", folder.path()),
    );
    assert_eq!(station.end(), Some(0), "{:?}", station.said);
    let log = std::fs::read_to_string(folder.path().join("tank.audit.jsonl")).unwrap();
    let last: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
    let from = (begun - SignedDuration::from_secs(1)).to_string();
    let (code, out, err) = run("report", &path, &["--from", &from, "--out", "-"]);
    assert_eq!(code, Some(0), "{err}");
    let rows = cells(&out);
    let fact = |name: &str| rows.iter().find(|row| row[0] == name).map(|row| row[1].clone());
    assert_eq!(fact("audit entry"), Some(last["n"].to_string()), "{log}");
    assert_eq!(fact("audit hash").as_deref(), last["hash"].as_str(), "{log}");
}

#[test]
fn no_output_file_is_written_into_the_history() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    history(&path, |_, _| Vec::new());
    let before = std::fs::read(&path).unwrap();
    let own = path.to_str().unwrap();
    for args in [
        &["report", "tank", "--from", START, "--out", own][..],
        &["export", "tank", "--from", START, "--out", own],
        &["run", "tank", "--for", "1s", "--port", "L1=/dev/none", "--log", own],
        &["demo", "--headless", "--for", "1s", "--log", own],
        &["demo", "--headless", "--for", "1s", "--report", own],
    ] {
        let mut command = sightglass();
        command.args(args).args(["--history", own]).env("XDG_STATE_HOME", folder.path());
        let output = command.output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {err}");
        assert!(err.contains("tank.duckdb belongs to the station: choose another file"), "{args:?}: {err}");
        assert!(std::fs::read(&path).unwrap() == before, "{args:?} changed the history");
    }
}

#[test]
fn a_history_of_an_older_version_is_read_after_one_start() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    history(&path, |_, _| Vec::new());
    // The last migrations only add tables, and columns.
    let old = duckdb::Connection::open(&path).unwrap();
    old.execute_batch(
        "DROP TABLE archive; DROP TABLE recorded; DROP TABLE deleted; DROP TABLE import; DROP TABLE batch; DROP TABLE report;
         DROP TABLE control_run; ALTER TABLE sample DROP COLUMN rest; ALTER TABLE alarm_journal DROP COLUMN value_rest;
         DELETE FROM schema_version WHERE version > 8; CHECKPOINT",
    )
    .unwrap();
    drop(old);
    let period = ["--from", START, "--to", "2026-03-02T08:00:00Z"];
    let commands = [("report", &["--out", "-"][..]), ("export", &["--tags", "TIC-1.PV"]), ("alarms", &["--stats"])];
    let start = format!("sightglass run PLANT --history {}", path.display());
    for (command, args) in commands {
        let (code, out, err) = run(command, &path, &[&period[..], args].concat());
        assert_eq!((code, &*out), (Some(1), ""), "{command}: {err}");
        assert!(err.contains("older version of sightglass (schema 8, this one reads 16)"), "{command}: {err}");
        assert!(err.contains(&start), "{command}: {err}");
    }
    let started = ["--for", "1s", "--port", "L1=/dev/none"];
    let (code, _, err) = run("run", &path, &started);
    assert_eq!(code, Some(0), "{err}");
    for (command, args) in commands {
        let (code, _, err) = run(command, &path, &[&period[..], args].concat());
        assert_eq!(code, Some(0), "{command}: {err}");
    }
}

#[test]
fn an_export_has_no_rows_beyond_the_present() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    history(&path, |_, _| Vec::new());
    let period = ["--from", "2020-01-01T00:00Z", "--to", "2099-01-01T00:00Z", "--every", "24h"];
    let (code, out, err) = run("export", &path, &[&period[..], &["--tags", "TIC-1.PV"]].concat());
    assert_eq!(code, Some(0), "{err}");
    let last = cells(&out).pop().unwrap()[0].parse::<Timestamp>().unwrap();
    let now = Timestamp::now();
    assert!(now - SignedDuration::from_hours(25) < last && last <= now, "{last}");
}

/// Two simulated controllers; the first shows °F with two decimals, the second °C with one.
const TWO: &str = r#"
title = "Two controllers"
time_zone = "UTC"

[[line]]
name = "L1"
mode = "tcp"
host = "127.0.0.1"

[[device]]
name = "TIC-1"
profile = "fuji_pxr"
line = "L1"
unit = 1
fast = "500ms"
slow = "1s"
tag = [{ name = "P-F", simulate = { start = "°F" } }, { name = "P-DP", simulate = { start = 2 } }]

[[device]]
name = "TIC-2"
profile = "fuji_pxr"
line = "L1"
unit = 2
fast = "500ms"
slow = "1s"
"#;

/// The simulated devices, a station on them, and the folders of both.
struct Running {
    folder: tempfile::TempDir,
    sockets: std::path::PathBuf,
    def: Arc<PlantDef>,
    _processes: [Process; 2],
}

impl Running {
    fn start(plant: &str) -> Running {
        let (folder, sockets) = (folder(), sockets());
        let file = folder.path().join("two.toml");
        let rules = format!("\n[[access.trusted]]\nuser = \"{}\"\nrole = \"technician\"\n", own_user());
        std::fs::write(&file, plant.to_owned() + &rules).unwrap();
        let def = profile::load(&file, &Search::shipped()).unwrap();
        let mut sim = Process::start(sightglass().arg("sim").arg(&file).args(["--tcp", "127.0.0.1:0"]));
        let port = sim.wait_for(" on 127.0.0.1:").rsplit(' ').next().unwrap().to_owned();
        let mut station = Process::start(
            sightglass()
                .arg("run")
                .arg(&file)
                .args(["--port", &format!("L1={port}")])
                .env("XDG_RUNTIME_DIR", &sockets)
                .env("XDG_STATE_HOME", folder.path()),
        );
        station.wait_for("TIC-2 (unit 2): responding");
        Running { folder, sockets, def, _processes: [sim, station] }
    }

    fn run(&self, args: &[&str]) -> (Option<i32>, String, String) {
        let file = self.folder.path().join("two.toml");
        let mut command = sightglass();
        command.arg(args[0]).arg(file).args(&args[1..]);
        let output = command.env("XDG_RUNTIME_DIR", &self.sockets).env("XDG_STATE_HOME", self.folder.path()).output();
        let Output { status, stdout, stderr } = output.unwrap();
        (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
    }
}

#[test]
fn an_export_takes_more_tags_than_one_query_and_keeps_units() {
    let running = Running::start(TWO);
    let stored: Vec<&str> = running.def.tags.iter().filter(|tag| tag.is_stored()).map(|tag| &*tag.name).collect();
    assert!(64 < stored.len(), "{} tags fit into one query", stored.len());
    let from = (Timestamp::now() - SignedDuration::from_secs(5)).to_string();
    let end = Instant::now() + TIMEOUT;
    // Until every tag has been read, its value is on disk, and the unit of the first device is known.
    let rows = loop {
        let (code, out, err) = running.run(&["export", "--from", &from, "--every", "500ms"]);
        assert_eq!(code, Some(0), "{err}");
        let rows = cells(&out);
        let missing = rows.last().unwrap()[2..].iter().step_by(2).filter(|quality| *quality != "good").count();
        if missing == 0 && rows[0].iter().any(|cell| cell == "TIC-1.SV °F") {
            break rows;
        }
        assert!(Instant::now() < end, "{missing} tags have no good value in\n{out}");
    };
    let [header, .., last] = &rows[..] else { panic!("{rows:?}") };
    assert_eq!(header.len(), 1 + 2 * stored.len());
    for (name, cell) in stored.iter().zip(header[1..].iter().step_by(2)) {
        assert!(cell.starts_with(name), "{cell} is not {name}");
    }
    let value = |head: &str| {
        let column = header.iter().position(|cell| cell == head).unwrap_or_else(|| panic!("no {head} in {header:?}"));
        &*last[column]
    };
    assert_eq!((value("TIC-1.SV °F"), value("TIC-2.SV °C")), ("70.00", "70.0"));

    // The report has the same units and decimals.
    let (code, out, err) = running.run(&["report", "--from", &from, "--out", "-"]);
    assert_eq!(code, Some(0), "{err}");
    let row = |tag: &str| cells(&out).into_iter().find(|row| row[0] == tag).unwrap_or_else(|| panic!("{out}"));
    assert_eq!(row("TIC-1.SV")[1..6], ["°F", "70.00", "70.00", "70.000", "70.00"]);
    assert_eq!(row("TIC-2.SV")[1..6], ["°C", "70.0", "70.0", "70.00", "70.0"]);
}
