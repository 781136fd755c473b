//! Every format of a report, read by programs that we did not write, beside figures that they compute from the samples themselves.

use std::{path::Path, process::Command};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    history::Store,
    plant::{AlarmEvent, AlarmRecord, Cause, PlantDef, Priority, Record, Sample},
    profile::{self, Search},
};

use crate::support::{folder, have, office, sightglass};

/// Reads every format strictly and compares each figure; computes min, mean, max, last, difference and good time from the samples.
const READER: &str = include_str!("formats/reader.py");

/// Samples of a period with a gap, of a counter that rolls over, and an alarm whose text is a formula; also as CSV for the reader.
fn history(path: &Path, from: Timestamp, seconds: i64) -> String {
    let def: std::sync::Arc<PlantDef> = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let tag = |name: &str| def.tag_named(name).unwrap();
    let (pv, kwh) = (tag("TIC-1.PV"), tag("PLC-1.HEATER.KWH"));
    let at = |second: i64| from + SignedDuration::from_secs(second);
    let mut records = Vec::new();
    let mut csv = String::from("tag,second,value\n");
    for second in (-60..seconds + 60).step_by(10) {
        let silent = (3_600..4_200).contains(&second);
        let value = 50.0 + (second % 700) as f64 / 10.0;
        let counted = ((second + 60) as f64 / 100.0) % 97.0;
        for (tag, name, value) in [(pv, "TIC-1.PV", value), (kwh, "PLC-1.HEATER.KWH", counted)] {
            let sample = if silent { Sample::bad(Cause::Timeout, at(second)) } else { Sample::good(value, at(second)) };
            records.push(Record::Sample(tag, sample));
            let cell = if silent { String::new() } else { value.to_string() };
            csv.push_str(&format!("{name},{second},{cell}\n"));
        }
    }
    let alarm = AlarmRecord {
        reason: Some("=1+2".into()),
        by: Some("@anna".into()),
        ..AlarmRecord::new(at(5_000), "TIC-1.PV", "+temperature high", Priority::High, AlarmEvent::Acknowledged)
    };
    records.push(Record::Alarm(alarm));
    let store = Store::open(path, &def, at(-60)).unwrap().store;
    records.chunks(10_000).for_each(|part| store.append(part).unwrap());
    store.checkpoint().unwrap();
    csv
}

fn check(zone_file: Option<&str>, from: &str, to: &str, language: &str) {
    let Some(python) = office().filter(|_| have("pdftotext", "poppler-utils")) else { return };
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    let (begin, end): (Timestamp, Timestamp) = (from.parse().unwrap(), to.parse().unwrap());
    let samples = folder.path().join("samples.csv");
    let seconds = end.duration_since(begin).as_secs();
    std::fs::write(&samples, history(&path, begin, seconds)).unwrap();
    let plant = match zone_file {
        None => "tank".to_owned(),
        Some(zone) => {
            let text = sightglass().args(["profiles", "tank"]).output().unwrap().stdout;
            let text = String::from_utf8(text).unwrap().replace("Asia/Bangkok", zone);
            assert!(text.contains(zone), "the plant file has a time zone");
            let file = folder.path().join("tank.toml");
            std::fs::write(&file, text).unwrap();
            file.display().to_string()
        }
    };
    let out = folder.path().join("out/");
    let made = sightglass()
        .args(["report", &plant, "--from", from, "--to", to, "--format", "csv,text,html,json,xlsx,docx,pdf,parquet"])
        .args(["--language", language, "--out"])
        .arg(&out)
        .arg("--history")
        .arg(&path)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let read =
        Command::new(python).args(["-c", READER]).arg(&out).arg(&samples).arg(seconds.to_string()).output().unwrap();
    let (said, error) = (String::from_utf8_lossy(&read.stdout), String::from_utf8_lossy(&read.stderr));
    assert!(read.status.success() && said.contains("figures agree"), "{said}\n{error}");
}

#[test]
fn every_format_has_the_figures_of_the_samples() {
    check(None, "2026-03-02T06:00:00+07:00", "2026-03-02T14:00:00+07:00", "en");
}

#[test]
fn every_format_has_the_figures_in_thai() {
    check(None, "2026-03-02T06:00:00+07:00", "2026-03-02T14:00:00+07:00", "th");
}

#[test]
fn a_day_of_23_hours_has_its_figures() {
    check(Some("Europe/Berlin"), "2026-03-29T00:00:00+01:00", "2026-03-30T00:00:00+02:00", "en");
}

#[test]
fn a_day_of_25_hours_has_its_figures() {
    check(Some("Europe/Berlin"), "2026-10-25T00:00:00+02:00", "2026-10-26T00:00:00+01:00", "en");
}
