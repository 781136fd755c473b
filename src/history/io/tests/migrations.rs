//! Histories of earlier versions of the program: a station migrates them, a report says that it cannot.

use std::fs;

use super::*;
use crate::report::ShiftReport;

/// A history as a program left it whose schema had this version.
fn old_history(db: &Path, version: usize, rows: &str) {
    let old = duckdb::Connection::open(db).unwrap();
    old.execute_batch(sql::CREATE_VERSION).unwrap();
    for (number, migration) in sql::MIGRATIONS[..version].iter().enumerate() {
        old.execute_batch(migration).unwrap();
        old.execute(sql::SET_VERSION, [number + 1]).unwrap();
    }
    old.execute_batch(rows).unwrap();
}

/// What versions 6 and 7 wrote of the records that [`records`] are.
fn old_rows(journal_columns: &str) -> String {
    format!(
        "
INSERT INTO tag VALUES (0, 'TIC-1.PV', '°C'), (1, 'TIC-1.SV', '°C');
INSERT INTO sample VALUES
    ('1970-01-01 00:00:10', 0, 27.0, 0, 0), ('1970-01-01 00:00:10', 1, 70.0, 0, 0),
    ('1970-01-01 00:00:30', 0, 28.5, 0, 0), ('1970-01-01 00:00:50', 0, NULL, 136, 1);
INSERT INTO alarm_journal (utc, subject, priority, value, limit_value, by_whom, epoch, {journal_columns}) VALUES
    ('1970-01-01 00:00:11', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'raised', 'high', '1970-01-01 00:00:11', 2),
    ('1970-01-01 00:00:12', 'TIC-1.PV', 2, 85.5, 85.0, 'somchai', 0, 'acknowledged', 'high', NULL, NULL),
    ('1970-01-01 00:00:13', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'raised again', 'high', NULL, NULL),
    ('1970-01-01 00:00:14', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'returned', 'high', NULL, NULL),
    ('1970-01-01 00:00:15', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'suppressed', 'low', NULL, NULL),
    ('1970-01-01 00:00:16', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'raised quietly', 'low', NULL, NULL),
    ('1970-01-01 00:00:17', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'returned quietly', 'low', NULL, NULL),
    ('1970-01-01 00:00:18', 'TIC-1.PV', 2, 85.5, 85.0, NULL, 0, 'released', 'low', NULL, NULL);
INSERT INTO operator_action (utc, by_whom, action, target, old_value, outcome, epoch, number, hash) VALUES
    ('1970-01-01 00:00:20', 'somchai', 'order', 'TIC-1.SV', '70.0 °C', 'verified', 0, 1, NULL),
    ('1970-01-01 00:00:21', 'somchai', 'write', 'TIC-1.SV', '70.0 °C', 'verified', 0, 2, NULL),
    ('1970-01-01 00:00:22', 'somchai', 'signature failed', 'TIC-1.SV', '70.0 °C', 'verified', 0, 3, NULL),
    ('1970-01-01 00:00:23', 'somchai', 'lock-out', 'TIC-1.SV', '70.0 °C', 'verified', 0, 4, NULL),
    ('1970-01-01 00:00:24', 'somchai', 'audit trail', 'TIC-1.SV', '70.0 °C', 'verified', 0, 5, NULL),
    ('1970-01-01 00:00:25', 'somchai', 'read audit trail', 'TIC-1.SV', '70.0 °C', 'verified', 1, 6, NULL);
INSERT INTO line_minute VALUES
    ('1970-01-01 00:01:00', 'L1', 60, 57, 1, 1, 1, 2, 4, 5, 480, 1260, 0.62, 14.1, NULL, 1);
UPDATE last_commit SET
    number = 7, first_utc = '1970-01-01 00:00:10', last_utc = '1970-01-01 00:00:50', epoch = 1;
"
    )
}

/// The same in today's words.
fn records() -> Vec<Record> {
    use AlarmEvent::{
        Acknowledged, Raised, RaisedSuppressed, ReAlarmed, ReturnedSuppressed, ReturnedToNormal, SuppressedByDesign,
        Unsuppressed,
    };
    let first_out = Some(FirstOut { began: sec(11), rank: 2 });
    let steps = [
        AlarmRecord { first_out, ..step(11, "high", Raised) },
        step(12, "high", Acknowledged),
        step(13, "high", ReAlarmed),
        step(14, "high", ReturnedToNormal),
        step(15, "low", SuppressedByDesign),
        step(16, "low", RaisedSuppressed),
        step(17, "low", ReturnedSuppressed),
        step(18, "low", Unsuppressed),
    ];
    let samples = [
        good(PV, 10, 27.0),
        good(SV, 10, 70.0),
        good(PV, 30, 28.5),
        Record::Sample(PV, Sample::bad(Cause::SensorFault, sec(50))),
    ];
    let others = [Record::Action(action(21)), Record::Line(minute("L1", 60, 60))];
    samples.into_iter().chain(steps.map(Record::Alarm)).chain(others).collect()
}

/// What a station, a report and an export ask of a history.
fn answers(db: &Path) -> Vec<Answer> {
    let mut def = plant("Asia/Bangkok", &THREE);
    def.lines.push(LineDef::new(LineId(0), "L1", Transport::tcp("plc", 502)));
    let opened = Store::open(db, &Arc::new(def), sec(100)).unwrap();
    assert_eq!(opened.trouble, None);
    let (store, from, to) = (opened.store, sec(0), sec(90));
    store.end_curves_left_behind(sec(100)).unwrap();
    let period = Period::free(from, to);
    let queries = [
        Query::Series { tags: vec![PV, SV], from, to, buckets: 9 },
        Query::Values { tags: vec![PV, SV], from, every: Duration::from_secs(10), count: 8 },
        Query::Journal { from, to, limit: 100 },
        Query::Actions { from, to, limit: 100 },
        Query::LineMinutes { line: LineId(0), from, to, limit: 100 },
        Query::AlarmMetrics { from, to },
        Query::Report { period },
    ];
    let mut answers: Vec<Answer> = queries.iter().map(|query| store.answer(query, sec(100)).unwrap()).collect();
    answers.push(Answer::Journal(store.restore().unwrap()));
    answers
}

#[test]
fn a_migrated_history_gives_the_same_report_and_samples() {
    let (_folder, today) = folder();
    open(&today, 0).append(&records()).unwrap();
    let expect = answers(&today);
    for (version, columns) in
        [(6, "step, text, burst_utc, burst_rank"), (7, "event, message, first_out_utc, first_out_rank")]
    {
        let (_folder, db) = folder();
        old_history(&db, version, &old_rows(columns));
        for (answer, expect) in answers(&db).into_iter().zip(&expect) {
            // The audit log of the old history has entries; they are not what is compared.
            let answer = match answer {
                Answer::Report(report) => Answer::Report(Box::new(ShiftReport { audit: None, ..*report })),
                other => other,
            };
            assert_eq!(answer, *expect, "schema version {version}");
        }
    }
}

#[test]
fn a_report_on_an_older_history_says_what_to_do() {
    let newest = sql::MIGRATIONS.len();
    for version in [1, 6, 7] {
        let (_folder, db) = folder();
        old_history(&db, version, "");
        let before = fs::read(&db).unwrap();
        let path = db.display();
        assert_eq!(
            Store::open_read_only(&db, &def()).err().unwrap().to_string(),
            format!(
                "the history {path} was written by an older version of sightglass (schema {version}, this one reads \
                 {newest}): start the station once to upgrade it, `sightglass run PLANT --history {path}`"
            )
        );
        assert!(fs::read(&db).unwrap() == before, "it was changed");
    }
}

#[test]
fn a_history_of_a_newer_version_is_refused_and_kept() {
    let (_folder, db) = folder();
    open(&db, 0).db.execute_batch("INSERT INTO schema_version VALUES (999)").unwrap();
    for refused in [Store::open(&db, &def(), sec(0)).err(), Store::open_read_only(&db, &def()).err()] {
        let words = refused.unwrap().to_string();
        assert!(words.contains("written by a newer version of sightglass (schema 999, this one reads"), "{words}");
    }
    assert!(db.exists());
}

#[test]
fn an_older_history_is_migrated_and_keeps_its_rows() {
    let (_folder, db) = folder();
    let rows = "INSERT INTO tag VALUES (0, 'TIC-1.PV', '°C'); INSERT INTO sample VALUES ('1970-01-01', 0, 27.0, 0)";
    old_history(&db, 1, rows);
    let store = open(&db, 10);
    store.append(&[Record::Line(minute("L1", 60, 60)), Record::Action(action(5))]).unwrap();
    // The value, the end of its curve, the minute, the action.
    assert_eq!(store.count_rows().unwrap(), 4);
}

#[test]
fn migrations_are_numbered_and_run_once() {
    let (_folder, db) = folder();
    for _ in 0..2 {
        let store = open(&db, 0);
        let versions: u32 = store.db.query_row("SELECT count(*) FROM schema_version", [], |row| row.get(0)).unwrap();
        assert_eq!(versions as usize, sql::MIGRATIONS.len());
    }
}
