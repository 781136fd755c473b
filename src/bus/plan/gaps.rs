//! What units refuse to read: of the polls and of live reads.
//!
//! A unit refuses a request with exception 02 because it does not have a register, with 03 (some makers: 01, 02 or 04) because that is too
//! many at once, or because of a register; the standard leaves it open, so only trying tells.

use std::collections::BTreeMap;

use super::{Block, refused::RefusedPages};
use crate::plant::{
    def::READ_REGISTERS_MAX, fault::ExceptionCode, line_finding::DeviceFinding, live::AddressSpan, number::to_u16,
    tag::Table,
};

/// May the exception mean that too much is asked for, or what is not there? Busy, away and broken memory do not.
pub fn may_be_cut(code: ExceptionCode) -> bool {
    !matches!(code.0, 0x05 | 0x06 | 0x08 | 0x0A | 0x0B)
}

/// Addresses that a unit does not have, although the plan would read (over) them, and how much it gives at once. An empty range is
/// a boundary: both sides can be read, but not with one request.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct UnreadableRanges {
    /// End by start. Ranges never touch the inside of each other.
    ends: BTreeMap<(u8, Table, u32), u32>,
    /// Most registers or bits of one request, and how many were refused.
    most: BTreeMap<(u8, Table), (u16, u16)>,
    /// What live reads found refused throughout.
    pub refused: RefusedPages,
}

impl UnreadableRanges {
    /// Remembers an unreadable range from `start` up to before `end`.
    pub fn add(&mut self, unit: u8, table: Table, start: u32, end: u32) {
        let (mut start, mut end) = (start, end);
        while let Some((old, old_end)) = self.touched(unit, table, start, end.max(start + 1)) {
            (start, end) = (start.min(old), end.max(old_end));
            self.ends.remove(&(unit, table, old));
        }
        self.ends.insert((unit, table, start), end);
    }

    /// Remembers that a unit gives no more than `most` registers or bits at once, and not as many as were `refused`.
    pub fn limit(&mut self, unit: u8, table: Table, most: u16, refused: u16) {
        let limit = self.most.entry((unit, table)).or_insert((most, refused));
        *limit = (limit.0.min(most).max(1), limit.1.min(refused));
    }

    /// Most registers or bits that a unit gives at once, if it gives less than was asked for.
    pub fn most(&self, unit: u8, table: Table) -> Option<u16> {
        self.most.get(&(unit, table)).map(|(most, _)| *most)
    }

    /// All that is known of a unit.
    pub fn of(&self, unit: u8) -> impl Iterator<Item = DeviceFinding> {
        let most = self.most.range((unit, Table::Coil)..=(unit, Table::Holding));
        let most = most.map(|((_, table), &(most, refused))| DeviceFinding::ReadMost { table: *table, most, refused });
        let ranges = self.ends.range((unit, Table::Coil, 0)..=(unit, Table::Holding, u32::MAX));
        most.chain(ranges.map(|((_, table, start), end)| DeviceFinding::Unreadable {
            table: *table,
            address: to_u16(*start),
            count: to_u16(end - start),
        }))
    }

    /// Remembers what was found of a unit earlier.
    pub fn recall(&mut self, unit: u8, found: DeviceFinding) {
        match found {
            DeviceFinding::ReadMost { table, most, refused } => self.limit(unit, table, most, refused),
            DeviceFinding::Unreadable { table, address, count } => {
                let start = u32::from(address);
                self.add(unit, table, start, start + u32::from(count));
            }
            DeviceFinding::InFlight { .. } | DeviceFinding::RequestGap { .. } => {}
        }
    }

    /// Would a read from `start` up to before `end` touch a gap?
    pub fn touch(&self, unit: u8, table: Table, start: u32, end: u32) -> bool {
        self.touched(unit, table, start, end).is_some()
    }

    /// Requests of a unit that it has refused; one that it answers now shows that it is another one, or has another program. `start`
    /// gives an address of each table from which it can be read.
    pub fn refused_requests(&self, unit: u8, start: impl Fn(Table) -> Option<u16>) -> Vec<AddressSpan> {
        let request = |found| match found {
            DeviceFinding::ReadMost { table, refused, .. } => {
                Some(AddressSpan { table, address: start(table)?, count: refused })
            }
            DeviceFinding::Unreadable { table, address, count: 0 } => {
                Some(AddressSpan { table, address: address.checked_sub(1)?, count: 2 })
            }
            // What has grown together of several was never asked for at once.
            DeviceFinding::Unreadable { table, address, count } => {
                Some(AddressSpan { table, address, count }).filter(|span| span.count <= READ_REGISTERS_MAX)
            }
            DeviceFinding::InFlight { .. } | DeviceFinding::RequestGap { .. } => None,
        };
        self.of(unit).filter_map(request).collect()
    }

    /// A unit may be another one, or have another program: its unreadable ranges are searched again.
    pub fn forget(&mut self, unit: u8) {
        self.ends.retain(|(gap, ..), _| *gap != unit);
        self.most.retain(|(other, _), _| *other != unit);
        self.refused.forget(unit);
    }

    /// A block was read. If it lay on a gap, what is known of its unit no longer holds, and `true` says so.
    pub fn disproved(&mut self, block: &Block) -> bool {
        let (start, end) = block.range();
        let wrong = self.touch(block.unit, block.table, start, end);
        if wrong {
            self.forget(block.unit);
        }
        wrong
    }

    /// The requests that read a span around what is unreadable.
    pub fn requests(&self, unit: u8, span: AddressSpan) -> Vec<AddressSpan> {
        let usual = if span.table.is_bits() { 2_000 } else { READ_REGISTERS_MAX };
        let most = self.most(unit, span.table).unwrap_or(usual).max(1);
        let (mut from, range) = (span.range().start, span.range());
        let mut requests = Vec::new();
        for (start, end) in self.within(unit, span.table, &range).chain([(range.end, range.end)]) {
            requests.extend((from..start).step_by(usize::from(most)).map(|address| AddressSpan {
                table: span.table,
                address: to_u16(address),
                count: most.min(to_u16(start - address)),
            }));
            from = end.max(from);
        }
        requests
    }

    /// What is unreadable in a span.
    pub fn holes_in(&self, unit: u8, span: AddressSpan) -> impl Iterator<Item = AddressSpan> {
        let range = span.range();
        let holes = self.within(unit, span.table, &range).filter(|(start, end)| start < end).collect::<Vec<_>>();
        holes.into_iter().map(move |(start, end)| AddressSpan {
            table: span.table,
            address: to_u16(start),
            count: to_u16(end - start),
        })
    }

    /// The ranges in another one, cut to it.
    fn within(&self, unit: u8, table: Table, range: &std::ops::Range<u32>) -> impl Iterator<Item = (u32, u32)> {
        let (first, last) = (range.start, range.end);
        let all = self.ends.range((unit, table, 0)..(unit, table, last));
        let cut = all.map(move |((_, _, start), end)| ((*start).max(first), (*end).min(last)));
        cut.filter(move |(start, end)| first < *end && start <= end)
    }

    fn touched(&self, unit: u8, table: Table, start: u32, end: u32) -> Option<(u32, u32)> {
        let before = self.ends.range((unit, table, 0)..(unit, table, end));
        // The last one that begins before the end is also the one that reaches furthest.
        before.map(|((_, _, gap), gap_end)| (*gap, *gap_end)).next_back().filter(|(_, gap_end)| start < *gap_end)
    }
}
