//! What queries cost the recording: 1,000 tags that change every second, written by the station's own threads, while a
//! shift report and a day's trends are asked and backups written without pause.
//!
//! `cargo bench --bench history -- load [SECONDS] [HOURS]`: for so many seconds (10) over a history of so many hours (2).

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use jiff::Timestamp;
use sightglass::api::{
    bus::Clock,
    history::{Answer, HistoryJob, JobRequest, Query, QueryRequest, Store, thread as history},
    plant::{PlantDef, Record, Sample, TagId},
    report::Period,
};
use tokio::sync::oneshot;

pub const TAGS: u16 = 1_000;
/// Batches that the samples of a second come in.
const BATCHES: u16 = 100;
/// Where the history begins: some day at midnight.
pub const BEGIN: i64 = 1_790_000_000;

/// Prints what it measured. `words` are those of the command line behind `load`.
pub fn main(words: &[String]) {
    let number = |place: usize, default: i64| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(default);
    if words.first().is_some_and(|word| word == "fill") {
        return fill(Path::new(&words[1]), number(2, 2));
    }
    let (seconds, hours) = (number(0, 10), number(1, 2));
    let (_folder, path) = filled(hours);
    run(&path, seconds, hours);
}

/// A history of so many hours, filled by a process of its own, so that its memory is not counted.
pub fn filled(hours: i64) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("load.duckdb");
    let own = std::env::current_exe().expect("this program");
    let filled = Command::new(own).args(["load", "fill"]).arg(&path).arg(hours.to_string()).status();
    assert!(filled.expect("a process").success(), "the history was not filled");
    (folder, path)
}

pub fn def() -> Arc<PlantDef> {
    Arc::new(PlantDef { tags: (0..TAGS).map(super::tag).collect(), ..(*super::tank()).clone() })
}

/// Stores so many hours as a station would have done, second by second; no bit packing, as there.
fn fill(path: &Path, hours: i64) {
    let start = Timestamp::from_second(BEGIN).expect("in range");
    drop(Store::open(path, &def(), start).expect("a new file"));
    let db = duckdb::Connection::open(path).expect("the file");
    db.execute_batch("SET disabled_compression_methods = 'bitpacking'; SET threads = 1").expect("settings");
    let began = Instant::now();
    for hour in 0..hours {
        let (from, to) = (hour * 3_600 * i64::from(TAGS), (hour + 1) * 3_600 * i64::from(TAGS));
        db.execute_batch(&format!(
            "INSERT INTO sample (utc, tag, value, quality) SELECT make_timestamp({BEGIN}000000 + s * 1000000 + k * 997), k::USMALLINT,
                round(60 + 10 * sin(s / (300.0 + 4 * k)) + (hash(i) % 5)::DOUBLE / 10 - 0.2, 1), 0
             FROM (SELECT i, i // {TAGS} AS s, i % {TAGS} AS k FROM range({from}, {to}) t(i)); CHECKPOINT"
        ))
        .expect("an hour");
    }
    let bytes = std::fs::metadata(path).map_or(0, |meta| meta.len());
    println!("{hours} h of {TAGS} tags: {:.0} s to fill, {} MB", began.elapsed().as_secs_f64(), bytes / 1_000_000);
}

/// What is counted while it runs.
#[derive(Default)]
pub struct Counts {
    pub stop: AtomicBool,
    pub refused: AtomicU64,
    rss_max_kb: AtomicU64,
    anonymous_max_kb: AtomicU64,
    log_max: AtomicU64,
}

fn run(path: &Path, seconds: i64, hours: i64) {
    let now = Timestamp::from_second(BEGIN + hours * 3_600).expect("in range");
    let clock = Clock::starting_at(now, 1.0);
    let began = Instant::now();
    let handle = history::start(path, def(), clock).expect("started");
    println!("opened in {:.0} ms, {} MB resident", began.elapsed().as_secs_f64() * 1e3, memory_kb("VmRSS") / 1_000);
    let counts = Counts::default();
    let (mut times, mut asked) = (Vec::new(), Vec::new());
    thread::scope(|scope| {
        scope.spawn(|| record(&handle, clock, &counts));
        let askers = [report(now), trend(now, hours)].map(|(name, query)| {
            let (handle, counts) = (&handle, &counts);
            scope.spawn(move || (name, ask(handle, &query, counts)))
        });
        let to = path.with_extension("backup");
        let backups = scope.spawn({
            let (handle, counts) = (&handle, &counts);
            move || ("backup", back_up(handle, &to, counts))
        });
        let watcher = scope.spawn(|| commits(&handle, clock, &counts));
        for _ in 0..seconds {
            thread::sleep(Duration::from_secs(1));
            counts.rss_max_kb.fetch_max(memory_kb("VmRSS"), Ordering::Relaxed);
            counts.anonymous_max_kb.fetch_max(memory_kb("RssAnon"), Ordering::Relaxed);
            let log = std::fs::metadata(path.with_extension("duckdb.wal")).map_or(0, |log| log.len());
            counts.log_max.fetch_max(log, Ordering::Relaxed);
        }
        counts.stop.store(true, Ordering::Relaxed);
        times = watcher.join().expect("times");
        asked.push(backups.join().expect("backups"));
        asked.extend(askers.into_iter().map(|asker| asker.join().expect("answers")));
    });
    let status = handle.status.borrow().clone();
    println!("{} rows in {seconds} s, lost {}, refused {}", status.rows, status.lost, counts.refused.into_inner());
    println!("trouble: {}", status.trouble.as_deref().unwrap_or("none"));
    spread("commit", times);
    for (name, (times, failed)) in asked {
        spread(name, times);
        failed.iter().for_each(|why| println!("  failed: {why}"));
    }
    let log_max = counts.log_max.into_inner() as f64 / 1e6;
    let (all, anonymous) = (counts.rss_max_kb.into_inner() / 1_000, counts.anonymous_max_kb.into_inner() / 1_000);
    println!("{all} MB resident at most, {anonymous} MB without files; log {log_max:.1} MB at most");
    handle.stop();
}

/// Sends the samples of every second in even batches, as lines do.
pub fn record(handle: &history::Handle, clock: Clock, counts: &Counts) {
    let began = Instant::now();
    for number in 0_u64.. {
        if counts.stop.load(Ordering::Relaxed) {
            break;
        }
        thread::sleep((Duration::from_secs(1) / u32::from(BATCHES) * number as u32).saturating_sub(began.elapsed()));
        let (at, each) = (clock.now(), TAGS / BATCHES);
        let first = (number % u64::from(BATCHES)) as u16 * each;
        let value = |id: u16| 60.0 + 10.0 * (number as f64 / 3e4 + f64::from(id)).sin();
        let sample = |id| Record::Sample(TagId(id), Sample::good((value(id) * 10.0).round() / 10.0, at));
        let batch: Vec<Record> = (first..first + each).map(sample).collect();
        if handle.records.try_send(batch.into()).is_err() {
            counts.refused.fetch_add(u64::from(each), Ordering::Relaxed);
        }
    }
}

/// How long each commit took, with the checkpoint behind some of them.
pub fn commits(handle: &history::Handle, clock: Clock, counts: &Counts) -> Vec<Duration> {
    let runtime = tokio::runtime::Builder::new_current_thread().build().expect("a runtime");
    let (mut status, mut times) = (handle.status.clone(), Vec::new());
    let mut last = status.borrow_and_update().committed_at;
    while !counts.stop.load(Ordering::Relaxed) {
        runtime.block_on(status.changed()).expect("the thread runs");
        let began = status.borrow_and_update().committed_at;
        if began != last {
            times.extend(began.and_then(|began| Duration::try_from(clock.utc().duration_since(began)).ok()));
            last = began;
        }
    }
    times
}

fn report(now: Timestamp) -> (&'static str, Query) {
    let period = Period::free(now - Duration::from_secs(8 * 3_600), now);
    ("report of 8 h, 1,000 tags", Query::Report { period })
}

fn trend(now: Timestamp, hours: i64) -> (&'static str, Query) {
    let from = now - Duration::from_secs(hours as u64 * 3_600);
    let tags = (0..8).map(|pen| TagId(pen * 120)).collect();
    ("trend of all hours, 8 pens", Query::Series { tags, from, to: now, buckets: 300 })
}

/// Asks without pause; how long each answer took, and what went wrong.
fn ask(handle: &history::Handle, query: &Query, counts: &Counts) -> (Vec<Duration>, Vec<String>) {
    let (mut times, mut failed) = (Vec::new(), Vec::new());
    while !counts.stop.load(Ordering::Relaxed) {
        let (reply, answer) = oneshot::channel();
        let began = Instant::now();
        handle.queries.blocking_send((1, QueryRequest { query: query.clone(), reply })).expect("asked");
        match answer.blocking_recv().expect("answered") {
            Ok(Answer::Series(series)) => assert!(series[0].good > 0.9, "{}", series[0].good),
            Ok(Answer::Report(report)) => assert_eq!(report.tags.len(), usize::from(TAGS)),
            Ok(_) => failed.push("another answer".to_owned()),
            Err(error) => failed.push(error.to_string()),
        }
        times.push(began.elapsed());
    }
    (times, failed)
}

/// Writes backups to one folder without pause.
fn back_up(handle: &history::Handle, to: &Path, counts: &Counts) -> (Vec<Duration>, Vec<String>) {
    let (mut times, mut failed) = (Vec::new(), Vec::new());
    while !counts.stop.load(Ordering::Relaxed) {
        let (reply, answer) = oneshot::channel();
        let began = Instant::now();
        let job = HistoryJob::Backup { to: to.to_owned(), companions: Vec::new() };
        handle.jobs.blocking_send(JobRequest { job, reply }).expect("asked");
        failed.extend(answer.blocking_recv().expect("answered").err().map(|error| error.to_string()));
        times.push(began.elapsed());
    }
    (times, failed)
}

pub fn spread(name: &str, mut times: Vec<Duration>) {
    times.sort();
    let at = |share: f64| times.get(((times.len() as f64 * share) as usize).min(times.len() - 1));
    let ms = |time: Option<&Duration>| time.map_or(f64::NAN, |time| time.as_secs_f64() * 1e3);
    let (half, most, worst) = (ms(at(0.5)), ms(at(0.99)), ms(times.last()));
    println!("{name}: {} times, p50 {half:.1} ms, p99 {most:.1} ms, worst {worst:.1} ms", times.len());
}

pub fn memory_kb(of: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with(of));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}
