//! The archive: what was archived answers as it did before, whatever ends the program in between.

use super::*;
use crate::{
    history::{
        io::archive::{Job, LeftOut},
        tiers::{HOUR, Tier},
    },
    plant::{def::HistoryDef, exact::Exact},
    report::{ShiftReport, TagFigures},
};

pub(super) const HOUR_S: i64 = HOUR / 1_000_000;

/// A sample every few seconds on average, of three tags, with gaps, bad values and rows of one instant.
pub(super) fn rows(hours: i64) -> Vec<Record> {
    let mut seed = 7u64;
    let mut random = move |below: i64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as i64 % below
    };
    let mut rows = Vec::new();
    let mut at = 0;
    while at < hours * HOUR_S * 1_000_000 {
        at += match random(200) {
            0 => random(400_000_000),
            1..20 => 0,
            _ => random(40_000_000),
        };
        let at = Timestamp::from_microsecond(at).unwrap();
        let sample = match random(10) {
            0 => Sample::bad(Cause::Timeout, at),
            1 => Sample::good(random(1_000) as f64, at).uncertain(Cause::Stale),
            _ => Sample::good(random(10_000) as f64 / 10.0, at),
        };
        rows.push(Record::Sample(TagId(random(3) as u16), sample));
    }
    rows
}

pub(super) fn filled(db: &Path, rows: &[Record]) -> Store {
    let store = open(db, 0);
    rows.chunks(500).for_each(|rows| store.append(rows).unwrap());
    store
}

/// Does all that is due at an hour.
pub(super) fn archive_all(store: &Store, hour: i64) -> Vec<Job> {
    let due = || store.archive_due(sec(hour * HOUR_S + 600), &LeftOut::default()).unwrap();
    let work = |job: &Job| store.archive(job).unwrap();
    std::iter::from_fn(|| due().inspect(work)).collect()
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
}

fn assert_series(got: &[Series], expect: &[Series], what: &str) {
    for (got, expect) in got.iter().zip(expect) {
        assert_eq!(
            (got.tag, got.from, got.step, got.buckets.len()),
            (expect.tag, expect.from, expect.step, expect.buckets.len()),
            "{what}"
        );
        assert!(near(got.good, expect.good), "{what}: {} {}", got.good, expect.good);
        for (place, pair) in got.buckets.iter().zip(&expect.buckets).enumerate() {
            let equal = match pair {
                (None, None) => true,
                (Some(a), Some(b)) => (a.min, a.max, a.last) == (b.min, b.max, b.last) && near(a.mean, b.mean),
                _ => false,
            };
            assert!(equal, "{what}: column {place}: {pair:?}");
        }
    }
}

pub(super) fn report(store: &Store, from: i64, to: i64) -> ShiftReport {
    let period = Period::free(sec(from), sec(to));
    match store.answer(&Query::Report { period }, sec(to)).unwrap() {
        Answer::Report(report) => *report,
        other => panic!("{other:?}"),
    }
}

/// Asks both stores the same, and expects the same.
pub(super) fn assert_same(archived: &Store, plain: &Store, hours: i64, what: &str) {
    let tags = [0, 1, 2].map(TagId).to_vec();
    let end = hours * HOUR_S;
    for (from, to, buckets) in [
        (0, end, 10),
        (0, end, 500),
        (17, end - 1_234, 60),
        (3_500, 3_700, 20),
        (HOUR_S, 2 * HOUR_S, 240),
        (end - 4_000, end, 66),
        (-9_000, end + 9_000, 13),
    ] {
        let query = Query::Series { tags: tags.clone(), from: sec(from), to: sec(to), buckets };
        let [got, expect] = [archived, plain].map(|store| match store.answer(&query, sec(end)).unwrap() {
            Answer::Series(series) => series,
            other => panic!("{other:?}"),
        });
        assert_series(&got, &expect, &format!("{what}: {from} to {to} in {buckets}"));
        let every = Duration::from_secs(97);
        let query = Query::Values { tags: tags.clone(), from: sec(from), every, count: 90 };
        assert_eq!(archived.answer(&query, sec(end)), plain.answer(&query, sec(end)), "{what}: values from {from}");
    }
    let mean = |figures: &TagFigures| figures.mean.map_or(-1.0, Exact::near);
    for (from, to) in [(0, end), (1_000, end - 100), (HOUR_S - 30, HOUR_S + 90)] {
        let (got, expect) = (report(archived, from, to), report(plain, from, to));
        assert_eq!(got.record, expect.record, "{what}");
        for (got, expect) in got.tags.iter().zip(&expect.tags) {
            assert_eq!((got.min, got.max, got.last), (expect.min, expect.max, expect.last), "{what}: {from} to {to}");
            assert!(near(mean(got), mean(expect)) && near(got.good, expect.good), "{what}: {from} to {to}");
        }
        // A window of ten minutes counts as watched whole once it is archived.
        if to - from > HOUR_S {
            assert_eq!(got.alarm_metrics, expect.alarm_metrics, "{what}");
        }
    }
}

#[test]
fn archived_hours_answer_as_before() {
    let [(_one, plain), (_other, db)] = [folder(), folder()];
    let rows = rows(30);
    let (plain, store) = (filled(&plain, &rows), filled(&db, &rows));
    let jobs = archive_all(&store, 29);
    assert_eq!(jobs.iter().filter(|job| matches!(job, Job::Hour(_))).count(), 29);
    assert_eq!(jobs.iter().filter(|job| matches!(job, Job::Merge(..))).count(), 3, "the first day");
    assert_same(&store, &plain, 30, "archived");
    let rows: u64 = store.files(None).unwrap().iter().filter(|file| file.tier == Tier::Raw).map(|file| file.rows).sum();
    assert_eq!(rows + store.count_rows().unwrap(), plain.count_rows().unwrap());
    // The same after a start, and without the database: it is the files that have the values.
    drop(store);
    assert_same(&open(&db, 30 * HOUR_S), &plain, 30, "after a start");
}

/// What is stored, however it lies: samples in order, with their quality.
pub(super) fn content(store: &Store) -> Vec<(u16, Sample)> {
    let mut all = Vec::new();
    store.each_stored(sec(-1_000), sec(1_000_000), |tag, sample| all.push((tag, sample))).unwrap();
    all.sort_by_key(|(tag, sample)| (*tag, sample.at));
    all
}

/// Rows and sums of what was formed: minutes, then hours.
fn aggregates(store: &Store) -> [(u64, f64, f64); 2] {
    [Tier::Minute, Tier::Hour].map(|tier| {
        let files: Vec<_> = store.files(None).unwrap().into_iter().filter(|file| file.tier == tier).collect();
        let sql = format!("SELECT count(*), sum(good_ms)::DOUBLE, sum(mean) FROM {}", store.parquet(&files, false));
        let row = |row: &duckdb::Row| Ok((row.get::<_, u64>(0)?, row.get::<_, f64>(1)?, row.get::<_, f64>(2)?));
        let (count, good, mean) = store.db.query_row(&sql, [], row).unwrap();
        (count, good, (mean * 1e6).round())
    })
}

fn reopen(db: &Path) -> Store {
    Store::open(db, &def(), sec(26 * HOUR_S)).unwrap().store
}

#[test]
fn a_lost_database_takes_up_its_archive() {
    let rows = rows(30);
    let (_folder, db) = folder();
    let store = filled(&db, &rows);
    archive_all(&store, 29);
    let (expect, formed) = (content(&store), aggregates(&store));
    let archived = |samples: Vec<(u16, Sample)>| -> Vec<_> {
        samples.into_iter().filter(|(_, sample)| sample.at < sec(29 * HOUR_S)).collect()
    };
    drop(store);
    std::fs::remove_file(&db).unwrap();
    std::fs::remove_file(with_suffix(&db, ".wal")).ok();
    let store = reopen(&db);
    assert!(content(&store) == archived(expect), "the samples of the archive");
    assert_eq!(aggregates(&store), formed);
    assert_eq!(series(&store, PV, 0, 29 * HOUR_S, 29).buckets.iter().flatten().count(), 29);
    // Another plant wrote here before: its numbers mean other tags.
    drop(store);
    std::fs::remove_file(&db).unwrap();
    let mut other = plant("Asia/Bangkok", &THREE);
    other.tags[0].name = "P-1.RUN".into();
    let tags = |def: PlantDef| Store::open(&db.with_file_name("other.duckdb"), &Arc::new(def), sec(0)).unwrap().store;
    drop(tags(other));
    std::fs::rename(db.with_file_name("other.duckdb"), &db).unwrap();
    let opened = Store::open(&db, &def(), sec(0)).unwrap();
    let words = opened.trouble.unwrap();
    assert!(words.contains("its archive is that of another history and is set aside as"), "{words}");
    assert_eq!(opened.store.files(None).unwrap(), []);
}

#[test]
fn what_was_never_recorded_is_not_taken_for_deleted() {
    let (_folder, db) = folder();
    // The last two days of a month, which is then a file of hours.
    let rows = [29, 30].map(|day| good(PV, day * 24 * HOUR_S + 60, day as f64));
    let store = filled(&db, &rows);
    archive_all(&store, 32 * 24);
    assert_eq!(store.files(None).unwrap().iter().filter(|file| file.path.ends_with("month.parquet")).count(), 1);
    drop(store);
    assert_eq!(
        Tier::ALL.map(|tier| reopen(&db).deleted_until(tier).unwrap()),
        [None; 3],
        "what is before is open to imports"
    );
    std::fs::remove_file(&db).unwrap();
    assert_eq!(Tier::ALL.map(|tier| reopen(&db).deleted_until(tier).unwrap()), [None; 3], "the database was lost");
}

#[test]
fn samples_that_come_late_are_archived_with_their_hour() {
    let rows = rows(27);
    let at = |record: &Record| match record {
        Record::Sample(_, sample) => sample.at,
        _ => panic!("only samples"),
    };
    // What lies in the middle of the first hour, and at the end of the third, comes a day late.
    let late = |record: &Record| {
        let second = at(record).as_second();
        (1_000..1_900).contains(&second) || (3 * HOUR_S - 100..3 * HOUR_S).contains(&second)
    };
    let (late, early): (Vec<Record>, Vec<Record>) = rows.iter().cloned().partition(late);
    assert!(late.len() > 20, "{}", late.len());
    let [(_one, plain), (_other, db)] = [folder(), folder()];
    let (plain, store) = (filled(&plain, &rows), filled(&db, &early));
    archive_all(&store, 26);
    store.append(&late).unwrap();
    assert!(content(&store) == content(&plain), "before they are archived");
    archive_all(&store, 26);
    assert!(content(&store) == content(&plain), "archived");
    assert_same(&store, &plain, 27, "late");
    let hours: Vec<String> = store.files(None).unwrap().into_iter().map(|file| file.path).collect();
    assert!(hours.iter().all(|path| !path.contains("date=1970-01-01") || path.contains("/day")), "{hours:?}");
}

#[test]
fn damage_of_the_archive_costs_no_more_than_it_must() {
    let rows = rows(30);
    let [(_one, plain), (_other, db)] = [folder(), folder()];
    let (plain, store) = (filled(&plain, &rows), filled(&db, &rows));
    archive_all(&store, 29);
    let path = |store: &Store, tier: Tier| {
        let file = store.files(None).unwrap().into_iter().find(|file| file.tier == tier).unwrap();
        store.archive_folder().join(file.path)
    };
    // Minutes and hours that cannot be read: the samples answer, and it is said.
    let minutes = path(&store, Tier::Minute);
    let mut bytes = std::fs::read(&minutes).unwrap();
    bytes[20..400].fill(0xAA);
    std::fs::write(&minutes, bytes).unwrap();
    std::fs::remove_file(path(&store, Tier::Hour)).unwrap();
    assert_same(&store, &plain, 30, "aggregates damaged");
    let words = store.unreadable.take().unwrap();
    assert!(words.contains(".parquet cannot be read"), "{words}");
    // Samples that cannot be read: their time is a gap, the rest is there.
    let samples = path(&store, Tier::Raw);
    std::fs::remove_file(&samples).unwrap();
    drop(store);
    let opened = Store::open(&db, &def(), sec(30 * HOUR_S)).unwrap();
    let words = opened.trouble.unwrap();
    assert!(
        words.starts_with("missing of its archive: ") && words.contains("raw/date=1970-01-01/day.parquet"),
        "{words}"
    );
    let query = Query::Values { tags: vec![PV], from: sec(0), every: Duration::from_secs(1_800), count: 58 };
    let [got, expect] = [&opened.store, &plain].map(|store| match store.answer(&query, sec(30 * HOUR_S)).unwrap() {
        Answer::Values(mut values) => values.remove(0),
        other => panic!("{other:?}"),
    });
    assert!(got[..47].iter().all(|value| value.is_none_or(|value| value.value.is_none())));
    assert_eq!(got[48..], expect[48..]);
    assert!(expect[..47].iter().any(|value| value.is_some_and(|value| value.value.is_some())));
    let words = opened.store.unreadable.take().unwrap();
    assert!(words.contains("1970-01-01T"), "{words}");
}

#[test]
fn a_merge_that_fails_does_not_hold_up_later_ones() {
    let (_folder, db) = folder();
    let store = filled(&db, &rows(50));
    while let Some(job @ Job::Hour(_)) = store.archive_due(sec(50 * HOUR_S + 600), &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    let lost = store.files(None).unwrap().into_iter().find(|file| file.tier == Tier::Raw).unwrap();
    let path = store.archive_folder().join(&lost.path);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let (mut left, mut failed) = (LeftOut::default(), 0);
    while let Some(job) = store.archive_due(sec(50 * HOUR_S + 600), &left).unwrap() {
        if let Err(error) = store.archive(&job) {
            let Job::Merge(tier, span) = job else { panic!("{job:?}") };
            assert!(error.is_damage_of_file(), "{error:?}");
            left.merges.push((tier, span));
            failed += 1;
        }
    }
    let days =
        |store: &Store| store.files(None).unwrap().iter().filter(|file| file.path.ends_with("day.parquet")).count();
    assert_eq!((failed, days(&store)), (1, 5), "two days of three tiers, but one");
    std::fs::write(&path, bytes).unwrap();
    archive_all(&store, 50);
    assert_eq!(days(&store), 6);
    let (_other, plain) = folder();
    assert_same(&store, &filled(&plain, &rows(50)), 50, "merged later");
}

/// The plant with a rule for its history.
fn keeping(rule: HistoryDef) -> Arc<PlantDef> {
    Arc::new(PlantDef { history: rule, ..PlantDef::clone(&def()) })
}

#[test]
fn what_was_deleted_is_answered_by_minutes() {
    let rows = rows(50);
    let [(_one, plain), (_other, db)] = [folder(), folder()];
    let plain = filled(&plain, &rows);
    drop(filled(&db, &rows));
    let rule = HistoryDef { keep_samples_days: Some(7), ..HistoryDef::default() };
    let open = || Store::open(&db, &keeping(rule), sec(50 * HOUR_S)).unwrap().store;
    let store = open();
    archive_all(&store, 52);
    let (all, formed) = (content(&store), aggregates(&store));
    // Eight days later the first day is too old.
    let later = sec(8 * 24 * HOUR_S);
    let due = |store: &Store| store.archive_due(later, &LeftOut::default()).unwrap();
    let job = due(&store).unwrap();
    assert!(matches!(&job, Job::Delete(next) if next.file.path == "raw/date=1970-01-01/day.parquet"), "{job:?}");
    while let Some(job) = due(&store) {
        store.archive(&job).unwrap();
    }
    assert_eq!(store.deleted_until(Tier::Raw).unwrap(), Some(sec(24 * HOUR_S)));
    let kept: Vec<_> = all.iter().copied().filter(|(_, sample)| sample.at >= sec(24 * HOUR_S)).collect();
    assert!(content(&store) == kept, "the second day and what is not archived");
    assert_eq!(aggregates(&store), formed);
    // A short window shows minutes; of hours and days nothing has changed.
    let short = series(&store, PV, 3_590, 3_900, 100);
    assert_eq!((short.from, short.step, short.buckets.len()), (sec(3_540), Duration::from_secs(60), 6));
    let expect = series(&plain, PV, 3_540, 3_900, 6);
    assert_series(&[short], &[expect], "minutes");
    for (from, to, buckets) in [(0, 50 * HOUR_S, 50), (HOUR_S, 9 * HOUR_S, 480), (30 * HOUR_S, 31 * HOUR_S, 99)] {
        let [got, expect] = [&store, &plain].map(|store| series(store, PV, from, to, buckets));
        assert_series(&[got], &[expect], "as before");
    }
    let [got, expect] = [&store, &plain].map(|store| report(store, 6 * HOUR_S, 14 * HOUR_S));
    for (got, expect) in got.tags.iter().zip(&expect.tags) {
        assert_eq!((got.min, got.max, got.last), (expect.min, expect.max, expect.last));
    }
    // What comes late to an hour without samples does not replace what was formed of them.
    let late = |tag, second| Record::Sample(tag, Sample::good(9e9, sec(second)));
    store.append(&[late(PV, HOUR_S + 10), late(TagId(3), HOUR_S + 10)]).unwrap();
    while let Some(job) = store.archive_due(sec(50 * HOUR_S + 600), &LeftOut::default()).unwrap() {
        store.archive(&job).unwrap();
    }
    let [got, expect] = [&store, &plain].map(|store| series(store, PV, 0, 5 * HOUR_S, 5));
    assert_series(&[got], &[expect], "late");
    // A lost database learns from the files what was deleted.
    drop(store);
    std::fs::remove_file(&db).unwrap();
    std::fs::remove_file(with_suffix(&db, ".wal")).ok();
    std::fs::remove_file(db.with_extension("archive").join("raw/date=1970-01-01/01.parquet")).unwrap();
    assert_eq!(open().deleted_until(Tier::Raw).unwrap(), Some(sec(24 * HOUR_S)));
}
