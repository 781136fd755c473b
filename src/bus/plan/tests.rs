//! What the plan must keep, and that nothing cheaper exists.

use std::time::Duration;

use proptest::{array::uniform4, option, prelude::*};

use super::*;
use crate::plant::{
    def::{Framing, Limits, LineDef, Parity, Protocol, Rs485, Serial, TableLimits, Transport},
    fixture,
    tag::DataType,
};

#[test]
fn neighbours_share_a_block_and_tables_do_not() {
    let plan = blocks(&fixture::plant(), LineId(0), &UnreadableRanges::default());
    let seen: Vec<_> = plan.iter().map(|block| (block.unit, block.table, block.address, block.count)).collect();
    let expect = [
        (1, Table::Input, 1000, 8),
        (1, Table::Holding, 1002, 1),
        (1, Table::Holding, 1019, 1),
        (2, Table::Coil, 3072, 1),
    ];
    assert_eq!(seen, expect);
}

#[test]
fn what_is_never_polled_is_planned_for_who_asks_only() {
    let mut def = fixture::plant();
    def.tags[fixture::SV.index()].poll = Poll::Never;
    let device = def.tag(fixture::SV).device;
    let none = UnreadableRanges::default();
    let reads = |plan: Vec<Block>| {
        plan.into_iter().find(|block| block.tags.contains(&fixture::SV)).map(|block| (block.poll, block.address))
    };
    assert_eq!(reads(blocks(&def, LineId(0), &none)), None);
    assert_eq!(reads(blocks_with_unpolled(&def, LineId(0), &none, &[])), None);
    let asked = blocks_with_unpolled(&def, LineId(0), &none, &[device]);
    assert_eq!(reads(asked), Some((Poll::Never, 1002)));
    assert!(has_unpolled(&def, device) && !has_unpolled(&fixture::plant(), device));
    // Refused once, it stays on request only.
    let mut refused = none;
    refused.add(def.device(device).unit, Table::Holding, 1002, 1003);
    assert_eq!(reads(blocks_with_unpolled(&def, LineId(0), &refused, &[device])), Some((Poll::Never, 1002)));
}

#[test]
fn a_block_is_as_important_as_its_most_important_tag() {
    let mut def = fixture::plant();
    def.tags[fixture::PV.index()].class = PollClass::Background;
    def.tags[fixture::FAULT.index()].class = PollClass::Critical;
    assert_eq!(blocks(&def, LineId(0), &UnreadableRanges::default())[0].class, PollClass::Critical);
}

fn serial_line(baud: u32, stop_bits: u8, framing: Framing) -> Transport {
    let serial = Serial { baud, stop_bits, data_bits: 8, parity: Parity::None };
    Transport::Serial { port: "/dev/null".into(), serial, framing, rs485: Rs485::Off }
}

/// RTU: the table of the requirements, 11 bits a character. ASCII: 17 + 11 + 4 · words characters of 10 bits, no silences.
#[test]
fn costs_are_those_of_the_wire() {
    let mut def = fixture::plant();
    let block = blocks(&def, LineId(0), &UnreadableRanges::default()).remove(0);
    let tcp = |framing| Transport::Network { protocol: Protocol::Tcp, host: "plc".into(), port: 502, framing };
    for (transport, words, ms) in [
        (serial_line(9600, 2, Framing::Rtu), 1u16, 25.2),
        (serial_line(9600, 2, Framing::Rtu), 10, 45.8),
        (serial_line(9600, 2, Framing::Rtu), 32, 96.2),
        (serial_line(9600, 2, Framing::Rtu), 125, 309.4),
        (serial_line(19_200, 2, Framing::Rtu), 125, 154.7),
        (serial_line(115_200, 2, Framing::Rtu), 32, 10.9),
        (serial_line(9600, 1, Framing::Ascii), 1, 33.3),
        (serial_line(9600, 1, Framing::Ascii), 10, 70.8),
        (tcp(Framing::Mbap), 125, 1.0 + (12.0 + 9.0 + 250.0) * 80e-6),
        (tcp(Framing::Rtu), 125, 1.0 + (8.0 + 5.0 + 250.0) * 80e-6),
    ] {
        def.lines[0].transport = transport;
        let wire = Wire::new(&def.lines[0], &def.devices[0]);
        let cost = wire.read(block.table, u32::from(words)).as_secs_f64() * 1e3;
        assert!((cost - ms).abs() < 0.06, "{}, {words} words: {cost} ms, expected {ms}", def.lines[0].transport);
    }
}

#[test]
fn a_silent_unit_costs_its_timeout_and_a_gap_of_the_line_counts() {
    let def = fixture::plant();
    let line = LineDef { gap: Duration::from_millis(10), ..def.lines[0].clone() };
    let wire = Wire::new(&line, &def.devices[0]);
    // 8 characters of 10 bits at 9600 are 8.33 ms, the gap is longer than 3.5 characters.
    let failing = wire.failing(Duration::from_millis(300)).as_secs_f64() * 1e3;
    assert!((failing - 318.33).abs() < 0.01, "{failing}");
}

fn tag(id: u16, address: u16, table: Table, kind: DataType, poll: Poll) -> TagDef {
    let sample = fixture::plant().tags.remove(0);
    let kind = if table.is_bits() { DataType::Bool } else { kind };
    TagDef { id: TagId(id), point: Point { table, address, kind, ..sample.point }, poll, ..sample }
}

const SECOND: Poll = Poll::Every(Duration::from_secs(1));

fn words(addresses: &[u16]) -> PlantDef {
    let mut def = fixture::plant();
    let tag = |(id, address): (usize, &u16)| tag(id as u16, *address, Table::Holding, DataType::U16, SECOND);
    def.tags = addresses.iter().enumerate().map(tag).collect();
    def
}

fn ranges(def: &PlantDef, unreadable: &UnreadableRanges) -> Vec<(u32, u32)> {
    kept(def, unreadable).iter().map(Block::range).collect()
}

#[test]
fn a_request_is_not_filled_if_that_costs_a_longer_gap() {
    let mut def = words(&[0, 6, 7, 12]);
    def.devices[0].limits.read_registers_max = 8;
    // Greedy would take 0 to 7 and leave 12 alone: 9 words with a gap of 5; this reads 7.
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 1), (6, 13)]);
}

#[test]
fn a_gap_costs_little_over_tcp_and_much_in_ascii() {
    let mut def = words(&[0, 30]);
    def.devices[0].limits.gap_registers_max = 40;
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 1), (30, 31)]);
    def.lines[0].transport = Transport::tcp("plc", 502);
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 31)]);
    let mut def = words(&[0, 7]);
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 8)], "in RTU six words are cheaper than 20 characters");
    def.lines[0].transport = serial_line(9600, 1, Framing::Ascii);
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 8)], "24 characters against 28");
    let mut def = words(&[0, 9]);
    def.lines[0].transport = serial_line(9600, 1, Framing::Ascii);
    assert_eq!(ranges(&def, &UnreadableRanges::default()), [(0, 1), (9, 10)], "32 characters against 28");
}

#[test]
fn fields_of_a_word_and_twins_are_read_together() {
    let def = words(&[5, 5, 5, 6]);
    let plan = blocks(&def, LineId(0), &UnreadableRanges::default());
    assert_eq!(plan.len(), 1);
    assert_eq!((plan[0].range(), plan[0].tags.len()), ((5, 7), 4));
}

/// Plays a device that refuses every read which touches one of `missing`, until the plan holds; counts the requests.
fn bisection(def: &PlantDef, missing: &[u32], count_max: u32) -> (UnreadableRanges, usize) {
    let (mut unreadable, mut search, mut asked) = (UnreadableRanges::default(), RangeBisection::default(), 0);
    let plan =
        |unreadable: &UnreadableRanges| blocks(def, LineId(0), unreadable).into_iter().rev().collect::<Vec<Block>>();
    let (mut todo, mut waiting) = (plan(&unreadable), Vec::new());
    while let Some(block) = todo.pop() {
        waiting.retain(|waits| *waits != block.range());
        asked += 1;
        assert!(asked < 1000, "the search ends");
        let (start, end) = block.range();
        if end - start > count_max || missing.iter().any(|is_unreadable| (start..end).contains(is_unreadable)) {
            // Behind what waits, as in a schedule.
            todo.splice(0..0, search.refused(def, &unreadable, &block).unwrap_or_default());
        } else {
            search.answered(&block);
            assert!(!unreadable.disproved(&block));
        }
        let found = search.conclude(&mut unreadable);
        if found.replan {
            todo = plan(&unreadable);
        }
        // What was refused waits, and the others are read meanwhile.
        waiting.extend(todo.iter().filter(|block| found.disbelieves(block)).map(Block::range));
        todo.sort_by_key(|block| !waiting.contains(&block.range()));
    }
    (unreadable, asked)
}

/// The plan without the tags that are refused and asked for alone.
fn kept(def: &PlantDef, unreadable: &UnreadableRanges) -> Vec<Block> {
    let refused = refused(def, LineId(0), unreadable);
    blocks(def, LineId(0), unreadable).into_iter().filter(|block| !refused.contains(&block.tags[0])).collect()
}

#[test]
fn a_missing_register_is_found_and_not_read_over_again() {
    // Every second register: 15 gaps, the one at 13 is missing.
    let def = words(&(0..16).map(|n| 2 * n).collect::<Vec<u16>>());
    let (unreadable, asked) = bisection(&def, &[13], 125);
    assert_eq!(ranges(&def, &unreadable), [(0, 13), (14, 31)]);
    assert!(refused(&def, LineId(0), &unreadable).is_empty());
    assert!(asked <= 12, "{asked} requests for 16 tags");
}

#[test]
fn a_missing_tag_is_reported_and_its_neighbours_are_read() {
    let def = words(&[0, 1, 2, 3, 4, 5, 6, 7]);
    let (unreadable, asked) = bisection(&def, &[5], 125);
    assert_eq!(refused(&def, LineId(0), &unreadable), [TagId(5)]);
    assert_eq!(ranges(&def, &unreadable), [(0, 5), (6, 8)]);
    assert_eq!(asked, 11, "the whole, six parts, the whole again, and the three blocks of the new plan");
}

#[test]
fn the_only_register_that_is_there_is_found_behind_refused_ones() {
    let def = words(&[10, 32, 42]);
    assert_eq!(refused(&def, LineId(0), &bisection(&def, &[10, 32], 125).0), [TagId(0), TagId(1)]);
}

#[test]
fn a_refused_range_is_probed_seldom_and_trusted_when_it_answers() {
    let def = words(&[0, 1, 2]);
    let mut unreadable = holes_at(&[1]);
    let plan = blocks(&def, LineId(0), &unreadable);
    let seen: Vec<_> = plan.iter().map(|block| (block.range(), block.poll, block.class)).collect();
    let minute = Poll::Every(Duration::from_secs(60));
    assert_eq!(
        seen,
        [
            ((0, 1), SECOND, PollClass::Normal),
            ((2, 3), SECOND, PollClass::Normal),
            ((1, 2), minute, PollClass::Background)
        ]
    );
    let mut search = RangeBisection::default();
    assert_eq!(search.refused(&def, &unreadable, &plan[2]), None, "that is known");
    assert!(!unreadable.disproved(&plan[0]) && unreadable.disproved(&plan[2]));
    assert_eq!(ranges(&def, &unreadable), [(0, 3)]);
}

#[test]
fn a_device_that_stumbles_once_loses_nothing() {
    let def = words(&[0, 1, 2, 3]);
    let (mut unreadable, mut search) = (UnreadableRanges::default(), RangeBisection::default());
    for _ in 0..3 {
        let whole = blocks(&def, LineId(0), &unreadable).remove(0);
        let parts = search.refused(&def, &unreadable, &whole).expect("something new");
        assert!(!search.conclude(&mut unreadable).replan, "the parts have not answered");
        parts.iter().for_each(|part| search.answered(part));
        assert!(search.conclude(&mut unreadable).replan, "back to the whole block");
        assert_eq!(ranges(&def, &unreadable), [(0, 4)]);
        search.answered(&whole);
    }
}

#[test]
fn a_device_that_takes_fewer_registers_gets_shorter_blocks() {
    let def = words(&(0..40).collect::<Vec<u16>>());
    let (unreadable, _) = bisection(&def, &[], 16);
    assert!(refused(&def, LineId(0), &unreadable).is_empty(), "nothing is missing");
    assert!(ranges(&def, &unreadable).iter().all(|(start, end)| end - start <= 16));
}

type Row = (u16, usize, usize, u8);

/// A plant with these tags on its first device: (address, table, kind, poll).
fn plant_of(rows: &[Row], limits: Limits, transport: Transport) -> PlantDef {
    let mut def = fixture::plant();
    def.devices[0].limits = limits;
    def.lines[0].transport = transport;
    let tables = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];
    let kinds = [DataType::U16, DataType::F32, DataType::U64, DataType::Bcd32];
    let polls = [SECOND, Poll::Once, Poll::Never];
    let tag = |(id, row): (usize, &Row)| tag(id as u16, row.0, tables[row.1], kinds[row.2], polls[usize::from(row.3)]);
    def.tags = rows.iter().enumerate().map(tag).collect();
    def
}

fn limits() -> impl Strategy<Value = Limits> {
    let own = (option::of(4u16..125), option::of(0u16..40), option::of(0u16..3));
    let own = own.prop_map(|(read_max, gap_max, power)| TableLimits {
        read_max,
        gap_max,
        alignment: power.map(|power| 1 << power),
    });
    (4u16..125, 1u16..2000, 0u16..40, 1u16..3, uniform4(own)).prop_map(|(words, bits, gap, alignment, of_tables)| {
        let limits = Limits { read_registers_max: words, read_bits_max: bits, ..Limits::STANDARD };
        Limits { gap_registers_max: gap, alignment, of_tables, ..limits }
    })
}

fn transport() -> impl Strategy<Value = Transport> {
    prop_oneof![
        Just(serial_line(9600, 1, Framing::Rtu)),
        Just(serial_line(115_200, 1, Framing::Rtu)),
        Just(serial_line(9600, 1, Framing::Ascii)),
        Just(Transport::tcp("plc", 502)),
    ]
}

fn holes_at(addresses: &[u16]) -> UnreadableRanges {
    let mut unreadable = UnreadableRanges::default();
    for address in addresses {
        unreadable.add(
            fixture::plant().device(fixture::TIC).unit,
            Table::Holding,
            u32::from(*address),
            u32::from(*address) + 1,
        );
    }
    unreadable
}

/// With two-register alignment the four words at 35 take six, which is more than a request of four may ask: the values at
/// 34 and 36 share one all the same.
#[test]
fn a_value_too_long_for_a_request_does_not_part_its_neighbours() {
    let limits = Limits { read_registers_max: 4, gap_registers_max: 0, alignment: 2, ..Limits::STANDARD };
    let def = plant_of(&[(34, 3, 0, 0), (35, 3, 2, 0), (36, 3, 0, 0)], limits, serial_line(9600, 1, Framing::Rtu));
    let seen: Vec<_> =
        blocks(&def, LineId(0), &UnreadableRanges::default()).iter().map(|b| (b.address, b.count)).collect();
    assert_eq!(seen, [(34, 4), (34, 6)]);
}

proptest! {
    #[test]
    fn every_tag_is_in_one_block_within_the_limits(
        rows in proptest::collection::vec((0u16..400, 0usize..4, 0usize..4, 0u8..3), 1..60),
        limits in limits(), transport in transport(), missing in proptest::collection::vec(0u16..400, 0..20),
    ) {
        let def = plant_of(&rows, limits, transport);
        let unreadable = holes_at(&missing);
        let plan = blocks(&def, LineId(0), &unreadable);
        let refused = refused(&def, LineId(0), &unreadable);
        for tag in &def.tags {
            let holders: Vec<&Block> = plan.iter().filter(|block| block.tags.contains(&tag.id)).collect();
            prop_assert_eq!(holders.len(), usize::from(tag.poll != Poll::Never));
            for block in holders {
                let (start, end) = block.range();
                prop_assert_eq!(block.table, tag.point.table);
                prop_assert!(start <= u32::from(tag.point.address) && end_of(tag.point) <= end, "split: {:?}", tag);
            }
        }
        for block in &plan {
            // A single value that is larger than the limit must be read all the same, and alignment may add to it.
            let step = limits.step(block.table);
            let longest = if block.table.is_bits() { step } else { 4 + 2 * (step - 1) };
            prop_assert!(block.count <= limits.most(block.table).max(longest), "{:?}", block);
            let (start, end) = block.range();
            let over = unreadable.touch(block.unit, block.table, start, end);
            prop_assert_eq!(over, refused.contains(&block.tags[0]), "{:?} and a is_unreadable", block);
            prop_assert!(!over || block.tags.len() == 1);
            prop_assert_eq!((block.address % step, block.count % step), (0, 0));
        }
    }

    #[test]
    fn no_way_to_deal_the_tags_is_cheaper(
        rows in proptest::collection::vec((0u16..60, 3usize..4, 0usize..4, 0u8..1), 1..9),
        limits in limits(), words in 4u16..30, transport in transport(),
        missing in proptest::collection::vec(0u16..60, 0..4),
    ) {
        let def = plant_of(&rows, Limits { read_registers_max: words, ..limits }, transport);
        let unreadable = holes_at(&missing);
        let refused = refused(&def, LineId(0), &unreadable);
        let mut tags = alternatives::sorted(&def);
        tags.retain(|tag| !refused.contains(&tag.id));
        let least: Duration = alternatives::groups(&def, &tags).iter()
            .map(|(group, device)| alternatives::best_of_all(&def, group, device, &unreadable)).sum();
        prop_assert_eq!(alternatives::wire_time(&def, &kept(&def, &unreadable)), least);
    }

    #[test]
    fn the_plan_is_never_dearer_than_simple_ones(
        rows in proptest::collection::vec((0u16..600, 0usize..4, 0usize..4, 0u8..2), 1..120),
        limits in limits(), transport in transport(),
    ) {
        // Fixed blocks read over gaps of any length, so the limit of gaps must not stand in the way of the plan.
        let def = plant_of(&rows, Limits { gap_registers_max: 200, alignment: 1, of_tables: Limits::STANDARD.of_tables, ..limits }, transport);
        let ours = alternatives::wire_time(&def, &blocks(&def, LineId(0), &UnreadableRanges::default()));
        let tags = alternatives::sorted(&def);
        let groups = alternatives::groups(&def, &tags);
        let (mut single, mut greedy, mut short, mut long) = <(Vec<_>, Vec<_>, Vec<_>, Vec<_>)>::default();
        for (group, device) in &groups {
            single.extend(alternatives::singles(group, device));
            greedy.extend(alternatives::greedy(group, device, &UnreadableRanges::default()));
            short.extend(alternatives::fixed(group, device, 10));
            long.extend(alternatives::fixed(group, device, 60));
        }
        for (name, rival) in [("one a tag", single), ("greedy", greedy), ("10 words", short), ("60 words", long)] {
            prop_assert!(ours <= alternatives::wire_time(&def, &rival), "{} is below {:?}", name, ours);
        }
    }

    #[test]
    fn all_registers_but_the_missing_ones_are_read_in_the_end(
        addresses in proptest::collection::btree_set(0u16..80, 1..40),
        missing in proptest::collection::btree_set(0u32..80, 0..12),
    ) {
        let def = words(&addresses.iter().copied().collect::<Vec<u16>>());
        let missing: Vec<u32> = missing.into_iter().collect();
        // A device that refuses everything is not believed.
        prop_assume!(!def.tags.iter().all(|tag| missing.contains(&u32::from(tag.point.address))));
        let (unreadable, _) = bisection(&def, &missing, 125);
        for tag in &def.tags {
            let gone = missing.contains(&u32::from(tag.point.address));
            prop_assert_eq!(refused(&def, LineId(0), &unreadable).contains(&tag.id), gone);
        }
        for (start, end) in ranges(&def, &unreadable) {
            prop_assert!(!missing.iter().any(|is_unreadable| (start..end).contains(is_unreadable)));
        }
    }
}
