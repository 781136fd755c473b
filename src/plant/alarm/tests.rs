//! The manager as a whole: what is annunciated, acknowledged, suppressed, reminded of and restored.

mod anything;
mod edits;
mod steps;
mod suppression;

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use proptest::prelude::*;

use super::{AlarmManager, AlarmRefusal, AlarmState, state::OperatorNote};
use crate::plant::condition::Facts;
use crate::plant::{
    def::{AlarmDef, AlarmId, Condition, Level, PlantDef, Subject},
    fixture::{self, HIGH, PV, SILENT},
    record::{AlarmEvent, AlarmRecord},
};

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn facts(value: f64, answering: bool) -> impl Fn(&AlarmDef) -> Facts {
    move |_| Facts { value: Some(value.into()), ill: Some(!answering), ..Facts::default() }
}

/// What anna says at an instant.
fn note(at: Timestamp, reason: Option<&Arc<str>>) -> OperatorNote {
    OperatorNote { at, by: Some("anna".into()), reason: reason.cloned(), recorded: true }
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
fn an_alarm_has_value_and_limit_and_survives_a_restart() {
    let mut manager = AlarmManager::new(fixture::shared());
    assert!(manager.evaluate(at(0), facts(80.0, true)).is_empty(), "the on-delay runs");
    let events = manager.evaluate(at(2), facts(81.0, true));
    assert_eq!(events.len(), 1);
    assert_eq!((&*events[0].subject, events[0].value, events[0].limit), ("TIC-1.PV", Some(81.0.into()), Some(75.0)));

    let mut again = AlarmManager::new(fixture::shared());
    again.restore(&events);
    assert_eq!(again.lists(), manager.lists());
    let ack = again.acknowledge(HIGH, at(2), &note(at(3), Some(&why()))).expect("it waits for an acknowledgement");
    assert_eq!((ack.by, ack.reason), (Some("anna".into()), Some(why())));
    assert_eq!(again.acknowledge(HIGH, at(2), &note(at(3), None)), Err(AlarmRefusal::NothingToAcknowledge));
    assert_eq!(again.active()[0].state, AlarmState::Acknowledged);
    assert_eq!(again.active()[0].acknowledged.as_ref().and_then(|note| note.by.clone()), Some("anna".into()));
}

#[test]
fn the_list_puts_what_waits_before_what_is_known() {
    let mut manager = AlarmManager::new(fixture::shared());
    manager.evaluate(at(0), facts(80.0, false));
    manager.evaluate(at(2), facts(80.0, false));
    assert_eq!(manager.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [HIGH, SILENT], "latest first");
    manager.acknowledge(HIGH, at(2), &note(at(3), None)).expect("it waits");
    assert_eq!(manager.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [SILENT, HIGH]);
}

#[test]
fn an_alarm_raised_since_the_display_stays_unacknowledged() {
    let def = with(|alarm| alarm.on_delay = Duration::ZERO);
    let mut manager = AlarmManager::new(def);
    manager.evaluate(at(0), facts(80.0, true));
    let seen = manager.active()[0].raised_at;
    manager.evaluate(at(1), facts(70.0, true));
    manager.evaluate(at(2), facts(80.0, true));
    assert_eq!(manager.acknowledge(HIGH, seen, &note(at(3), None)), Err(AlarmRefusal::RaisedSince));
    assert_eq!(state(&manager), AlarmState::Unacknowledged);
    assert!(manager.acknowledge(HIGH, at(2), &note(at(3), None)).is_ok());
}

#[test]
fn all_that_was_seen_is_acknowledged_and_what_came_since_is_not() {
    let def = with(|alarm| alarm.on_delay = Duration::ZERO);
    let mut manager = AlarmManager::new(def);
    let unseen = manager.annunciations();
    manager.evaluate(at(1), facts(80.0, true));
    let seen = manager.annunciations();
    // It may be of the very instant of the snapshot before it.
    assert_eq!((manager.waiting(unseen), manager.waiting(seen)), (vec![], vec![HIGH]));
    assert_eq!(manager.acknowledge_seen(HIGH, unseen, &note(at(1), None)), Err(AlarmRefusal::RaisedSince));
    manager.evaluate(at(2), facts(70.0, true));
    manager.evaluate(at(3), facts(80.0, true));
    assert_eq!(manager.acknowledge_seen(HIGH, seen, &note(at(3), None)), Err(AlarmRefusal::RaisedSince));
    let seen = manager.annunciations();
    manager.evaluate(at(4), facts(70.0, true));
    assert_eq!(manager.annunciations(), seen, "a return is no annunciation");
    assert!(manager.acknowledge_seen(HIGH, seen, &note(at(4), None)).is_ok());
    assert!(manager.waiting(seen).is_empty());
}

#[test]
fn what_latches_and_comes_back_from_the_shelf_was_not_seen() {
    let def = with(|alarm| (alarm.on_delay, alarm.latch) = (Duration::ZERO, true));
    let mut manager = AlarmManager::new(def);
    manager.evaluate(at(0), facts(80.0, true));
    manager.shelve(HIGH, Duration::from_secs(60), &note(at(1), Some(&why()))).expect("it is active");
    manager.evaluate(at(2), facts(70.0, true));
    let seen = manager.annunciations();
    manager.reinstate(HIGH, AlarmEvent::Unshelved, None, &note(at(3), None)).expect("it is shelved");
    assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged);
    assert!(manager.waiting(seen).is_empty());
    assert_eq!(manager.waiting(manager.annunciations()), [HIGH]);
}

#[test]
fn a_note_is_asked_for_where_the_plant_wants_one() {
    let def = with(|alarm| (alarm.on_delay, alarm.ack_comment) = (Duration::ZERO, true));
    let mut manager = AlarmManager::new(def);
    manager.evaluate(at(0), facts(80.0, true));
    for reason in [None, Some("".into()), Some("  ".into())] {
        assert_eq!(manager.acknowledge(HIGH, at(0), &note(at(1), reason.as_ref())), Err(AlarmRefusal::NoteNeeded));
    }
    let long: Arc<str> = "x".repeat(501).into();
    assert_eq!(manager.acknowledge(HIGH, at(0), &note(at(1), Some(&long))), Err(AlarmRefusal::TooLong));
    let longest: Arc<str> = "ü".repeat(500).into();
    assert!(manager.acknowledge(HIGH, at(0), &note(at(1), Some(&longest))).is_ok());
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
    assert_eq!(manager.reset(HIGH, &note(at(0), None)), Err(AlarmRefusal::NothingToReset));
    manager.evaluate(at(0), facts(80.0, true));
    assert_eq!(manager.reset(HIGH, &note(at(1), None)), Err(AlarmRefusal::CauseLasts));
    manager.evaluate(at(2), facts(70.0, true));
    assert_eq!(state(&manager), AlarmState::LatchedUnacknowledged);
    manager.acknowledge(HIGH, at(0), &note(at(3), None)).expect("it waits");
    assert_eq!(state(&manager), AlarmState::LatchedAcknowledged);
    manager.reset(HIGH, &note(at(4), None)).expect("the cause has gone");
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
        assert_eq!(manager.shelve(HIGH, lasts, &note(at(0), Some(&reason.into()))), Err(refusal));
    }
    manager.shelve(HIGH, minute, &note(at(0), Some(&why()))).expect("a minute, with a reason");
    assert_eq!(events(&manager.evaluate(at(10), facts(80.0, true))), [AlarmEvent::RaisedSuppressed]);
    assert!(!manager.lists().sound && manager.active().is_empty());
    let suppressed = manager.lists().suppressed[0].clone();
    assert_eq!((suppressed.until, suppressed.active, suppressed.note.reason), (Some(at(60)), true, Some(why())));
    assert_eq!(events(&manager.evaluate(at(59), facts(80.0, true))), []);
    assert_eq!(events(&manager.evaluate(at(60), facts(80.0, true))), [AlarmEvent::Unshelved, AlarmEvent::Raised]);
    assert_eq!((state(&manager), manager.active()[0].raised_at), (AlarmState::Unacknowledged, at(60)));
    manager.shelve(HIGH, minute, &note(at(70), Some(&why()))).expect("again");
    assert_eq!(events(&manager.evaluate(at(71), facts(70.0, true))), [AlarmEvent::ReturnedSuppressed]);
    assert_eq!(
        events(&manager.reinstate(HIGH, AlarmEvent::Unshelved, None, &note(at(72), None)).expect("it is shelved")),
        [AlarmEvent::Unshelved]
    );
    assert_eq!(state(&manager), AlarmState::Normal);
    assert_eq!(
        manager.reinstate(HIGH, AlarmEvent::Unshelved, None, &note(at(73), None)),
        Err(AlarmRefusal::NotShelved)
    );
}

#[test]
fn a_clock_that_goes_back_lengthens_no_shelf_and_no_delay() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::from_secs(10)));
    manager.evaluate(at(10_000), facts(80.0, true));
    manager.evaluate(at(10_006), facts(80.0, true));
    manager.evaluate(at(100), facts(80.0, true));
    assert_eq!(events(&manager.evaluate(at(104), facts(80.0, true))), [AlarmEvent::Raised], "6 s and 4 s");
    manager.shelve(HIGH, Duration::from_secs(600), &note(at(5_000), Some(&why()))).expect("ten minutes");
    assert_eq!(events(&manager.evaluate(at(200), facts(80.0, true))), [AlarmEvent::Shelved]);
    assert_eq!(manager.lists().suppressed[0].until, Some(at(800)));
    assert_eq!(events(&manager.evaluate(at(800), facts(80.0, true))), [AlarmEvent::Unshelved, AlarmEvent::Raised]);
}

#[test]
fn an_alarm_out_of_service_stays_so_until_it_is_put_back() {
    let mut manager = AlarmManager::new(with(|alarm| alarm.on_delay = Duration::ZERO));
    assert_eq!(manager.out_of_service(HIGH, &note(at(0), Some(&" ".into()))), Err(AlarmRefusal::ReasonNeeded));
    assert_eq!(manager.reinstate(HIGH, AlarmEvent::InService, None, &note(at(0), None)), Err(AlarmRefusal::InService));
    manager.out_of_service(HIGH, &note(at(0), Some(&why()))).expect("with a reason");
    assert_eq!(
        manager.shelve(HIGH, Duration::from_secs(60), &note(at(1), Some(&why()))),
        Err(AlarmRefusal::OutOfService)
    );
    assert_eq!(events(&manager.evaluate(at(100_000), facts(80.0, true))), [AlarmEvent::RaisedSuppressed]);
    assert_eq!(manager.lists().suppressed[0].state, AlarmState::OutOfService);
    let back = manager
        .reinstate(HIGH, AlarmEvent::InService, Some(80.0.into()), &note(at(100_001), None))
        .expect("it is out of service");
    assert_eq!(events(&back), [AlarmEvent::InService, AlarmEvent::Raised]);
    assert_eq!(back[1].value, Some(80.0.into()));
}

#[test]
fn an_acknowledged_alarm_that_lasts_is_reminded_of() {
    let remind = |alarm: &mut AlarmDef| {
        (alarm.on_delay, alarm.re_alarm) = (Duration::ZERO, Some(Duration::from_secs(1_800)));
    };
    let mut manager = AlarmManager::new(with(remind));
    let mut journal = manager.evaluate(at(0), facts(80.0, true));
    journal.push(manager.acknowledge(HIGH, at(0), &note(at(10), None)).expect("it waits"));
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
    let early = manager.acknowledge(HIGH, at(0), &note(at(1_811), None));
    assert_eq!(early, Err(AlarmRefusal::RaisedSince), "a window from before the reminder acknowledges nothing");
    let seen = manager.active()[0].annunciated_at;
    assert!(manager.acknowledge(HIGH, seen, &note(at(1_812), None)).is_ok());
}

/// The fixture whose alarm "high" is enabled while the facts say so.
fn enabled_by_design(change: impl Fn(&mut AlarmDef)) -> Arc<PlantDef> {
    use crate::plant::expr::{Compare, Expr};
    let expr = Expr::test(PV, Compare::Above, 0.0);
    with(|alarm| {
        (alarm.on_delay, alarm.enabled_when) = (Duration::ZERO, Some(expr.clone()));
        change(alarm);
    })
}
