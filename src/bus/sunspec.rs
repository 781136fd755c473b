//! Finds out which SunSpec models a unit has: what to read next, and what that says. Pure.

use crate::{
    plant::{
        live::AddressSpan,
        number::{to_u16, to_u32},
        tag::Table,
    },
    profile::sunspec::{BASES, END, FoundModel, MARKER, SunSpecDevice},
};

/// Registers of one request.
const REQUEST_MAX: u32 = 125;
/// Spans of one read.
const SPANS_MAX: usize = 16;
/// Models of a device.
const MODELS_MAX: usize = 200;
/// Registers of all models whose contents are read: more than any device has.
const REGISTERS_MAX: u32 = 16_000;

/// A walk at work. It ends by itself: each read is of 16 parts of a model or leads to the next one, whose numbers are bounded.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    step: Step,
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
        Walk { step: Step::Places, device: None }
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
                let (device, found) = (self.device.as_ref()?, self.device.as_ref()?.models.last()?);
                let span = |address: u32, count: u32| AddressSpan {
                    table: device.table,
                    address: to_u16(address),
                    count: to_u16(count),
                };
                let part = |n: usize| {
                    let address = from + to_u32(n) * REQUEST_MAX;
                    (address < found.end()).then(|| span(address, REQUEST_MAX.min(found.end() - address)))
                };
                let mut spans: Vec<AddressSpan> = (0..SPANS_MAX).map_while(part).collect();
                let read: u32 = spans.iter().map(|span| u32::from(span.count)).sum();
                if from + read == found.end() && found.end() + 2 <= 0x1_0000 {
                    spans.push(span(found.end(), 2));
                }
                (!spans.is_empty()).then_some(spans)
            }
            Step::Done => None,
        }
    }

    /// What was asked for has been read: good words from an address on, fewer where one was refused.
    pub fn on_words(&mut self, words: &dyn Fn(AddressSpan) -> Vec<u16>) {
        let Some(spans) = self.next() else { return };
        match self.step {
            Step::Places => self.seek(0, words),
            Step::Marker(n) => match words(spans[0]) == MARKER {
                true => {
                    let AddressSpan { table, address: base, .. } = spans[0];
                    self.device = Some(SunSpecDevice { table, base, models: Vec::new(), is_cut: false });
                    self.on_head(u32::from(base) + 2, words);
                }
                false => self.seek(n + 1, words),
            },
            Step::Model(from) => {
                let contents: Vec<AddressSpan> = spans.iter().copied().filter(|span| !self.is_head(*span)).collect();
                if let Some(found) = self.device.as_mut().and_then(|device| device.models.last_mut()) {
                    for address in contents.iter().flat_map(|span| span.range()) {
                        let one = AddressSpan { address: to_u16(address), count: 1, ..contents[0] };
                        found.words.push(words(one).first().copied());
                    }
                    let end = found.end();
                    let next = contents.last().map_or(from, |span| span.range().end);
                    self.step = Step::Model(next);
                    if next == end {
                        self.on_head(end, words);
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

    /// The next place from the `n`th on that holds the first half of the marker.
    fn seek(&mut self, n: usize, words: &dyn Fn(AddressSpan) -> Vec<u16>) {
        let begins = |place: AddressSpan| words(AddressSpan { count: 1, ..place }).first() == MARKER.first();
        let place = places().enumerate().skip(n).find(|(_, place)| begins(*place));
        self.step = place.map_or(Step::Done, |(n, _)| Step::Marker(n));
    }

    /// The number and length of a model, or the end.
    fn on_head(&mut self, at: u32, words: &dyn Fn(AddressSpan) -> Vec<u16>) {
        let Some(device) = &mut self.device else { return };
        let head = |count: u32| match at + count <= 0x1_0000 {
            true => words(AddressSpan { table: device.table, address: to_u16(at), count: to_u16(count) }),
            false => Vec::new(),
        };
        self.step = Step::Done;
        let read: u32 = device.models.iter().map(|found| u32::from(found.length)).sum();
        match (head(1).first(), head(2).get(1)) {
            // Some end with the number alone.
            (Some(&END), _) => {}
            (Some(&0), _) => device.is_cut = true,
            (Some(&id), Some(&length)) => {
                let end = at + 2 + u32::from(length);
                if 0x1_0000 < end || device.models.len() == MODELS_MAX || REGISTERS_MAX < read + u32::from(length) {
                    device.is_cut = true;
                    return;
                }
                device.models.push(FoundModel { id, address: to_u16(at + 2), length, words: Vec::new() });
                self.step = Step::Model(at + 2);
            }
            _ => device.is_cut = true,
        }
    }

    /// Is this the head of the model behind the one at hand?
    fn is_head(&self, span: AddressSpan) -> bool {
        let found = self.device.as_ref().and_then(|device| device.models.last());
        found.is_some_and(|found| found.end() == u32::from(span.address))
    }
}

/// Where the marker may stand, two registers each.
fn places() -> impl Iterator<Item = AddressSpan> {
    let tables = [Table::Holding, Table::Input];
    tables.into_iter().flat_map(|table| BASES.map(|address| AddressSpan { table, address, count: 2 }))
}

#[cfg(test)]
mod tests;
