//! Decimals of a value: how many are shown, and how a device says by which power of ten it is scaled.

use serde::{Deserialize, Serialize};

use super::{id::TagId, number::to_i8, number::to_u8};

/// Decimals of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Decimals {
    /// Always this many; they do not scale.
    Fixed(u8),
    /// Another tag says how many decimals the raw number has: it scales by 10^-n and shows n.
    From(TagId),
    /// Another tag holds a power of ten by which the raw number is multiplied (SunSpec `sunssf`). Value and power are taken
    /// from one cycle.
    PowerFrom(TagId),
}

impl Decimals {
    /// Most decimals that a value can have.
    pub const MAX: u8 = 6;
    /// Largest power of ten that a device can announce, to either side (SunSpec, `sunssf`).
    pub const POWER_MAX: i8 = 10;

    /// The tag that holds them.
    pub fn source(self) -> Option<TagId> {
        match self {
            Decimals::From(tag) | Decimals::PowerFrom(tag) => Some(tag),
            Decimals::Fixed(_) => None,
        }
    }

    /// The tag that holds a power of ten.
    pub fn power_source(self) -> Option<TagId> {
        match self {
            Decimals::PowerFrom(tag) => Some(tag),
            Decimals::Fixed(_) | Decimals::From(_) => None,
        }
    }

    /// The decimals that scale a raw number when the register that announces them holds this: below 0 for a multiple of ten.
    /// `None` where it holds what is no number of decimals, or no power of ten: any other would scale every value to nothing.
    pub fn announced(self, value: f64) -> Option<i8> {
        let (least, most) = self.possible();
        let decimals = match self {
            Decimals::Fixed(_) => return Some(0),
            Decimals::From(_) => value,
            Decimals::PowerFrom(_) => -value,
        };
        (value.fract() == 0.0 && (f64::from(least)..=f64::from(most)).contains(&decimals)).then(|| to_i8(decimals))
    }

    /// The fewest and the most decimals that can be announced.
    pub fn possible(self) -> (i8, i8) {
        match self {
            Decimals::Fixed(_) => (0, 0),
            Decimals::From(_) => (0, to_i8(Decimals::MAX)),
            Decimals::PowerFrom(_) => (-Decimals::POWER_MAX, Decimals::POWER_MAX),
        }
    }

    /// How many are shown of so many that scale.
    pub fn shown(scaling: i8) -> u8 {
        to_u8(scaling).min(Decimals::MAX)
    }
}
