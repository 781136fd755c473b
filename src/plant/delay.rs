//! Delays of a calculated condition: on-delay and off-delay timers (TON and TOF of IEC 61131-3).

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{keyword::keyword_enum, sample::Sample, time::elapsed};

keyword_enum! {
    /// Which change of the condition is delayed; the word stands before the parenthesis of `expr`.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Edge: "delay" {
        /// It becomes true once the condition has been true for the whole time.
        On => "on_delay",
        /// It becomes false once the condition has been false for the whole time.
        Off => "off_delay",
    }
}

/// A delay of so much time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Delay {
    /// What is delayed.
    pub edge: Edge,
    /// By how much.
    pub time: Duration,
}

/// A delay at work.
#[derive(Debug, Clone)]
pub struct DelayTimer {
    delay: Delay,
    /// The condition, since when, and the delayed one; `None` at first, and while the condition is bad.
    last: Option<(bool, Timestamp, bool)>,
}

impl DelayTimer {
    /// Before the first input.
    pub fn new(delay: Delay) -> DelayTimer {
        DelayTimer { delay, last: None }
    }

    /// The delayed condition with the next sample of its input, as good as that. After a bad one, and at the start, an on-delay
    /// begins again, and an off-delay is what its condition is.
    pub fn add(&mut self, input: Sample) -> Sample {
        let Some(value) = input.value else {
            self.last = None;
            return input;
        };
        let now = value != 0.0;
        let since = match self.last {
            Some((before, since, _)) if before == now => since,
            Some(_) | None => input.at,
        };
        let over = self.delay.time <= elapsed(since, input.at);
        let held = self.last.is_some_and(|(.., delayed)| delayed);
        let delayed = match self.delay.edge {
            Edge::On => now && (over || held),
            Edge::Off => now || (!over && held),
        };
        self.last = Some((now, since, delayed));
        Sample { value: Some(f64::from(u8::from(delayed))), ..input }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sample::Cause;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn check(edge: Edge, inputs: &[(i64, Option<f64>)], expect: &[Option<f64>]) {
        let mut timer = DelayTimer::new(Delay { edge, time: Duration::from_secs(10) });
        let sample = |(second, value): &(i64, Option<f64>)| match value {
            Some(value) => Sample::good(*value, at(*second)),
            None => Sample::bad(Cause::Timeout, at(*second)),
        };
        let found: Vec<Option<f64>> = inputs.iter().map(|input| timer.add(sample(input)).value).collect();
        assert_eq!(found, expect, "{edge:?} {inputs:?}");
    }

    #[test]
    fn a_condition_is_true_after_the_whole_on_delay() {
        const ON: Option<f64> = Some(1.0);
        const OFF: Option<f64> = Some(0.0);
        check(Edge::On, &[(0, OFF), (1, ON), (10, ON), (11, ON), (12, OFF)], &[OFF, OFF, OFF, ON, OFF]);
        check(Edge::On, &[(0, ON), (9, OFF), (10, ON), (19, ON), (20, ON)], &[OFF, OFF, OFF, OFF, ON]);
        check(Edge::On, &[(0, ON), (5, None), (6, ON), (15, ON), (16, ON)], &[OFF, None, OFF, OFF, ON]);
        check(Edge::Off, &[(0, ON), (1, OFF), (10, OFF), (11, OFF), (12, ON)], &[ON, ON, ON, OFF, ON]);
        check(Edge::Off, &[(0, OFF), (1, ON), (2, OFF), (11, ON), (12, OFF)], &[OFF, ON, ON, ON, ON]);
        check(Edge::Off, &[(0, ON), (1, OFF), (2, None), (3, OFF)], &[ON, ON, None, OFF]);
    }

    #[test]
    fn a_delayed_condition_is_as_good_as_its_input() {
        let mut timer = DelayTimer::new(Delay { edge: Edge::On, time: Duration::from_secs(1) });
        timer.add(Sample::good(1.0, at(0)));
        let uncertain = Sample::good(1.0, at(2)).uncertain(Cause::Stale);
        assert_eq!(timer.add(uncertain), uncertain);
    }
}
