//! Where the keys of a batch lead.

use super::*;
use crate::history::{Bucket, Series};

/// A plant with a rule of batches over two tags.
fn with_rule() -> Fixture {
    let mut fixture = Fixture::normal();
    fixture.def.batches[0].tags = ["TIC-1.PV", "TIC-1.MV"].map(|name| fixture.tag(name)).to_vec();
    fixture
}

/// What the curves were asked for: of which tag, from and to.
fn curves(stand: &Stand) -> Vec<(TagId, Timestamp, Timestamp)> {
    let of = |(_, query): &(QueryId, Query)| match query {
        Query::Series { tags, from, to, .. } => Some((tags[0], *from, *to)),
        _ => None,
    };
    stand.asked.iter().filter_map(of).collect()
}

#[test]
fn marked_batches_lie_over_each_other() {
    let (fixture, batches) = (with_rule(), batches());
    let tags = fixture.def.batches[0].tags.clone();
    for (name, width, height) in [("overlay_at_80x24", 80, 24), ("overlay_at_160x50", 160, 50)] {
        let mut stand = Stand::of(&fixture, Theme::FULL, width, height);
        stand.press("b");
        stand.answer(true);
        stand.press("↓ ↓↓ o");
        let spans = [&batches[1].batch, &batches[3].batch].map(|batch| (tags[0], batch.from, batch.to.expect("ended")));
        assert_eq!(curves(&stand), spans, "the marked ones, each over its own time");
        stand.answer(true);
        insta::assert_snapshot!(name, stand.screen());
        stand.press("→");
        assert_eq!(curves(&stand).iter().map(|(tag, ..)| *tag).collect::<Vec<_>>(), [tags[1]; 2], "another tag");
        assert!(!stand.screen().contains("100.0 %"), "figures of one tag never stand under another");
        stand.press("⎋");
        assert!(stand.screen().contains("■hot-water-18"), "the list with its marks");
    }
}

#[test]
fn without_marks_the_selected_batch_and_those_before_it() {
    let (fixture, batches) = (with_rule(), batches());
    let mut stand = Stand::of(&fixture, Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(true);
    stand.press("↓o");
    let from: Vec<Timestamp> = curves(&stand).iter().map(|(_, from, _)| *from).collect();
    assert_eq!(from, [1, 2, 3].map(|n: usize| batches[n].batch.from));
    // The curve of a running batch is read again, that of an ended one is not.
    stand.press("o");
    stand.answer(true);
    stand.press("5↑o");
    stand.answer(true);
    let snapshot = fixture.snapshot();
    let at = snapshot.at + SignedDuration::from_mins(1);
    stand.send(Msg::Snapshot(Arc::new(Snapshot { at, ..(*snapshot).clone() })));
    let again: Vec<Timestamp> = curves(&stand).iter().map(|(_, from, _)| *from).collect();
    assert_eq!(again, [batches[0].batch.from]);
}

#[test]
fn the_overlay_of_a_running_batch_ends_with_it() {
    let fixture = with_rule();
    let mut stand = Stand::of(&fixture, Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(true);
    stand.press("o");
    stand.answer(true);
    let snapshot = fixture.snapshot();
    let later = |stand: &mut Stand, minutes: i64| {
        let at = snapshot.at + SignedDuration::from_mins(minutes);
        stand.send(Msg::Snapshot(Arc::new(Snapshot { at, ..(*snapshot).clone() })));
    };
    later(&mut stand, 15);
    let end = snapshot.at + SignedDuration::from_mins(10);
    for (id, query) in std::mem::take(&mut stand.asked) {
        let answer = match query {
            Query::Batches { .. } => {
                let mut batches = batches();
                batches[0].batch.to = Some(end);
                Answer::Batches(batches)
            }
            Query::Series { tags, from, to, buckets } => curve(tags[0], (from, to), buckets),
            other => panic!("{other:?}"),
        };
        stand.send(Msg::Answer(id, Ok(answer)));
    }
    let begin = batches()[0].batch.from;
    assert_eq!(curves(&stand).iter().map(|(_, from, to)| (*from, *to)).collect::<Vec<_>>(), [(begin, end)]);
    stand.answer(true);
    let lasted = format!("{:.1}", end.duration_since(begin).as_secs_f64() / 60.0);
    let shown = stand.screen();
    let row = shown.lines().find(|line| line.contains("hot-water-19")).unwrap_or_default();
    assert!(row.contains(&lasted), "it lasted {lasted} min: {row}");
    later(&mut stand, 60);
    assert_eq!(stand.asked, Vec::new(), "all have ended: nothing is asked any more");
}

#[test]
fn the_curves_of_a_running_batch_reach_the_present() {
    let fixture = with_rule();
    let mut stand = Stand::of(&fixture, Theme::FULL, 80, 24);
    stand.press("b");
    stand.answer(true);
    let snapshot = fixture.snapshot();
    let at = snapshot.at + SignedDuration::from_mins(15);
    stand.send(Msg::Snapshot(Arc::new(Snapshot { at, ..(*snapshot).clone() })));
    for (keys, past) in [("t", false), ("5↓t", true)] {
        stand.press(keys);
        assert_eq!((stand.model.tabs.shown, stand.screen().contains(" past ")), (Tab::Trends, past), "{keys}");
    }
}

/// The answer to a query about one curve.
pub fn curve(tag: TagId, span: (Timestamp, Timestamp), buckets: usize) -> Answer {
    Answer::Series(vec![rising(tag, span, buckets)])
}

/// A curve that rises by 1 in each minute.
pub fn rising(tag: TagId, (from, to): (Timestamp, Timestamp), buckets: usize) -> Series {
    let step = to.duration_since(from).unsigned_abs() / u32::try_from(buckets).expect("a screen of columns");
    let minutes = |n: usize| n as f64 * step.as_secs_f64() / 60.0;
    let bucket = |n| {
        let value = minutes(n);
        Some(Bucket { min: value, max: value, mean: value, last: value.into() })
    };
    let summary = Some((0.0.into(), (minutes(buckets) / 2.0).into(), minutes(buckets).into()));
    Series { tag, from, step, buckets: (0..buckets).map(bucket).collect(), summary, counted: None, good: 1.0 }
}
