//! Batches and control runs over a clock that was set back: energy, duration and the parts of periods are those of the plant's
//! own time, before and after the archive.

use super::{
    archive::{HOUR_S, archive_all},
    counts::{making, report, run},
    *,
};
use crate::{
    history::tiers::Tier,
    plant::{
        batch::{BatchEvent, BatchRecord},
        control_run::{ControlRun, RunState},
        history_def::HistoryDef,
    },
    report::ShiftReport,
};

/// The minute since which the clock shows an hour less: 29:00 to 30:00 come twice.
const SET: i64 = 30 * 60;
/// Seconds between samples.
const EVERY: i64 = 30;

/// What the clock shows at a minute of the plant.
fn shown(minute: i64) -> i64 {
    60 * if minute < SET { minute } else { minute - 60 }
}

/// A station from 27 to 33 o'clock whose counter counts 1 a minute, with a batch and a control run between two of its minutes.
fn station(db: &Path, begin: i64, end: i64) -> Store {
    let store = Store::open(db, &making(), sec(0)).unwrap().store;
    let batch = |minute: i64, place, event| {
        let (at, batch) = (sec(shown(minute)), "soup".into());
        Record::Batch(BatchRecord { at, batch, number: 1, place, event, phase: None })
    };
    let run = |minute: i64, place| {
        let (until, lasts) = (shown(minute), 60 * (minute - begin));
        let state = if minute < end { RunState::Running } else { RunState::Interrupted };
        let energy = Some(((minute - begin) as f64, 1.0));
        Record::Run(Box::new(ControlRun { state, place, energy, ..run(until - lasts, until, 0.0) }))
    };
    let mut records = Vec::new();
    for minute in 27 * 60..33 * 60 {
        records.extend((minute == SET).then_some(Record::ClockSet));
        let samples = (0..60).step_by(EVERY as usize).map(|second| shown(minute) + second);
        records.extend(samples.flat_map(|at| [good(PV, at, minute as f64), good(SV, at, 1.0)]));
        records.extend((minute == begin).then(|| batch(minute, 0, BatchEvent::Started)));
        records.extend((minute == end).then(|| batch(minute, 1, BatchEvent::Ended)));
        let is_stored = minute == end || (begin..end).contains(&minute) && (minute - begin) % 5 == 0;
        records.extend(is_stored.then(|| run(minute, (minute - begin) as u32)));
    }
    store.append(&records).unwrap();
    store
}

/// Energy in kWh and seconds of the batch, and of the run, as far as they lie in the period of a report.
fn within(report: &ShiftReport) -> [(f64, i64); 2] {
    let none = (0.0, 0);
    let batch = report.batches.first().map(|batch| batch.part.as_deref().unwrap_or(batch));
    let batch = batch.map_or(none, |of| (of.energy.map_or(0.0, |of| of.0), of.batch.lasted.as_secs() as i64));
    let part = report.run_parts.first().map(|part| (part.energy, part.lasted));
    let run = part.or_else(|| report.control_runs.first().map(|run| (run.energy, run.lasted())));
    [batch, run.map_or(none, |(energy, lasted)| (energy.map_or(0.0, |of| of.0), lasted.as_secs() as i64))]
}

#[test]
fn batches_and_runs_are_right_where_the_clock_was_set_back() {
    let near = |one: i64, other: i64| (one - other).abs() <= EVERY;
    for (begin, end) in [(-40, 15), (-90, 30), (20, 90)] {
        let (_folder, db) = folder();
        let store = station(&db, SET + begin, SET + end);
        let (kwh, lasts) = ((end - begin) as f64, 60 * (end - begin));
        for archived in [0, 60] {
            archive_all(&store, archived);
            let what = format!("{begin} to {end} min, archived to hour {archived}");
            let all = report(&store, 27 * HOUR_S, 40 * HOUR_S);
            for (energy, lasted) in within(&all) {
                assert!(energy == kwh && near(lasted, lasts), "{what}: {energy} kWh in {lasted} s");
            }
            assert!(all.batches[0].part.is_none() && all.run_parts.is_empty(), "{what}: it is whole");
            // Within the doubled time.
            let edge = HOUR_S * 29 + if archived == 0 { 600 } else { 3_000 };
            let parts = [(27 * HOUR_S, edge), (edge, 40 * HOUR_S)].map(|(from, to)| within(&report(&store, from, to)));
            for (name, of) in [("batch", 0), ("run", 1)] {
                let (energy, lasted) = (parts[0][of].0 + parts[1][of].0, parts[0][of].1 + parts[1][of].1);
                assert!(energy == kwh && near(lasted, lasts), "{what}, {name} cut at {edge}: {parts:?}");
            }
        }
    }
}

#[test]
fn a_batch_that_changes_after_the_last_sample_is_of_its_epoch() {
    let (_folder, db) = folder();
    let store = Store::open(&db, &making(), sec(0)).unwrap().store;
    let batch = |at: Timestamp, place, event| {
        Record::Batch(BatchRecord { at, batch: "soup".into(), number: 1, place, event, phase: None })
    };
    let samples = |from: i64, to: i64| (from..=to).step_by(10).map(|at| good(PV, at, 1.0));
    // Samples are stored by the millisecond: it begins 0.9 ms after the last one, then the clock is set back by an hour.
    let begin = Timestamp::from_microsecond(7_200_000_900).unwrap();
    let mut records: Vec<Record> = samples(6_000, 7_200).collect();
    records.extend([batch(begin, 0, BatchEvent::Started), Record::ClockSet]);
    records.extend(samples(3_600, 3_700));
    records.push(batch(sec(3_630), 1, BatchEvent::Ended));
    store.append(&records).unwrap();
    let all = report(&store, 0, 10_000);
    assert_eq!(all.batches[0].batch.lasted.as_secs(), 30, "{:?}", all.batches[0].batch);
}

#[test]
fn a_doubled_hour_is_counted_where_its_samples_are_deleted() {
    let rule = HistoryDef { keep_samples_days: Some(7), ..HistoryDef::default() };
    let def = Arc::new(PlantDef { history: rule, ..PlantDef::clone(&making()) });
    for (begin, end) in [(-40, 15), (-90, 30), (20, 90)] {
        let (_folder, db) = folder();
        drop(station(&db, SET + begin, SET + end));
        let store = Store::open(&db, &def, sec(0)).unwrap().store;
        archive_all(&store, 60);
        let before = report(&store, 27 * HOUR_S, 40 * HOUR_S);
        archive_all(&store, 20 * 24);
        assert_eq!(store.deleted_until(Tier::Raw).unwrap(), Some(sec(48 * HOUR_S)));
        let after = report(&store, 27 * HOUR_S, 40 * HOUR_S);
        // The whole is as it was; nothing is taken for what a counter did.
        assert_eq!((&after.tags, &after.counters), (&before.tags, &before.counters), "{begin} to {end}");
        let [(kwh, lasted), run] = within(&after);
        let [(all_kwh, all_lasted), all_of_run] = within(&before);
        assert_eq!((lasted, run), (all_lasted, all_of_run));
        // What lies in that time cannot be separated: the batch has what is known of it, never more, and says so.
        let share = after.batches[0].energy.map_or(0.0, |(_, share)| share);
        assert!(kwh <= all_kwh && share < 0.5, "{begin} to {end}: {kwh} of {all_kwh} kWh, known {share}");
    }
}
