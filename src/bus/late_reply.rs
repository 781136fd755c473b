//! Protection against late answers where frames carry no transaction id (RTU and ASCII).
//!
//! After a timeout a reply is *outstanding*. It may come at any later moment and would then be taken for the answer to the
//! next request of the same signature: the value of another tag, called good. So while a reply is outstanding, only a request is sent
//! whose answer cannot be mistaken for an outstanding one. A serial device answers in order; a valid answer to such a request
//! therefore proves that nothing older is still to come, and nothing is outstanding any more.
//!
//! A unit whose outstanding reply comes after such a proof does not answer in order: from then on only the outstanding reply itself, or
//! time, clears what is outstanding.
//!
//! A unit that was never asked before may still answer an earlier process that was killed, and one that sends what it was
//! not asked for may do so again: both are *unproven*, and are first asked something that is no usual block of theirs.

mod unit;

use std::time::Duration;

pub use unit::Proof;
use unit::Unit;

use super::{
    frame::{Request, ResponseSignature, response_signature},
    pdu::Pdu,
    plan::Block,
    wide_addresses::WideAddresses,
};
use crate::plant::number::{to_u8, to_u32};

/// Most answers that are remembered as outstanding; with more, the unit is not polled until it has paused.
const OUTSTANDING_MAX: usize = 16;

/// Usual signatures that are remembered of a unit; one with more is resynchronised by a loopback.
const USUAL_MAX: usize = 64;

/// A unit is left alone so many times as long while no other unit of its line answers either.
const STANDSTILL_FACTOR: u32 = 10;

/// A unit is left alone no longer than this, however late it seems to have been.
const REST_MAX: Duration = Duration::from_secs(600);

/// Outstanding replies of one unit.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct OutstandingReplies {
    signatures: Vec<ResponseSignature>,
    /// A loopback is outstanding: the next *refusal* of a loopback may be the answer to that one.
    loopback: bool,
    /// Functions whose answers have no signature (identification, event log) that are outstanding.
    functions: Vec<u8>,
    /// Response signatures of the blocks that the unit is asked for.
    usual: Vec<ResponseSignature>,
    /// A reply of a usual signature may be outstanding that this line has not asked for.
    unproven: bool,
}

impl OutstandingReplies {
    /// A request of this signature was not answered in time.
    pub fn add(&mut self, signature: ResponseSignature) {
        if signature.is_loopback() {
            self.loopback = true;
        } else if !self.signatures.contains(&signature) && self.signatures.len() < OUTSTANDING_MAX {
            self.signatures.push(signature);
        }
    }

    /// A request of a function whose answers have no signature was not answered in time.
    fn add_function(&mut self, function: u8) {
        if !self.functions.contains(&function) {
            self.functions.push(function);
        }
    }

    /// Could an answer of this signature be an outstanding one?
    pub fn is_ambiguous(&self, signature: ResponseSignature) -> bool {
        let usual = self.unproven && (self.usual.contains(&signature) || self.usual.len() == USUAL_MAX);
        !signature.is_loopback()
            && (usual || self.signatures.contains(&signature) || self.signatures.len() == OUTSTANDING_MAX)
    }

    /// Is a reply of this signature outstanding?
    fn contains(&self, signature: ResponseSignature) -> bool {
        self.signatures.contains(&signature)
    }

    /// Does the refusal of a loopback (exception 01, by devices that do not have it) prove as much as its echo?
    pub fn refusal_proves(&self) -> bool {
        !self.loopback
    }

    /// How many signatures are outstanding.
    pub fn count(&self) -> usize {
        self.signatures.len()
    }

    /// Nothing older can come any more.
    pub fn clear(&mut self) {
        *self = OutstandingReplies { usual: std::mem::take(&mut self.usual), ..OutstandingReplies::default() };
    }

    /// Is nothing outstanding?
    pub fn is_clear(&self) -> bool {
        self.signatures.is_empty() && self.functions.is_empty() && !self.loopback && !self.unproven
    }

    /// A read that resynchronises the unit: part of a block that is read anyway, with a count whose answer cannot
    /// be mistaken. `None`: there is none, see [`loopback`].
    pub fn probe<'a>(&self, blocks: impl Iterator<Item = &'a Block>) -> Option<Vec<u8>> {
        blocks
            .flat_map(probes)
            .find(|probe| signature_of(probe).is_some_and(|signature| !self.is_ambiguous(signature)))
            .map(|probe| probe.request())
    }
}

/// Diagnostics 08 / 00, return query data: the request comes back as it was sent, so with a number of its own it cannot be
/// mistaken for anything (Modbus application protocol V1.1b3, 6.8). It changes nothing in the device.
pub fn loopback(unit: u8, number: u16) -> Vec<u8> {
    Pdu::loopback(number).to(unit)
}

/// The signature of the answer to a block.
fn signature_of(block: &Block) -> Option<ResponseSignature> {
    response_signature(Request { message: &block.request(), address_words: block.address_words })
}

/// Reads of the first part of a block, the shortest first: each has a signature of its own.
fn probes(block: &Block) -> impl Iterator<Item = Block> {
    let first = block.alignment.max(1);
    let step = if block.table.is_bits() { first.max(8) } else { first };
    let counts = (first..block.count).step_by(usize::from(step)).chain([block.count]);
    let block = block.clone();
    counts.map(move |count| Block { count, ..block.clone() })
}

/// Outstanding replies of all units of a line, and how late they have ever been. It outlives an opening: what was asked before a port
/// was closed may be answered when it is open again. Times are spans since the line began.
#[derive(Debug, Clone)]
pub struct LineReplies {
    units: Vec<Unit>,
    /// How long an answer may take.
    timeout: Duration,
    /// Numbers of loopbacks.
    loopbacks: u16,
    /// Frames carry transaction ids: no answer is mistaken for another, and nothing is ever outstanding.
    has_ids: bool,
    /// What the requests do not say of their answers.
    wide: WideAddresses,
}

impl LineReplies {
    /// Nothing is outstanding. The numbers of loopbacks begin behind `seed`, which differs from process to process.
    pub fn new(timeout: Duration, seed: u16) -> LineReplies {
        LineReplies {
            units: vec![Unit::default(); 256],
            timeout,
            loopbacks: seed,
            has_ids: false,
            wide: WideAddresses::default(),
        }
    }

    /// These addresses hold 32 bits each from now on.
    pub fn set_wide(&mut self, wide: WideAddresses) {
        self.wide = wide;
    }

    /// A request message with how its answer counts.
    pub fn request<'a>(&self, message: &'a [u8]) -> Request<'a> {
        self.wide.request(message)
    }

    /// These blocks are asked for from now on; a unit that was asked for none before is unproven.
    pub fn expect(&mut self, blocks: &[Block]) {
        for (unit, known) in (0..).zip(&mut self.units) {
            let outstanding = &mut known.outstanding;
            let first = outstanding.usual.is_empty();
            outstanding.usual.clear();
            for signature in blocks.iter().filter(|block| block.unit == unit).filter_map(signature_of) {
                if !outstanding.usual.contains(&signature) && outstanding.usual.len() < USUAL_MAX {
                    outstanding.usual.push(signature);
                }
            }
            outstanding.unproven |= first && !outstanding.usual.is_empty() && !self.has_ids;
        }
    }

    /// A unit has answered, `proof` if this cannot have been an older answer. One that sends each answer again rests after
    /// each block until the repetition must have come.
    pub fn answered(&mut self, request: &[u8], answer: &[u8], proof: bool, now: Duration) {
        let Some(unit) = request.first().map(|unit| usize::from(*unit)) else { return };
        let unsettled = self.is_unsettled(to_u8(unit), now);
        let timeout = self.timeout;
        let signature = response_signature(self.request(request));
        let unit = &mut self.units[unit];
        if proof && !unsettled {
            unit.prove(unit.quarantine(timeout), now);
        } else if !unsettled {
            unit.settles_from = Some(now);
        }
        answer.clone_into(&mut unit.answer);
        let is_usual = signature.is_some_and(|signature| unit.outstanding.usual.contains(&signature));
        if is_usual && std::mem::take(&mut unit.repeats) {
            unit.outstanding.unproven = true;
            unit.unsolicited_at = Some(now);
        }
    }

    /// An unsolicited good frame of this unit came. `true` if that puts what was read of it into doubt.
    pub fn on_unsolicited(&mut self, unit: u8, message: &[u8], now: Duration) -> bool {
        let unit = &mut self.units[usize::from(unit)];
        unit.unsettle(now);
        if unit.answer == message {
            unit.repeats = true;
            let usual = unit.outstanding.usual.iter().any(|signature| signature.fits(message));
            if usual {
                unit.outstanding.unproven = true;
                unit.unsolicited_at = Some(now);
            }
            return false;
        }
        let was_in_sync = unit.outstanding.is_clear() && !unit.outstanding.usual.is_empty();
        if was_in_sync || unit.unsolicited_at.is_some() {
            unit.outstanding.unproven = true;
            unit.unsolicited_at = Some(now);
        }
        was_in_sync
    }

    /// Another master asks on this line: any unit may be answering it.
    pub fn mark_all_unproven(&mut self) {
        for unit in self.units.iter_mut().filter(|unit| !unit.outstanding.usual.is_empty()) {
            unit.outstanding.unproven = true;
        }
    }

    /// Has this unit sent within one timeout what it was not asked for? Nothing that it sends now proves anything.
    pub fn is_unsettled(&self, unit: u8, now: Duration) -> bool {
        let unsolicited_at = self.units[usize::from(unit)].unsolicited_at;
        unsolicited_at.is_some_and(|at| now.saturating_sub(at) < self.timeout)
    }

    /// Other settings: an answer may take this long from now on, and frames carry transaction ids or do not.
    pub fn set_line(&mut self, timeout: Duration, has_ids: bool) {
        self.timeout = timeout;
        if std::mem::replace(&mut self.has_ids, has_ids) != has_ids {
            for unit in &mut self.units {
                unit.resynchronise();
                unit.outstanding.unproven = !has_ids && !unit.outstanding.usual.is_empty();
            }
        }
    }

    /// What is tried next to prove that a unit is in sync.
    pub fn proof(&self, unit: u8) -> Proof {
        self.units[usize::from(unit)].proof
    }

    /// It has proved to be in sync by an answer.
    pub fn proof_given(&mut self, unit: u8) {
        self.units[usize::from(unit)].proof_given();
    }

    /// An operator wants it asked now: what takes longest is not tried first.
    pub fn retry(&mut self, unit: u8) {
        self.units[usize::from(unit)].proof = Proof::default();
    }

    /// That has proved nothing.
    pub fn proof_failed(&mut self, unit: u8) {
        self.units[usize::from(unit)].proof_failed();
    }

    /// It has answered, and proves to be in sync if nothing more comes of it for so long; `None`: it is not about to.
    pub fn settles_in(&self, unit: u8, now: Duration) -> Option<Duration> {
        let unit = &self.units[usize::from(unit)];
        let since = unit.settles_from.filter(|_| unit.proof == Proof::Silence && !unit.reorders)?;
        Some(unit.settling_time(self.timeout).saturating_sub(now.saturating_sub(since)))
    }

    /// Outstanding replies of a unit.
    pub fn of(&self, unit: u8) -> &OutstandingReplies {
        &self.units[usize::from(unit)].outstanding
    }

    /// Could the answer to this message be mistaken for an outstanding one?
    pub fn is_ambiguous(&self, message: &[u8]) -> bool {
        let Some(unit) = message.first() else { return false };
        let outstanding = self.of(*unit);
        match (response_signature(self.request(message)), message.get(1)) {
            (Some(signature), _) => outstanding.is_ambiguous(signature),
            (None, Some(function)) => outstanding.unproven || outstanding.functions.contains(function),
            (None, None) => false,
        }
    }

    /// Nothing older than its last answer can come from this unit any more.
    pub fn clear(&mut self, unit: u8, now: Duration) {
        let timeout = self.timeout;
        let unit = &mut self.units[usize::from(unit)];
        unit.prove(unit.quarantine(timeout), now);
    }

    /// A request was not answered, or only by something corrupt.
    pub fn failed(&mut self, message: &[u8], now: Duration) {
        let signature = response_signature(self.request(message));
        let Some(unit) = message.first().map(|unit| &mut self.units[usize::from(*unit)]) else { return };
        match (signature, message.get(1)) {
            (Some(signature), _) => unit.outstanding.add(signature),
            (None, Some(function)) => unit.outstanding.add_function(*function),
            (None, None) => {}
        }
        // Patience counts from the last request that may be answered late; a loopback cannot be mistaken.
        if !signature.is_some_and(ResponseSignature::is_loopback) {
            unit.failed_at = Some(now);
        }
        unit.settles_from = None;
    }

    /// A request was refused while the refusal may have been the answer to an older one: call it after [`LineReplies::failed`].
    pub fn refused(&mut self, unit: u8, now: Duration) {
        self.units[usize::from(unit)].settles_from = Some(now);
    }

    /// An answer of this unit came that was not waited for any more. `true` if one was outstanding.
    pub fn on_late_reply(&mut self, unit: u8, message: &[u8], now: Duration) -> bool {
        let timeout = self.timeout;
        let unit = &mut self.units[usize::from(unit)];
        unit.unsettle(now);
        let Some(failed_at) = unit.failed_at.filter(|_| !unit.outstanding.is_clear()) else { return false };
        unit.late_max = unit.late_max.max(now.saturating_sub(failed_at) + timeout);
        if unit.reorders && !unit.is_unsure {
            unit.outstanding.signatures.retain(|signature| !signature.fits(message));
        }
        true
    }

    /// An answer of this unit came that was not waited for any more. `true` if it shows for the first time that its answers overtake
    /// each other: what was read of it while it seemed to be in sync is in doubt.
    pub fn detect_reordering(&mut self, unit: u8, message: &[u8], now: Duration) -> bool {
        let timeout = self.timeout;
        let unit = &mut self.units[usize::from(unit)];
        let is_repeated = unit.answer == message;
        !unit.reorders && !is_repeated && unit.detect_reordering(message, unit.quarantine(timeout), now)
    }

    /// Can only time, or the outstanding reply, make sure that the answer to this message is no older one?
    pub fn must_wait(&self, message: &[u8]) -> bool {
        let Some(unit) = message.first().map(|unit| &self.units[usize::from(*unit)]) else { return false };
        unit.reorders
            && response_signature(self.request(message)).is_some_and(|signature| unit.outstanding.contains(signature))
    }

    /// The next loopback of a unit, with a number of its own.
    pub fn next_loopback(&mut self, unit: u8) -> Vec<u8> {
        self.loopbacks = self.loopbacks.wrapping_add(1);
        loopback(unit, self.loopbacks)
    }

    /// For a unit that no probe can resynchronise: how much longer it must rest before its outstanding replies may be forgotten,
    /// `None` once it is forgotten. For each outstanding reply it is left alone twice as long as it has ever been late, ten
    /// timeouts at the least: a delay, not a proof, and needed only for devices that do not answer a loopback at all. While no
    /// unit answers, the line itself may stand still, as behind a gateway with a queue, and the delay says little.
    pub fn forget(&mut self, unit: u8, now: Duration) -> Option<Duration> {
        let timeout = self.timeout;
        let settled = self.settles_in(unit, now) == Some(Duration::ZERO);
        let stands_still = self.stands_still_for(unit);
        let unit = &mut self.units[usize::from(unit)];
        let outstanding = to_u32(unit.outstanding.count().max(1));
        let factor = if stands_still { STANDSTILL_FACTOR } else { 1 };
        let rest = (unit.quarantine(timeout) * outstanding * factor).min(REST_MAX);
        let waited = unit.failed_at.map_or(rest, |failed_at| now.saturating_sub(failed_at));
        if waited < rest && !settled {
            return Some(rest - waited);
        }
        unit.resynchronise();
        None
    }

    /// Has no unit of the line answered since this one has not, though there are others?
    fn stands_still_for(&self, unit: u8) -> bool {
        let is_polled = |other: &Unit| !other.outstanding.usual.is_empty();
        let others = (0..).zip(&self.units).any(|(other, known)| other != unit && is_polled(known));
        others && self.units.iter().filter_map(|unit| unit.proved_at).max() <= self.units[usize::from(unit)].failed_at
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
