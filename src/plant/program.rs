//! A ramp/soak program: which tags command and show it, and how long it has been in its step.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::id::TagId;
use crate::plant::{number::to_usize, time::elapsed};

/// The tags of a controller's ramp/soak program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProgramDef {
    /// Where it is: 0 off, 1 ramp 1, 2 soak 1, 3 ramp 2 …, and beyond the last soak: ended (PXR 31009).
    pub position: TagId,
    /// Starts, holds and stops it.
    pub command: TagId,
    /// The value of the command that runs it.
    pub run: f64,
    /// The value that holds it where it is, if it can be held.
    pub halt: Option<f64>,
    /// The value that stops it.
    pub off: f64,
    /// Chooses steps to run.
    pub pattern: Option<TagId>,
    /// First and last step, from 0, of each pattern, by the pattern's value; empty: every step is always run.
    pub patterns: Vec<(usize, usize)>,
    /// What happens at its end and at power-on.
    pub mode: Option<TagId>,
    /// Its steps; at least one.
    pub steps: Vec<ProgramStep>,
}

/// A step: to a target in a time, then staying there for a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProgramStep {
    /// The target.
    pub sv: TagId,
    /// Time to reach it.
    pub ramp: TagId,
    /// Time to stay.
    pub soak: TagId,
}

/// Where a program is, in words of its definition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ProgramPosition {
    /// Not running.
    Off,
    /// On its way to the target of a step, from 0.
    Ramp(usize),
    /// Staying at the target of a step, from 0.
    Soak(usize),
    /// All steps are done.
    Ended,
}

impl ProgramDef {
    /// What a value of the position means.
    pub fn place(&self, position: f64) -> ProgramPosition {
        let number = to_usize(position.max(0.0));
        match number.checked_sub(1) {
            None => ProgramPosition::Off,
            Some(half) if half / 2 >= self.steps.len() => ProgramPosition::Ended,
            Some(half) if half % 2 == 0 => ProgramPosition::Ramp(half / 2),
            Some(half) => ProgramPosition::Soak(half / 2),
        }
    }
    /// The steps that a pattern runs, first and last, from 0; `None` for a pattern that the profile does not describe.
    pub fn steps_of(&self, pattern: Option<f64>) -> Option<(usize, usize)> {
        match (self.pattern, self.patterns.is_empty()) {
            (None, _) | (_, true) => Some((0, self.steps.len().saturating_sub(1))),
            (Some(_), false) => self.patterns.get(to_usize(pattern?)).copied(),
        }
    }
}

/// How long a program has been where it is. The device does not report it: it is counted here, without the time in halt.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ProgramWatch {
    position: Option<f64>,
    /// Time in this position; at least so long if its beginning was not seen.
    into: Duration,
    seen: bool,
    at: Option<Timestamp>,
}

impl ProgramWatch {
    /// What is known at `at`: the position and the command, `None` where they are not good.
    pub fn observe(&mut self, def: &ProgramDef, position: Option<f64>, command: Option<f64>, at: Timestamp) {
        let since = self.at.replace(at).map_or(Duration::ZERO, |before| elapsed(before, at));
        match (position, self.position) {
            // What happens while the position is unknown is not counted, and that is remembered.
            (None, _) => self.seen = false,
            (Some(now), Some(before)) if now == before => {
                if command == Some(def.run) {
                    self.into += since;
                }
            }
            (Some(now), before) => {
                *self =
                    ProgramWatch { position: Some(now), into: Duration::ZERO, seen: before.is_some(), at: Some(at) };
            }
        }
    }
    /// Time in the present position, and whether its beginning was seen: if not, it is the least it can be.
    pub fn elapsed(&self) -> Option<(Duration, bool)> {
        self.position.map(|_| (self.into, self.seen))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn def() -> ProgramDef {
        let step = |n: u16| ProgramStep { sv: TagId(n), ramp: TagId(n + 1), soak: TagId(n + 2) };
        ProgramDef {
            position: TagId(0),
            command: TagId(1),
            run: 1.0,
            halt: Some(2.0),
            off: 0.0,
            pattern: Some(TagId(2)),
            patterns: vec![(0, 0), (1, 1), (0, 1)],
            mode: None,
            steps: vec![step(3), step(6)],
        }
    }

    #[test]
    fn a_position_is_a_ramp_or_a_soak_of_a_step() {
        let check = |position, expect| assert_eq!(def().place(position), expect, "{position}");
        check(0.0, ProgramPosition::Off);
        check(1.0, ProgramPosition::Ramp(0));
        check(2.0, ProgramPosition::Soak(0));
        check(4.0, ProgramPosition::Soak(1));
        check(5.0, ProgramPosition::Ended);
        check(17.0, ProgramPosition::Ended);
        assert_eq!(def().steps_of(Some(2.0)), Some((0, 1)));
        assert_eq!(def().steps_of(Some(3.0)), None, "the profile does not say what pattern 3 is");
        assert_eq!(def().steps_of(None), None);
    }

    #[test]
    fn time_in_halt_does_not_count_and_an_unseen_begin_is_shown() {
        let at = |second| Timestamp::from_second(second).expect("a small number");
        let mut watch = ProgramWatch::default();
        let mut check = |second, position: Option<f64>, command: f64, expect: Option<(u64, bool)>| {
            watch.observe(&def(), position, Some(command), at(second));
            let expect = expect.map(|(seconds, seen)| (Duration::from_secs(seconds), seen));
            assert_eq!(watch.elapsed(), expect, "at {second}");
        };
        check(0, None, 1.0, None);
        check(10, Some(1.0), 1.0, Some((0, false)));
        check(40, Some(1.0), 1.0, Some((30, false)));
        check(50, Some(2.0), 1.0, Some((0, true)));
        check(80, Some(2.0), 1.0, Some((30, true)));
        check(100, Some(2.0), 2.0, Some((30, true)));
        check(110, Some(2.0), 1.0, Some((40, true)));
        check(120, None, 1.0, Some((40, false)));
    }
}
