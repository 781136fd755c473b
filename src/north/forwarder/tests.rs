//! What goes out when: windows, restarts, deadbands and clocks that are set.

use super::*;
use crate::{history::recorded::Over, north::payload::tests::mqtt};

fn at(millis: i64) -> Timestamp {
    Timestamp::from_millisecond(1_000_000_000 + millis).expect("in range")
}

fn sample(millis: i64, value: f64) -> (TagId, Sample) {
    (TagId(0), Sample::good(value, at(millis)))
}

/// A history of which some samples are committed only after a while.
struct Stored(Vec<(i64, (TagId, Sample))>);

/// What is asked while no clock is set.
fn ask(forwarder: &mut Forwarder, now: i64) -> (Timestamp, Timestamp) {
    let (_, from, to) = forwarder.window(0, at(now)).expect("the clock is not behind");
    (from, to)
}

fn of(samples: Vec<(TagId, Sample)>) -> StoredSamples {
    StoredSamples { samples, over: None }
}

impl Stored {
    fn answer(&self, now: i64, (from, to): (Timestamp, Timestamp)) -> StoredSamples {
        let there = self.0.iter().filter(|(committed, _)| *committed <= now).map(|(_, sample)| *sample);
        let mut found: Vec<_> = there.filter(|(_, sample)| from <= sample.at && sample.at < to).collect();
        found.sort_by_key(|(_, sample)| sample.at);
        of(found)
    }
}

fn run(forwarder: &mut Forwarder, stored: &Stored, now: i64, out: &mut Vec<f64>) {
    let window = ask(forwarder, now);
    let batch = forwarder.on_samples(&mqtt(), window.1, stored.answer(now, window));
    out.extend(batch.samples.iter().filter_map(|(_, sample)| sample.value));
    forwarder.on_delivered(&batch);
}

#[test]
fn what_is_committed_late_is_sent_once() {
    // Every 300 ms a sample, committed up to 7 s after its time.
    let samples = (0..400).map(|n| (n * 300 + (n * 7_919) % 7_000, sample(n * 300, n as f64)));
    let stored = Stored(samples.collect());
    let mut forwarder = Forwarder::new((0, at(0)), 1, 1.0);
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
    let mut forwarder = Forwarder::new((0, at(0)), 1, 1.0);
    let window = ask(&mut forwarder, 1_000);
    let first = forwarder.on_samples(&mqtt(), window.1, stored.answer(1_000, window));
    assert_eq!(first.samples.len(), 10);
    // The broker is gone.
    let window = ask(&mut forwarder, 2_000);
    let second = forwarder.on_samples(&mqtt(), window.1, stored.answer(2_000, window));
    assert_eq!(second.samples, first.samples);
    forwarder.on_delivered(&second);
    let mut out = Vec::new();
    run(&mut forwarder, &stored, 3_000, &mut out);
    assert_eq!(out, [0.0; 0]);
}

#[test]
fn windows_adapt_to_how_much_lies_in_them() {
    let mut forwarder = Forwarder::new((0, at(0)), 1, 1.0);
    let day = 24 * 3_600_000;
    let (_, to) = ask(&mut forwarder, 100 * day);
    assert_eq!(to, at(60_000));
    forwarder.on_too_many();
    assert_eq!(ask(&mut forwarder, 100 * day).1, at(15_000));
    for _ in 0..20 {
        forwarder.on_too_many();
    }
    assert_eq!(ask(&mut forwarder, 100 * day).1, at(1));
    // Where nothing is stored, a hundred days take some steps.
    let mut steps = 0;
    while forwarder.cursor().1 < at(100 * day) {
        run(&mut forwarder, &Stored(Vec::new()), 100 * day, &mut Vec::new());
        steps += 1;
    }
    assert!(steps < 130, "{steps}");
}

/// What a history of two epochs answers: the clock was set back from 60 s to 30.5 s.
fn two_epochs(now: i64, (epoch, from, to): (u16, Timestamp, Timestamp)) -> StoredSamples {
    let first: Vec<_> = (0..60).map(|n| sample(n * 1_000, n as f64)).collect();
    let then: Vec<_> = (0..100).map(|n| sample(30_500 + n * 1_000, 100.0 + n as f64)).collect();
    let is_there = |(_, sample): &(TagId, Sample)| from <= sample.at && sample.at < to;
    let is_stored = |(_, sample): &(TagId, Sample)| sample.at <= at(now);
    match epoch {
        0 => {
            let over = Over { ended: at(59_000), next: (1, at(30_500)) };
            StoredSamples { samples: first.into_iter().filter(is_there).collect(), over: Some(over) }
        }
        _ => of(then.into_iter().filter(is_there).filter(is_stored).collect()),
    }
}

#[test]
fn an_epoch_goes_out_whole_before_the_next_one_and_once() {
    // How far the first epoch was out when the clock was set back, and whether the station was stopped then.
    for (until, stopped) in [(60_000, false), (20_000, false), (45_000, true)] {
        let (mut forwarder, mut out) = (Forwarder::new((0, at(0)), 1, 1.0), Vec::new());
        let mut step = |forwarder: &mut Forwarder, latest: u16, now: i64| {
            let Some(asked) = forwarder.window(latest, at(now)) else { return };
            let mut stored = two_epochs(now, asked);
            stored.over = stored.over.filter(|_| 0 < latest);
            let batch = forwarder.on_samples(&mqtt(), asked.2, stored);
            out.extend(batch.samples.iter().filter_map(|(_, sample)| sample.value));
            forwarder.on_delivered(&batch);
        };
        step(&mut forwarder, 0, until);
        // The history does not know it yet.
        step(&mut forwarder, 0, 31_000);
        if stopped {
            let known: Vec<_> = forwarder.sent().collect();
            forwarder = Forwarder::new(forwarder.cursor(), 1, 1.0).knowing(known.into_iter());
        }
        for second in 31..90 {
            step(&mut forwarder, 1, second * 1_000);
        }
        let expect: Vec<f64> = (0..60).chain(100..159).map(f64::from).collect();
        assert_eq!(out, expect, "{until} {stopped}");
    }
}

#[test]
fn a_clock_that_is_behind_for_good_is_that_of_another_history() {
    let mut forwarder = Forwarder::new((3, at(60_000)), 1, 1.0);
    assert_eq!(forwarder.window(3, at(30_000)), None);
    let asked = (0..40).find_map(|_| forwarder.window(3, at(30_000)));
    assert_eq!(asked, Some((3, at(20_000), at(30_000))));
    assert_eq!(forwarder.window(0, at(40_000)), Some((0, at(20_000), at(40_000))), "its epochs begin again");
}

#[test]
fn a_deadband_leaves_out_what_hardly_differs() {
    let def = MqttDef { deadbands: vec![0.5], ..mqtt() };
    let mut forwarder = Forwarder::new((0, at(0)), 1, 1.0);
    let rows = vec![sample(0, 1.0), sample(100, 1.2), sample(200, 1.6), sample(300, 1.7)];
    let batch = forwarder.on_samples(&def, at(1_000), of(rows.clone()));
    assert_eq!(batch.samples, [rows[0], rows[2]]);
    forwarder.on_delivered(&batch);
    assert_eq!(forwarder.on_samples(&def, at(2_000), of(vec![sample(1_100, 1.7)])).samples, []);
}

/// What is sent of a history, a window each second, by a forwarder that is stopped and goes on after some of them.
fn sent_of(def: &MqttDef, stored: &Stored, seconds: i64, restarts: &[i64]) -> Vec<(TagId, i64, f64)> {
    let mut forwarder = Forwarder::new((0, at(0)), 3, 1.0);
    let mut out = Vec::new();
    for second in 1..=seconds {
        let window = ask(&mut forwarder, second * 1_000);
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
    let mut forwarder = Forwarder::new((0, at(0)), 3, 1.0);
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
    let rows =
        [(0, 0, 1.0), (0, 900, 5.0), (4_000, 300, 1.2), (4_000, 600, 9.0), (4_500, 4_500, 5.2), (5_000, 5_000, 5.6)];
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
    let mut forwarder = Forwarder::new((0, at(1_000)), 1, 1.0);
    let window = ask(&mut forwarder, 1_000);
    let batch = forwarder.on_samples(&def, window.1, stored.answer(1_000, window));
    assert_eq!(batch.samples.iter().filter_map(|(_, sample)| sample.value).collect::<Vec<_>>(), [1.0, 1.4, 2.0, 1.3]);
}
