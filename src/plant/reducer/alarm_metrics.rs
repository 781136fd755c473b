//! The alarm monitor in the reducer: it counts every event of an alarm, and after a restart those of the last day.

use jiff::Timestamp;

use super::Plant;
use crate::plant::{
    alarm::AlarmMonitor,
    record::{AlarmRecord, Record},
};

impl Plant {
    /// Counts the journal of the last day in the alarm monitor. `active` are the raising events of alarms
    /// that were active before it, `events` what came since; both oldest first, none after `now`. `watched` are the windows
    /// of that day in which a station ran.
    pub fn restore_alarm_counts(
        &mut self,
        active: &[AlarmRecord],
        events: &[AlarmRecord],
        watched: &[i64],
        now: Timestamp,
    ) {
        let began = events.first().map_or(now, |event| event.at.min(now));
        self.alarm_monitor = AlarmMonitor::running(began);
        watched.iter().for_each(|window| self.alarm_monitor.watched(*window));
        active.iter().for_each(|event| self.alarm_monitor.already(event));
        events.iter().for_each(|event| self.alarm_monitor.on_event(event));
        self.alarm_monitor.advance(now);
        self.alarm_metrics = self.alarm_monitor.metrics();
    }

    /// Counts the events of alarms among what is to be stored.
    pub(super) fn count_alarms(&mut self, records: &[Record]) {
        self.alarm_monitor.advance(self.at);
        for record in records {
            match record {
                Record::Alarm(event) => self.alarm_monitor.on_event(event),
                Record::Sample(..)
                | Record::Action(_)
                | Record::Line(_)
                | Record::Batch(_)
                | Record::Run(_)
                | Record::Report(_)
                | Record::ClockSet => {}
            }
        }
        self.alarm_metrics = self.alarm_monitor.metrics();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{super::tests::alarm_events, *};
    use crate::plant::{
        event::Event,
        fixture::{self, DP, FAULT, PV, TIC},
    };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    /// The temperature at a second; above 75 is too hot after two seconds.
    fn read(plant: &mut Plant, second: i64, value: f64) -> Vec<AlarmRecord> {
        let values = fixture::raw([(DP, 0.0), (FAULT, 0.0), (PV, value)]);
        let (device, texts, response_time) = (TIC, Vec::new(), Duration::from_millis(12));
        let event = Event::Read { at: at(second), device, values, texts, response_time, exchange: None };
        alarm_events(plant.on_event(event))
    }

    #[test]
    fn a_restart_keeps_the_alarm_rates() {
        let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
        let mut journal = Vec::new();
        for second in 0..44 {
            let hot = second % 4 != 3;
            journal.extend(read(&mut plant, second, if hot { 80.0 } else { 20.0 }));
        }
        let metrics = plant.snapshot().alarm_metrics;
        assert_eq!((metrics.last_10_min, metrics.last_hour, metrics.flood_since), (11, 11, Some(at(42))));
        let mut again = Plant::new(fixture::shared(), at(50), 1.0);
        again.restore(&journal);
        again.restore_alarm_counts(&[], &journal, &[], at(50));
        plant.on_tick(at(53));
        again.on_tick(at(53));
        assert_eq!(again.snapshot().alarm_metrics.last_10_min, 11);
        assert_eq!(again.snapshot().alarm_metrics.flood_since, Some(at(42)));
        assert_eq!(again.snapshot().alarm_metrics.day.chattering, plant.snapshot().alarm_metrics.day.chattering);
        plant.on_tick(at(700));
        assert_eq!(plant.snapshot().alarm_metrics.last_10_min, 0);
        assert_eq!(plant.snapshot().alarm_metrics.flood_since, None);
    }
}
