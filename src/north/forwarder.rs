//! Which stored samples are sent next, and how far they are at the broker.
//!
//! ```text
//!   ── at the broker ──┐cursor
//!              ├OVERLAP┤── window ──┤
//!                      what was committed late stands here: read again, sent once
//! ```

use std::{collections::HashSet, time::Duration};

use jiff::Timestamp;

use super::deadband::Deadband;
use crate::plant::{
    def::{MqttDef, TagId},
    sample::Sample,
};

/// A sample is in the history this long after its time at the latest, in plant seconds of a station at normal speed: a link, the
/// plant and the history take some milliseconds and a second.
const OVERLAP: Duration = Duration::from_secs(10);
/// What a window is tried with, and what it has at most and at least.
const SPAN: Duration = Duration::from_secs(60);
const SPAN_MAX: Duration = Duration::from_secs(24 * 3_600);
const SPAN_MIN: Duration = Duration::from_millis(1);
/// Fewer samples in a window make the next one longer.
const FEW: usize = 5_000;

/// Time, tag, value and quality: two samples may have one time.
type Key = (Timestamp, TagId, [Option<u64>; 2], u8);

/// The state of the samples that go out. A window is asked of the history, its samples are sent, and when the broker has
/// acknowledged them the cursor moves to its end.
#[derive(Debug)]
pub struct Forwarder {
    cursor: Timestamp,
    span: Duration,
    overlap: Duration,
    /// What was sent of the last `OVERLAP` before the cursor.
    sent: HashSet<Key>,
    deadband: Deadband,
}

/// What is sent next.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// The cursor when they have arrived.
    pub until: Timestamp,
    /// In order of time.
    pub samples: Vec<(TagId, Sample)>,
}

impl Forwarder {
    /// Everything before the cursor has been read once, and is at the broker. `speed`: plant seconds per real second.
    pub fn new(cursor: Timestamp, tags: usize, speed: f64) -> Forwarder {
        let overlap = OVERLAP.mul_f64(speed.max(1.0));
        Forwarder { cursor, span: SPAN, overlap, sent: HashSet::new(), deadband: Deadband::new(tags) }
    }

    /// What is read next begins `OVERLAP` before this instant.
    pub fn cursor(&self) -> Timestamp {
        self.cursor
    }

    /// Everything before this instant is at the broker: what is later may still be committed.
    pub fn complete_until(&self) -> Timestamp {
        self.cursor.checked_sub(self.overlap).unwrap_or(Timestamp::MIN)
    }

    /// What is asked of the history: from, and to. A clock that was set back takes the cursor with it, and some samples are
    /// sent twice.
    pub fn window(&mut self, now: Timestamp) -> (Timestamp, Timestamp) {
        if now < self.cursor {
            self.cursor = now;
            self.sent.clear();
        }
        (self.complete_until(), self.cursor.checked_add(self.span).unwrap_or(now).min(now))
    }

    /// The history has too many samples in the window.
    pub fn on_too_many(&mut self) {
        self.span = (self.span / 4).max(SPAN_MIN);
    }

    /// The history has answered: which samples are new and differ enough.
    pub fn on_samples(&mut self, def: &MqttDef, until: Timestamp, samples: Vec<(TagId, Sample)>) -> Batch {
        if samples.len() < FEW {
            self.span = (self.span * 4).min(SPAN_MAX);
        }
        let mut deadband = self.deadband.clone();
        let is_due = |(tag, sample): &(TagId, Sample)| {
            !self.sent.contains(&key(*tag, sample)) && (def.deadband(*tag) == 0.0 || deadband.pass(def, *tag, *sample))
        };
        Batch { until, samples: samples.into_iter().filter(is_due).collect() }
    }

    /// The broker has acknowledged all of a batch.
    pub fn on_delivered(&mut self, def: &MqttDef, batch: &Batch) {
        for (tag, sample) in &batch.samples {
            self.deadband.pass(def, *tag, *sample);
            self.sent.insert(key(*tag, sample));
        }
        self.cursor = batch.until;
        let from = self.complete_until();
        self.sent.retain(|(at, ..)| from <= *at);
    }
}

fn key(tag: TagId, sample: &Sample) -> Key {
    (sample.at, tag, [sample.value, sample.rest].map(|part| part.map(f64::to_bits)), sample.quality.code())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::north::payload::tests::mqtt;

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_millisecond(1_000_000_000 + millis).expect("in range")
    }

    fn sample(millis: i64, value: f64) -> (TagId, Sample) {
        (TagId(0), Sample::good(value, at(millis)))
    }

    /// A history of which some samples are committed only after a while.
    struct Stored(Vec<(i64, (TagId, Sample))>);

    impl Stored {
        fn answer(&self, now: i64, (from, to): (Timestamp, Timestamp)) -> Vec<(TagId, Sample)> {
            let there = self.0.iter().filter(|(committed, _)| *committed <= now).map(|(_, sample)| *sample);
            let mut found: Vec<_> = there.filter(|(_, sample)| from <= sample.at && sample.at < to).collect();
            found.sort_by_key(|(_, sample)| sample.at);
            found
        }
    }

    fn run(forwarder: &mut Forwarder, stored: &Stored, now: i64, out: &mut Vec<f64>) {
        let window = forwarder.window(at(now));
        let batch = forwarder.on_samples(&mqtt(), window.1, stored.answer(now, window));
        out.extend(batch.samples.iter().filter_map(|(_, sample)| sample.value));
        forwarder.on_delivered(&mqtt(), &batch);
    }

    #[test]
    fn what_is_committed_late_is_sent_once() {
        // Every 300 ms a sample, committed up to 7 s after its time.
        let samples = (0..400).map(|n| (n * 300 + (n * 7_919) % 7_000, sample(n * 300, n as f64)));
        let stored = Stored(samples.collect());
        let mut forwarder = Forwarder::new(at(0), 1, 1.0);
        let mut out = Vec::new();
        for second in 1..140 {
            run(&mut forwarder, &stored, second * 1_000, &mut out);
        }
        out.sort_by(f64::total_cmp);
        assert_eq!(out, (0..400).map(f64::from).collect::<Vec<_>>());
        assert!(forwarder.sent.len() < 40, "what is remembered has a bound: {}", forwarder.sent.len());
    }

    #[test]
    fn what_was_not_acknowledged_is_sent_again() {
        let stored = Stored((0..10).map(|n| (0, sample(n * 100, n as f64))).collect());
        let mut forwarder = Forwarder::new(at(0), 1, 1.0);
        let window = forwarder.window(at(1_000));
        let first = forwarder.on_samples(&mqtt(), window.1, stored.answer(1_000, window));
        assert_eq!(first.samples.len(), 10);
        // The broker is gone.
        let window = forwarder.window(at(2_000));
        let second = forwarder.on_samples(&mqtt(), window.1, stored.answer(2_000, window));
        assert_eq!(second.samples, first.samples);
        forwarder.on_delivered(&mqtt(), &second);
        let mut out = Vec::new();
        run(&mut forwarder, &stored, 3_000, &mut out);
        assert_eq!(out, [0.0; 0]);
    }

    #[test]
    fn windows_adapt_to_how_much_lies_in_them() {
        let mut forwarder = Forwarder::new(at(0), 1, 1.0);
        let day = 24 * 3_600_000;
        let (_, to) = forwarder.window(at(100 * day));
        assert_eq!(to, at(60_000));
        forwarder.on_too_many();
        assert_eq!(forwarder.window(at(100 * day)).1, at(15_000));
        for _ in 0..20 {
            forwarder.on_too_many();
        }
        assert_eq!(forwarder.window(at(100 * day)).1, at(1));
        // Where nothing is stored, a hundred days take some steps.
        let mut steps = 0;
        while forwarder.cursor() < at(100 * day) {
            run(&mut forwarder, &Stored(Vec::new()), 100 * day, &mut Vec::new());
            steps += 1;
        }
        assert!(steps < 130, "{steps}");
    }

    #[test]
    fn a_clock_that_is_set_back_loses_nothing() {
        let mut forwarder = Forwarder::new(at(0), 1, 1.0);
        let mut out = Vec::new();
        let mut stored = Stored((0..60).map(|n| (0, sample(n * 1_000, n as f64))).collect());
        run(&mut forwarder, &stored, 60_000, &mut out);
        assert_eq!(out.len(), 60);
        stored.0.extend((0..20).map(|n| (0, sample(30_500 + n * 1_000, 100.0 + n as f64))));
        out.clear();
        for second in 31..52 {
            run(&mut forwarder, &stored, second * 1_000, &mut out);
        }
        let new = out.iter().filter(|value| **value >= 100.0).count();
        assert_eq!(new, 20, "{out:?}");
    }

    #[test]
    fn a_deadband_leaves_out_what_hardly_differs() {
        let def = MqttDef { deadbands: vec![0.5], ..mqtt() };
        let mut forwarder = Forwarder::new(at(0), 1, 1.0);
        let rows = vec![sample(0, 1.0), sample(100, 1.2), sample(200, 1.6), sample(300, 1.7)];
        let batch = forwarder.on_samples(&def, at(1_000), rows.clone());
        assert_eq!(batch.samples, [rows[0], rows[2]]);
        forwarder.on_delivered(&def, &batch);
        assert_eq!(forwarder.on_samples(&def, at(2_000), vec![sample(1_100, 1.7)]).samples, []);
    }
}
