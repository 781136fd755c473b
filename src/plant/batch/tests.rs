//! Batches from what is read: their begin, phases and end, over failures and restarts.

use super::*;
use crate::plant::{
    expr::Compare,
    fixture,
    sample::{Cause, Quality},
    time::elapsed,
};

const STEP: TagId = TagId(4);

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

/// The batches of records, by a clock that was never set; one that runs is as long as it is at `now`.
fn batches(records: &[BatchRecord], now: Timestamp) -> Vec<Batch> {
    let of_one = records.chunk_by(|one, next| one.number == next.number);
    let lasts = |records: &[BatchRecord], place: usize| {
        elapsed(records[place].at, records.get(place + 1).map_or(now, |next| next.at))
    };
    of_one.filter_map(|records| batch(records, |place| lasts(records, place))).collect()
}

/// Begins with FILL (1), ends with IDLE (0); 2 is HEAT, 3 has no word.
fn rule() -> (BatchDef, TagDef) {
    let def = BatchDef {
        name: "water".into(),
        start: Expr::test(STEP, Compare::Equal, 1.0),
        end: Expr::test(STEP, Compare::Equal, 0.0),
        phase: Some(STEP),
        energy: None,
        tags: Vec::new(),
    };
    let enum_labels = vec![(0, "IDLE".into()), (1, "FILL".into()), (2, "HEAT".into())];
    (def, TagDef { enum_labels, ..fixture::plant().tags[STEP.index()].clone() })
}

/// A step at a second: a number, an uncertain number, or none.
#[derive(Clone, Copy)]
enum Step {
    Good(f64),
    Uncertain(f64),
    Bad,
}
use Step::{Bad, Good, Uncertain};

fn follow(tracker: &mut BatchTracker, steps: &[(i64, Step)]) -> Vec<BatchRecord> {
    let (def, tag) = rule();
    let update = |(second, step): &(i64, Step)| {
        let sample = match *step {
            Good(value) => Sample::good(value, at(*second)),
            Uncertain(value) => Sample::good(value, at(*second)).uncertain(Cause::Timeout),
            Bad => Sample::bad(Cause::DeviceDown, at(*second)),
        };
        assert_eq!(matches!(step, Uncertain(_)), matches!(sample.quality, Quality::Uncertain(_)));
        tracker.update(&def, Some(&tag), &|_| sample, at(*second))
    };
    steps.iter().flat_map(update).collect()
}

/// `12 1.0 started FILL`: second, number and place, event, phase.
fn words(records: &[BatchRecord]) -> Vec<String> {
    let word = |BatchRecord { at, number, place, event, phase, .. }: &BatchRecord| {
        let phase = phase.as_deref().unwrap_or("-");
        format!("{} {number}.{place} {} {phase}", at.as_second(), event.word())
    };
    records.iter().map(word).collect()
}

fn fresh() -> BatchTracker {
    let mut tracker = BatchTracker::default();
    assert_eq!(tracker.restore(None, None), None);
    tracker
}

#[test]
fn a_batch_has_its_phases_and_the_next_start_ends_it() {
    let steps = [0.0, 1.0, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 1.0].map(Good);
    let steps: Vec<(i64, Step)> = (10..).zip(steps).collect();
    let records = follow(&mut fresh(), &steps);
    let expect = [
        "11 1.0 started FILL",
        "13 1.1 phase HEAT",
        "14 1.2 phase 3",
        "15 1.3 ended -",
        "15 2.0 started FILL",
        "16 2.1 ended -",
        "18 3.0 started FILL",
    ];
    assert_eq!(words(&records), expect);
    let found = batches(&records, at(30));
    let phases = |batch: &Batch| -> Vec<(String, u64)> {
        batch.phases.iter().map(|(name, time)| (name.to_string(), time.as_secs())).collect()
    };
    assert_eq!(phases(&found[0]), [("FILL".into(), 2), ("HEAT".into(), 1), ("3".into(), 1)]);
    assert_eq!((found[0].from, found[0].to, found[0].seen), (at(11), Some(at(15)), (true, true)));
    assert_eq!((found[2].to, found[2].label()), (None, "water-3".into()));
    assert_eq!(phases(&found[2]), [("FILL".into(), 12)], "it runs until now");
}

#[test]
fn a_late_answer_decides_nothing_and_a_lost_one_is_unknown() {
    let steps = [
        (1, Good(0.0)),
        (2, Good(1.0)),
        (3, Uncertain(1.0)),
        (4, Good(1.0)),
        (5, Bad),
        (6, Bad),
        (7, Uncertain(1.0)),
        (8, Good(1.0)),
        (9, Uncertain(0.0)),
        (10, Bad),
        (11, Good(0.0)),
    ];
    let records = follow(&mut fresh(), &steps);
    let expect =
        ["2 1.0 started FILL", "5 1.1 unknown -", "8 1.2 phase FILL", "10 1.3 unknown -", "11 1.4 found ended -"];
    assert_eq!(words(&records), expect);
    let batch = &batches(&records, at(99))[0];
    assert_eq!((batch.unknown, batch.seen), (Duration::from_secs(4), (true, false)));
    assert_eq!(batch.phases, [("FILL".into(), Duration::from_secs(5))]);
}

#[test]
fn what_begins_unseen_says_so() {
    // Already running when the plant is first read.
    assert_eq!(words(&follow(&mut fresh(), &[(1, Bad), (2, Good(1.0))])), ["2 1.0 found running FILL"]);
    // Not a start: it may be any phase of a batch whose begin was not seen.
    assert_eq!(words(&follow(&mut fresh(), &[(1, Good(2.0)), (2, Good(0.0))])), [""; 0]);
    // It began unseen.
    let records = follow(&mut fresh(), &[(1, Good(0.0)), (2, Bad), (3, Good(1.0))]);
    assert_eq!(words(&records), ["3 1.0 found running FILL"]);
    // The one before it ended there, too.
    let records = follow(&mut fresh(), &[(1, Good(0.0)), (2, Good(1.0)), (3, Good(2.0)), (4, Bad), (5, Good(1.0))]);
    let expect = ["4 1.2 unknown -", "5 1.3 found ended -", "5 2.0 found running FILL"];
    assert_eq!(words(&records)[2..], expect);
}

#[test]
fn a_restart_goes_on_and_gives_no_number_twice() {
    let before = follow(&mut fresh(), &[(1, Good(0.0)), (2, Good(1.0)), (3, Good(2.0))]);
    let restarted = |off| {
        let mut tracker = BatchTracker::default();
        assert_eq!(words(&follow(&mut tracker, &[(9, Good(1.0))])), [""; 0], "nothing before the history is known");
        let unknown = tracker.restore(before.last().cloned(), Some(at(off)));
        (tracker, words(unknown.as_slice()))
    };
    // The batch goes on: dead from 4 to 11.
    let (mut tracker, unknown) = restarted(4);
    assert_eq!(unknown, ["4 1.2 unknown -"]);
    let records = follow(&mut tracker, &[(10, Bad), (11, Good(2.0)), (12, Good(0.0))]);
    assert_eq!(words(&records), ["11 1.3 phase HEAT", "12 1.4 ended -"]);
    let records = follow(&mut tracker, &[(13, Good(1.0))]);
    assert_eq!(words(&records), ["13 2.0 started FILL"]);
    // It ended meanwhile.
    let (mut tracker, _) = restarted(4);
    let records = follow(&mut tracker, &[(11, Good(0.0)), (12, Good(1.0))]);
    assert_eq!(words(&records), ["11 1.3 found ended -", "12 2.0 started FILL"]);
    // Killed twice: unknown is unknown.
    let mut tracker = BatchTracker::default();
    let unknown = BatchRecord { event: BatchEvent::Unknown, phase: None, ..before[1].clone() };
    assert_eq!(tracker.restore(Some(unknown), Some(at(9))), None);
}
