//! Changed samples and source frames, grouped by response so that a shared time is sent once.

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::DeltaMismatch;
use crate::plant::{
    number::to_u32,
    sample::{Quality, Sample},
    traffic::Exchange,
};

/// Places in a list, as (first, how many).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Runs(Vec<(u32, u32)>);

impl Runs {
    /// One more place, behind all others.
    fn push(&mut self, place: usize) {
        match self.0.last_mut() {
            Some((from, count)) if *from as usize + *count as usize == place => *count += 1,
            _ => self.0.push((to_u32(place), 1)),
        }
    }

    fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().flat_map(|(from, count)| (*from as usize..).take(*count as usize))
    }
}

/// Samples of one quality and instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Readings {
    at: Timestamp,
    quality: Quality,
    /// Tags that keep their value.
    kept: Runs,
    /// Tags that have another one, and these values.
    new: Runs,
    values: Vec<Option<f64>>,
}

/// The samples that have changed.
pub fn between(old: &[Sample], new: &[Sample]) -> Vec<Readings> {
    let bits = |sample: &Sample| sample.value.map(f64::to_bits);
    let mut answers: BTreeMap<(Timestamp, Quality), Readings> = BTreeMap::new();
    for (place, (old, new)) in old.iter().zip(new).enumerate() {
        let is_kept = bits(old) == bits(new);
        if is_kept && (old.at, old.quality) == (new.at, new.quality) {
            continue;
        }
        let Sample { value, quality, at } = *new;
        let answer = answers.entry((at, quality)).or_insert_with(|| Readings {
            at,
            quality,
            kept: Runs::default(),
            new: Runs::default(),
            values: Vec::new(),
        });
        if is_kept {
            answer.kept.push(place);
        } else {
            answer.new.push(place);
            answer.values.push(value);
        }
    }
    answers.into_values().collect()
}

/// Takes them in.
pub fn apply(readings: Vec<Readings>, samples: &mut [Sample]) -> Result<(), DeltaMismatch> {
    for Readings { at, quality, kept, new, values } in readings {
        for place in kept.iter() {
            let sample = samples.get_mut(place).ok_or(DeltaMismatch)?;
            (sample.at, sample.quality) = (at, quality);
        }
        let mut values = values.into_iter();
        for place in new.iter() {
            let sample = samples.get_mut(place).ok_or(DeltaMismatch)?;
            *sample = Sample { value: values.next().ok_or(DeltaMismatch)?, quality, at };
        }
    }
    Ok(())
}

/// One request with its answer, and the tags that it speaks of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceFrame {
    exchange: Option<Arc<Exchange>>,
    tags: Runs,
}

/// Requests with their answers, by tag.
type Exchanges = [Option<Arc<Exchange>>];

/// The source frames that have changed, each request once.
pub fn source_frames_between(old: &Exchanges, new: &Exchanges) -> Vec<SourceFrame> {
    let mut found: Vec<SourceFrame> = Vec::new();
    let mut places: HashMap<Option<*const Exchange>, usize> = HashMap::new();
    for (tag, (old, new)) in old.iter().zip(new).enumerate() {
        let is_same = match (old, new) {
            (Some(old), Some(new)) => Arc::ptr_eq(old, new) || old == new,
            (None, None) => true,
            (Some(_), None) | (None, Some(_)) => false,
        };
        if is_same {
            continue;
        }
        let place = *places.entry(new.as_ref().map(Arc::as_ptr)).or_insert_with(|| {
            found.push(SourceFrame { exchange: new.clone(), tags: Runs::default() });
            found.len() - 1
        });
        found[place].tags.push(tag);
    }
    found
}

/// Takes it in.
pub fn apply_source_frames(news: Vec<SourceFrame>, source_frames: &mut Exchanges) -> Result<(), DeltaMismatch> {
    for SourceFrame { exchange, tags } in news {
        for tag in tags.iter() {
            *source_frames.get_mut(tag).ok_or(DeltaMismatch)? = exchange.clone();
        }
    }
    Ok(())
}
