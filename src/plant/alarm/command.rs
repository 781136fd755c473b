//! What an operator does with alarms: acknowledge, silence, reset, shelve, take out of service.

use crate::t;
use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    AlarmManager,
    lists::raised_at_of,
    state::{AlarmState, OperatorNote},
};
use crate::plant::{
    def::{AlarmDef, AlarmId},
    exact::Exact,
    record::{AlarmEvent, AlarmRecord},
};

/// Most characters of a note or reason.
pub const NOTE_CHARS_MAX: usize = 500;

/// An alarm command. The note of its command is the note of an acknowledgement, and the reason without which
/// nothing is shelved or put out of service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum AlarmCommand {
    /// Acknowledge one alarm, as the operator saw it.
    Acknowledge {
        /// Which.
        alarm: AlarmId,
        /// When the operator's view of it was annunciated: an alarm annunciated later stays unacknowledged.
        annunciated_at: Timestamp,
    },
    /// Acknowledge several, as the operator saw them. Of a size that any flood fits into.
    AcknowledgeAll {
        /// Which; `None` for all.
        alarms: Option<Arc<[AlarmId]>>,
        /// How many annunciations the operator had seen: an alarm annunciated later stays unacknowledged. No instant, because
        /// an alarm may come after a snapshot and be of its very instant.
        seen: u64,
    },
    /// End the sound of what sounds now.
    Silence,
    /// Reset a latched alarm whose condition has cleared.
    Reset(AlarmId),
    /// Shelve all of these.
    Shelve {
        /// Which.
        alarms: Arc<[AlarmId]>,
        /// For how long, at most `shelve_max` of the plant file.
        lasts: Duration,
    },
    /// Take an alarm back from the shelf before its time.
    Unshelve(AlarmId),
    /// Take an alarm out of service.
    OutOfService(AlarmId),
    /// Put an alarm back in service.
    InService(AlarmId),
    /// Tick a step of the action as done, or take the tick back.
    Tick {
        /// Which alarm.
        alarm: AlarmId,
        /// When the activation that the operator saw was raised.
        raised_at: Timestamp,
        /// The step, from 0.
        step: u8,
        /// Done, or not.
        done: bool,
    },
}

/// Why a request about an alarm was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum AlarmRefusal {
    /// The plant has no such alarm.
    #[error("{}", t!("no such alarm"))]
    NoSuchAlarm,
    /// It does not wait for an acknowledgement.
    #[error("{}", t!("nothing to acknowledge"))]
    NothingToAcknowledge,
    /// It was raised again after the operator looked.
    #[error("{}", t!("raised again since it was displayed"))]
    RaisedSince,
    /// The plant file wants a note with the acknowledgement.
    #[error("{}", t!("a comment is required"))]
    NoteNeeded,
    /// Shelving and taking out of service need a reason.
    #[error("{}", t!("a reason is required"))]
    ReasonNeeded,
    /// A note or reason is longer than `NOTE_CHARS_MAX` characters.
    #[error("{}", t!("more than {most} characters", most = NOTE_CHARS_MAX))]
    TooLong,
    /// Not for no time, and not for longer than the plant allows.
    #[error("{}", t!("an alarm can be shelved for up to {minutes} min", minutes = .max.as_secs() / 60))]
    ShelveTime {
        /// The longest.
        max: Duration,
    },
    /// Nothing sounds.
    #[error("{}", t!("no audible alarm"))]
    NothingSounds,
    /// It does not wait for a reset.
    #[error("{}", t!("nothing to reset"))]
    NothingToReset,
    /// Its condition still holds.
    #[error("{}", t!("its condition is still active"))]
    CauseLasts,
    /// It is not shelved.
    #[error("{}", t!("not shelved"))]
    NotShelved,
    /// It is out of service.
    #[error("{}", t!("out of service"))]
    OutOfService,
    /// It is in service.
    #[error("{}", t!("already in service"))]
    InService,
    /// The action has no such step.
    #[error("{}", t!("no such step"))]
    NoSuchStep,
    /// The step has that tick, or has none.
    #[error("{}", t!("the step was ticked or unticked by another user"))]
    TickedAlready,
}

impl AlarmManager {
    /// Acknowledges an alarm, unless it was annunciated again after `annunciated_at`.
    pub fn acknowledge(
        &mut self,
        id: AlarmId,
        annunciated_at: Timestamp,
        note: &OperatorNote,
    ) -> Result<AlarmRecord, AlarmRefusal> {
        let is_later = self.machine(id).annunciated_at.is_some_and(|latest| latest != annunciated_at);
        self.acknowledge_unless(is_later, id, note)
    }

    /// The same for one of several, unless it was annunciated after those that were seen.
    pub fn acknowledge_seen(
        &mut self,
        id: AlarmId,
        seen: u64,
        note: &OperatorNote,
    ) -> Result<AlarmRecord, AlarmRefusal> {
        self.acknowledge_unless(seen < self.machine(id).edge, id, note)
    }

    /// All that wait, of those that were seen.
    pub fn waiting(&self, seen: u64) -> Vec<AlarmId> {
        let waits = |id: &AlarmId| {
            let machine = self.machine(*id);
            machine.edge <= seen && machine.state().needs_acknowledgement()
        };
        self.def.alarms.iter().map(|alarm| alarm.id).filter(waits).collect()
    }

    fn acknowledge_unless(
        &mut self,
        raised_since: bool,
        id: AlarmId,
        note: &OperatorNote,
    ) -> Result<AlarmRecord, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let machine = self.machine(id);
        if !machine.state().needs_acknowledgement() {
            return Err(AlarmRefusal::NothingToAcknowledge);
        }
        if raised_since {
            return Err(AlarmRefusal::RaisedSince);
        }
        let reason = note.reason.clone().filter(|reason| !reason.trim().is_empty());
        if alarm.ack_comment && reason.is_none() {
            return Err(AlarmRefusal::NoteNeeded);
        }
        check_note(reason.as_ref())?;
        let value = machine.value;
        Ok(self.record_action(&alarm, AlarmEvent::Acknowledged, value, reason, note))
    }

    /// Resets a latched alarm whose condition has cleared.
    pub fn reset(&mut self, id: AlarmId, note: &OperatorNote) -> Result<AlarmRecord, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let machine = self.machine(id);
        match machine.state() {
            AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged => {
                Ok(self.record_action(&alarm, AlarmEvent::Reset, None, None, note))
            }
            AlarmState::Unacknowledged | AlarmState::Acknowledged if machine.latched => Err(AlarmRefusal::CauseLasts),
            _ => Err(AlarmRefusal::NothingToReset),
        }
    }

    /// Shelves an alarm, or shelves a shelved one for another time.
    pub fn shelve(&mut self, id: AlarmId, lasts: Duration, note: &OperatorNote) -> Result<AlarmRecord, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let reason = needed(note)?;
        let max = self.def.alarm_rules.shelve_max;
        let until = note.at.checked_add(lasts).ok().filter(|_| !lasts.is_zero() && lasts <= max);
        let until = until.ok_or(AlarmRefusal::ShelveTime { max })?;
        if self.machine(id).out_of_service.is_some() {
            return Err(AlarmRefusal::OutOfService);
        }
        let record = self.record(&alarm, AlarmEvent::Shelved, note.at, None);
        Ok(self
            .apply_event(id, AlarmRecord { by: note.by.clone(), reason: Some(reason), until: Some(until), ..record }))
    }

    /// Takes an alarm out of service.
    pub fn out_of_service(&mut self, id: AlarmId, note: &OperatorNote) -> Result<AlarmRecord, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let reason = needed(note)?;
        if self.machine(id).out_of_service.is_some() {
            return Err(AlarmRefusal::OutOfService);
        }
        Ok(self.record_action(&alarm, AlarmEvent::OutOfService, None, Some(reason), note))
    }

    /// Ends shelving (`Unshelved`) or puts the alarm back in service; an active one is raised again with its present `value`.
    pub fn reinstate(
        &mut self,
        id: AlarmId,
        event: AlarmEvent,
        value: Option<Exact>,
        note: &OperatorNote,
    ) -> Result<Vec<AlarmRecord>, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let machine = self.machine(id);
        let (is_away, refusal) = match event {
            AlarmEvent::Unshelved => (machine.shelved.is_some(), AlarmRefusal::NotShelved),
            _ => (machine.out_of_service.is_some(), AlarmRefusal::InService),
        };
        if !is_away {
            return Err(refusal);
        }
        let back = self.record_action(&alarm, event, value, None, note);
        Ok(std::iter::once(back).chain(self.raise_again(&alarm, note.at, value)).collect())
    }

    /// Ticks a step of the action, or takes the tick back, unless the alarm was raised again after `raised_at`.
    pub fn tick(
        &mut self,
        id: AlarmId,
        raised_at: Timestamp,
        (step, done): (u8, bool),
        note: &OperatorNote,
    ) -> Result<AlarmRecord, AlarmRefusal> {
        let alarm = self.alarm(id)?;
        let text = alarm.guidance.steps().nth(step.into()).ok_or(AlarmRefusal::NoSuchStep)?;
        let machine = self.machine(id);
        if raised_at_of(machine) != raised_at || machine.state() == AlarmState::Normal {
            return Err(AlarmRefusal::RaisedSince);
        }
        if machine.steps.iter().any(|ticked| ticked.reason.as_deref() == Some(text)) == done {
            return Err(AlarmRefusal::TickedAlready);
        }
        let event = if done { AlarmEvent::StepDone } else { AlarmEvent::StepUndone };
        Ok(self.record_action(&alarm, event, None, Some(text.into()), note))
    }

    fn record_action(
        &mut self,
        alarm: &AlarmDef,
        event: AlarmEvent,
        value: Option<Exact>,
        reason: Option<Arc<str>>,
        note: &OperatorNote,
    ) -> AlarmRecord {
        let record = self.record(alarm, event, note.at, value);
        self.apply_event(alarm.id, AlarmRecord { by: note.by.clone(), reason, ..record })
    }

    /// An id may come over the socket from another plant's terminal: it is checked.
    fn alarm(&self, id: AlarmId) -> Result<AlarmDef, AlarmRefusal> {
        self.def.alarms.get(id.index()).cloned().ok_or(AlarmRefusal::NoSuchAlarm)
    }
}

fn needed(note: &OperatorNote) -> Result<Arc<str>, AlarmRefusal> {
    let reason = note.reason.clone().filter(|reason| !reason.trim().is_empty()).ok_or(AlarmRefusal::ReasonNeeded)?;
    check_note(Some(&reason))?;
    Ok(reason)
}

/// A note that is too long is refused; `None` is none.
pub fn check_note(words: Option<&Arc<str>>) -> Result<(), AlarmRefusal> {
    match words.is_some_and(|words| NOTE_CHARS_MAX < words.chars().count()) {
        true => Err(AlarmRefusal::TooLong),
        false => Ok(()),
    }
}
