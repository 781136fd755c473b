//! A sweep: which addresses of a table a unit answers at.

use crate::t;
use serde::{Deserialize, Serialize};

use super::{
    fault::{ExceptionCode, Fault},
    tag::Table,
};

/// Most addresses between two that are asked alone.
pub const EVERY_MAX: u8 = 64;
/// The usual choice: every range of eight or more is found.
pub const EVERY_USUAL: u8 = 8;

/// Reads a table in blocks. In a block that is refused, one address of every `every` is asked alone, and around those that
/// answer each one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sweep {
    /// Who is asked.
    pub unit: u8,
    /// Which table.
    pub table: Table,
    /// First address, 0-based.
    pub first: u16,
    /// Last address.
    pub last: u16,
    /// 1: each address of a refused block is asked alone; 8: ranges shorter than eight may be missed.
    pub every: u8,
}

impl Sweep {
    /// Addresses from the first to the last.
    pub fn addresses(&self) -> u32 {
        (u32::from(self.last) + 1).saturating_sub(u32::from(self.first))
    }

    /// Registers or bits of one block: a multiple of `every` that fits one request.
    pub fn block(&self) -> u16 {
        let (most, every) = (if self.table.is_bits() { 2_000 } else { 125 }, u16::from(self.every.max(1)));
        most / every * every
    }

    /// Requests in whole blocks if all of it answers, and those that ask one address each if all of it is refused.
    pub fn requests(&self) -> (u32, u32) {
        (self.addresses().div_ceil(u32::from(self.block())), self.addresses().div_ceil(u32::from(self.every.max(1))))
    }

    /// Can a line carry it? `Err` says why not.
    pub(super) fn check(&self) -> Result<(), String> {
        let Sweep { first, last, every, .. } = *self;
        if last < first {
            return Err(t!("addresses {first} to {last}: the first is greater than the last", first, last));
        }
        if !(1..=EVERY_MAX).contains(&every) {
            return Err(t!("every {every} addresses: expected 1 to 64", every));
        }
        Ok(())
    }
}

/// Neighbouring addresses with the same outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SweptRange {
    /// First address, 0-based.
    pub first: u16,
    /// Last address.
    pub last: u16,
    /// What became of them.
    pub outcome: SweptOutcome,
}

/// What became of an address.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SweptOutcome {
    /// It has a value.
    Answers,
    /// The unit refuses it, alone or with those around it.
    Refused(ExceptionCode),
    /// Nothing came, or nothing that could be used: what is there is not known.
    Silent(Fault),
}
