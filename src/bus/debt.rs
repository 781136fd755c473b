//! Protection against late answers where frames carry no transaction id (RTU and ASCII).
//!
//! After a timeout a unit *owes* an answer. It may come at any later moment and would then be taken for the answer to the
//! next request of the same shape: the value of another tag, called good. So while a unit owes, only a request is sent
//! whose answer cannot be mistaken for an owed one. A serial device answers in order; a valid answer to such a request
//! therefore proves that nothing older is still to come, and the debt is cleared.
//!
//! A unit that was never asked before may owe an answer to an earlier process that was killed, and one that sends what it was
//! not asked for may do so again: both are *unproven*, and are first asked something that is no usual block of theirs.

use std::time::Duration;

use super::{
    frame::{Shape, shape_of},
    plan::Block,
};

/// Most answers that are remembered as owed; a unit that owes more is asked nothing until it has rested.
const OWED_MAX: usize = 16;

/// Usual shapes that are remembered of a unit; one with more is brought into step by a loopback.
const USUAL_MAX: usize = 64;

/// A unit rests no longer than this, however late it seems to have been.
const REST_MAX: Duration = Duration::from_secs(600);

/// What one unit owes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Debt {
    owed: Vec<Shape>,
    /// A loopback is owed: the next *refusal* of a loopback may be the answer to that one.
    loopback: bool,
    /// Functions whose answers have no shape (identification, event log) that are owed.
    functions: Vec<u8>,
    /// Shapes of the blocks that the unit is asked for.
    usual: Vec<Shape>,
    /// It may owe an answer of a usual shape that this line has not asked for.
    unproven: bool,
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

    /// A request of a function whose answers have no shape was not answered in time.
    fn owe_function(&mut self, function: u8) {
        if !self.functions.contains(&function) {
            self.functions.push(function);
        }
    }

    /// Could an answer of this shape be an owed one?
    pub fn is_ambiguous(&self, shape: Shape) -> bool {
        let usual = self.unproven && (self.usual.contains(&shape) || self.usual.len() == USUAL_MAX);
        !shape.is_loopback() && (usual || self.owed.contains(&shape) || self.owed.len() == OWED_MAX)
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
        *self = Debt { usual: std::mem::take(&mut self.usual), ..Debt::default() };
    }

    /// Does the unit owe nothing?
    pub fn is_clear(&self) -> bool {
        self.owed.is_empty() && self.functions.is_empty() && !self.loopback && !self.unproven
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

/// What all units of a line owe, and how late they have ever been. It outlives an opening: what was asked before a port
/// was closed may be answered when it is open again. Times are spans since the line began.
#[derive(Debug, Clone)]
pub struct Debts {
    units: Vec<Unit>,
    /// How long an answer may take.
    timeout: Duration,
    /// Numbers of loopbacks.
    loopbacks: u16,
}

#[derive(Debug, Clone, Default)]
struct Unit {
    debt: Debt,
    /// How late an owed answer has ever come, its timeout included.
    late_max: Duration,
    /// When it last failed to answer in time.
    failed_at: Option<Duration>,
    /// When it last sent what it was not asked for, unless it has been brought into step since.
    unasked_at: Option<Duration>,
    /// Its last good answer, and whether that came again.
    answer: Vec<u8>,
    repeats: bool,
}

impl Unit {
    fn in_step(&mut self) {
        self.debt.clear();
        (self.failed_at, self.unasked_at) = (None, None);
    }
}

impl Debts {
    /// Nobody owes anything. The numbers of loopbacks begin behind `seed`, which differs from process to process.
    pub fn new(timeout: Duration, seed: u16) -> Debts {
        Debts { units: vec![Unit::default(); 256], timeout, loopbacks: seed }
    }

    /// These blocks are asked for from now on; a unit that was asked for none before is unproven.
    pub fn expect(&mut self, blocks: &[Block]) {
        for (unit, known) in (0..).zip(&mut self.units) {
            let debt = &mut known.debt;
            let first = debt.usual.is_empty();
            debt.usual.clear();
            for shape in blocks.iter().filter(|block| block.unit == unit).filter_map(|block| shape_of(&block.request()))
            {
                if !debt.usual.contains(&shape) && debt.usual.len() < USUAL_MAX {
                    debt.usual.push(shape);
                }
            }
            debt.unproven |= first && !debt.usual.is_empty();
        }
    }

    /// A unit has answered, `proof` if this cannot have been an older answer. One that sends each answer again rests after
    /// each block until the repetition must have come.
    pub fn answered(&mut self, request: &[u8], answer: &[u8], proof: bool, now: Duration) {
        let Some(unit) = request.first().map(|unit| usize::from(*unit)) else { return };
        let unsettled = self.is_unsettled(unit as u8, now);
        let unit = &mut self.units[unit];
        if proof && !unsettled {
            unit.in_step();
        }
        answer.clone_into(&mut unit.answer);
        let is_usual = shape_of(request).is_some_and(|shape| unit.debt.usual.contains(&shape));
        if is_usual && std::mem::take(&mut unit.repeats) {
            unit.debt.unproven = true;
            unit.unasked_at = Some(now);
        }
    }

    /// A good frame of this unit came that nobody had asked for. `true` if that puts what was read of it into doubt.
    pub fn unasked(&mut self, unit: u8, message: &[u8], now: Duration) -> bool {
        let unit = &mut self.units[usize::from(unit)];
        if unit.answer == message {
            unit.repeats = true;
            let usual = unit.debt.usual.iter().any(|shape| shape.fits(message));
            if usual {
                unit.debt.unproven = true;
                unit.unasked_at = Some(now);
            }
            return false;
        }
        let was_in_step = unit.debt.is_clear() && !unit.debt.usual.is_empty();
        if was_in_step || unit.unasked_at.is_some() {
            unit.debt.unproven = true;
            unit.unasked_at = Some(now);
        }
        was_in_step
    }

    /// Another master asks on this line: any unit may be answering it.
    pub fn distrust_all(&mut self) {
        for unit in self.units.iter_mut().filter(|unit| !unit.debt.usual.is_empty()) {
            unit.debt.unproven = true;
        }
    }

    /// Has this unit sent within one timeout what it was not asked for? Nothing that it sends now proves anything.
    pub fn is_unsettled(&self, unit: u8, now: Duration) -> bool {
        let unasked_at = self.units[usize::from(unit)].unasked_at;
        unasked_at.is_some_and(|at| now.saturating_sub(at) < self.timeout)
    }

    /// Other settings: an answer may take this long from now on.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// What a unit owes.
    pub fn of(&self, unit: u8) -> &Debt {
        &self.units[usize::from(unit)].debt
    }

    /// Could the answer to this message be mistaken for one that its unit still owes?
    pub fn is_ambiguous(&self, message: &[u8]) -> bool {
        let Some(unit) = message.first() else { return false };
        let debt = self.of(*unit);
        match (shape_of(message), message.get(1)) {
            (Some(shape), _) => debt.is_ambiguous(shape),
            (None, Some(function)) => debt.unproven || debt.functions.contains(function),
            (None, None) => false,
        }
    }

    /// Nothing older than its last answer can come from this unit any more.
    pub fn clear(&mut self, unit: u8) {
        self.units[usize::from(unit)].in_step();
    }

    /// A request was not answered, or only by something spoiled.
    pub fn failed(&mut self, message: &[u8], now: Duration) {
        let Some(unit) = message.first().map(|unit| &mut self.units[usize::from(*unit)]) else { return };
        let shape = shape_of(message);
        match (shape, message.get(1)) {
            (Some(shape), _) => unit.debt.owe(shape),
            (None, Some(function)) => unit.debt.owe_function(*function),
            (None, None) => {}
        }
        // Patience counts from the last request that may be answered late; a loopback cannot be mistaken.
        if !shape.is_some_and(Shape::is_loopback) {
            unit.failed_at = Some(now);
        }
    }

    /// Bytes of this unit came that nobody waits for. `true` if it owed them.
    pub fn came_late(&mut self, unit: u8, now: Duration) -> bool {
        let timeout = self.timeout;
        let unit = &mut self.units[usize::from(unit)];
        let Some(failed_at) = unit.failed_at.filter(|_| !unit.debt.is_clear()) else { return false };
        unit.late_max = unit.late_max.max(now.saturating_sub(failed_at) + timeout);
        true
    }

    /// The next loopback of a unit, with a number of its own.
    pub fn next_loopback(&mut self, unit: u8) -> [u8; 6] {
        self.loopbacks = self.loopbacks.wrapping_add(1);
        loopback(unit, self.loopbacks)
    }

    /// For a unit that no probe can bring into step: how much longer it must rest before its debt may be forgotten,
    /// `None` once it is forgotten. For each answer that it owes it rests twice as long as it has ever been late, ten
    /// timeouts at the least: patience, not proof, and needed only for devices that do not answer a loopback at all.
    pub fn forget(&mut self, unit: u8, now: Duration) -> Option<Duration> {
        let unit = &mut self.units[usize::from(unit)];
        let each = (2 * unit.late_max).max(10 * self.timeout);
        let rest = (each * unit.debt.count().max(1) as u32).min(REST_MAX);
        let waited = unit.failed_at.map_or(rest, |failed_at| now.saturating_sub(failed_at));
        if waited < rest {
            return Some(rest - waited);
        }
        unit.in_step();
        None
    }
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

    #[test]
    fn a_unit_that_was_late_must_rest_longer() {
        let s = Duration::from_secs;
        let mut debts = Debts::new(s(1), 0);
        let request = [1, 3, 0, 0, 0, 2];
        assert_eq!(debts.forget(1, s(0)), None, "who owes nothing has nothing to forget");
        debts.failed(&request, s(100));
        assert!(debts.is_ambiguous(&request) && !debts.is_ambiguous(&[2, 3, 0, 0, 0, 2]));
        assert_eq!(debts.forget(1, s(104)), Some(s(6)), "ten timeouts");
        assert!(debts.came_late(1, s(108)) && !debts.came_late(2, s(108)));
        assert_eq!(debts.forget(1, s(110)), Some(s(8)), "twice the 9 s that it was late");
        assert_eq!(debts.forget(1, s(118)), None);
        assert!(!debts.is_ambiguous(&request));
    }
}
