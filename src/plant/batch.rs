//! Batches: what a plant makes in one go, between two conditions of its plant file, with a number and its phases (ISA-88).
//!
//! ```text
//!   start  ──┐ PLC-1.STEP = FILL           end ──┐ PLC-1.STEP = IDLE
//!            ├─ FILL ─┬── HEAT ──┬── unknown ──┬─┤
//!   records  started   phase      unknown      phase, ended
//! ```
//!
//! A record begins a span that the next one ends: a station that dies in the middle of a batch goes on with it.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{expr::Expr, id::TagId, keyword::keyword_enum, sample::Sample, tag::TagDef};

/// What a batch is, from a `[[batch]]` of the plant file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BatchDef {
    /// `water`; the history knows its batches by it.
    pub name: Arc<str>,
    /// One begins when this becomes true; the one before it ends then at the latest.
    pub start: Expr,
    /// It ends when this is true.
    pub end: Expr,
    /// Its value is the phase.
    pub phase: Option<TagId>,
    /// Energy in kWh comes from this power or energy counter.
    pub energy: Option<TagId>,
    /// What is summarised of each batch.
    pub tags: Vec<TagId>,
}

impl BatchDef {
    /// The tags that decide when it begins and ends, and its phase.
    fn inputs(&self) -> impl Iterator<Item = TagId> + '_ {
        [self.start.tags(), self.end.tags()].into_iter().flatten().chain(self.phase)
    }
}

/// A change of a batch, as it is stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BatchRecord {
    /// When.
    pub at: Timestamp,
    /// Name of its [`BatchDef`].
    pub batch: Arc<str>,
    /// From 1 in each history; never given twice.
    pub number: u32,
    /// Its place among the records of this batch, from 0: in this order, even if the clock was set.
    pub place: u32,
    /// What happened.
    pub event: BatchEvent,
    /// The phase from here on; `None` if it is unknown, has ended, or the batch has no phases.
    pub phase: Option<Arc<str>>,
}

impl BatchRecord {
    /// Number and name of the batch as one word: `water-17`.
    pub fn label(&self) -> String {
        format!("{}-{}", self.batch, self.number)
    }
}

keyword_enum! {
    /// What happens to a batch. The words are what the history and CSV hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum BatchEvent: "batch event" {
        /// Its start was seen.
        Started => "started",
        /// It had begun before the plant could be read.
        FoundRunning => "found running",
        /// Its phase changed, or is known again.
        Phase => "phase",
        /// The plant could not be read any more.
        Unknown => "unknown",
        /// Its end was seen.
        Ended => "ended",
        /// It had ended before the plant could be read again, or is no longer followed.
        FoundEnded => "found ended",
    }
}

impl BatchEvent {
    fn is_end(self) -> bool {
        matches!(self, BatchEvent::Ended | BatchEvent::FoundEnded)
    }
}

/// A batch, from its records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Batch {
    /// Name of its [`BatchDef`].
    pub name: Arc<str>,
    /// Its number.
    pub number: u32,
    /// Begin, or when it was found running.
    pub from: Timestamp,
    /// End, or when it was found ended; `None` while it runs.
    pub to: Option<Timestamp>,
    /// Whether begin and end were seen: else they are earlier than [`Batch::from`] and [`Batch::to`].
    pub seen: (bool, bool),
    /// How long it has lasted: that of its phases, also where the clock was set meanwhile.
    pub lasted: Duration,
    /// How long each phase lasted, in the order in which they first came.
    pub phases: Vec<(Arc<str>, Duration)>,
    /// How long the phase was not known.
    pub unknown: Duration,
}

impl Batch {
    /// Number and name as one word: `water-17`.
    pub fn label(&self) -> String {
        format!("{}-{}", self.name, self.number)
    }

    /// Until its end; until `now` while it runs.
    pub fn until(&self, now: Timestamp) -> Timestamp {
        self.to.unwrap_or(now)
    }
}

/// A batch from its records, in the order of their places. `lasts` gives for how long it was as each of them says: until the
/// next one, or until now.
pub fn batch(records: &[BatchRecord], lasts: impl Fn(usize) -> Duration) -> Option<Batch> {
    let (first, last) = (records.first()?, records.last()?);
    let to = last.event.is_end().then_some(last.at);
    let mut phases: Vec<(Arc<str>, Duration)> = Vec::new();
    let (mut lasted, mut unknown) = (Duration::ZERO, Duration::ZERO);
    let at_work = records.len() - usize::from(to.is_some());
    for (place, record) in records[..at_work].iter().enumerate() {
        let span = lasts(place);
        lasted += span;
        match &record.phase {
            _ if record.event == BatchEvent::Unknown => unknown += span,
            Some(phase) => match phases.iter_mut().find(|(known, _)| known == phase) {
                Some((_, total)) => *total += span,
                None => phases.push((phase.clone(), span)),
            },
            None => {}
        }
    }
    let seen = (first.event == BatchEvent::Started, last.event != BatchEvent::FoundEnded);
    Some(Batch { name: first.batch.clone(), number: first.number, from: first.at, to, seen, lasted, phases, unknown })
}

/// Follows the batches of one rule. It says nothing before [`BatchTracker::restore`]: a number must not be given twice.
#[derive(Debug, Clone, Default)]
pub struct BatchTracker {
    restored: bool,
    /// The latest batch: its last record; `None` before the first one.
    latest: Option<BatchRecord>,
    /// What the condition of the start was when it was last known.
    start: Option<bool>,
    /// Every input had a value at the last update.
    known: bool,
}

impl BatchTracker {
    /// Goes on after the last record of this rule, if there is one, unless it does already; `off` is when the station before this
    /// one ended.
    pub fn restore(&mut self, latest: Option<BatchRecord>, off: Option<Timestamp>) -> Option<BatchRecord> {
        if std::mem::replace(&mut self.restored, true) {
            return None;
        }
        self.latest = latest;
        self.lose(off?)
    }

    /// The plant file has its rule no more: its end would never be seen.
    pub fn remove(self, at: Timestamp) -> Option<BatchRecord> {
        removed(self.latest.as_ref()?, at)
    }

    /// It is not followed from here on.
    fn lose(&mut self, at: Timestamp) -> Option<BatchRecord> {
        let running = self.running().filter(|latest| latest.event != BatchEvent::Unknown)?;
        let record = next(running, BatchEvent::Unknown, None, at);
        self.push(record)
    }

    /// What has changed at an instant. `sample` gives the sample of a tag.
    pub fn update(
        &mut self,
        def: &BatchDef,
        phase_def: Option<&TagDef>,
        sample: &impl Fn(TagId) -> Sample,
        at: Timestamp,
    ) -> Vec<BatchRecord> {
        if !self.restored {
            return Vec::new();
        }
        let mut records = Vec::new();
        // A single answer that is late decides nothing; only a value that is gone leaves the phase unknown.
        let good = |tag: TagId| sample(tag).good_value();
        let known = def.inputs().all(|tag| sample(tag).value.is_some());
        let exact = |tag: TagId| sample(tag).good_exact();
        let (start, end) = (def.start.holds(&exact), def.end.holds(&exact));
        let phase = phase_def.and_then(|tag| Some(phase_name(tag, good(tag.id)?)));
        let ended = if self.known { BatchEvent::Ended } else { BatchEvent::FoundEnded };
        let begins = start == Some(true)
            && match self.start {
                Some(before) => !before,
                None => self.running().is_none(),
            };
        if end == Some(true) || begins {
            let ended = self.running().map(|running| next(running, ended, None, at));
            records.extend(ended.and_then(|record| self.push(record)));
        }
        if begins && end != Some(true) {
            let event = if self.known && self.start.is_some() { BatchEvent::Started } else { BatchEvent::FoundRunning };
            let number = self.latest.as_ref().map_or(0, |latest| latest.number) + 1;
            let record = BatchRecord { at, batch: def.name.clone(), number, place: 0, event, phase };
            records.extend(self.push(record));
        } else if let Some(running) = self.running() {
            let was_unknown = running.event == BatchEvent::Unknown;
            let changed = match (known, was_unknown) {
                (false, false) => Some((BatchEvent::Unknown, None)),
                (false, true) => None,
                // An uncertain value leaves the phase as it is.
                (true, false) if phase.is_none() || phase == running.phase => None,
                (true, false) => Some((BatchEvent::Phase, phase)),
                (true, true) if def.phase.is_some() && phase.is_none() => None,
                (true, true) => Some((BatchEvent::Phase, phase)),
            };
            let record = changed.map(|(event, phase)| next(running, event, phase, at));
            records.extend(record.and_then(|record| self.push(record)));
        }
        (self.start, self.known) = (start.or(self.start), known);
        records
    }

    fn running(&self) -> Option<&BatchRecord> {
        self.latest.as_ref().filter(|latest| !latest.event.is_end())
    }

    fn push(&mut self, record: BatchRecord) -> Option<BatchRecord> {
        self.latest.insert(record).clone().into()
    }
}

/// The end of a batch without a rule, unless it has ended.
pub fn removed(latest: &BatchRecord, at: Timestamp) -> Option<BatchRecord> {
    (!latest.event.is_end()).then(|| next(latest, BatchEvent::FoundEnded, None, at))
}

fn next(latest: &BatchRecord, event: BatchEvent, phase: Option<Arc<str>>, at: Timestamp) -> BatchRecord {
    BatchRecord { at, batch: latest.batch.clone(), number: latest.number, place: latest.place + 1, event, phase }
}

/// `HEAT`; the number where the plant file has no word for it.
fn phase_name(tag: &TagDef, value: f64) -> Arc<str> {
    tag.label_of(value).map_or_else(|| value.to_string().into(), Arc::from)
}

#[cfg(test)]
mod tests;
