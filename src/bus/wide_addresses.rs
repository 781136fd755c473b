//! The register addresses of a line that hold 32 bits each, as Enron and Daniel count: a read of them brings four bytes for
//! each, which its request does not say.

use super::frame::Request;
use crate::plant::{
    PlantDef,
    def::{DeviceDef, LineId},
    tag::{Access, Table, TagDef},
};

/// Those of all units of a line; by default none.
#[derive(Debug, Clone, Default)]
pub struct WideAddresses(Vec<WideAddress>);

#[derive(Debug, Clone, Copy)]
struct WideAddress {
    unit: u8,
    table: Table,
    address: u16,
    /// A read has to bring it: it is no gap in one of others.
    is_read: bool,
}

impl WideAddresses {
    /// Those of the tags of a line.
    pub fn of(def: &PlantDef, line: LineId) -> WideAddresses {
        let is_wide = |tag: &&TagDef| tag.calculation.is_none() && tag.point.kind.address_words() != 1;
        let devices = def.devices.iter().filter(|device| device.line == line);
        let of_device = |device: &DeviceDef| {
            let unit = device.unit;
            let wide = |tag: &TagDef| {
                let (table, address, is_read) = (tag.point.table, tag.point.address, tag.access != Access::Write);
                WideAddress { unit, table, address, is_read }
            };
            def.tags_of(device.id).filter(is_wide).map(wide).collect::<Vec<_>>()
        };
        WideAddresses(devices.flat_map(of_device).collect())
    }

    /// A request message with how it counts: two words for each address where one of them is known to hold 32 bits.
    pub fn request<'a>(&self, message: &'a [u8]) -> Request<'a> {
        let (table, writes) = match message.get(1) {
            Some(0x03) => (Table::Holding, false),
            Some(0x04) => (Table::Input, false),
            Some(0x10) => (Table::Holding, true),
            Some(_) | None => return message.into(),
        };
        let &[unit, _, a, b, c, d, ..] = message else { return message.into() };
        let (address, count) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
        let end = u32::from(address) + u32::from(count);
        let is_inside = |wide: &WideAddress| {
            let is_there = address <= wide.address && u32::from(wide.address) < end;
            (wide.unit, wide.table) == (unit, table) && is_there && (writes || wide.is_read)
        };
        Request { message, address_words: if self.0.iter().any(is_inside) { 2 } else { 1 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bus::plan::{UnreadableRanges, blocks},
        plant::{def::Limits, fixture, id::TagId, tag::DataType},
    };

    /// Unit 1 has 32 bits in each of 70 addresses from 7001, and a register of 16 right behind them.
    fn plant() -> PlantDef {
        let mut def = fixture::plant();
        let sample = def.tags[fixture::SV.index()].clone();
        let tag = |place: u16| {
            let mut tag = TagDef { id: TagId(place), ..sample.clone() };
            tag.point.address = 7_001 + place;
            tag.point.kind = if place < 70 { DataType::EnronF32 } else { DataType::U16 };
            tag
        };
        (def.tags, def.alarms) = ((0..=70).map(tag).collect(), Vec::new());
        def.devices[0].limits = Limits::STANDARD;
        def
    }

    #[test]
    fn a_read_of_32_bits_an_address_is_half_as_long() {
        let plan = blocks(&plant(), LineId(0), &UnreadableRanges::default());
        let mut seen: Vec<_> = plan.iter().map(|block| (block.count, block.address_words, block.words())).collect();
        seen.sort_unstable();
        // 62 addresses are what an answer holds; the last register is not in a read of them.
        assert_eq!(seen.iter().map(|(count, ..)| count).sum::<u16>(), 71, "{seen:?}");
        assert!(seen.contains(&(1, 1, 1)) && seen.len() == 3, "{seen:?}");
        assert!(seen.iter().all(|(count, each, words)| *count <= 62 && *words == u32::from(count * each)), "{seen:?}");
    }

    #[test]
    fn a_request_is_known_by_unit_table_and_range() {
        let wide = WideAddresses::of(&plant(), LineId(0));
        for (message, words) in [
            ([1, 3, 0x1B, 0x59, 0, 1], 2),
            ([1, 3, 0x1B, 0x58, 0, 2], 2),
            ([1, 3, 0x1B, 0x58, 0, 1], 1),
            ([1, 3, 0x1B, 0x9F, 0, 1], 1),
            ([1, 4, 0x1B, 0x59, 0, 1], 1),
            ([2, 3, 0x1B, 0x59, 0, 1], 1),
            ([1, 6, 0x1B, 0x59, 0, 1], 1),
            ([1, 16, 0x1B, 0x59, 0, 1], 2),
            ([1, 16, 0x1B, 0x9F, 0, 1], 1),
        ] {
            assert_eq!(wide.request(&message).address_words, words, "{message:02X?}");
        }
    }
}
