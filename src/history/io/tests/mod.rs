//! The store: what goes in comes out, over restarts and failures.
#![allow(clippy::unwrap_used)]

mod absent;
mod damage;
mod flips;
mod alarm_metrics;
mod pieces;
mod reading;

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
        value: Some(85.5),
        limit: Some(85.0),
        by: (step == AlarmEvent::Acknowledged).then(|| "somchai".into()),
        reason: None,
        until: None,
        first_out: None,
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
        ("checkpoint_threshold", "3.8 MiB"),
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
    // Nobody ended the curves: the station died. It is known to have lived until 30 s.
    let store = open(&db, 100);
    store.append(&[good(PV, 100, 40.0)]).unwrap();
    let expect = [Some(27.0), Some(28.0), None, None, Some(40.0)];
    assert_eq!(means(&store, PV, 0, 125, 5)[0], expect[0]);
    let by_10_s = means(&store, PV, 0, 110, 11);
    assert_eq!(by_10_s[..3], [Some(27.0); 3]);
    assert_eq!(by_10_s[3], Some(28.0));
    assert_eq!(by_10_s[4..10], [None; 6]);
    assert_eq!(by_10_s[10], Some(40.0));
    // 31 s of the set value, then nothing.
    assert!((series(&store, SV, 0, 100, 1).good - 0.31).abs() < 1e-9);
    // Opening once more adds nothing: the curve of SV has ended already.
    drop(store);
    let store = open(&db, 100);
    let rows: u32 = store.db.query_row("SELECT count(*) FROM sample WHERE tag = 1", [], |row| row.get(0)).unwrap();
    assert_eq!(rows, 2);
}

#[test]
fn a_value_is_stored_to_its_last_digit_and_every_quality_comes_back() {
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
fn a_tag_keeps_its_curve_when_the_plant_file_is_reordered_and_loses_it_with_its_unit() {
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

#[test]
fn lists_come_newest_first_within_their_span_and_limit() {
    use AlarmEvent::{Acknowledged, Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    // Two steps at one instant keep their order.
    let steps = [
        step(1, "high", Raised),
        step(2, "high", Acknowledged),
        step(2, "high", ReturnedToNormal),
        step(9, "low", Raised),
    ];
    let mut records: Vec<_> = steps.iter().cloned().map(Record::Alarm).collect();
    records.extend([action(3), action(4)].map(Record::Action));
    store.append(&records).unwrap();
    let journal = |from, to, limit| Query::Journal { from: sec(from), to: sec(to), limit };
    let [raised, acked, returned, low] = &steps;
    for (query, expect) in [
        (journal(0, 10, 100), vec![low, returned, acked, raised]),
        (journal(0, 9, 2), vec![returned, acked]),
        (journal(2, 9, 100), vec![returned, acked]),
    ] {
        let expect = Answer::Journal(expect.into_iter().cloned().collect());
        assert_eq!(store.answer(&query, sec(10)).unwrap(), expect);
    }
    let query = Query::Actions { from: sec(0), to: sec(10), limit: 1 };
    assert_eq!(store.answer(&query, sec(10)).unwrap(), Answer::Actions(vec![action(4)]));
    assert_eq!(store.answer(&journal(5, 5, 1), sec(10)), Err(HistoryError::EmptyPeriod));
}

#[test]
fn actions_are_found_by_text_user_and_action() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let login = ActionRecord {
        by: "Anna".into(), action: "login".into(), target: "ฝ่ายผลิต 50%".into(), ..action(4)
    };
    store.append(&[Record::Action(action(3)), Record::Action(login.clone())]).unwrap();
    let check = |words: &str, by: &str, action: &str, expect: Vec<ActionRecord>| {
        let (words, by, action) = (words.to_owned(), by.to_owned(), action.to_owned());
        let query = Query::Audit { from: sec(0), to: sec(10), words, by, action, limit: 10 };
        assert_eq!(store.answer(&query, sec(10)).unwrap(), Answer::Actions(expect), "{query:?}");
    };
    check("", "", "", vec![login.clone(), action(3)]);
    check("tic-1", "", "write", vec![action(3)]);
    check("", "ANNA", "", vec![login.clone()]);
    check("ผลิต 50%", "", "log", vec![login.clone()]);
    check("70.0 °c", "anna", "", vec![login.clone()]);
    check("", "", "_rite", vec![]);
    check("'; DROP TABLE sample", "", "", vec![]);
}

/// A minute of a line that ends `at`, with so many requests.
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

#[test]
fn what_a_line_counted_comes_back_minute_by_minute() {
    let (_folder, db) = folder();
    let mut def = plant("Asia/Bangkok", &THREE);
    def.lines.push(LineDef::new(LineId(0), "L1", Transport::tcp("plc", 502)));
    let store = Store::open(&db, &Arc::new(def), sec(0)).unwrap().store;
    let minutes = [minute("L1", 60, 60), minute("L1", 120, 58), minute("L1", 180, 61)];
    let records = minutes.iter().cloned().chain([minute("L2", 120, 9)]).map(Record::Line);
    store.append(&records.collect::<Vec<_>>()).unwrap();
    assert_eq!(store.count_rows().unwrap(), 4);
    let ask = |from, to, limit| Query::LineMinutes { line: LineId(0), from: sec(from), to: sec(to), limit };
    for (query, expect) in
        [(ask(0, 300, 100), &minutes[..]), (ask(60, 180, 100), &minutes[..2]), (ask(0, 300, 2), &minutes[1..])]
    {
        assert_eq!(store.answer(&query, sec(300)).unwrap(), Answer::LineMinutes(expect.to_vec()), "{query:?}");
    }
}

#[test]
fn a_history_of_an_older_program_gets_the_new_table_and_keeps_its_rows() {
    let (_folder, db) = folder();
    let old = duckdb::Connection::open(&db).unwrap();
    old.execute_batch(sql::CREATE_VERSION).unwrap();
    old.execute_batch(sql::MIGRATIONS[0]).unwrap();
    old.execute(sql::SET_VERSION, [1]).unwrap();
    old.execute_batch(
        "INSERT INTO tag VALUES (0, 'TIC-1.PV', '°C'); INSERT INTO sample VALUES ('1970-01-01', 0, 27.0, 0)",
    )
    .unwrap();
    drop(old);
    let store = open(&db, 10);
    store.append(&[Record::Line(minute("L1", 60, 60)), Record::Action(action(5))]).unwrap();
    // The value, the end of its curve, the minute, the action.
    assert_eq!(store.count_rows().unwrap(), 4);
}

/// The epoch of each row, in the order in which they were written.
fn epochs(store: &Store, table: &str) -> Vec<u16> {
    let mut statement = store.db.prepare(&format!("SELECT epoch FROM {table} ORDER BY rowid")).unwrap();
    statement.query_map([], |row| row.get(0)).unwrap().map(Result::unwrap).collect()
}

#[test]
fn each_record_has_the_epoch_of_its_clock() {
    let (_folder, db) = folder();
    let raised = |at| Record::Alarm(step(at, "high", AlarmEvent::Raised));
    let store = open(&db, 0);
    store.append(&[good(PV, 10, 1.0), raised(10), Record::ClockSet, good(PV, 5, 2.0)]).unwrap();
    store.append(&[Record::ClockSet, Record::ClockSet]).unwrap();
    drop(store);
    let store = open(&db, 20);
    store.append(&[raised(21), Record::Action(action(21)), Record::Line(minute("L1", 60, 60))]).unwrap();
    // The last sample is the end of the curve, which is written at the start.
    assert_eq!(epochs(&store, "sample"), [0, 1, 3]);
    assert_eq!(epochs(&store, "alarm_journal"), [0, 3]);
    assert_eq!((epochs(&store, "operator_action"), epochs(&store, "line_minute")), (vec![3], vec![3]));
}

#[test]
fn a_start_before_the_last_record_begins_an_epoch() {
    let (_folder, db) = folder();
    let run = |from: i64| {
        let mut writer = Writer::open(db.clone(), def(), sec(from)).unwrap();
        writer.accept(vec![good(PV, from, 1.0)]);
        writer.commit(sec(from));
        let rows = epochs(writer.store().unwrap(), "sample");
        (writer.status().epoch, *rows.last().unwrap())
    };
    assert_eq!(run(1_000), (0, 0));
    assert_eq!(run(2_000), (0, 0));
    assert_eq!(run(500), (1, 1));
}

#[test]
fn the_alarms_of_before_the_restart_are_restored_with_their_acknowledgements() {
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
fn a_shift_report_has_figures_alarms_and_actions() {
    use AlarmEvent::{Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let samples = (0..12).map(|i| good(PV, i * 10, 20.0 + i as f64)).chain([good(SV, 0, 70.0)]);
    let alarms =
        [step(5, "high", Raised), step(30, "high", ReturnedToNormal), step(50, "low", Raised)].map(Record::Alarm);
    store.append(&samples.chain(alarms).chain([Record::Action(action(25))]).collect::<Vec<_>>()).unwrap();
    let period = Period { name: "period".into(), from: sec(20), to: sec(200) };
    let query = Query::Report { period: period.clone() };
    let Answer::Report(report) = store.answer(&query, sec(100)).unwrap() else { panic!("not a report") };
    assert_eq!((report.period, report.until), (period, sec(100)));
    let [pv, sv, mv] = report.tags.as_slice() else { panic!("three tags") };
    assert_eq!((pv.tag.as_str(), pv.unit.as_str(), pv.decimals), ("TIC-1.PV", "°C", 1));
    assert_eq!((pv.min, pv.mean, pv.max, pv.last, pv.good), (Some(22.0), Some(25.5), Some(29.0), Some(29.0), 1.0));
    // 20–30 s from before the period, and 50 s to the end.
    assert_eq!(pv.in_alarm.as_secs(), 60);
    assert_eq!((sv.mean, sv.good), (Some(70.0), 1.0));
    assert_eq!((mv.mean, mv.good), (None, 0.0));
    assert_eq!(report.alarms, [step(30, "high", ReturnedToNormal), step(50, "low", Raised)]);
    assert_eq!(report.actions, [action(25)]);
    assert_eq!(report.record_of, Some(("TIC-1".into(), "°C".into())));
    assert_eq!(report.record.len(), 8);
    assert_eq!((report.record[0].at, report.record[0].er), (sec(20), Some(48.0)));
    let future = Query::Report { period: Period { name: "period".into(), from: sec(300), to: sec(400) } };
    assert_eq!(store.answer(&future, sec(100)), Err(HistoryError::EmptyPeriod));
}

#[test]
fn a_report_has_the_last_entry_of_the_audit_log_before_its_end() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let entry = |at: i64, number: u64| {
        let chain_hash = Some(ChainHash { number, hash: [number as u8; 32] });
        Record::Action(ActionRecord { chain_hash, ..action(at) })
    };
    // The clock went back between 3 and 4, 6 was written after the period, and one action is not in the log.
    let log = [entry(10, 1), entry(30, 2), entry(50, 3), entry(40, 4), entry(45, 5), entry(100, 6)];
    store.append(&log.into_iter().chain([Record::Action(action(60))]).collect::<Vec<_>>()).unwrap();
    let audit = |from: i64, to: i64| {
        let period = Period { name: "period".into(), from: sec(from), to: sec(to) };
        store.report(&period, sec(1_000)).unwrap().audit.map(|entry| (entry.number, entry.hash[0]))
    };
    assert_eq!(audit(20, 100), Some((5, 5)));
    assert_eq!(audit(20, 40), Some((2, 2)));
    assert_eq!(audit(70, 101), Some((6, 6)));
    assert_eq!(audit(0, 10), None, "nothing was in the log then");
}

#[test]
fn a_period_of_a_century_is_answered_at_once_and_a_record_of_millions_of_rows_refused() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 0, 27.0), good(PV, 100_000, 28.0)]).unwrap();
    let century = 3_000_000_000;
    assert_eq!(series(&store, PV, -century, century, 3).buckets.len(), 3);
    let period = Period { name: "period".into(), from: sec(0), to: sec(century) };
    let answer = store.answer(&Query::Report { period }, sec(century));
    assert!(matches!(answer, Err(HistoryError::TooManyRows { .. })));
}

#[test]
fn a_period_before_the_samples_of_a_start_is_answered_at_once() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&(0..100).map(|value| good(PV, 1_000, f64::from(value))).collect::<Vec<_>>()).unwrap();
    let century = 3_000_000_000;
    assert_eq!(means(&store, PV, -century, 900, 3), [None; 3]);
    assert_eq!(series(&store, PV, -century, 1_001, 3).buckets.last().unwrap().unwrap().last, 99.0);
}

#[test]
fn records_wait_while_the_store_fails_and_nothing_is_lost_when_it_recovers() {
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
fn a_clock_that_went_back_is_reported_and_the_old_curve_still_ends() {
    let (_folder, db) = folder();
    open(&db, 0).append(&[good(PV, 1000, 27.0)]).unwrap();
    let writer = Writer::open(db, def(), sec(500)).unwrap();
    let trouble = writer.status().trouble.clone().unwrap();
    assert_eq!(trouble, "the clock is behind the last record, 1970-01-01T00:16:41Z: is it right?");
    assert_eq!(means(writer.store().unwrap(), PV, 1000, 1002, 2), [Some(27.0), None]);
}

#[test]
fn a_stopped_station_leaves_every_curve_ended_and_a_running_one_answers() {
    let (_folder, db) = folder();
    let clock = Clock::starting_at(sec(10), 1.0);
    let mut handle = thread::start(&db, def(), clock).unwrap();
    assert_eq!(handle.restored.take().unwrap().blocking_recv().unwrap().steps, []);
    handle.records.blocking_send(vec![good(PV, 5, 27.0), Record::Alarm(step(6, "high", AlarmEvent::Raised))]).unwrap();
    let (reply, answer) = tokio::sync::oneshot::channel();
    let period = Period { name: "period".into(), from: sec(0), to: sec(10) };
    handle.queries.blocking_send((1, QueryRequest { query: Query::Report { period }, reply })).unwrap();
    let Ok(Ok(Answer::Report(report))) = answer.blocking_recv() else { panic!("no report") };
    assert_eq!(report.tags[0].last, Some(27.0));
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
fn a_question_behind_which_too_much_lies_is_refused_before_anything_is_read() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 1, 27.0), good(PV, 2, 28.0), good(PV, 3, 28.0)]).unwrap();
    // As if the three rows lay evenly over their two seconds and the three tags: one second of all is half of them.
    let now = sec(3);
    assert_eq!(store.bounded(3, sec(1), sec(2), now, 2), Ok(()));
    assert_eq!(store.bounded(1, sec(0), sec(4), now, 2), Ok(()));
    assert_eq!(store.bounded(3, sec(0), sec(4), now, 2), Err(HistoryError::TooManyRows { rows: 3, max: 2 }));
    // A connection that has not seen the rows come refuses as well.
    let reader = open(&folder().1, 0).try_clone().unwrap();
    assert_eq!(reader.bounded(3, sec(0), sec(4), now, 0), Ok(()), "nothing is stored there");
}

#[test]
fn what_an_operator_does_with_an_alarm_is_committed_at_once() {
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
        handle.records.blocking_send(vec![Record::Alarm(acknowledged)]).unwrap();
        runtime.block_on(status.wait_for(|status| status.rows == n as u64)).unwrap();
    }
    handle.stop();
}

#[test]
fn a_step_of_the_clock_is_not_counted_as_a_row() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    writer.accept(vec![Record::ClockSet, good(PV, 1, 27.0), Record::ClockSet]);
    writer.commit(sec(1));
    let stored = writer.store().unwrap().count_rows().unwrap();
    assert_eq!((writer.status().rows, writer.status().waiting, stored), (1, 0, 1));
}

#[test]
fn migrations_are_numbered_and_run_once() {
    let (_folder, db) = folder();
    for _ in 0..2 {
        let store = open(&db, 0);
        let versions: u32 = store.db.query_row("SELECT count(*) FROM schema_version", [], |row| row.get(0)).unwrap();
        assert_eq!(versions as usize, sql::MIGRATIONS.len());
    }
    open(&db, 0).db.execute_batch("INSERT INTO schema_version VALUES (999)").unwrap();
    assert!(
        matches!(Store::open(&db, &def(), sec(0)).err(), Some(HistoryError::Engine(words)) if words.contains("newer"))
    );
    assert!(db.exists());
}

#[test]
fn an_action_that_was_stored_without_its_seal_is_there_once_when_it_comes_with_it() {
    use crate::plant::record::{ActionRecord, ChainHash};
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("h.duckdb"), &def(), sec(0)).unwrap().store;
    let action = |number: i64, chain_hash: Option<ChainHash>| {
        Record::Action(ActionRecord {
            at: sec(number),
            by: "anna".into(),
            from: "".into(),
            action: "write".into(),
            target: "TIC-1.SV".into(),
            old: None,
            new: Some("70".into()),
            outcome: "verified".into(),
            note: None,
            chain_hash,
        })
    };
    let chain_hash = |number| ChainHash { number, hash: [number as u8; 32] };
    store.append(&[action(1, Some(chain_hash(1))), action(2, None), action(3, None)]).unwrap();
    assert_eq!(store.chain_hashes().unwrap(), [chain_hash(1)]);
    store.append(&[action(2, Some(chain_hash(2))), action(4, Some(chain_hash(4)))]).unwrap();
    assert_eq!(store.chain_hashes().unwrap(), [chain_hash(4), chain_hash(2), chain_hash(1)]);
    assert_eq!(store.count_rows().unwrap(), 4, "the second was stored twice, the third waits for its chain_hash");
}
