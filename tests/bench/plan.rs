//! What the read plan saves: wire time of a scattered map against simpler ways to read it, and how long planning takes.
#![allow(clippy::print_stdout, missing_docs)]
#![allow(clippy::cast_lossless, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

mod alternatives;
#[path = "support/dice.rs"]
mod dice;

use std::{
    hint::black_box,
    time::{Duration, Instant},
};

use dice::Dice;
use sightglass::api::{
    bus::plan::{Block, UnreadableRanges, Wire, blocks, single},
    plant::{
        ByteOrder, DataType, DeviceDef, DeviceId, Limits, LineDef, LineId, PlantDef, Point, Serial, Table, TagDef,
        TagId, Transport,
    },
};

fn device(id: u16) -> DeviceDef {
    let limits = Limits { gap_registers_max: 16, ..Limits::STANDARD };
    DeviceDef { unit: id as u8 + 1, limits, ..DeviceDef::new(DeviceId(id), &format!("D-{id}"), LineId(0)) }
}

/// Tags of mixed types in runs of one to eight, with gaps of up to `gap` registers between the runs.
fn plant(devices: u16, tags: u16, gap: u64, dice: &mut Dice) -> PlantDef {
    let kinds = [
        DataType::U16,
        DataType::I16,
        DataType::F32,
        DataType::U32,
        DataType::U16,
        DataType::U64,
        DataType::Bcd16,
        DataType::I16,
    ];
    let mut next = vec![[0u64; 2]; usize::from(devices)];
    let (mut run, mut place, mut half) = (0, 0, 0);
    let tag = |id| {
        if run == 0 {
            (run, place, half) = (1 + dice.below(8), dice.below(u64::from(devices)) as usize, dice.below(2) as usize);
            next[place][half] += dice.below(gap);
        }
        run -= 1;
        let kind = kinds[dice.below(8) as usize];
        let address = next[place][half] as u16;
        next[place][half] += u64::from(kind.registers());
        let point =
            Point { table: [Table::Holding, Table::Input][half], address, kind, order: ByteOrder::Abcd, field: None };
        TagDef::new(TagId(id), DeviceId(place as u16), &format!("D-{place}.T{id}"), point)
    };
    let tags = (0..tags).map(tag).collect();
    PlantDef {
        name: "scattered".into(),
        lines: vec![LineDef::new(LineId(0), "L1", Transport::rtu("/dev/null", Serial::USUAL))],
        devices: (0..devices).map(device).collect(),
        tags,
        ..PlantDef::default()
    }
}

fn compare(def: &PlantDef) {
    let unreadable = UnreadableRanges::default();
    let plan = blocks(def, LineId(0), &unreadable);
    let ours = alternatives::wire_time(def, &plan);
    println!("{} tags on {} devices, {}", def.tags.len(), def.devices.len(), def.lines[0].transport);
    println!("  our plan          {:4} requests {:8.1} ms", plan.len(), ours.as_secs_f64() * 1e3);
    let tags = alternatives::sorted(def);
    let groups = alternatives::groups(def, &tags);
    let all = |cut: &dyn Fn(&[TagDef], &DeviceDef) -> Vec<Block>| -> Vec<Block> {
        groups.iter().flat_map(|(group, device)| cut(group, device)).collect()
    };
    for (name, rival) in [
        ("one a tag", all(&alternatives::singles)),
        ("fixed 10", all(&|group, device| alternatives::fixed(group, device, 10))),
        ("fixed 60", all(&|group, device| alternatives::fixed(group, device, 60))),
        ("greedy", all(&|group, device| alternatives::greedy(group, device, &unreadable))),
    ] {
        let theirs = alternatives::wire_time(def, &rival);
        let ratio = ours.as_secs_f64() / theirs.as_secs_f64();
        println!(
            "  {name:16}  {:4} requests {:8.1} ms   ours is {ratio:.3} of it",
            rival.len(),
            theirs.as_secs_f64() * 1e3
        );
    }
}

/// Eight tags on one device, a thousand maps: the plan against every way to deal them.
fn against_the_optimum(dice: &mut Dice) {
    let (mut worst, mut cases) = (1.0f64, 0);
    for _ in 0..1000 {
        let def = plant(1, 8, 24, dice);
        let tags = alternatives::sorted(&def);
        let groups = alternatives::groups(&def, &tags);
        let least: Duration = groups
            .iter()
            .map(|(group, device)| alternatives::best_of_all(&def, group, device, &UnreadableRanges::default()))
            .sum();
        let ours = alternatives::wire_time(&def, &blocks(&def, LineId(0), &UnreadableRanges::default()));
        worst = worst.max(ours.as_secs_f64() / least.as_secs_f64());
        cases += 1;
    }
    println!("against the optimum of an exhaustive search: worst ratio {worst:.3} in {cases} maps of 8 tags");
}

fn main() {
    let mut dice = Dice(2026);
    let def = plant(3, 200, 24, &mut dice);
    compare(&def);
    against_the_optimum(&mut dice);
    let many = plant(5, 10_000, 12, &mut dice);
    let times = (0..10).map(|_| {
        let start = Instant::now();
        black_box(blocks(black_box(&many), LineId(0), &UnreadableRanges::default()));
        start.elapsed()
    });
    let best = times.min().unwrap_or_default();
    println!("planning 10 000 tags on 5 devices: {:.2} ms", best.as_secs_f64() * 1e3);
}
