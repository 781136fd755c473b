//! Storms, and any sequence of events with restarts.

use super::*;
use crate::plant::{
    def::LineId,
    fixture::{PLC, TIC},
};

/// A plant with this many alarms on PV, each with a limit of its own.
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
    // A group ends ten seconds after its first, however long the storm.
    let groups = raised.chunk_by(|one, next| one.first_out.map(|of| of.began) == next.first_out.map(|of| of.began));
    let groups: Vec<&[AlarmRecord]> = groups.collect();
    assert_eq!(groups.len(), 6);
    for (group, began) in groups.iter().zip([0, 11, 22, 33, 44, 55].map(at)) {
        let ranks: Vec<_> = group.iter().filter_map(|record| record.first_out).map(|of| (of.began, of.rank)).collect();
        assert_eq!(ranks, (1..).map(|rank| (began, rank)).take(group.len()).collect::<Vec<_>>());
        assert!(group.iter().all(|record| record.at <= began + Duration::from_secs(10)));
    }
    let later = manager.evaluate(at(80), facts(501.5, true));
    assert_eq!(later[0].first_out.map(|first_out| (first_out.began, first_out.rank)), Some((at(80), 1)), "another one");
}

#[test]
fn what_is_of_another_line_is_no_consequence() {
    let mut def = fixture::plant();
    let mut other = def.lines[0].clone();
    other.id = LineId(1);
    def.lines.push(other);
    def.devices[PLC.index()].line = LineId(1);
    for (number, device) in [TIC, PLC].into_iter().enumerate() {
        let id = AlarmId(number as u16);
        def.alarms[number] = AlarmDef::new(id, Subject::Device(device), Condition::NotResponding, "silent");
    }
    def.alarms.truncate(2);
    let mut manager = AlarmManager::new(Arc::new(def));
    let mut raised = Vec::new();
    for second in 0..60 {
        raised.extend(manager.evaluate(at(second), facts(1.0, false)));
    }
    let [one, two] = &raised[..] else { panic!("{raised:?}") };
    let ranks = [one, two].map(|record| record.first_out.map(|of| of.rank));
    assert_eq!(ranks, [Some(1), Some(1)]);
    assert_ne!(one.first_out.map(|of| of.began), two.first_out.map(|of| of.began), "the instant identifies a group");
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
        manager.lists().active.iter().map(|alarm| crate::plant::alarm::ActiveAlarm { times: 0, ..alarm.clone() });
    let machine = manager.machine(HIGH);
    let kept = (machine.active, machine.latched, machine.suppressed, machine.shelved.clone());
    (active.collect::<Vec<_>>(), manager.lists().suppressed.clone(), kept)
}

proptest! {
    #[test]
    fn no_alarm_is_lost_and_a_restart_changes_nothing(
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
            match test_event.clone() {
                TestEvent::Passes(seconds) => now = (now + seconds).max(0),
                TestEvent::Value(next) => value = next,
                TestEvent::Enabled(next) => enabled = next,
                TestEvent::Acknowledge => {
                    let seen = before.annunciated_at.unwrap_or(at(0));
                    let done = manager.acknowledge(HIGH, seen, &note(at(now), None));
                    prop_assert_eq!(done.is_ok(), before.state().needs_acknowledgement());
                    journal.extend(done);
                }
                TestEvent::Silence => { manager.silence(); }
                TestEvent::Reset => {
                    let done = manager.reset(HIGH, &note(at(now), None));
                    prop_assert!(done.is_err() || !before.active, "a reset while the cause lasts");
                    journal.extend(done);
                }
                TestEvent::Shelve(seconds) => {
                    journal.extend(manager.shelve(HIGH, Duration::from_secs(seconds), &note(at(now), Some(&why()))));
                }
                TestEvent::Unshelve => journal.extend(manager.reinstate(HIGH, AlarmEvent::Unshelved, value.map(Into::into), &note(at(now), None)).into_iter().flatten()),
                TestEvent::OutOfService => journal.extend(manager.out_of_service(HIGH, &note(at(now), Some(&why())))),
                TestEvent::InService => journal.extend(manager.reinstate(HIGH, AlarmEvent::InService, value.map(Into::into), &note(at(now), None)).into_iter().flatten()),
                TestEvent::Restart => {
                    let mut again = AlarmManager::new(def.clone());
                    again.restore(&remembered(&journal));
                    prop_assert_eq!(lasting(&again), lasting(&manager));
                    manager = again;
                    continue;
                }
            }
            let found = manager.evaluate(at(now), |alarm| Facts {
                value: value.map(Into::into),
                ill: Some(false),
                enabled: enabled.filter(|_| alarm.enabled_when.is_some()),
                ..Facts::default()
            });
            journal.extend(found);
            let (machine, new) = (manager.machine(HIGH), &journal[known..]);
            let raised = new.iter().any(|event| matches!(event.event, AlarmEvent::Raised | AlarmEvent::ReAlarmed));
            // An alarm is annunciated once, and only if it was raised unsuppressed.
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
                prop_assert_eq!(machine.state(), AlarmState::Unacknowledged, "not acknowledged yet");
            }
            prop_assert!(!latch || !machine.latched || machine.state() != AlarmState::Normal);
            // Shelved for no longer than it was given for.
            if let Some(shelving) = machine.shelved.as_ref() {
                prop_assert!(at(now) < shelving.until);
                prop_assert!(shelving.until.duration_since(at(now)).as_secs() <= 2_000);
            }
        }
    }
}
