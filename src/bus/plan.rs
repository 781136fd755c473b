//! The read plan of a line: tags grouped into the blocks that take the least time on the wire.
//!
//! ```text
//!   tags ──> groups ──────────────> runs ──────────────────> blocks
//!            device, table, period  cheapest cut (cheapest)  one request each (cost)
//!                                        ▲
//!                                   unreadable: what the device refused (gaps), as found (bisection)
//! ```
//!
//! Tags of different [`PollClass`] share blocks, and the block has the most important of them: a word that is read along costs
//! two characters, a request of its own twenty, so to leave it out would make the line slower for the critical ones as well.

pub mod cost;
pub mod bisection;
pub mod gaps;
pub mod refused;
mod cheapest;
mod factor;
#[cfg(test)]
#[path = "../../tests/bench/alternatives.rs"]
mod alternatives;
#[cfg(test)]
mod tests;

pub use bisection::{AddressRange, RangeBisection, split};
pub use cost::{Wire, cost};
pub use gaps::{UnreadableRanges, may_be_cut};

use std::{sync::Arc, time::Duration};

use super::pdu::Pdu;
use crate::plant::{
    PlantDef,
    def::{DeviceDef, DeviceId, LineId, READ_REGISTERS_MAX, TagId},
    number::to_u16,
    tag::{Access, Point, Poll, PollClass, Table, TagDef},
};

/// A tag that its device has refused is asked for this often.
const REFUSED_EVERY: Duration = Duration::from_secs(60);

/// One read request: a run of registers or bits of one device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Who is asked.
    pub device: DeviceId,
    /// Its unit address.
    pub unit: u8,
    /// Which table.
    pub table: Table,
    /// First address, 0-based.
    pub address: u16,
    /// Registers, or bits.
    pub count: u16,
    /// The tags in it, by address.
    pub tags: Arc<[TagId]>,
    /// How often.
    pub poll: Poll,
    /// The most important class of its tags.
    pub class: PollClass,
    /// Address and count are multiples of this (registers only).
    pub alignment: u16,
    /// Words that each register address holds.
    pub address_words: u16,
}

impl Block {
    /// The request message: unit, function, address, count.
    pub fn request(&self) -> Vec<u8> {
        Pdu::read(self.table, self.address, self.count).to(self.unit)
    }

    /// Words of registers, or bits, that its answer has.
    pub fn words(&self) -> u32 {
        u32::from(self.count) * u32::from(self.address_words)
    }

    /// First address, and the one behind the last.
    pub fn range(&self) -> (u32, u32) {
        (u32::from(self.address), u32::from(self.address) + u32::from(self.count))
    }
}

/// The blocks of a line: every readable tag in exactly one, no value split, all within the limits of its device, in the
/// least time on the wire. A tag that the device has [`refused()`] is asked for alone and seldom.
pub fn blocks(def: &PlantDef, line: LineId, unreadable: &UnreadableRanges) -> Vec<Block> {
    blocks_with_unpolled(def, line, unreadable, &[])
}

/// The same, and of these devices also what is never polled: an operator has asked for it. Those blocks are read once, and
/// again whenever everything of their device is.
pub fn blocks_with_unpolled(
    def: &PlantDef,
    line: LineId,
    unreadable: &UnreadableRanges,
    requested: &[DeviceId],
) -> Vec<Block> {
    // Nothing is ever asked where another master polls.
    let polled = |device: &&DeviceDef| device.line == line && !def.line(line).listens;
    let on_line = def.devices.iter().filter(polled);
    on_line.flat_map(|device| blocks_of(def, device, unreadable, requested.contains(&device.id))).collect()
}

/// Does a device have tags that are never polled?
pub fn has_unpolled(def: &PlantDef, device: DeviceId) -> bool {
    readable(def, def.device(device), true).any(|tag| tag.poll == Poll::Never)
}

fn blocks_of(def: &PlantDef, device: &DeviceDef, unreadable: &UnreadableRanges, unpolled: bool) -> Vec<Block> {
    let (refused, mut tags): (Vec<&TagDef>, Vec<&TagDef>) =
        readable(def, device, unpolled).partition(|tag| is_refused(device, tag, unreadable));
    tags.sort_by_key(|tag| (tag.poll, tag.point.table, tag.point.address, tag.point.len(), tag.id));
    let alike = |tag: &TagDef| (tag.poll, tag.point.table, tag.point.kind.address_words());
    let wire = Wire::new(def.line(device.line), device);
    let groups = tags.chunk_by(|a, b| alike(a) == alike(b));
    let cut = |group| factor::join(cheapest::cut(group, device, wire, unreadable), device, unreadable);
    let runs = groups.flat_map(cut);
    runs.map(|run| together(device, &run)).chain(refused.iter().map(|tag| asked_again(device, tag))).collect()
}

/// A device may get another program: what it has refused is asked for now and then, when the line has time.
fn asked_again(device: &DeviceDef, tag: &TagDef) -> Block {
    let poll = match tag.poll {
        Poll::Every(period) => Poll::Every(period.max(REFUSED_EVERY)),
        Poll::Once => Poll::Every(REFUSED_EVERY),
        Poll::Never => Poll::Never,
    };
    Block { poll, class: PollClass::Background, ..single(device, tag) }
}

/// The tags of a line that its devices have refused.
pub fn refused(def: &PlantDef, line: LineId, unreadable: &UnreadableRanges) -> Vec<TagId> {
    let on_line = def.devices.iter().filter(|device| device.line == line);
    let refused =
        on_line.flat_map(|device| readable(def, device, false).filter(|tag| is_refused(device, tag, unreadable)));
    refused.map(|tag| tag.id).collect()
}

fn readable<'a>(def: &'a PlantDef, device: &DeviceDef, unpolled: bool) -> impl Iterator<Item = &'a TagDef> {
    let is_read = move |tag: &&TagDef| tag.poll != Poll::Never || unpolled && tag.calculation.is_none();
    def.tags_of(device.id).filter(|tag| tag.access != Access::Write).filter(is_read)
}

fn is_refused(device: &DeviceDef, tag: &TagDef, unreadable: &UnreadableRanges) -> bool {
    let alone = Extent::new(tag.point, end_of(tag.point), device);
    unreadable.touch(device.unit, alone.table, alone.start, alone.end)
}

/// The block that reads one tag alone.
pub fn single(device: &DeviceDef, tag: &TagDef) -> Block {
    together(device, &[tag])
}

/// The block that reads these tags, which are sorted by address.
fn together(device: &DeviceDef, tags: &[&TagDef]) -> Block {
    let first = tags[0];
    let extent = Extent::new(first.point, tags.iter().map(|tag| end_of(tag.point)).max().unwrap_or(0), device);
    Block {
        device: device.id,
        unit: device.unit,
        table: extent.table,
        address: to_u16(extent.start),
        count: to_u16(extent.count()),
        tags: tags.iter().map(|tag| tag.id).collect(),
        poll: first.poll,
        class: tags.iter().map(|tag| tag.class).min().unwrap_or(first.class),
        alignment: device.limits.step(extent.table),
        address_words: extent.address_words,
    }
}

fn end_of(point: Point) -> u32 {
    u32::from(point.address) + u32::from(point.len())
}

/// Most registers or bits of one request, as stated or found.
fn most(device: &DeviceDef, table: Table, unreadable: &UnreadableRanges) -> u32 {
    let stated = u32::from(device.limits.most(table));
    unreadable.most(device.unit, table).map_or(stated, |found| stated.min(found.into()))
}

/// The registers or bits of one request, moved outwards to multiples of the alignment of their table.
#[derive(Debug, Clone, Copy)]
struct Extent {
    table: Table,
    start: u32,
    end: u32,
    address_words: u16,
}

impl Extent {
    fn new(first: Point, end: u32, device: &DeviceDef) -> Extent {
        let (table, start) = (first.table, u32::from(first.address));
        let step = u32::from(device.limits.step(table));
        let address_words = first.kind.address_words();
        Extent { table, start: start - start % step, end: end.next_multiple_of(step).min(0x1_0000), address_words }
    }

    fn count(self) -> u32 {
        self.end - self.start
    }

    /// Words of registers, or bits, that its answer has.
    fn words(self) -> u32 {
        self.count() * u32::from(self.address_words)
    }

    /// Within the limits of one request.
    fn fits(self, device: &DeviceDef, unreadable: &UnreadableRanges) -> bool {
        // An answer holds no more words for counting others as one.
        let is_short = self.address_words == 1 || self.words() <= READ_REGISTERS_MAX.into();
        is_short && self.count() <= most(device, self.table, unreadable)
    }

    /// Within the limits of one request, and free of unreadable registers.
    fn allowed(self, device: &DeviceDef, unreadable: &UnreadableRanges) -> bool {
        self.fits(device, unreadable) && !unreadable.touch(device.unit, self.table, self.start, self.end)
    }
}
