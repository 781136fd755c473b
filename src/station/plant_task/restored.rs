//! What the plant goes on from of the time before: alarms, batches, runs, totals, and what became of alarms meanwhile.

use super::PlantTask;
use crate::{
    history::io::open::Restored,
    plant::{
        alarm::Succession,
        record::{AlarmRecord, Record},
    },
};

impl PlantTask {
    /// Restores alarm states and metrics from the history.
    pub(super) fn restore_history(&mut self, restored: Restored) {
        let Some(past) = self.persistence.past.take() else { return };
        let at_start = past.at_start;
        let Restored { events, recent, entries, batches, mut runs, procedure, totals, off } = past.join(restored);
        let behind = self.clock.behind_utc();
        let off = off.map(|off| off.checked_sub(behind).unwrap_or(off));
        runs.iter_mut().for_each(|run| run.move_from_utc(behind));
        self.plant.restore_totals(&totals);
        let resumed = self.plant.restore_batches(&batches, off);
        self.dispatch(resumed);
        let mut interrupted = self.plant.restore_runs(&runs);
        interrupted.extend(self.plant.restore_procedures(procedure.as_ref()));
        self.dispatch(interrupted);
        if let (Some(entries), Some(audit)) = (entries, &mut self.persistence.audit) {
            audit.compare(entries);
        }
        if !events.is_empty() {
            tracing::info!(events = events.len(), "the alarm state is restored from the journal");
            let succession = self.plant.restore(&events);
            self.send_to_audit_log(Vec::new(), events);
            self.record_succession(succession);
        }
        if at_start {
            self.plant.restore_alarm_counts(&recent.active, &recent.events, &recent.watched, self.clock.now());
        }
    }

    /// Records what the plant file has no more of the alarms, or calls otherwise.
    pub(super) fn record_succession(&mut self, succession: Succession) {
        let journal = succession.journal(self.clock.now(), self.persistence.file_since);
        self.dispatch(journal.into_iter().map(Record::Alarm).collect());
        self.keep_standing(succession.state());
    }

    /// The state file knows since when an alarm stands; the journal has heard of that under another name.
    pub(super) fn keep_standing(&mut self, mut events: Vec<AlarmRecord>) {
        let behind = self.clock.behind_utc();
        events.iter_mut().for_each(|event| event.move_to_utc(behind));
        self.send_to_audit_log(Vec::new(), events);
    }
}
