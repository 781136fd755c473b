//! Closed hours as files: what `sightglass history` says of them, and what other engines read.

use std::{path::Path, process::Command, sync::Arc};

use jiff::{SignedDuration, Timestamp};
use sightglass::api::{
    history::{LeftOut, Store},
    plant::{HistoryDef, ParquetVersion, PlantDef, Record, Sample},
    profile::{self, Search},
};

use crate::support::{engines, folder, sightglass};

const START: &str = "2026-03-02T06:00:00Z";
/// Samples of each tag, one a second: 26 hours.
const SECONDS: i64 = 26 * 3_600;

/// A closed history of the tank, archived up to its last hour.
pub fn archived(path: &Path, parquet: ParquetVersion) {
    let def = profile::load(Path::new("tank"), &Search::shipped()).unwrap();
    let def = Arc::new(PlantDef { history: HistoryDef { parquet, ..def.history }, ..PlantDef::clone(&def) });
    let start: Timestamp = START.parse().unwrap();
    let store = Store::open(path, &def, start).unwrap().store;
    let tags = ["TIC-1.PV", "TIC-1.SV"].map(|name| def.tag_named(name).unwrap());
    let row = |second: i64| {
        let sample = |value| Sample::good(value, start + SignedDuration::from_secs(second));
        [Record::Sample(tags[0], sample((second % 1_000) as f64 / 10.0)), Record::Sample(tags[1], sample(70.0))]
    };
    for part in (0..SECONDS).collect::<Vec<i64>>().chunks(20_000) {
        store.append(&part.iter().flat_map(|second| row(*second)).collect::<Vec<_>>()).unwrap();
    }
    let now = start + SignedDuration::from_secs(SECONDS);
    while let Some(job) = store.archive_due(now, &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    store.checkpoint().unwrap();
}

/// `history`, a subcommand of it where one is named, on the tank.
fn history(path: &Path, command: &[&str], args: &[&str]) -> (Option<i32>, String) {
    let mut history = sightglass();
    let output =
        history.arg("history").args(command).args(["tank", "--history"]).arg(path).args(args).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

#[test]
fn the_archive_is_listed_and_verified() {
    let folder = folder();
    let path = folder.path().join("tank.duckdb");
    archived(&path, ParquetVersion::V1);
    let (code, text) = history(&path, &[], &[]);
    assert_eq!(code, Some(0), "{text}");
    for expect in [
        "stored    2026-03-02 13:00:00 to 2026-03-03 14:59:59",
        "7200 samples not archived yet",
        "raw       2026-03-02 13:00:00 to 2026-03-03 14:00:00: 180000 rows",
        "m1        2026-03-02 13:00:00 to 2026-03-03 14:00:00: 3000 rows",
        "h1        2026-03-02 13:00:00 to 2026-03-03 14:00:00: 50 rows",
        "may take 50 % of the disk, ",
        "next      raw/date=2026-03-02/day.parquet is deleted ",
        ": the history would have more than 50 % of the disk",
    ] {
        assert!(text.contains(expect), "{expect} in\n{text}");
    }
    let (code, text) = history(&path, &["verify"], &[]);
    assert!(code == Some(0) && text.contains("each is as it was written"), "{text}");
    let (code, text) = history(&path, &[], &["--json"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((code, json["samples"].as_u64()), (Some(0), Some(7_200)));
    // One bit, and one file.
    let day = folder.path().join("tank.archive/raw/date=2026-03-02/day.parquet");
    let mut bytes = std::fs::read(&day).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&day, bytes).unwrap();
    std::fs::remove_file(folder.path().join("tank.archive/h1/date=2026-03-02/day.parquet")).unwrap();
    let (code, text) = history(&path, &["verify"], &[]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("raw/date=2026-03-02/day.parquet: its bytes were changed"), "{text}");
    assert!(text.contains("h1/date=2026-03-02/day.parquet: No such file"), "{text}");
    assert!(text.contains("2 of "), "{text}");
}

#[test]
fn other_engines_read_the_archive_as_it_lies() {
    let Some(python) = engines() else { return };
    // 25 hours of one sample a second, each in force for one second: both sums are those of 0.0 … 99.9, ninety times.
    let tenths = (0..90_000).map(|second| second % 1_000).sum::<u32>();
    let expect = format!("180000 {tenths} 90000 2026-03-02 06:00:00 2026-03-03 06:59:59 1500 {tenths} 90000");
    for version in ParquetVersion::ALL {
        let folder = folder();
        archived(&folder.path().join("tank.duckdb"), version);
        let archive = folder.path().join("tank.archive");
        for engine in ["polars", "pyarrow", "duckdb", "datafusion", "clickhouse", "spark"] {
            let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/archive.py");
            let output = Command::new(&python).args([script, engine]).arg(&archive).output().unwrap();
            let text = String::from_utf8(output.stdout).unwrap();
            assert!(output.status.success(), "{engine}: {}", String::from_utf8_lossy(&output.stderr));
            assert_eq!(text.trim(), expect, "{engine}, Parquet {version:?}");
        }
    }
}
