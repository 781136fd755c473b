//! What the history costs: one commit, rows a second, bytes a sample, and reading a curve of a week; with `-- load`, what
//! queries cost the recording; with `-- import`, what an import does, with
//! `-- calculated`, what calculated tags do; with `-- year`, what a year of 1,000 tags costs; with
//! `-- station`, what a station of a shipped plant stores of it.
#![allow(clippy::print_stdout, missing_docs)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

#[path = "history/calculated.rs"]
mod calculated;
#[path = "history/cold.rs"]
mod cold;
#[path = "history/import.rs"]
mod import;
#[path = "history/load.rs"]
mod load;
#[path = "history/station.rs"]
mod station;
#[path = "history/year.rs"]
mod year;
#[allow(unused_imports, clippy::unwrap_used, reason = "only the slave on TCP is needed")]
#[path = "support/mod.rs"]
mod support;

use std::{hint::black_box, path::Path, sync::Arc, time::Duration, time::Instant};

use criterion::{Criterion, criterion_group};
use jiff::Timestamp;
use sightglass::api::{
    history::{Query, Store},
    plant::{ByteOrder, DataType, Decimals, DeviceId, PlantDef, Point, Record, Sample, Table, TagDef, TagId},
    report::Period,
};

/// Tags of the tank: temperatures and outputs that change, setpoints and switches that rarely do.
const CHANGING: u16 = 8;
const TAGS: u16 = 24;
const WEEK: i64 = 7 * 86_400;

fn tag(id: u16) -> TagDef {
    let point = Point { table: Table::Input, address: id, kind: DataType::I16, order: ByteOrder::Abcd, field: None };
    let plain = TagDef::new(TagId(id), DeviceId(0), &format!("TIC-1.T{id}"), point);
    TagDef { scale: 0.1, decimals: Decimals::Fixed(1), unit: "°C".into(), ..plain }
}

fn tank() -> Arc<PlantDef> {
    Arc::new(PlantDef {
        name: "tank".into(),
        title: "Water tank".into(),
        tags: (0..TAGS).map(tag).collect(),
        ..PlantDef::default()
    })
}

/// The records of one second: the changing tags wander by a tenth, the others are stored once a minute.
fn second(at: i64) -> Vec<Record> {
    let stamp = |id: u16| {
        Timestamp::from_microsecond(at * 1_000_000 + i64::from(id) * 37_113 + at % 97 * 211).expect("in range")
    };
    let wander = |id: u16| {
        let phase = at as f64 / (300.0 + f64::from(id) * 41.0);
        let noise = (at.wrapping_mul(2_654_435_761) >> 7).rem_euclid(5) as f64 - 2.0;
        ((60.0 + 10.0 * phase.sin()) * 10.0 + noise).round() / 10.0
    };
    let changing = (0..CHANGING).map(|id| Record::Sample(TagId(id), Sample::good(wander(id), stamp(id))));
    let steady = (CHANGING..TAGS)
        .filter(|id| at % 60 == i64::from(*id))
        .map(|id| Record::Sample(TagId(id), Sample::good(f64::from(id) * 10.0, stamp(id))));
    changing.chain(steady).collect()
}

fn fill(path: &Path, def: &Arc<PlantDef>, seconds: i64) -> Store {
    let store = Store::open(path, def, Timestamp::UNIX_EPOCH).expect("a new file").store;
    let (start, mut rows) = (Instant::now(), 0);
    let all: Vec<i64> = (0..seconds).collect();
    for minutes in all.chunks(600) {
        let records: Vec<Record> = minutes.iter().flat_map(|at| second(*at)).collect();
        rows += records.len();
        store.append(&records).expect("appended");
    }
    store.checkpoint().expect("checkpoint");
    let (spent, bytes) = (start.elapsed().as_secs_f64(), store.file_bytes());
    println!("{rows} rows in {spent:.2} s: {:.0} rows/s in commits of ten minutes", rows as f64 / spent);
    println!("{bytes} bytes on disk: {:.2} bytes a sample", bytes as f64 / rows as f64);
    store
}

fn history(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let def = tank();
    let store = fill(&folder.path().join("week.duckdb"), &def, WEEK);
    let end = Timestamp::from_second(WEEK).expect("in range");
    for (name, from) in [("hour", WEEK - 3600), ("day", WEEK - 86_400), ("week", 0)] {
        let from = Timestamp::from_second(from).expect("in range");
        let query = Query::Series { tags: vec![TagId(0)], from, to: end, buckets: 160 };
        c.bench_function(&format!("curve of a {name}"), |b| b.iter(|| black_box(store.answer(&query, end))));
    }
    let from = Timestamp::from_second(WEEK - 8 * 3600).expect("in range");
    let query = Query::Report { period: Period::free(from, end) };
    c.bench_function("report of eight hours", |b| b.iter(|| black_box(store.answer(&query, end))));
    let mut at = WEEK;
    c.bench_function("commit of one second", |b| {
        b.iter(|| {
            at += 1;
            store.append(&second(at)).expect("appended");
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_millis(300));
    targets = history
}
fn main() {
    let words: Vec<String> = std::env::args().collect();
    type Mode = (&'static str, fn(&[String]));
    let modes: [Mode; 5] = [
        ("load", load::main),
        ("import", import::main),
        ("calculated", calculated::main),
        ("year", year::main),
        ("station", station::main),
    ];
    let mode = modes.iter().find_map(|(name, mode)| Some((words.iter().position(|word| word == name)?, mode)));
    match mode {
        Some((place, mode)) => mode(&words[place + 1..]),
        None => {
            benches();
            Criterion::default().configure_from_args().final_summary();
        }
    }
}
