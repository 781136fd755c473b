//! By what a device is recognised: the raw numbers of some of its tags.

use super::{
    diagnostic::Problems,
    names::{Scope, check_number},
    raw_pattern::RawPattern,
    reader::At,
    schema::SignatureTable,
};
use crate::plant::{def::Probe, exact::Exact, tag::TagDef};

/// By what the device is recognised.
pub(super) fn probes(table: &SignatureTable, scope: &Scope, problems: &mut Problems) -> Vec<Probe> {
    let mut found = Vec::new();
    for At { value: probe, at } in &table.probes {
        let Some(tag) = probe.tag.as_ref().and_then(|name| scope.tag(name, problems)) else { continue };
        check_number(*at, tag, problems);
        let bits = probe.bits.as_ref().and_then(|name| scope.tag(name, problems));
        if let Some(bit) = bits.filter(|bit| !bit.point.table.is_bits() || tag.point.len() != 1) {
            problems.add(*at, format!("{} and {} are no word and bit", tag.name, bit.name)).label("bits");
        }
        let is: Vec<f64> = probe.is.iter().filter_map(|number| probed(*number, tag, problems)).collect();
        let ranges = match (probe.range, &probe.bits, probe.is.is_empty()) {
            (Some(At { value: [low, high], at }), None, true) => {
                if high < low {
                    problems.add(at, format!("{low} to {high} is empty")).label("expected [least, greatest]");
                }
                vec![(low, high)]
            }
            (None, Some(_), true) => Vec::new(),
            (None, None, _) if !probe.is.is_empty() => is.into_iter().map(|number| (number, number)).collect(),
            _ => {
                let problem = problems.add(*at, "a probe says what the raw number must be");
                problem.label("expected one of `is`, `range` and `bits`");
                continue;
            }
        };
        found.push(Probe { tag: tag.id, ranges, bits: bits.map(|bit| bit.id) });
    }
    found
}

/// The raw number of a probe; one that the tag can never hold would never be recognised.
fn probed(is: At<RawPattern>, tag: &TagDef, problems: &mut Problems) -> Option<f64> {
    let meant = tag.point.raw_number(is.value.number, is.value.is_pattern).number();
    if meant.is_none() {
        let problem = problems.add(is.at, format!("{} never reads as {}", tag.name, is.value.number));
        problem.label(format!("expected a raw number of {}", tag.point.kind));
    }
    meant.map(Exact::near)
}
