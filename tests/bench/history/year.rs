//! A year of 1,000 tags, stored on change: bytes, start, trends, reports, beside other ways to keep one day of it.
//!
//! `cargo bench --bench history -- year [DAYS] [RAW_DAYS]`: minutes and hours of so many days (365), samples of the last of
//! them (31). One day is stored and archived as a station does it; the others are its copies, moved in time.

use std::{path::Path, process::Command, time::Instant};

use duckdb::Connection;
use jiff::{Timestamp, tz::TimeZone};
use sightglass::api::{
    history::{LeftOut, Query, Store, sql, tiers::Tier},
    plant::{ParquetVersion, TagId},
    report::Period,
};

use super::{
    cold,
    load::{TAGS, def, memory_kb},
};

/// The day that is stored as a station does it: the last one.
pub const LAST_DAY: i64 = 1_790_035_200;
pub const DAY: i64 = 86_400;
/// Of a tag one second in so many has a new value.
const ONE_IN: i64 = 12;
/// Times that a trend is asked for, each at another place.
const ASKED: usize = 40;

/// Prints what it measured.
pub fn main(words: &[String]) {
    let number = |place: usize, usual: i64| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(usual);
    let (days, raw_days) = (number(0, 365), number(1, 31));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("year.duckdb");
    store_a_day(&path);
    peers(folder.path());
    copy_days(&path.with_extension("archive"), days, raw_days);
    let took = |what: &str, began: Instant| println!("{what}: {:.1} s", began.elapsed().as_secs_f64());
    let began = Instant::now();
    let store = Store::open(&path, &def(), at(LAST_DAY + DAY)).expect("opened").store;
    took("taken up", began);
    let began = Instant::now();
    archive(&store);
    took("months merged", began);
    drop(store);
    let began = Instant::now();
    let store = Store::open(&path, &def(), at(LAST_DAY + DAY)).expect("opened").store;
    println!("opened with {days} days: {:.0} ms", began.elapsed().as_secs_f64() * 1e3);
    sizes(&store, days);
    ask(&store, days, raw_days);
    println!("{} MB resident", memory_kb("VmRSS") / 1_000);
    drop(store);
    cold::ask(&path, days, raw_days);
}

pub fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("in range")
}

/// One value of each tag at the beginning of each minute, and on change in between.
fn store_a_day(path: &Path) {
    drop(Store::open(path, &def(), at(LAST_DAY)).expect("a new file"));
    let db = Connection::open(path).expect("the file");
    db.execute_batch("SET disabled_compression_methods = 'bitpacking'; SET threads = 1").expect("settings");
    for hour in 0..24 {
        let (from, to) = (hour * 3_600 * i64::from(TAGS), (hour + 1) * 3_600 * i64::from(TAGS));
        db.execute_batch(&format!(
            "INSERT INTO sample (utc, tag, value, quality) SELECT make_timestamp({LAST_DAY}000000 + s * 1000000 + k * 1000),
                k::USMALLINT, round(60 + 10 * sin(s / (300.0 + 4 * k)) + (hash(i) % 5)::DOUBLE / 10 - 0.2, 1), 0
             FROM (SELECT i, i // {TAGS} AS s, i % {TAGS} AS k FROM range({from}, {to}) t(i))
             WHERE s % 60 = 0 OR hash(s, k) % {ONE_IN} = 0"
        ))
        .expect("an hour");
    }
    db.execute_batch("CHECKPOINT").expect("checkpoint");
    let rows: u64 = db.query_row("SELECT count(*) FROM sample", [], |row| row.get(0)).expect("counted");
    drop(db);
    let bytes = std::fs::metadata(path).map_or(0, |meta| meta.len());
    println!("a day in the database: {rows} rows, {:.2} bytes a sample", bytes as f64 / rows as f64);
    let store = Store::open(path, &def(), at(LAST_DAY + DAY)).expect("opened").store;
    let began = Instant::now();
    archive(&store);
    println!("archived: {:.2} s an hour", began.elapsed().as_secs_f64() / 24.0);
}

fn archive(store: &Store) {
    while let Some(job) = store.archive_due(at(LAST_DAY + DAY + 600), &LeftOut::default()).expect("known") {
        store.archive(&job).expect("archived");
    }
}

fn copy_days(archive: &Path, days: i64, raw_days: i64) {
    let began = Instant::now();
    let db = Connection::open_in_memory().expect("an engine");
    for back in 1..days {
        let date = at(LAST_DAY - back * DAY).to_zoned(TimeZone::UTC).strftime("%Y-%m-%d").to_string();
        for tier in Tier::ALL.into_iter().filter(|tier| *tier != Tier::Raw || back < raw_days) {
            let last = at(LAST_DAY).to_zoned(TimeZone::UTC).strftime("%Y-%m-%d").to_string();
            let [from, to] = [last, date.clone()].map(|date| archive.join(format!("{}/date={date}", tier.word())));
            std::fs::create_dir_all(&to).expect("a folder");
            let rows = format!(
                "SELECT * REPLACE (utc - INTERVAL {back} DAY AS utc)
                 FROM read_parquet('{}/day.parquet', hive_partitioning = false)",
                from.display()
            );
            let to = format!("'{}/day.parquet'", to.display());
            db.execute_batch(&sql::copy_to(tier, ParquetVersion::V1, &rows, &to)).expect("copied");
        }
    }
    println!("copied: {:.0} s", began.elapsed().as_secs_f64());
}

fn sizes(store: &Store, days: i64) {
    let files = store.files(None).expect("listed");
    for tier in ["raw", "m1", "h1"] {
        let of_tier = files.iter().filter(|file| file.tier.word() == tier);
        let (count, rows, bytes) =
            of_tier.fold((0, 0, 0), |(count, rows, bytes), file| (count + 1, rows + file.rows, bytes + file.bytes));
        println!(
            "{tier}: {count} files, {rows} rows, {} MB, {:.2} bytes a row",
            bytes >> 20,
            bytes as f64 / rows as f64
        );
    }
    let raw: Vec<_> = files.iter().filter(|file| file.tier.word() == "raw").collect();
    let a_day = raw.iter().map(|file| file.bytes).sum::<u64>() as f64 / raw.len() as f64;
    println!("samples of {days} days would have {:.1} GB", a_day * days as f64 / 1e9);
}

fn ask(store: &Store, days: i64, raw_days: i64) {
    let mut seed = 1_u64;
    let mut random = move |below: i64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as i64 % below.max(1)
    };
    for (name, span) in [("1 h", 3_600), ("24 h", DAY), ("7 d", 7 * DAY), ("30 d", 30 * DAY), ("1 year", days * DAY)] {
        for pens in [1, 8] {
            // Where samples answer, only where there are some.
            let reach = if span < 5 * 3_600 { raw_days } else { days } * DAY;
            let (mut times, mut first) = (Vec::new(), 0.0);
            for number in 0..ASKED {
                let to = LAST_DAY + DAY - random(reach - span);
                let tags = (0..pens).map(|pen| TagId((random(120) + pen * 120) as u16)).collect();
                let query = Query::Series { tags, from: at(to - span), to: at(to), buckets: 300 };
                let began = Instant::now();
                store.answer(&query, at(LAST_DAY + DAY)).expect("answered");
                times.push(began.elapsed().as_secs_f64() * 1e3);
                first = if number == 0 { times[0] } else { first };
            }
            times.sort_by(f64::total_cmp);
            let (half, most) = (times[ASKED / 2], times[ASKED * 95 / 100]);
            println!("trend of {name}, {pens} tags: first {first:.0}, p50 {half:.0}, p95 {most:.0} ms");
        }
    }
    let mut times: Vec<f64> = (0..ASKED)
        .map(|_| {
            let at = at(LAST_DAY + DAY - 3_600 - random(raw_days * DAY - 3_600));
            let began = Instant::now();
            store.answer(&Query::Past { at }, self::at(LAST_DAY + DAY)).expect("answered");
            began.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("past instant, all tags: p50 {:.0}, p95 {:.0} ms", times[ASKED / 2], times[ASKED * 95 / 100]);
    for (name, from, to) in [
        ("shift", LAST_DAY - DAY + 6 * 3_600, LAST_DAY - DAY + 14 * 3_600),
        ("month", LAST_DAY - 29 * DAY, LAST_DAY + DAY),
        ("year", LAST_DAY - (days - 1) * DAY, LAST_DAY + DAY),
    ] {
        let period = Period::free(at(from), at(to));
        let began = Instant::now();
        store.answer(&Query::Report { period }, at(LAST_DAY + DAY)).expect("answered");
        println!("report of a {name}, all tags: {:.2} s", began.elapsed().as_secs_f64());
    }
}

/// The same day in other ways, each with its best query for the last hour and the whole day of one tag.
fn peers(folder: &Path) {
    let archive = folder.join("year.archive");
    let db = Connection::open(folder.join("plain.duckdb")).expect("a file");
    let raw = format!("read_parquet('{}/raw/**/*.parquet', hive_partitioning = false)", archive.display());
    let arrival = folder.join("arrival.parquet");
    let began = Instant::now();
    db.execute_batch(&format!(
        "CREATE TABLE sample AS SELECT utc, tag, value, quality FROM {raw} ORDER BY utc; CHECKPOINT"
    ))
    .expect("stored");
    println!("plain DuckDB: stored in {:.1} s", began.elapsed().as_secs_f64());
    db.execute_batch(&format!("COPY sample TO '{}' (FORMAT parquet, COMPRESSION zstd)", arrival.display()))
        .expect("written");
    db.execute_batch(&format!(
        "COPY (SELECT epoch_us(utc), tag, value, quality FROM sample) TO '{}/day.csv' (HEADER false)",
        folder.display()
    ))
    .expect("written");
    let rows: f64 = db.query_row("SELECT count(*) FROM sample", [], |row| row.get(0)).expect("counted");
    let file = |name: &str| std::fs::metadata(folder.join(name)).map_or(0.0, |meta| meta.len() as f64) / rows;
    let store = Store::open(&folder.join("year.duckdb"), &def(), at(LAST_DAY + DAY)).expect("opened").store;
    for (name, span) in [("1 h", 3_600), ("24 h", DAY)] {
        let (from, to) = (at(LAST_DAY + DAY - span), at(LAST_DAY + DAY));
        let sql = |source: &str| {
            format!(
                "SELECT (epoch_us(utc) - {0}) // {1} AS c, min(value), max(value), sum(value * held) / sum(held) FROM (
                    SELECT utc, value, coalesce(lead(epoch_us(utc)) OVER (ORDER BY utc), {2}) - epoch_us(utc) AS held
                    FROM {source} WHERE tag = 500 AND utc >= make_timestamp({0})) GROUP BY c ORDER BY c",
                from.as_microsecond(),
                span * 1_000_000 / 300,
                to.as_microsecond()
            )
        };
        let own = median(|| {
            let query = Query::Series { tags: vec![TagId(500)], from, to, buckets: 300 };
            store.answer(&query, to).expect("answered");
        });
        let count = |source: &str| {
            median(|| {
                let mut statement = db.prepare(&sql(source)).expect("prepared");
                assert!(statement.query_map([], |row| row.get::<_, i64>(0)).expect("asked").count() > 100);
            })
        };
        let arrival = format!("'{}'", arrival.display());
        let (plain, parquet) = (count("sample"), count(&arrival));
        println!(
            "trend of {name}, 1 tag: {own:.1} ms; plain DuckDB {:.2}, Parquet as it came {:.2} times",
            plain / own,
            parquet / own
        );
        match sqlite(folder, from, to, span) {
            Some(sqlite) => println!("  SQLite with index {:.2} times", sqlite / own),
            None => println!("  SQLite: no python3"),
        }
    }
    println!(
        "bytes a sample: plain DuckDB {:.2}, Parquet as it came {:.2}, SQLite with index {:.2}",
        file("plain.duckdb"),
        file("arrival.parquet"),
        file("day.sqlite")
    );
}

/// The median of some runs, in ms; the first one is not counted.
fn median(mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..10)
        .map(|_| {
            let began = Instant::now();
            run();
            began.elapsed().as_secs_f64() * 1e3
        })
        .skip(1)
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// The same by SQLite, unweighted: it has no faster way to weight.
fn sqlite(folder: &Path, from: Timestamp, to: Timestamp, span: i64) -> Option<f64> {
    let script = "
import csv, os, sqlite3, sys, time
folder, start, end, step = sys.argv[1], *map(int, sys.argv[2:])
path = folder + '/day.sqlite'
fresh = not os.path.exists(path)
db = sqlite3.connect(path)
if fresh:
    db.execute('CREATE TABLE sample (utc INTEGER, tag INTEGER, value REAL, quality INTEGER)')
    db.executemany('INSERT INTO sample VALUES (?, ?, ?, ?)', csv.reader(open(folder + '/day.csv')))
    db.execute('CREATE INDEX by_tag ON sample (tag, utc)')
    db.commit()
times = []
for _ in range(10):
    began = time.perf_counter()
    db.execute('SELECT (utc - ?) / ? AS c, min(value), max(value), avg(value) FROM sample WHERE tag = 500 AND utc >= ? AND utc < ? GROUP BY c', (start, step, start, end)).fetchall()
    times.append((time.perf_counter() - began) * 1e3)
print(sorted(times[1:])[4])
";
    let numbers = [from.as_microsecond(), to.as_microsecond(), span * 1_000_000 / 300].map(|number| number.to_string());
    let output = Command::new("python3").args(["-c", script]).arg(folder).args(numbers).output().ok()?;
    String::from_utf8(output.stdout).ok()?.trim().parse().ok()
}
