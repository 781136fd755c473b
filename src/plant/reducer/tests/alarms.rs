//! Commands on alarms.

use super::*;
use crate::plant::alarm::AlarmCommand;

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
    assert_eq!(status.outcome, Outcome::NotConfirmed(NotConfirmed::Partly("1 of 2; no such alarm".to_owned())));
}
