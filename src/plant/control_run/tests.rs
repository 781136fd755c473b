//! Control runs as they happen: their begin and end, their figures, and what is not known of them.

use proptest::prelude::*;

use super::*;
use crate::plant::{
    PlantDef,
    energy::Measures,
    fixture::{self, PV, RUN, SV, TIC},
    id::TagId,
    sample::{Cause, Sample},
};

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn seconds(seconds: u64) -> Figure {
    Figure::After(Duration::from_secs(seconds))
}

/// The controller of the fixture; RUN of its PLC is taken for power in kW.
struct Rig {
    plant: PlantDef,
    def: RunDef,
    tracker: RunTracker,
    power: Sample,
    records: Vec<ControlRun>,
}

impl Rig {
    fn new() -> Rig {
        let def = RunDef {
            controller: TIC,
            sv: SV,
            sv_used: None,
            pv: PV,
            band: Some(0.5),
            steady_for: STEADY_FOR,
            duration_max: DURATION_MAX,
            energy: Some((RUN, Measures::Power(1.0))),
            batches: vec![0],
            tags: Vec::new(),
        };
        let mut tracker = RunTracker::default();
        assert_eq!(tracker.restore(None), None);
        let power = Sample::bad(Cause::NotRead, at(0));
        Rig { plant: fixture::plant(), def, tracker, power, records: Vec::new() }
    }

    /// SV and PV at a second; `None` has no good value.
    fn step(&mut self, second: i64, sv: Option<f64>, pv: Option<f64>) -> &mut Rig {
        self.step_with(second, sv, pv, &[])
    }

    fn step_with(&mut self, second: i64, sv: Option<f64>, pv: Option<f64>, started: &[(usize, String)]) -> &mut Rig {
        let sample = |value: Option<f64>| match value {
            Some(value) => Sample::good(value, at(second)),
            None => Sample::bad(Cause::DeviceDown, at(second)),
        };
        let (sv, pv, power) = (sample(sv), sample(pv), self.power);
        let of_tag = |tag: TagId| match tag {
            SV => sv,
            PV => pv,
            _ => power,
        };
        let view = View { plant: &self.plant, sample: &of_tag, decimals: &|_| 1, started, at: at(second) };
        self.records.extend(self.tracker.update(&self.def, &view));
        self
    }

    /// A value a second, from one second on.
    fn ramp(&mut self, from: i64, sv: f64, pv: impl IntoIterator<Item = f64>) -> &mut Rig {
        for (second, pv) in (from..).zip(pv) {
            self.step(second, Some(sv), Some(pv));
        }
        self
    }

    /// The same for some seconds.
    fn hold(&mut self, seconds: std::ops::Range<i64>, sv: Option<f64>, pv: Option<f64>) -> &mut Rig {
        for second in seconds {
            self.step(second, sv, pv);
        }
        self
    }

    fn shown(&self) -> ControlRun {
        ControlRun::clone(&self.tracker.shown().expect("a run"))
    }

    /// `1.0 running setpoint`, of every record.
    fn words(&self) -> Vec<String> {
        let word = |run: &ControlRun| {
            format!("{}.{} {} {} {}", run.number, run.place, run.state.word(), run.cause.word(), run.detail)
        };
        self.records.iter().map(|run| word(run).trim_end().to_owned()).collect()
    }
}

/// From 20 at second 10 by 1 a second to 42 at second 32, then 41, then 40 for good.
fn step_to_40(rig: &mut Rig) {
    rig.step(0, Some(20.0), Some(20.0));
    rig.ramp(10, 40.0, (20..=42).map(f64::from));
    rig.ramp(33, 40.0, [41.0]).ramp(34, 40.0, std::iter::repeat_n(40.0, 400));
}

#[test]
fn a_step_of_the_setpoint_has_its_figures() {
    let mut rig = Rig::new();
    step_to_40(&mut rig);
    let run = rig.shown();
    assert_eq!((run.sv_before, run.sv, run.pv, run.seen), (Some(20.0), 40.0, Some(20.0), true));
    assert_eq!((run.from, run.until, run.state), (at(10), at(433), RunState::Running));
    assert_eq!(run.at_sv, seconds(20), "40 at second 30");
    assert_eq!(run.rise, seconds(16), "22 at second 12, 38 at second 28");
    assert_eq!(run.steady, seconds(24), "within 0.5 from second 34 on");
    assert_eq!((run.overshoot, run.offset, run.good), (Some(2.0), Some(0.0), 1.0));
    // 20 + 19 + … + 1, then 0, 1, 2, 1 and 0.
    assert!((run.iae * 60.0 - 214.0).abs() < 1e-9, "{}", run.iae);
    assert_eq!(run.energy, None, "its power was never read");
}

#[test]
fn steady_is_said_after_its_time_and_taken_back() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0)).step(10, Some(40.0), Some(20.0));
    rig.ramp(11, 40.0, std::iter::repeat_n(40.2, 300));
    assert_eq!((rig.shown().steady, rig.shown().at_sv), (Figure::NotYet, seconds(1)), "299 s in the band");
    rig.step(311, Some(40.0), Some(40.0));
    assert_eq!(rig.shown().steady, seconds(1));
    rig.step(312, Some(40.0), Some(41.0));
    assert_eq!(rig.shown().steady, Figure::NotYet);
}

#[test]
fn a_step_down_is_the_same_upside_down() {
    let mut rig = Rig::new();
    rig.step(0, Some(70.0), Some(70.0));
    rig.ramp(10, 50.0, (48..=70).rev().map(f64::from)).ramp(33, 50.0, std::iter::repeat_n(50.0, 20));
    let run = rig.shown();
    assert_eq!((run.at_sv, run.rise, run.overshoot), (seconds(20), seconds(16), Some(2.0)));
}

#[test]
fn what_happens_in_a_gap_is_unknown() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0)).ramp(10, 40.0, (20..25).map(f64::from));
    rig.hold(15..40, Some(40.0), None);
    rig.ramp(40, 40.0, std::iter::repeat_n(40.0, 301));
    let run = rig.shown();
    assert_eq!((run.at_sv, run.rise), (Figure::Unknown, Figure::Unknown));
    assert_eq!(run.steady, Figure::Unknown, "it came to SV in the gap");
    assert!((run.good - 305.0 / 330.0).abs() < 1e-9 && run.is_partial(), "{}", run.good);
    rig.hold(341..360, None, Some(40.0));
    let run = rig.shown();
    assert_eq!((run.steady, run.offset), (Figure::NotYet, None), "SV is not known: it may be another one");
}

/// Seen in a demonstration that was played too fast: "steady from 52:31" was the end of a gap, not a time of the process.
#[test]
fn the_end_of_a_gap_is_not_when_it_became_steady() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0)).step(10, Some(40.0), Some(20.0));
    rig.ramp(11, 40.0, std::iter::repeat_n(40.2, 400));
    assert_eq!(rig.shown().steady, seconds(1));
    rig.hold(411..440, Some(40.0), None);
    rig.ramp(440, 40.0, std::iter::repeat_n(40.2, 301));
    assert_eq!(rig.shown().steady, Figure::Unknown);
    // It leaves, and comes back where it is seen.
    rig.step(741, Some(40.0), Some(41.0)).ramp(742, 40.0, std::iter::repeat_n(40.2, 301));
    assert_eq!(rig.shown().steady, seconds(732));
}

#[test]
fn a_short_gap_leaves_the_times_known() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0)).ramp(10, 40.0, (20..38).map(f64::from));
    rig.hold(28..38, Some(40.0), None);
    rig.step(38, Some(40.0), Some(40.0));
    assert_eq!(rig.shown().at_sv, seconds(28), "known to ten seconds");
    // Of the two values before and after, the error counts only while it was known: 20 + 19 + … + 3.
    assert!((rig.shown().iae * 60.0 - 207.0).abs() < 1e-9, "{}", rig.shown().iae);
}

#[test]
fn a_run_at_sv_counts_from_where_pv_left_it() {
    let mut rig = Rig::new();
    rig.step(0, Some(40.0), Some(40.0)).step_with(10, Some(40.0), Some(40.0), &[(0, "soup-7".into())]);
    let begun = rig.shown();
    assert_eq!((begun.cause, &*begun.detail, begun.at_sv), (RunCause::Batch, "soup-7", seconds(0)));
    rig.ramp(11, 40.0, [39.0, 38.0]);
    assert_eq!(rig.shown().at_sv, Figure::NotYet);
    rig.ramp(13, 40.0, [39.0, 40.0, 41.0]);
    let run = rig.shown();
    assert_eq!((run.at_sv, run.overshoot, run.rise), (seconds(4), Some(1.0), Figure::NotYet));
}

#[test]
fn a_setpoint_on_its_way_is_one_change() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0));
    rig.step(10, Some(30.0), Some(20.0)).step(12, Some(35.0), Some(20.0)).step(14, Some(40.0), Some(20.0));
    rig.hold(15..30, Some(40.0), Some(20.0));
    assert_eq!(rig.words(), ["1.0 running setpoint"]);
    assert_eq!((rig.records[0].sv_before, rig.records[0].from), (Some(20.0), at(14)));
    rig.step(40, Some(50.0), Some(20.0));
    assert_eq!(rig.words()[1..], ["1.1 ended setpoint"]);
    assert_eq!(rig.records[1].until, at(40));
}

#[test]
fn a_setpoint_that_was_not_read_when_it_changed_is_marked() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0));
    rig.hold(1..30, None, None);
    rig.step(30, Some(40.0), Some(25.0));
    let run = rig.shown();
    assert!(!run.seen && run.sv_before == Some(20.0));
    rig.step(41, None, None).step(42, Some(40.0), Some(25.0));
    assert_eq!(rig.words(), ["1.0 running setpoint"], "the same setpoint is no new run");
}

#[test]
fn the_setpoint_in_use_confirms_one_that_was_not_read() {
    let mut rig = Rig::new();
    (rig.def.sv_used, rig.def.energy) = (Some(RUN), None);
    rig.power = Sample::good(40.0, at(0));
    rig.step(0, Some(20.0), Some(20.0)).step(10, Some(40.0), Some(20.0)).hold(11..60, None, Some(30.0));
    assert_eq!((rig.shown().good, rig.shown().offset), (1.0, Some(10.0)));
    rig.power = Sample::good(41.0, at(60));
    rig.hold(60..80, None, Some(30.0));
    assert_eq!((rig.shown().good, rig.shown().offset), (50.0 / 69.0, None), "it is on its way to another one");
}

#[test]
fn a_batch_begins_a_run_once_the_setpoint_is_known() {
    let mut rig = Rig::new();
    rig.step(0, Some(40.0), Some(40.0)).step_with(10, None, Some(40.0), &[(0, "soup-7".into()), (1, "tea-1".into())]);
    rig.hold(11..15, None, Some(40.0)).hold(15..30, Some(40.0), Some(40.0));
    let run = rig.shown();
    assert_eq!((&*run.detail, run.from, run.seen), ("soup-7", at(15), false));
    assert_eq!(rig.words(), ["1.0 running batch soup-7"]);
}

#[test]
fn a_run_that_goes_on_is_stored_now_and_then_and_ends() {
    let mut rig = Rig::new();
    rig.def.duration_max = Duration::from_secs(1_000);
    step_to_40(&mut rig);
    // Once after 10 s; as soon as it may be with the times that came; with steady; then every 5 minutes.
    let stored: Vec<i64> = rig.records.iter().map(|run| run.until.as_second()).collect();
    assert_eq!(stored, [20, 80, 334]);
    rig.ramp(434, 40.0, std::iter::repeat_n(40.0, 700));
    let stored: Vec<(i64, &str)> =
        rig.records[3..].iter().map(|run| (run.until.as_second(), run.state.word())).collect();
    assert_eq!(stored, [(634, "running"), (934, "running"), (1_010, "ended")]);
    let places: Vec<u32> = rig.records.iter().map(|run| run.place).collect();
    assert_eq!(places, [0, 1, 2, 3, 4, 5]);
    assert_eq!(rig.shown().until, at(1_010), "the last run is still shown");
}

#[test]
fn a_killed_station_leaves_an_interrupted_run() {
    let mut rig = Rig::new();
    step_to_40(&mut rig);
    let last = rig.records.last().expect("it was stored").clone();
    let mut next = RunTracker::default();
    let interrupted = next.restore(Some(last.clone())).expect("it was at work");
    assert_eq!((interrupted.state, interrupted.place), (RunState::Interrupted, last.place + 1));
    assert_eq!(next.restore(Some(interrupted)), None, "once is enough");
    rig.tracker = next;
    rig.step(500, Some(40.0), Some(40.0)).step(510, Some(50.0), Some(40.0)).step(520, Some(50.0), Some(41.0));
    assert_eq!(rig.words().last().map(String::as_str), Some("2.0 running setpoint"), "no number is given twice");
    let stopped = rig.tracker.stop(at(521)).expect("it was at work");
    assert_eq!((stopped.number, stopped.state, stopped.until), (2, RunState::Interrupted, at(521)));
}

#[test]
fn energy_is_of_power_or_of_a_counter() {
    let mut rig = Rig::new();
    rig.step(0, Some(20.0), Some(20.0));
    for second in 10..=3_610 {
        rig.power = if second < 1_810 { Sample::good(2.0, at(second)) } else { Sample::bad(Cause::Stale, at(second)) };
        rig.step(second, Some(40.0), Some(20.0));
    }
    let (kwh, good) = rig.shown().energy.expect("power was read");
    assert!((kwh - 1.0).abs() < 1e-9 && (good - 0.5).abs() < 1e-9, "{kwh} kWh in {good}");
    let mut rig = Rig::new();
    rig.def.energy = Some((RUN, Measures::Energy(1e-3)));
    rig.step(0, Some(20.0), Some(20.0));
    for (second, wh) in (10..).zip([500.0, 700.0, 900.0, 50.0, 80.0]) {
        rig.power = Sample::good(wh, at(second));
        rig.step(second, Some(40.0), Some(20.0));
    }
    let (kwh, good) = rig.shown().energy.expect("the counter was read");
    assert!((kwh - 0.48).abs() < 1e-9 && good == 1.0, "400 Wh, then 80 after a reset: {kwh}");
}

proptest! {
    #[test]
    fn no_figure_is_outside_its_run(
        steps in prop::collection::vec((1i64..40, prop::option::weighted(0.9, 0usize..2), prop::option::weighted(0.8, 15f64..75.0)), 1..120),
    ) {
        let mut rig = Rig::new();
        let mut second = 0;
        for (passed, sv, pv) in steps {
            second += passed;
            rig.step(second, sv.map(|place| [20.0, 60.0][place]), pv);
            let Some(run) = rig.tracker.shown() else { continue };
            prop_assert!(run.from <= run.until && run.until <= at(second));
            prop_assert!((0.0..=1.0).contains(&run.good) && 0.0 <= run.iae);
            prop_assert!(run.overshoot.is_none_or(|over| 0.0 <= over));
            for figure in [run.at_sv, run.steady, run.rise] {
                prop_assert!(figure.known().is_none_or(|time| time <= run.lasted()), "{:?}", figure);
            }
            if let (Some(at_sv), Some(steady)) = (run.at_sv.known(), run.steady.known()) {
                prop_assert!(at_sv <= steady, "{:?} {:?}", at_sv, steady);
            }
        }
        // One record a minute at most while it goes on, and one for its end.
        let most = usize::try_from(second).unwrap_or(0) / 10 + 2;
        prop_assert!(rig.records.len() <= 2 * most);
        for pair in rig.records.windows(2) {
            let next = (pair[0].number, pair[0].place + 1);
            prop_assert!((pair[1].number, pair[1].place) == next || (pair[1].number, pair[1].place) == (next.0 + 1, 0));
        }
    }
}

#[test]
fn a_counter_that_steps_back_a_little_or_is_replaced_counts_on() {
    for (readings, expect) in [
        (vec![5_000.0, 5_200.0, 5_199.9, 5_400.0], 400.0),
        (vec![10_000.0, 10_005.0, 904.0, 908.0], 9.0),
        (vec![10_000.0, 10_005.0, 98_000.0, 98_004.0], 9.0),
        (vec![5_000.0, 5_001.0, 0.0, 5_002.0], 2.0),
    ] {
        let mut rig = Rig::new();
        rig.def.energy = Some((RUN, Measures::Energy(1e-3)));
        rig.step(0, Some(20.0), Some(20.0));
        for (second, wh) in (10..).zip(&readings) {
            rig.power = Sample::good(*wh, at(second));
            rig.step(second, Some(40.0), Some(20.0));
        }
        let (kwh, _) = rig.shown().energy.expect("the counter was read");
        assert!((kwh * 1e3 - expect).abs() < 1e-6, "{readings:?}: {kwh} kWh");
    }
}
