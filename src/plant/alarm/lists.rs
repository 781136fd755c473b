//! What an operator should see of the manager: alarms in order of urgency, what is suppressed, and whether it sounds.

use std::{cmp::Reverse, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    AlarmManager,
    state::{AlarmState, AlarmStateMachine, OperatorNote},
};
use crate::plant::{exact::Exact, id::AlarmId, record::FirstOut};

/// An alarm that an operator should see.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ActiveAlarm {
    /// Which.
    pub id: AlarmId,
    /// Unacknowledged, acknowledged, returned, latched; never one of those that are suppressed.
    pub state: AlarmState,
    /// When it was raised.
    pub raised_at: Timestamp,
    /// When it was last annunciated; identifies what the operator saw, see [`super::AlarmCommand::Acknowledge`].
    pub annunciated_at: Timestamp,
    /// When it returned to normal, if it did.
    pub returned_at: Option<Timestamp>,
    /// The value that raised it.
    pub value: Option<Exact>,
    /// Who acknowledged it, when, with which note.
    pub acknowledged: Option<OperatorNote>,
    /// The steps of its action that were done: who, when, and the step as the reason.
    pub steps: Vec<OperatorNote>,
    /// Activations since the station started.
    pub times: u32,
    /// Its place among the alarms that were raised together.
    pub first_out: Option<FirstOut>,
}

impl ActiveAlarm {
    /// An alarm without value, actions and first-out group.
    #[cfg(test)]
    pub fn new(id: AlarmId, state: AlarmState, raised_at: Timestamp) -> ActiveAlarm {
        let (returned_at, value, acknowledged, steps, times, first_out) = (None, None, None, Vec::new(), 1, None);
        let annunciated_at = raised_at;
        ActiveAlarm { id, state, raised_at, annunciated_at, returned_at, value, acknowledged, steps, times, first_out }
    }

    /// Who did this step of the action, and when.
    pub fn step(&self, text: &str) -> Option<&OperatorNote> {
        self.steps.iter().find(|ticked| ticked.reason.as_deref() == Some(text))
    }
}

/// An alarm that is suppressed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SuppressedAlarm {
    /// Which.
    pub id: AlarmId,
    /// Shelved, suppressed or out of service.
    pub state: AlarmState,
    /// Who suppressed it, when and why; no operator if by design.
    pub note: OperatorNote,
    /// When it comes back by itself, if it is shelved.
    pub until: Option<Timestamp>,
    /// Its condition holds all the same.
    pub active: bool,
}

/// What a snapshot shows of the manager. Shared, because most snapshots show the same.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lists {
    /// Most urgent first; among equals those that wait for an acknowledgement, then the latest.
    pub active: Arc<Vec<ActiveAlarm>>,
    /// What is suppressed, in the order of the plant file.
    pub suppressed: Arc<Vec<SuppressedAlarm>>,
    /// An unacknowledged active alarm came after the last silence.
    pub sound: bool,
}

impl AlarmManager {
    /// What an operator should see.
    pub fn lists(&self) -> &Arc<Lists> {
        self.lists.get_or_init(|| Arc::new(self.listed()))
    }

    /// What an operator should see and answer to.
    #[cfg(test)]
    pub fn active(&self) -> &[ActiveAlarm] {
        &self.lists().active
    }

    /// How many annunciations there have been.
    pub fn annunciations(&self) -> u64 {
        self.edges
    }

    /// What sounds now is silenced; what comes later sounds again. `false` if nothing sounded.
    pub fn silence(&mut self) -> bool {
        let sounded = self.lists().sound;
        self.silenced = self.edges;
        self.lists = std::sync::OnceLock::new();
        sounded
    }

    fn listed(&self) -> Lists {
        let (mut active, mut suppressed, mut sound) = (Vec::new(), Vec::new(), false);
        for (alarm, machine) in self.def.alarms.iter().zip(&self.machines) {
            let state = machine.state();
            if state.is_suppressed() {
                suppressed.extend(suppressed_alarm(alarm.id, machine));
            } else if state != AlarmState::Normal {
                sound |= state == AlarmState::Unacknowledged && self.silenced < machine.edge;
                active.push(shown(alarm.id, machine));
            }
        }
        active.sort_by_key(|alarm: &ActiveAlarm| {
            let waits = alarm.state.needs_acknowledgement();
            (self.def.alarm(alarm.id).priority, !waits, Reverse(alarm.raised_at))
        });
        Lists { active: Arc::new(active), suppressed: Arc::new(suppressed), sound }
    }
}

fn shown(id: AlarmId, machine: &AlarmStateMachine) -> ActiveAlarm {
    let raised_at = raised_at_of(machine);
    ActiveAlarm {
        id,
        state: machine.state(),
        raised_at,
        annunciated_at: machine.annunciated_at.unwrap_or(raised_at),
        returned_at: machine.returned_at,
        value: machine.value,
        acknowledged: machine.acknowledged.clone(),
        steps: machine.steps.clone(),
        times: machine.times,
        first_out: machine.first_out,
    }
}

/// When an alarm was raised: whatever the journal has lost, the alarm itself is not.
pub(super) fn raised_at_of(machine: &AlarmStateMachine) -> Timestamp {
    machine.raised_at.or(machine.returned_at).unwrap_or(Timestamp::UNIX_EPOCH)
}

fn suppressed_alarm(id: AlarmId, machine: &AlarmStateMachine) -> Option<SuppressedAlarm> {
    let by_design = |at| OperatorNote { at, by: None, reason: None, recorded: true };
    let (note, until) = match (&machine.out_of_service, &machine.shelved) {
        (Some(note), _) => (note.clone(), None),
        (None, Some(shelving)) => (shelving.note.clone(), Some(shelving.until)),
        (None, None) => (machine.suppressed.map(by_design)?, None),
    };
    Some(SuppressedAlarm { id, state: machine.state(), note, until, active: machine.active })
}
