//! What a device refused to read, and how the refused register in a refused block is found with few requests.

use std::collections::BTreeMap;

use super::{Block, together};
use crate::plant::{
    def::{DeviceId, PlantDef},
    tag::{Table, TagDef},
};

/// Addresses that a device does not have, although the plan would read (over) them. An empty range is a split boundary: both sides
/// can be read, but not with one request.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct UnreadableRanges {
    /// End by start. Ranges never touch the inside of each other.
    ends: BTreeMap<(DeviceId, Table, u32), u32>,
}

impl UnreadableRanges {
    /// Remembers an unreadable range from `start` up to before `end`.
    pub fn add(&mut self, device: DeviceId, table: Table, start: u32, end: u32) {
        let (mut start, mut end) = (start, end);
        while let Some((old, old_end)) = self.touched(device, table, start, end.max(start + 1)) {
            (start, end) = (start.min(old), end.max(old_end));
            self.ends.remove(&(device, table, old));
        }
        self.ends.insert((device, table, start), end);
    }

    /// Would a read from `start` up to before `end` touch a gap?
    pub fn touch(&self, device: DeviceId, table: Table, start: u32, end: u32) -> bool {
        self.touched(device, table, start, end).is_some()
    }

    /// A device may be another one, or have another program, when it comes back: its unreadable ranges are searched again.
    pub fn forget(&mut self, device: DeviceId) {
        self.ends.retain(|(gap, ..), _| *gap != device);
    }

    /// A block was read. If it lay on a gap, what is known of its device no longer holds, and `true` says so.
    pub fn disproved(&mut self, block: &Block) -> bool {
        let (start, end) = block.range();
        let wrong = self.touch(block.device, block.table, start, end);
        if wrong {
            self.forget(block.device);
        }
        wrong
    }

    fn touched(&self, device: DeviceId, table: Table, start: u32, end: u32) -> Option<(u32, u32)> {
        let before = self.ends.range((device, table, 0)..(device, table, end));
        // The last one that begins before the end is also the one that reaches furthest.
        before.map(|((_, _, gap), gap_end)| (*gap, *gap_end)).next_back().filter(|(_, gap_end)| start < *gap_end)
    }
}

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

/// The search for what is wrong with a refused block: its parts are polled in its place, and their responses narrow it down. What
/// was found must be confirmed by one more refusal, so that a device that stumbled once loses nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RangeBisection {
    /// Parts that have not answered yet.
    open: Vec<Block>,
    /// Each refused block, and what lay between the two parts that it was cut into.
    cuts: Vec<(AddressRange, AddressRange)>,
    found: Vec<AddressRange>,
    /// Found once: unreadable if the next read that contains them is refused too.
    candidates: Vec<AddressRange>,
}

/// Addresses of a table, from the first to before the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct AddressRange {
    device: DeviceId,
    table: Table,
    start: u32,
    end: u32,
}

impl AddressRange {
    fn new(block: &Block, (start, end): (u32, u32)) -> AddressRange {
        AddressRange { device: block.device, table: block.table, start, end }
    }

    fn contains(&self, other: &AddressRange) -> bool {
        (self.device, self.table) == (other.device, other.table) && self.start <= other.start && other.end <= self.end
    }
}

impl RangeBisection {
    /// A block was refused with exception 02: what to poll in its place. `None`: leave it, nothing new was learnt.
    pub fn refused(&mut self, def: &PlantDef, unreadable: &UnreadableRanges, block: &Block) -> Option<Vec<Block>> {
        let whole = AddressRange::new(block, block.range());
        if unreadable.touch(whole.device, whole.table, whole.start, whole.end) {
            return None;
        }
        self.open.retain(|open| open != block);
        let parts = split(def, block);
        let confirmed = self.candidates.iter().any(|candidate| whole.contains(candidate));
        match parts {
            Some((parts, between)) if !confirmed => {
                self.cuts.push((whole, AddressRange::new(block, between)));
                self.open.extend(parts.clone());
                Some(parts.into())
            }
            Some((parts, _)) => {
                self.found.extend(self.candidates.iter().filter(|candidate| whole.contains(candidate)));
                Some(parts.into())
            }
            None => {
                if !self.found.contains(&whole) {
                    self.found.push(whole);
                }
                Some(vec![block.clone()])
            }
        }
    }

    /// A block was read. The device has all of it.
    pub fn answered(&mut self, block: &Block) {
        let whole = AddressRange::new(block, block.range());
        self.open.retain(|open| open != block);
        self.candidates.retain(|candidate| !whole.contains(candidate));
    }

    /// When every part has answered, or is a gap itself: adds what was confirmed to `unreadable`. `true` if the plan must be
    /// made again. Where both parts of a refused block can be read, the gap between them cannot.
    pub fn conclude(&mut self, unreadable: &mut UnreadableRanges) -> bool {
        if !self.open.is_empty() || (self.cuts.is_empty() && self.found.is_empty()) {
            return false;
        }
        for (whole, between) in std::mem::take(&mut self.cuts).into_iter().rev() {
            if !self.found.iter().any(|found| whole.contains(found)) {
                self.found.push(between);
            }
        }
        let (confirmed, new): (Vec<AddressRange>, Vec<AddressRange>) =
            self.found.drain(..).partition(|found| self.candidates.contains(found));
        self.candidates.retain(|candidate| !confirmed.contains(candidate));
        self.candidates.extend(new);
        confirmed.iter().for_each(|gap| unreadable.add(gap.device, gap.table, gap.start, gap.end));
        true
    }

    /// The plan is made again for another reason: the search starts over.
    pub fn reset(&mut self) {
        *self = RangeBisection::default();
    }
}
