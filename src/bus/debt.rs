//! Protection against late answers where frames carry no transaction id (RTU).
//!
//! After a timeout a unit *owes* an answer. It may come at any later moment and would then be taken for the answer to the
//! next request of the same shape: the value of another tag, called good. So while a unit owes, only a request is sent
//! whose answer cannot be mistaken for an owed one. A serial device answers in order; a valid answer to such a request
//! therefore proves that nothing older is still to come, and the debt is cleared.

use super::{
    frame::{Shape, shape_of},
    plan::Block,
};

/// Most answers that are remembered as owed; a unit that owes more is asked nothing until it has rested.
const OWED_MAX: usize = 16;

/// What one unit owes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Debt {
    owed: Vec<Shape>,
    /// A loopback is owed: the next *refusal* of a loopback may be the answer to that one.
    loopback: bool,
}

impl Debt {
    /// A request of this shape was not answered in time.
    pub fn owe(&mut self, shape: Shape) {
        if shape.is_loopback() {
            self.loopback = true;
        } else if !self.owed.contains(&shape) && self.owed.len() < OWED_MAX {
            self.owed.push(shape);
        }
    }

    /// Could an answer of this shape be an owed one?
    pub fn is_ambiguous(&self, shape: Shape) -> bool {
        !shape.is_loopback() && (self.owed.contains(&shape) || self.owed.len() == OWED_MAX)
    }

    /// Does the refusal of a loopback (exception 01, by devices that do not have it) prove as much as its echo?
    pub fn refusal_proves(&self) -> bool {
        !self.loopback
    }

    /// How many shapes are owed.
    pub fn count(&self) -> usize {
        self.owed.len()
    }

    /// Nothing older can come any more.
    pub fn clear(&mut self) {
        *self = Debt::default();
    }

    /// Does the unit owe nothing?
    pub fn is_clear(&self) -> bool {
        self.owed.is_empty() && !self.loopback
    }

    /// A read that brings the unit back into step: part of a block that is read anyway, with a count whose answer cannot
    /// be mistaken. `None`: there is none, see [`loopback`].
    pub fn probe<'a>(&self, blocks: impl Iterator<Item = &'a Block>) -> Option<[u8; 6]> {
        blocks.flat_map(probes).find(|request| shape_of(request).is_some_and(|shape| !self.is_ambiguous(shape)))
    }
}

/// Diagnostics 08 / 00, return query data: the request comes back as it was sent, so with a number of its own it cannot be
/// mistaken for anything (Modbus application protocol V1.1b3, 6.8). It changes nothing in the device.
pub fn loopback(unit: u8, number: u16) -> [u8; 6] {
    let [high, low] = number.to_be_bytes();
    [unit, 0x08, 0, 0, high, low]
}

/// Reads of the first part of a block, the shortest first: each has a shape of its own.
fn probes(block: &Block) -> impl Iterator<Item = [u8; 6]> {
    let (first, step) = if block.table.is_bits() { (1, 8) } else { (block.alignment.max(1), block.alignment.max(1)) };
    let counts = (first..block.count).step_by(usize::from(step)).chain([block.count]);
    let block = block.clone();
    counts.map(move |count| Block { count, ..block.clone() }.request())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::{
        bus::plan,
        plant::{def::LineId, fixture},
    };

    #[test]
    fn a_probe_is_never_of_an_owed_shape() {
        let blocks = plan::blocks(&fixture::plant(), LineId(0), &plan::Holes::default());
        let inputs = &blocks[0];
        let mut debt = Debt::default();
        assert!(debt.is_clear());
        let mut asked = Vec::new();
        // Every probe in vain is owed too; each next one differs until the block has no more shapes to offer.
        debt.owe(shape_of(&inputs.request()).unwrap());
        assert!(debt.is_ambiguous(shape_of(&inputs.request()).unwrap()));
        while let Some(probe) = debt.probe([inputs].into_iter()) {
            assert!(!asked.contains(&probe));
            assert!(probe[5] < inputs.count as u8);
            debt.owe(shape_of(&probe).unwrap());
            asked.push(probe);
        }
        assert_eq!(asked.len(), 7, "one to seven of eight registers");
        debt.clear();
        assert!(!debt.is_ambiguous(shape_of(&inputs.request()).unwrap()));
    }

    #[test]
    fn a_unit_that_owes_too_much_is_asked_nothing() {
        let mut debt = Debt::default();
        for count in 1..=OWED_MAX as u8 {
            debt.owe(shape_of(&[1, 3, 0, 0, 0, count]).unwrap());
        }
        assert!(debt.is_ambiguous(shape_of(&[1, 4, 0, 0, 0, 99]).unwrap()));
    }

    #[test]
    fn a_loopback_is_never_ambiguous_and_its_first_refusal_is_proof() {
        let mut debt = Debt::default();
        let shape = |number| shape_of(&loopback(1, number)).unwrap();
        assert!(debt.refusal_proves());
        debt.owe(shape(7));
        assert!(!debt.is_clear() && !debt.refusal_proves());
        assert!(!debt.is_ambiguous(shape(8)));
        debt.clear();
        assert!(debt.is_clear() && debt.refusal_proves());
    }

    #[test]
    fn writes_are_told_apart_by_their_echo() {
        let mut debt = Debt::default();
        debt.owe(shape_of(&[1, 6, 0, 1, 0, 5]).unwrap());
        assert!(!debt.is_ambiguous(shape_of(&[1, 6, 0, 1, 0, 6]).unwrap()));
        assert!(debt.is_ambiguous(shape_of(&[1, 6, 0, 1, 0, 5]).unwrap()));
    }
}
