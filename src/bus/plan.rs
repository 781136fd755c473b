//! The read plan of a line: tags grouped into blocks, what each costs on the wire, and how busy that makes the line.

use std::time::Duration;

use crate::plant::{
    def::{DeviceDef, DeviceId, Limits, LineDef, LineId, PlantDef, TagId, Transport},
    tag::{Access, Poll, Table, TagDef},
};

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
    pub tags: Vec<TagId>,
    /// How often.
    pub poll: Poll,
    /// Address and count are multiples of this (registers only).
    pub alignment: u16,
}

impl Block {
    /// The request message: unit, function, address, count.
    pub fn request(&self) -> [u8; 6] {
        let ([a, b], [c, d]) = (self.address.to_be_bytes(), self.count.to_be_bytes());
        [self.unit, self.table.read_fc(), a, b, c, d]
    }

    /// Bytes of the answer on a serial line.
    pub fn answer_bytes(&self) -> u32 {
        let count = u32::from(self.count);
        5 + if self.table.is_bits() { count.div_ceil(8) } else { 2 * count }
    }
}

/// The blocks of a line: every readable tag in exactly one, no value split, all within the limits of its device.
pub fn blocks(def: &PlantDef, line: LineId) -> Vec<Block> {
    let on_line = def.devices.iter().filter(|device| device.line == line);
    on_line.flat_map(|device| blocks_of(device, def.tags_of(device.id))).collect()
}

fn blocks_of<'a>(device: &DeviceDef, tags: impl Iterator<Item = &'a TagDef>) -> Vec<Block> {
    let mut tags: Vec<&TagDef> = tags.filter(|tag| tag.access != Access::Write && tag.poll != Poll::Never).collect();
    tags.sort_by_key(|tag| (tag.poll, tag.point.table, tag.point.address, tag.id));
    let mut blocks: Vec<Block> = Vec::new();
    for tag in tags {
        let joined = blocks.last_mut().is_some_and(|block| join(block, tag, &device.limits));
        if !joined {
            blocks.push(single(device, tag));
        }
    }
    blocks
}

/// The block that reads one tag alone.
pub fn single(device: &DeviceDef, tag: &TagDef) -> Block {
    let (address, end) = aligned(tag.point.address, span_end(tag), tag.point.table, &device.limits);
    Block {
        device: device.id,
        unit: device.unit,
        table: tag.point.table,
        address,
        count: (end - u32::from(address)) as u16,
        tags: vec![tag.id],
        poll: tag.poll,
        alignment: device.limits.alignment,
    }
}

/// Takes a tag into a block if it is of the same kind, near enough, and the limits hold.
fn join(block: &mut Block, tag: &TagDef, limits: &Limits) -> bool {
    let (gap_max, count_max) = if block.table.is_bits() {
        // Sixteen bits cost as much on the wire as one register.
        (u32::from(limits.gap_words_max) * 16, u32::from(limits.read_bits_max))
    } else {
        (u32::from(limits.gap_words_max), u32::from(limits.read_words_max))
    };
    let old_end = u32::from(block.address) + u32::from(block.count);
    let gap = u32::from(tag.point.address).saturating_sub(old_end);
    let (_, end) = aligned(block.address, span_end(tag).max(old_end), block.table, limits);
    let count = end - u32::from(block.address);
    let fits = (block.poll, block.table) == (tag.poll, tag.point.table) && gap <= gap_max && count <= count_max;
    if fits {
        block.count = count as u16;
        block.tags.push(tag.id);
    }
    fits
}

fn span_end(tag: &TagDef) -> u32 {
    u32::from(tag.point.address) + u32::from(tag.point.len())
}

/// Start and end moved outwards to multiples of the alignment (registers only).
fn aligned(start: u16, end: u32, table: Table, limits: &Limits) -> (u16, u32) {
    let step = u32::from(limits.alignment.max(1));
    if table.is_bits() { (start, end) } else { (start - (u32::from(start) % step) as u16, end.next_multiple_of(step)) }
}

/// Worst time that a good read takes on its line: request and answer on the wire, two silences, the device's own gap.
/// Modbus over serial line V1.02, 2.5.1; over TCP the wire costs nothing worth counting.
pub fn cost(block: &Block, line: &LineDef, device: &DeviceDef) -> Duration {
    match &line.transport {
        Transport::Serial { serial, .. } => {
            let silence = serial.silence().max(line.gap).max(device.gap);
            serial.char_time() * (8 + block.answer_bytes()) + serial.silence() + silence
        }
        Transport::Tcp { .. } => line.gap.max(device.gap),
    }
}

/// Share of the line's time that its periodic reads take, 0–1 and beyond.
pub fn utilisation(def: &PlantDef, line: LineId) -> f64 {
    blocks(def, line)
        .iter()
        .filter_map(|block| match block.poll {
            Poll::Every(period) => {
                Some(cost(block, def.line(line), def.device(block.device)).as_secs_f64() / period.as_secs_f64())
            }
            Poll::Once | Poll::Never => None,
        })
        .sum()
}

/// The plan in words, a line of text each, for `sightglass check`.
pub fn describe(def: &PlantDef) -> Vec<String> {
    let mut text = Vec::new();
    for line in &def.lines {
        let load = utilisation(def, line.id);
        text.push(String::new());
        text.push(format!("line {}: {}, timeout {} ms", line.name, line.transport, line.timeout.as_millis()));
        text.push(
            "  device      function     wire address             Modicon         count  tags  every    worst case"
                .into(),
        );
        for block in blocks(def, line.id) {
            text.push(block_words(def, line, &block));
        }
        let verdict = if load <= 1.0 { "" } else { "  TOO MUCH: polls will be skipped" };
        text.push(format!("  utilisation {:.1} %{verdict}", load * 100.0));
    }
    text
}

fn block_words(def: &PlantDef, line: &LineDef, block: &Block) -> String {
    let device = def.device(block.device);
    let function = block.table.read_fc();
    let last = block.address + (block.count - 1);
    let every = match block.poll {
        Poll::Every(period) => format!("{} s", period.as_secs_f64()),
        Poll::Once => "once".into(),
        Poll::Never => "never".into(),
    };
    format!(
        "  {:10}  {:11}  {:23}  {:14}  {:5}  {:4}  {:7}  {:.1} ms",
        device.name,
        format!("{function} / 0x{function:02X}"),
        format!("{}–{} / 0x{:04X}", block.address, last, block.address),
        format!("{}–{}", block.table.modicon(block.address), block.table.modicon(last)),
        block.count,
        block.tags.len(),
        every,
        cost(block, line, device).as_secs_f64() * 1e3,
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::{
        fixture,
        tag::{Kind, Point},
    };

    #[test]
    fn neighbours_share_a_block_and_tables_do_not() {
        let plan = blocks(&fixture::plant(), LineId(0));
        let seen: Vec<_> = plan.iter().map(|block| (block.unit, block.table, block.address, block.count)).collect();
        let expect = [
            (1, Table::Input, 1000, 8),
            (1, Table::Holding, 1002, 1),
            (1, Table::Holding, 1019, 1),
            (2, Table::Coil, 3072, 1),
        ];
        assert_eq!(seen, expect);
    }

    /// Transaction times at 11 bits a character and no device delay, as the standard's arithmetic gives them.
    #[test]
    fn costs_are_those_of_the_wire() {
        let mut def = fixture::plant();
        let mut block = blocks(&def, LineId(0)).remove(0);
        for (baud, words, ms) in [(9600, 1, 25.2), (9600, 10, 45.8), (19_200, 125, 154.7), (115_200, 32, 10.9)] {
            let Transport::Serial { serial, .. } = &mut def.lines[0].transport else { panic!("serial") };
            (serial.baud, serial.stop_bits) = (baud, 2);
            block.count = words;
            let cost = cost(&block, &def.lines[0], &def.devices[0]).as_secs_f64() * 1e3;
            assert!((cost - ms).abs() < 0.06, "{baud} baud, {words} words: {cost} ms, expected {ms}");
        }
    }

    #[test]
    fn the_plan_is_told_in_both_number_bases() {
        let text = describe(&fixture::plant()).join("\n");
        for part in ["9600 8N1", "4 / 0x04", "1000–1007 / 0x03E8", "31001–31008", "utilisation"] {
            assert!(text.contains(part), "no {part} in\n{text}");
        }
    }

    proptest! {
        #[test]
        fn every_tag_is_in_one_block_within_the_limits(
            points in proptest::collection::vec((0u16..400, 0usize..4, 0usize..4, 0u8..3), 1..60),
            words_max in 4u16..125, bits_max in 1u16..2000, gap in 0u16..40, alignment in 1u16..3,
        ) {
            let mut def = fixture::plant();
            def.devices[0].limits =
                Limits { read_words_max: words_max, read_bits_max: bits_max, write_words_max: 1, gap_words_max: gap, alignment, in_flight_max: 1 };
            let sample = def.tags[0].clone();
            let tables = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];
            let kinds = [Kind::U16, Kind::F32, Kind::U64, Kind::Bcd32];
            def.tags = points.iter().enumerate().map(|(index, (address, table, kind, poll))| TagDef {
                id: TagId(index as u16),
                point: Point { table: tables[*table], address: *address, kind: kinds[*kind], ..sample.point },
                poll: [Poll::Every(Duration::from_secs(1)), Poll::Once, Poll::Never][usize::from(*poll)],
                ..sample.clone()
            }).collect();
            let plan = blocks(&def, LineId(0));
            for tag in &def.tags {
                let holders: Vec<&Block> = plan.iter().filter(|block| block.tags.contains(&tag.id)).collect();
                prop_assert_eq!(holders.len(), usize::from(tag.poll != Poll::Never));
                for block in holders {
                    prop_assert_eq!(block.table, tag.point.table);
                    prop_assert!(block.address <= tag.point.address);
                    prop_assert!(span_end(tag) <= u32::from(block.address) + u32::from(block.count));
                }
            }
            for block in &plan {
                // A single value that is larger than the limit must be read all the same, and alignment may add to it.
                let max = if block.table.is_bits() { bits_max } else { words_max.max(4 + 2 * (alignment - 1)) };
                prop_assert!(block.count <= max, "{:?}", block);
                if !block.table.is_bits() {
                    prop_assert_eq!((block.address % alignment, block.count % alignment), (0, 0));
                }
            }
        }
    }
}
