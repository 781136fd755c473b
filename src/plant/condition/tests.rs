//! Conditions over values and over time.

use super::*;

fn sec(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// The verdicts over values at instants, in seconds.
fn over_time(condition: Condition, values: &[(u64, Option<f64>)]) -> Vec<Option<bool>> {
    let (mut memory, mut active) = (ConditionMemory::default(), false);
    let verdict = |(second, value): &(u64, Option<f64>)| {
        let facts = Facts { value: value.map(Exact::from), ..Facts::default() };
        let holds = holds(condition, facts, active, &mut memory, sec(*second));
        active = holds.unwrap_or(active);
        holds
    };
    values.iter().map(verdict).collect()
}

#[test]
fn a_condition_holds_beyond_its_limit_and_clears_by_deadband() {
    let limit = |level, limit| Condition::Limit { level, limit, deadband: 2.0 };
    let deviation = Condition::Deviation { from: TagId(1), limit: 5.0, deadband: 1.0 };
    for (condition, value, active, expect) in [
        (limit(Level::High, 75.0), Some(75.0), false, Some(false)),
        (limit(Level::High, 75.0), Some(75.1), false, Some(true)),
        (limit(Level::HighHigh, 75.0), Some(73.5), true, Some(true)),
        (limit(Level::High, 75.0), Some(73.0), true, Some(false)),
        (limit(Level::Low, 10.0), Some(9.9), false, Some(true)),
        (limit(Level::LowLow, 10.0), Some(11.9), true, Some(true)),
        (limit(Level::Low, 10.0), Some(12.0), true, Some(false)),
        (limit(Level::Low, 10.0), None, true, None),
        (deviation, Some(75.1), false, Some(true)),
        (deviation, Some(64.9), false, Some(true)),
        (deviation, Some(65.5), true, Some(true)),
        (deviation, Some(66.0), true, Some(false)),
        (Condition::State { is: 2.0 }, Some(2.0), false, Some(true)),
        (Condition::State { is: 2.0 }, Some(1.0), true, Some(false)),
        (Condition::Bit { bit: 2 }, Some(4.0), false, Some(true)),
        (Condition::Bit { bit: 2 }, Some(3.0), true, Some(false)),
        (Condition::Bit { bit: 15 }, Some(-32_768.0), false, Some(true)),
        (Condition::Bit { bit: 2 }, None, true, None),
    ] {
        let facts = Facts { value: value.map(Exact::from), reference: Some(70.0.into()), ..Facts::default() };
        let holds = holds(condition, facts, active, &mut ConditionMemory::default(), Duration::ZERO);
        assert_eq!(holds, expect, "{condition:?} at {value:?}, active {active}");
    }
}

#[test]
fn a_deviation_from_an_unknown_set_value_is_unknown() {
    let facts = Facts { value: Some(99.0.into()), ..Facts::default() };
    let deviation = Condition::Deviation { from: TagId(1), limit: 5.0, deadband: 0.0 };
    assert_eq!(holds(deviation, facts, false, &mut ConditionMemory::default(), Duration::ZERO), None);
}

#[test]
fn silence_is_judged_by_the_device_alone() {
    for ill in [Some(true), Some(false), None] {
        let facts = Facts { ill, ..Facts::default() };
        assert_eq!(holds(Condition::NotResponding, facts, false, &mut ConditionMemory::default(), Duration::ZERO), ill);
    }
}

#[test]
fn a_rate_needs_a_full_window_without_a_gap() {
    let rising = Condition::Rate { limit: 6.0, over: sec(30), deadband: 2.0 };
    let (no, yes) = (Some(false), Some(true));
    let events = [(0, 20.0), (15, 21.6), (30, 23.2), (60, 25.4), (90, 27.0)].map(|(at, value)| (at, Some(value)));
    assert_eq!(over_time(rising, &events), [None, None, yes, yes, no], "6.4, 4.4, 3.2 a minute");
    let falling = Condition::Rate { limit: -6.0, over: sec(30), deadband: 2.0 };
    assert_eq!(over_time(falling, &events), [None, None, no, no, no], "it rises");
    let fall = [(0, Some(20.0)), (30, Some(10.0)), (60, None), (120, Some(0.0)), (150, Some(0.0))];
    assert_eq!(over_time(falling, &fall), [None, yes, None, None, no]);
}

#[test]
fn a_value_that_stands_still_is_stuck_and_an_unknown_one_is_not() {
    let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
    let (no, yes) = (Some(false), Some(true));
    let check = |values: &[(u64, Option<f64>)], expect: &[Option<bool>]| {
        assert_eq!(over_time(stuck, values), expect, "{values:?}");
    };
    check(&[(0, Some(20.0)), (30, Some(20.2)), (60, Some(20.1)), (61, Some(20.3))], &[no, no, yes, no]);
    check(&[(0, Some(20.0)), (59, Some(20.3)), (60, Some(20.3))], &[no, no, no]);
    check(&[(0, Some(20.0)), (50, None), (60, Some(20.0)), (110, Some(20.0))], &[no, None, no, yes]);
    check(&[(0, Some(20.0)), (60, Some(20.0)), (70, None), (80, Some(20.0))], &[no, yes, None, yes]);
}

#[test]
fn no_update_is_reported_for_unknown_values_alone() {
    let silent = Condition::NoUpdate { lasts: sec(30) };
    let (no, yes) = (Some(false), Some(true));
    let values = [(0, None), (29, None), (30, None), (31, None), (32, Some(1.0)), (61, None), (63, None)];
    assert_eq!(over_time(silent, &values), [no, no, yes, yes, no, no, yes]);
}

#[test]
fn a_chattering_signal_is_in_alarm_until_it_calms_down() {
    let busy = Condition::Changes { count: 3, within: sec(10), deadband: 0.0 };
    let (no, yes) = (Some(false), Some(true));
    let values = [(0, 0.0), (1, 1.0), (5, 0.0), (8, 1.0), (11, 1.0), (12, 1.0)].map(|(at, value)| (at, Some(value)));
    assert_eq!(over_time(busy, &values), [no, no, no, yes, yes, no]);
}

#[test]
fn a_restored_alarm_clears_only_by_what_was_measured_since() {
    let (no, yes) = (Some(false), Some(true));
    let check = |condition, values: &[(u64, f64, Option<bool>)]| {
        let mut memory = ConditionMemory::default();
        for (second, value, expect) in values {
            let facts = Facts { value: Some((*value).into()), ..Facts::default() };
            assert_eq!(holds(condition, facts, true, &mut memory, sec(*second)), *expect, "at {second} s");
        }
    };
    let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
    check(stuck, &[(0, 20.0, None), (59, 20.1, None), (60, 20.0, yes)]);
    check(stuck, &[(0, 20.0, None), (10, 20.5, no), (11, 20.5, no)]);
    let busy = Condition::Changes { count: 2, within: sec(10), deadband: 0.0 };
    check(busy, &[(0, 0.0, None), (9, 0.0, None), (10, 0.0, no)]);
    check(busy, &[(0, 0.0, None), (1, 1.0, None), (2, 0.0, yes), (12, 0.0, no)]);
}

#[test]
fn what_has_been_is_forgotten_when_an_alarm_is_enabled_again() {
    let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
    let (mut memory, facts) = (ConditionMemory::default(), Facts { value: Some(20.0.into()), ..Facts::default() });
    assert_eq!(holds(stuck, facts, false, &mut memory, sec(0)), Some(false));
    memory.clear();
    assert_eq!(holds(stuck, facts, false, &mut memory, sec(60)), Some(false));
    assert_eq!(holds(stuck, facts, false, &mut memory, sec(120)), Some(true));
}
