//! How the lists by tag of a snapshot are encoded: what many tags share, such as one answer, is there once.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A list in which many elements are equal.
#[derive(Serialize, Deserialize)]
struct Dictionary<T> {
    distinct: Vec<T>,
    /// For each element of the list, its index among the distinct ones.
    indices: Vec<u32>,
}

impl<T: Clone> Dictionary<T> {
    /// Elements with the same key are the same.
    fn new<K: Ord>(list: impl Iterator<Item = (K, T)>) -> Dictionary<T> {
        let (mut distinct, mut known) = (Vec::new(), BTreeMap::new());
        let indices = list.map(|(key, element)| {
            *known.entry(key).or_insert_with(|| {
                distinct.push(element);
                super::to_u32(distinct.len() - 1)
            })
        });
        let indices = indices.collect();
        Dictionary { distinct, indices }
    }

    fn list<E: serde::de::Error>(&self) -> Result<Vec<T>, E> {
        let element = |index: &u32| self.distinct.get(*index as usize).cloned();
        self.indices.iter().map(element).collect::<Option<_>>().ok_or_else(|| E::custom("an index without element"))
    }
}

/// Samples: quality and time are those of an answer.
pub mod samples {
    use jiff::Timestamp;
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    use super::Dictionary;
    use crate::plant::sample::{Quality, Sample};

    /// Times and qualities, values, and what few of these lack, with their places.
    type Encoded = (Dictionary<(Timestamp, Quality)>, Vec<Option<f64>>, Vec<(u32, f64)>);

    pub fn serialize<S: Serializer>(samples: &[Sample], to: S) -> Result<S::Ok, S::Error> {
        let readings = samples.iter().map(|sample| (sample.at, sample.quality)).map(|reading| (reading, reading));
        let values: Vec<Option<f64>> = samples.iter().map(|sample| sample.value).collect();
        let rests = (0u32..).zip(samples).filter_map(|(place, sample)| Some((place, sample.rest?)));
        (Dictionary::new(readings), values, rests.collect::<Vec<_>>()).serialize(to)
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<Sample>, D::Error> {
        let (readings, values, rests): Encoded = Deserialize::deserialize(from)?;
        let samples = readings.list::<D::Error>()?.into_iter().zip(values);
        let sample = |((at, quality), value)| Sample { value, rest: None, quality, at };
        let mut samples: Vec<Sample> = samples.map(sample).collect();
        for (place, rest) in rests {
            let sample = samples.get_mut(place as usize).ok_or_else(|| D::Error::custom("a rest without value"))?;
            sample.rest = Some(rest);
        }
        Ok(samples)
    }
}

/// Source frames: an answer belongs to all tags of its block.
pub mod source_frames {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Dictionary;
    use crate::plant::traffic::Exchange;

    type SourceFrames = Arc<Vec<Option<Arc<Exchange>>>>;

    pub fn serialize<S: Serializer>(source_frames: &SourceFrames, to: S) -> Result<S::Ok, S::Error> {
        let frames = source_frames.iter().map(|exchange| (exchange.as_ref().map(Arc::as_ptr), exchange.clone()));
        Dictionary::new(frames).serialize(to)
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<SourceFrames, D::Error> {
        Ok(Arc::new(Dictionary::deserialize(from)?.list::<D::Error>()?))
    }
}
