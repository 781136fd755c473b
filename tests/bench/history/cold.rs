//! Trends of a year of which nothing is in memory: before each the history is opened again, and its pages are dropped from
//! the cache of the system.

use std::{
    fs::{self, File},
    path::Path,
    time::Instant,
};

use rustix::fs::{Advice, fadvise};
use sightglass::api::{
    history::{Query, Store},
    plant::TagId,
};

use super::{
    load::def,
    year::{DAY, LAST_DAY, at},
};

/// Times that each is asked for, every time at another place.
const ASKED: i64 = 7;

/// Prints what it measured.
pub fn ask(path: &Path, days: i64, raw_days: i64) {
    let now = at(LAST_DAY + DAY);
    let mut opened = Vec::new();
    for (name, span) in [("1 h", 3_600), ("24 h", DAY), ("7 d", 7 * DAY), ("30 d", 30 * DAY), ("1 year", days * DAY)] {
        for pens in [1, 8] {
            let reach = if span < 5 * 3_600 { raw_days } else { days } * DAY;
            let (mut times, mut bytes) = (Vec::new(), 0);
            for number in 0..ASKED {
                forget(path.parent().expect("a folder"));
                let began = Instant::now();
                let store = Store::open(path, &def(), now).expect("opened").store;
                opened.push(ms(began));
                forget(path.parent().expect("a folder"));
                let to = LAST_DAY + DAY - (reach - span) / ASKED * number;
                let tags = (0..pens).map(|pen| TagId((number * 13 + pen * 120) as u16)).collect();
                let query = Query::Series { tags, from: at(to - span), to: at(to), buckets: 300 };
                let (before, began) = (read_bytes(), Instant::now());
                store.answer(&query, now).expect("answered");
                times.push(ms(began));
                bytes += read_bytes() - before;
            }
            let (half, worst) = spread(times);
            let each = bytes as f64 / ASKED as f64 / 1e6;
            println!(
                "cold trend of {name}, {pens} tags: p50 {half:.0}, worst {worst:.0} ms; {each:.2} MB from the disk"
            );
        }
    }
    let (half, worst) = spread(opened);
    println!("cold start: p50 {half:.0}, worst {worst:.0} ms");
}

fn ms(began: Instant) -> f64 {
    began.elapsed().as_secs_f64() * 1e3
}

fn spread(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    (times[times.len() / 2], times[times.len() - 1])
}

/// Drops the pages of all files of a folder from the cache; those of the program stay, as in a running station.
fn forget(folder: &Path) {
    for path in fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
        match path.is_dir() {
            true => forget(&path),
            false => {
                let file = File::open(&path).expect("a file");
                file.sync_all().expect("on disk");
                fadvise(&file, 0, None, Advice::DontNeed).expect("dropped");
            }
        }
    }
}

/// What this process has had read from the disk.
fn read_bytes() -> u64 {
    let io = fs::read_to_string("/proc/self/io").expect("known");
    let line = io.lines().find_map(|line| line.strip_prefix("read_bytes: "));
    line.and_then(|bytes| bytes.parse().ok()).expect("a number")
}
