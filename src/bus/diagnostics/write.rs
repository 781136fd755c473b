//! A write without a plant file: read what the operator saw, write once, read back. Nothing is ever sent twice.

use std::time::Duration;

use super::{Step, read, step};
use crate::{
    bus::{
        codec,
        pdu::{self, Pdu},
    },
    plant::{
        command::{NotConfirmed, Outcome, Refusal},
        diagnostics::RegisterWrite,
        exact::Exact,
        fault::Fault,
        number::to_u16,
        tag::Point,
        tag_value::TagValue,
        text_value,
    },
};

/// A clock is read back at once, and may have gone on by this.
const READ_BACK_AFTER: Duration = Duration::from_secs(1);
/// Steps of a write.
pub const STEPS: u32 = 3;

/// Step `n` of a write, from 0.
pub fn step_of(write: &RegisterWrite, n: u32) -> Step {
    match n {
        1 => step(message(write)),
        _ => step(read(write.unit, write.table, write.address, to_u16(write.words.len()))),
    }
}

fn message(write: &RegisterWrite) -> Vec<u8> {
    let bits = write.table.is_bits();
    let pdu = match (write.words.as_slice(), bits) {
        ([word], true) if !write.multiple => Pdu::write_coil(write.address, *word != 0),
        ([word], false) if !write.multiple => Pdu::write_register(write.address, *word),
        (words, true) => Pdu::write_coils(write.address, words),
        (words, false) => Pdu::write_registers(write.address, words),
    };
    pdu.to(write.unit)
}

/// Before the write: its end, if the device no longer holds what the operator saw, or does not say what it holds.
pub fn after_first_read(write: &RegisterWrite, held: Result<Vec<u16>, Fault>) -> Option<Outcome> {
    match held {
        Ok(held) if held == write.expected || write.clock.is_some() => None,
        Ok(held) => Some(Outcome::Refused(Refusal::ChangedTo(text(&held)))),
        Err(Fault::Exception(code)) => Some(Outcome::Refused(Refusal::Exception(code))),
        Err(fault) => Some(Outcome::Refused(Refusal::NotSent(fault))),
    }
}

/// After the write: its end, if the device has refused it. An answer that did not come says nothing yet.
pub fn after_write(answered: &Result<(), Fault>) -> Option<Outcome> {
    match answered {
        Err(Fault::Exception(code)) if code.is_refusal() => Some(Outcome::Refused(Refusal::Exception(*code))),
        Ok(()) | Err(_) => None,
    }
}

/// After the read-back.
pub fn after_read_back(write: &RegisterWrite, answered: Result<(), Fault>, held: Result<Vec<u16>, Fault>) -> Outcome {
    Outcome::NotConfirmed(match (held, answered) {
        // What it held before proves nothing of a write that was not answered.
        (Ok(held), Err(fault)) if held == write.words && held == write.expected => NotConfirmed::NotAnswered(fault),
        (Ok(held), _) if is_held(write, &held) => return Outcome::Verified,
        (Ok(held), Ok(())) => NotConfirmed::Different(value(&held)),
        (Ok(held), Err(fault)) => NotConfirmed::NotApplied(fault, value(&held)),
        (Err(_), Err(fault)) => NotConfirmed::NotAnswered(fault),
        (Err(fault), Ok(())) => NotConfirmed::NotRead(fault),
    })
}

/// Does a device that shows these words hold what was written? A clock has gone on since.
fn is_held(write: &RegisterWrite, held: &[u16]) -> bool {
    let shown = |point: Point, words| codec::decode_text(point, words);
    let clock = write.clock.map(|point| (point.kind, shown(point, &write.words), shown(point, held)));
    match clock {
        Some((kind, Some(written), Some(shown))) => text_value::is_held(kind, &written, &shown, READ_BACK_AFTER),
        _ => held == write.words,
    }
}

/// What becomes of a write that ends before it was read back: `lost` is why, `made` how many of its steps were made.
pub fn unfinished(made: u32, written: Result<(), Fault>, lost: Fault) -> Outcome {
    match (made, written) {
        (0 | 1, _) => Outcome::Refused(Refusal::NotSent(lost)),
        (2, _) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(lost)),
        (_, Err(fault)) => Outcome::NotConfirmed(NotConfirmed::NotAnswered(fault)),
        (_, Ok(())) => Outcome::NotConfirmed(NotConfirmed::NotRead(lost)),
    }
}

/// The values that a response to a read holds.
pub fn words_of(request: &[u8], answer: &[u8]) -> Option<Vec<u16>> {
    let (_, _, words) = pdu::values_read(request.get(1..)?, answer.get(1..)?)?;
    Some(words)
}

/// One word as a number; several as they are written.
fn value(words: &[u16]) -> TagValue {
    match words {
        [word] => Exact::whole((*word).into()).into(),
        several => TagValue::Text(text(several).into()),
    }
}

fn text(words: &[u16]) -> String {
    words.iter().map(u16::to_string).collect::<Vec<_>>().join(" ")
}
