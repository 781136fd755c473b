//! The conditions of alarms: what each watches, whether it holds, and what its limit is. A new one is added here, and its
//! TOML keys in `profile::condition`.

use std::{collections::VecDeque, time::Duration};

use serde::{Deserialize, Serialize};

use crate::plant::{exact::Exact, id::TagId, signal::Signal, station_fault::StationFault};

/// Points that the memory of a rate keeps: finer than any window needs.
const POINTS_MAX: u32 = 32;

/// When an alarm is active. Limits and deadbands are in the tag's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Condition {
    /// A fixed limit; it returns when the value is back by the deadband.
    Limit { level: Level, limit: f64, deadband: f64 },
    /// The value is further than `limit` from another tag (its SV), on either side; it returns when it is nearer by the deadband.
    Deviation { from: TagId, limit: f64, deadband: f64 },
    /// A discrete tag has this abnormal value.
    State { is: f64 },
    /// A tag is not what the plant file states, see [`TagDef::stated`](crate::plant::tag::TagDef::stated).
    OtherThanStated { stated: f64 },
    /// This bit of a word is set; bit 0 is the lowest.
    Bit { bit: u8 },
    /// The value rises faster than a limit above 0, or falls faster than one below: limit and deadband per minute, measured
    /// `over` a time.
    Rate { limit: f64, over: Duration, deadband: f64 },
    /// The value has stayed within `deadband` for so long, as if stuck.
    NoChange { lasts: Duration, deadband: f64 },
    /// There has been no good value for so long.
    NoUpdate { lasts: Duration },
    /// The value has changed so often (2 to 100), by more than the deadband each time, `within` a time.
    Changes { count: u32, within: Duration, deadband: f64 },
    /// The device does not answer, or gives no values.
    NotResponding,
    /// The device has this signal of NE 107.
    Health { signal: Signal },
    /// The device takes longer for a response than its profile states.
    SlowerThanStated,
    /// The line is not connected although it should be.
    NotConnected,
    /// The line has no time for all of its polls: some are read less often.
    Overloaded,
    /// Another master asks on the line, which this station polls.
    OtherMaster,
    /// The station has this fault.
    Station(StationFault),
}

/// The four levels of a limit alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Level {
    /// Above the high-high limit.
    HighHigh,
    /// Above the high limit.
    High,
    /// Below the low limit.
    Low,
    /// Below the low-low limit.
    LowLow,
}

impl Condition {
    /// Looks back in time: starts over when the alarm is enabled.
    pub fn looks_back(self) -> bool {
        self.traits().looks_back
    }
    /// The tag that the value is compared with.
    pub fn reference(self) -> Option<TagId> {
        self.traits().reference
    }
    /// The limit that stands on the scale of the value itself.
    pub fn on_scale(self) -> Option<f64> {
        let traits = self.traits();
        traits.limit.filter(|_| traits.is_on_scale)
    }
    /// The limit that the journal names.
    pub fn limit(self) -> Option<f64> {
        self.traits().limit
    }
    /// The condition in signs, `> 72.0`; empty where the message alone says it. `number` writes a value of the watched
    /// tag, `name` another tag.
    pub fn text(self, number: impl Fn(f64) -> String, name: impl Fn(TagId) -> String) -> String {
        let traits = self.traits();
        match (self, traits.sign) {
            (Condition::State { is: known } | Condition::OtherThanStated { stated: known }, sign) => {
                format!("{sign} {}", number(known))
            }
            (Condition::Rate { limit, .. }, sign) => format!("{sign} {limit}/min"),
            (_, sign) => match (traits.limit, traits.reference) {
                (Some(limit), Some(from)) => format!("{sign} {} off {}", number(limit), name(from)),
                (Some(limit), None) => format!("{sign} {}", number(limit)),
                (None, _) => String::new(),
            },
        }
    }

    fn traits(self) -> Traits {
        let none = Traits { limit: None, is_on_scale: false, reference: None, looks_back: false, sign: ">" };
        match self {
            Condition::Limit { level: Level::High | Level::HighHigh, limit, .. } => {
                Traits { limit: Some(limit), is_on_scale: true, ..none }
            }
            Condition::Limit { level: Level::Low | Level::LowLow, limit, .. } => {
                Traits { limit: Some(limit), is_on_scale: true, sign: "<", ..none }
            }
            Condition::Deviation { from, limit, .. } => Traits { limit: Some(limit), reference: Some(from), ..none },
            Condition::State { .. } => Traits { sign: "=", ..none },
            Condition::OtherThanStated { .. } => Traits { sign: "≠", ..none },
            Condition::Rate { limit, .. } => {
                Traits { limit: Some(limit), looks_back: true, sign: if limit < 0.0 { "<" } else { ">" }, ..none }
            }
            Condition::NoChange { .. } | Condition::NoUpdate { .. } | Condition::Changes { .. } => {
                Traits { looks_back: true, ..none }
            }
            Condition::Bit { .. }
            | Condition::NotResponding
            | Condition::Health { .. }
            | Condition::SlowerThanStated
            | Condition::NotConnected
            | Condition::Overloaded
            | Condition::OtherMaster
            | Condition::Station(_) => none,
        }
    }
}

/// What the rest of the program needs to know of a condition.
struct Traits {
    limit: Option<f64>,
    is_on_scale: bool,
    reference: Option<TagId>,
    looks_back: bool,
    sign: &'static str,
}

/// What a condition is evaluated by. `None` is "unknown now".
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Facts {
    /// The good value of the tag, in its unit.
    pub value: Option<Exact>,
    /// The good value of the tag that a deviation is measured from.
    pub reference: Option<Exact>,
    /// For a device or line: whether it is in the state that the alarm reports.
    pub ill: Option<bool>,
    /// Whether the alarm is enabled by design.
    pub enabled: Option<bool>,
}

/// What a condition that looks back remembers. Instants are of the manager's own clock, which never goes back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ConditionMemory {
    /// Earlier values, or earlier changes, oldest first.
    points: VecDeque<(Duration, Exact)>,
    /// The value that "no change" counts from.
    from: Option<Exact>,
    /// How long there was no change, or no good value.
    lasted: Duration,
    /// When it was last asked.
    asked: Option<Duration>,
    /// Since when it remembers, and whether it has seen a change since.
    since: Option<Duration>,
    changed: bool,
}

impl ConditionMemory {
    /// Starts over.
    pub fn clear(&mut self) {
        self.points.clear();
        *self = ConditionMemory { points: std::mem::take(&mut self.points), ..ConditionMemory::default() };
    }

    /// The rate in units per minute over about this window; `None` until the window is full.
    fn rate(&mut self, value: Exact, now: Duration, over: Duration) -> Option<f64> {
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
        (over <= span).then(|| (value - then).near() / span.as_secs_f64() * 60.0)
    }

    /// How long the value has stayed where it is; time in which it is not known does not count.
    fn unchanged(&mut self, value: Exact, passed: Duration, deadband: f64) -> Duration {
        if self.from.is_some_and(|from| (value - from).near().abs() <= deadband) {
            self.lasted += passed;
        } else {
            self.changed |= self.from.is_some();
            (self.from, self.lasted) = (Some(value), Duration::ZERO);
        }
        self.lasted
    }

    /// Whether the value has changed `count` times within a time. Keeps no more changes than it needs.
    fn changes(&mut self, value: Exact, now: Duration, count: u32, within: Duration, deadband: f64) -> bool {
        let changed = self.from.is_some_and(|from| deadband < (value - from).near().abs());
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
pub fn holds(
    condition: Condition,
    facts: Facts,
    active: bool,
    memory: &mut ConditionMemory,
    now: Duration,
) -> Option<bool> {
    let back = |deadband: f64| if active { deadband } else { 0.0 };
    let passed = |memory: &mut ConditionMemory| now.saturating_sub(memory.asked.replace(now).unwrap_or(now));
    match condition {
        Condition::Limit { level: Level::High | Level::HighHigh, limit, deadband } => {
            facts.value.map(|value| value > Exact::from(limit - back(deadband)))
        }
        Condition::Limit { level: Level::Low | Level::LowLow, limit, deadband } => {
            facts.value.map(|value| value < Exact::from(limit + back(deadband)))
        }
        Condition::Deviation { from: _, limit, deadband } => {
            let distance = (facts.value? - facts.reference?).near().abs();
            Some(limit - back(deadband) < distance)
        }
        Condition::State { is } => facts.value.map(|value| value == is),
        Condition::OtherThanStated { stated } => facts.value.map(|value| value != stated),
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
            // After a restart it counts as calm only once it was watched for that long.
            let watched = within <= now.saturating_sub(*memory.since.get_or_insert(now));
            (busy || !active || watched).then_some(busy)
        }
        Condition::NotResponding
        | Condition::Health { .. }
        | Condition::SlowerThanStated
        | Condition::NotConnected
        | Condition::Overloaded
        | Condition::OtherMaster
        | Condition::Station(_) => facts.ill,
    }
}

/// Whether a bit of a word is set. A word with a sign has its highest bit set while it is negative.
pub fn is_set(value: Exact, bit: u8) -> bool {
    value.bits().checked_shr(u32::from(bit)).unwrap_or(0) & 1 == 1
}

#[cfg(test)]
mod tests;
