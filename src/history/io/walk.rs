//! Stored samples in the order in which they were stored: where the clock was set back, those of one epoch after the other.

use jiff::Timestamp;

use super::{
    read::{check_span, within},
    samples::Wanted,
    sql,
    store::{Store, instant},
};
use crate::{
    history::{
        HistoryError,
        recorded::{Epochs, Leg, StoredSamples},
    },
    plant::{
        def::TagId,
        sample::{Cause, Quality, Sample},
    },
    report::{
        Gap,
        step_series::{HOLD_MAX, expiry},
    },
};

/// The same, of all sources: more than a plant has tags, so that one instant is never too much.
pub const STORED_MAX: u64 = 100_000;

/// What is handed over.
pub(super) enum Read {
    /// A sample, with the place of its tag.
    Sample(u32, Sample),
    /// From then on nothing is known of any tag.
    Nothing(Cause, Timestamp),
    /// A sample outside of the span: it matters only where the clock was set back.
    Held(u32, Sample),
    /// The clock was set back: from when, to when.
    Set(Timestamp, Timestamp),
}

impl Store {
    /// Hands over the samples of some different tags that matter in a span: its own and those of [`HOLD_MAX`] before. Each
    /// comes with the place of its tag in `tags`, each tag's in the order in which they were stored: of each epoch of the clock
    /// in order of time. Returns what could not be read; there, no value is known.
    pub(super) fn each_sample(
        &self,
        tags: &[TagId],
        from: Timestamp,
        to: Timestamp,
        each: impl FnMut(usize, Sample),
    ) -> Result<Vec<Gap>, HistoryError> {
        self.each_sample_of(tags, (from, to), &Epochs::All, each)
    }

    /// The same of some epochs only, in a time that is theirs among others: what holds at its begin may be of one before.
    pub(super) fn each_sample_of(
        &self,
        tags: &[TagId],
        (from, to): (Timestamp, Timestamp),
        of: &Epochs,
        mut each: impl FnMut(usize, Sample),
    ) -> Result<Vec<Gap>, HistoryError> {
        let all = 0..tags.len();
        let mut held: Vec<Option<Sample>> = vec![None; tags.len()];
        let gaps = self.each_row(&self.wanted(tags), (in_force(from), to), of, |read| match read {
            Read::Sample(place, sample) => {
                held[place as usize] = Some(sample);
                each(place as usize, sample);
            }
            Read::Held(place, sample) => held[place as usize] = Some(sample),
            Read::Nothing(cause, at) => all.clone().for_each(|place| each(place, Sample::bad(cause, at))),
            // What held then holds on.
            Read::Set(ended, at) => held.iter().enumerate().for_each(|(place, sample)| {
                let holds = |sample: &Sample| match sample.quality {
                    Quality::Good => ended < expiry(*sample),
                    Quality::Uncertain(_) => true,
                    Quality::Bad(cause) => cause != Cause::StationOff,
                };
                let held = sample.filter(holds);
                held.into_iter().for_each(|sample| each(place, Sample { at, ..sample }));
            }),
        })?;
        if let Some(at) = self.ended {
            all.for_each(|place| each(place, Sample::bad(Cause::StationOff, at)));
        }
        Ok(gaps)
    }

    /// The same of all tags that are stored, each with its stored number.
    pub(super) fn each_stored(
        &self,
        from: Timestamp,
        to: Timestamp,
        each: impl FnMut(u16, Sample),
    ) -> Result<Vec<Gap>, HistoryError> {
        self.each_where(sql::of_tags(None), from, to, each)
    }

    /// The same of those that came from files.
    pub(super) fn each_imported(
        &self,
        from: Timestamp,
        to: Timestamp,
        each: impl FnMut(u16, Sample),
    ) -> Result<Vec<Gap>, HistoryError> {
        self.each_where(format!(" AND epoch = {}", sql::IMPORTED), from, to, each)
    }

    fn each_where(
        &self,
        condition: String,
        from: Timestamp,
        to: Timestamp,
        mut each: impl FnMut(u16, Sample),
    ) -> Result<Vec<Gap>, HistoryError> {
        let all = Wanted::all(condition);
        self.each_row(&all, (in_force(from), to), &Epochs::All, |read| {
            if let Read::Sample(place, sample) = read {
                each(u16::try_from(place).unwrap_or(u16::MAX), sample);
            }
        })
    }

    fn each_row(
        &self,
        wanted: &Wanted,
        (from, to): (Timestamp, Timestamp),
        of: &Epochs,
        mut each: impl FnMut(Read),
    ) -> Result<Vec<Gap>, HistoryError> {
        let mut gaps = Vec::new();
        let mut legs = self.legs(from, to)?;
        let is_read = |leg: &Leg| match of {
            Epochs::All => true,
            // What was before a doubled time holds on into its first epoch.
            Epochs::Without(_) => *of == leg.epochs || leg.epochs == Epochs::All,
            Epochs::One(_) => *of == leg.epochs,
        };
        let last = legs.iter().rposition(|leg| leg.epochs == *of).filter(|_| *of != Epochs::All);
        legs.truncate(last.map_or(legs.len(), |last| last + 1));
        for (place, leg) in legs.iter().enumerate() {
            let (Some(from), Some(to), epochs) = (instant(leg.from), instant(leg.to), leg.epochs.condition()) else {
                continue;
            };
            let mut own = |read| match (is_read(leg), read) {
                (true, read) => each(read),
                (false, Read::Sample(place, sample)) => each(Read::Held(place, sample)),
                (false, Read::Held(..) | Read::Nothing(..) | Read::Set(..)) => {}
            };
            gaps.extend(self.each_row_of(wanted, &epochs, (from, to), &mut own)?);
            let next = legs.get(place + 1);
            let (Some(ended), true) = (leg.ended.and_then(instant), next.is_some() || *of != Epochs::All) else {
                continue;
            };
            // Its values hold until the clock was set back, and then from there on.
            own(Read::Nothing(Cause::StationOff, ended.min(to)));
            let Some(began) = next.filter(|next| is_read(next)).and_then(|next| instant(next.began?)) else { continue };
            let end = instant(ended.as_microsecond() + 1).unwrap_or(ended);
            let rest = (to.max(in_force(ended)), end);
            if rest.0 < rest.1 {
                self.each_row_of(wanted, &epochs, rest, &mut |read| match read {
                    Read::Sample(place, sample) => each(Read::Held(place, sample)),
                    Read::Held(..) | Read::Nothing(..) | Read::Set(..) => {}
                })?;
            }
            each(Read::Set(ended, began));
        }
        Ok(gaps)
    }

    /// The samples of this plant's tags that were stored in a span of an epoch, and nothing that was in force before.
    pub(super) fn stored(
        &self,
        epoch: Option<u16>,
        (from, to): (Timestamp, Timestamp),
    ) -> Result<StoredSamples, HistoryError> {
        check_span(from, to)?;
        let tags: Vec<TagId> = self.def.tags.iter().map(|tag| tag.id).collect();
        let (mut samples, mut count) = (Vec::new(), 0);
        let mut each = |read| {
            let Read::Sample(place, sample) = read else { return };
            count += 1;
            if count <= STORED_MAX {
                samples.push((tags[place as usize], sample));
            }
        };
        let (wanted, mut over) = (self.wanted(&tags), None);
        match epoch {
            None => self.each_row(&wanted, (from, to), &Epochs::All, each)?,
            Some(epoch) => {
                over = self.over(epoch)?;
                self.each_row_of(&wanted, &format!(" AND coalesce(epoch, 0) = {epoch}"), (from, to), &mut each)?
            }
        };
        within(count, STORED_MAX)?;
        Ok(StoredSamples { samples, over })
    }
}

/// From when on a sample may be in force at an instant.
fn in_force(from: Timestamp) -> Timestamp {
    from.checked_sub(HOLD_MAX).unwrap_or(Timestamp::MIN)
}
