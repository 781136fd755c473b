//! Finds out which SunSpec models a unit has: what to read next, and what that says. Pure.

use super::live::{Outcome, Retries};
use crate::{
    plant::{
        def::READ_REGISTERS_MAX,
        live::AddressSpan,
        number::{to_u16, to_u32},
        tag::Table,
    },
    profile::sunspec::{BASES, END, FoundModel, MARKER, SunSpecDevice},
};

/// Requests of one read for the contents of a model.
const PARTS_MAX: usize = 16;
/// Models of a device.
const MODELS_MAX: usize = 200;
/// Registers of all models whose contents are read: more than any device has.
const REGISTERS_MAX: u32 = 16_000;
/// Behind the last address.
const EDGE: u32 = 0x1_0000;

/// What a read has brought of the register at an address.
pub type Outcomes<'a> = &'a dyn Fn(Table, u32) -> Outcome;

/// A walk at work. It ends by itself: each read is of 16 parts of a model or leads to the next one, whose numbers are bounded, and
/// what is lost is asked for again a few times only.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    step: Step,
    retries: Retries,
    device: Option<SunSpecDevice>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Step {
    /// Does anything answer at the usual places?
    Places,
    /// The marker at one of them, and the head of the first model.
    Marker(usize),
    /// The rest of the model at hand from an address on, and the head of the next.
    Model(u32),
    Done,
}

impl Default for Walk {
    fn default() -> Walk {
        Walk { step: Step::Places, retries: Retries::default(), device: None }
    }
}

impl Walk {
    /// What to read next; `None` when it is done.
    pub fn next(&self) -> Option<Vec<AddressSpan>> {
        match self.step {
            // One register each: a refusal of it is not read again in halves.
            Step::Places => Some(places().map(|place| AddressSpan { count: 1, ..place }).collect()),
            Step::Marker(n) => {
                places().nth(n).map(|place| vec![place, AddressSpan { address: place.address + 2, ..place }])
            }
            Step::Model(from) => {
                let (table, end) = (self.device.as_ref()?.table, self.end()?);
                let most = u32::from(READ_REGISTERS_MAX);
                let part = |n: usize| {
                    let address = from + to_u32(n) * most;
                    (address < end).then(|| span(table, address, most.min(end - address)))
                };
                let mut spans: Vec<AddressSpan> = (0..PARTS_MAX).map_while(part).collect();
                let behind = spans.last().map_or(from, |span| span.range().end);
                spans.extend((behind == end && end < EDGE).then(|| head_at(table, end)));
                Some(spans)
            }
            Step::Done => None,
        }
    }

    /// What was asked for has been read, refused or lost.
    pub fn on_outcomes(&mut self, outcome: Outcomes) {
        let Some(spans) = self.next() else { return };
        let is_lost = |span: &AddressSpan| span.range().any(|address| outcome(span.table, address) == Outcome::Lost);
        let whole = spans.iter().take_while(|span| !is_lost(span)).count();
        match self.step {
            Step::Places | Step::Marker(_) if self.retries.again(whole < spans.len()) => {}
            Step::Places => self.seek(0, outcome),
            Step::Marker(n) => match words(outcome, spans[0]) == MARKER {
                true => {
                    let AddressSpan { table, address: base, .. } = spans[0];
                    self.device = Some(SunSpecDevice { table, base, models: Vec::new(), is_cut: false });
                    self.on_head(spans[1], outcome);
                }
                false => self.seek(n + 1, outcome),
            },
            // Of what was lost the first is asked for again, or given up.
            Step::Model(_) if self.retries.again(whole == 0) => {}
            Step::Model(_) => {
                for span in &spans[..whole.max(1)] {
                    match Some(u32::from(span.address)) == self.end() {
                        true => self.on_head(*span, outcome),
                        false => self.on_contents(*span, outcome),
                    }
                }
            }
            Step::Done => {}
        }
    }

    /// What was found; `None` before the end, and where the unit has no models.
    pub fn found(&self) -> Option<&SunSpecDevice> {
        self.device.as_ref().filter(|device| self.step == Step::Done && !device.models.is_empty())
    }

    /// Models so far.
    pub fn count(&self) -> usize {
        self.device.as_ref().map_or(0, |device| device.models.len())
    }

    /// The address behind the model at hand.
    fn end(&self) -> Option<u32> {
        self.device.as_ref().and_then(|device| device.models.last()).map(FoundModel::end)
    }

    /// The next place from the `n`th on that holds the first half of the marker.
    fn seek(&mut self, n: usize, outcome: Outcomes) {
        let begins = |place: AddressSpan| words(outcome, AddressSpan { count: 1, ..place }).first() == MARKER.first();
        let place = places().enumerate().skip(n).find(|(_, place)| begins(*place));
        self.step = place.map_or(Step::Done, |(n, _)| Step::Marker(n));
    }

    /// Part of the model at hand.
    fn on_contents(&mut self, part: AddressSpan, outcome: Outcomes) {
        let Some(device) = &mut self.device else { return };
        let Some(found) = device.models.last_mut() else { return };
        for address in part.range() {
            let outcome = outcome(part.table, address);
            device.is_cut |= outcome == Outcome::Lost;
            found.words.push(outcome.word());
        }
        self.go_on(part.range().end);
    }

    /// The number and length of a model, or the end.
    fn on_head(&mut self, head: AddressSpan, outcome: Outcomes) {
        let Some(device) = &mut self.device else { return };
        self.step = Step::Done;
        let read: u32 = device.models.iter().map(|found| u32::from(found.length)).sum();
        match words(outcome, head)[..] {
            // Some end with the number alone.
            [END, ..] => {}
            [id, length] if id != 0 => {
                let (at, registers) = (head.range().end, u32::from(length));
                if EDGE < at + registers || device.models.len() == MODELS_MAX || REGISTERS_MAX < read + registers {
                    device.is_cut = true;
                    return;
                }
                device.models.push(FoundModel { id, address: to_u16(at), length, words: Vec::new() });
                self.go_on(at);
            }
            _ => device.is_cut = true,
        }
    }

    /// From this address on; nothing stands behind the last.
    fn go_on(&mut self, from: u32) {
        self.step = if from == EDGE { Step::Done } else { Step::Model(from) };
    }
}

fn span(table: Table, address: u32, count: u32) -> AddressSpan {
    AddressSpan { table, address: to_u16(address), count: to_u16(count) }
}

/// Number and length of a model, as much as there is room for.
fn head_at(table: Table, address: u32) -> AddressSpan {
    span(table, address, (EDGE - address).min(2))
}

/// Good words from an address on, fewer where one was refused.
fn words(outcome: Outcomes, span: AddressSpan) -> Vec<u16> {
    span.range().map_while(|address| outcome(span.table, address).word()).collect()
}

/// Where the marker may stand, two registers each.
fn places() -> impl Iterator<Item = AddressSpan> {
    let tables = [Table::Holding, Table::Input];
    tables.into_iter().flat_map(|table| BASES.map(|address| AddressSpan { table, address, count: 2 }))
}

#[cfg(test)]
mod tests;
