//! The values of all tags: raw answers become samples, doubts and ages take their trust away, changes are stored.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    def::{DeviceId, PlantDef, TagId},
    event::{ExceptionCode, Fault},
    record::Record,
    sample::{Cause, Quality, Sample},
    scale,
    tag::{Bound, Decimals, Poll, TagDef},
};
use crate::plant::number::{to_i64, to_u8};

/// A value is uncertain after so many poll periods without an answer, and bad after [`PERIODS_BAD`].
pub const PERIODS_UNCERTAIN: u32 = 3;
/// See [`PERIODS_UNCERTAIN`].
pub const PERIODS_BAD: u32 = 10;
/// An unchanged good value is stored again after this time, so that a silent stretch in the history means "no data".
pub const STORE_EVERY: Duration = Duration::from_secs(60);

/// More decimals than any device announces.
const DECIMALS_MAX: f64 = 6.0;
/// A value that is never read by itself is doubted after this time.
const NEVER_READ_AGAIN: Duration = Duration::from_secs(60);

/// What is known of every tag.
#[derive(Debug, Clone)]
pub struct ProcessImage {
    def: Arc<PlantDef>,
    /// What was last read, by tag; `None` when there is no value to stand on.
    raw: Vec<Option<Reading>>,
    samples: Vec<Sample>,
    /// The text of tags that hold text, by tag; `None` while there is none to stand on. Shared with snapshots.
    texts: Arc<Vec<Option<Arc<str>>>>,
    /// Decimals that the device last announced, by tag: for showing what was, while it does not answer.
    decimals_seen: Vec<u8>,
    /// What the history last got, by tag.
    stored: Vec<Option<Sample>>,
    /// Tags whose sample was set since records were last taken; a tag may be here twice.
    touched: Vec<TagId>,
    /// Tags whose value depends on this one (decimals, fault word), by tag.
    dependents: Vec<Vec<TagId>>,
}

/// A raw number, when it was read, and what has made it doubtful since.
#[derive(Debug, Clone, Copy)]
struct Reading {
    raw: f64,
    at: Timestamp,
    doubt: Option<Cause>,
}

impl ProcessImage {
    /// Nothing read yet, as of `at`.
    pub fn new(def: Arc<PlantDef>, at: Timestamp) -> ProcessImage {
        let count = def.tags.len();
        let mut dependents = vec![Vec::new(); count];
        for tag in &def.tags {
            for from in needs(tag) {
                dependents[from.index()].push(tag.id);
            }
        }
        ProcessImage {
            raw: vec![None; count],
            samples: vec![Sample::bad(Cause::NotRead, at); count],
            texts: Arc::new(vec![None; count]),
            decimals_seen: vec![0; count],
            stored: vec![None; count],
            // That nothing is known is a fact to store too.
            touched: def.tags.iter().map(|tag| tag.id).collect(),
            dependents,
            def,
        }
    }

    /// All samples, by tag.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The sample of a tag.
    pub fn sample(&self, tag: TagId) -> Sample {
        self.samples[tag.index()]
    }

    /// Takes the raw numbers of one answer. A fault word or decimals among them count for their dependents at once.
    pub fn read(&mut self, values: &[(TagId, f64)], at: Timestamp) {
        for (tag, raw) in values {
            self.raw[tag.index()] = Some(Reading { raw: *raw, at, doubt: None });
        }
        for (tag, _) in values {
            self.settle(*tag);
        }
        for (tag, _) in values {
            for dependent in self.dependents[tag.index()].clone() {
                self.settle(dependent);
            }
        }
    }

    /// The texts, by tag.
    pub fn texts(&self) -> &Arc<Vec<Option<Arc<str>>>> {
        &self.texts
    }

    /// Takes the texts of one answer.
    pub fn read_texts(&mut self, texts: &[(TagId, Arc<str>)], at: Timestamp) {
        for (tag, text) in texts {
            if self.texts[tag.index()].as_ref() != Some(text) {
                Arc::make_mut(&mut self.texts)[tag.index()] = Some(text.clone());
            }
            self.set(*tag, Sample { value: None, quality: Quality::Good, at });
        }
    }

    /// A request for these tags failed: they lose trust, and at once their value where the fault says that there is none.
    pub fn failed(&mut self, tags: &[TagId], fault: Fault, at: Timestamp) {
        for tag in tags {
            match judge(fault) {
                // The last value of a device that is known to be gone is not doubtful but past.
                // The reading is doubted all the same: what has made it bad may go before it is read again.
                Verdict::Doubt(cause) if self.sample(*tag).quality == Quality::Bad(Cause::NotRead) => {
                    self.set(*tag, Sample::bad(cause, at));
                }
                Verdict::Doubt(cause) if self.sample(*tag).quality.is_bad() => {
                    if let Some(reading) = &mut self.raw[tag.index()] {
                        reading.doubt = Some(cause);
                    }
                }
                Verdict::Doubt(cause) => self.doubt(*tag, cause),
                Verdict::Gone(cause) => self.drop_value(*tag, cause, at),
            }
        }
    }

    /// Everything of a device is gone at once.
    pub fn gone(&mut self, device: DeviceId, cause: Cause, at: Timestamp) {
        let def = self.def.clone();
        for tag in def.tags_of(device) {
            if self.sample(tag.id).quality != Quality::Bad(cause) {
                self.drop_value(tag.id, cause, at);
            }
        }
    }

    /// Lets values age: uncertain after three missed periods, bad after ten.
    pub fn age(&mut self, at: Timestamp) {
        let def = self.def.clone();
        for tag in &def.tags {
            let sample = self.sample(tag.id);
            let stored = self.stored[tag.id.index()];
            if stored.is_none_or(|stored| is_due(tag, sample, Some(stored), at)) {
                self.touched.push(tag.id);
            }
            let period = match tag.poll {
                Poll::Every(period) => period,
                Poll::Once => continue,
                // Known from a write or a look; it may have changed since.
                Poll::Never if sample.quality.is_good() => NEVER_READ_AGAIN / PERIODS_UNCERTAIN,
                Poll::Never => continue,
            };
            let age = Duration::try_from(at.duration_since(sample.at)).unwrap_or_default();
            if sample.quality.is_bad() {
                continue;
            } else if period * PERIODS_BAD < age {
                self.drop_value(tag.id, Cause::Stale, at);
            } else if period * PERIODS_UNCERTAIN < age && sample.quality.is_good() {
                self.doubt(tag.id, Cause::Stale);
            }
        }
    }

    /// The records due at `at`: changes beyond the deadband, changes of quality, and unchanged values once a minute.
    /// Doubts are stored with the time at which they arose, not with the time of the value that they doubt.
    pub fn records(&mut self, at: Timestamp) -> Vec<Record> {
        let mut records = Vec::new();
        let mut touched = std::mem::take(&mut self.touched);
        touched.sort_unstable();
        touched.dedup();
        for tag in touched.drain(..).map(|tag| self.def.tag(tag)).filter(|tag| tag.store) {
            let sample = self.samples[tag.id.index()];
            let stored = &mut self.stored[tag.id.index()];
            if !is_due(tag, sample, *stored, at) {
                continue;
            }
            // A good value that has not been read since it was last stored still stands: it is stored again as of now.
            let fresh = sample.quality.is_good() && stored.is_none_or(|stored| stored.at < sample.at);
            let record = if fresh { sample } else { Sample { at, ..sample } };
            *stored = Some(record);
            records.push(Record::Sample(tag.id, record));
        }
        // Its room is used again.
        self.touched = touched;
        records
    }

    /// Decimals that the device announces for a tag: they scale its raw number. 0 for tags with fixed decimals.
    pub fn scaling_decimals(&self, tag: &TagDef) -> Option<u8> {
        match tag.decimals {
            Decimals::Fixed(_) => Some(0),
            Decimals::From(from) => {
                // A register that holds anything else would scale every value to nothing.
                let known =
                    self.sample(from).good_value().filter(|n| n.fract() == 0.0 && (0.0..=DECIMALS_MAX).contains(n));
                known.map(to_u8)
            }
        }
    }

    /// Decimals to show a tag with: those that the device announces, or announced last.
    pub fn shown_decimals(&self, tag: &TagDef) -> u8 {
        match tag.decimals {
            Decimals::Fixed(decimals) => decimals,
            Decimals::From(_) => self.scaling_decimals(tag).unwrap_or(self.decimals_seen[tag.id.index()]),
        }
    }

    /// A bound as it stands now; `Err` names the tag that is not known.
    pub fn bound(&self, bound: Bound) -> Result<f64, TagId> {
        match bound {
            Bound::Fixed(value) => Ok(value),
            Bound::From(from) => self.sample(from).good_value().ok_or(from),
        }
    }

    /// The raw number last read, if the sample still stands on it.
    pub fn good_raw(&self, tag: TagId) -> Option<f64> {
        self.sample(tag).good_value()?;
        self.raw[tag.index()].map(|reading| reading.raw)
    }

    fn doubt(&mut self, tag: TagId, cause: Cause) {
        if let Some(reading) = &mut self.raw[tag.index()] {
            reading.doubt = Some(cause);
        }
        let sample = self.sample(tag);
        // A text is kept beside the sample, which has no number to show for it.
        let doubted = match self.texts[tag.index()] {
            Some(_) => Sample { quality: Quality::Uncertain(cause), ..sample },
            None => sample.uncertain(cause),
        };
        self.set(tag, doubted);
    }

    fn drop_value(&mut self, tag: TagId, cause: Cause, at: Timestamp) {
        self.raw[tag.index()] = None;
        if self.texts[tag.index()].is_some() {
            Arc::make_mut(&mut self.texts)[tag.index()] = None;
        }
        self.set(tag, Sample::bad(cause, at));
    }

    /// A value that stays bad for the same reason has been so since it became it.
    fn set(&mut self, tag: TagId, sample: Sample) {
        let before = self.samples[tag.index()];
        let lasts = sample.quality.is_bad() && sample.quality == before.quality;
        self.samples[tag.index()] = if lasts { Sample { at: before.at, ..sample } } else { sample };
        self.touched.push(tag);
    }

    /// Makes the sample of a tag from its reading and all that it depends on. A doubt stays until the tag itself is
    /// read again: nobody else's answer revives it.
    fn settle(&mut self, tag: TagId) {
        let Some(Reading { raw, at, doubt }) = self.raw[tag.index()] else { return };
        let def = self.def.clone();
        let tag = def.tag(tag);
        if let Some(decimals) = self.scaling_decimals(tag) {
            self.decimals_seen[tag.id.index()] = decimals;
        }
        let fault_word = tag.quality_from.map(|(from, mask)| (self.sample(from), self.good_raw(from), mask));
        let no_value = tag.bad_if.iter().any(|bad| *bad as f64 == raw);
        let sample = match (no_value, self.scaling_decimals(tag)) {
            (true, _) => Sample::bad(Cause::SensorFault, at),
            (false, None) => Sample::bad(Cause::Unscaled, at),
            (false, Some(decimals)) => Sample::good(scale::to_value(tag, raw, decimals), at),
        };
        let sample = match fault_word {
            None => sample,
            // The raw number: a status word may be signed, and is never meant to be scaled.
            Some((word, bits, mask)) => match bits {
                Some(bits) if to_i64(bits).cast_unsigned() & mask != 0 => Sample::bad(Cause::SensorFault, at),
                Some(_) => sample,
                None => sample.uncertain(word.quality.cause().unwrap_or(Cause::NotRead)),
            },
        };
        let sample = match doubt {
            Some(cause) if !sample.quality.is_bad() => sample.uncertain(cause),
            Some(_) | None => sample,
        };
        self.set(tag.id, sample);
    }
}

/// The tags that a tag's value needs.
fn needs(tag: &TagDef) -> impl Iterator<Item = TagId> {
    let decimals = match tag.decimals {
        Decimals::From(from) => Some(from),
        Decimals::Fixed(_) => None,
    };
    decimals.into_iter().chain(tag.quality_from.map(|(from, _)| from))
}

enum Verdict {
    Doubt(Cause),
    Gone(Cause),
}

/// What a fault means for the values that were asked for.
fn judge(fault: Fault) -> Verdict {
    match fault {
        Fault::Timeout => Verdict::Doubt(Cause::Timeout),
        Fault::Crc { .. }
        | Fault::Lrc { .. }
        | Fault::NotHex(_)
        | Fault::Truncated { .. }
        | Fault::WrongUnit { .. }
        | Fault::WrongFunction { .. }
        | Fault::WrongLength { .. }
        | Fault::WrongEcho
        | Fault::OutOfSync => Verdict::Doubt(Cause::Corrupt),
        // 05 acknowledge and 06 busy pass; any other exception means that there is no such value.
        Fault::Exception(ExceptionCode(0x05 | 0x06)) => Verdict::Doubt(Cause::Exception),
        Fault::Exception(_) => Verdict::Gone(Cause::Exception),
        Fault::NotANumber => Verdict::Gone(Cause::SensorFault),
        Fault::NotConnected => Verdict::Gone(Cause::NotConnected),
        Fault::BackedOff => Verdict::Gone(Cause::DeviceDown),
    }
}

fn is_due(tag: &TagDef, sample: Sample, stored: Option<Sample>, at: Timestamp) -> bool {
    let Some(stored) = stored else { return true };
    let waited = at.duration_since(stored.at);
    stored.quality != sample.quality
        || match (stored.value, sample.value) {
            (Some(old), Some(new)) => {
                tag.deadband < (new - old).abs()
                    || (sample.quality.is_good() && STORE_EVERY <= Duration::try_from(waited).unwrap_or_default())
            }
            (None, None) => false,
            (None, Some(_)) | (Some(_), None) => true,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture::{self, DP, FAULT, PV, RUN, TIC};
    use crate::plant::tag::DataType;

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a small number")
    }

    fn image() -> ProcessImage {
        let mut image = ProcessImage::new(fixture::shared(), at(0));
        image.read(&[(PV, 724.0), (DP, 1.0), (FAULT, 0.0)], at(0));
        image
    }

    #[test]
    fn a_value_needs_its_decimals_and_a_silent_fault_word() {
        let mut image = ProcessImage::new(fixture::shared(), at(0));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotRead));
        image.read(&[(PV, 724.0), (FAULT, 0.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "never 724 for 72.4");
        image.read(&[(DP, 1.0)], at(2));
        assert_eq!(image.sample(PV), Sample::good(72.4, at(1)), "as old as its own reading");
        image.read(&[(FAULT, 2.0)], at(3));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::SensorFault));
        assert_eq!(image.sample(PV).value, None);
    }

    #[test]
    fn a_value_that_stays_bad_keeps_the_time_since_when() {
        let mut image = image();
        for second in [3, 30, 60] {
            image.read(&[(PV, 724.0), (FAULT, 2.0)], at(second));
            assert_eq!(image.sample(PV), Sample::bad(Cause::SensorFault, at(3)), "read at {second} s");
        }
        image.read(&[(PV, 724.0), (FAULT, 0.0)], at(61));
        assert_eq!(image.sample(PV), Sample::good(72.4, at(61)));
    }

    #[test]
    fn a_text_is_trusted_and_doubted_like_a_number_and_never_stored() {
        let mut def = fixture::plant();
        (def.tags[PV.index()].point.kind, def.tags[PV.index()].store) = (DataType::Text(8), false);
        let mut image = ProcessImage::new(Arc::new(def), at(0));
        assert_eq!(image.texts()[PV.index()], None);
        image.read_texts(&[(PV, "PXR4".into())], at(1));
        assert_eq!(image.sample(PV), Sample { value: None, quality: Quality::Good, at: at(1) });
        image.failed(&[PV], Fault::Timeout, at(2));
        assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
        assert_eq!(image.texts()[PV.index()].as_deref(), Some("PXR4"), "doubtful, not gone");
        image.gone(TIC, Cause::NotConnected, at(3));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotConnected));
        assert_eq!(image.texts()[PV.index()], None, "what is not known is not shown");
        let stored = |record: &Record| matches!(record, Record::Sample(tag, _) if *tag == PV);
        assert!(!image.records(at(4)).iter().any(stored));
    }

    #[test]
    fn an_impossible_number_of_decimals_is_no_scale() {
        for decimals in [65_535.0, -1.0, 7.0, 0.5] {
            let mut image = image();
            image.read(&[(DP, decimals), (PV, 724.0)], at(1));
            assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "{decimals} decimals");
        }
    }

    #[test]
    fn a_signed_fault_word_counts_with_all_its_bits() {
        let mut image = image();
        image.read(&[(FAULT, f64::from(i16::MIN)), (PV, 724.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::SensorFault));
        image.failed(&[PV], Fault::Timeout, at(2));
        image.read(&[(FAULT, 0.0)], at(3));
        assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout), "not read since");
    }

    #[test]
    fn trust_goes_with_failures() {
        use Quality::{Bad, Uncertain};
        for (fault, quality) in [
            (Fault::Timeout, Uncertain(Cause::Timeout)),
            (Fault::Crc { got: 1, computed: 2 }, Uncertain(Cause::Corrupt)),
            (Fault::Exception(ExceptionCode(2)), Bad(Cause::Exception)),
            (Fault::Exception(ExceptionCode(6)), Uncertain(Cause::Exception)),
            (Fault::NotANumber, Bad(Cause::SensorFault)),
            (Fault::NotConnected, Bad(Cause::NotConnected)),
            (Fault::BackedOff, Bad(Cause::DeviceDown)),
        ] {
            let mut image = image();
            image.failed(&[PV], fault, at(1));
            let sample = image.sample(PV);
            assert_eq!(sample.quality, quality);
            assert_eq!(sample.value.is_none(), quality.is_bad(), "{fault}: a bad sample has no value");
        }
    }

    #[test]
    fn nobody_elses_answer_revives_a_doubtful_value() {
        let mut image = image();
        image.failed(&[PV], Fault::Timeout, at(1));
        image.read(&[(FAULT, 0.0), (DP, 1.0)], at(2));
        assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
        image.age(at(11));
        image.read(&[(FAULT, 0.0), (DP, 1.0)], at(12));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Stale));
        image.read(&[(PV, 725.0)], at(13));
        assert_eq!(image.sample(PV), Sample::good(72.5, at(13)));
    }

    #[test]
    fn values_age_by_their_own_period() {
        let mut image = image();
        for (second, quality) in [
            (3, Quality::Good),
            (4, Quality::Uncertain(Cause::Stale)),
            (10, Quality::Uncertain(Cause::Stale)),
            (11, Quality::Bad(Cause::Stale)),
        ] {
            image.age(at(second));
            assert_eq!(image.sample(PV).quality, quality, "after {second} s");
        }
        assert_eq!(image.sample(RUN).quality, Quality::Bad(Cause::NotRead));
    }

    #[test]
    fn a_device_that_is_gone_takes_its_values_with_it() {
        let mut image = image();
        image.gone(TIC, Cause::NotConnected, at(5));
        assert_eq!(image.shown_decimals(fixture::shared().tag(PV)), 1, "what was keeps its decimals");
        assert_eq!(image.sample(PV), Sample::bad(Cause::NotConnected, at(5)));
        image.failed(&[PV], Fault::Timeout, at(6));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotConnected), "a probe in vain changes nothing");
    }

    #[test]
    fn changes_are_stored_and_unchanged_values_once_a_minute() {
        let mut image = image();
        let count = |image: &mut ProcessImage, second| {
            let pv = |record: &Record| matches!(record, Record::Sample(tag, _) if *tag == PV);
            image.records(at(second)).iter().filter(|record| pv(record)).count()
        };
        assert_eq!(count(&mut image, 0), 1);
        for (second, raw, expect) in [(1, 724.0, 0), (2, 725.0, 1), (61, 725.0, 0), (62, 725.0, 1), (121, 725.0, 0)] {
            image.read(&[(PV, raw)], at(second));
            assert_eq!(count(&mut image, second), expect, "at {second} s");
        }
        image.failed(&[PV], Fault::Timeout, at(122));
        let records = image.records(at(122));
        let doubted = Sample { value: Some(72.5), quality: Quality::Uncertain(Cause::Timeout), at: at(122) };
        assert!(records.contains(&Record::Sample(PV, doubted)), "the doubt begins at 122 s: {records:?}");
        assert_eq!(count(&mut image, 123), 0);
    }
}
