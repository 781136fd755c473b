//! Epochs of the clock and minutes of lines.

use super::*;

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
fn a_step_of_the_clock_is_not_counted_as_a_row() {
    let (_folder, db) = folder();
    let mut writer = Writer::open(db, def(), sec(0)).unwrap();
    writer.accept(vec![Record::ClockSet, good(PV, 1, 27.0), Record::ClockSet]);
    writer.commit(sec(1));
    let stored = writer.store().unwrap().count_rows().unwrap();
    assert_eq!((writer.status().rows, writer.status().waiting, stored), (1, 0, 1));
}

#[test]
fn a_clock_set_back_is_reported_and_the_old_curve_ends() {
    let (_folder, db) = folder();
    open(&db, 0).append(&[good(PV, 1000, 27.0)]).unwrap();
    let writer = Writer::open(db, def(), sec(500)).unwrap();
    let trouble = writer.status().trouble.clone().unwrap();
    assert_eq!(trouble, "the clock is behind the last record, 1970-01-01T00:16:41Z: is it right?");
    assert_eq!(means(writer.store().unwrap(), PV, 1000, 1002, 2), [Some(27.0), None]);
}
