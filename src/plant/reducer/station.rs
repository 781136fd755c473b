//! Faults of the station: the state of the store becomes alarms.

use super::Plant;
use crate::plant::{
    snapshot::HistoryStatus,
    station_fault::{FaultState, StationFault},
};

impl Plant {
    /// The state of a part of the station. The alarm follows with the next tick.
    pub fn on_fault(&mut self, fault: StationFault, state: FaultState) {
        self.faults.set(fault, state);
    }

    /// The state of the store. Alarms follow with the next tick.
    pub fn on_history(&mut self, status: HistoryStatus) {
        self.faults.set(StationFault::NotRecording, FaultState::lasting(status.failing.clone()));
        self.faults.set(StationFault::NotArchived, FaultState::lasting(status.unarchived.clone()));
        self.faults.set(StationFault::DiskSpace, FaultState::lasting(status.disk.clone()));
        if self.history.lost < status.lost {
            let words = format!("{} records lost since the start", status.lost);
            self.faults.set(StationFault::RecordsLost, FaultState::Occurred(words.into()));
        }
        if let Some(damaged) = status.damaged.as_ref().filter(|_| self.history.damaged != status.damaged) {
            self.faults.set(StationFault::HistoryDamaged, FaultState::Occurred(damaged.as_str().into()));
        }
        if let Some(behind) = status.clock.as_ref().filter(|_| self.history.clock != status.clock) {
            self.faults.set(StationFault::Clock, FaultState::Occurred(behind.as_str().into()));
        }
        self.history = status;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use jiff::Timestamp;

    use super::{super::tests::alarm_events, *};
    use crate::plant::{
        alarm::AlarmState,
        def::AlarmId,
        event::Event,
        fixture,
        record::{AlarmEvent, AlarmRecord, Record},
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// The fixture with the alarms that a loaded plant has, behind its own two.
    fn plant() -> Plant {
        let mut def = fixture::plant();
        let own = def.alarms.len();
        def.alarms.extend((own..).zip(StationFault::ALL).map(|(id, fault)| fault.alarm(AlarmId(id as u16))));
        Plant::new(Arc::new(def), at(0), 1.0)
    }

    fn tick(plant: &mut Plant, second: i64) -> Vec<AlarmRecord> {
        alarm_events(plant.on_tick(at(second)))
    }

    #[test]
    fn a_history_that_does_not_record_sounds_until_it_records() {
        let mut plant = plant();
        let failing = HistoryStatus { failing: Some("no space left".into()), ..HistoryStatus::default() };
        plant.on_history(failing);
        assert_eq!(tick(&mut plant, 1), [], "one failed commit raises no alarm");
        let raised = tick(&mut plant, 4);
        assert_eq!((raised.len(), &*raised[0].message), (1, "history not recording"));
        assert_eq!((raised[0].event, raised[0].reason.as_deref()), (AlarmEvent::Raised, Some("no space left")));
        let snapshot = plant.snapshot();
        assert!(snapshot.sound);
        assert_eq!(snapshot.fault_details(snapshot.alarms[0].id), "no space left");
        plant.on_history(HistoryStatus::default());
        assert_eq!(tick(&mut plant, 5)[0].event, AlarmEvent::ReturnedToNormal);
        assert_eq!(plant.snapshot().alarms[0].state, AlarmState::ReturnedToNormal, "until it is acknowledged");
    }

    #[test]
    fn an_archive_that_stands_still_is_an_alarm_until_it_goes_on() {
        let mut plant = plant();
        plant.on_history(HistoryStatus { unarchived: Some("no space left".into()), ..HistoryStatus::default() });
        let raised = tick(&mut plant, 1);
        assert_eq!((raised.len(), &*raised[0].message), (1, "history not archived"));
        assert_eq!(tick(&mut plant, 60), []);
        plant.on_history(HistoryStatus::default());
        assert_eq!(tick(&mut plant, 61)[0].event, AlarmEvent::ReturnedToNormal);
    }

    #[test]
    fn lost_records_are_an_alarm_each_time_some_are_lost() {
        let mut plant = plant();
        let lost = |lost| HistoryStatus { lost, ..HistoryStatus::default() };
        plant.on_history(lost(7));
        let raised = tick(&mut plant, 1);
        assert_eq!(raised[0].reason.as_deref(), Some("7 records lost since the start"));
        plant.on_history(lost(7));
        let events: Vec<_> = (2..20).flat_map(|second| tick(&mut plant, second)).map(|event| event.event).collect();
        assert_eq!(events, [AlarmEvent::ReturnedToNormal]);
        plant.on_history(lost(8));
        assert_eq!(tick(&mut plant, 20)[0].event, AlarmEvent::Raised);
    }

    #[test]
    fn a_start_before_the_last_record_is_an_alarm() {
        let mut plant = plant();
        let behind = HistoryStatus { clock: Some("the clock is behind".into()), ..HistoryStatus::default() };
        plant.on_history(behind.clone());
        let raised = tick(&mut plant, 1);
        assert_eq!((raised.len(), &*raised[0].message), (1, StationFault::Clock.word()));
        plant.on_history(behind);
        assert_eq!(tick(&mut plant, 2), [], "once");
    }

    #[test]
    fn any_part_of_the_station_can_report_a_fault() {
        let mut plant = plant();
        let fault = |state| Event::Station { at: at(1), fault: StationFault::LineTask, state };
        let effects = plant.on_event(fault(FaultState::Occurred("line L1 was started again".into())));
        let Some(Record::Alarm(event)) = effects.records.last() else { panic!("no alarm: {effects:?}") };
        assert_eq!((&*event.subject, &*event.message), ("station", "line task restarted"));
    }
}
