//! The state machine of one alarm: two memories, *active* and *unacknowledged*, and the delays between them.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::record::AlarmStep;

/// State of an alarm as an operator sees it, derived from the two memories.
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
    Returned,
}

impl AlarmState {
    /// The word on screen.
    pub fn word(self) -> &'static str {
        match self {
            AlarmState::Normal => "normal",
            AlarmState::Unacknowledged => "UNACK",
            AlarmState::Acknowledged => "acked",
            AlarmState::Returned => "returned",
        }
    }
    /// Waits for an acknowledgement.
    pub fn needs_acknowledgement(self) -> bool {
        matches!(self, AlarmState::Unacknowledged | AlarmState::Returned)
    }
}

/// The memory of one alarm.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Machine {
    active: bool,
    unacknowledged: bool,
    /// Since when the condition differs from `active`: the delay runs.
    pending_since: Option<Timestamp>,
    /// The last activation and its return.
    pub raised_at: Option<Timestamp>,
    /// When the last activation returned.
    pub returned_at: Option<Timestamp>,
    /// The value that raised it.
    pub value: Option<f64>,
}

impl Machine {
    /// The state as an operator sees it.
    pub fn state(&self) -> AlarmState {
        match (self.active, self.unacknowledged) {
            (false, false) => AlarmState::Normal,
            (true, true) => AlarmState::Unacknowledged,
            (true, false) => AlarmState::Acknowledged,
            (false, true) => AlarmState::Returned,
        }
    }

    /// Is the condition established (delays included)?
    pub fn is_active(&self) -> bool {
        self.active
    }

    /// Takes the judgement of an instant. A condition must hold (or be gone) for the whole delay; a flap inside the
    /// delay leaves no trace. An unknown judgement (`None`) changes nothing and restarts no delay.
    pub fn step(
        &mut self,
        holds: Option<bool>,
        at: Timestamp,
        on_delay: Duration,
        off_delay: Duration,
    ) -> Option<AlarmStep> {
        let holds = holds?;
        if holds == self.active {
            self.pending_since = None;
            return None;
        }
        let since = *self.pending_since.get_or_insert(at);
        let delay = if holds { on_delay } else { off_delay };
        if Duration::try_from(at.duration_since(since)).unwrap_or_default() < delay {
            return None;
        }
        let step = if holds { AlarmStep::Raised } else { AlarmStep::Returned };
        self.apply(step, at);
        Some(step)
    }

    /// Takes a step without judging: what [`Machine::step`] decided, or what the journal remembers after a restart.
    pub fn apply(&mut self, step: AlarmStep, at: Timestamp) {
        self.pending_since = None;
        match step {
            AlarmStep::Raised => {
                (self.active, self.unacknowledged) = (true, true);
                (self.raised_at, self.returned_at) = (Some(at), None);
            }
            AlarmStep::Acknowledged => self.unacknowledged = false,
            AlarmStep::Returned => {
                self.active = false;
                self.returned_at = Some(at);
            }
        }
    }

    /// Acknowledges what is there now; `false` if there was nothing to acknowledge.
    pub fn acknowledge(&mut self) -> bool {
        std::mem::replace(&mut self.unacknowledged, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ON: Duration = Duration::from_secs(5);
    const OFF: Duration = Duration::from_secs(10);

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    #[test]
    fn the_life_of_an_alarm() {
        let mut machine = Machine::default();
        for (second, holds, step, state) in [
            (0, Some(true), None, AlarmState::Normal),
            (4, Some(false), None, AlarmState::Normal),
            (5, Some(true), None, AlarmState::Normal),
            (7, None, None, AlarmState::Normal),
            (10, Some(true), Some(AlarmStep::Raised), AlarmState::Unacknowledged),
            (11, Some(false), None, AlarmState::Unacknowledged),
            (20, Some(false), None, AlarmState::Unacknowledged),
            (21, Some(false), Some(AlarmStep::Returned), AlarmState::Returned),
        ] {
            assert_eq!(machine.step(holds, at(second), ON, OFF), step, "at {second} s");
            assert_eq!(machine.state(), state, "at {second} s");
        }
        assert!(machine.acknowledge());
        assert_eq!(machine.state(), AlarmState::Normal);
        assert!(!machine.acknowledge(), "there is nothing left to acknowledge");
    }

    #[test]
    fn an_acknowledged_alarm_returns_without_a_word() {
        let mut machine = Machine::default();
        machine.step(Some(true), at(0), Duration::ZERO, Duration::ZERO);
        assert!(machine.acknowledge());
        assert_eq!(machine.state(), AlarmState::Acknowledged);
        machine.step(Some(false), at(1), Duration::ZERO, Duration::ZERO);
        assert_eq!(machine.state(), AlarmState::Normal);
    }

    proptest! {
        #[test]
        fn steps_alternate_and_a_new_activation_is_never_acknowledged(
            holds in proptest::collection::vec(proptest::option::of(any::<bool>()), 1..200),
            acknowledge in proptest::collection::vec(any::<bool>(), 200),
        ) {
            let mut machine = Machine::default();
            let mut last = AlarmStep::Returned;
            for (second, holds) in holds.into_iter().enumerate() {
                if let Some(step) = machine.step(holds, at(second as i64), Duration::from_secs(2), Duration::from_secs(3)) {
                    prop_assert_ne!(step, last);
                    last = step;
                    if step == AlarmStep::Raised {
                        prop_assert_eq!(machine.state(), AlarmState::Unacknowledged);
                    }
                }
                if acknowledge[second] { machine.acknowledge(); }
                prop_assert_eq!(machine.is_active(), last == AlarmStep::Raised);
            }
        }
    }
}
