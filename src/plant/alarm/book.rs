//! The book of all alarms: judges them against the plant and lists what an operator should see.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    condition::{Facts, holds, limit_of},
    state::{AlarmState, Machine},
};
use crate::plant::{
    def::{AlarmId, PlantDef, Subject},
    record::{AlarmRecord, AlarmStep},
    snapshot::ActiveAlarm,
};

/// The machines of all alarms, by [`AlarmId`].
#[derive(Debug, Clone)]
pub struct Book {
    def: Arc<PlantDef>,
    machines: Vec<Machine>,
}

impl Book {
    /// Every alarm normal.
    pub fn new(def: Arc<PlantDef>) -> Book {
        let machines = vec![Machine::default(); def.alarms.len()];
        Book { def, machines }
    }

    /// Judges every alarm at an instant; `facts` tells what is known for a subject and condition.
    pub fn judge(&mut self, at: Timestamp, facts: impl Fn(AlarmId) -> Facts) -> Vec<AlarmRecord> {
        let mut records = Vec::new();
        for index in 0..self.machines.len() {
            let alarm = &self.def.alarms[index];
            let (id, facts) = (alarm.id, facts(alarm.id));
            let machine = &mut self.machines[index];
            let holds = holds(alarm.condition, facts, machine.is_active());
            if let Some(step) = machine.step(holds, at, alarm.on_delay, alarm.off_delay) {
                if step == AlarmStep::Raised {
                    machine.value = facts.value;
                }
                records.push(self.record(id, step, at, facts.value, None));
            }
        }
        records
    }

    /// Acknowledges one alarm; `None` if there is nothing to acknowledge.
    pub fn acknowledge(&mut self, id: AlarmId, at: Timestamp, by: Arc<str>) -> Option<AlarmRecord> {
        let machine = self.machines.get_mut(id.index())?;
        let value = machine.value;
        machine.acknowledge().then(|| self.record(id, AlarmStep::Acknowledged, at, value, Some(by)))
    }

    /// The alarms that wait for an acknowledgement now.
    pub fn unacknowledged(&self) -> Vec<AlarmId> {
        let waits = |alarm: &AlarmId| self.machines[alarm.index()].state().needs_acknowledgement();
        self.def.alarms.iter().map(|alarm| alarm.id).filter(waits).collect()
    }

    /// Takes up the alarms that the journal remembers from before a restart. Steps come oldest first; those of alarms
    /// that the plant no longer has are passed over.
    pub fn restore(&mut self, steps: &[AlarmRecord]) {
        for step in steps {
            let known = self.def.alarms.iter().position(|alarm| {
                *alarm.text == *step.text && subject_name(&self.def, alarm.subject) == &*step.subject
            });
            if let Some(index) = known {
                self.machines[index].apply(step.step, step.at);
                if step.step == AlarmStep::Raised {
                    self.machines[index].value = step.value;
                }
            }
        }
    }

    /// What an operator should see: most urgent first; among equals those that wait for an acknowledgement, then the latest.
    pub fn active(&self) -> Vec<ActiveAlarm> {
        let mut list: Vec<ActiveAlarm> = self
            .def
            .alarms
            .iter()
            .filter_map(|alarm| {
                let machine = &self.machines[alarm.id.index()];
                let raised_at = machine.raised_at.filter(|_| machine.state() != AlarmState::Normal)?;
                Some(ActiveAlarm {
                    id: alarm.id,
                    state: machine.state(),
                    raised_at,
                    returned_at: machine.returned_at,
                    value: machine.value,
                })
            })
            .collect();
        list.sort_by_key(|alarm| {
            let waits = alarm.state.needs_acknowledgement();
            (self.def.alarm(alarm.id).priority, !waits, std::cmp::Reverse(alarm.raised_at))
        });
        list
    }

    fn record(
        &self,
        id: AlarmId,
        step: AlarmStep,
        at: Timestamp,
        value: Option<f64>,
        by: Option<Arc<str>>,
    ) -> AlarmRecord {
        let alarm = self.def.alarm(id);
        AlarmRecord {
            at,
            subject: subject_name(&self.def, alarm.subject).into(),
            text: alarm.text.as_str().into(),
            priority: alarm.priority,
            step,
            value,
            limit: limit_of(alarm.condition),
            by,
        }
    }
}

/// Full name of what an alarm watches: tag or device.
pub fn subject_name(def: &PlantDef, subject: Subject) -> &str {
    match subject {
        Subject::Tag(tag) => &def.tag(tag).name,
        Subject::Device(device) => &def.device(device).name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture::{self, HIGH, SILENT};

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn facts(value: f64, answering: bool) -> impl Fn(AlarmId) -> Facts {
        move |_| Facts { value: Some(value), reference: None, answering: Some(answering) }
    }

    #[test]
    fn an_alarm_is_told_with_value_and_limit_and_survives_a_restart() {
        let mut book = Book::new(fixture::shared());
        assert!(book.judge(at(0), facts(80.0, true)).is_empty(), "the on-delay runs");
        let steps = book.judge(at(2), facts(81.0, true));
        assert_eq!(steps.len(), 1);
        assert_eq!((&*steps[0].subject, steps[0].value, steps[0].limit), ("TIC-1.PV", Some(81.0), Some(75.0)));

        let mut again = Book::new(fixture::shared());
        again.restore(&steps);
        assert_eq!(again.active(), book.active());
        let ack = again.acknowledge(HIGH, at(3), "anna".into()).expect("it waits for an acknowledgement");
        assert_eq!(ack.by.as_deref(), Some("anna"));
        assert_eq!(again.acknowledge(HIGH, at(3), "anna".into()), None);
        assert_eq!(again.active()[0].state, AlarmState::Acknowledged);
    }

    #[test]
    fn the_list_puts_what_waits_before_what_is_known() {
        let mut book = Book::new(fixture::shared());
        book.judge(at(0), facts(80.0, false));
        book.judge(at(2), facts(80.0, false));
        assert_eq!(book.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [HIGH, SILENT], "latest first");
        book.acknowledge(HIGH, at(3), "anna".into());
        assert_eq!(book.active().iter().map(|alarm| alarm.id).collect::<Vec<_>>(), [SILENT, HIGH]);
        assert_eq!(book.unacknowledged(), [SILENT]);
    }
}
