//! What was read of a unit: a cell for every register or bit, with what it held before.

use std::{
    borrow::Cow,
    collections::{BTreeMap, VecDeque},
};

use jiff::Timestamp;

use crate::{
    bus::live::Outcome,
    plant::{
        fault::Fault,
        live::{AddressSpan, LiveReading},
        number::to_u16,
        tag::Table,
    },
    register_map::named::Named,
};

/// Values of a cell that are remembered.
const SEEN_MAX: usize = 600;
/// Cells that are remembered; older windows are forgotten.
const CELLS_MAX: usize = 20_000;

/// A register or bit.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// As it was last read; `None` before the first good read.
    pub word: Option<u16>,
    /// When `word` was read.
    pub at: Timestamp,
    /// When it last became another value.
    pub changed: Option<Timestamp>,
    /// Why the last read brought nothing.
    pub fault: Option<Fault>,
    /// The last values, oldest first.
    pub seen: VecDeque<(Timestamp, u16)>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cells(BTreeMap<(Table, u16), Cell>);

impl Cells {
    pub fn get(&self, table: Table, address: u16) -> Option<&Cell> {
        self.0.get(&(table, address))
    }

    /// Good words from an address on, as many as follow one another, at most `most`.
    pub fn words(&self, table: Table, address: u16, most: u16) -> Vec<u16> {
        let range = AddressSpan { table, address, count: most }.range();
        let word = |address: u32| {
            let cell = u16::try_from(address).ok().and_then(|address| self.get(table, address))?;
            cell.word.filter(|_| cell.fault.is_none())
        };
        range.map_while(word).collect()
    }

    /// The words of a value from one response, good or not any more; two halves of different moments are no value.
    pub fn held(&self, table: Table, address: u16, count: u16) -> Option<Vec<u16>> {
        let at = self.get(table, address)?.at;
        let word = |address: u32| self.get(table, u16::try_from(address).ok()?).filter(|cell| cell.at == at)?.word;
        AddressSpan { table, address, count }.range().map(word).collect()
    }

    /// A name with the power of ten that the unit holds for it, once that was read.
    pub fn scaled<'a>(&self, named: &'a Named) -> Cow<'a, Named> {
        let word = named.power_at.and_then(|at| self.held(named.table, at, 1)?.first().copied());
        let scaled = word.and_then(|word| named.with_power(word.cast_signed()));
        scaled.map_or(Cow::Borrowed(named), Cow::Owned)
    }

    /// What the last read of an address has brought.
    pub fn outcome(&self, table: Table, address: u32) -> Outcome {
        let cell = u16::try_from(address).ok().and_then(|address| self.get(table, address));
        Outcome::of(cell.and_then(|cell| cell.fault.map(Err).or(cell.word.map(Ok))))
    }

    /// Did some of these registers not come, although the unit may have them?
    pub fn is_lost(&self, span: AddressSpan) -> bool {
        span.range().any(|address| self.outcome(span.table, address) == Outcome::Lost)
    }

    /// Everything good, in the order of tables and addresses.
    pub fn good(&self) -> impl Iterator<Item = (Table, u16)> {
        let good = self.0.iter().filter(|(_, cell)| cell.fault.is_none() && cell.word.is_some());
        good.map(|(address, _)| *address)
    }

    /// The cells with a good word that `is_good` takes, as they are now, without what they held before.
    pub fn frozen(&self, is_good: impl Fn(&Cell) -> bool) -> Cells {
        let good = self.0.iter().filter(|(_, cell)| cell.word.is_some() && is_good(cell));
        let frozen = |cell: &Cell| Cell { word: cell.word, ..Cell::new(cell.at) };
        Cells(good.map(|(at, cell)| (*at, frozen(cell))).collect())
    }

    /// Was nothing ever read?
    pub fn is_blank(&self) -> bool {
        self.0.values().all(|cell| cell.word.is_none())
    }

    /// A read has ended.
    pub fn on_reading(&mut self, reading: &LiveReading) {
        if CELLS_MAX < self.0.len() {
            self.0.clear();
        }
        for part in &reading.parts {
            for (n, address) in part.span.range().map(to_u16).enumerate() {
                let cell = self.0.entry((part.span.table, address)).or_insert_with(|| Cell::new(part.at));
                match &part.words {
                    Ok(words) => words.get(n).iter().for_each(|word| cell.update(**word, part.at)),
                    Err(fault) => cell.fault = Some(*fault),
                }
            }
        }
    }
}

impl Cell {
    fn new(at: Timestamp) -> Cell {
        Cell { word: None, at, changed: None, fault: None, seen: VecDeque::new() }
    }

    fn update(&mut self, word: u16, at: Timestamp) {
        if self.word.is_some_and(|old| old != word) {
            self.changed = Some(at);
        }
        (self.word, self.at, self.fault) = (Some(word), at, None);
        if self.seen.len() == SEEN_MAX {
            self.seen.pop_front();
        }
        self.seen.push_back((at, word));
    }

    /// Is the device without this address?
    pub fn is_hole(&self) -> bool {
        matches!(self.fault, Some(Fault::Exception(code)) if code.0 == 2)
    }
}
