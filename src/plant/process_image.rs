//! The values of all tags: raw responses become samples, faults and age make them uncertain, changes are stored.

mod factor;
mod fault_effect;
mod presence;
mod redefine;

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use self::fault_effect::{FaultEffect, effect_of};
use super::{
    calculation::Calculator,
    def::{PlantDef, TagId},
    exact::Exact,
    fault::Fault,
    heard::{Heard, Stated},
    identity::Identities,
    record::Record,
    sample::{Cause, Quality, Sample},
    scale,
    tag::{Access, Decimals, Poll, StorePolicy, TagDef},
};
use crate::plant::time::{elapsed, is_later_hour};

/// A value is uncertain after this many poll periods without an answer, and bad after [`PERIODS_BAD`].
pub const PERIODS_UNCERTAIN: u32 = 3;
/// See [`PERIODS_UNCERTAIN`].
pub const PERIODS_BAD: u32 = 10;

/// A value that is never polled becomes uncertain after this time.
const NEVER_READ_AGAIN: Duration = Duration::from_secs(60);

/// What is known of every tag.
#[derive(Debug, Clone)]
pub struct ProcessImage {
    def: Arc<PlantDef>,
    /// What was last read, by tag; `None` when there is no value to stand on.
    raw: Vec<Option<Reading>>,
    /// What was read after it and waits for the power of ten of its own cycle, by tag.
    waiting: Vec<Option<Reading>>,
    pub samples: Vec<Sample>,
    /// The text of tags that hold text, by tag; `None` while there is none to stand on. Shared with snapshots.
    pub texts: Arc<Vec<Option<Arc<str>>>>,
    /// Decimals that the device last announced, by tag: for showing what was, while it does not answer.
    decimals_seen: Vec<u8>,
    /// How often each tag comes, by tag.
    heard: Vec<Heard>,
    stated: Stated,
    /// What the history last got, by tag.
    stored: Vec<Option<Sample>>,
    /// Tags whose sample was set since records were last taken; a tag may be here twice.
    touched: Vec<TagId>,
    /// Tags whose value depends on this one (decimals, fault word), by tag.
    dependents: Vec<Vec<TagId>>,
    calculator: Calculator,
    pub identities: Identities,
}

/// A raw number, when it was read, and what has made it uncertain since.
#[derive(Debug, Clone, Copy)]
struct Reading {
    raw: Exact,
    at: Timestamp,
    uncertain: Option<Cause>,
    /// The decimals of its cycle, for a tag that is scaled by a power of ten.
    decimals: Option<i8>,
}

impl ProcessImage {
    /// Nothing read yet, as of `at`.
    pub fn new(def: Arc<PlantDef>, at: Timestamp) -> ProcessImage {
        let count = def.tags.len();
        let mut dependents = vec![Vec::new(); count];
        for tag in &def.tags {
            for from in tag.value_needs() {
                dependents[from.index()].push(tag.id);
            }
        }
        let unread = |tag: &TagDef| match tag.access == Access::Write || tag.is_read() || def.listens_to(tag.id) {
            true => Cause::NotRead,
            false => Cause::OnRequest,
        };
        let mut image = ProcessImage {
            raw: vec![None; count],
            waiting: vec![None; count],
            samples: def.tags.iter().map(|tag| Sample::bad(unread(tag), at)).collect(),
            texts: Arc::new(vec![None; count]),
            decimals_seen: vec![0; count],
            heard: vec![Heard::default(); count],
            stated: Stated::default(),
            stored: vec![None; count],
            // That nothing is known is a fact to store too.
            touched: def.tags.iter().map(|tag| tag.id).collect(),
            dependents,
            calculator: Calculator::new(&def.tags),
            identities: Identities::default(),
            def: def.clone(),
        };
        let stated = def.tags.iter().filter(|tag| tag.stated.is_some());
        stated.for_each(|tag| image.set(tag.id, Sample::bad(Cause::NotRead, at)));
        image
    }

    /// Takes the values of all tags from elsewhere.
    pub fn set_all(&mut self, samples: &[Sample]) {
        for (own, sample) in self.samples.iter_mut().zip(samples) {
            *own = *sample;
        }
    }

    pub fn sample(&self, tag: TagId) -> Sample {
        self.samples[tag.index()]
    }

    /// Takes the raw numbers of one answer. A fault word or decimals among them count for their dependents at once.
    pub fn read(&mut self, values: &[(TagId, impl Into<Exact> + Copy)], at: Timestamp) {
        self.read_as(values, None, at);
    }

    /// Takes what may be an answer to another request: as uncertain, where nothing better is known.
    pub fn read_unproven(&mut self, values: &[(TagId, Exact)], texts: &[(TagId, Arc<str>)], at: Timestamp) {
        let is_new = |tag: &TagId| !self.sample(*tag).quality.is_good();
        let values: Vec<_> = values.iter().filter(|(tag, _)| is_new(tag)).copied().collect();
        let texts: Vec<_> = texts.iter().filter(|(tag, _)| is_new(tag)).cloned().collect();
        self.read_as(&values, Some(Cause::Unproven), at);
        self.read_texts(&texts, at);
        texts.iter().for_each(|(tag, _)| self.mark_uncertain(*tag, Cause::Unproven));
    }

    /// Takes the texts of one answer.
    pub fn read_texts(&mut self, texts: &[(TagId, Arc<str>)], at: Timestamp) {
        for (tag, text) in texts {
            if self.texts[tag.index()].as_ref() != Some(text) {
                Arc::make_mut(&mut self.texts)[tag.index()] = Some(text.clone());
            }
            self.heard[tag.index()].hear(at);
            self.set(*tag, Sample::new(None, Quality::Good, at));
        }
    }

    /// A request for these tags failed: they lose trust, and at once their value where the fault says that there is none.
    /// What was only not heard stands for as long as its period says.
    pub fn failed(&mut self, tags: &[TagId], fault: Fault, at: Timestamp) {
        let def = self.def.clone();
        for tag in tags.iter().filter(|tag| def.tag(**tag).calculation.is_none()) {
            let waits = def.listens_to(*tag) && self.sample(*tag).quality.is_good();
            match effect_of(fault) {
                FaultEffect::Uncertain(cause) if waits => self.heard[tag.index()].miss(cause),
                FaultEffect::Uncertain(cause) => self.doubt(*tag, cause, at),
                FaultEffect::Gone(cause) => self.drop_value(*tag, cause, at),
            }
        }
    }

    /// A tag was written and not read back, because of a fault or because nothing else was asked for: its value is uncertain
    /// until it is read again.
    pub fn written(&mut self, tag: TagId, fault: Option<Fault>, at: Timestamp) {
        let cause = fault.map_or(Cause::NotReadBack, |fault| match effect_of(fault) {
            // A write that failed does not say that there is no value.
            FaultEffect::Uncertain(cause) | FaultEffect::Gone(cause) => cause,
        });
        self.doubt(tag, cause, at);
    }

    /// The last value of a device that is down is bad, not uncertain. The reading is marked all the same: what has made it bad
    /// may go before it is read again.
    fn doubt(&mut self, tag: TagId, cause: Cause, at: Timestamp) {
        match self.sample(tag).quality {
            Quality::Bad(Cause::NotRead | Cause::OnRequest | Cause::Reloaded) => self.set(tag, Sample::bad(cause, at)),
            Quality::Bad(_) => {
                if let Some(reading) = &mut self.raw[tag.index()] {
                    reading.uncertain = Some(cause);
                }
            }
            Quality::Good | Quality::Uncertain(_) => self.mark_uncertain(tag, cause),
        }
    }

    /// Lets values age: uncertain after three missed periods, bad after ten.
    pub fn age(&mut self, at: Timestamp) {
        let def = self.def.clone();
        for tag in &def.tags {
            let sample = self.sample(tag.id);
            let stored = self.stored[tag.id.index()];
            if stored.is_none_or(|stored| self.is_due(tag, sample, Some(stored), at)) {
                self.touched.push(tag.id);
            }
            // It is as old as its inputs, which grow old themselves.
            if tag.calculation.is_some() {
                continue;
            }
            let listens = def.listens_to(tag.id);
            let (period, cause) = match tag.poll {
                poll if listens => {
                    let heard = &self.heard[tag.id.index()];
                    (heard.period(poll), heard.missed.unwrap_or(Cause::NotHeard))
                }
                Poll::Every(period) => (period, Cause::Stale),
                Poll::Once => continue,
                // Known from a write or a look; it may have changed since.
                Poll::Never => {
                    if sample.quality.is_good() && NEVER_READ_AGAIN < elapsed(sample.at, at) {
                        self.mark_uncertain(tag.id, Cause::OnRequest);
                    }
                    continue;
                }
            };
            let age = elapsed(sample.at, at);
            if sample.quality.is_bad() || sample.is_stated() {
                continue;
            } else if period * PERIODS_BAD < age {
                self.drop_value(tag.id, cause, at);
            } else if period * PERIODS_UNCERTAIN < age && sample.quality.is_good() {
                self.mark_uncertain(tag.id, cause);
            }
        }
    }

    /// Calculates the tags of which an input was set since records were last taken, each after its inputs.
    pub fn calculate(&mut self) {
        let mut calculator = std::mem::take(&mut self.calculator);
        for (tag, sample) in calculator.changed(&self.def, &self.touched, &self.samples) {
            self.set(tag, sample);
        }
        self.calculator = calculator;
    }

    /// Lets every total go on from its last stored value, or from 0.
    pub fn restore_totals(&mut self, stored: &[(TagId, f64)]) {
        self.touched.extend(self.calculator.restore_totals(stored));
    }

    /// The records due at `at`: changes beyond the deadband, changes of quality, and unchanged values at their interval, so
    /// that a silent stretch in the history means "no data".
    /// A loss of quality is stored with the time at which it arose, not with the time of the value.
    pub fn records(&mut self, at: Timestamp) -> Vec<Record> {
        let mut records = Vec::new();
        let mut touched = std::mem::take(&mut self.touched);
        touched.sort_unstable();
        touched.dedup();
        for tag in touched.drain(..).map(|tag| self.def.tag(tag)).filter(|tag| tag.is_stored()) {
            let sample = self.samples[tag.id.index()];
            let stored = self.stored[tag.id.index()];
            if !self.is_due(tag, sample, stored, at) {
                continue;
            }
            // A good value that has not been read since it was last stored still stands: it is stored again as of now.
            let fresh = sample.quality.is_good() && stored.is_none_or(|stored| stored.at < sample.at);
            let record = if fresh { sample } else { Sample { at, ..sample } };
            self.stored[tag.id.index()] = Some(record);
            records.push(Record::Sample(tag.id, record));
        }
        // Its room is used again.
        self.touched = touched;
        records
    }

    /// Whether a sample is to be stored, after what was `stored` last.
    fn is_due(&self, tag: &TagDef, sample: Sample, stored: Option<Sample>, at: Timestamp) -> bool {
        let Some(stored) = stored else { return true };
        let waited = Duration::try_from(at.duration_since(stored.at)).unwrap_or_default();
        stored.quality != sample.quality
            // Once an hour in any case: what a past instant was like need not be looked for further back.
            || !sample.quality.is_good() && is_later_hour(stored.at, at)
            || match (stored.exact(), sample.exact()) {
                (Some(old), Some(new)) => {
                    let changed = match tag.store {
                        StorePolicy::Always => stored.at < sample.at,
                        StorePolicy::Change => (new - old).abs() > Exact::from(self.deadband(tag)),
                        StorePolicy::Never => false,
                    };
                    changed || (sample.quality.is_good() && tag.store_every <= waited)
                }
                (None, None) => false,
                (None, Some(_)) | (Some(_), None) => true,
            }
    }

    /// The largest change that is not stored. Half a digit: what a person would not see, and rounding alone.
    fn deadband(&self, tag: &TagDef) -> f64 {
        tag.deadband.unwrap_or_else(|| 0.5 * 10f64.powi(-i32::from(self.shown_decimals(tag))))
    }

    /// Decimals that the device announces for a tag: they scale its raw number. 0 for tags with fixed decimals.
    pub fn scaling_decimals(&self, tag: &TagDef) -> Option<i8> {
        tag.scaling_decimals(|from| self.sample(from).scaling_value())
    }

    /// Decimals to show a tag with: those that the device announces, or announced last.
    pub fn shown_decimals(&self, tag: &TagDef) -> u8 {
        match tag.decimals {
            Decimals::Fixed(decimals) => decimals,
            Decimals::From(_) => self.scaling_decimals(tag).map_or(self.decimals_seen[tag.id.index()], Decimals::shown),
            Decimals::PowerFrom(_) => self.decimals_seen[tag.id.index()],
        }
    }

    /// The raw number last read, if the sample still stands on it.
    pub fn good_raw(&self, tag: TagId) -> Option<Exact> {
        self.sample(tag).good_value()?;
        let (def, reading) = (self.def.tag(tag), self.raw[tag.index()]?);
        // One of another power of ten is none that can be compared.
        let is_of_now = def.decimals.power_source().is_none() || reading.decimals == self.scaling_decimals(def);
        is_of_now.then_some(reading.raw)
    }

    fn mark_uncertain(&mut self, tag: TagId, cause: Cause) {
        self.waiting[tag.index()] = None;
        if let Some(reading) = &mut self.raw[tag.index()] {
            reading.uncertain = Some(cause);
        }
        let sample = self.sample(tag);
        // A text is kept beside the sample, which has no number to show for it.
        let uncertain = match self.texts[tag.index()] {
            Some(_) => Sample { quality: Quality::Uncertain(cause), ..sample },
            None => sample.uncertain(cause),
        };
        self.set(tag, uncertain);
    }

    fn drop_value(&mut self, tag: TagId, cause: Cause, at: Timestamp) {
        (self.raw[tag.index()], self.waiting[tag.index()]) = (None, None);
        if self.texts[tag.index()].is_some() {
            Arc::make_mut(&mut self.texts)[tag.index()] = None;
        }
        self.set(tag, Sample::bad(cause, at));
    }

    /// A value that stays bad for the same cause keeps the time at which it became bad.
    fn set(&mut self, tag: TagId, sample: Sample) {
        let before = self.samples[tag.index()];
        let sample = self.stated.instead_of(self.def.tag(tag), sample);
        let sample = self.if_present(tag, sample);
        let lasts = (sample.quality.is_bad() || sample.is_stated()) && sample.quality == before.quality;
        self.samples[tag.index()] = if lasts { Sample { at: before.at, ..sample } } else { sample };
        self.touched.push(tag);
    }

    /// Makes the sample of a tag from its reading and all that it depends on. It stays uncertain until the tag itself
    /// is read again.
    fn recompute_sample(&mut self, tag: TagId) {
        let Some(reading @ Reading { raw, at, uncertain, .. }) = self.raw[tag.index()] else {
            return self.look_for(tag);
        };
        let def = self.def.clone();
        let tag = def.tag(tag);
        let scaling = self.decimals_of(tag, reading);
        if let Some(decimals) = scaling {
            self.decimals_seen[tag.id.index()] = Decimals::shown(decimals);
        }
        let fault_word = tag.quality_from.map(|(from, mask)| (self.sample(from), self.good_raw(from), mask));
        let no_value = tag.is_bad(raw);
        let sample = match (no_value, scaling) {
            (true, _) => Sample::bad(Cause::SensorFault, at),
            (false, None) => Sample::bad(Cause::Unscaled, at),
            (false, Some(decimals)) => Sample::good(scale::to_value(tag, raw, decimals), at),
        };
        let sample = match fault_word {
            None => sample,
            // The raw number: a status word may be signed, and is never meant to be scaled.
            Some((word, bits, mask)) => match bits {
                Some(word) if word.bits() & mask != 0 => Sample::bad(Cause::SensorFault, at),
                Some(_) => sample,
                None => sample.uncertain(word.quality.cause().unwrap_or(Cause::NotRead)),
            },
        };
        let by_unproven = tag.decimals.source().is_some_and(|from| self.sample(from).is_unproven());
        let sample = match uncertain.or(by_unproven.then_some(Cause::Unproven)) {
            Some(cause) if !sample.quality.is_bad() => sample.uncertain(cause),
            Some(_) | None => sample,
        };
        self.set(tag.id, sample);
    }
}

#[cfg(test)]
mod tests;
