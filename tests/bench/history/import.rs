//! What an import costs the recording: 1,000 tags that change every second, written by the station's own threads, while the
//! samples of a file fill a gap before them.
//!
//! `cargo bench --bench history -- import [ROWS] [HOURS]`: so many rows (1,000,000) into a history of so many hours (2).

use std::{
    io::{BufWriter, Write},
    path::Path,
    sync::atomic::Ordering,
    thread,
    time::{Duration, Instant},
};

use jiff::Timestamp;
use sightglass::api::{
    bus::Clock,
    history::{HistoryJob, JobRequest, thread as history},
};
use tokio::sync::oneshot;

use super::load::{BEGIN, Counts, TAGS, commits, def, filled, memory_kb, record, spread};

/// The file begins so long before the history.
const BEFORE_S: i64 = 4 * 3_600;
/// Before the import, and after it, when its hours are archived.
const AROUND: Duration = Duration::from_secs(20);

/// Prints what it measured.
pub fn main(words: &[String]) {
    let number = |place: usize, usual: i64| words.get(place).and_then(|word| word.parse().ok()).unwrap_or(usual);
    let (rows, hours) = (number(0, 1_000_000), number(1, 2));
    let (folder, path) = filled(hours);
    let file = folder.path().join("logger.csv");
    write_csv(&file, rows).expect("a file");
    let clock = Clock::starting_at(Timestamp::from_second(BEGIN + hours * 3_600).expect("in range"), 1.0);
    let handle = history::start(&path, def(), clock).expect("started");
    let recording = Counts::default();
    thread::scope(|scope| {
        scope.spawn(|| record(&handle, clock, &recording));
        let during = |what: &str, work: &dyn Fn()| {
            let counts = Counts::default();
            let times = thread::scope(|scope| {
                let watcher = scope.spawn(|| commits(&handle, clock, &counts));
                work();
                counts.stop.store(true, Ordering::Relaxed);
                watcher.join().expect("times")
            });
            spread(&format!("commit {what}"), times);
            println!("  {} MB resident", memory_kb("VmRSS") / 1_000);
        };
        during("before the import", &|| thread::sleep(AROUND));
        during("while it runs", &|| {
            let began = Instant::now();
            let (reply, done) = oneshot::channel();
            handle
                .jobs
                .blocking_send(JobRequest { job: HistoryJob::Import { file: file.clone() }, reply })
                .expect("asked");
            println!("{:?} in {:.0} s", done.blocking_recv().expect("answered"), began.elapsed().as_secs_f64());
        });
        during("while its hours are archived", &|| thread::sleep(AROUND));
        recording.stop.store(true, Ordering::Relaxed);
    });
    let status = handle.status.borrow().clone();
    let refused = recording.refused.into_inner();
    println!("{} rows, lost {}, refused {refused}; trouble: {:?}", status.rows, status.lost, status.trouble);
    handle.stop();
}

/// A row a second of each tag.
fn write_csv(path: &Path, rows: i64) -> std::io::Result<()> {
    let mut file = BufWriter::new(std::fs::File::create(path)?);
    writeln!(file, "tag,time_utc,value")?;
    let def = def();
    for row in 0..rows {
        let (second, tag) = (row / i64::from(TAGS), row % i64::from(TAGS));
        let at = Timestamp::from_second(BEGIN - BEFORE_S + second).expect("in range");
        writeln!(file, "{},{at},{:.1}", def.tags[tag as usize].name, 60.0 + ((row * 7) % 100) as f64 / 10.0)?;
    }
    file.flush()
}
