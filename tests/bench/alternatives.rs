//! Alternative ways to cut tags into requests: what the read plan is compared with, in its tests and its bench.

use std::time::Duration;

use super::{Block, DeviceDef, PlantDef, TagDef, UnreadableRanges, Wire, single};

/// Wire time of one read of each block.
pub fn wire_time(def: &PlantDef, blocks: &[Block]) -> Duration {
    let of_block = |block: &Block| {
        let device = def.device(block.device);
        Wire::new(def.line(device.line), device).read(block.table, u32::from(block.count))
    };
    blocks.iter().map(of_block).sum()
}

/// Tags of one device, table and period, by address: what is cut.
pub fn groups<'a>(def: &PlantDef, tags: &'a [TagDef]) -> Vec<(&'a [TagDef], DeviceDef)> {
    let key = |tag: &TagDef| (tag.device.0, tag.poll, tag.point.table);
    tags.chunk_by(|a, b| key(a) == key(b)).map(|group| (group, def.device(group[0].device).clone())).collect()
}

/// The order in which tags must stand to be cut.
pub fn sorted(def: &PlantDef) -> Vec<TagDef> {
    let mut tags = def.tags.clone();
    tags.sort_by_key(|tag| (tag.device.0, tag.poll, tag.point.table, tag.point.address, tag.point.len(), tag.id));
    tags
}

/// One request a tag.
pub fn singles(group: &[TagDef], device: &DeviceDef) -> Vec<Block> {
    group.iter().map(|tag| single(device, tag)).collect()
}

/// As long as the next tag may join, it does.
pub fn greedy(group: &[TagDef], device: &DeviceDef, unreadable: &UnreadableRanges) -> Vec<Block> {
    runs(group, |run| joined(group, run, device, unreadable).is_some())
        .iter()
        .filter_map(|run| joined(group, run, device, unreadable))
        .collect()
}

/// Always so many registers (or sixteen times so many bits) from the first tag that is not read yet, or as many as the
/// device allows; whatever lies between.
pub fn fixed(group: &[TagDef], device: &DeviceDef, words: u32) -> Vec<Block> {
    let table = group[0].point.table;
    let max = (words * if table.is_bits() { 16 } else { 1 }).min(device.limits.most(table).into());
    let within = |run: &[&TagDef]| {
        let start = single(device, run[0]).range().0;
        run.iter().all(|tag| single(device, tag).range().1 <= start + max)
    };
    let block = |run: &Vec<&TagDef>| Block {
        count: max.max(u32::from(single(device, run[0]).count)) as u16,
        tags: run.iter().map(|tag| tag.id).collect(),
        ..single(device, run[0])
    };
    runs(group, within).iter().map(block).collect()
}

/// The cheapest of all ways to deal tags to requests, neighbours or not: for up to eight tags.
pub fn best_of_all(def: &PlantDef, group: &[TagDef], device: &DeviceDef, unreadable: &UnreadableRanges) -> Duration {
    fn deal<'a>(
        rest: &'a [TagDef],
        runs: &mut Vec<Vec<&'a TagDef>>,
        price: &impl Fn(&[Vec<&TagDef>]) -> Duration,
    ) -> Duration {
        let Some((tag, rest)) = rest.split_first() else { return price(runs) };
        runs.push(vec![tag]);
        let mut least = deal(rest, runs, price);
        runs.pop();
        for run in 0..runs.len() {
            runs[run].push(tag);
            least = least.min(deal(rest, runs, price));
            runs[run].pop();
        }
        least
    }
    let price = |runs: &[Vec<&TagDef>]| {
        let blocks: Option<Vec<Block>> = runs.iter().map(|run| joined(group, run, device, unreadable)).collect();
        blocks.map_or(Duration::MAX, |blocks| wire_time(def, &blocks))
    };
    deal(group, &mut Vec::new(), &price)
}

fn runs<'a>(group: &'a [TagDef], fits: impl Fn(&[&'a TagDef]) -> bool) -> Vec<Vec<&'a TagDef>> {
    let mut runs: Vec<Vec<&TagDef>> = Vec::new();
    for tag in group {
        match runs.last_mut() {
            Some(run) => {
                run.push(tag);
                if !fits(run) {
                    run.pop();
                    runs.push(vec![tag]);
                }
            }
            None => runs.push(vec![tag]),
        }
    }
    runs
}

/// One request for some tags of a group, if limits, gaps and unreadable allow it; one tag always may.
fn joined(group: &[TagDef], run: &[&TagDef], device: &DeviceDef, unreadable: &UnreadableRanges) -> Option<Block> {
    let first = single(device, run[0]);
    if run.len() == 1 {
        return Some(first);
    }
    let range =
        |tag: &TagDef| (u32::from(tag.point.address), u32::from(tag.point.address) + u32::from(tag.point.len()));
    let blocks = || run.iter().map(|tag| single(device, tag).range());
    let (start, end) = (blocks().map(|range| range.0).min()?, blocks().map(|range| range.1).max()?);
    let (max, gap_max) = (u32::from(device.limits.most(first.table)), device.limits.gap(first.table));
    let wanted = (run.iter().map(|tag| range(tag).0).min()?, run.iter().map(|tag| range(tag).1).max()?);
    let (mut used, mut near) = (wanted.0, true);
    for (from, to) in group.iter().map(range).filter(|(from, to)| wanted.0 < *to && *from < wanted.1) {
        near &= from <= used + gap_max;
        used = used.max(to);
    }
    // Several values on the same registers are one, whatever its length.
    let same = run.iter().all(|tag| range(tag) == range(run[0]));
    let fits = same || (end - start <= max && near && !unreadable.touch(device.unit, first.table, start, end));
    fits.then(|| Block {
        address: start as u16,
        count: (end - start) as u16,
        tags: run.iter().map(|tag| tag.id).collect(),
        ..first
    })
}
