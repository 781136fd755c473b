//! The cheapest way to read a group of tags, by dynamic programming over the places where a request may end.

use std::{ops::Range, time::Duration};

use super::{Extent, Holes, cost::Wire};
use crate::plant::{def::DeviceDef, tag::TagDef};

/// Cuts tags of one device, table and period, sorted by address and length, into runs that are one request each, so that
/// the requests together take the least time on the wire (and are fewest among equals).
///
/// Only runs of neighbours need be looked at: of any two requests where none contains the other, the later one can take
/// over every tag that it covers from its start on. `best[n]` is the least cost of the first n values; the last request
/// of them begins at some value, no further back than the limits of the device allow.
pub(super) fn cut<'a, 'b>(
    tags: &'b [&'a TagDef],
    device: &DeviceDef,
    wire: Wire,
    holes: &Holes,
) -> Vec<&'b [&'a TagDef]> {
    let values = values(tags);
    let mut best: Vec<(Duration, usize)> = vec![(Duration::ZERO, 0)];
    let mut first = Vec::with_capacity(values.len());
    for last in 0..values.len() {
        let mut end = 0;
        let mut found = None;
        for start in (0..=last).rev() {
            end = values[start].end.max(end);
            let extent = Extent::of(tags[values[start].tags.start].point, end, device);
            let alone = start == last;
            // From here on the run only grows: what is forbidden now stays forbidden.
            if !alone && (values[start + 1].gap > extent.gap_max(device) || !extent.allowed(device, holes)) {
                break;
            }
            let (spent, requests) = best[start];
            let total = (spent + wire.read(extent.table, extent.count()), requests + 1);
            if found.is_none_or(|(least, _)| total < least) {
                found = Some((total, start));
            }
        }
        let (least, start) = found.expect("a value alone is always a run");
        best.push(least);
        first.push(start);
    }
    let mut runs = Vec::new();
    let mut left = values.len();
    while let Some(&start) = left.checked_sub(1).and_then(|last| first.get(last)) {
        runs.push(&tags[values[start].tags.start..values[left - 1].tags.end]);
        left = start;
    }
    runs.reverse();
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
