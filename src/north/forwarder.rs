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

use std::time::Duration;

use jiff::Timestamp;

use super::deadband::differs;
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

/// The state of the samples that go out. A window is asked of the history, its samples are sent, and when the broker has
/// acknowledged them the cursor moves to its end.
#[derive(Debug)]
pub struct Forwarder {
    cursor: Timestamp,
    span: Duration,
    overlap: Duration,
    sent: Sent,
    /// What was sent before this instant is not known: there, no deadband leaves anything out.
    unknown_before: Timestamp,
}

/// What is sent next.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// The cursor when they have arrived.
    pub until: Timestamp,
    /// In order of time.
    pub samples: Vec<(TagId, Sample)>,
}

/// What was sent of each tag in the last `OVERLAP` before the cursor, and the last one before that, in order of time.
#[derive(Debug, Clone)]
struct Sent(Vec<Vec<Sample>>);

impl Forwarder {
    /// Everything before the cursor has been read once, and is at the broker. `speed`: plant seconds per real second.
    pub fn new(cursor: Timestamp, tags: usize, speed: f64) -> Forwarder {
        let overlap = OVERLAP.mul_f64(speed.max(1.0));
        Forwarder { cursor, span: SPAN, overlap, sent: Sent(vec![Vec::new(); tags]), unknown_before: cursor }
    }

    /// The same where it is known what was sent last, see [`Forwarder::sent`].
    pub fn knowing(self, sent: impl Iterator<Item = (TagId, Sample)>) -> Forwarder {
        let mut known = Forwarder { unknown_before: Timestamp::MIN, ..self };
        sent.for_each(|(tag, sample)| known.sent.add(tag, sample));
        known
    }

    /// What is read next begins `OVERLAP` before this instant.
    pub fn cursor(&self) -> Timestamp {
        self.cursor
    }

    /// What the next one must know, to go on where this one ends.
    pub fn sent(&self) -> impl Iterator<Item = (TagId, Sample)> {
        (0..).zip(&self.sent.0).flat_map(|(tag, sent)| sent.iter().map(move |sample| (TagId(tag), *sample)))
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
            self.sent.0.iter_mut().for_each(Vec::clear);
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
        let mut sent = self.sent.clone();
        let is_due = |(tag, sample): &(TagId, Sample)| {
            let all = def.deadband(*tag) == 0.0 || sample.at < self.unknown_before;
            let is_due = sent.lacks(*tag, *sample, |before| all || differs(def, *tag, before, *sample));
            if is_due {
                sent.add(*tag, *sample);
            }
            is_due
        };
        Batch { until, samples: samples.into_iter().filter(is_due).collect() }
    }

    /// The broker has acknowledged all of a batch.
    pub fn on_delivered(&mut self, batch: &Batch) {
        batch.samples.iter().for_each(|(tag, sample)| self.sent.add(*tag, *sample));
        self.cursor = batch.until;
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
        forwarder.on_delivered(&batch);
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
        let remembered = forwarder.sent().count();
        assert!(remembered < 40, "what is remembered has a bound: {remembered}");
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
        forwarder.on_delivered(&second);
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
        forwarder.on_delivered(&batch);
        assert_eq!(forwarder.on_samples(&def, at(2_000), vec![sample(1_100, 1.7)]).samples, []);
    }

    /// What is sent of a history, a window each second, by a forwarder that is stopped and goes on after some of them.
    fn sent_of(def: &MqttDef, stored: &Stored, seconds: i64, restarts: &[i64]) -> Vec<(TagId, i64, f64)> {
        let mut forwarder = Forwarder::new(at(0), 3, 1.0);
        let mut out = Vec::new();
        for second in 1..=seconds {
            let window = forwarder.window(at(second * 1_000));
            let batch = forwarder.on_samples(def, window.1, stored.answer(second * 1_000, window));
            let millis = |at: Timestamp| at.as_millisecond() - at_0();
            out.extend(batch.samples.iter().filter_map(|(tag, sample)| Some((*tag, millis(sample.at), sample.value?))));
            forwarder.on_delivered(&batch);
            if restarts.contains(&second) {
                let known: Vec<_> = forwarder.sent().collect();
                forwarder = Forwarder::new(forwarder.cursor(), 3, 1.0).knowing(known.into_iter());
            }
        }
        out
    }

    fn at_0() -> i64 {
        at(0).as_millisecond()
    }

    #[test]
    fn what_a_deadband_left_out_is_not_sent_later() {
        let def = MqttDef { deadbands: vec![0.5, 2.0, 0.0], ..mqtt() };
        let stored =
            Stored([(0, 1.0), (100, 1.4), (200, 2.0), (300, 2.1)].map(|(ms, value)| (0, sample(ms, value))).into());
        let expect = [(TagId(0), 0, 1.0), (TagId(0), 200, 2.0)];
        assert_eq!(sent_of(&def, &stored, 30, &[]), expect);
        assert_eq!(sent_of(&def, &stored, 30, &[1, 5, 10, 11, 12]), expect, "by a station that is restarted");
    }

    #[test]
    fn windows_and_restarts_change_nothing_of_what_is_sent() {
        let def = MqttDef { deadbands: vec![0.5, 2.0, 0.0], ..mqtt() };
        // Three tags that wander, each sample committed at its time.
        let mut seed = 1_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as f64 / f64::from(1_u32 << 31)
        };
        let mut rows = Vec::new();
        let mut values = [0.0; 3];
        for (n, tag) in (0..900_i64).zip([0_u16, 1, 2].into_iter().cycle()) {
            let value = &mut values[usize::from(tag)];
            *value += next() - 0.5;
            rows.push((n * 70, (TagId(tag), Sample::good(*value, at(n * 70)))));
        }
        let stored = Stored(rows);
        let mut forwarder = Forwarder::new(at(0), 3, 1.0);
        let all = forwarder.on_samples(&def, at(100_000), stored.answer(100_000, (at(0), at(100_000)))).samples;
        let mut all: Vec<_> = all
            .iter()
            .map(|(tag, sample)| (*tag, sample.at.as_millisecond() - at_0(), sample.value.unwrap_or(f64::NAN)))
            .collect();
        let mut sent = sent_of(&def, &stored, 80, &[7, 8, 30, 55]);
        let of = |tag: u16| all.iter().filter(|(of, ..)| *of == TagId(tag)).count();
        assert!(of(2) == 300 && of(1) < of(0) && of(0) < 200, "{} {} {}", of(0), of(1), of(2));
        all.sort_by_key(|(tag, at, _)| (*at, *tag));
        sent.sort_by_key(|(tag, at, _)| (*at, *tag));
        assert_eq!(sent, all);
    }

    #[test]
    fn what_comes_late_is_compared_with_its_neighbour() {
        let def = MqttDef { deadbands: vec![0.5, 0.0, 0.0], ..mqtt() };
        // Two samples of the time before that of the last one are committed three seconds later: one as its neighbour, one not.
        let rows = [
            (0, 0, 1.0),
            (0, 900, 5.0),
            (4_000, 300, 1.2),
            (4_000, 600, 9.0),
            (4_500, 4_500, 5.2),
            (5_000, 5_000, 5.6),
        ];
        let stored = Stored(rows.map(|(committed, ms, value)| (committed, sample(ms, value))).into());
        let sent: Vec<_> = sent_of(&def, &stored, 20, &[]).into_iter().map(|(_, _, value)| value).collect();
        assert_eq!(sent, [1.0, 5.0, 9.0, 5.6]);
    }

    #[test]
    fn where_it_is_not_known_what_was_sent_all_is_sent() {
        let def = MqttDef { deadbands: vec![0.5], ..mqtt() };
        let stored =
            Stored([(0, 1.0), (100, 1.4), (200, 2.0), (300, 1.3)].map(|(ms, value)| (0, sample(ms, value))).into());
        // After a failure: the last one is sent, so the broker has no value that is further off than the deadband.
        let mut forwarder = Forwarder::new(at(1_000), 1, 1.0);
        let window = forwarder.window(at(1_000));
        let batch = forwarder.on_samples(&def, window.1, stored.answer(1_000, window));
        assert_eq!(
            batch.samples.iter().filter_map(|(_, sample)| sample.value).collect::<Vec<_>>(),
            [1.0, 1.4, 2.0, 1.3]
        );
    }
}
