//! Which stored samples are sent next, and how far they are at the broker.
//!
//! ```text
//!   ── at the broker ──┐cursor
//!              ├OVERLAP┤── window ──┤
//!                      what was committed late stands here: read again, sent once
//! ```
//!
//! What is read again is decided again: each sample is compared with what was sent last before its own time, so that what a
//! deadband has left out stays left out, and what comes late is compared with its neighbour.
//!
//! Where the clock was set back, all of an epoch goes out before the next one.

use std::time::Duration;

use jiff::Timestamp;

use super::deadband::differs;
use crate::{
    history::recorded::StoredSamples,
    plant::{
        def::{MqttDef, TagId},
        sample::Sample,
    },
};

/// A sample is in the history this long after its time at the latest, in plant seconds of a station at normal speed: a link, the
/// plant and the history take some milliseconds and a second.
const OVERLAP: Duration = Duration::from_secs(10);
/// What a window is tried with, and what it has at most and at least.
const SPAN: Duration = Duration::from_secs(60);
const SPAN_MAX: Duration = Duration::from_secs(24 * 3_600);
const SPAN_MIN: Duration = Duration::from_millis(1);
/// A clock that is behind the cursor this many looks without a new epoch is that of another history.
const WAITS_MAX: u32 = 30;
/// Fewer samples in a window make the next one longer.
const FEW: usize = 5_000;

/// The state of the samples that go out. A window is asked of the history, its samples are sent, and when the broker has
/// acknowledged them the cursor moves to its end.
#[derive(Debug)]
pub struct Forwarder {
    /// The epoch of the clock in which it reads, and how far it is there.
    epoch: u16,
    cursor: Timestamp,
    /// Looks in a row at which the clock was behind the cursor.
    waits: u32,
    span: Duration,
    overlap: Duration,
    sent: Sent,
    /// What was sent before this instant is not known: there, no deadband leaves anything out.
    unknown_before: Timestamp,
}

/// What is sent next.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// The epoch and the cursor when they have arrived.
    pub until: (u16, Timestamp),
    /// In order of time.
    pub samples: Vec<(TagId, Sample)>,
}

/// What was sent of each tag in the last `OVERLAP` before the cursor, and the last one before that, in order of time.
#[derive(Debug, Clone)]
struct Sent(Vec<Vec<Sample>>);

impl Forwarder {
    /// Everything before the cursor has been read once, and is at the broker. `speed`: plant seconds per real second.
    pub fn new((epoch, cursor): (u16, Timestamp), tags: usize, speed: f64) -> Forwarder {
        let overlap = OVERLAP.mul_f64(speed.max(1.0));
        Forwarder {
            epoch,
            cursor,
            waits: 0,
            span: SPAN,
            overlap,
            sent: Sent(vec![Vec::new(); tags]),
            unknown_before: cursor,
        }
    }

    /// The same where it is known what was sent last, see [`Forwarder::sent`].
    pub fn knowing(self, sent: impl Iterator<Item = (TagId, Sample)>) -> Forwarder {
        let mut known = Forwarder { unknown_before: Timestamp::MIN, ..self };
        sent.for_each(|(tag, sample)| known.sent.add(tag, sample));
        known
    }

    /// What is read next begins `OVERLAP` before this instant of an epoch.
    pub fn cursor(&self) -> (u16, Timestamp) {
        (self.epoch, self.cursor)
    }

    /// What the next one must know, to go on where this one ends.
    pub fn sent(&self) -> impl Iterator<Item = (TagId, Sample)> {
        (0..).zip(&self.sent.0).flat_map(|(tag, sent)| sent.iter().map(move |sample| (TagId(tag), *sample)))
    }

    /// Everything before this instant is at the broker: what is later may still be committed.
    pub fn complete_until(&self) -> Timestamp {
        self.cursor.checked_sub(self.overlap).unwrap_or(Timestamp::MIN)
    }

    /// What is asked of the history: the epoch, from, and to. `latest` is its epoch now. `None` while the clock is behind: the
    /// history is about to tell that it was set.
    pub fn window(&mut self, latest: u16, now: Timestamp) -> Option<(u16, Timestamp, Timestamp)> {
        self.waits = if now < self.cursor && latest == self.epoch { self.waits + 1 } else { 0 };
        if latest < self.epoch || WAITS_MAX < self.waits {
            (self.epoch, self.cursor, self.waits) = (latest, self.cursor.min(now), 0);
            self.sent.0.iter_mut().for_each(Vec::clear);
        }
        let to = self.cursor.checked_add(self.span).unwrap_or(now);
        let to = if self.epoch < latest { to } else { to.min(now) };
        (self.cursor <= to).then(|| (self.epoch, self.complete_until(), to))
    }

    /// The history has too many samples in the window.
    pub fn on_too_many(&mut self) {
        self.span = (self.span / 4).max(SPAN_MIN);
    }

    /// The history has answered: which samples are new and differ enough.
    pub fn on_samples(&mut self, def: &MqttDef, until: Timestamp, stored: StoredSamples) -> Batch {
        let StoredSamples { samples, over } = stored;
        if samples.len() < FEW {
            self.span = (self.span * 4).min(SPAN_MAX);
        }
        let mut sent = self.sent.clone();
        let is_due = |(tag, sample): &(TagId, Sample)| {
            let all = def.deadband(*tag) == 0.0 || sample.at < self.unknown_before;
            let is_due = sent.lacks(*tag, *sample, |before| all || differs(def, *tag, before, *sample));
            if is_due {
                sent.add(*tag, *sample);
            }
            is_due
        };
        let samples = samples.into_iter().filter(is_due).collect();
        let next = over.filter(|over| over.ended < until).map(|over| over.next);
        Batch { until: next.unwrap_or((self.epoch, until)), samples }
    }

    /// The broker has acknowledged all of a batch.
    pub fn on_delivered(&mut self, batch: &Batch) {
        batch.samples.iter().for_each(|(tag, sample)| self.sent.add(*tag, *sample));
        if batch.until.0 != self.epoch {
            self.sent.0.iter_mut().for_each(Vec::clear);
        }
        (self.epoch, self.cursor) = batch.until;
        self.sent.forget(self.complete_until());
    }
}

impl Sent {
    /// Was it not sent yet, and does it differ from what was sent last before its time?
    fn lacks(&self, tag: TagId, sample: Sample, differs: impl Fn(Sample) -> bool) -> bool {
        let Some(sent) = self.0.get(tag.index()) else { return false };
        let before = &sent[..behind(sent, sample.at)];
        let is_sent = before.iter().rev().take_while(|sent| sent.at == sample.at).any(|sent| *sent == sample);
        !is_sent && before.last().is_none_or(|before| differs(*before))
    }

    fn add(&mut self, tag: TagId, sample: Sample) {
        if let Some(sent) = self.0.get_mut(tag.index()) {
            sent.insert(behind(sent, sample.at), sample);
        }
    }

    /// Forgets what was before an instant, but for the last of each tag.
    fn forget(&mut self, from: Timestamp) {
        for sent in &mut self.0 {
            let before = sent.partition_point(|sample| sample.at < from);
            sent.drain(..before.saturating_sub(1));
        }
    }
}

/// Where a sample of this time stands: behind those of the same time.
fn behind(sent: &[Sample], at: Timestamp) -> usize {
    sent.partition_point(|sample| sample.at <= at)
}

#[cfg(test)]
mod tests;
