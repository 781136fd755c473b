//! How a simulated device fills a tag, as its profile says: what `demo`, `sim` and tests serve instead of the real device.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::id::TagId;

/// How the simulated value of a tag comes about. All numbers are in the tag's unit, times are plant time.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Simulate {
    /// The value when the device is switched on; without it 0, or what is nearest to 0 of what the tag may be.
    pub start: Option<f64>,
    /// The first case that is so gives the value.
    pub cases: Vec<Case>,
    /// How the value moves while no case is so; without it the value holds.
    pub motion: Option<Motion>,
    /// The value never leaves this range.
    pub range: Option<[f64; 2]>,
    /// The registers show the value with so much noise to either side.
    pub noise: f64,
    /// The value goes back to 0 this long after it has become something else: a command that resets itself.
    pub pulse: Option<Duration>,
}

/// A value for when something is so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// All of them must be so.
    pub when: Vec<Check>,
    /// The value then.
    pub value: f64,
}

/// A condition on another tag.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// The tag that is asked.
    pub tag: TagId,
    /// Only these bits of its number: lowest bit and how many.
    pub field: Option<(u8, u8)>,
    /// What is asked.
    pub test: Test,
}

/// What a value is compared with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Test {
    /// It is not 0.
    On,
    /// It is one of these.
    Is(Vec<f64>),
    /// It is greater.
    Above(f64),
    /// It is less.
    Below(f64),
}

/// A value that moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Where it goes.
    pub source: Source,
    /// Multiplies what the source gives.
    pub gain: f64,
    /// Added then.
    pub offset: f64,
    pub pace: Pace,
    /// It moves while all of these are so.
    pub when: Vec<Check>,
    /// Where it goes while they are not; without it, it stays where it is.
    pub idle: Option<f64>,
}

/// Where a moving value goes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Source {
    /// Slowly up and down between two values, the same in every run.
    Oscillation {
        /// Lowest and highest value.
        range: [f64; 2],
        /// The longer of its two swings.
        period: Duration,
    },
    /// To what other tags make.
    Of(Operation, Vec<TagId>),
    /// It adds up another tag: a counter of energy from power.
    Integral {
        of: TagId,
        /// The time in which a constant 1 adds 1.
        time_base: Duration,
    },
}

/// What is made of other tags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Operation {
    Sum,
    Mean,
    Product,
    /// The first less the others.
    Difference,
    /// The first over the second; 0 over 0.
    Quotient,
    /// Reactive power: the root of the first squared less the squares of the others (apparent and active power).
    Reactive,
    /// The angle in degrees whose cosine it is: from a power factor.
    Angle,
}

/// How fast a value follows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Pace {
    AtOnce,
    /// By so much a second.
    Rate(f64),
    /// By two thirds of the way in this time.
    Lag(Duration),
}

impl Simulate {
    /// The tags that it asks or follows.
    pub fn sources(&self) -> impl Iterator<Item = TagId> + '_ {
        let asked = self.cases.iter().flat_map(|case| &case.when);
        let of_motion = self.motion.iter().flat_map(|motion| {
            let followed = match &motion.source {
                Source::Oscillation { .. } => Vec::new(),
                Source::Of(_, tags) => tags.clone(),
                Source::Integral { of, .. } => vec![*of],
            };
            followed.into_iter().chain(motion.when.iter().map(|check| check.tag))
        });
        asked.map(|check| check.tag).chain(of_motion)
    }
}
