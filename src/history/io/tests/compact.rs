//! A compacted history is the same history in less room.

use super::{
    archive::{HOUR_S, content, filled, rows},
    *,
};
use crate::history::io::{compact::compact, last};

#[test]
fn a_compacted_history_is_smaller_and_the_same() {
    let (_folder, db) = folder();
    let store = filled(&db, &rows(26));
    store.append(&[Record::Alarm(step(50, "high", AlarmEvent::Raised)), Record::Action(action(60))]).unwrap();
    store.end_curves_left_behind(sec(27 * HOUR_S)).unwrap();
    let (expect, last_commit) = (content(&store), store.last_commit());
    let expect_log = store.answer(&Query::Journal { from: sec(0), to: sec(100), limit: 9 }, sec(100)).unwrap();
    let mut steps = 0;
    // Killed at every step, and done once more.
    let done = loop {
        steps += 1;
        let mut left = steps;
        let kill = &mut |_: &'static str| {
            left -= 1;
            if left == 0 { Err(HistoryError::NotOpen) } else { Ok(()) }
        };
        let store = Store::open(&db, &def(), sec(27 * HOUR_S)).unwrap();
        assert_eq!(store.trouble, None, "killed at step {steps}");
        assert!(!with_suffix(&db, ".compact").exists());
        match compact(store.store, sec(27 * HOUR_S), kill) {
            Ok(done) => break done,
            Err(error) => assert_eq!(error, HistoryError::NotOpen),
        }
    };
    assert!(steps > 5 && done.after <= done.before, "{steps} {done:?}");
    let opened = Store::open(&db, &def(), sec(27 * HOUR_S)).unwrap();
    assert_eq!((opened.trouble, opened.store.last_commit()), (None, last_commit));
    assert!(content(&opened.store) == expect);
    let log = opened.store.answer(&Query::Journal { from: sec(0), to: sec(100), limit: 9 }, sec(100)).unwrap();
    assert_eq!(log, expect_log);
    assert_eq!(last::read(&db), last::Noted::Commit(last_commit));
    // Room is given back: of a day of samples nothing is left in the database.
    let (_other, db) = folder();
    let store = open(&db, 0);
    let many: Vec<Record> = (0..300_000).map(|n| good(PV, n / 10, (n as f64).sqrt())).collect();
    many.chunks(50_000).for_each(|part| store.append(part).unwrap());
    store.checkpoint().unwrap();
    let done = compact(store, sec(20 * HOUR_S), &mut |_| Ok(())).unwrap();
    assert!(done.jobs >= 9 && done.after < done.before / 2, "{done:?}");
}

#[test]
fn a_compacted_history_ends_where_its_station_was_killed() {
    let (_folder, db) = folder();
    drop(filled(&db, &[good(PV, 10, 27.0), good(PV, 1_000, 28.0)]));
    let figures = |store: &Store| {
        let hour = store.report(&crate::report::Period::free(sec(0), sec(HOUR_S)), sec(9 * HOUR_S)).unwrap();
        (hour.tags, means(store, PV, 0, HOUR_S, 6))
    };
    let read = || Store::open_read_only(&db, &def()).unwrap();
    let before = figures(&read());
    assert_eq!(before.1[1..], [Some(28.0), None, None, None, None]);
    let store = Store::open(&db, &def(), sec(9 * HOUR_S)).unwrap().store;
    assert!(0 < compact(store, sec(9 * HOUR_S), &mut |_| Ok(())).unwrap().jobs);
    assert_eq!(figures(&read()), before);
    assert_eq!(figures(&open(&db, 9 * HOUR_S)), before);
}

#[test]
fn a_history_that_is_read_elsewhere_is_not_compacted() {
    let (_folder, db) = folder();
    let store = filled(&db, &rows(1));
    let reader = store.try_clone().unwrap();
    let why = compact(store, sec(0), &mut |_| Ok(())).unwrap_err().to_string();
    assert!(why.contains("did not close in order"), "{why}");
    drop(reader);
    assert!(content(&open(&db, HOUR_S)).len() > 100);
}
