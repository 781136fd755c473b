//! Counters over periods: shifts add up to days, whatever happened to the readings, before and after they are archived, and to
//! what another computes from the same samples.

use proptest::prelude::*;

use super::{
    archive::{HOUR_S, archive_all},
    *,
};
use crate::plant::recorded_action::RecordedAction;
use crate::{
    plant::{
        batch::{BatchDef, BatchEvent, BatchRecord},
        control_run::{ControlRun, Figure, RunCause, RunDef, RunState},
        counter::CounterEvent,
        def::DeviceId,
        energy::Measures,
        exact::Exact,
        expr::{Compare, Expr},
        tag::{DataType, TagDef},
    },
    report::{ShiftReport, TagFigures, counters::CounterRow},
};

const MV: TagId = TagId(2);
const DAY_S: i64 = 24 * HOUR_S;
/// Five minutes in which the counter counts this.
const STEP: f64 = 5.0;

/// PV is a counter in kWh, MV of one whose greatest rate is known; SV is on or off.
pub(super) fn def() -> Arc<PlantDef> {
    let mut def = plant("Asia/Kathmandu", &THREE);
    for (place, max_rate) in [(0, None), (2, Some(60.0))] {
        let tag: &mut TagDef = &mut def.tags[place];
        (tag.point.kind, tag.scale, tag.counter, tag.max_rate) = (DataType::U32, 1.0, Some(true), max_rate);
    }
    (def.tags[1].point.kind, def.tags[1].scale, def.tags[1].hours) = (DataType::Bool, 1.0, true);
    def.report.record = None;
    Arc::new(def)
}

pub(super) fn report(store: &Store, from: i64, to: i64) -> ShiftReport {
    let query = Query::Report { period: Period::free(sec(from), sec(to)) };
    let Answer::Report(report) = store.answer(&query, sec(40 * DAY_S)).unwrap() else { panic!() };
    *report
}

pub(super) fn counted(report: &ShiftReport, tag: TagId) -> f64 {
    let named = |figures: &&TagFigures| figures.tag == def().tag(tag).name;
    report.tags.iter().find(named).and_then(|figures| figures.difference).map_or(0.0, Exact::near)
}

fn events(report: &ShiftReport) -> Vec<(CounterEvent, i64)> {
    let event = |row: &CounterRow| (row.step.event, row.step.at.as_second());
    report.counters.iter().filter(|row| row.tag == "TIC-1.PV").map(event).collect()
}

/// Samples of a day and more: every five minutes on the minute, after a day that only counts.
fn samples(value: impl Fn(i64) -> Option<f64>, to: i64) -> Vec<Record> {
    let at = (0..to).step_by(300);
    at.flat_map(|at| {
        let read = value(at);
        let both = |value| [good(PV, at, value), good(MV, at, value)];
        let on = f64::from(u8::from(at / 4_200 % 2 == 1));
        read.map(both).into_iter().flatten().chain(read.map(|_| good(SV, at, on)))
    })
    .collect()
}

/// Shifts add up to the day before and after it is archived; what the day counted and its events.
fn check(value: impl Fn(i64) -> Option<f64>) -> (f64, Vec<CounterEvent>) {
    let (_folder, db) = folder();
    let store = Store::open(&db, &def(), sec(0)).unwrap().store;
    store.append(&samples(value, 3 * DAY_S)).unwrap();
    // Shifts of local time begin at 15 minutes past an hour of UTC.
    let (day, edges) = (DAY_S + 900, [0, 8 * HOUR_S, 16 * HOUR_S, DAY_S]);
    let mut found = Vec::new();
    for archived in [0, 30, 80] {
        archive_all(&store, archived);
        let whole = report(&store, day, day + DAY_S);
        let shifts: Vec<_> = edges.windows(2).map(|edge| report(&store, day + edge[0], day + edge[1])).collect();
        for tag in [PV, MV] {
            let sum: f64 = shifts.iter().map(|shift| counted(shift, tag)).sum();
            assert_eq!(sum, counted(&whole, tag), "of {} archived to hour {archived}", def().tag(tag).name);
        }
        let starts = |report: &ShiftReport| report.runs[0].starts.unwrap_or(0.0);
        let on = |report: &ShiftReport| report.runs[0].on.map_or(0, |on| on.as_millis());
        assert_eq!(shifts.iter().map(starts).sum::<f64>(), starts(&whole));
        assert!(shifts.iter().map(on).sum::<u128>().abs_diff(on(&whole)) <= 3, "milliseconds, rounded");
        // What one shift has not decided, the next one does.
        let decided = |event: &(CounterEvent, i64)| event.0 != CounterEvent::Held;
        let of_shifts: Vec<_> = shifts.iter().flat_map(events).filter(decided).collect();
        let steps: Vec<_> = events(&whole).into_iter().filter(decided).collect();
        assert_eq!(of_shifts, steps);
        found.push((counted(&whole, PV), counted(&whole, MV), steps));
    }
    assert!(found.windows(2).all(|pair| pair[0] == pair[1]), "archived it is {found:?}");
    (found[0].0, found[0].2.iter().map(|(event, _)| *event).collect())
}

/// What it shows where nothing happens to it.
fn plain(at: i64) -> f64 {
    40_000.0 + STEP * (at / 300) as f64
}

#[test]
fn shifts_add_up_to_the_day_whatever_happens_to_a_counter() {
    let all = STEP * 288.0;
    // At 9 o'clock of the second day.
    let then = DAY_S + 9 * HOUR_S;
    assert_eq!(check(|at| Some(plain(at))), (all, vec![]));
    // Off over the end of the first shift.
    let off = DAY_S + 900 + 7 * HOUR_S..DAY_S + 900 + 9 * HOUR_S;
    assert_eq!(check(|at| (!off.contains(&at)).then(|| plain(at))), (all, vec![]));
    let jitters = |at: i64| plain(at) - f64::from(u8::from(at % 3_000 == 300)) * 6.0;
    assert_eq!(check(|at| Some(jitters(at))), (all, vec![]));
    let zero = |at: i64| if (then..then + 900).contains(&at) { 0.0 } else { plain(at) };
    assert_eq!(check(|at| Some(zero(at))), (all, vec![CounterEvent::FalseReading]));
    let lower = |at: i64| if then <= at { plain(at) - plain(then) + 30_000.0 } else { plain(at) };
    assert_eq!(check(|at| Some(lower(at))), (all - STEP, vec![CounterEvent::Replaced]));
    let higher = |at: i64| if then <= at { plain(at) + 50_000.0 } else { plain(at) };
    assert_eq!(check(|at| Some(higher(at))), (all - STEP, vec![CounterEvent::Replaced]));
    let reset = |at: i64| if then <= at { plain(at) - plain(then) } else { plain(at) };
    assert_eq!(check(|at| Some(reset(at))), (all - STEP, vec![CounterEvent::Reset]));
    let rolls = |at: i64| (4_294_967_296.0 - plain(then) + 2.0 + plain(at)) % 4_294_967_296.0;
    assert_eq!(check(|at| Some(rolls(at))), (all, vec![CounterEvent::Rollover]));
}

/// What happens to a reading.
#[derive(Debug, Clone, Copy)]
enum Fate {
    Read,
    Missing,
    Zero,
    Jitter,
    Replaced,
}

/// PV in kWh, of which batches and control runs have their energy.
pub(super) fn making() -> Arc<PlantDef> {
    let mut def = PlantDef::clone(&def());
    def.tags[0].unit = "kWh".into();
    def.batches = vec![BatchDef {
        name: "soup".into(),
        start: Expr::test(SV, Compare::Equal, 1.0),
        end: Expr::test(SV, Compare::Equal, 0.0),
        phase: None,
        energy: Some(PV),
        tags: vec![PV],
    }];
    def.runs = vec![RunDef {
        controller: DeviceId(0),
        sv: SV,
        sv_used: None,
        pv: PV,
        band: None,
        steady_for: Duration::from_secs(60),
        duration_max: Duration::from_secs(36_000),
        energy: Some((PV, Measures::Energy(1.0))),
        batches: Vec::new(),
        tags: Vec::new(),
    }];
    Arc::new(def)
}

pub(super) fn run(from: i64, until: i64, kwh: f64) -> ControlRun {
    ControlRun {
        controller: "TIC-1".into(),
        number: 1,
        place: 0,
        state: RunState::Interrupted,
        cause: RunCause::Setpoint,
        detail: "".into(),
        seen: true,
        from: sec(from),
        until: sec(until),
        sv_before: None,
        sv: 60.0,
        pv: None,
        unit: "°C".into(),
        decimals: 1,
        band: 1.0,
        settings: "".into(),
        settings_changed: false,
        at_sv: Figure::NotYet,
        steady: Figure::NotYet,
        rise: Figure::NotYet,
        overshoot: None,
        offset: None,
        iae: 0.0,
        energy: Some((kwh, 1.0)),
        good: 1.0,
    }
}

#[test]
fn batches_and_runs_over_a_change_of_shift_count_in_parts() {
    let (_folder, db) = folder();
    let store = Store::open(&db, &making(), sec(0)).unwrap().store;
    let (begin, change, end) = (DAY_S + 3_000, DAY_S + 7_200, DAY_S + 18_000);
    let batch = |at: i64, place, event| {
        Record::Batch(BatchRecord { at: sec(at), batch: "soup".into(), number: 1, place, event, phase: None })
    };
    let mut records = samples(|at| Some(plain(at)), 2 * DAY_S);
    records.extend([batch(begin, 0, BatchEvent::Started), batch(end, 1, BatchEvent::Ended)]);
    let kwh = STEP * ((end - begin) / 300) as f64;
    // As stations do: stored while it is at work, and at its end.
    let at_work = ControlRun { state: RunState::Running, ..run(begin, begin + 300, STEP) };
    let ended = ControlRun { place: 1, ..run(begin, end, kwh) };
    records.extend([at_work, ended].map(|run| Record::Run(Box::new(run))));
    store.append(&records).unwrap();
    let [day, first, second] =
        [(DAY_S, 2 * DAY_S), (DAY_S, change), (change, 2 * DAY_S)].map(|(from, to)| report(&store, from, to));
    let energy = |report: &ShiftReport| {
        let batch = &report.batches[0];
        let part = batch.part.as_deref().unwrap_or(batch);
        (part.energy.unwrap().0, part.batch.lasted.as_secs())
    };
    assert_eq!(energy(&day), (kwh, 15_000));
    assert_eq!((energy(&first).1, energy(&second).1), (4_200, 10_800));
    assert_eq!(energy(&first).0 + energy(&second).0, kwh);
    assert!(day.batches[0].part.is_none() && second.batches[0].energy.unwrap().0 == kwh, "the whole stands beside it");
    let (of_first, of_second) = (&first.control_runs[0], &second.run_parts[0]);
    assert_eq!(of_first.energy.unwrap().0 + of_second.energy.unwrap().0, kwh);
    assert_eq!(
        (of_first.state, of_first.lasted() + of_second.lasted),
        (RunState::Running, Duration::from_secs(15_000))
    );
    assert!(day.run_parts.is_empty());
    // As it is printed: the part is marked, and a run that was interrupted says so.
    let text = crate::report::render(
        crate::report::format("csv").unwrap(),
        &second,
        &making(),
        &crate::report::Style::of(&making()),
    );
    let text = String::from_utf8(text.unwrap()).unwrap();
    assert!(text.contains("ended, part") && text.contains("interrupted, part"), "{text}");
}

#[test]
fn a_correction_counts_in_the_period_in_which_it_is_entered() {
    let (_folder, db) = folder();
    let store = Store::open(&db, &def(), sec(0)).unwrap().store;
    let correction = |at, new: &str, outcome: &str| {
        let action = ActionRecord::new(sec(at), "anna", RecordedAction::CorrectCounter, "TIC-1.PV", outcome);
        Record::Action(ActionRecord { new: Some(new.into()), note: Some("new meter".into()), ..action })
    };
    let mut records = samples(|at| Some(plain(at)), 2 * DAY_S);
    records.push(correction(DAY_S + 100, "12.25 °C", "done"));
    records.push(correction(DAY_S + 200, "-2 °C", "verified"));
    records.push(correction(DAY_S + 300, "99 °C", "refused: this needs a supervisor"));
    store.append(&records).unwrap();
    let [before, with] = [report(&store, 3_600, DAY_S), report(&store, DAY_S, 2 * DAY_S - 300)];
    assert_eq!(counted(&before, PV), STEP * 276.0);
    assert_eq!(counted(&with, PV), STEP * 287.0 + 10.25);
    let rows: Vec<_> =
        with.counters.iter().map(|row| (row.step.event, row.step.counted.near(), row.note.as_str())).collect();
    assert_eq!(
        rows,
        [(CounterEvent::Corrected, 12.25, "anna: new meter"), (CounterEvent::Corrected, -2.0, "anna: new meter")]
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3, ..ProptestConfig::default() })]
    #[test]
    fn any_history_of_a_counter_adds_up(fates in proptest::collection::vec(prop_oneof![
        60 => Just(Fate::Read),
        3 => Just(Fate::Missing),
        2 => Just(Fate::Zero),
        3 => Just(Fate::Jitter),
        1 => Just(Fate::Replaced),
    ], 288)) {
        // What it shows in all, and what is added by the meters put in; a step to another meter is not counted.
        let (mut shown, mut values, mut not_counted) = (plain(0), Vec::new(), 0.0);
        let mut settled = 0;
        for step in 0..3 * 288 {
            let fate = fates.get((step as usize).wrapping_sub(288)).copied().unwrap_or(Fate::Read);
            // Two readings tell what the one before was.
            let fate = if settled < 3 { Fate::Read } else { fate };
            settled = if matches!(fate, Fate::Read) { settled + 1 } else { 0 };
            shown += STEP;
            values.push(match fate {
                Fate::Read => Some(shown),
                Fate::Missing => None,
                Fate::Zero => Some(0.0),
                Fate::Jitter => Some(shown - STEP - 1.0),
                Fate::Replaced => {
                    shown = 900_000.0 - shown / 2.0;
                    not_counted += STEP;
                    Some(shown)
                }
            });
        }
        // The last readings before and after the day are plain.
        let (of_day, _) = check(|at| values[(at / 300) as usize]);
        prop_assert!((of_day + not_counted - STEP * 288.0).abs() <= 3.0 * STEP, "{} and {}", of_day, not_counted);
    }
}
