//! The test against its vectors, against the letter of the theorem and against played lines; and what an engineer reads.

use proptest::prelude::*;

use super::*;
use crate::{
    bus::plan::{UnreadableRanges, blocks},
    plant::fixture::{self, PLC},
};

/// `52/250 107/500`: cost/period.
fn tasks(text: &str) -> Vec<Task> {
    let task = |word: &str| {
        let (cost, period) = word.split_once('/').expect("cost/period");
        Task { cost: cost.parse().expect("a number"), period: period.parse().expect("a number") }
    };
    text.split_whitespace().map(task).collect()
}

#[test]
fn every_row_of_the_vectors_has_the_verdict_that_it_names() {
    let mut rows = csv::Reader::from_reader(include_str!("../../../tests/vectors/schedule.csv").as_bytes());
    let mut count = 0;
    for row in rows.records() {
        let row = row.expect("a row");
        let tasks = tasks(&row[1]);
        let (schedulability, overload) = match test(&tasks) {
            Test::Accept => ("accept", String::new()),
            Test::TooMuch => ("reject", String::new()),
            Test::OverloadInterval { length, demand, .. } => ("reject", format!("L={length} demand {demand}")),
        };
        let found = (format!("{:.3}", utilisation(&tasks)), schedulability, overload.as_str());
        assert_eq!(found, (row[2].to_owned(), &row[3], &row[4]), "{}", &row[0]);
        count += 1;
    }
    assert_eq!(count, 10);
}

/// The theorem to the letter: every L of every i.
fn by_the_letter(tasks: &[Task]) -> bool {
    let mut sorted = tasks.to_vec();
    sorted.sort_by_key(|task| task.period);
    let holds = |i: usize, length: u64| {
        let demand: u64 = sorted[..i].iter().map(|task| (length - 1) / task.period * task.cost).sum();
        length >= sorted[i].cost + demand
    };
    utilisation(tasks) <= 1.0 + 1e-9
        && (1..sorted.len()).all(|i| (sorted[0].period + 1..sorted[i].period).all(|length| holds(i, length)))
}

proptest! {
    #[test]
    fn only_the_steps_of_the_demand_need_be_looked_at(
        raw in proptest::collection::vec((1u64..40, 5u64..300), 1..7),
    ) {
        let tasks: Vec<Task> = raw.iter().map(|(cost, period)| Task { cost: *cost, period: *period }).collect();
        match test(&tasks) {
            Test::Accept => prop_assert!(by_the_letter(&tasks)),
            Test::TooMuch => prop_assert!(utilisation(&tasks) > 1.0),
            Test::OverloadInterval { length, demand, blocker } => {
                prop_assert!(!by_the_letter(&tasks));
                prop_assert!(length < demand && length < tasks[blocker].period);
                let others: u64 = tasks.iter().map(|task| (length - 1) / task.period * task.cost).sum();
                prop_assert_eq!(demand, others + tasks[blocker].cost);
            }
        }
    }
}

#[test]
fn a_plant_that_fits_has_its_cycle_and_its_dead_units() {
    let def = fixture::plant();
    let admission = admit(&def, LineId(0), &blocks(&def, LineId(0), &UnreadableRanges::default()));
    assert_eq!((&admission.schedulability, admission.factor), (&Schedulability::Fits, Some(1.0)));
    // Four blocks, one a second each: cycle and utilisation are the same number.
    assert!((admission.cycle.as_secs_f64() - admission.utilisation).abs() < 1e-9);
    assert_eq!(admission.warnings, [Warning::NoParityOneStopBit]);
    let dead = admission.dead.iter().find(|dead| dead.device == PLC).expect("it is polled");
    let probe_ms = dead.probe.as_secs_f64() * 1e3;
    assert!((probe_ms - 311.98).abs() < 0.1, "8 characters, 300 ms, 3.5 characters: {probe_ms}");
}

#[test]
fn a_long_poll_in_the_way_of_a_fast_one_is_named() {
    let mut def = fixture::plant();
    def.devices.iter_mut().for_each(|device| device.response_time = Some(Duration::from_millis(1)));
    def.tags[fixture::RUN.index()].poll = Poll::Every(Duration::from_millis(30));
    def.tags[fixture::PV.index()].poll = Poll::Every(Duration::from_millis(200));
    let admission = admit(&def, LineId(0), &blocks(&def, LineId(0), &UnreadableRanges::default()));
    let words = admission.schedulability.to_string();
    for part in ["in 30.1 ms the line must transfer", "PLC-1 coil 3072 every 30 ms", "is read", "its period"] {
        assert!(words.contains(part), "no {part:?} in {words:?}");
    }
}

#[test]
fn an_overload_says_how_far_process_values_are_stretched() {
    let mut def = fixture::plant();
    for tag in &mut def.tags {
        tag.poll = Poll::Every(Duration::from_millis(60));
    }
    def.lines[0].timeout = Duration::from_millis(20);
    let admission = admit(&def, LineId(0), &blocks(&def, LineId(0), &UnreadableRanges::default()));
    assert!(
        matches!(admission.schedulability, Schedulability::TooMuch { utilisation } if utilisation > 1.0),
        "{admission:?}"
    );
    assert!(admission.critical.fits(), "no tag of the fixture is critical");
    assert!(admission.factor.is_some_and(|factor| factor > 1.0));
    let timeout = |warning: &Warning| matches!(warning, Warning::TimeoutBelowAnswer { .. });
    assert!(admission.warnings.iter().any(timeout), "an answer of 8 words takes 21 characters, 21.9 ms");
}

#[test]
fn more_units_than_the_line_carries_are_counted() {
    let mut def = fixture::plant();
    let blocks = blocks(&def, LineId(0), &UnreadableRanges::default());
    let warned = |def: &PlantDef| {
        let warnings = admit(def, LineId(0), &blocks).warnings;
        warnings.into_iter().map(|warning| warning.to_string()).find(|words| words.contains("units"))
    };
    for unit in 3..=31 {
        def.devices.push(DeviceDef { unit, ..DeviceDef::new(DeviceId(u16::from(unit) - 1), "D", LineId(0)) });
    }
    assert_eq!(warned(&def), None, "31 units and the master are 32 loads");
    def.devices[1].units_max = Some(16);
    assert!(warned(&def).is_some_and(|words| words.contains("31 units on the line: PLC-1 permits 16")));
    def.devices[1].units_max = Some(64);
    def.devices.push(DeviceDef { unit: 32, ..DeviceDef::new(DeviceId(31), "D", LineId(0)) });
    assert!(warned(&def).is_some_and(|words| words.contains("32 units and the master")));
    def.devices.iter_mut().for_each(|device| device.units_max = Some(64));
    assert_eq!(warned(&def), None, "all of them are a fraction of a load");
    def.devices.iter_mut().for_each(|device| device.units_max = None);
    def.lines[0].transport = Transport::tcp("plc", 502);
    assert_eq!(warned(&def), None);
}
