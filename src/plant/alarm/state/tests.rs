//! The alarm state machine over time and over every event.

use super::*;
use crate::plant::def::Priority;

const DELAYS: AlarmDelays = AlarmDelays { on_delay: Duration::from_secs(5), off_delay: Duration::from_secs(10) };

fn record(event: AlarmEvent, second: i64) -> AlarmRecord {
    let at = Timestamp::from_second(second).expect("a small number");
    let record = AlarmRecord::new(at, "TIC-1.PV", "temperature high", Priority::High, event);
    AlarmRecord { until: Some(at + Duration::from_secs(60)), ..record }
}

/// The evaluation of an instant, with what follows from it.
fn evaluated(machine: &mut AlarmStateMachine, holds: Option<bool>, second: u64) -> Option<AlarmEvent> {
    let event = machine.evaluate(holds, Duration::from_secs(second), DELAYS)?;
    machine.apply(&record(event, second as i64), false);
    Some(event)
}

#[test]
fn the_life_of_an_alarm() {
    let mut machine = AlarmStateMachine::default();
    for (second, holds, event, state) in [
        (0, Some(true), None, AlarmState::Normal),
        (4, Some(false), None, AlarmState::Normal),
        (5, Some(true), None, AlarmState::Normal),
        (7, None, None, AlarmState::Normal),
        (10, Some(true), Some(AlarmEvent::Raised), AlarmState::Unacknowledged),
        (11, Some(false), None, AlarmState::Unacknowledged),
        (20, Some(false), None, AlarmState::Unacknowledged),
        (21, Some(false), Some(AlarmEvent::ReturnedToNormal), AlarmState::ReturnedToNormal),
    ] {
        assert_eq!(evaluated(&mut machine, holds, second), event, "at {second} s");
        assert_eq!(machine.state(), state, "at {second} s");
    }
    machine.apply(&record(AlarmEvent::Acknowledged, 22), false);
    assert_eq!(machine.state(), AlarmState::Normal);
}

#[test]
fn what_an_operator_does_leads_from_state_to_state() {
    use AlarmEvent as T;
    use AlarmState as S;
    let check = |latch: bool, events: &[(T, S)]| {
        let mut machine = AlarmStateMachine::default();
        for (event, state) in events {
            machine.apply(&record(*event, 0), latch);
            assert_eq!(machine.state(), *state, "{event:?} of {events:?}");
        }
    };
    check(
        false,
        &[(T::Raised, S::Unacknowledged), (T::Acknowledged, S::Acknowledged), (T::ReturnedToNormal, S::Normal)],
    );
    check(
        false,
        &[(T::Raised, S::Unacknowledged), (T::Acknowledged, S::Acknowledged), (T::ReAlarmed, S::Unacknowledged)],
    );
    let latched = [
        (T::Raised, S::Unacknowledged),
        (T::ReturnedToNormal, S::LatchedUnacknowledged),
        (T::Acknowledged, S::LatchedAcknowledged),
        (T::Reset, S::Normal),
    ];
    check(true, &latched);
    check(
        true,
        &[
            (T::Raised, S::Unacknowledged),
            (T::ReturnedToNormal, S::LatchedUnacknowledged),
            (T::Reset, S::ReturnedToNormal),
        ],
    );
    let shelved = [
        (T::Raised, S::Unacknowledged),
        (T::Shelved, S::Shelved),
        (T::ReturnedSuppressed, S::Shelved),
        (T::Unshelved, S::Normal),
    ];
    check(false, &shelved);
    let both = [
        (T::Shelved, S::Shelved),
        (T::OutOfService, S::OutOfService),
        (T::RaisedSuppressed, S::OutOfService),
        (T::InService, S::Shelved),
        (T::Unshelved, S::Acknowledged),
        (T::Raised, S::Unacknowledged),
    ];
    check(false, &both);
    let design = [
        (T::SuppressedByDesign, S::SuppressedByDesign),
        (T::RaisedSuppressed, S::SuppressedByDesign),
        (T::ReturnedSuppressed, S::SuppressedByDesign),
        (T::Unsuppressed, S::Normal),
    ];
    check(false, &design);
    check(true, &design);
    let quiet = [(T::Shelved, S::Shelved), (T::RaisedSuppressed, S::Shelved), (T::ReturnedSuppressed, S::Shelved)];
    check(true, &[&quiet[..], &[(T::Unshelved, S::LatchedUnacknowledged)]].concat());
    check(false, &[&quiet[..], &[(T::Unshelved, S::Normal)]].concat());
    let longer = [(T::Shelved, S::Shelved), (T::Unshelved, S::LatchedUnacknowledged)];
    check(true, &[&quiet[..], &longer].concat());
}

#[test]
fn a_shelving_is_never_longer_than_it_was_given_for() {
    let at = |second| Timestamp::from_second(second).expect("a small number");
    let note = OperatorNote { at: at(1_000), by: None, reason: None, recorded: true };
    let shelving = Shelving { note, until: at(1_600) };
    assert_eq!(shelving.moved(at(1_500)), None);
    assert_eq!(shelving.moved(at(100)), Some(at(700)));
}
