//! Counters of 64 bits: what goes in comes out to the last digit, from the table, from the archive, and as SQL.

use super::{
    archive::{HOUR_S, archive_all},
    *,
};
use crate::{
    history::{Overview, io::tables::Tables},
    plant::{exact::Exact, tag::DataType},
    report::{TagFigures, step_series::HeldValue},
};

/// PV counts in a register of 64 bits, SV is as ordinary as ever.
fn def() -> Arc<PlantDef> {
    let mut def = plant("Asia/Bangkok", &THREE);
    let counter = &mut def.tags[PV.index()];
    (counter.point.kind, counter.scale, counter.counter) = (DataType::U64, 1.0, Some(true));
    Arc::new(def)
}

fn open(db: &Path) -> Store {
    Store::open(db, &def(), sec(0)).unwrap().store
}

/// It begins just above 2^53, where an f64 has every other number only, and counts 1 in ten seconds.
fn counted(at: i64) -> i128 {
    (1 << 53) + 1 + i128::from(at / 10)
}

/// Two hours of both, and two of the ordinary tag alone; in the fifth the counter stands at the end of its type.
fn fill(store: &Store) {
    let counter = |at, value| Record::Sample(PV, Sample::good(Exact::whole(value), sec(at)));
    let records = (0..4 * HOUR_S).step_by(10).flat_map(|at| {
        let counter = (at < 2 * HOUR_S).then(|| counter(at, counted(at)));
        counter.into_iter().chain([good(SV, at, at as f64 / 10.0)])
    });
    let end = [counter(4 * HOUR_S, u64::MAX.into()), good(SV, 4 * HOUR_S, 1.5)];
    store.append(&records.chain(end).collect::<Vec<_>>()).unwrap();
}

fn values(store: &Store, from: i64, count: usize) -> Vec<Option<String>> {
    let query = Query::Values { tags: vec![PV], from: sec(from), every: Duration::from_secs(10), count };
    let Answer::Values(values) = store.answer(&query, sec(5 * HOUR_S)).unwrap() else { panic!() };
    let text = |held: &Option<HeldValue>| Some((*held)?.value?.to_string());
    values[0].iter().map(text).collect()
}

fn figures(store: &Store, from: i64, to: i64) -> TagFigures {
    let query = Query::Report { period: Period::free(sec(from), sec(to)) };
    let Answer::Report(report) = store.answer(&query, sec(5 * HOUR_S)).unwrap() else { panic!() };
    report.tags.into_iter().find(|figures| figures.tag == "TIC-1.PV").unwrap()
}

fn overview(store: &Store) -> Overview {
    match store.answer(&Query::Overview, sec(5 * HOUR_S)).unwrap() {
        Answer::Overview(overview) => *overview,
        other => panic!("{other:?}"),
    }
}

fn whole(number: i128) -> Option<Exact> {
    Some(Exact::whole(number))
}

/// What every reader sees of it.
fn assert_exact(store: &Store, what: &str) {
    let text = |at: i64| Some(counted(at).to_string());
    assert_eq!(values(store, 0, 3), [text(10), text(20), text(30)], "{what}");
    assert_eq!(values(store, HOUR_S, 2), [text(HOUR_S + 10), text(HOUR_S + 20)], "{what}");
    assert_eq!(values(store, 4 * HOUR_S, 1), [Some("18446744073709551615".to_owned())], "{what}");
    for at in [0, 3_600, 7_190] {
        let Answer::Past(past) = store.answer(&Query::Past { at: sec(at) }, sec(5 * HOUR_S)).unwrap() else { panic!() };
        assert_eq!(past.samples[PV.index()].good_exact(), whole(counted(at)), "{what}, as it was at {at} s");
    }
    let curve = series(store, PV, 0, HOUR_S, 1);
    let (least, most) = (counted(0), counted(HOUR_S - 10));
    assert_eq!(curve.buckets[0].map(|bucket| bucket.last), whole(most), "{what}");
    assert_eq!(curve.summary.map(|(min, _, max)| (min, max)), whole(least).zip(whole(most)), "{what}");
    for (from, to) in [(0, HOUR_S), (0, 2 * HOUR_S), (100, HOUR_S + 500), (1_000, 1_100)] {
        let found = figures(store, from, to);
        let (first, last) = (counted(from), counted(to - 10));
        assert_eq!((found.first, found.last), (whole(first), whole(last)), "{what}: {from} to {to}");
        assert_eq!((found.min, found.max), (whole(first), whole(last)), "{what}: {from} to {to}");
        assert_eq!(found.difference, whole(last - first), "{what}: {from} to {to}");
    }
}

#[test]
fn a_counter_of_64_bits_keeps_its_last_digit_in_the_archive() {
    let (_folder, db) = folder();
    let store = open(&db);
    fill(&store);
    assert_exact(&store, "from the table");
    archive_all(&store, 2);
    assert_exact(&store, "half of it archived");
    archive_all(&store, 5);
    assert_exact(&store, "all of it archived");
    drop(store);
    assert_exact(&open(&db), "after a restart");
}

#[test]
fn only_a_file_with_such_numbers_has_columns_for_them() {
    let (_folder, db) = folder();
    let store = open(&db);
    fill(&store);
    archive_all(&store, 5);
    let overview = overview(&store);
    let rests = |hour: i64| -> Vec<bool> {
        let of_hour = overview.files.iter().filter(|file| file.from == hour * HOUR_S * 1_000_000);
        of_hour.map(|file| file.rests).collect()
    };
    assert!(rests(0).len() > 1 && rests(0).iter().all(|rests| *rests), "{:?}", overview.files);
    assert!(rests(3).len() > 1 && rests(3).iter().all(|rests| !rests), "{:?}", overview.files);
    let columns = |path: &str| -> String {
        let file = overview.folder.join(path);
        let sql =
            format!("SELECT string_agg(name, ' ') FROM parquet_schema('{}') WHERE type IS NOT NULL", file.display());
        store.db.query_row(&sql, [], |row| row.get(0)).unwrap()
    };
    for file in &overview.files {
        assert_eq!(columns(&file.path).contains("rest"), file.rests, "{}: {}", file.path, columns(&file.path));
    }
}

#[test]
fn in_sql_a_value_is_never_a_double_that_rounds_it() {
    let (_folder, db) = folder();
    let store = open(&db);
    fill(&store);
    let first = |sql: &str, store: &Store| {
        let scratch = tempfile::tempdir().unwrap();
        let overview = overview(store);
        let tables = Tables::new(&def(), &overview, scratch.path()).unwrap();
        let unarchived = (overview.samples > 0).then(|| {
            let tag = |tag: TagId| (def().tag(tag).name.clone(), def().tag(tag).unit.clone());
            let sample = |at: i64| (0, Sample::good(Exact::whole(counted(at)), sec(at)));
            let samples = vec![sample(0), sample(10), (1, Sample::good(1.5, sec(0)))];
            crate::history::Unarchived { tags: vec![tag(PV), tag(SV)], samples }
        });
        tables.add_samples(unarchived.unwrap_or_default()).unwrap();
        tables.rows(sql, 9).unwrap().1
    };
    let row = |cells: &[&str]| -> Vec<Option<String>> {
        cells.iter().map(|cell| (*cell != "NULL").then(|| (*cell).to_owned())).collect()
    };
    let samples = "SELECT tag, value, exact FROM sample WHERE utc < '1970-01-01 00:00:20' ORDER BY tag, utc";
    let archived = |what: &str| {
        let rows = first(samples, &store);
        assert_eq!(rows[0], row(&["TIC-1.PV", "NULL", "9007199254740993.000000"]), "{what}");
        assert_eq!(rows[1], row(&["TIC-1.PV", "NULL", "9007199254740994.000000"]), "{what}");
        assert_eq!(rows[2][2], None, "{what}: an ordinary value stands in its column");
    };
    archived("from the table");
    archive_all(&store, 5);
    archived("from the archive");
    let tiers = "SELECT min, min_exact, last_exact::HUGEINT, gain, n FROM h1 WHERE tag = 'TIC-1.PV' ORDER BY utc";
    let last = counted(HOUR_S - 10).to_string();
    assert_eq!(first(tiers, &store)[0], row(&["NULL", "9007199254740993.000000", &last, "359.0", "360"]));
}
