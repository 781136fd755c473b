//! By what a device is recognised: the raw numbers of some of its tags.

use super::{
    diagnostic::{Problems, Span},
    names::{Scope, check_number},
    raw_pattern::RawPattern,
    reader::At,
    schema::SignatureTable,
};
use crate::plant::{
    def::{PROBED_NUMBERS_MIN, PROBES_MIN, Probe},
    exact::Exact,
    tag::{Access, TagDef},
};

/// By what the device is recognised.
pub(super) fn probes(table: &SignatureTable, scope: &Scope, problems: &mut Problems) -> Vec<Probe> {
    let mut found = Vec::new();
    for At { value: probe, at } in &table.probes {
        let Some(tag) = probe.tag.as_ref().and_then(|name| scope.tag(name, problems)) else { continue };
        check_number(*at, tag, problems);
        if tag.point.kind.address_words() != 1 {
            let problem = problems.add(*at, format!("{} is not a 16-bit register", tag.name));
            problem.label("a device is recognised before it is known how it counts");
        }
        let bits = probe.bits.as_ref().and_then(|name| scope.tag(name, problems));
        if let Some(bit) = bits.filter(|bit| !bit.point.table.is_bits() || tag.point.len() != 1) {
            problems.add(*at, format!("{} and {} are not a word and a bit", tag.name, bit.name)).label("bits");
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
        check_probe(tag, &ranges, *at, problems);
        found.push(Probe { tag: tag.id, ranges, bits: bits.map(|bit| bit.id) });
    }
    if found.len() == table.probes.len() {
        check_signature(table, &found, problems);
    }
    found
}

/// A probe that nothing can answer never fits.
fn check_probe(tag: &TagDef, ranges: &[(f64, f64)], at: Span, problems: &mut Problems) {
    if tag.access == Access::Write {
        problems.add(at, format!("{} is never read: this probe can never fit", tag.name)).label("expected another tag");
    }
    let Some((low, high)) = tag.point.raw_range() else { return };
    let holds = |(least, most): &(f64, f64)| Exact::whole(low).near() <= *most && *least <= Exact::whole(high).near();
    if !ranges.is_empty() && !ranges.iter().any(holds) {
        let problem = problems.add(at, format!("{} never reads as this: this probe can never fit", tag.name));
        problem.label(format!("a raw number of {} is {low} to {high}", tag.point.kind));
    }
}

/// Too few probes, or too few numbers among them, and no device is ever recognised.
fn check_signature(table: &SignatureTable, probes: &[Probe], problems: &mut Problems) {
    let count = probes.len();
    if count < PROBES_MIN {
        let problem = problems.add(table.at, format!("a signature of {count} probes can never fit"));
        problem.label(format!("expected at least {PROBES_MIN}: this many must fit"));
        return;
    }
    let is_one = |probe: &Probe| probe.bits.is_none() && probe.ranges.iter().all(|(low, high)| low == high);
    let mut numbers: Vec<f64> = probes.iter().flat_map(|probe| &probe.ranges).map(|(low, _)| *low).collect();
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    if probes.iter().all(is_one) && numbers.len() < PROBED_NUMBERS_MIN {
        let problem = problems.add(table.at, "this signature can never fit: too few different numbers");
        problem.label(format!("expected {PROBED_NUMBERS_MIN} different numbers among its probes"));
    }
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
