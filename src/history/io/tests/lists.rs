//! Lists and reports: order, span, search and bounds.

use super::*;
use crate::plant::report::{PeriodKind, ReportEvent, ReportRecord};

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

#[test]
fn a_shift_report_has_figures_alarms_and_actions() {
    use AlarmEvent::{Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let samples = (0..12).map(|i| good(PV, i * 10, 20.0 + i as f64)).chain([good(SV, 0, 70.0)]);
    let alarms =
        [step(5, "high", Raised), step(30, "high", ReturnedToNormal), step(50, "low", Raised)].map(Record::Alarm);
    store.append(&samples.chain(alarms).chain([Record::Action(action(25))]).collect::<Vec<_>>()).unwrap();
    let period = Period::free(sec(20), sec(200));
    let query = Query::Report { period: period.clone() };
    let Answer::Report(report) = store.answer(&query, sec(100)).unwrap() else { panic!("not a report") };
    assert_eq!((report.period, report.until), (period, sec(100)));
    let [pv, sv, mv] = report.tags.as_slice() else { panic!("three tags") };
    assert_eq!((pv.tag.as_str(), pv.unit.as_str(), pv.decimals), ("TIC-1.PV", "°C", 1));
    assert_eq!(
        (pv.min, pv.mean, pv.max, pv.last, pv.good),
        (Some(22.0.into()), Some(25.5.into()), Some(29.0.into()), Some(29.0.into()), 1.0)
    );
    // 20–30 s from before the period, and 50 s to the end.
    assert_eq!(pv.in_alarm.as_secs(), 60);
    assert_eq!((sv.mean, sv.good), (Some(70.0.into()), 1.0));
    assert_eq!((mv.mean, mv.good), (None, 0.0));
    assert_eq!(report.alarms, [step(30, "high", ReturnedToNormal), step(50, "low", Raised)]);
    assert_eq!(report.actions, [action(25)]);
    assert_eq!(report.record_of, Some(("TIC-1".into(), "°C".into())));
    assert_eq!(report.record.len(), 8);
    assert_eq!((report.record[0].at, report.record[0].er), (sec(20), Some(48.0.into())));
    let future = Query::Report { period: Period::free(sec(300), sec(400)) };
    assert_eq!(store.answer(&future, sec(100)), Err(HistoryError::EmptyPeriod));
}

#[test]
fn the_record_has_the_setpoint_that_is_in_use() {
    let (_folder, db) = folder();
    let mut def = crate::report::testing::plant("Asia/Bangkok", &THREE);
    // A program has moved it away from what the operator has set.
    const USED: TagId = TagId(2);
    def.devices[0].faceplate.as_mut().unwrap().sv_used = Some(USED);
    let store = Store::open(&db, &Arc::new(def), sec(0)).unwrap().store;
    store.append(&[good(PV, 0, 40.0), good(SV, 0, 70.0), good(USED, 0, 45.0)]).unwrap();
    let query = Query::Report { period: Period::free(sec(10), sec(60)) };
    let Answer::Report(report) = store.answer(&query, sec(50)).unwrap() else { panic!("not a report") };
    assert_eq!(report.record.first().map(|row| (row.sv, row.er)), Some((Some(45.0.into()), Some(5.0.into()))));
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
        let period = Period::free(sec(from), sec(to));
        store.report(&period, sec(1_000)).unwrap().audit.map(|entry| (entry.number, entry.hash[0]))
    };
    assert_eq!(audit(20, 100), Some((5, 5)));
    assert_eq!(audit(20, 40), Some((2, 2)));
    assert_eq!(audit(70, 101), Some((6, 6)));
    assert_eq!(audit(0, 10), None, "nothing was in the log then");
}

#[test]
fn a_century_is_answered_and_millions_of_rows_are_refused() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 0, 27.0), good(PV, 100_000, 28.0)]).unwrap();
    let century = 3_000_000_000;
    assert_eq!(series(&store, PV, -century, century, 3).buckets.len(), 3);
    let period = Period::free(sec(0), sec(century));
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
fn a_query_of_too_many_rows_is_refused_before_reading() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 1, 27.0), good(PV, 2, 28.0), good(PV, 3, 28.0)]).unwrap();
    // As if the three rows lay evenly over their two seconds and the three tags: one second of all is half of them.
    let now = sec(3);
    assert_eq!(store.bounded(3, sec(1), sec(2), now, 2), Ok(()));
    assert_eq!(store.bounded(1, sec(0), sec(4), now, 2), Ok(()));
    assert_eq!(
        store.bounded(3, sec(0), sec(4), now, 2),
        Err(HistoryError::TooManyRows { rows: 3, max: 2, asked: Some(2) })
    );
    // A connection that has not seen the rows come refuses as well.
    let reader = open(&folder().1, 0).try_clone().unwrap();
    assert_eq!(reader.bounded(3, sec(0), sec(4), now, 0), Ok(()), "nothing is stored there");
}

#[test]
fn an_action_stored_before_its_chain_hash_is_kept_once() {
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

#[test]
fn rows_behind_aggregates_do_not_count_for_the_bound() {
    let (_folder, db) = folder();
    let store = archive::filled(&db, &archive::rows(50));
    archive::archive_all(&store, 50);
    store.db.execute("UPDATE archive SET rows = 1000000000 WHERE tier = 'raw'", []).unwrap();
    let hours = |hours: i64| sec(hours * 3_600);
    let curve = |to, buckets| {
        store.answer(&Query::Series { tags: vec![PV], from: hours(0), to: hours(to), buckets }, hours(50)).map(drop)
    };
    assert_eq!(curve(48, 24), Ok(()), "of hours");
    let period = Period::free(hours(0), hours(48));
    let report = store.answer(&Query::Report { period }, hours(50));
    assert!(matches!(report, Err(HistoryError::TooManyRows { .. })), "its record is of samples");
    let refused = curve(20, 4_000).unwrap_err();
    assert!(matches!(refused, HistoryError::TooManyRows { asked: Some(71_000..=72_000), .. }), "{refused}");
    assert!(refused.to_string().contains("choose a period of at most"), "{refused}");
}

#[test]
fn a_short_list_of_reports_has_the_newest_with_their_state() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let made = |day: i64| ReportRecord {
        at: sec(day * 86_400),
        period: PeriodKind::Day,
        name: format!("day {day}").into(),
        from: sec((day - 1) * 86_400),
        to: sec(day * 86_400),
        format: "csv".into(),
        file: format!("/srv/{day}.csv").into(),
        sha256: "0".into(),
        event: ReportEvent::Made,
        attempts: 0,
        error: None,
    };
    let delivered = made(3).then(sec(3 * 86_400 + 60), ReportEvent::Delivered);
    let records = [made(1), made(2), made(3), delivered.clone()].map(Record::Report);
    store.append(&records).unwrap();
    for (limit, expect) in [(2, vec![delivered.clone(), made(2)]), (10_000, vec![delivered.clone(), made(2), made(1)])]
    {
        let Ok(Answer::Reports(found)) = store.answer(&Query::Reports { limit }, sec(400_000)) else {
            panic!("no list of {limit}")
        };
        assert_eq!(found.reports, expect);
    }
}

#[test]
fn an_action_of_a_full_disk_stands_once_in_the_history() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let chained = |at, number| ActionRecord { chain_hash: Some(ChainHash { number, hash: [7; 32] }), ..action(at) };
    let records = |actions: &[ActionRecord]| -> Vec<Record> { actions.iter().cloned().map(Record::Action).collect() };
    // Both disks were full: what was sent without its chain hash and with it waits together, also over a step of the clock.
    store.append(&records(&[action(1), action(2), chained(1, 1), action(3)])).unwrap();
    let clock_set = [records(&[action(4)]), vec![Record::ClockSet], records(&[chained(4, 4), chained(2, 2)])];
    store.append(&clock_set.concat()).unwrap();
    // One that was stored before.
    store.append(&records(&[chained(3, 3)])).unwrap();
    let sql = "SELECT string_agg(coalesce(number::VARCHAR, 'none'), ' ' ORDER BY utc) FROM operator_action";
    assert_eq!(store.db.query_row(sql, [], |row| row.get::<_, String>(0)).unwrap(), "1 2 3 4");
}

/// The alarms as a second found them.
fn leg(store: &Store, second: i64) -> crate::report::figures::EventLeg {
    store.event_legs(sec(second), sec(second + 1)).unwrap().remove(0)
}

/// An earlier version stored no end where a plant file took an alarm away.
#[test]
fn an_alarm_that_its_plant_has_no_more_is_not_active_for_ever() {
    let (_folder, db) = folder();
    let mut def = plant("Asia/Bangkok", &THREE);
    let condition = crate::plant::def::Condition::State { is: 1.0 };
    let subject = crate::plant::def::Subject::Tag(PV);
    def.alarms = vec![crate::plant::def::AlarmDef::new(crate::plant::def::AlarmId(0), subject, condition, "there")];
    let def = Arc::new(def);
    let store = Store::open(&db, &def, sec(0)).unwrap().store;
    let events = [step(10, "there", AlarmEvent::Raised), step(10, "gone", AlarmEvent::Raised)];
    store.append(&events.map(Record::Alarm)).unwrap();
    let messages = |found: Vec<AlarmRecord>| found.iter().map(|event| event.message.to_string()).collect::<Vec<_>>();
    assert_eq!(messages(leg(&store, 1_000).active), ["there"]);
    assert_eq!(messages(store.standing_at(sec(1_000)).unwrap()), ["there"]);
    // What has a later event was in the plant until then.
    store.append(&[Record::Alarm(step(2_000, "gone", AlarmEvent::Removed))]).unwrap();
    let mut both = messages(leg(&store, 1_000).active);
    both.sort();
    assert_eq!(both, ["gone", "there"]);
    assert_eq!(messages(leg(&store, 3_000).active), ["there"]);
    store.append(&[Record::Alarm(step(3_100, "there too", AlarmEvent::CarriedOver))]).unwrap();
    store.append(&[Record::Alarm(step(9_000, "there too", AlarmEvent::Removed))]).unwrap();
    assert_eq!(messages(store.standing_at(sec(4_000)).unwrap()), ["there", "there too"]);
}

#[test]
fn each_reason_for_a_suppression_ends_for_itself() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let events = [
        (10, AlarmEvent::Shelved),
        (20, AlarmEvent::SuppressedByDesign),
        (30, AlarmEvent::Unshelved),
        (40, AlarmEvent::OutOfService),
        (50, AlarmEvent::Unsuppressed),
        (60, AlarmEvent::Removed),
    ];
    store.append(&events.map(|(at, event)| Record::Alarm(step(at, "high", event)))).unwrap();
    let at =
        |second: i64| -> Vec<AlarmEvent> { leg(&store, second).suppressing.iter().map(|event| event.event).collect() };
    use AlarmEvent::{OutOfService, Shelved, SuppressedByDesign};
    assert_eq!(at(5), []);
    assert_eq!(at(25), [Shelved, SuppressedByDesign]);
    assert_eq!(at(35), [SuppressedByDesign]);
    assert_eq!(at(45), [SuppressedByDesign, OutOfService]);
    assert_eq!(at(55), [OutOfService]);
    assert_eq!(at(65), []);
}
