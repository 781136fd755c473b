//! How the culprit in a refused request is found with few requests: it is cut in two until its parts are answered, or are one value each.

use std::collections::{BTreeMap, BTreeSet};

use super::{Block, UnreadableRanges, together};
use crate::plant::{
    def::PlantDef,
    live::AddressSpan,
    number::to_u16,
    tag::{Table, TagDef},
};

/// The two smaller blocks to read instead of one that was refused, and the registers between them; `None` for one value.
///
/// A register between tags is the usual refused register, so it is cut at a gap as long as there is one: the middle one, because
/// each further answer then halves the candidates. Then between neighbours, down to single values.
pub fn split(def: &PlantDef, block: &Block) -> Option<([Block; 2], (u32, u32))> {
    let mut tags: Vec<&TagDef> = block.tags.iter().map(|tag| def.tag(*tag)).collect();
    tags.sort_by_key(|tag| (tag.point.address, tag.point.len(), tag.id));
    // Places where no value is cut in two: number of tags before, first and last unused register.
    let mut places: Vec<(usize, u32, u32)> = Vec::new();
    let mut used = 0;
    for (before, tag) in tags.iter().enumerate() {
        let start = u32::from(tag.point.address);
        if before > 0 && used <= start {
            places.push((before, used, start));
        }
        used = used.max(start + u32::from(tag.point.len()));
    }
    let gaps: Vec<_> = places.iter().filter(|(_, from, to)| from < to).copied().collect();
    let candidates = if gaps.is_empty() { places } else { gaps };
    let (before, from, to) = *candidates.get(candidates.len() / 2)?;
    let device = def.device(block.device);
    let part = |tags| together(device, tags);
    Some(([part(&tags[..before]), part(&tags[before..])], (from, to)))
}

/// Registers or bits of a unit, from the first to before the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AddressRange {
    unit: u8,
    table: Table,
    start: u32,
    end: u32,
}

impl AddressRange {
    /// Those of a span.
    pub fn of_span(unit: u8, span: AddressSpan) -> AddressRange {
        AddressRange { unit, table: span.table, start: span.range().start, end: span.range().end }
    }

    fn of_block(block: &Block) -> AddressRange {
        let (start, end) = block.range();
        AddressRange { unit: block.unit, table: block.table, start, end }
    }

    fn at(self, (start, end): (u32, u32)) -> AddressRange {
        AddressRange { start, end, ..self }
    }

    fn count(self) -> u32 {
        self.end - self.start
    }

    fn contains(&self, other: &AddressRange) -> bool {
        self.is_beside(other) && self.start <= other.start && other.end <= self.end
    }

    /// What lies between two parts may be empty.
    fn touches(&self, other: &AddressRange) -> bool {
        self.contains(other) || self.is_beside(other) && self.start < other.end && other.start < self.end
    }

    fn is_beside(&self, other: &AddressRange) -> bool {
        (self.unit, self.table) == (other.unit, other.table)
    }
}

/// What a refused request was found to fail of: a range that the unit does not have, or, if that is empty, that it was so much at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Obstacle {
    range: AddressRange,
    /// Registers or bits of the refused request.
    asked: u32,
    /// The unit gave values between the refusals that led to it: it does not refuse everything.
    sound: bool,
}

/// What is to be done about a refused request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// Nothing new was learnt.
    Known,
    /// Its two parts are asked for in its place.
    Cut,
    /// It is one value: that is not there.
    Alone,
}

/// What a search has come to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Conclusion {
    /// The plan must be made again.
    pub replan: bool,
    /// Of units that have refused everything since the last search, which is not believed: a device that starts up does so.
    disbelieved: Vec<AddressRange>,
}

impl Conclusion {
    /// Was the refusal of this block, or of a part of it, not believed?
    pub fn disbelieves(&self, block: &Block) -> bool {
        let whole = AddressRange::of_block(block);
        self.disbelieved.iter().any(|range| whole.touches(range))
    }
}

/// The search for what is wrong with a refused request: its parts are asked for in its place, and their responses narrow it down.
/// What was found must be confirmed by one more refusal, so that a device that stumbled once loses nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RangeBisection {
    /// Parts that have not answered yet.
    open: Vec<AddressRange>,
    /// Each refused request, and what lay between the two parts that it was cut into.
    cuts: Vec<(AddressRange, AddressRange)>,
    found: Vec<Obstacle>,
    /// Found once: unreadable if the next read that contains them is refused too.
    candidates: Vec<Obstacle>,
    /// Units that have given a value since something of them was found last, and since the search for it began.
    gives: BTreeSet<u8>,
    gives_meanwhile: BTreeSet<u8>,
    /// The most that a unit has given at once.
    given: BTreeMap<(u8, Table), u32>,
}

impl RangeBisection {
    /// A block was refused: what to poll in its place. `None`: leave it, nothing new was learnt.
    pub fn refused(&mut self, def: &PlantDef, unreadable: &UnreadableRanges, block: &Block) -> Option<Vec<Block>> {
        let (whole, parts) = (AddressRange::of_block(block), split(def, block));
        let ranges = parts
            .as_ref()
            .map(|([first, second], between)| ([first, second].map(AddressRange::of_block), whole.at(*between)));
        match (self.refused_range(unreadable, whole, ranges), parts) {
            (Refused::Known, _) => None,
            (Refused::Cut, Some((parts, _))) => Some(parts.into()),
            (Refused::Cut | Refused::Alone, _) => Some(vec![block.clone()]),
        }
    }

    /// A range was refused that can be cut into these parts, with something between them.
    pub fn refused_range(
        &mut self,
        unreadable: &UnreadableRanges,
        whole: AddressRange,
        parts: Option<([AddressRange; 2], AddressRange)>,
    ) -> Refused {
        if unreadable.touch(whole.unit, whole.table, whole.start, whole.end) {
            return Refused::Known;
        }
        self.open.retain(|open| *open != whole);
        if !self.searches(whole.unit) {
            self.gives_meanwhile.remove(&whole.unit);
        }
        let candidates = self.candidates.iter().filter(|candidate| candidate.sound);
        let confirmed: Vec<Obstacle> =
            candidates.filter(|candidate| whole.contains(&candidate.range)).copied().collect();
        match parts {
            Some((parts, between)) if confirmed.is_empty() => {
                self.cuts.push((whole, between));
                self.open.extend(parts);
                Refused::Cut
            }
            Some(_) => {
                self.found.extend(confirmed);
                Refused::Cut
            }
            None => {
                if !self.found.iter().any(|found| found.range == whole) {
                    self.found.push(Obstacle { range: whole, asked: whole.count(), sound: false });
                }
                Refused::Alone
            }
        }
    }

    fn searches(&self, unit: u8) -> bool {
        self.cuts.iter().any(|(whole, _)| whole.unit == unit) || self.found.iter().any(|found| found.range.unit == unit)
    }

    /// A block was read. The unit has all of it.
    pub fn answered(&mut self, block: &Block) {
        self.answered_range(AddressRange::of_block(block));
    }

    /// A range was read.
    pub fn answered_range(&mut self, whole: AddressRange) {
        self.gives.insert(whole.unit);
        self.gives_meanwhile.insert(whole.unit);
        let given = self.given.entry((whole.unit, whole.table)).or_default();
        *given = whole.count().max(*given);
        self.open.retain(|open| *open != whole);
        self.candidates.retain(|candidate| !whole.contains(&candidate.range));
    }

    /// The most registers or bits that the unit of a block has given at once.
    pub fn given(&self, block: &Block) -> u16 {
        to_u16(self.given.get(&(block.unit, block.table)).copied().unwrap_or_default())
    }

    /// When every part has answered, or is a gap itself: adds what was confirmed to `unreadable`. Where both parts of a refused
    /// request can be read, the gap between them cannot, or it was too much.
    pub fn conclude(&mut self, unreadable: &mut UnreadableRanges) -> Conclusion {
        if !self.open.is_empty() || (self.cuts.is_empty() && self.found.is_empty()) {
            return Conclusion::default();
        }
        self.explain_cuts();
        let (gives, candidates) = (&self.gives, &self.candidates);
        let (believed, doubted): (Vec<Obstacle>, Vec<Obstacle>) =
            self.found.drain(..).partition(|found| found.sound || gives.contains(&found.range.unit));
        let disbelieved = doubted.into_iter().map(|found| found.range).collect();
        let meanwhile = &self.gives_meanwhile;
        let sound = |found: Obstacle| Obstacle { sound: meanwhile.contains(&found.range.unit), ..found };
        self.found = believed.into_iter().map(sound).collect();
        self.gives.retain(|unit| !self.found.iter().any(|found| found.range.unit == *unit));
        let (confirmed, new): (Vec<Obstacle>, Vec<Obstacle>) =
            self.found.drain(..).partition(|found| candidates.iter().any(|known| known.range == found.range));
        self.candidates.retain(|candidate| !confirmed.iter().any(|known| known.range == candidate.range));
        self.candidates.extend(new);
        self.learn(&confirmed, unreadable);
        Conclusion { replan: true, disbelieved }
    }

    /// The same without a second refusal: for reads that an operator watches.
    pub fn conclude_at_once(&mut self, unreadable: &mut UnreadableRanges) {
        self.explain_cuts();
        let found: Vec<Obstacle> =
            self.found.drain(..).filter(|found| self.gives.contains(&found.range.unit)).collect();
        self.learn(&found, unreadable);
    }

    /// Cuts that no found range explains are obstacles themselves.
    fn explain_cuts(&mut self) {
        for (whole, between) in std::mem::take(&mut self.cuts).into_iter().rev() {
            if !self.found.iter().any(|found| whole.contains(&found.range)) {
                self.found.push(Obstacle { range: between, asked: whole.count(), sound: false });
            }
        }
    }

    fn learn(&self, obstacles: &[Obstacle], unreadable: &mut UnreadableRanges) {
        for Obstacle { range, asked, .. } in obstacles {
            let given = self.given.get(&(range.unit, range.table)).copied().unwrap_or_default();
            if range.start == range.end && given < *asked {
                unreadable.limit(range.unit, range.table, to_u16(given), to_u16(*asked));
            } else {
                unreadable.add(range.unit, range.table, range.start, range.end);
            }
        }
    }

    /// Is a search under way?
    pub fn is_open(&self) -> bool {
        !self.open.is_empty()
    }

    /// The plan is made again: its blocks are whole again, and what was found stays to be confirmed.
    pub fn restart(&mut self) {
        self.open.clear();
        self.cuts.clear();
        self.found.clear();
    }

    /// What was known no longer holds: the search starts over.
    pub fn reset(&mut self) {
        *self = RangeBisection { given: std::mem::take(&mut self.given), ..RangeBisection::default() };
    }
}
