//! What a station restores from its history, which may open long after polling has started.

use std::{collections::HashSet, time::Duration};

use tokio::sync::oneshot;

use crate::{
    history::io::open::Restored,
    plant::record::{ActionRecord, AlarmRecord},
};

/// Where the journal alone knows the state of the alarms, the plant waits this long before it evaluates any.
pub const WAIT_MAX: Duration = Duration::from_millis(500);
/// Alarm events that are kept for the figures of the last day until the history is open.
const EARLY_MAX: usize = 10_000;

/// What is still to come of the time before the start.
#[derive(Debug)]
pub struct Past {
    /// Gone once it will never come.
    restored: Option<oneshot::Receiver<Restored>>,
    /// The state of the alarms comes from the journal.
    pub from_journal: bool,
    /// The station has just started, else it goes on under another definition of its plant.
    pub at_start: bool,
    /// The last start or end of a procedure by the audit log, which is written before the history.
    procedure: Option<ActionRecord>,
    /// Alarm events since the start.
    early: Vec<AlarmRecord>,
}

impl Past {
    /// Everything is still to come.
    pub fn new(
        restored: Option<oneshot::Receiver<Restored>>,
        from_journal: bool,
        procedure: Option<ActionRecord>,
    ) -> Past {
        Past { restored, from_journal, at_start: true, procedure, early: Vec::new() }
    }

    /// Only what the plant did not follow before is still to come.
    pub fn of_new_definition(restored: oneshot::Receiver<Restored>) -> Past {
        Past { at_start: false, ..Past::new(Some(restored), false, None) }
    }

    /// An event of an alarm, before the past is known.
    pub fn note(&mut self, event: &AlarmRecord) {
        if self.early.len() < EARLY_MAX {
            self.early.push(event.clone());
        }
    }

    /// Waits until the past is known; for ever where it never will be.
    pub async fn known(past: &mut Option<Past>) -> Restored {
        let waited = past.as_mut().and_then(|past| past.restored.as_mut());
        let Some(receiver) = waited else { return std::future::pending().await };
        match receiver.await {
            Ok(restored) => restored,
            Err(_) => {
                *past = None;
                std::future::pending().await
            }
        }
    }

    /// Joins the past with what has happened since: the events to restore leave out alarms that have changed meanwhile.
    pub fn join(self, mut restored: Restored) -> Restored {
        let name = |event: &AlarmRecord| (event.subject.clone(), event.message.clone());
        let changed: HashSet<_> = self.early.iter().map(name).collect();
        restored.events.retain(|event| self.from_journal && !changed.contains(&name(event)));
        restored.recent.events.extend(self.early);
        restored.procedure = last(self.procedure, restored.procedure.take());
        restored
    }
}

/// The later one: by its number in the audit log, or by time where the log does not have the other.
fn last(logged: Option<ActionRecord>, stored: Option<ActionRecord>) -> Option<ActionRecord> {
    let number = |record: &ActionRecord| record.chain_hash.map(|hash| hash.number);
    let is_later = |stored: &ActionRecord, logged: &ActionRecord| match (number(stored), number(logged)) {
        (Some(stored), Some(logged)) => logged < stored,
        (None, _) | (_, None) => logged.at < stored.at,
    };
    match (logged, stored) {
        (Some(logged), Some(stored)) => Some(if is_later(&stored, &logged) { stored } else { logged }),
        (logged, stored) => logged.or(stored),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::{
        access::audit_log,
        history::io::alarm_metrics::Recent,
        plant::{
            def::Priority,
            record::{AlarmEvent, ChainHash},
            recorded_action::RecordedAction,
        },
    };

    fn event(second: i64, text: &str, event: AlarmEvent) -> AlarmRecord {
        AlarmRecord::new(Timestamp::from_second(second).unwrap(), "TIC-1.PV", text, Priority::High, event)
    }

    #[test]
    fn a_late_restore_changes_no_newer_alarm() {
        let before = vec![event(1, "high", AlarmEvent::Raised), event(2, "low", AlarmEvent::Raised)];
        let recent = Recent { events: before.clone(), ..Recent::default() };
        let restored = Restored { events: before.clone(), recent, entries: None, ..Restored::default() };
        let now = event(9, "low", AlarmEvent::ReturnedToNormal);
        for from_journal in [true, false] {
            let mut past = Past::new(None, from_journal, None);
            past.note(&now);
            let joined = past.join(restored.clone());
            assert_eq!(joined.events, if from_journal { vec![before[0].clone()] } else { vec![] });
            assert_eq!(joined.recent.events, [before[0].clone(), before[1].clone(), now.clone()], "all are counted");
        }
    }

    #[test]
    fn a_start_that_only_the_audit_log_has_is_not_forgotten() {
        let record = |second: i64, number: Option<u64>, action: RecordedAction| ActionRecord {
            chain_hash: number.map(|number| ChainHash { number, ..audit_log::START }),
            ..ActionRecord::new(Timestamp::from_second(second).unwrap(), "anna", action, "fill", "done")
        };
        let (end, start) =
            (record(9, Some(3), RecordedAction::EndProcedure), record(5, Some(4), RecordedAction::StartProcedure));
        let unchained = record(11, None, RecordedAction::EndProcedure);
        for (logged, stored, expect) in [
            (Some(&start), Some(&end), Some(&start)),
            (Some(&start), None, Some(&start)),
            (Some(&end), Some(&start), Some(&start)),
            (None, Some(&end), Some(&end)),
            (Some(&start), Some(&unchained), Some(&unchained)),
            (None, None, None),
        ] {
            let past = Past::new(None, false, logged.cloned());
            let restored = Restored { procedure: stored.cloned(), ..Restored::default() };
            assert_eq!(past.join(restored).procedure.as_ref(), expect, "{logged:?} {stored:?}");
        }
    }
}
