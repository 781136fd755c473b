//! The manager as a whole: what is told, acknowledged, suppressed, reminded of and restored.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use proptest::prelude::*;

use super::{AlarmManager, AlarmRefusal, AlarmState, condition::Facts};
use crate::plant::{
    def::{AlarmDef, AlarmId, Condition, Level, PlantDef, Subject},
    fixture::{self, HIGH, PV, SILENT},
    record::{AlarmEvent, AlarmRecord},
};

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn facts(value: f64, answering: bool) -> impl Fn(&AlarmDef) -> Facts {
    move |_| Facts { value: Some(value), ill: Some(!answering), ..Facts::default() }
}

fn by() -> Arc<str> {
    "anna".into()
}

fn why() -> Arc<str> {
    "sensor is being changed".into()
}

/// The fixture with its alarm "high" changed.
fn with(change: impl Fn(&mut AlarmDef)) -> Arc<PlantDef> {
    let mut def = fixture::plant();
    change(&mut def.alarms[0]);
    Arc::new(def)
}

fn state(manager: &AlarmManager) -> AlarmState {
    manager.machine(HIGH).state()
}

fn events(records: &[AlarmRecord]) -> Vec<AlarmEvent> {
    records.iter().map(|record| record.event).collect()
}

#[test]
fn an_alarm_is_told_with_value_and_limit_and_survives_a_restart() {
    let mut manager = AlarmManager::new(fixture::shared());
    assert!(manager.evaluate(at(0), facts(80.0, true)).is_empty(), "the on-delay runs");
    let events = manager.evaluate(at(2), facts(81.0, true));
    assert_eq!(events.len(), 1);
    assert_eq!((&*events[0].subject, events[0].value, events[0].limit), ("TIC-1.PV", Some(81.0), Some(75.0)));

    let mut again = AlarmManager::new(fixture::shared());
    again.restore(&events);
    assert_eq!(again.lists(), manager.lists());
    let ack = again.acknowledge(HIGH, at(2), Some(&why()), at(3), &by()).expect("it waits for an acknowledgement");
    assert_eq!((ack.by, ack.reason), (Some(by()), Some(why())));
    assert_eq!(again.acknowledge(HIGH, at(2), None, at(3), &by()), Err(AlarmRefusal::NothingToAcknowledge));
    assert_eq!(again.active()[0].state, AlarmState::Acknowledged);
    assert_eq!(again.active()[0].acknowledged.as_ref().and_then(|note| note.by.clone()), Some(by()));
}

#[test]
fn the_list_puts_what_waits_before_what_is_known() {
    let mut manager = AlarmManager::new(fixture::shared());
    manager.evaluate(at(0), facts(80.0, false));
    manager.evaluate(at(2), facts(80.0, false));
    assert_eq!(manager.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [HIGH, SILENT], "latest first");
    manager.acknowledge(HIGH, at(2), None, at(3), &by()).expect("it waits");
    assert_eq!(manager.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [SILENT, HIGH]);
}

#[test]
fn what_was_raised_after_the_operator_looked_stays_unacknowledged() {
    let def = with(|alarm| alarm.on_delay = Duration::ZERO);
    let mut manager = AlarmManager::new(def);
    manager.evaluate(at(0), facts(80.0, true));
    let seen = manager.active()[0].raised_at;
    manager.evaluate(at(1), facts(70.0, true));
    manager.evaluate(at(2), facts(80.0, true));
    assert_eq!(manager.acknowledge(HIGH, seen, None, at(3), &by()), Err(AlarmRefusal::RaisedSince));
    assert_eq!(state(&manager), AlarmState::Unacknowledged);
    assert!(manager.acknowledge(HIGH, at(2), None, at(3), &by()).is_ok());
}

#[test]
fn a_note_is_asked_for_where_the_plant_wants_one() {
    let def = with(|alarm| (alarm.on_delay, alarm.ack_comment) = (Duration::ZERO, true));
    let mut manager = AlarmManager::new(def);
    manager.evaluate(at(0), facts(80.0, true));
    for note in [None, Some("".into()), Some("  ".into())] {
        assert_eq!(manager.acknowledge(HIGH, at(0), note.as_ref(), at(1), &by()), Err(AlarmRefusal::NoteNeeded));
    }
    let long: Arc<str> = "x".repeat(501).into();
    assert_eq!(manager.acknowledge(HIGH, at(0), Some(&long), at(1), &by()), Err(AlarmRefusal::TooLong));
    assert!(manager.acknowledge(HIGH, at(0), Some(&why()), at(1), &by()).is_ok());
}

#[test]
fn silence_ends_what_sounds_and_a_return_never_sounds() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::ZERO));
    assert!(!manager.silence(), "nothing sounds");
    manager.evaluate(at(0), facts(80.0, true));
    assert!(manager.lists().sound);
    assert!(manager.silence());
    assert!(!manager.lists().sound);
    assert_eq!(state(&manager), AlarmState::Unacknowledged, "silence acknowledges nothing");
    manager.evaluate(at(1), facts(80.0, false));
    assert!(manager.lists().sound, "a new alarm sounds");
    manager.silence();
    manager.evaluate(at(2), facts(70.0, true));
    assert!(!manager.lists().sound, "both have returned");
}

#[test]
fn a_reset_does_nothing_while_the_cause_lasts() {
    let mut manager = AlarmManager::new(with(|alarm| (alarm.on_delay, alarm.latch) = (Duration::ZERO, true)));
    assert_eq!(manager.reset(HIGH, at(0), &by()), Err(AlarmRefusal::NothingToReset));
    manager.evaluate(at(0), facts(80.0, true));
    assert_eq!(manager.reset(HIGH, at(1), &by()), Err(AlarmRefusal::CauseLasts));
    manager.evaluate(at(2), facts(70.0, true));
    assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged);
    manager.acknowledge(HIGH, at(0), None, at(3), &by()).expect("it waits");
    assert_eq!(state(&manager), AlarmState::LatchedAcknowledged);
    manager.reset(HIGH, at(4), &by()).expect("the cause has gone");
    assert_eq!(state(&manager), AlarmState::Normal);
}

#[test]
fn a_shelved_alarm_is_judged_quietly_and_comes_back_by_itself() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::ZERO));
    let minute = Duration::from_secs(60);
    let max = manager.def.alarm_rules.shelve_max;
    for (lasts, reason, refusal) in [
        (minute, "", AlarmRefusal::ReasonNeeded),
        (Duration::ZERO, "leak", AlarmRefusal::ShelveTime { max }),
        (max + minute, "leak", AlarmRefusal::ShelveTime { max }),
    ] {
        assert_eq!(manager.shelve(HIGH, lasts, Some(&reason.into()), at(0), &by()), Err(refusal));
    }
    manager.shelve(HIGH, minute, Some(&why()), at(0), &by()).expect("a minute, with a reason");
    assert_eq!(events(&manager.evaluate(at(10), facts(80.0, true))), [AlarmEvent::RaisedSuppressed]);
    assert!(!manager.lists().sound && manager.active().is_empty());
    let suppressed = manager.lists().suppressed[0].clone();
    assert_eq!((suppressed.until, suppressed.active, suppressed.note.reason), (Some(at(60)), true, Some(why())));
    assert_eq!(events(&manager.evaluate(at(59), facts(80.0, true))), []);
    assert_eq!(events(&manager.evaluate(at(60), facts(80.0, true))), [AlarmEvent::Unshelved, AlarmEvent::Raised]);
    assert_eq!((state(&manager), manager.active()[0].raised_at), (AlarmState::Unacknowledged, at(60)));
    manager.shelve(HIGH, minute, Some(&why()), at(70), &by()).expect("again");
    assert_eq!(events(&manager.evaluate(at(71), facts(70.0, true))), [AlarmEvent::ReturnedSuppressed]);
    assert_eq!(events(&manager.unshelve(HIGH, None, at(72), &by()).expect("it is shelved")), [AlarmEvent::Unshelved]);
    assert_eq!(state(&manager), AlarmState::Normal);
    assert_eq!(manager.unshelve(HIGH, None, at(73), &by()), Err(AlarmRefusal::NotShelved));
}

#[test]
fn a_clock_that_goes_back_lengthens_no_shelf_and_no_delay() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::from_secs(10)));
    manager.evaluate(at(10_000), facts(80.0, true));
    manager.evaluate(at(10_006), facts(80.0, true));
    manager.evaluate(at(100), facts(80.0, true));
    assert_eq!(events(&manager.evaluate(at(104), facts(80.0, true))), [AlarmEvent::Raised], "6 s and 4 s");
    manager.shelve(HIGH, Duration::from_secs(600), Some(&why()), at(5_000), &by()).expect("ten minutes");
    assert_eq!(events(&manager.evaluate(at(200), facts(80.0, true))), [AlarmEvent::Shelved]);
    assert_eq!(manager.lists().suppressed[0].until, Some(at(800)));
    assert_eq!(events(&manager.evaluate(at(800), facts(80.0, true))), [AlarmEvent::Unshelved, AlarmEvent::Raised]);
}

#[test]
fn an_alarm_out_of_service_stays_so_until_somebody_puts_it_back() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::ZERO));
    assert_eq!(manager.out_of_service(HIGH, Some(&" ".into()), at(0), &by()), Err(AlarmRefusal::ReasonNeeded));
    assert_eq!(manager.in_service(HIGH, None, at(0), &by()), Err(AlarmRefusal::InService));
    manager.out_of_service(HIGH, Some(&why()), at(0), &by()).expect("with a reason");
    assert_eq!(
        manager.shelve(HIGH, Duration::from_secs(60), Some(&why()), at(1), &by()),
        Err(AlarmRefusal::OutOfService)
    );
    assert_eq!(events(&manager.evaluate(at(100_000), facts(80.0, true))), [AlarmEvent::RaisedSuppressed]);
    assert_eq!(manager.lists().suppressed[0].state, AlarmState::OutOfService);
    let back = manager.in_service(HIGH, Some(80.0), at(100_001), &by()).expect("it is out of service");
    assert_eq!(events(&back), [AlarmEvent::InService, AlarmEvent::Raised]);
    assert_eq!(back[1].value, Some(80.0));
}

/// The fixture whose alarm "high" is enabled while the facts say so.
fn enabled_by_design(change: impl Fn(&mut AlarmDef)) -> Arc<PlantDef> {
    use crate::plant::expr::{Compare, Expr};
    let expr = Expr::Test { tag: PV, compare: Compare::Above, value: 0.0 };
    with(|alarm| {
        (alarm.on_delay, alarm.enabled_when) = (Duration::ZERO, Some(expr.clone()));
        change(alarm);
    })
}

/// A value, and whether it enables the alarm.
fn enabled_with(value: f64, enabled: bool) -> impl Fn(&AlarmDef) -> Facts {
    move |_| Facts { value: Some(value), enabled: Some(enabled), ..Facts::default() }
}

#[test]
fn a_latching_alarm_that_came_and_went_while_suppressed_is_normal_on_release() {
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
    manager.shelve(HIGH, Duration::from_secs(60), Some(&why()), at(1), &by()).expect("a minute, with a reason");
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
            journal.extend(manager.shelve(HIGH, Duration::from_secs(60), Some(&why()), at(2), &by()));
            manager.unshelve(HIGH, None, at(3), &by())
        } else {
            journal.extend(manager.out_of_service(HIGH, Some(&why()), at(2), &by()));
            manager.in_service(HIGH, None, at(3), &by())
        };
        journal.extend(back.expect("it is suppressed"));
        assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged, "shelved: {shelved}");
        let mut again = AlarmManager::new(manager.def.clone());
        again.restore(&journal);
        assert_eq!(again.lists(), manager.lists());
        manager.acknowledge(HIGH, at(0), None, at(4), &by()).expect("it waits");
    }
}

#[test]
fn an_alarm_that_is_not_enabled_tells_nobody_and_an_unknown_enabling_suppresses_nothing() {
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
    let anew = [AlarmEvent::Unsuppressed, AlarmEvent::ReturnedSuppressed];
    assert_eq!(
        events(&delayed.evaluate(at(10), when(80.0, Some(true)))),
        anew,
        "the delay begins when the pump starts"
    );
    assert_eq!(events(&delayed.evaluate(at(14), when(80.0, Some(true)))), []);
    assert_eq!(events(&delayed.evaluate(at(15), when(80.0, Some(true)))), [AlarmEvent::Raised]);
}

#[test]
fn a_restart_or_a_lost_frame_brings_nothing_back_that_is_suppressed_but_a_long_silence_does() {
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
    assert!(free.machine(HIGH).suppressed().is_none(), "the plant file enables it by nothing any more");
}

#[test]
fn what_was_annunciated_stays_until_somebody_has_answered_to_it_though_its_enabling_ends() {
    let when = |enabled| {
        move |_: &AlarmDef| Facts { enabled: Some(enabled), ..facts(80.0, true)(&fixture::plant().alarms[0]) }
    };
    let latch = |alarm: &mut AlarmDef| (alarm.latch, alarm.on_delay) = (true, Duration::ZERO);
    let mut manager = AlarmManager::new(enabled_by_design(latch));
    assert_eq!(events(&manager.evaluate(at(0), when(true))), [AlarmEvent::Raised]);
    assert_eq!(events(&manager.evaluate(at(1), when(false))), [AlarmEvent::ReturnedToNormal]);
    assert_eq!((state(&manager), manager.lists().sound), (AlarmState::LatchedUnacknowledged, false));
    assert_eq!(events(&manager.evaluate(at(2), when(false))), [], "it is neither raised again nor taken away");
    manager.acknowledge(HIGH, at(0), None, at(3), &by()).expect("it waits");
    assert_eq!(events(&manager.evaluate(at(4), when(false))), []);
    assert_eq!(state(&manager), AlarmState::LatchedAcknowledged);
    manager.reset(HIGH, at(5), &by()).expect("its cause is gone");
    assert_eq!(events(&manager.evaluate(at(6), when(false)))[0], AlarmEvent::SuppressedByDesign);
    assert_eq!(state(&manager), AlarmState::SuppressedByDesign);
}

#[test]
fn a_value_that_stood_still_before_the_heating_is_not_stuck() {
    let stuck = Condition::NoChange { lasts: Duration::from_secs(60), deadband: 0.1 };
    let mut manager = AlarmManager::new(enabled_by_design(|alarm| alarm.condition = stuck));
    let when = |enabled| move |_: &AlarmDef| Facts { value: Some(20.0), enabled: Some(enabled), ..Facts::default() };
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
fn an_acknowledged_alarm_that_lasts_is_reminded_of() {
    let remind = |alarm: &mut AlarmDef| {
        (alarm.on_delay, alarm.re_alarm) = (Duration::ZERO, Some(Duration::from_secs(1_800)));
    };
    let mut manager = AlarmManager::new(with(remind));
    let mut journal = manager.evaluate(at(0), facts(80.0, true));
    journal.push(manager.acknowledge(HIGH, at(0), None, at(10), &by()).expect("it waits"));
    manager.silence();
    assert_eq!(events(&manager.evaluate(at(1_809), facts(80.0, true))), []);
    let mut again = AlarmManager::new(with(remind));
    again.restore(&journal);
    assert_eq!(
        events(&again.evaluate(at(1_810), facts(80.0, true))),
        [AlarmEvent::ReAlarmed],
        "a restart forgets no time"
    );
    assert_eq!(events(&manager.evaluate(at(1_810), facts(80.0, true))), [AlarmEvent::ReAlarmed]);
    assert_eq!((state(&manager), manager.lists().sound), (AlarmState::Unacknowledged, true));
    assert_eq!(manager.active()[0].raised_at, at(0), "it is the same activation");
    let early = manager.acknowledge(HIGH, at(0), None, at(1_811), &by());
    assert_eq!(early, Err(AlarmRefusal::RaisedSince), "a window from before the reminder acknowledges nothing");
    let seen = manager.active()[0].annunciated_at;
    assert!(manager.acknowledge(HIGH, seen, None, at(1_812), &by()).is_ok());
}

/// A plant with so many alarms on PV, each with a limit of its own.
fn many(count: u16) -> Arc<PlantDef> {
    let mut def = fixture::plant();
    let alarm = |n: u16| {
        let condition = Condition::Limit { level: Level::High, limit: f64::from(n), deadband: 0.5 };
        AlarmDef::new(AlarmId(n), Subject::Tag(PV), condition, format!("over {n}"))
    };
    def.alarms = (0..count).map(alarm).collect();
    Arc::new(def)
}

#[test]
fn of_a_storm_none_is_lost_and_the_first_out_is_marked() {
    let mut manager = AlarmManager::new(many(10_000));
    let mut raised = Vec::new();
    for second in 0..60 {
        raised.extend(manager.evaluate(at(second), facts(second as f64 * 500.0 / 59.0 + 0.5, true)));
    }
    assert_eq!(raised.len(), 501);
    assert_eq!(manager.active().len(), 501);
    assert!(
        raised.iter().all(|record| record.first_out.is_some_and(|first_out| first_out.began == at(0))),
        "one first_out"
    );
    let ranks: Vec<u32> = raised.iter().filter_map(|record| record.first_out.map(|first_out| first_out.rank)).collect();
    assert_eq!(ranks, (1..=501).collect::<Vec<u32>>());
    let later = manager.evaluate(at(80), facts(501.5, true));
    assert_eq!(later[0].first_out.map(|first_out| (first_out.began, first_out.rank)), Some((at(80), 1)), "another one");
}

/// One thing that happens in the property test.
#[derive(Debug, Clone)]
enum TestEvent {
    Passes(i64),
    Value(Option<f64>),
    Enabled(Option<bool>),
    Acknowledge,
    Silence,
    Reset,
    Shelve(u64),
    Unshelve,
    OutOfService,
    InService,
    Restart,
}

fn test_event() -> impl Strategy<Value = TestEvent> {
    prop_oneof![
        4 => (0i64..40).prop_map(TestEvent::Passes),
        1 => (-5_000i64..5_000).prop_map(TestEvent::Passes),
        5 => proptest::option::weighted(0.9, 70.0..80.0f64).prop_map(TestEvent::Value),
        2 => proptest::option::of(any::<bool>()).prop_map(TestEvent::Enabled),
        3 => Just(TestEvent::Acknowledge),
        1 => Just(TestEvent::Silence),
        2 => Just(TestEvent::Reset),
        2 => (0u64..2_000).prop_map(TestEvent::Shelve),
        1 => Just(TestEvent::Unshelve),
        1 => Just(TestEvent::OutOfService),
        1 => Just(TestEvent::InService),
        2 => Just(TestEvent::Restart),
    ]
}

/// What the journal restores: of each alarm the last event of every kind, in their order.
fn remembered(journal: &[AlarmRecord]) -> Vec<AlarmRecord> {
    let last = |(place, record): &(usize, &AlarmRecord)| {
        let same = |later: &AlarmRecord| later.event == record.event && later.message == record.message;
        !journal[place + 1..].iter().any(same)
    };
    journal.iter().enumerate().filter(last).map(|(_, record)| record.clone()).collect()
}

/// What a restart must bring back: all but the count since the start and what sounds.
fn lasting(manager: &AlarmManager) -> impl PartialEq + std::fmt::Debug {
    let active =
        manager.lists().active.iter().map(|alarm| super::super::snapshot::ActiveAlarm { times: 0, ..alarm.clone() });
    let machine = manager.machine(HIGH);
    let kept = (machine.is_active(), machine.is_latched(), machine.suppressed(), machine.shelved().cloned());
    (active.collect::<Vec<_>>(), manager.lists().suppressed.clone(), kept)
}

proptest! {
    #[test]
    fn whatever_happens_no_alarm_is_lost_or_wrong_and_a_restart_changes_nothing(
        latch in any::<bool>(),
        designed in any::<bool>(),
        delay in 0u64..20,
        test_events in proptest::collection::vec(test_event(), 1..120),
    ) {
        let manner = |alarm: &mut AlarmDef| {
            (alarm.latch, alarm.on_delay) = (latch, Duration::from_secs(delay));
            alarm.re_alarm = Some(Duration::from_secs(900));
        };
        let def = if designed { enabled_by_design(manner) } else { with(manner) };
        let mut manager = AlarmManager::new(def.clone());
        let (mut now, mut value, mut enabled) = (100_000, Some(70.0), Some(true));
        let mut journal: Vec<AlarmRecord> = Vec::new();
        for test_event in test_events {
            let (before, sounded, known) = (manager.machine(HIGH).clone(), manager.lists().sound, journal.len());
            let by = by();
            match test_event.clone() {
                TestEvent::Passes(seconds) => now = (now + seconds).max(0),
                TestEvent::Value(next) => value = next,
                TestEvent::Enabled(next) => enabled = next,
                TestEvent::Acknowledge => {
                    let seen = before.annunciated_at.unwrap_or(at(0));
                    let done = manager.acknowledge(HIGH, seen, None, at(now), &by);
                    prop_assert_eq!(done.is_ok(), before.state().needs_acknowledgement());
                    journal.extend(done);
                }
                TestEvent::Silence => { manager.silence(); }
                TestEvent::Reset => {
                    let done = manager.reset(HIGH, at(now), &by);
                    prop_assert!(done.is_err() || !before.is_active(), "a reset while the cause lasts");
                    journal.extend(done);
                }
                TestEvent::Shelve(seconds) => {
                    journal.extend(manager.shelve(HIGH, Duration::from_secs(seconds), Some(&why()), at(now), &by));
                }
                TestEvent::Unshelve => journal.extend(manager.unshelve(HIGH, value, at(now), &by).into_iter().flatten()),
                TestEvent::OutOfService => journal.extend(manager.out_of_service(HIGH, Some(&why()), at(now), &by)),
                TestEvent::InService => journal.extend(manager.in_service(HIGH, value, at(now), &by).into_iter().flatten()),
                TestEvent::Restart => {
                    let mut again = AlarmManager::new(def.clone());
                    again.restore(&remembered(&journal));
                    prop_assert_eq!(lasting(&again), lasting(&manager));
                    manager = again;
                    continue;
                }
            }
            let told = manager.evaluate(at(now), |alarm| Facts {
                value,
                ill: Some(false),
                enabled: enabled.filter(|_| alarm.enabled_when.is_some()),
                ..Facts::default()
            });
            journal.extend(told);
            let (machine, new) = (manager.machine(HIGH), &journal[known..]);
            let raised = new.iter().any(|event| matches!(event.event, AlarmEvent::Raised | AlarmEvent::ReAlarmed));
            // Who is told is told once, and only where something was raised in the open.
            prop_assert!(!manager.lists().sound || sounded || raised, "it sounds for nothing: {:?}", test_event);
            prop_assert!(!(machine.state().is_suppressed() && manager.lists().sound));
            let shown = manager.active().iter().any(|alarm| alarm.id == HIGH);
            let suppressed = manager.lists().suppressed.iter().any(|alarm| alarm.id == HIGH);
            prop_assert_eq!(machine.state() == AlarmState::Normal, !shown && !suppressed, "what is not normal is listed");
            prop_assert!(!(shown && suppressed));
            // Beyond the limit for longer than its delay it is active; inside the deadband nothing changes, unless its
            // enabling begins or ends.
            let released = new.iter().any(|event| event.event == AlarmEvent::Unsuppressed);
            if enabled != Some(false) && !released && (74.0..=75.0).contains(&value.unwrap_or(74.5)) {
                let turned = new.iter().any(|event| matches!(
                    event.event,
                    AlarmEvent::RaisedSuppressed | AlarmEvent::ReturnedToNormal
                ));
                prop_assert!(!turned || delay > 0, "chatter inside the deadband: {:?}", new);
            }
            if raised && !new.iter().any(|event| event.event == AlarmEvent::ReAlarmed) {
                prop_assert_eq!(machine.state(), AlarmState::Unacknowledged, "nobody has seen it");
            }
            prop_assert!(!latch || !machine.is_latched() || machine.state() != AlarmState::Normal);
            // Shelved for no longer than it was given for.
            if let Some(shelving) = machine.shelved() {
                prop_assert!(at(now) < shelving.until);
                prop_assert!(shelving.until.duration_since(at(now)).as_secs() <= 2_000);
            }
        }
    }
}
