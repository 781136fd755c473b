//! Which kind of device a unit is: what the signatures of device profiles ask, and whether the answers fit. Pure.

use std::sync::Arc;

use super::codec;
use crate::plant::{
    PlantDef,
    def::{DeviceDef, PROBED_NUMBERS_MIN, PROBES_MIN, Probe},
    exact::Exact,
    live::AddressSpan,
    number::{to_i8, to_u16},
    scale,
    tag::{Decimals, Point, TagDef},
};
use crate::t;

/// Share of the probes that must fit.
const PERCENT_MIN: usize = 80;

/// Good words from an address on, as many as were read of these; fewer where one was refused.
pub type Words<'a> = &'a dyn Fn(AddressSpan) -> Vec<u16>;

/// How well a unit fits a signature.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fit {
    /// Probes that fit.
    pub fits: usize,
    /// Probes in all.
    pub of: usize,
    /// Different numbers among those that fit.
    pub different: usize,
}

impl Fit {
    /// Is it this kind of device?
    pub fn is_enough(self) -> bool {
        let share = PERCENT_MIN * self.of <= 100 * self.fits;
        share && PROBES_MIN <= self.fits && PROBED_NUMBERS_MIN <= self.different
    }
}

/// A profile, how well a unit fits it, and why it does not.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// Its device is the only one of this plant.
    pub def: Arc<PlantDef>,
    /// How well.
    pub fit: Fit,
    /// The probes that do not fit.
    pub misses: Vec<Miss>,
}

/// A probe that does not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Miss {
    /// `PV`.
    pub tag: String,
    /// The raw number that was read; `None`: none was.
    pub read: Option<f64>,
    /// What fits.
    pub expected: Expected,
}

/// `P-DP is 7, expected 0, 1, 2`.
impl std::fmt::Display for Miss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Miss { tag, read, expected } = self;
        f.write_str(&match read {
            Some(read) => t!("{tag} is {read}, expected {expected}", tag, read, expected),
            None => t!("{tag} cannot be read", tag),
        })
    }
}

/// What a probe expects.
#[derive(Debug, Clone, PartialEq)]
pub enum Expected {
    /// A raw number in one of these.
    Ranges(Vec<(f64, f64)>),
    /// The same bits as those from this tag on.
    Bits(String),
}

impl std::fmt::Display for Expected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let one = |(low, high): &(f64, f64)| if low == high { low.to_string() } else { format!("{low}…{high}") };
        match self {
            Expected::Ranges(ranges) => f.write_str(&ranges.iter().map(one).collect::<Vec<_>>().join(", ")),
            Expected::Bits(tag) => f.write_str(tag),
        }
    }
}

/// All of these profiles, that which fits best first.
pub fn ranking(known: &[Arc<PlantDef>], words: Words) -> Vec<Ranked> {
    let ranked = known.iter().filter_map(|def| {
        let device = def.devices.first()?;
        Some(Ranked { def: Arc::clone(def), fit: fit(def, device, words), misses: misses(def, device, words) })
    });
    let mut ranked: Vec<Ranked> = ranked.collect();
    let share = |ranked: &Ranked| (1_000 * ranked.fit.fits).checked_div(ranked.fit.of).unwrap_or(0);
    // Those without a signature come last.
    ranked.sort_by_key(|one| std::cmp::Reverse((one.fit.is_enough(), share(one), one.fit.fits, 0 < one.fit.of)));
    ranked
}

fn misses(def: &PlantDef, device: &DeviceDef, words: Words) -> Vec<Miss> {
    let missed = device.signature.iter().filter_map(|probe| {
        let tag = def.tag(probe.tag);
        let read = raw_of(tag.point, words);
        let expected = match probe.bits {
            Some(bit) => Expected::Bits(def.tag(bit).short.clone()),
            None => Expected::Ranges(probe.ranges.clone()),
        };
        let fits = read.is_some_and(|raw| holds(def, probe, raw, words));
        (!fits).then(|| Miss { tag: tag.short.clone(), read, expected })
    });
    missed.collect()
}

/// What must be read to know how well a unit fits, and what its values need to be shown: registers beside each other
/// together.
pub fn spans(def: &PlantDef, device: &DeviceDef) -> Vec<AddressSpan> {
    let probes = device.signature.iter().flat_map(|probe| {
        let word = span_of(def.tag(probe.tag).point);
        [Some(word), bits_of(def, probe)].into_iter().flatten()
    });
    let needed = def.tags_of(device.id).flat_map(|tag| {
        let unit = tag.unit_from.as_ref().map(|(from, _)| *from);
        tag.decimals.source().into_iter().chain(unit).map(|from| span_of(def.tag(from).point))
    });
    let mut all: Vec<AddressSpan> = probes.chain(needed).collect();
    all.sort_unstable();
    let mut merged: Vec<AddressSpan> = Vec::new();
    for span in all {
        match merged.last_mut().filter(|last| last.table == span.table && span.range().start <= last.range().end) {
            Some(last) => last.count = to_u16(last.range().end.max(span.range().end) - last.range().start),
            None => merged.push(span),
        }
    }
    merged
}

/// How well what was read fits the signature of a device.
pub fn fit(def: &PlantDef, device: &DeviceDef, words: Words) -> Fit {
    let good = device
        .signature
        .iter()
        .filter_map(|probe| raw_of(def.tag(probe.tag).point, words).filter(|raw| holds(def, probe, *raw, words)));
    let mut numbers: Vec<f64> = good.collect();
    let fits = numbers.len();
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    Fit { fits, of: device.signature.len(), different: numbers.len() }
}

/// The profile that a unit fits best, of those that it fits well enough: most probes, then the largest share.
pub fn best<'a>(known: &'a [Arc<PlantDef>], words: Words) -> Option<(&'a Arc<PlantDef>, Fit)> {
    let fits = known.iter().filter_map(|def| Some((def, fit(def, def.devices.first()?, words))));
    let enough = fits.filter(|(_, fit)| fit.is_enough());
    enough.max_by(|(_, a), (_, b)| (a.fits, a.fits * b.of).cmp(&(b.fits, b.fits * a.of)))
}

/// Decimals and unit of a tag as the device says; `None` where it was not read or says nothing of use.
pub fn scaling(def: &PlantDef, tag: &TagDef, words: Words) -> Option<(i8, String)> {
    let value = |of| raw_of(def.tag(of).point, words).map(|raw| scale::to_value(def.tag(of), raw, 0));
    let decimals = match tag.decimals {
        Decimals::Fixed(decimals) => to_i8(decimals),
        Decimals::From(_) | Decimals::PowerFrom(_) => tag.scaling_decimals(value)?,
    };
    Some((decimals, tag.unit_by(value)?.to_owned()))
}

fn holds(def: &PlantDef, probe: &Probe, raw: f64, words: Words) -> bool {
    if let Some(span) = bits_of(def, probe) {
        let bits = words(span);
        let word = bits.iter().rev().fold(0, |word, bit| word << 1 | u32::from(*bit != 0));
        return bits.len() == usize::from(span.count) && f64::from(word) == raw;
    }
    probe.ranges.iter().any(|(low, high)| (*low..=*high).contains(&raw))
}

fn raw_of(point: Point, words: Words) -> Option<f64> {
    let span = span_of(point);
    let read = words(span);
    (read.len() == usize::from(span.count)).then(|| codec::decode(point, &read).map(Exact::near)).flatten()
}

fn span_of(point: Point) -> AddressSpan {
    AddressSpan { table: point.table, address: point.address, count: point.len() }
}

fn bits_of(def: &PlantDef, probe: &Probe) -> Option<AddressSpan> {
    let first = def.tag(probe.bits?).point;
    Some(AddressSpan { count: 16, ..span_of(first) })
}

#[cfg(test)]
mod tests;
