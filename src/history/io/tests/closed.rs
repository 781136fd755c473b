//! The same period has the same figures, before and after every job of the archive.

use proptest::prelude::*;

use super::{
    archive::{HOUR_S, archive_all, assert_same, report},
    import::{by_tag, import_all},
    *,
};
use crate::history::io::compact::compact;

/// Hours that something happens in.
const HOURS: i64 = 30;
/// By then the month is over, and its files are merged.
const LATER: i64 = 24 * 40;

/// What happens to a history.
#[derive(Debug, Clone)]
enum Happening {
    /// A station records for so many seconds from a second on, after so many that it was off.
    Recorded { off: i64, lasts: i64, every: i64 },
    /// It is killed: no curve is ended before the next start.
    Killed,
    /// A file with rows from a second on.
    Imported { from: i64, lasts: i64, every: i64 },
    /// All jobs that are due.
    Archived,
    /// The same, and the database into a new file.
    Compacted,
}

fn happening() -> impl Strategy<Value = Happening> {
    let lasts = prop_oneof![1..200i64, 1..3 * HOUR_S];
    let off = prop_oneof![Just(0), 0..300i64, 0..4 * HOUR_S];
    prop_oneof![
        4 => (off, lasts.clone(), 5..140i64).prop_map(|(off, lasts, every)| Happening::Recorded { off, lasts, every }),
        1 => Just(Happening::Killed),
        3 => (0..HOURS * HOUR_S, lasts, 1..200i64)
            .prop_map(|(from, lasts, every)| Happening::Imported { from, lasts, every }),
        3 => Just(Happening::Archived),
        1 => Just(Happening::Compacted),
    ]
}

/// Samples of two tags; some are bad, one tag is late.
fn samples(from: i64, lasts: i64, every: i64) -> Vec<Record> {
    let value = |n: i64| (n * 7_919 % 1_000) as f64 / 10.0;
    let sample = |tag, n: i64, at| match n % 11 {
        3 => Record::Sample(tag, Sample::bad(Cause::Timeout, sec(at))),
        _ => good(tag, at, value(n)),
    };
    let pair = |n: i64| [sample(PV, n, from + n * every), sample(SV, n + 5, from + n * every + 2)];
    (0..=lasts / every).take(400).flat_map(pair).collect()
}

/// Does what happens to a history; `archived`: the jobs of the archive, too.
fn lived(db: &Path, happenings: &[Happening], archived: bool) -> Store {
    let (mut store, mut now) = (open(db, 0), 0);
    for happening in happenings {
        match happening {
            Happening::Recorded { off, lasts, every } if now + off + lasts < HOURS * HOUR_S => {
                store.append(&samples(now + off, *lasts, *every)).unwrap();
                now += off + lasts + 5;
            }
            Happening::Recorded { .. } => {}
            Happening::Killed => {
                now += 30;
                drop(store);
                store = open(db, now);
            }
            Happening::Imported { from, lasts, every } => {
                let rows = by_tag(&samples(*from, *lasts, *every));
                import_all(&store, rows, &format!("{from}-{lasts}-{every}.csv"), sec(HOURS * HOUR_S));
            }
            Happening::Archived if archived => drop(archive_all(&store, now / HOUR_S)),
            Happening::Archived => {}
            Happening::Compacted => {
                // What another process does while the station is off.
                match archived {
                    true => drop(compact(store, sec(now), &mut |_| Ok(())).unwrap()),
                    false => drop(store),
                }
                store = open(db, now);
            }
        }
    }
    store
}

#[test]
fn a_value_that_reaches_into_an_hour_without_samples_stays() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    store.append(&[good(PV, 10, 20.0), good(PV, HOUR_S - 50, 30.0), good(SV, 4 * HOUR_S, 1.0)]).unwrap();
    let figures = |store: &Store| {
        let of = |from, to| report(store, from, to).tags[0].clone();
        [of(HOUR_S, 2 * HOUR_S), of(0, 5 * HOUR_S)].map(|tag| (tag.last, (tag.good * 1e9).round()))
    };
    let before = figures(&store);
    assert_eq!(before[0], (Some(30.0.into()), (100.0 / 3_600.0 * 1e9_f64).round()));
    for hour in [2, 8, 50, LATER] {
        archive_all(&store, hour);
        assert_eq!(figures(&store), before, "hour {hour}");
    }
    // A file that begins after that hour, and one that fills it.
    for (from, to) in [(2 * HOUR_S, 3 * HOUR_S), (HOUR_S, 2 * HOUR_S)] {
        let rows = by_tag(&[good(PV, from + 200, 40.0), good(PV, to - 20, 41.0)]);
        import_all(&store, rows, &format!("{from}.csv"), sec(9 * HOUR_S)).unwrap();
        let filled = figures(&store);
        archive_all(&store, LATER);
        assert_eq!(figures(&store), filled, "from {from}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]
    #[test]
    fn a_period_has_the_same_figures_whatever_the_archive_did(
        happenings in proptest::collection::vec(happening(), 3..14),
    ) {
        let [(_one, db), (_two, plain)] = [folder(), folder()];
        let (store, plain) = (lived(&db, &happenings, true), lived(&plain, &happenings, false));
        store.append(&[good(PV, HOURS * HOUR_S, 1.0)]).unwrap();
        plain.append(&[good(PV, HOURS * HOUR_S, 1.0)]).unwrap();
        for (round, until, what) in [(0, 0, "as it was"), (1, HOURS + 2, "a day"), (2, LATER, "a month")] {
            archive_all(&store, until);
            assert_same(&store, &plain, HOURS, what);
            // Every third hour by itself, as it is closed.
            for hour in (round..HOURS).step_by(3) {
                let [got, expect] = [&store, &plain].map(|store| report(store, hour * HOUR_S, (hour + 1) * HOUR_S).tags);
                let figures = |tags: &[crate::report::TagFigures]| {
                    tags.iter().map(|tag| (tag.min, tag.max, tag.last, (tag.good * 1e9).round())).collect::<Vec<_>>()
                };
                prop_assert_eq!(figures(&got), figures(&expect), "{}: hour {}", what, hour);
            }
        }
    }
}
