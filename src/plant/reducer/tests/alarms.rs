//! Commands on alarms.

use super::*;
use crate::plant::{
    alarm::{AlarmCommand, AlarmRefusal},
    device_time::{DeviceTime, SeenTime},
};

#[test]
fn an_alarm_is_raised_acknowledged_by_name_and_returns() {
    let mut plant = running();
    plant.on_event(read(1, &[(PV, 760.0)]));
    plant.on_event(read(3, &[(PV, 761.0)]));
    assert_eq!(plant.snapshot().alarms[0].state, AlarmState::Unacknowledged);
    let seen = plant.snapshot();
    let effects = plant.on_command(command(1, seen.alarms[0].acknowledge()), at(4));
    assert!(matches!(&effects.records[0], Record::Alarm(event) if event.by.as_deref() == Some("anna")));
    let all = seen.acknowledge_all().expect("one waited when it was seen");
    let effects = plant.on_command(command(2, all), at(4));
    assert!(!effects.records.iter().any(|record| matches!(record, Record::Alarm(_))), "it was acknowledged already");
    plant.on_event(fail(5, &[PV], Fault::Timeout));
    assert_eq!(plant.snapshot().alarms[0].state, AlarmState::Acknowledged, "no answer is no return");
    plant.on_event(read(6, &[(PV, 700.0)]));
    assert!(plant.snapshot().alarms.is_empty());
}

#[test]
fn several_alarms_are_shelved_by_one_command() {
    let mut plant = running();
    let shelve = |alarms: &[AlarmId]| {
        let lasts = Duration::from_secs(60);
        CommandKind::Alarm(AlarmCommand::Shelve { alarms: alarms.into(), lasts })
    };
    let all: Vec<AlarmId> = plant.def.alarms.iter().map(|alarm| alarm.id).collect();
    assert!(1 < all.len());
    let with_reason = |number, kind| {
        let mut status = command(number, kind);
        status.command.note = Some("cleaning".into());
        status
    };
    let effects = plant.on_command(with_reason(1, shelve(&all)), at(1));
    let shelved = effects.records.iter().filter(|record| matches!(record, Record::Alarm(_)));
    assert_eq!(shelved.count(), all.len());
    assert_eq!(plant.snapshot().commands[0].outcome, Outcome::Verified);
    let unknown = AlarmId(all.len() as u16);
    plant.on_command(with_reason(2, shelve(&[all[0], unknown])), at(2));
    let snapshot = plant.snapshot();
    let status = snapshot.commands.iter().find(|status| status.command.id.number == 2).expect("the second command");
    assert_eq!(
        status.outcome,
        Outcome::NotConfirmed(NotConfirmed::PartlyAccepted { done: 1, count: 2, first: AlarmRefusal::NoSuchAlarm })
    );
}

#[test]
fn a_device_slower_than_stated_is_an_alarm_with_figures() {
    let mut def = fixture::plant();
    let slow = AlarmId(def.alarms.len() as u16);
    def.alarms.push(AlarmDef::new(slow, Subject::Device(TIC), Condition::SlowerThanStated, "slow"));
    let def = Arc::new(def);
    let ms = Duration::from_millis;
    let mut seen = SeenTime::new(Some(ms(30)));
    // `responses` of this many ms come, then a second passes: what the alarm says, as an event and as a state.
    let mut after = |plant: &mut Plant, second: i64, responses: usize, of_ms: u64| {
        (0..responses).for_each(|_| seen.add(ms(of_ms)));
        let device_times = vec![(TIC, DeviceTime::new(&seen))];
        let report = LineReport { device_times, ..LineReport::new(plant.def().line(L1).clone()) };
        let mut records = plant.on_event(Event::Report { at: at(second), line: L1, report: Arc::new(report) }).records;
        records.extend(plant.on_event(read(second, &[(PV, 700.0), (SV, 700.0), (DP, 1.0), (FAULT, 0.0)])).records);
        records.extend(plant.on_tick(at(second)).records);
        let event = records.into_iter().find_map(|record| match record {
            Record::Alarm(event) => Some((event.event, event.reason.map(|reason| reason.to_string()))),
            _ => None,
        });
        (event, plant.snapshot().alarms.iter().map(|alarm| alarm.state).collect::<Vec<_>>())
    };
    let mut plant = Plant::new(def.clone(), at(0), 1.0);
    plant.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    let none = (None, vec![]);
    assert_eq!(after(&mut plant, 1, 100, 10), none, "as fast as stated");
    assert_eq!(after(&mut plant, 2, 2, 400), none, "two pauses");
    let words = "takes up to 400 ms for a response, its profile states 30 ms".to_owned();
    let raised = (Some((AlarmEvent::Raised, Some(words))), vec![AlarmState::Unacknowledged]);
    assert_eq!(after(&mut plant, 3, 1, 45), raised);
    assert_eq!(after(&mut plant, 4, 200, 10), (None, vec![AlarmState::Unacknowledged]), "some are still slow");
    let gone = (Some((AlarmEvent::ReturnedToNormal, None)), vec![AlarmState::ReturnedToNormal]);
    assert_eq!(after(&mut plant, 5, 256, 10), gone);
    let mut fast = Plant::new(def, at(0), 60.0);
    fast.on_event(Event::Line { at: at(0), line: L1, state: LineState::Connected });
    assert_eq!(after(&mut fast, 6, 100, 400), none, "only the machine that plays the plant is slow");
}

/// Whatever its state is called: of a device that fails and has no value left, nothing is known.
#[test]
fn a_failing_device_without_a_value_raises_its_alarm() {
    let mut plant = running();
    let tags: Vec<TagId> = plant.def.tags_of(TIC).map(|tag| tag.id).collect();
    let silent =
        |plant: &Plant| plant.snapshot().alarms.iter().find(|alarm| alarm.id == SILENT).map(|alarm| alarm.state);
    for (second, failed) in [(1, &[PV][..]), (10, &tags)] {
        plant.on_event(fail(second, failed, Fault::Exception(ExceptionCode(0x0B))));
        plant.on_tick(at(second + 5));
        assert!(matches!(plant.snapshot().devices[TIC.index()].state, DeviceState::Failing(_)));
        assert_eq!(silent(&plant).is_some(), failed.len() == tags.len(), "{failed:?}");
    }
    plant.on_event(read(20, &[(PV, 700.0)]));
    plant.on_tick(at(25));
    assert_eq!(silent(&plant), Some(AlarmState::ReturnedToNormal));
}
