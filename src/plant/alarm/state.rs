//! The state machine of one alarm: the memories *active*, *unacknowledged* and *latched*, and why it is suppressed.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::{
    exact::Exact,
    keyword::keyword_enum,
    record::{AlarmEvent, AlarmRecord, FirstOut},
};

keyword_enum! {
    /// State of an alarm as an operator sees it, derived from the memories.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
    pub enum AlarmState: "alarm state" {
        /// Nothing to see.
        #[default]
        Normal => "normal",
        /// Active and unacknowledged.
        Unacknowledged => "UNACK",
        /// Active and acknowledged.
        Acknowledged => "acked",
        /// No longer active, but unacknowledged.
        ReturnedToNormal => "RTN",
        /// No longer active, not acknowledged, and it waits for a reset.
        LatchedUnacknowledged => "LATCHED",
        /// No longer active, acknowledged, and it waits for a reset.
        LatchedAcknowledged => "latched",
        /// Suppressed by an operator for a limited time.
        Shelved => "shelved",
        /// Suppressed by design: its enabling condition is false.
        SuppressedByDesign => "suppressed by design",
        /// Suppressed by an operator until put back in service.
        OutOfService => "out of service",
    }
}

impl AlarmState {
    /// Waits for an acknowledgement.
    pub fn needs_acknowledgement(self) -> bool {
        matches!(self, AlarmState::Unacknowledged | AlarmState::ReturnedToNormal | AlarmState::LatchedUnacknowledged)
    }
    /// Is it annunciated, and does its condition still hold?
    pub(crate) fn is_active(self) -> bool {
        matches!(self, AlarmState::Unacknowledged | AlarmState::Acknowledged)
    }
    /// Does it wait for a reset?
    pub(crate) fn is_latched(self) -> bool {
        matches!(self, AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged)
    }
    /// Shelved, suppressed by design or out of service: evaluated and journaled, not annunciated.
    pub fn is_suppressed(self) -> bool {
        matches!(self, AlarmState::Shelved | AlarmState::SuppressedByDesign | AlarmState::OutOfService)
    }
}

/// Who did something with an alarm, when, and in which words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OperatorNote {
    /// When.
    pub at: Timestamp,
    /// Who; `None` if the station did it by itself.
    pub by: Option<Arc<str>>,
    /// The note or reason.
    pub reason: Option<Arc<str>>,
    /// It is on disk.
    pub recorded: bool,
}

/// An alarm that is shelved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shelving {
    /// Who, when, why.
    pub note: OperatorNote,
    /// It comes back by itself then.
    pub until: Timestamp,
}

impl Shelving {
    /// If the clock has gone back behind the beginning, the end moves along, so that the shelving lasts no longer than asked for.
    pub fn moved(&self, at: Timestamp) -> Option<Timestamp> {
        (at < self.note.at).then(|| at + self.until.duration_since(self.note.at))
    }
}

/// The delays of an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AlarmDelays {
    /// The condition must hold this long before it is raised.
    pub on_delay: Duration,
    /// The condition must be gone this long before it returns.
    pub off_delay: Duration,
}

/// The memory of one alarm.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AlarmStateMachine {
    pub active: bool,
    pub unacknowledged: bool,
    pub latched: bool,
    pub suppressed: Option<Timestamp>,
    pub shelved: Option<Shelving>,
    pub out_of_service: Option<OperatorNote>,
    /// Since when the condition differs from `active`: the delay runs. An instant of the manager's own clock.
    pub pending_since: Option<Duration>,
    /// The last activation that was annunciated.
    pub raised_at: Option<Timestamp>,
    /// When it was last annunciated: raised or re-alarmed.
    pub annunciated_at: Option<Timestamp>,
    /// When the last activation returned.
    pub returned_at: Option<Timestamp>,
    /// The last acknowledgement since it was raised.
    pub acknowledged: Option<OperatorNote>,
    /// The steps of the action that were done since it was raised: who, when, and the step as the reason.
    pub steps: Vec<OperatorNote>,
    /// The value that raised it.
    pub value: Option<Exact>,
    /// Its place among the alarms that were raised together.
    pub first_out: Option<FirstOut>,
    /// Activations since the station started.
    pub times: u32,
    /// For how long it has been acknowledged and active.
    pub acknowledged_for: Option<Duration>,
    /// Its place among everything that was annunciated since the start.
    pub edge: u64,
}

impl AlarmStateMachine {
    /// The state as an operator sees it.
    pub fn state(&self) -> AlarmState {
        if self.out_of_service.is_some() {
            return AlarmState::OutOfService;
        }
        if self.shelved.is_some() {
            return AlarmState::Shelved;
        }
        if self.suppressed.is_some() {
            return AlarmState::SuppressedByDesign;
        }
        match (self.active, self.unacknowledged, self.latched) {
            (true, true, _) => AlarmState::Unacknowledged,
            (true, false, _) => AlarmState::Acknowledged,
            (false, true, true) => AlarmState::LatchedUnacknowledged,
            (false, false, true) => AlarmState::LatchedAcknowledged,
            (false, true, false) => AlarmState::ReturnedToNormal,
            (false, false, false) => AlarmState::Normal,
        }
    }

    /// The condition holds, and its on-delay begins now, unless it is established already.
    pub fn begin_on_delay(&mut self, now: Duration) {
        if !self.active {
            self.pending_since = Some(now);
        }
    }

    /// Takes the evaluation of an instant, and says which event follows. A condition must hold (or be gone) for the whole
    /// delay; a flap inside the delay leaves no trace. An unknown evaluation (`None`) changes nothing and restarts no delay.
    /// `now` is an instant of the manager's own clock. The event is to be [applied](AlarmStateMachine::apply).
    pub fn evaluate(&mut self, holds: Option<bool>, now: Duration, delays: AlarmDelays) -> Option<AlarmEvent> {
        let holds = holds?;
        if holds == self.active {
            self.pending_since = None;
            return None;
        }
        let since = *self.pending_since.get_or_insert(now);
        let delay = if holds { delays.on_delay } else { delays.off_delay };
        if now.saturating_sub(since) < delay {
            return None;
        }
        let suppressed = self.state().is_suppressed();
        Some(match (holds, suppressed) {
            (true, false) => AlarmEvent::Raised,
            (true, true) => AlarmEvent::RaisedSuppressed,
            (false, false) => AlarmEvent::ReturnedToNormal,
            (false, true) => AlarmEvent::ReturnedSuppressed,
        })
    }

    /// Takes an event: one that was just decided, or one that the journal remembers after a restart. Both end in the same
    /// state, because this is the only place where it changes.
    pub fn apply(&mut self, event: &AlarmRecord, latch: bool) {
        let note = || OperatorNote { at: event.at, by: event.by.clone(), reason: event.reason.clone(), recorded: true };
        match event.event {
            AlarmEvent::Raised => {
                (self.active, self.unacknowledged, self.pending_since) = (true, true, None);
                self.annunciated_at = Some(event.at);
                self.latched |= latch;
                (self.raised_at, self.returned_at, self.acknowledged) = (Some(event.at), None, None);
                self.steps.clear();
                (self.value, self.first_out) = (event.value, event.first_out);
                self.times = self.times.saturating_add(1);
            }
            AlarmEvent::RaisedSuppressed => {
                (self.active, self.pending_since) = (true, None);
                if latch && self.suppressed.is_none() {
                    // It is not annunciated now, but what latches must be acknowledged once it is back. What came while it
                    // was suppressed by design was no fault.
                    (self.latched, self.unacknowledged) = (true, true);
                    (self.raised_at, self.returned_at, self.acknowledged) = (Some(event.at), None, None);
                    (self.annunciated_at, self.value) = (Some(event.at), event.value);
                    self.steps.clear();
                }
            }
            AlarmEvent::ReAlarmed => (self.unacknowledged, self.annunciated_at) = (true, Some(event.at)),
            AlarmEvent::Acknowledged => {
                (self.unacknowledged, self.acknowledged) = (false, Some(note()));
            }
            AlarmEvent::ReturnedToNormal | AlarmEvent::ReturnedSuppressed => {
                (self.active, self.pending_since, self.returned_at) = (false, None, Some(event.at));
            }
            AlarmEvent::Reset => self.latched = false,
            AlarmEvent::Shelved => {
                // Without an end it would stay away for ever: the journal of another program, or a damaged one.
                self.shelved = Some(Shelving { note: note(), until: event.until.unwrap_or(event.at) });
                self.keep_latched();
            }
            AlarmEvent::Unshelved => self.shelved = None,
            AlarmEvent::SuppressedByDesign => {
                self.suppressed = Some(event.at);
                // Only what is normal is suppressed. The journal remembers the last event of every kind: what came in an
                // earlier suppression must not latch after a restart.
                (self.latched, self.unacknowledged) = (false, false);
            }
            AlarmEvent::Unsuppressed => self.suppressed = None,
            AlarmEvent::OutOfService => {
                self.out_of_service = Some(note());
                self.keep_latched();
            }
            AlarmEvent::InService => self.out_of_service = None,
            AlarmEvent::StepDone | AlarmEvent::StepUndone => {
                self.steps.retain(|ticked| ticked.reason != event.reason);
                if event.event == AlarmEvent::StepDone {
                    self.steps.push(note());
                }
            }
            AlarmEvent::CarriedOver => {
                (self.active, self.unacknowledged, self.pending_since) = (true, true, None);
                self.latched |= latch;
                (self.raised_at, self.annunciated_at) = (Some(event.at), Some(event.at));
                (self.returned_at, self.acknowledged) = (None, None);
                self.steps.clear();
                (self.value, self.first_out) = (event.value, event.first_out);
            }
            AlarmEvent::Removed => {
                let AlarmStateMachine { times, edge, .. } = *self;
                *self = AlarmStateMachine { times, edge, ..AlarmStateMachine::default() };
            }
        }
    }

    /// An alarm that comes back from the shelf or into service is raised again if it is active; a latched one comes back as it
    /// was, because shelving is no acknowledgement.
    fn keep_latched(&mut self) {
        self.unacknowledged &= self.latched;
    }
}

#[cfg(test)]
mod tests;
