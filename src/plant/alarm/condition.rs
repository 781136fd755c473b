//! Does a condition hold? Pure comparison with a deadband, and an honest "unknown".

use crate::plant::def::{Condition, Level};

/// What a condition is judged by. `None` is "not known now".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facts {
    /// The trusted value of the tag, in its unit.
    pub value: Option<f64>,
    /// The trusted value of the tag that a deviation is measured from.
    pub reference: Option<f64>,
    /// Whether the device answers.
    pub answering: Option<bool>,
}

/// Whether the condition holds; while an alarm is already active the limit moves inwards by the deadband, so that
/// a value that hovers at the limit does not chatter. `None`: it cannot be judged, nothing changes.
pub fn holds(condition: Condition, facts: Facts, active: bool) -> Option<bool> {
    let back = |deadband: f64| if active { deadband } else { 0.0 };
    match condition {
        Condition::Limit { level: Level::High | Level::HighHigh, limit, deadband } => {
            facts.value.map(|value| limit - back(deadband) < value)
        }
        Condition::Limit { level: Level::Low | Level::LowLow, limit, deadband } => {
            facts.value.map(|value| value < limit + back(deadband))
        }
        Condition::Deviation { from: _, limit, deadband } => {
            let distance = (facts.value? - facts.reference?).abs();
            Some(limit - back(deadband) < distance)
        }
        Condition::State { is } => facts.value.map(|value| value == is),
        Condition::NotAnswering => facts.answering.map(|answering| !answering),
    }
}

/// The limit that the journal names, if the condition has one.
pub fn limit_of(condition: Condition) -> Option<f64> {
    match condition {
        Condition::Limit { limit, .. } | Condition::Deviation { limit, .. } => Some(limit),
        Condition::State { .. } | Condition::NotAnswering => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::def::TagId;

    #[test]
    fn every_condition_holds_beyond_its_limit_and_returns_by_its_deadband() {
        let limit = |level, limit| Condition::Limit { level, limit, deadband: 2.0 };
        let deviation = Condition::Deviation { from: TagId(1), limit: 5.0, deadband: 1.0 };
        for (condition, value, active, expect) in [
            (limit(Level::High, 75.0), Some(75.0), false, Some(false)),
            (limit(Level::High, 75.0), Some(75.1), false, Some(true)),
            (limit(Level::HighHigh, 75.0), Some(73.5), true, Some(true)),
            (limit(Level::High, 75.0), Some(73.0), true, Some(false)),
            (limit(Level::Low, 10.0), Some(9.9), false, Some(true)),
            (limit(Level::LowLow, 10.0), Some(11.9), true, Some(true)),
            (limit(Level::Low, 10.0), Some(12.0), true, Some(false)),
            (limit(Level::Low, 10.0), None, true, None),
            (deviation, Some(75.1), false, Some(true)),
            (deviation, Some(64.9), false, Some(true)),
            (deviation, Some(65.5), true, Some(true)),
            (deviation, Some(66.0), true, Some(false)),
            (Condition::State { is: 2.0 }, Some(2.0), false, Some(true)),
            (Condition::State { is: 2.0 }, Some(1.0), true, Some(false)),
        ] {
            let facts = Facts { value, reference: Some(70.0), answering: None };
            assert_eq!(holds(condition, facts, active), expect, "{condition:?} at {value:?}, active {active}");
        }
    }

    #[test]
    fn a_deviation_from_an_unknown_set_value_is_unknown() {
        let facts = Facts { value: Some(99.0), reference: None, answering: None };
        assert_eq!(holds(Condition::Deviation { from: TagId(1), limit: 5.0, deadband: 0.0 }, facts, false), None);
    }

    #[test]
    fn silence_is_judged_by_the_device_alone() {
        for (answering, expect) in [(Some(true), Some(false)), (Some(false), Some(true)), (None, None)] {
            let facts = Facts { value: None, reference: None, answering };
            assert_eq!(holds(Condition::NotAnswering, facts, false), expect);
        }
    }
}
