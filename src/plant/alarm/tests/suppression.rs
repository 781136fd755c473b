//! Suppression by design, shelving and out of service together.

use super::*;

/// A value, and whether it enables the alarm.
fn enabled_with(value: f64, enabled: bool) -> impl Fn(&AlarmDef) -> Facts {
    move |_| Facts { value: Some(value.into()), enabled: Some(enabled), ..Facts::default() }
}

#[test]
fn a_latch_of_suppressed_time_is_normal_on_release() {
    let mut manager = AlarmManager::new(enabled_by_design(|alarm| alarm.latch = true));
    let mut journal = manager.evaluate(at(0), enabled_with(80.0, false));
    journal.extend(manager.evaluate(at(1), enabled_with(70.0, false)));
    assert_eq!(
        events(&journal),
        [AlarmEvent::SuppressedByDesign, AlarmEvent::RaisedSuppressed, AlarmEvent::ReturnedSuppressed]
    );
    assert_eq!(events(&manager.evaluate(at(2), enabled_with(70.0, true))), [AlarmEvent::Unsuppressed]);
    assert_eq!((state(&manager), manager.active().len()), (AlarmState::Normal, 0));
    assert_eq!(events(&manager.evaluate(at(3), enabled_with(80.0, true))), [AlarmEvent::Raised]);
    manager.evaluate(at(4), enabled_with(70.0, true));
    assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged, "it still latches");
}

#[test]
fn a_latching_alarm_released_while_shelved_comes_back_latched() {
    let mut manager = AlarmManager::new(enabled_by_design(|alarm| alarm.latch = true));
    manager.evaluate(at(0), enabled_with(80.0, false));
    manager.shelve(HIGH, Duration::from_secs(60), &note(at(1), Some(&why()))).expect("a minute, with a reason");
    let quietly = [AlarmEvent::Unsuppressed, AlarmEvent::RaisedSuppressed];
    assert_eq!(events(&manager.evaluate(at(2), enabled_with(80.0, true))), quietly);
    assert_eq!(events(&manager.evaluate(at(3), enabled_with(70.0, true))), [AlarmEvent::ReturnedSuppressed]);
    assert_eq!(events(&manager.evaluate(at(61), enabled_with(70.0, true))), [AlarmEvent::Unshelved]);
    assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged);
}

#[test]
fn an_on_delay_begins_when_the_suppression_ends() {
    let delay = Duration::from_secs(30);
    let mut manager = AlarmManager::new(enabled_by_design(move |alarm| alarm.on_delay = delay));
    assert_eq!(events(&manager.evaluate(at(0), enabled_with(70.0, false))), [AlarmEvent::SuppressedByDesign]);
    assert_eq!(events(&manager.evaluate(at(1), enabled_with(80.0, false))), []);
    assert_eq!(events(&manager.evaluate(at(25), enabled_with(80.0, true))), [AlarmEvent::Unsuppressed]);
    assert_eq!(events(&manager.evaluate(at(54), enabled_with(80.0, true))), [], "enabled for 29 s");
    assert_eq!(events(&manager.evaluate(at(55), enabled_with(80.0, true))), [AlarmEvent::Raised]);
}

#[test]
fn the_on_delay_of_a_rate_begins_when_the_suppression_ends() {
    let rate = Condition::Rate { limit: 6.0, over: Duration::from_secs(10), deadband: 0.0 };
    let delay = Duration::from_secs(30);
    let mut manager =
        AlarmManager::new(enabled_by_design(move |alarm| (alarm.condition, alarm.on_delay) = (rate, delay)));
    let mut raised = Vec::new();
    for second in 0..100 {
        // The delay has run for 9 s when the alarm is suppressed.
        let enabled = !(20..40).contains(&second);
        let records = manager.evaluate(at(second), enabled_with(second as f64, enabled));
        raised.extend(records.iter().filter(|record| record.event == AlarmEvent::Raised).map(|_| second));
    }
    assert_eq!(raised, [80], "40 s, 10 s of window, 30 s of delay");
}

#[test]
fn shelving_and_out_of_service_acknowledge_no_latched_alarm() {
    for shelved in [true, false] {
        let mut manager = AlarmManager::new(with(|alarm| (alarm.on_delay, alarm.latch) = (Duration::ZERO, true)));
        let mut journal = manager.evaluate(at(0), facts(80.0, true));
        journal.extend(manager.evaluate(at(1), facts(70.0, true)));
        assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged);
        let back = if shelved {
            journal.extend(manager.shelve(HIGH, Duration::from_secs(60), &note(at(2), Some(&why()))));
            manager.reinstate(HIGH, AlarmEvent::Unshelved, None, &note(at(3), None))
        } else {
            journal.extend(manager.out_of_service(HIGH, &note(at(2), Some(&why()))));
            manager.reinstate(HIGH, AlarmEvent::InService, None, &note(at(3), None))
        };
        journal.extend(back.expect("it is suppressed"));
        assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged, "shelved: {shelved}");
        let mut again = AlarmManager::new(manager.def.clone());
        again.restore(&journal);
        assert_eq!(again.lists(), manager.lists());
        manager.acknowledge(HIGH, at(0), &note(at(4), None)).expect("it waits");
    }
}

#[test]
fn only_a_known_false_condition_disables_an_alarm() {
    let when =
        |value: f64, enabled| move |_: &AlarmDef| Facts { enabled, ..facts(value, true)(&fixture::plant().alarms[0]) };
    let mut manager = AlarmManager::new(enabled_by_design(|_| ()));
    let quiet = [AlarmEvent::SuppressedByDesign, AlarmEvent::RaisedSuppressed];
    assert_eq!(events(&manager.evaluate(at(0), when(80.0, Some(false)))), quiet);
    assert_eq!((state(&manager), manager.lists().sound), (AlarmState::SuppressedByDesign, false));
    assert_eq!(
        events(&manager.evaluate(at(1), when(80.0, Some(true)))),
        [AlarmEvent::Unsuppressed, AlarmEvent::Raised]
    );
    let mut unknown = AlarmManager::new(enabled_by_design(|_| ()));
    assert_eq!(events(&unknown.evaluate(at(0), when(80.0, None))), [AlarmEvent::Raised]);
    let mut delayed = AlarmManager::new(enabled_by_design(|alarm| alarm.on_delay = Duration::from_secs(5)));
    delayed.evaluate(at(0), when(80.0, Some(false)));
    assert_eq!(events(&delayed.evaluate(at(5), when(80.0, Some(false)))), [AlarmEvent::RaisedSuppressed]);
    let unsuppressed = [AlarmEvent::Unsuppressed, AlarmEvent::ReturnedSuppressed];
    assert_eq!(
        events(&delayed.evaluate(at(10), when(80.0, Some(true)))),
        unsuppressed,
        "the delay begins when the pump starts"
    );
    assert_eq!(events(&delayed.evaluate(at(14), when(80.0, Some(true)))), []);
    assert_eq!(events(&delayed.evaluate(at(15), when(80.0, Some(true)))), [AlarmEvent::Raised]);
}

#[test]
fn only_a_long_unknown_condition_ends_suppression() {
    let when =
        |value: f64, enabled| move |_: &AlarmDef| Facts { enabled, ..facts(value, true)(&fixture::plant().alarms[0]) };
    let mut manager = AlarmManager::new(enabled_by_design(|_| ()));
    let journal = manager.evaluate(at(0), when(80.0, Some(false)));
    assert_eq!(events(&manager.evaluate(at(1), when(80.0, None))), [], "a lost frame");
    assert_eq!(events(&manager.evaluate(at(2), when(80.0, Some(false)))), []);
    let mut again = AlarmManager::new(enabled_by_design(|_| ()));
    again.restore(&journal);
    for (second, enabled, expect) in [
        (1_000, None, vec![]),
        (1_059, None, vec![]),
        (1_059, Some(false), vec![]),
        (1_060, None, vec![]),
        (1_119, None, vec![]),
        (1_120, None, vec![AlarmEvent::Unsuppressed, AlarmEvent::Raised]),
        (1_121, None, vec![]),
    ] {
        assert_eq!(events(&again.evaluate(at(second), when(80.0, enabled))), expect, "at {second} s");
    }
    let mut free = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::ZERO));
    free.restore(&journal);
    assert_eq!(events(&free.evaluate(at(1), facts(70.0, true)))[0], AlarmEvent::ReturnedSuppressed);
    assert!(free.machine(HIGH).suppressed.is_none(), "the plant file enables it by nothing any more");
}

#[test]
fn an_annunciated_alarm_stays_until_acknowledged() {
    let when = |enabled| {
        move |_: &AlarmDef| Facts { enabled: Some(enabled), ..facts(80.0, true)(&fixture::plant().alarms[0]) }
    };
    let latch = |alarm: &mut AlarmDef| (alarm.latch, alarm.on_delay) = (true, Duration::ZERO);
    let mut manager = AlarmManager::new(enabled_by_design(latch));
    assert_eq!(events(&manager.evaluate(at(0), when(true))), [AlarmEvent::Raised]);
    assert_eq!(events(&manager.evaluate(at(1), when(false))), [AlarmEvent::ReturnedToNormal]);
    assert_eq!((state(&manager), manager.lists().sound), (AlarmState::LatchedUnacknowledged, false));
    assert_eq!(events(&manager.evaluate(at(2), when(false))), [], "it is neither raised again nor taken away");
    manager.acknowledge(HIGH, at(0), &note(at(3), None)).expect("it waits");
    assert_eq!(events(&manager.evaluate(at(4), when(false))), []);
    assert_eq!(state(&manager), AlarmState::LatchedAcknowledged);
    manager.reset(HIGH, &note(at(5), None)).expect("its cause is gone");
    assert_eq!(events(&manager.evaluate(at(6), when(false)))[0], AlarmEvent::SuppressedByDesign);
    assert_eq!(state(&manager), AlarmState::SuppressedByDesign);
}

#[test]
fn a_value_that_stood_still_before_the_heating_is_not_stuck() {
    let stuck = Condition::NoChange { lasts: Duration::from_secs(60), deadband: 0.1 };
    let mut manager = AlarmManager::new(enabled_by_design(|alarm| alarm.condition = stuck));
    let when =
        |enabled| move |_: &AlarmDef| Facts { value: Some(20.0.into()), enabled: Some(enabled), ..Facts::default() };
    for (second, enabled, expect) in [
        (0, false, vec![AlarmEvent::SuppressedByDesign]),
        (600, false, vec![]),
        (601, true, vec![AlarmEvent::Unsuppressed]),
        (660, true, vec![]),
        (661, true, vec![AlarmEvent::Raised]),
        (662, false, vec![AlarmEvent::ReturnedToNormal]),
    ] {
        assert_eq!(events(&manager.evaluate(at(second), when(enabled))), expect, "at {second} s");
    }
}

#[test]
fn what_is_disabled_returns_without_its_off_delay() {
    let def = enabled_by_design(|alarm| alarm.off_delay = Duration::from_secs(30));
    let mut manager = AlarmManager::new(def.clone());
    assert_eq!(events(&manager.evaluate(at(0), enabled_with(80.0, true))), [AlarmEvent::Raised]);
    assert_eq!(events(&manager.evaluate(at(1), enabled_with(80.0, false))), [AlarmEvent::ReturnedToNormal]);
    let mut shelved = AlarmManager::new(def);
    shelved.evaluate(at(0), enabled_with(80.0, true));
    shelved.shelve(HIGH, Duration::from_secs(60), &note(at(1), Some(&why()))).expect("a minute, with a reason");
    let by_design = shelved.evaluate(at(2), enabled_with(80.0, false));
    assert_eq!(events(&by_design), [AlarmEvent::SuppressedByDesign], "on the shelf nothing returns");
}

#[test]
fn a_value_is_stuck_from_when_nothing_disabled_it() {
    use AlarmEvent::{Raised, ReturnedToNormal, SuppressedByDesign, Unsuppressed};
    let stuck = Condition::NoChange { lasts: Duration::from_secs(60), deadband: 0.1 };
    let when = |enabled| move |_: &AlarmDef| Facts { value: Some(20.0.into()), enabled, ..Facts::default() };
    let suppressed_then_unknown = [
        (0, Some(false), vec![SuppressedByDesign]),
        (10, None, vec![]),
        (69, None, vec![]),
        (70, Some(true), vec![Unsuppressed]),
        (129, Some(true), vec![]),
        (130, Some(true), vec![Raised]),
    ];
    let unknown_then_disabled_unacknowledged = [
        (0, None, vec![]),
        (60, None, vec![Raised]),
        (61, Some(false), vec![ReturnedToNormal]),
        (62, Some(true), vec![]),
        (121, Some(true), vec![]),
        (122, Some(true), vec![Raised]),
    ];
    for steps in [suppressed_then_unknown, unknown_then_disabled_unacknowledged] {
        let mut manager = AlarmManager::new(enabled_by_design(|alarm| alarm.condition = stuck));
        for (second, enabled, expect) in steps {
            assert_eq!(events(&manager.evaluate(at(second), when(enabled))), expect, "at {second} s");
        }
    }
}
