//! Every kind of damage to the files of a history: the station starts, records, and says what it has met.
//!
//! `SIGHTGLASS_DAMAGE=200` makes 200 cases of each kind instead of a few.
#![allow(clippy::print_stdout)]

use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use super::{
    super::{last, store::Store},
    PV, SV, action,
    damage::{FILE, child},
    def, good, step,
};
use crate::{
    plant::record::{AlarmEvent, Record},
    profile::io::atomic::with_suffix,
    report::testing::sec,
};

/// Cases of each kind, unless `SIGHTGLASS_DAMAGE` says how many.
const CASES: usize = 6;
/// Rows in the file, and rows in its log.
const FILED: i64 = 20_000;
const LOGGED: i64 = 60;

/// The same numbers each time.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }
}

/// The files of a station that was killed.
struct Files {
    db: Vec<u8>,
    log: Vec<u8>,
    last: Vec<u8>,
}

impl Files {
    fn read(db: &Path) -> Files {
        let read = |path: &Path| fs::read(path).unwrap();
        Files { db: read(db), log: read(&with_suffix(db, ".wal")), last: read(&last::path(db)) }
    }

    fn write(&self, db: &Path) {
        fs::create_dir_all(db.parent().unwrap()).unwrap();
        fs::write(db, &self.db).unwrap();
        fs::write(with_suffix(db, ".wal"), &self.log).unwrap();
        fs::write(last::path(db), &self.last).unwrap();
    }
}

/// Damages one of the files; gives what it is called in a message.
fn damage(files: &mut Files, kind: usize, numbers: &mut Numbers) -> String {
    let (name, file) = if kind < 2 { ("database", &mut files.db) } else { ("log", &mut files.log) };
    let place = numbers.below(file.len());
    if kind.is_multiple_of(2) {
        file[place] ^= 1 << numbers.below(8);
        format!("{name} flipped at {place}")
    } else {
        file.truncate(place);
        format!("{name} cut at {place}")
    }
}

#[test]
fn a_station_starts_with_any_damage_and_reports_it() {
    let cases = std::env::var("SIGHTGLASS_DAMAGE").map_or(CASES, |cases| cases.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.duckdb");
    assert!(!child("fill and die", &whole).wait().unwrap().success());
    let mut numbers = Numbers(7);
    let place = |case: usize| folder.path().join(case.to_string()).join("tank.duckdb");
    let damaged: Vec<String> = (0..4 * cases)
        .map(|case| {
            let mut files = Files::read(&whole);
            let what = damage(&mut files, case % 4, &mut numbers);
            files.write(&place(case));
            what
        })
        .collect();
    let (mut said, mut deaths) = (Vec::new(), Vec::new());
    while said.len() < damaged.len() {
        let case = said.len();
        let mut child = child(&format!("survive from {case}"), folder.path());
        let lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        said.extend(lines.filter_map(|line| Some(line.strip_prefix("case ")?.to_owned())));
        if !child.wait().unwrap().success() && said.len() < damaged.len() {
            deaths.push(said.len());
            let deadly = deaths.iter().filter(|death| **death == said.len()).count();
            assert!(deadly < 3, "{} starts ended: {}", deadly, damaged[said.len()]);
        }
    }
    let mut unread = 0;
    for (what, said) in damaged.iter().zip(&said) {
        if cases > CASES {
            println!("{what}: {said}");
        }
        assert!(!said.contains("WRONG"), "{what}: {said}");
        unread += usize::from(said.contains("unreadable"));
        let is_cut = what.contains(" cut at ");
        assert!(!is_cut || said.contains("trouble: "), "a cut goes unsaid: {what}: {said}");
    }
    println!("{} cases, {} starts that ended, {unread} found by the first read", damaged.len(), deaths.len());
}

/// The jobs of the child processes of these tests; `false` for another job.
pub(super) fn job(job: &str) -> bool {
    let path = PathBuf::from(std::env::var(FILE).unwrap());
    if job == "fill and die" {
        let _open = fill(&path);
        std::process::abort();
    }
    let Some(first) = job.strip_prefix("survive from ") else { return false };
    let first: usize = first.parse().unwrap();
    for case in first.. {
        let db = path.join(case.to_string()).join("tank.duckdb");
        if !db.exists() && !with_suffix(&db, ".wal").exists() {
            break;
        }
        // On a line of its own, whatever the test harness prints.
        println!("\ncase {}", survive(&db));
    }
    true
}

fn fill(db: &Path) -> Store {
    let store = Store::open(db, &def(), sec(0)).unwrap().store;
    let rows = (0..FILED).flat_map(|i| [good(PV, i, value(i)), good(SV, i, 70.0)]);
    store.append(&rows.collect::<Vec<_>>()).unwrap();
    let others = (0..500).flat_map(|i| [Record::Alarm(step(i, "high", AlarmEvent::Raised)), Record::Action(action(i))]);
    store.append(&others.collect::<Vec<_>>()).unwrap();
    store.checkpoint().unwrap();
    for i in FILED..FILED + LOGGED {
        store.append(&[good(PV, i, value(i)), Record::Alarm(step(i, "low", AlarmEvent::Raised))]).unwrap();
    }
    store
}

fn value(i: i64) -> f64 {
    (i as f64 * 0.37).sin() * 40.0 + 60.0
}

/// Starts a station on these files and records; returns what it reports and what is missing.
fn survive(db: &Path) -> String {
    let now = FILED + LOGGED + 10;
    let records =
        [good(PV, now, 1.0), Record::Alarm(step(now, "high", AlarmEvent::Raised)), Record::Action(action(now))];
    let record = || {
        let opened = Store::open_at_start(db, &def(), sec(now)).unwrap();
        opened.store.append(&records).and_then(|()| opened.store.checkpoint()).map(|()| opened)
    };
    // A checkpoint that fails is answered by opening the file again.
    let opened = match record().or_else(|_| record()) {
        Ok(opened) => opened,
        Err(error) => return format!("WRONG: does not record: {error}"),
    };
    let store = &opened.store;
    let mut report = match &opened.trouble {
        Some(trouble) => format!("trouble: {}", trouble.replace('\n', " ")),
        None => "no trouble".to_owned(),
    };
    let sql = format!(
        "SELECT count(*), coalesce(sum(value), 0), (SELECT count(*) FROM alarm_journal WHERE utc < make_timestamp({0})),
             (SELECT count(*) FROM operator_action WHERE utc < make_timestamp({0}) AND target = 'TIC-1.SV')
         FROM sample WHERE utc < make_timestamp({0}) AND value IS NOT NULL",
        (FILED + LOGGED) * 1_000_000
    );
    let read = store.db.query_row(&sql, [], |row| {
        Ok((row.get::<_, i64>(0)?, row.get::<_, f64>(1)?, row.get::<_, i64>(2)?, row.get::<_, i64>(3)?))
    });
    let sum = (0..FILED + LOGGED).map(value).sum::<f64>() + FILED as f64 * 70.0;
    match read {
        Err(error) => report += &format!("; unreadable: {}", error.to_string().lines().next().unwrap_or_default()),
        Ok((rows, total, journal, actions)) => {
            let whole =
                (rows, journal, actions) == (2 * FILED + LOGGED, 500 + LOGGED, 500) && (total - sum).abs() < 1e-3;
            if !whole && opened.trouble.is_none() {
                report +=
                    &format!("; WRONG: {rows} rows, sum {total} instead of {sum}, {journal} steps, {actions} actions");
            }
        }
    }
    report
}
