//! A station of a shipped plant in virtual time, as fast as the machine can: plant task, links, simulated devices, the history
//! and its archive are those of `sightglass run`; the clock, the lines and the threads are not.
//!
//! `cargo bench --bench history -- station [DAYS] [PLANT] [MINUTES] [COMMIT]`: so many days (365) of a plant (`lab`), or
//! as many as so many minutes of real time (10) are enough for, with a commit every so many virtual seconds (60: with one a
//! second the year would be one of syncs).

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use super::load::memory_kb;
use duckdb::Connection;
use jiff::Timestamp;
use sightglass::api::{
    bus::{Clock, worker},
    history::{
        ArchiveFile, Store, sync_and_hash,
        thread::{offer, start_with},
        tiers::{HOUR, Tier, in_milliseconds},
    },
    plant::{HistoryDef, PlantDef, Record},
    profile::{self, Search},
    sim::{Simulator, SimulatorHandle, in_memory},
    station,
};

/// 20 January 2026, midnight in UTC: some days before the end of a month.
const BEGIN: i64 = 1_768_867_200;
const DAY: Duration = Duration::from_secs(86_400);
/// So many days of samples, and of minutes, are kept: a run of some weeks deletes both.
const KEPT_DAYS: [u32; 2] = [7, 14];
/// A good value repeats within a minute and counts for two and a half: what is longer is a gap.
const GAP_S: i64 = 150;

/// What was sent to the history: samples by hour, and what found its queue full.
#[derive(Default)]
struct Sent {
    samples: BTreeMap<i64, u64>,
    lost: u64,
}

/// Prints what it measured.
pub fn main(words: &[String]) {
    let number = |place: usize, usual: u64| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(usual);
    let plant = words.get(1).filter(|word| !word.starts_with("--")).map_or("lab", String::as_str);
    let (days, minutes, commit) = (number(0, 365), number(2, 10), number(3, 60));
    let def = profile::load(Path::new(plant), &Search::shipped()).expect("a shipped plant");
    let [samples, minutes_kept] = KEPT_DAYS.map(Some);
    let history = HistoryDef { keep_samples_days: samples, keep_minutes_days: minutes_kept, ..def.history };
    let def = Arc::new(PlantDef { history, ..PlantDef::clone(&def) });
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("year.duckdb");
    println!("{}: {} tags on {} lines, a commit every {commit} s", def.title, def.tags.len(), def.lines.len());
    let sent = Arc::new(Mutex::new(Sent::default()));
    let began = Instant::now();
    let limit = Duration::from_secs(60 * minutes);
    let (done, status) = run(&def, &path, days, limit, Duration::from_secs(commit), &sent);
    let real = began.elapsed().as_secs_f64();
    println!("{done} days in {real:.0} s: {:.0} times real time", done as f64 * 86_400.0 / real);
    println!("{} rows stored, {} lost; trouble: {}", status.0, status.1, status.2.as_deref().unwrap_or("none"));
    let sent = sent.lock().expect("not poisoned");
    let count: u64 = sent.samples.values().sum();
    println!("{count} samples, {} records found the queue full", sent.lost);
    let began = Instant::now();
    let now = Timestamp::from_second(BEGIN).expect("in range") + Duration::from_secs(done * DAY.as_secs());
    let opened = Store::open(&path, &def, now).expect("opened");
    println!(
        "opened again in {:.0} ms: {}",
        began.elapsed().as_secs_f64() * 1e3,
        opened.trouble.unwrap_or("sound".into())
    );
    let files = opened.store.files(None).expect("listed");
    println!("database {:.1} MB", opened.store.file_bytes() as f64 / 1e6);
    let folder = opened.store.archive_folder();
    drop(opened.store);
    sizes(&files, done);
    verify(&files, &folder, &sent.samples);
    deleted_and_gaps(&path, &files, &folder);
}

/// Runs the station until the days or the time are over. Gives the days, and rows, losses and trouble of the history.
fn run(
    def: &Arc<PlantDef>,
    path: &Path,
    days: u64,
    limit: Duration,
    commit: Duration,
    sent: &Arc<Mutex<Sent>>,
) -> (u64, (u64, u64, Option<String>)) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
    runtime.expect("a runtime").block_on(async {
        let clock = Clock::starting_at(Timestamp::from_second(BEGIN).expect("in range"), 1.0);
        let simulator = SimulatorHandle::spawn_for(def, Simulator::new(def).expect("a simulation"), clock);
        worker::simulate();
        let history = start_with(path, def.clone(), clock, commit, Arc::new(Store::answer)).expect("a history");
        let (records, stored) = (history.records.clone(), history.status.clone());
        let sent = sent.clone();
        let observer = move |batch: &[Record]| {
            let mut sent = sent.lock().expect("not poisoned");
            for record in batch {
                if let Record::Sample(_, sample) = record {
                    *sent.samples.entry(in_milliseconds(sample.at).as_microsecond() / HOUR).or_default() += 1;
                }
            }
            sent.lost += offer(&records, batch.to_vec());
        };
        let station = station::start_transient(def.clone(), clock, in_memory(def, &simulator), Box::new(observer));
        let (began, mut done) = (Instant::now(), 0);
        while done < days && began.elapsed() < limit {
            clock.sleep(DAY).await;
            done += 1;
            if done.is_power_of_two() || done % 50 == 0 {
                let (real, resident) = (began.elapsed().as_secs_f64(), memory_kb("VmRSS") / 1_000);
                println!(
                    "  day {done}: {real:.0} s, {resident} MB resident, {} without files",
                    memory_kb("RssAnon") / 1_000
                );
            }
        }
        station.stop().await;
        history.ended().await;
        let status = stored.borrow().clone();
        (done, (status.rows, status.lost, status.trouble))
    })
}

fn sizes(files: &[ArchiveFile], days: u64) {
    for tier in Tier::ALL {
        let of_tier = || files.iter().filter(|file| file.tier == tier);
        let (rows, bytes) = of_tier().fold((0, 0), |(rows, bytes), file| (rows + file.rows, bytes + file.bytes));
        // A file of a month may begin before the record.
        let span = of_tier().map(|file| file.to - file.from).sum::<i64>() as f64 / (24 * HOUR) as f64;
        let span = span.min(days as f64);
        let year = bytes as f64 / span * 365.0 / 1e6;
        println!(
            "{}: {} files of {span:.1} days, {rows} rows, {:.2} bytes a row, {:.2} MB; a year of it has {year:.0} MB",
            tier.word(),
            of_tier().count(),
            bytes as f64 / rows as f64,
            bytes as f64 / 1e6
        );
    }
    if days < 365 {
        println!("what stands for a year is that of {days} days, extrapolated");
    }
}

/// What `history verify` does; and whether each file has as many samples as were sent for its time.
fn verify(files: &[ArchiveFile], folder: &Path, sent: &BTreeMap<i64, u64>) {
    let unsound = files.iter().filter(|file| {
        let found = sync_and_hash(&folder.join(&file.path));
        !found.is_ok_and(|(bytes, sha256)| (bytes, &sha256) == (file.bytes, &file.sha256))
    });
    println!("verified {} files: {} are not as they were written", files.len(), unsound.count());
    let raw = || files.iter().filter(|file| file.tier == Tier::Raw);
    let differing: Vec<_> = raw()
        .filter_map(|file| {
            let meant: u64 = sent.range(file.from / HOUR..file.to / HOUR).map(|(_, count)| count).sum();
            (meant != file.rows).then(|| format!("{}: {} rows, {meant} sent", file.path, file.rows))
        })
        .collect();
    println!("{} files of samples against what was sent: {} differ", raw().count(), differing.len());
    differing.iter().take(5).for_each(|words| println!("  {words}"));
}

/// Files that the rules have deleted, and times without a sample of a tag.
fn deleted_and_gaps(path: &Path, files: &[ArchiveFile], folder: &Path) {
    let db = Connection::open(path).expect("the file");
    let count = |sql: &str| db.query_row(sql, [], |row| row.get::<_, u64>(0)).expect(sql);
    for tier in Tier::ALL {
        let word = tier.word();
        println!("deleted of {word}: {} files", count(&format!("SELECT count(*) FROM deleted WHERE tier = '{word}'")));
    }
    let paths = files
        .iter()
        .filter(|file| file.tier == Tier::Raw)
        .map(|file| format!("'{}'", folder.join(&file.path).display()));
    let raw = format!(
        "SELECT utc, tag FROM read_parquet([{}], hive_partitioning = false) UNION ALL SELECT utc, tag FROM sample",
        paths.collect::<Vec<_>>().join(", ")
    );
    let gaps = format!(
        "SELECT count(*) FROM (SELECT utc - lag(utc) OVER (PARTITION BY tag ORDER BY utc) AS since FROM ({raw}))
         WHERE since > INTERVAL {GAP_S} SECOND"
    );
    println!("gaps of more than {GAP_S} s of a tag in what is kept: {}", count(&gaps));
    let doubles = format!("SELECT count(*) FROM (SELECT utc, tag FROM ({raw}) GROUP BY ALL HAVING count(*) > 1)");
    println!("instants that a tag has twice: {}", count(&doubles));
}
