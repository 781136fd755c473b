//! Does a condition hold? Pure comparison with a deadband, a memory where it looks back, and an honest "unknown".

use crate::plant::{
    def::{Condition, Level},
    number::to_i64,
};
use std::{collections::VecDeque, time::Duration};

/// Points that the memory of a rate keeps: finer than any window needs.
const POINTS_MAX: u32 = 32;

/// What a condition is evaluated by. `None` is "not known now".
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Facts {
    /// The good value of the tag, in its unit.
    pub value: Option<f64>,
    /// The good value of the tag that a deviation is measured from.
    pub reference: Option<f64>,
    /// For a device or line: whether it is in the state that the alarm tells.
    pub ill: Option<bool>,
    /// Whether the alarm is enabled by design.
    pub enabled: Option<bool>,
}

/// What a condition that looks back remembers. Instants are of the manager's own clock, which never goes back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Memory {
    /// Earlier values, or earlier changes, oldest first.
    points: VecDeque<(Duration, f64)>,
    /// The value that "no change" counts from.
    from: Option<f64>,
    /// How long there was no change, or no good value.
    lasted: Duration,
    /// When it was last asked.
    asked: Option<Duration>,
    /// Since when it remembers, and whether it has seen a change since.
    since: Option<Duration>,
    changed: bool,
}

impl Memory {
    /// Begins anew.
    pub fn clear(&mut self) {
        self.points.clear();
        *self = Memory { points: std::mem::take(&mut self.points), ..Memory::default() };
    }

    /// The rate in units per minute over about this window; `None` until the window is full.
    fn rate(&mut self, value: f64, now: Duration, over: Duration) -> Option<f64> {
        while self.points.get(1).is_some_and(|(at, _)| over <= now.saturating_sub(*at)) {
            self.points.pop_front();
        }
        let first = self.points.front().copied();
        if self.points.back().is_none_or(|(at, _)| over / POINTS_MAX <= now.saturating_sub(*at)) {
            self.points.push_back((now, value));
        }
        let (at, then) = first?;
        let span = now.saturating_sub(at);
        // After a gap the oldest value is of another time: the window must fill again.
        if over * 2 < span {
            self.points.clear();
            self.points.push_back((now, value));
            return None;
        }
        (over <= span).then(|| (value - then) / span.as_secs_f64() * 60.0)
    }

    /// How long the value has stayed where it is; time in which it is not known does not count.
    fn unchanged(&mut self, value: f64, passed: Duration, deadband: f64) -> Duration {
        if self.from.is_some_and(|from| (value - from).abs() <= deadband) {
            self.lasted += passed;
        } else {
            self.changed |= self.from.is_some();
            (self.from, self.lasted) = (Some(value), Duration::ZERO);
        }
        self.lasted
    }

    /// Whether the value has changed `count` times within a time. Keeps no more changes than it needs.
    fn changes(&mut self, value: f64, now: Duration, count: u32, within: Duration, deadband: f64) -> bool {
        let changed = self.from.is_some_and(|from| deadband < (value - from).abs());
        if changed {
            self.points.push_back((now, value));
        }
        if changed || self.from.is_none() {
            self.from = Some(value);
        }
        let count = count as usize;
        while count < self.points.len() {
            self.points.pop_front();
        }
        self.points.len() == count && self.points.front().is_some_and(|(at, _)| now.saturating_sub(*at) <= within)
    }
}

/// Whether the condition holds; while an alarm is already active the limit moves inwards by the deadband, so that
/// a value that hovers at the limit does not chatter. `None`: it cannot be evaluated, nothing changes. `now` is an instant of
/// the manager's own clock.
pub fn holds(condition: Condition, facts: Facts, active: bool, memory: &mut Memory, now: Duration) -> Option<bool> {
    let back = |deadband: f64| if active { deadband } else { 0.0 };
    let passed = |memory: &mut Memory| now.saturating_sub(memory.asked.replace(now).unwrap_or(now));
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
        Condition::Bit { bit } => facts.value.map(|value| is_set(value, bit)),
        Condition::Rate { limit, over, deadband } => {
            let rate = memory.rate(facts.value?, now, over)?;
            Some(limit.abs() - back(deadband) < rate * limit.signum())
        }
        Condition::NoChange { lasts, deadband } => {
            let passed = passed(memory);
            let stuck = lasts <= memory.unchanged(facts.value?, passed, deadband);
            // After a restart it is as stuck as it was until it has moved.
            (stuck || !active || memory.changed).then_some(stuck)
        }
        Condition::NoUpdate { lasts } => {
            let passed = passed(memory);
            memory.lasted = if facts.value.is_some() { Duration::ZERO } else { memory.lasted + passed };
            // A silence that may still become too long is no return of one that already was.
            match lasts <= memory.lasted {
                true => Some(true),
                false => (facts.value.is_some() || !active).then_some(false),
            }
        }
        Condition::Changes { count, within, deadband } => {
            let busy = memory.changes(facts.value?, now, count, within, deadband);
            // After a restart nobody can tell that it is calm before it was watched for that long.
            let watched = within <= now.saturating_sub(*memory.since.get_or_insert(now));
            (busy || !active || watched).then_some(busy)
        }
        Condition::NotAnswering
        | Condition::Health { .. }
        | Condition::NotConnected
        | Condition::Overloaded
        | Condition::Station(_) => facts.ill,
    }
}

/// Whether a bit of a word is set. A word with a sign has its highest bit set while it is negative.
pub fn is_set(value: f64, bit: u8) -> bool {
    to_i64(value).cast_unsigned().checked_shr(u32::from(bit)).unwrap_or(0) & 1 == 1
}

/// The limit that the journal names, if the condition has one.
pub fn limit_of(condition: Condition) -> Option<f64> {
    match condition {
        Condition::Limit { limit, .. } | Condition::Deviation { limit, .. } | Condition::Rate { limit, .. } => {
            Some(limit)
        }
        Condition::State { .. }
        | Condition::Bit { .. }
        | Condition::NoChange { .. }
        | Condition::NoUpdate { .. }
        | Condition::Changes { .. }
        | Condition::NotAnswering
        | Condition::Health { .. }
        | Condition::NotConnected
        | Condition::Overloaded
        | Condition::Station(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::def::TagId;

    fn sec(seconds: u64) -> Duration {
        Duration::from_secs(seconds)
    }

    /// The verdicts over values at instants, in seconds.
    fn over_time(condition: Condition, values: &[(u64, Option<f64>)]) -> Vec<Option<bool>> {
        let (mut memory, mut active) = (Memory::default(), false);
        let verdict = |(second, value): &(u64, Option<f64>)| {
            let facts = Facts { value: *value, ..Facts::default() };
            let holds = holds(condition, facts, active, &mut memory, sec(*second));
            active = holds.unwrap_or(active);
            holds
        };
        values.iter().map(verdict).collect()
    }

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
            (Condition::Bit { bit: 2 }, Some(4.0), false, Some(true)),
            (Condition::Bit { bit: 2 }, Some(3.0), true, Some(false)),
            (Condition::Bit { bit: 15 }, Some(-32_768.0), false, Some(true)),
            (Condition::Bit { bit: 2 }, None, true, None),
        ] {
            let facts = Facts { value, reference: Some(70.0), ..Facts::default() };
            let holds = holds(condition, facts, active, &mut Memory::default(), Duration::ZERO);
            assert_eq!(holds, expect, "{condition:?} at {value:?}, active {active}");
        }
    }

    #[test]
    fn a_deviation_from_an_unknown_set_value_is_unknown() {
        let facts = Facts { value: Some(99.0), ..Facts::default() };
        let deviation = Condition::Deviation { from: TagId(1), limit: 5.0, deadband: 0.0 };
        assert_eq!(holds(deviation, facts, false, &mut Memory::default(), Duration::ZERO), None);
    }

    #[test]
    fn silence_is_judged_by_the_device_alone() {
        for ill in [Some(true), Some(false), None] {
            let facts = Facts { ill, ..Facts::default() };
            assert_eq!(holds(Condition::NotAnswering, facts, false, &mut Memory::default(), Duration::ZERO), ill);
        }
    }

    #[test]
    fn a_fast_change_is_told_once_the_window_is_full_and_not_after_a_gap() {
        let rising = Condition::Rate { limit: 6.0, over: sec(30), deadband: 2.0 };
        let (no, yes) = (Some(false), Some(true));
        let events = [(0, 20.0), (15, 21.6), (30, 23.2), (60, 25.4), (90, 27.0)].map(|(at, value)| (at, Some(value)));
        assert_eq!(over_time(rising, &events), [None, None, yes, yes, no], "6.4, 4.4, 3.2 a minute");
        let falling = Condition::Rate { limit: -6.0, over: sec(30), deadband: 2.0 };
        assert_eq!(over_time(falling, &events), [None, None, no, no, no], "it rises");
        let fall = [(0, Some(20.0)), (30, Some(10.0)), (60, None), (120, Some(0.0)), (150, Some(0.0))];
        assert_eq!(over_time(falling, &fall), [None, yes, None, None, no]);
    }

    #[test]
    fn a_value_that_stands_still_is_stuck_and_an_unknown_one_is_not() {
        let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
        let (no, yes) = (Some(false), Some(true));
        let check = |values: &[(u64, Option<f64>)], expect: &[Option<bool>]| {
            assert_eq!(over_time(stuck, values), expect, "{values:?}");
        };
        check(&[(0, Some(20.0)), (30, Some(20.2)), (60, Some(20.1)), (61, Some(20.3))], &[no, no, yes, no]);
        check(&[(0, Some(20.0)), (59, Some(20.3)), (60, Some(20.3))], &[no, no, no]);
        check(&[(0, Some(20.0)), (50, None), (60, Some(20.0)), (110, Some(20.0))], &[no, None, no, yes]);
        check(&[(0, Some(20.0)), (60, Some(20.0)), (70, None), (80, Some(20.0))], &[no, yes, None, yes]);
    }

    #[test]
    fn no_update_is_told_from_unknown_values_alone() {
        let silent = Condition::NoUpdate { lasts: sec(30) };
        let (no, yes) = (Some(false), Some(true));
        let values = [(0, None), (29, None), (30, None), (31, None), (32, Some(1.0)), (61, None), (63, None)];
        assert_eq!(over_time(silent, &values), [no, no, yes, yes, no, no, yes]);
    }

    #[test]
    fn a_signal_that_changes_too_often_is_told_until_it_calms_down() {
        let busy = Condition::Changes { count: 3, within: sec(10), deadband: 0.0 };
        let (no, yes) = (Some(false), Some(true));
        let values =
            [(0, 0.0), (1, 1.0), (5, 0.0), (8, 1.0), (11, 1.0), (12, 1.0)].map(|(at, value)| (at, Some(value)));
        assert_eq!(over_time(busy, &values), [no, no, no, yes, yes, no]);
    }

    #[test]
    fn an_alarm_of_before_a_restart_returns_only_when_its_value_has_moved_or_was_calm_for_long_enough() {
        let (no, yes) = (Some(false), Some(true));
        let check = |condition, values: &[(u64, f64, Option<bool>)]| {
            let mut memory = Memory::default();
            for (second, value, expect) in values {
                let facts = Facts { value: Some(*value), ..Facts::default() };
                assert_eq!(holds(condition, facts, true, &mut memory, sec(*second)), *expect, "at {second} s");
            }
        };
        let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
        check(stuck, &[(0, 20.0, None), (59, 20.1, None), (60, 20.0, yes)]);
        check(stuck, &[(0, 20.0, None), (10, 20.5, no), (11, 20.5, no)]);
        let busy = Condition::Changes { count: 2, within: sec(10), deadband: 0.0 };
        check(busy, &[(0, 0.0, None), (9, 0.0, None), (10, 0.0, no)]);
        check(busy, &[(0, 0.0, None), (1, 1.0, None), (2, 0.0, yes), (12, 0.0, no)]);
    }

    #[test]
    fn what_has_been_is_forgotten_when_an_alarm_is_enabled_anew() {
        let stuck = Condition::NoChange { lasts: sec(60), deadband: 0.2 };
        let (mut memory, facts) = (Memory::default(), Facts { value: Some(20.0), ..Facts::default() });
        assert_eq!(holds(stuck, facts, false, &mut memory, sec(0)), Some(false));
        memory.clear();
        assert_eq!(holds(stuck, facts, false, &mut memory, sec(60)), Some(false));
        assert_eq!(holds(stuck, facts, false, &mut memory, sec(120)), Some(true));
    }
}
