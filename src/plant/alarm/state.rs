//! The state machine of one alarm: the memories *active*, *unacknowledged* and *latched*, and why it is suppressed.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::record::{AlarmEvent, AlarmRecord, FirstOut};

/// State of an alarm as an operator sees it, derived from the memories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum AlarmState {
    /// Nothing to see.
    #[default]
    Normal,
    /// Active, and nobody has acknowledged it.
    Unacknowledged,
    /// Active and acknowledged.
    Acknowledged,
    /// No longer active, but nobody has acknowledged it.
    ReturnedToNormal,
    /// No longer active, not acknowledged, and it waits for a reset.
    LatchedUnacknowledged,
    /// No longer active, acknowledged, and it waits for a reset.
    LatchedAcknowledged,
    /// Suppressed by an operator for a limited time.
    Shelved,
    /// Suppressed by design: its enabling condition is false.
    SuppressedByDesign,
    /// Suppressed by an operator until put back in service.
    OutOfService,
}

impl AlarmState {
    /// Every state.
    pub const ALL: [AlarmState; 9] = [
        AlarmState::Normal,
        AlarmState::Unacknowledged,
        AlarmState::Acknowledged,
        AlarmState::ReturnedToNormal,
        AlarmState::LatchedUnacknowledged,
        AlarmState::LatchedAcknowledged,
        AlarmState::Shelved,
        AlarmState::SuppressedByDesign,
        AlarmState::OutOfService,
    ];

    /// The word on screen.
    pub fn word(self) -> &'static str {
        match self {
            AlarmState::Normal => "normal",
            AlarmState::Unacknowledged => "UNACK",
            AlarmState::Acknowledged => "acked",
            AlarmState::ReturnedToNormal => "RTN",
            AlarmState::LatchedUnacknowledged => "LATCHED",
            AlarmState::LatchedAcknowledged => "latched",
            AlarmState::Shelved => "shelved",
            AlarmState::SuppressedByDesign => "suppressed by design",
            AlarmState::OutOfService => "out of service",
        }
    }
    /// Waits for an acknowledgement.
    pub fn needs_acknowledgement(self) -> bool {
        match self {
            AlarmState::Unacknowledged | AlarmState::ReturnedToNormal | AlarmState::LatchedUnacknowledged => true,
            AlarmState::Normal
            | AlarmState::Acknowledged
            | AlarmState::LatchedAcknowledged
            | AlarmState::Shelved
            | AlarmState::SuppressedByDesign
            | AlarmState::OutOfService => false,
        }
    }
    /// Shelved, suppressed by design or out of service: evaluated and journaled, not annunciated.
    pub fn is_suppressed(self) -> bool {
        match self {
            AlarmState::Shelved | AlarmState::SuppressedByDesign | AlarmState::OutOfService => true,
            AlarmState::Normal
            | AlarmState::Unacknowledged
            | AlarmState::Acknowledged
            | AlarmState::ReturnedToNormal
            | AlarmState::LatchedUnacknowledged
            | AlarmState::LatchedAcknowledged => false,
        }
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
    /// If the clock has gone back behind the beginning, the end moves along: nobody shelved it for longer than this.
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
    active: bool,
    unacknowledged: bool,
    latched: bool,
    suppressed: Option<Timestamp>,
    shelved: Option<Shelving>,
    out_of_service: Option<OperatorNote>,
    /// Since when the condition differs from `active`: the delay runs. An instant of the manager's own clock.
    pending_since: Option<Duration>,
    /// The last activation that was annunciated.
    pub raised_at: Option<Timestamp>,
    /// When an operator was last told of it: raised, or reminded of.
    pub annunciated_at: Option<Timestamp>,
    /// When the last activation returned.
    pub returned_at: Option<Timestamp>,
    /// The last acknowledgement since it was raised.
    pub acknowledged: Option<OperatorNote>,
    /// The value that raised it.
    pub value: Option<f64>,
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

    /// Is the condition established (delays included)?
    pub fn is_active(&self) -> bool {
        self.active
    }
    /// Shelved until when, by whom and why; also while it is out of service.
    pub fn shelved(&self) -> Option<&Shelving> {
        self.shelved.as_ref()
    }
    /// Since when it is out of service, by whom and why.
    pub fn out_of_service(&self) -> Option<&OperatorNote> {
        self.out_of_service.as_ref()
    }
    /// Since when it is suppressed by design.
    pub fn suppressed(&self) -> Option<Timestamp> {
        self.suppressed
    }
    /// Waits for a reset once its condition is gone.
    pub fn is_latched(&self) -> bool {
        self.latched
    }

    /// The condition differs from what is established: a delay runs.
    pub fn is_pending(&self) -> bool {
        self.pending_since.is_some()
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
        }
    }

    /// An alarm that comes back from the shelf or into service is raised again if it is active; a latched one comes back as it
    /// was, because shelving is no acknowledgement.
    fn keep_latched(&mut self) {
        self.unacknowledged &= self.latched;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::def::Priority;

    const DELAYS: AlarmDelays = AlarmDelays { on_delay: Duration::from_secs(5), off_delay: Duration::from_secs(10) };

    fn record(event: AlarmEvent, second: i64) -> AlarmRecord {
        let at = Timestamp::from_second(second).expect("a small number");
        let record = AlarmRecord::new(at, "TIC-1.PV", "temperature high", Priority::High, event);
        AlarmRecord { until: Some(at + Duration::from_secs(60)), ..record }
    }

    /// The evaluation of an instant, with what follows from it.
    fn evaluated(machine: &mut AlarmStateMachine, holds: Option<bool>, second: u64) -> Option<AlarmEvent> {
        let event = machine.evaluate(holds, Duration::from_secs(second), DELAYS)?;
        machine.apply(&record(event, second as i64), false);
        Some(event)
    }

    #[test]
    fn the_life_of_an_alarm() {
        let mut machine = AlarmStateMachine::default();
        for (second, holds, event, state) in [
            (0, Some(true), None, AlarmState::Normal),
            (4, Some(false), None, AlarmState::Normal),
            (5, Some(true), None, AlarmState::Normal),
            (7, None, None, AlarmState::Normal),
            (10, Some(true), Some(AlarmEvent::Raised), AlarmState::Unacknowledged),
            (11, Some(false), None, AlarmState::Unacknowledged),
            (20, Some(false), None, AlarmState::Unacknowledged),
            (21, Some(false), Some(AlarmEvent::ReturnedToNormal), AlarmState::ReturnedToNormal),
        ] {
            assert_eq!(evaluated(&mut machine, holds, second), event, "at {second} s");
            assert_eq!(machine.state(), state, "at {second} s");
        }
        machine.apply(&record(AlarmEvent::Acknowledged, 22), false);
        assert_eq!(machine.state(), AlarmState::Normal);
    }

    #[test]
    fn what_an_operator_does_leads_from_state_to_state() {
        use AlarmEvent as T;
        use AlarmState as S;
        let check = |latch: bool, events: &[(T, S)]| {
            let mut machine = AlarmStateMachine::default();
            for (event, state) in events {
                machine.apply(&record(*event, 0), latch);
                assert_eq!(machine.state(), *state, "{event:?} of {events:?}");
            }
        };
        check(
            false,
            &[(T::Raised, S::Unacknowledged), (T::Acknowledged, S::Acknowledged), (T::ReturnedToNormal, S::Normal)],
        );
        check(
            false,
            &[(T::Raised, S::Unacknowledged), (T::Acknowledged, S::Acknowledged), (T::ReAlarmed, S::Unacknowledged)],
        );
        let latched = [
            (T::Raised, S::Unacknowledged),
            (T::ReturnedToNormal, S::LatchedUnacknowledged),
            (T::Acknowledged, S::LatchedAcknowledged),
            (T::Reset, S::Normal),
        ];
        check(true, &latched);
        check(
            true,
            &[
                (T::Raised, S::Unacknowledged),
                (T::ReturnedToNormal, S::LatchedUnacknowledged),
                (T::Reset, S::ReturnedToNormal),
            ],
        );
        let shelved = [
            (T::Raised, S::Unacknowledged),
            (T::Shelved, S::Shelved),
            (T::ReturnedSuppressed, S::Shelved),
            (T::Unshelved, S::Normal),
        ];
        check(false, &shelved);
        let both = [
            (T::Shelved, S::Shelved),
            (T::OutOfService, S::OutOfService),
            (T::RaisedSuppressed, S::OutOfService),
            (T::InService, S::Shelved),
            (T::Unshelved, S::Acknowledged),
            (T::Raised, S::Unacknowledged),
        ];
        check(false, &both);
        let design = [
            (T::SuppressedByDesign, S::SuppressedByDesign),
            (T::RaisedSuppressed, S::SuppressedByDesign),
            (T::ReturnedSuppressed, S::SuppressedByDesign),
            (T::Unsuppressed, S::Normal),
        ];
        check(false, &design);
        check(true, &design);
        let quiet = [(T::Shelved, S::Shelved), (T::RaisedSuppressed, S::Shelved), (T::ReturnedSuppressed, S::Shelved)];
        check(true, &[&quiet[..], &[(T::Unshelved, S::LatchedUnacknowledged)]].concat());
        check(false, &[&quiet[..], &[(T::Unshelved, S::Normal)]].concat());
        let longer = [(T::Shelved, S::Shelved), (T::Unshelved, S::LatchedUnacknowledged)];
        check(true, &[&quiet[..], &longer].concat());
    }

    #[test]
    fn a_shelving_is_never_longer_than_it_was_given_for() {
        let at = |second| Timestamp::from_second(second).expect("a small number");
        let note = OperatorNote { at: at(1_000), by: None, reason: None, recorded: true };
        let shelving = Shelving { note, until: at(1_600) };
        assert_eq!(shelving.moved(at(1_500)), None);
        assert_eq!(shelving.moved(at(100)), Some(at(700)));
    }
}
