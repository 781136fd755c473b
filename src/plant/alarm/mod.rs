//! Alarms: when a condition holds, what state follows, and the book of all of them.

/// State of an alarm as an operator sees it. *Active* and *unacknowledged* are two memories; this is derived.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
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
