//! The store: what goes in comes out, over restarts and failures.
#![allow(clippy::unwrap_used)]

mod absent;
mod archive;
mod backup;
mod batches;
mod closed;
mod compact;
mod counts;
mod doubled;
pub(super) mod damage;
mod epochs;
mod exact;
mod lists;
mod migrations;
mod past;
mod flips;
mod import;
mod alarm_metrics;
mod moved;
mod outages;
mod pieces;
mod power;
mod procedures;
mod reading;
mod redefine;
mod reunite;
mod runs;
mod steps;
mod totals;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;

use super::{files, sql, store::Store, thread, writer::Writer};
use crate::{
    bus::io::clock::Clock,
    history::{Answer, HistoryError, Query, Series, io::QueryRequest},
    plant::{
        def::{LineDef, LineId, PlantDef, Priority, TagId, Transport},
        line_minute::LineMinute,
        record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash, FirstOut, Record},
        sample::{Cause, Sample},
    },
    profile::io::atomic::with_suffix,
    report::{
        Period,
        testing::{THREE, plant, sec, tag},
    },
};

const PV: TagId = TagId(0);
const SV: TagId = TagId(1);

fn def() -> Arc<PlantDef> {
    Arc::new(plant("Asia/Bangkok", &THREE))
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let db = folder.path().join("tank.duckdb");
    (folder, db)
}

fn open(db: &Path, now: i64) -> Store {
    let opened = Store::open(db, &def(), sec(now)).unwrap();
    assert_eq!(opened.trouble, None);
    opened.store.end_curves_left_behind(sec(now)).unwrap();
    opened.store
}

fn good(tag: TagId, at: i64, value: f64) -> Record {
    Record::Sample(tag, Sample::good(value, sec(at)))
}

fn step(at: i64, text: &str, step: AlarmEvent) -> AlarmRecord {
    AlarmRecord {
        at: sec(at),
        subject: "TIC-1.PV".into(),
        message: text.into(),
        priority: Priority::High,
        event: step,
        value: Some(85.5.into()),
        limit: Some(85.0),
        by: (step == AlarmEvent::Acknowledged).then(|| "somchai".into()),
        reason: None,
        until: None,
        first_out: None,
        identity: None,
    }
}

fn action(at: i64) -> ActionRecord {
    ActionRecord {
        at: sec(at),
        by: "somchai".into(),
        action: "write".into(),
        target: "TIC-1.SV".into(),
        old: Some("70.0 °C".into()),
        new: None,
        outcome: "verified".into(),
        from: "".into(),
        note: None,
        chain_hash: None,
    }
}

fn series(store: &Store, tag: TagId, from: i64, to: i64, buckets: usize) -> Series {
    let query = Query::Series { tags: vec![tag], from: sec(from), to: sec(to), buckets };
    match store.answer(&query, sec(to)).unwrap() {
        Answer::Series(mut series) => series.remove(0),
        other => panic!("{other:?}"),
    }
}

fn means(store: &Store, tag: TagId, from: i64, to: i64, buckets: usize) -> Vec<Option<f64>> {
    series(store, tag, from, to, buckets).buckets.iter().map(|bucket| bucket.map(|bucket| bucket.mean)).collect()
}

fn setting(store: &Store, name: &str) -> String {
    store.db.query_row(&format!("SELECT current_setting('{name}')::VARCHAR"), [], |row| row.get(0)).unwrap()
}

#[test]
fn the_engine_is_the_one_that_was_vetted_and_set_as_decided() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    assert_eq!(store.db.version().unwrap(), "v1.5.6");
    for (name, expect) in [
        ("threads", "1"),
        ("max_memory", "61.0 MiB"),
        ("autoinstall_known_extensions", "false"),
        ("autoload_known_extensions", "false"),
        ("disabled_compression_methods", "bitpacking"),
        ("max_temp_directory_size", "488.2 MiB"),
        ("checkpoint_threshold", "931.3 GiB"),
    ] {
        assert_eq!(setting(&store, name).to_lowercase(), expect.to_lowercase(), "{name}");
    }
    // And it does what it says: nothing on disk is bit-packed.
    store.append(&(0..20_000).map(|i| good(PV, i, i as f64 / 10.0)).collect::<Vec<_>>()).unwrap();
    store.checkpoint().unwrap();
    let sql = "SELECT count(*), count(*) FILTER (lower(compression) = 'bitpacking') FROM pragma_storage_info('sample')";
    let (segments, packed): (u32, u32) = store.db.query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?))).unwrap();
    assert!(segments > 0);
    assert_eq!(packed, 0);
}

#[cfg(not(feature = "bundled"))]
#[test]
fn the_linked_library_has_its_extensions_built_in() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let sql = "SELECT count(*) FROM duckdb_extensions() WHERE loaded AND extension_name IN ('icu', 'json', 'parquet')";
    assert_eq!(store.db.query_row(sql, [], |row| row.get::<_, u32>(0)).unwrap(), 3);
}

#[test]
fn a_restart_continues_and_the_time_in_between_is_a_gap() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 0, 27.0), good(SV, 0, 70.0), good(PV, 30, 28.0)]).unwrap();
    drop(store);
    // The curves have no end: the station died. It is known to have lived until 30 s.
    let store = open(&db, 100);
    store.append(&[good(PV, 100, 40.0)]).unwrap();
    let expect = [Some(27.0), Some(28.0), None, None, Some(40.0)];
    assert_eq!(means(&store, PV, 0, 125, 5)[0], expect[0]);
    let by_10_s = means(&store, PV, 0, 110, 11);
    assert_eq!(by_10_s[..3], [Some(27.0); 3]);
    assert_eq!(by_10_s[3], Some(28.0));
    assert_eq!(by_10_s[4..10], [None; 6]);
    assert_eq!(by_10_s[10], Some(40.0));
    // 31 s of the setpoint, then nothing.
    assert!((series(&store, SV, 0, 100, 2).good - 0.31).abs() < 1e-9);
    // Opening once more adds nothing: the curve of SV has ended already.
    drop(store);
    let store = open(&db, 100);
    let rows: u32 = store.db.query_row("SELECT count(*) FROM sample WHERE tag = 1", [], |row| row.get(0)).unwrap();
    assert_eq!(rows, 2);
}

#[test]
fn values_and_qualities_are_stored_exactly() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 0, 123_456.7), Record::Sample(PV, Sample::bad(Cause::SensorFault, sec(10)))]).unwrap();
    let last = Sample::good(1.0, sec(20)).uncertain(Cause::Timeout);
    store.append(&[Record::Sample(PV, Sample { at: sec(20), ..last })]).unwrap();
    assert_eq!(means(&store, PV, 0, 30, 3), [Some(123_456.7), None, None]);
    let codes: Vec<u8> = {
        let mut statement = store.db.prepare("SELECT quality FROM sample ORDER BY utc").unwrap();
        statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect()
    };
    assert_eq!(codes, [0, 136, 66]);
}

#[test]
fn a_tag_keeps_its_curve_unless_its_unit_changes() {
    let (_folder, db) = folder();
    open(&db, 0).append(&[good(PV, 0, 27.0), good(SV, 0, 70.0)]).unwrap();
    let mut other = plant("Asia/Bangkok", &THREE);
    other.tags = vec![tag(0, "NEW"), tag(1, "SV"), tag(2, "PV")];
    let store = Store::open(&db, &Arc::new(other.clone()), sec(5)).unwrap().store;
    let at_start = |store: &Store, tag| means(store, TagId(tag), 0, 1, 1)[0];
    assert_eq!([0, 1, 2].map(|tag| at_start(&store, tag)), [None, Some(70.0), Some(27.0)]);
    drop(store);
    other.tags[2].unit = "°F".into();
    let store = Store::open(&db, &Arc::new(other), sec(5)).unwrap().store;
    assert_eq!([1, 2].map(|tag| at_start(&store, tag)), [Some(70.0), None]);
}

#[test]
fn a_commit_that_fails_leaves_nothing_behind() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.db.execute_batch("DROP TABLE operator_action").unwrap();
    let records = [good(PV, 0, 27.0), Record::Alarm(step(0, "high", AlarmEvent::Raised)), Record::Action(action(0))];
    assert!(matches!(store.append(&records), Err(HistoryError::Engine(_))));
    for table in ["sample", "alarm_journal"] {
        let sql = format!("SELECT count(*) FROM {table}");
        assert_eq!(store.db.query_row(&sql, [], |row| row.get::<_, u32>(0)).unwrap(), 0, "{table}");
    }
    // And the store goes on.
    store.append(&records[..2]).unwrap();
}

/// A minute of a line that ends `at`, with this many requests.
fn minute(line: &str, at: i64, requests: u64) -> LineMinute {
    LineMinute {
        at: sec(at),
        line: line.into(),
        requests,
        ok: requests - 3,
        timeouts: 1,
        corrupt: 1,
        exceptions: 1,
        retries: 2,
        late: 4,
        missed: 5,
        sent_bytes: 480,
        received_bytes: 1_260,
        utilisation: 0.62,
        reply_p99_ms: Some(14.1),
        reply_max_ms: None,
    }
}

/// The epoch of each row, in the order in which they were written.
fn epochs(store: &Store, table: &str) -> Vec<u16> {
    let mut statement = store.db.prepare(&format!("SELECT epoch FROM {table} ORDER BY rowid")).unwrap();
    statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect()
}

#[test]
fn alarms_and_acknowledgements_survive_a_restart() {
    use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let old = [step(1, "high", Raised), step(2, "high", ReturnedToNormal), step(3, "high", Acknowledged)];
    let new = [
        step(4, "high", Raised),
        step(5, "low", Raised),
        step(6, "high", Acknowledged),
        step(7, "low", ReturnedToNormal),
    ];
    let shelved = AlarmRecord {
        reason: Some("sensor is being changed".into()),
        until: Some(sec(600)),
        first_out: Some(FirstOut { began: sec(4), rank: 2 }),
        ..step(8, "low", AlarmEvent::Shelved)
    };
    let last = [&old[1..2], &new, &[shelved]].concat();
    let all = old[..1].iter().chain([&old[2]]).chain(&last).cloned();
    store.append(&all.map(Record::Alarm).collect::<Vec<_>>()).unwrap();
    assert_eq!(store.restore().unwrap(), last, "the last step of every kind");
}

#[test]
fn no_record_is_lost_when_a_failed_store_recovers() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    let sql = |writer: &Writer, sql: &str| writer.store().unwrap().db.execute_batch(sql).unwrap();
    sql(&writer, "ALTER TABLE sample RENAME TO hidden");
    writer.accept(vec![good(PV, 0, 27.0)]);
    writer.commit(sec(1));
    writer.accept(vec![good(PV, 1, 28.0)]);
    writer.commit(sec(2));
    let words = writer.status().words().unwrap();
    assert!(words.starts_with("not recording: 2 records waiting (0 %); "), "{words}");
    assert_eq!((writer.status().rows, writer.status().lost, writer.status().committed_at), (0, 0, None));
    sql(&writer, "ALTER TABLE hidden RENAME TO sample");
    writer.commit(sec(3));
    assert_eq!((writer.status().rows, writer.status().lost), (2, 0));
    assert_eq!((&writer.status().trouble, writer.status().committed_at), (&None, Some(sec(3))));
    assert_eq!(means(writer.store().unwrap(), PV, 0, 2, 2), [Some(27.0), Some(28.0)]);
    // What still cannot be stored at the very end is counted as lost.
    sql(&writer, "ALTER TABLE sample RENAME TO hidden");
    writer.accept(vec![good(PV, 4, 27.0)]);
    writer.finish(sec(5));
    assert_eq!(writer.status().lost, 1);
}

#[test]
fn a_stop_ends_every_curve_and_a_run_answers_queries() {
    let (_folder, db) = folder();
    let clock = Clock::starting_at(sec(10), 1.0);
    let mut handle = thread::start(&db, def(), clock).unwrap();
    assert_eq!(handle.restored.take().unwrap().blocking_recv().unwrap().events, []);
    let records = vec![good(PV, 5, 27.0), Record::Alarm(step(6, "high", AlarmEvent::Raised))];
    handle.records.blocking_send(records.into()).unwrap();
    let (reply, answer) = tokio::sync::oneshot::channel();
    let period = Period::free(sec(0), sec(10));
    handle.queries.blocking_send((1, QueryRequest { query: Query::Report { period }, reply })).unwrap();
    let Ok(Ok(Answer::Report(report))) = answer.blocking_recv() else { panic!("no report") };
    assert_eq!(report.tags[0].last, Some(27.0.into()));
    assert_eq!(handle.status.borrow().lost, 0);
    handle.stop();
    let store = open(&db, 100);
    assert_eq!(store.restore().unwrap(), [step(6, "high", AlarmEvent::Raised)]);
    let (last, quality): (i64, u8) = store
        .db
        .query_row("SELECT utc, quality FROM sample ORDER BY rowid DESC LIMIT 1", [], |row| {
            Ok((row.get(0)?, row.get(1)?))
        })
        .unwrap();
    assert_eq!(quality, 139);
    assert!(Timestamp::from_microsecond(last).unwrap() < sec(100));
    assert!(!with_suffix(&db, ".wal").exists(), "the log was written into the file");
}

#[test]
fn operator_steps_of_alarms_are_committed_at_once() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    assert!(!writer.accept(vec![Record::Alarm(AlarmRecord { by: None, ..step(6, "high", AlarmEvent::Raised) })]));
    let acknowledged = AlarmRecord { by: Some("anna".into()), ..step(7, "high", AlarmEvent::Acknowledged) };
    assert!(writer.accept(vec![Record::Alarm(acknowledged)]), "it asks for a commit");
    writer.commit(sec(7));
    assert_eq!(writer.status().rows, 2);

    let (_folder, db) = folder();
    // Nothing else commits for an hour.
    let (clock, answer) = (Clock::starting_at(sec(10), 1.0), Arc::new(Store::answer));
    let handle = thread::start_with(&db, def(), clock, Duration::from_secs(3600), answer).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut status = handle.status.clone();
    for n in 1..=20 {
        let acknowledged = AlarmRecord { by: Some("anna".into()), ..step(n, "high", AlarmEvent::Acknowledged) };
        handle.records.blocking_send(vec![Record::Alarm(acknowledged)].into()).unwrap();
        runtime.block_on(status.wait_for(|status| status.rows == n as u64)).unwrap();
    }
    handle.stop();
}
