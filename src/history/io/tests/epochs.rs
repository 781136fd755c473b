//! Epochs of the clock and minutes of lines.

use super::{
    archive::{HOUR_S, archive_all},
    counts::{self, counted, report},
    *,
};

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

/// What the clock shows at a second of a station that runs on: some steps of it, each at a second, by so much.
fn shown(real: i64, steps: &[(i64, i64)]) -> i64 {
    real + steps.iter().filter(|(at, _)| *at <= real).map(|(_, by)| by).sum::<i64>()
}

/// A station with a counter that counts 1 a minute from 1,000 on, and with an actuator that is on for 10 of 30 minutes.
fn stepped(db: &Path, hours: i64, steps: &[(i64, i64)]) -> Store {
    let store = Store::open(db, &counts::def(), sec(0)).unwrap().store;
    let of_minute = |minute: i64| {
        let at = shown(60 * minute, steps);
        let on = f64::from(u8::from(minute % 30 < 10));
        let records = [good(PV, at, 1_000.0 + minute as f64), good(SV, at, on)];
        let set = steps.iter().any(|(at, _)| *at == 60 * minute).then_some(Record::ClockSet);
        set.into_iter().chain(records)
    };
    store.append(&(0..hours * 60).flat_map(of_minute).collect::<Vec<_>>()).unwrap();
    store
}

#[test]
fn what_a_station_counted_is_the_same_however_its_clock_was_set() {
    let real = 40;
    for steps in [
        vec![],
        vec![(30 * HOUR_S + 600, -5_400)],
        vec![(30 * HOUR_S, -600)],
        vec![(30 * HOUR_S, -1_200), (32 * HOUR_S + 60, -3_600)],
        vec![(30 * HOUR_S, 5_400), (31 * HOUR_S, -5_400)],
        vec![(30 * HOUR_S, -5_400), (31 * HOUR_S, 5_400)],
    ] {
        let (_folder, db) = folder();
        let store = stepped(&db, real, &steps);
        let end = 60 * HOUR_S;
        for archived in [0, 33, 60] {
            archive_all(&store, archived);
            let what = format!("{steps:?}, archived to hour {archived}");
            let whole = report(&store, 10 * HOUR_S, end);
            assert_eq!(counted(&whole, PV), (real - 10) as f64 * 60.0, "{what}");
            assert_eq!(whole.counters, [], "{what}");
            assert_eq!(whole.runs[0].starts, Some((real - 10) as f64 * 2.0), "{what}");
            let on = whole.runs[0].on.unwrap().as_secs() as i64;
            assert!((on - (real - 10) * 1_200).abs() <= 61 * steps.len() as i64, "{what}: on for {on} s");
            for edge in [29 * HOUR_S + 60, 30 * HOUR_S - 1_000, 31 * HOUR_S + 90, 32 * HOUR_S] {
                let parts = [report(&store, 10 * HOUR_S, edge), report(&store, edge, end)];
                let sum: f64 = parts.iter().map(|part| counted(part, PV)).sum();
                assert_eq!(sum, counted(&whole, PV), "{what}, cut at {edge}");
                let starts: f64 = parts.iter().filter_map(|part| part.runs[0].starts).sum();
                assert_eq!(Some(starts), whole.runs[0].starts, "{what}, cut at {edge}");
                let on_parts: u128 = parts.iter().filter_map(|part| part.runs[0].on).map(|on| on.as_millis()).sum();
                assert!(on_parts.abs_diff(whole.runs[0].on.unwrap().as_millis()) <= 3, "{what}, cut at {edge}");
            }
        }
    }
}

#[test]
fn a_trend_over_a_clock_set_back_has_what_both_epochs_stored() {
    let (_folder, db) = folder();
    let store = stepped(&db, 40, &[(30 * HOUR_S, -3_600)]);
    let before = series(&store, PV, 28 * HOUR_S, 34 * HOUR_S, 6);
    archive_all(&store, 60);
    let archived = series(&store, PV, 28 * HOUR_S, 34 * HOUR_S, 6);
    let edges = |series: &Series| -> Vec<_> {
        series.buckets.iter().flatten().map(|of| (of.min, of.max, of.last.near())).collect()
    };
    assert_eq!(
        edges(&before)[..3],
        [(2_680.0, 2_739.0, 2_739.0), (2_740.0, 2_859.0, 2_859.0), (2_860.0, 2_919.0, 2_919.0)]
    );
    assert_eq!(edges(&archived), edges(&before));
    // What holds at an instant that was twice is what was stored last.
    let past = |at: i64| store.past(sec(at), sec(60 * HOUR_S)).unwrap().samples[0].value;
    assert_eq!(past(29 * HOUR_S + 30), Some(2_800.0));
}

#[test]
fn an_alarm_lasts_as_long_as_it_did_whatever_the_clock_showed() {
    use AlarmEvent::{Raised, ReturnedToNormal};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let alarm = |at, event| Record::Alarm(step(at, "high", event));
    let value = |at| good(PV, at, 1.0);
    let first = (0..=120).map(|minute| value(60 * minute)).chain([alarm(4_200, Raised)]);
    store.append(&first.collect::<Vec<_>>()).unwrap();
    // From 7,200 back to 3,600, where it is active for 600 s more.
    let then = (60..=180).map(|minute| value(60 * minute)).chain([alarm(4_200, ReturnedToNormal)]);
    store.append(&[Record::ClockSet].into_iter().chain(then).collect::<Vec<_>>()).unwrap();
    let in_alarm = |from, to| report(&store, from, to).tags[0].in_alarm.as_secs();
    assert_eq!(in_alarm(0, 10_800), 3_000 + 600);
    assert_eq!(in_alarm(0, 5_000) + in_alarm(5_000, 10_800), 3_000 + 600);
    assert_eq!(in_alarm(7_300, 10_800), 0, "it has returned");
}

#[test]
fn a_dead_station_ends_where_it_wrote_last_by_any_clock() {
    let day = 24 * HOUR_S;
    let (_folder, db) = folder();
    let store = open(&db, 400 * day);
    store.append(&[good(PV, 400 * day, 1.0), good(SV, 400 * day, 70.0)]).unwrap();
    let right = (0..10).map(|minute| good(PV, 60 * minute, 2.0)).chain([good(SV, 540, 70.0)]);
    store.append(&[Record::ClockSet].into_iter().chain(right).collect::<Vec<_>>()).unwrap();
    drop(store);
    let read_only = Store::open_read_only(&db, &def()).unwrap();
    assert_eq!(read_only.ended, Some(sec(541)));
    drop(read_only);
    let writer = Writer::open(db.clone(), def(), sec(600)).unwrap();
    assert_eq!(writer.status().trouble, None, "the clock is right");
    drop(writer);
    let opened = Store::open_at_start(&db, &def(), sec(600)).unwrap();
    assert_eq!(opened.read.off, Some(sec(541)));
    let store = opened.store;
    let ends = "SELECT tag::VARCHAR || ' ' || epoch_us(utc) // 1000000 FROM sample WHERE quality = 139 ORDER BY ALL";
    let ends: Vec<String> = store.list(ends, &[], |row| row.get(0)).unwrap();
    assert_eq!(ends, ["0 541", "1 541"]);
    store.append(&[good(PV, 600, 3.0)]).unwrap();
    assert_eq!(means(&store, PV, 520, 620, 5), [Some(2.0), Some(2.0), None, None, Some(3.0)]);
}

#[test]
fn samples_of_one_epoch_come_alone_and_say_what_follows() {
    use crate::history::recorded::{Over, StoredSamples};
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 10, 1.0), good(PV, 70, 2.0), Record::ClockSet, good(PV, 40, 3.0)]).unwrap();
    let stored = |epoch, from, to| -> StoredSamples {
        match store.answer(&Query::Samples { epoch: Some(epoch), from: sec(from), to: sec(to) }, sec(100)).unwrap() {
            Answer::Samples(stored) => stored,
            other => panic!("{other:?}"),
        }
    };
    let values =
        |stored: &StoredSamples| stored.samples.iter().filter_map(|(_, sample)| sample.value).collect::<Vec<_>>();
    let first = stored(0, 0, 100);
    assert_eq!((values(&first), first.over), (vec![1.0, 2.0], Some(Over { ended: sec(70), next: (1, sec(40)) })));
    let then = stored(1, 0, 100);
    assert_eq!((values(&then), then.over), (vec![3.0], None));
}
