//! Samples from files: they fill gaps, are archived like any other, and are known as what they are.

use std::collections::BTreeMap;

use super::{
    archive::{HOUR_S, archive_all, content, rows},
    *,
};
use crate::history::{
    import::{Import, Rows},
    tiers::in_milliseconds,
};

/// The samples of records, by tag.
pub(super) fn by_tag(records: &[Record]) -> Rows {
    let mut rows: Rows = BTreeMap::new();
    for record in records {
        if let Record::Sample(tag, sample) = record {
            rows.entry(*tag).or_default().push(Sample { at: in_milliseconds(sample.at), ..*sample });
        }
    }
    // A file has one row for each instant of a tag.
    rows.values_mut().for_each(|rows| rows.dedup_by_key(|sample| sample.at));
    rows
}

/// All pieces of an import.
pub(super) fn import_all(store: &Store, rows: Rows, file: &str, now: Timestamp) -> Option<Import> {
    let mut importing = store.importing(rows, file, now).unwrap()?;
    while store.import_piece(&mut importing).unwrap() {}
    assert_eq!(importing.done(), importing.import.rows);
    Some(importing.import)
}

fn overview(store: &Store) -> crate::history::Overview {
    match store.answer(&Query::Overview, sec(60 * HOUR_S)).unwrap() {
        Answer::Overview(overview) => *overview,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_imported_day_is_as_if_it_had_been_recorded() {
    let ((_one, db), (_two, plain)) = (folder(), folder());
    let (store, plain) = (open(&db, 0), open(&plain, 0));
    // A station that recorded before and after the day that is missing.
    let shifted = |hours: i64| good(PV, hours * HOUR_S, 1.0);
    let around: Vec<Record> = vec![shifted(-3), shifted(40), good(SV, 41 * HOUR_S, 2.0)];
    store.append(&around).unwrap();
    plain.append(&around).unwrap();
    archive_all(&store, 60);
    let day = by_tag(&rows(26));
    for (tag, samples) in &day {
        let records: Vec<Record> = samples.iter().map(|sample| Record::Sample(*tag, *sample)).collect();
        plain.append(&records).unwrap();
    }
    let import = import_all(&store, day.clone(), "logger.csv", sec(60 * HOUR_S)).unwrap();
    assert_eq!(import.rows as usize, day.values().map(Vec::len).sum::<usize>());
    assert!(content(&store) == content(&plain), "before it is archived");
    assert_eq!(import_all(&store, day.clone(), "logger.csv", sec(60 * HOUR_S)), None, "the second time");
    archive_all(&store, 60);
    assert_eq!(overview(&store).samples, 0);
    assert!(content(&store) == content(&plain), "archived");
    assert_eq!(import_all(&store, day, "other.csv", sec(60 * HOUR_S)), None, "out of the archive too");
    assert_eq!(overview(&store).imports, std::slice::from_ref(&import));
    for (from, to, buckets) in [(0, 26 * HOUR_S, 26), (5 * HOUR_S, 5 * HOUR_S + 600, 60)] {
        let [got, expect] = [&store, &plain].map(|store| series(store, PV, from, to, buckets));
        let ends =
            |series: &Series| series.buckets.iter().map(|b| b.map(|b| (b.min, b.max, b.last))).collect::<Vec<_>>();
        assert_eq!(ends(&got), ends(&expect));
    }
    // The mark is in the files of the archive, for whoever reads them; and the clock was not set.
    let files = store.files(Some((crate::history::tiers::Tier::Raw, 0..26 * HOUR_S * 1_000_000))).unwrap();
    let sql = format!("SELECT count(*) FROM {} WHERE epoch = {}", store.parquet(&files, false), sql::IMPORTED);
    let marked: u64 = store.db.query_row(&sql, [], |row| row.get(0)).unwrap();
    assert_eq!((marked, store.epoch()), (import.rows, 0));
}

#[test]
fn what_was_recorded_is_not_changed_by_a_file() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&(0..100).map(|n| good(PV, 10 * n, n as f64)).collect::<Vec<_>>()).unwrap();
    let before = content(&store);
    // One in between, one at the same instant, one before, and one after the last value ends.
    let file: Vec<Record> = [5, 10, -1, 1_200].map(|at| good(PV, at, -7.0)).into();
    let mut file = by_tag(&file);
    file.values_mut().for_each(|rows| rows.sort_by_key(|sample| sample.at));
    assert_eq!(import_all(&store, file, "x.csv", sec(5_000)).unwrap().rows, 2);
    let after = content(&store);
    let recorded: Vec<_> = after.iter().filter(|(_, sample)| sample.value != Some(-7.0)).copied().collect();
    assert!(recorded == before);
    assert_eq!(after.len(), before.len() + 2);
}

#[test]
fn an_import_is_no_time_at_which_alarms_were_watched() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let file: Vec<Record> = (0..2 * HOUR_S / 60).map(|n| good(PV, 60 * n, 1.0)).collect();
    import_all(&store, by_tag(&file), "x.csv", sec(5 * HOUR_S)).unwrap();
    let watched = |store: &Store| {
        let period = Period::free(sec(0), sec(2 * HOUR_S));
        match store.answer(&Query::Report { period }, sec(3 * HOUR_S)).unwrap() {
            Answer::Report(report) => report.alarm_metrics.watched,
            other => panic!("{other:?}"),
        }
    };
    let hot = watched(&store);
    archive_all(&store, 5);
    assert_eq!((hot, watched(&store)), (Duration::ZERO, Duration::ZERO));
}

#[test]
fn a_file_in_parts_is_imported_as_the_whole_in_any_order() {
    let whole: Vec<Record> = (0..200).map(|n| good(PV, 10 * n, n as f64)).collect();
    let parts = [&whole[..100], &whole[100..]];
    let imported = |parts: &[&[Record]], archived: bool| {
        let (_folder, db) = folder();
        let store = open(&db, 0);
        store.append(&[good(PV, -3 * HOUR_S, 0.0), good(PV, 3 * HOUR_S, 0.0)]).unwrap();
        for part in parts {
            import_all(&store, by_tag(part), "x.csv", sec(5 * HOUR_S)).unwrap();
            if archived {
                archive_all(&store, 60);
            }
        }
        content(&store)
    };
    let expect = imported(&[&whole], false);
    assert_eq!(expect.len(), 201, "all, and the recorded sample after them");
    assert!(imported(&[parts[1], parts[0]], false) == expect, "the later part first");
    assert!(imported(&parts, false) == expect, "the earlier part first");
    assert!(imported(&parts, true) == expect, "the earlier part first, and archived");
}

#[test]
fn an_import_that_was_killed_is_completed_by_the_next() {
    let file: Vec<Record> = (0..50_000).map(|n| good(if n % 3 == 0 { SV } else { PV }, n / 2, n as f64)).collect();
    let ((_one, db), (_two, other)) = (folder(), folder());
    let expect = {
        let store = open(&other, 0);
        store.append(&[good(PV, 9_000, -1.0), good(SV, 9_060, -1.0)]).unwrap();
        import_all(&store, by_tag(&file), "x.csv", sec(9 * HOUR_S)).unwrap();
        content(&store)
    };
    let store = open(&db, 0);
    store.append(&[good(PV, 9_000, -1.0), good(SV, 9_060, -1.0)]).unwrap();
    let mut importing = store.importing(by_tag(&file), "x.csv", sec(9 * HOUR_S)).unwrap().unwrap();
    assert!(store.import_piece(&mut importing).unwrap(), "there is more");
    let rest = importing.import.rows - importing.done();
    drop((store, importing));
    let opened = Store::open(&db, &def(), sec(9 * HOUR_S)).unwrap();
    let second = import_all(&opened.store, by_tag(&file), "x.csv", sec(9 * HOUR_S)).unwrap();
    assert!(rest > 0 && second.rows == rest, "{} of {rest}", second.rows);
    assert!(content(&opened.store) == expect);
}

#[test]
fn an_import_that_reaches_into_an_archived_hour_is_in_it() {
    let ((_one, db), (_two, plain)) = (folder(), folder());
    let (store, plain) = (open(&db, 0), open(&plain, 0));
    // The station recorded hour 0 and hour 2 from its second 140 on; hour 1 is missing.
    let recorded: Vec<Record> =
        [good(PV, 10, 1.0)].into_iter().chain((0..60).map(|n| good(PV, 2 * HOUR_S + 140 + 60 * n, 9.0))).collect();
    store.append(&recorded).unwrap();
    plain.append(&recorded).unwrap();
    archive_all(&store, 5);
    let file = by_tag(&[good(PV, 2 * HOUR_S - 200, 4.0), good(PV, 2 * HOUR_S - 5, 5.0)]);
    import_all(&store, file.clone(), "x.csv", sec(5 * HOUR_S)).unwrap();
    import_all(&plain, file, "x.csv", sec(5 * HOUR_S)).unwrap();
    let minutes = |store: &Store| means(store, PV, 2 * HOUR_S - 120, 2 * HOUR_S + 240, 6);
    let hours = |store: &Store| series(store, PV, 0, 4 * HOUR_S, 4).good;
    let before = (minutes(&store), hours(&store));
    archive_all(&store, 5);
    archive_all(&plain, 5);
    let (got, expect) = ((minutes(&store), hours(&store)), (minutes(&plain), hours(&plain)));
    assert_eq!(got, expect, "hot it was {before:?}");
}

#[test]
fn a_parquet_file_of_another_program_is_read_or_named() {
    let folder = tempfile::tempdir().unwrap();
    let db = duckdb::Connection::open_in_memory().unwrap();
    let read = |select: &str| {
        let file = folder.path().join("others.parquet");
        db.execute_batch(&format!("COPY ({select}) TO '{}' (FORMAT parquet)", file.display())).unwrap();
        crate::history::io::import::read_rows(&file, &def(), sec(0), sec(60 * HOUR_S))
    };
    let sample = |second, value| Sample::good(value, sec(second));
    let expect: Rows = [(PV, vec![sample(3_600, 20.5), sample(3_601, 21.0)])].into();
    // A row a sample, and a row an instant; instants that are UTC by their type, by their name, by their zone.
    for select in [
        "SELECT 'TIC-1.PV' AS tag, make_timestamptz(3600000000 + i * 1000000) AS time, 20.5 + i * 0.5 AS value FROM range(2) t(i)",
        "SELECT 'TIC-1.PV' AS tag, make_timestamp_ns(3600000000000 + i * 1000000000) AS utc, (20.5 + i * 0.5)::FLOAT AS value FROM range(2) t(i)",
        "SELECT make_timestamp(3600000000 + i * 1000000) AS utc, 20.5::DOUBLE + i * 0.5 AS 'TIC-1.PV', NULL AS 'TIC-1.PV quality' FROM range(2) t(i)",
        "SELECT '1970-01-01T0' || (1 + i) || ':00:00+0' || i || ':00' AS time, 'TIC-1.PV' AS tag, 20.5 AS value FROM range(1) t(i)
            UNION ALL SELECT '1970-01-01T01:00:01Z', 'TIC-1.PV', 21",
    ] {
        assert_eq!(read(select).as_ref(), Ok(&expect), "{select}");
    }
    for (select, why) in [
        ("SELECT 'TIC-1.PV' AS tag, 'noon' AS utc, 1 AS value", "row 1: found the time `noon`"),
        ("SELECT 'TIC-1.PV' AS tag, make_timestamp(0) AS utc, 'warm' AS value", "row 1: TIC-1.PV: found `warm`"),
        ("SELECT 1 AS a, [1, 2] AS b", "line 1: column 1 is none of samples"),
        ("SELECT 'x' AS tag, make_timestamp(0) AS utc, 1 AS value WHERE false", "found no row"),
    ] {
        assert!(read(select).is_err_and(|problems| problems[0].contains(why)), "{select}: {:?}", read(select));
    }
    let file = folder.path().join("others.parquet");
    let whole = std::fs::read(&file).unwrap();
    for damaged in
        [&whole[..4], &whole[..whole.len() / 2], &[&whole[..whole.len() - 12], b"\xff\xff\xff\x7fPAR1"].concat()]
    {
        std::fs::write(&file, damaged).unwrap();
        let read = crate::history::io::import::read_rows(&file, &def(), sec(0), sec(60 * HOUR_S));
        let why = read.unwrap_err().remove(0);
        assert!(why.contains("others.parquet: cannot be read as Parquet"), "{why}");
        // Words of the file, not of the statement that has read it.
        assert!(!why.contains('\n') && !why.contains("/dev/fd"), "{why}");
    }
}
