//! Every shipped device against what its own text simulates: each tag that can be read is read by the plan of its line and
//! shows what the device holds.

use std::{collections::BTreeSet, path::Path, sync::Arc, time::Duration};

use super::simulator::Simulator;
use crate::{
    bus::{
        codec, pdu,
        plan::{self, Block, UnreadableRanges},
    },
    plant::{
        Plant, PlantDef, Snapshot,
        def::TagId,
        event::Event,
        exact::Exact,
        scale,
        tag::{Access, Poll, TagDef},
    },
    profile::{self, Kind, Search},
};
use jiff::Timestamp;

#[test]
fn every_tag_of_the_library_is_read_as_its_device_holds_it() {
    let listed = profile::list(&Search::shipped()).into_iter().filter(|listed| listed.kind == Kind::Device);
    let (mut devices, mut tags, mut wrong) = (0, 0, Vec::new());
    for name in listed.map(|listed| listed.name) {
        devices += 1;
        match profile::check(Path::new(&name), &Search::shipped()) {
            Ok(checked) => {
                wrong.extend(checked.warnings.full_lines().map(|warning| format!("{name}: {warning}")));
                tags += read_back(&name, &checked.plant, &mut wrong);
            }
            Err(errors) => wrong.push(format!("{name}: {errors}")),
        }
    }
    assert!(wrong.is_empty(), "{} of {tags} tags are wrong: {wrong:#?}", wrong.len());
    assert!(150 <= devices && 5_000 <= tags, "{devices} devices, {tags} tags");
}

/// Reads all tags of a device as its line does, and says which do not show what it holds; how many there are.
fn read_back(name: &str, def: &PlantDef, wrong: &mut Vec<String>) -> usize {
    let mut def = def.clone();
    let is_readable = |tag: &TagDef| tag.access != Access::Write && tag.calculation.is_none();
    for tag in def.tags.iter_mut().filter(|tag| is_readable(tag) && tag.poll == Poll::Never) {
        tag.poll = Poll::Once;
    }
    let def = Arc::new(def);
    let mut simulator = Simulator::new(&def).expect("a device alone is no rig");
    let sources: BTreeSet<TagId> = def.tags.iter().flat_map(TagDef::needs).collect();
    for tag in def.tags.iter().filter(|tag| is_readable(tag) && !sources.contains(&tag.id) && tag.simulate.is_none()) {
        if let Some(value) = odd_value(tag, &simulator) {
            simulator.set_value(tag.id, value);
        }
    }
    let mut plant = Plant::new(def.clone(), Timestamp::UNIX_EPOCH, 1.0);
    let mut read = BTreeSet::new();
    for line in &def.lines {
        let blocks: Vec<Block> = plan::blocks(&def, line.id, &UnreadableRanges::default());
        // Twice: what is read seldom waits for a power of ten that is read often.
        for block in blocks.iter().chain(&blocks) {
            read.extend(block.tags.iter().copied());
            match answer(&def, block, &mut simulator) {
                Some(event) => drop(plant.on_event(event)),
                None => wrong.push(format!("{name}: {:?} {} {} is refused", block.table, block.address, block.count)),
            }
        }
    }
    let readable: Vec<&TagDef> = def.tags.iter().filter(|tag| is_readable(tag)).collect();
    let shown = plant.snapshot();
    for tag in &readable {
        let why =
            if read.contains(&tag.id) { difference(tag, &shown, &simulator) } else { Some("not read".to_owned()) };
        wrong.extend(why.map(|why| format!("{name}: {} {why}", tag.short)));
    }
    readable.len()
}

/// A value of its own for a tag, so that one that is read from the place of another one is seen.
fn odd_value(tag: &TagDef, simulator: &Simulator) -> Option<f64> {
    let raw = match tag.enum_labels.last() {
        Some((last, _)) => *last,
        None => {
            let (low, high) = tag.point.raw_range().unwrap_or((0, 1_000));
            low.max(0) + i128::from(tag.point.address) * 7 % (high - low.max(0)).clamp(1, 997)
        }
    };
    let raw = Exact::whole(raw);
    let decimals = tag.scaling_decimals(|from| simulator.value(from))?;
    (!tag.is_bad(raw)).then(|| scale::to_value(tag, raw, decimals).near())
}

/// What the device answers to the request of a block.
fn answer(def: &PlantDef, block: &Block, simulator: &mut Simulator) -> Option<Event> {
    let request = block.request();
    let response = simulator.respond(def.device(block.device).line, block.unit, &request[1..])?;
    let (.., words) = pdu::words_read(&request[1..], &response, block.address_words)?;
    let own = |tag: TagId| {
        let point = def.tag(tag).point;
        let start = usize::from(point.address - block.address) * usize::from(block.address_words);
        (point, &words[start..start + usize::from(point.words())])
    };
    let number = |tag: &TagId| {
        let (point, words) = own(*tag);
        codec::decode(point, words).map(|raw| (*tag, raw))
    };
    let text = |tag: &TagId| {
        let (point, words) = own(*tag);
        codec::decode_text(point, words).map(|text| (*tag, text.into()))
    };
    Some(Event::Read {
        at: Timestamp::UNIX_EPOCH,
        device: block.device,
        values: block.tags.iter().filter_map(number).collect(),
        texts: block.tags.iter().filter_map(text).collect(),
        response_time: Duration::ZERO,
        exchange: None,
    })
}

/// How a tag differs from what its device holds; `None` where it does not.
fn difference(tag: &TagDef, shown: &Snapshot, simulator: &Simulator) -> Option<String> {
    if tag.is_text() {
        return shown.text(tag.id).is_none().then(|| format!("has no text: {:?}", shown.sample(tag.id)));
    }
    let held = simulator.value(tag.id);
    let value = shown.sample(tag.id).good_value();
    (held.is_none() || value != held).then(|| format!("shows {:?}, the device holds {held:?}", shown.sample(tag.id)))
}
