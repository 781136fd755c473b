//! The cheapest way to read a group of tags, by dynamic programming over the places where a request may end.

use std::{ops::Range, time::Duration};

use super::{Extent, UnreadableRanges, cost::Wire};
use crate::plant::{def::DeviceDef, tag::TagDef};

/// Cuts tags of one device, table and period, sorted by address and length, into runs that are one request each, so that
/// the requests together take the least time on the wire (and are fewest among equals).
///
/// Only runs of neighbours need be looked at: of any two requests where none contains the other, the later one can take
/// over every tag that it covers from its start on. That fails only for a value that is longer than a request may be: it
/// can be read alone and nothing can join it, so it is set aside first. `best[n]` is the least cost of the first n values;
/// the last request of them begins at some value, no further back than the limits of the device allow.
pub(super) fn cut<'a>(
    tags: &[&'a TagDef],
    device: &DeviceDef,
    wire: Wire,
    unreadable: &UnreadableRanges,
) -> Vec<Vec<&'a TagDef>> {
    let too_long = |value: &Value| {
        let alone = Extent::new(tags[value.tags.start].point, value.end, device);
        !alone.fits(device, unreadable)
    };
    let (mut runs, mut values): (Vec<Vec<&TagDef>>, Vec<Value>) = (Vec::new(), Vec::new());
    // The registers of a value that was set aside are no gap, but one before it still lies between its neighbours.
    let mut gap = 0;
    for value in self::values(tags) {
        gap = value.gap.max(gap);
        if too_long(&value) {
            runs.push(tags[value.tags].to_vec());
        } else {
            values.push(Value { gap: std::mem::take(&mut gap), ..value });
        }
    }
    let mut best: Vec<(Duration, usize)> = vec![(Duration::ZERO, 0)];
    let mut first = Vec::with_capacity(values.len());
    for last in 0..values.len() {
        let mut end = 0;
        let mut found = None;
        for start in (0..=last).rev() {
            end = values[start].end.max(end);
            let extent = Extent::new(tags[values[start].tags.start].point, end, device);
            let alone = start == last;
            // From here on the run only grows: what is forbidden now stays forbidden.
            if !alone
                && (values[start + 1].gap > device.limits.gap(extent.table) || !extent.allowed(device, unreadable))
            {
                break;
            }
            let (spent, requests) = best[start];
            let total = (spent + wire.read(extent.table, extent.words()), requests + 1);
            if found.is_none_or(|(least, _)| total < least) {
                found = Some((total, start));
            }
        }
        let (least, start) = found.expect("a value alone is always a run");
        best.push(least);
        first.push(start);
    }
    let mut left = values.len();
    while let Some(&start) = left.checked_sub(1).and_then(|last| first.get(last)) {
        let run = values[start..left].iter().flat_map(|value| &tags[value.tags.clone()]);
        runs.push(run.copied().collect());
        left = start;
    }
    runs.sort_by_key(|run| (run[0].point.address, run[0].point.len(), run[0].id));
    runs
}

/// A value on the wire: tags on the very same registers (fields of one word, twins) are one.
struct Value {
    tags: Range<usize>,
    end: u32,
    /// Registers or bits before it that no tag of the group uses.
    gap: u32,
}

fn values(tags: &[&TagDef]) -> Vec<Value> {
    let mut values: Vec<Value> = Vec::new();
    let (mut used, mut count) = (0, 0);
    for same in tags.chunk_by(|a, b| (a.point.address, a.point.len()) == (b.point.address, b.point.len())) {
        let start = u32::from(same[0].point.address);
        let end = start + u32::from(same[0].point.len());
        values.push(Value { tags: count..count + same.len(), end, gap: start.saturating_sub(used) });
        used = used.max(end);
        count += same.len();
    }
    values
}
