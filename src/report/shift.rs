//! The shift calendar: which shift an instant belongs to, and what its neighbours are.
//!
//! A shift starts at its local time on every date and lasts until the next start, whatever the clocks do in between, so
//! that shifts tile time: on a day of 23 or 25 hours the one shift over the change is shorter or longer. Two rules make
//! every start one instant:
//! - a start that the clocks skip (02:30 in spring) is the instant of the change itself;
//! - a start that happens twice (02:30 in autumn) is the first of the two.

use jiff::{Timestamp, ToSpan, civil, tz::AmbiguousOffset, tz::TimeZone};

use super::{Period, PeriodName};
use crate::plant::def::PlantDef;

/// The shift that is running at an instant; `None` if the plant has no shifts, or at the very ends of the calendar.
pub fn shift_at(def: &PlantDef, at: Timestamp) -> Option<Period> {
    let date = at.to_zoned(def.time_zone.clone()).date();
    // Two days to either side reach over a day that a zone skipped altogether (Samoa, 30 December 2011).
    let starts = starts_between(def, date.checked_sub(2.days()).ok()?, date.checked_add(2.days()).ok()?);
    let next = starts.partition_point(|start| start.at <= at);
    let current = starts.get(next.checked_sub(1)?)?;
    let end = starts.get(next)?;
    Some(Period {
        name: PeriodName::Shift { name: current.name.into(), date: current.date },
        from: current.at,
        to: end.at,
    })
}

/// The shift before a period.
pub fn previous(def: &PlantDef, period: &Period) -> Option<Period> {
    shift_at(def, period.from.checked_sub(1.nanosecond()).ok()?)
}

/// The last `n` shifts, newest first, the running one included.
pub fn recent(def: &PlantDef, now: Timestamp, n: usize) -> Vec<Period> {
    std::iter::successors(shift_at(def, now), |period| previous(def, period)).take(n).collect()
}

/// The shift of this name that starts on this local date; `None` if there is none, or if the clocks skipped it.
pub fn shift_on(def: &PlantDef, name: &str, date: civil::Date) -> Option<Period> {
    let start = def.shifts.iter().find(|shift| shift.name == name)?.start;
    let period = shift_at(def, instant(&def.time_zone, date.to_datetime(start))?)?;
    (period.name == PeriodName::Shift { name: name.into(), date }).then_some(period)
}

/// The instant of a local time: the clock change itself for a time that it skips, the first of two for one that it repeats.
pub fn instant(zone: &TimeZone, local: civil::DateTime) -> Option<Timestamp> {
    let ambiguous = zone.to_ambiguous_timestamp(local);
    match ambiguous.offset() {
        AmbiguousOffset::Unambiguous { .. } | AmbiguousOffset::Fold { .. } => ambiguous.earlier().ok(),
        AmbiguousOffset::Gap { after, .. } => {
            // Read with the offset after the change, the skipped time lies just before the change.
            let before_change = after.to_timestamp(local).ok()?;
            zone.following(before_change).next().map(|change| change.timestamp())
        }
    }
}

/// One start of a shift.
struct Start<'a> {
    at: Timestamp,
    name: &'a str,
    date: civil::Date,
}

/// Every start on the dates `first..=last`, in order. Of several at one instant (skipped by one clock change) the last
/// is the shift that is worked, the others have no length.
fn starts_between(def: &PlantDef, first: civil::Date, last: civil::Date) -> Vec<Start<'_>> {
    let dates = first.series(1.day()).take_while(|date| *date <= last);
    let mut starts: Vec<Start> = dates
        .flat_map(|date| {
            def.shifts.iter().filter_map(move |shift| {
                let at = instant(&def.time_zone, date.to_datetime(shift.start))?;
                Some(Start { at, name: &shift.name, date })
            })
        })
        .collect();
    starts.sort_by_key(|start| start.at);
    starts
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::report::testing::{THREE, at, named, plant};

    fn check(zone: &str, shifts: &[(&str, i8, i8)], now: &str, name: &str, from: &str, to: &str) {
        let period = shift_at(&plant(zone, shifts), at(now)).unwrap();
        assert_eq!(period, Period { name: named(name), from: at(from), to: at(to) }, "{zone} at {now}");
    }

    #[test]
    fn an_instant_belongs_to_the_shift_of_its_local_time() {
        let zone = "Asia/Bangkok";
        check(zone, &THREE, "2026-11-21T06:00+07", "morning 2026-11-21", "2026-11-21T06:00+07", "2026-11-21T14:00+07");
        check(zone, &THREE, "2026-11-21T05:59:59+07", "night 2026-11-20", "2026-11-20T22:00+07", "2026-11-21T06:00+07");
        check(zone, &THREE, "2026-11-21T23:59+07", "night 2026-11-21", "2026-11-21T22:00+07", "2026-11-22T06:00+07");
        check(
            zone,
            &[("day", 7, 30)],
            "2026-11-21T07:00+07",
            "day 2026-11-20",
            "2026-11-20T07:30+07",
            "2026-11-21T07:30+07",
        );
        assert_eq!(shift_at(&plant(zone, &[]), at("2026-11-21T06:00+07")), None);
    }

    #[test]
    fn a_shift_over_a_clock_change_is_shorter_or_longer() {
        let zone = "Europe/Berlin";
        // 23 h day: the night has 7 hours.
        check(zone, &THREE, "2026-03-29T00:00Z", "night 2026-03-28", "2026-03-28T22:00+01", "2026-03-29T06:00+02");
        // 25 h day: the night has 9 hours.
        check(zone, &THREE, "2026-10-25T00:00Z", "night 2026-10-24", "2026-10-24T22:00+02", "2026-10-25T06:00+01");
        // A start at 02:30 does not exist on 29 March: the shift starts with the change at 01:00 UTC.
        let odd = [("early", 2, 30), ("late", 14, 0)];
        check(zone, &odd, "2026-03-29T01:00Z", "early 2026-03-29", "2026-03-29T01:00Z", "2026-03-29T14:00+02");
        // 02:30 happens twice on 25 October: the first counts.
        check(zone, &odd, "2026-10-25T00:30Z", "early 2026-10-25", "2026-10-25T02:30+02", "2026-10-25T14:00+01");
        check(zone, &odd, "2026-10-25T01:40Z", "early 2026-10-25", "2026-10-25T02:30+02", "2026-10-25T14:00+01");
        // Two starts inside one gap: the first has no length and is never worked.
        let both = [("a", 2, 10), ("b", 2, 50)];
        check(zone, &both, "2026-03-29T01:00Z", "b 2026-03-29", "2026-03-29T01:00Z", "2026-03-30T02:10+02");
        let date = civil::date(2026, 3, 29);
        assert_eq!(shift_on(&plant(zone, &both), "a", date), None);
        assert!(shift_on(&plant(zone, &both), "b", date).is_some());
        // A zone that skipped a whole day.
        check(
            "Pacific/Apia",
            &THREE,
            "2011-12-30T10:00Z",
            "night 2011-12-30",
            "2011-12-30T10:00Z",
            "2011-12-31T06:00+14",
        );
    }

    #[test]
    fn the_starts_of_dates_are_those_of_first_and_last_too() {
        let def = plant("Asia/Bangkok", &THREE);
        let starts = starts_between(&def, civil::date(2026, 11, 20), civil::date(2026, 11, 21));
        let starts: Vec<_> = starts.iter().map(|start| (start.date.day(), start.name)).collect();
        let expect = [20, 21].map(|day| THREE.map(|(name, ..)| (day, name))).concat();
        assert_eq!(starts, expect);
    }

    #[test]
    fn the_list_of_shifts_is_unbroken_and_newest_first() {
        let def = plant("Asia/Bangkok", &THREE);
        let list = recent(&def, at("2026-11-21T09:00+07"), 4);
        let names: Vec<_> = list.iter().map(|period| period.name.to_string()).collect();
        assert_eq!(names, ["morning 2026-11-21", "night 2026-11-20", "afternoon 2026-11-20", "morning 2026-11-20"]);
        assert_eq!(shift_at(&def, list[1].to).as_ref(), Some(&list[0]));
    }

    const ZONES: [&str; 8] = [
        "Asia/Bangkok",
        "Europe/Berlin",
        "America/New_York",
        "Australia/Lord_Howe",
        "America/Sao_Paulo",
        "Asia/Beirut",
        "Africa/Casablanca",
        "Pacific/Apia",
    ];

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn shifts_tile_a_year_without_gap_or_overlap(
            zone in proptest::sample::select(&ZONES[..]),
            year in 1995i64..2037,
            starts in proptest::collection::btree_set(0i8..48, 1..5),
        ) {
            let names = ["a", "b", "c", "d"];
            let shifts: Vec<_> = starts.iter().zip(names).map(|(half, name)| (name, half / 2, half % 2 * 30)).collect();
            let def = plant(zone, &shifts);
            let begin = at(&format!("{year}-01-01T12:00Z"));
            let end = at(&format!("{}-01-01T12:00Z", year + 1));
            let mut period = shift_at(&def, begin).unwrap();
            let mut names = std::collections::HashSet::new();
            while period.from < end {
                prop_assert!(period.from < period.to);
                prop_assert!(names.insert(period.name.to_string()), "{} twice", period.name);
                // Every instant of it belongs to it: its first, a middle one and its last.
                let middle = period.from + period.to.duration_since(period.from) / 2;
                for instant in [period.from, middle, period.to - 1.nanosecond()] {
                    prop_assert_eq!(shift_at(&def, instant), Some(period.clone()));
                }
                let following = shift_at(&def, period.to).unwrap();
                prop_assert_eq!(following.from, period.to);
                prop_assert_eq!(previous(&def, &following), Some(period));
                period = following;
            }
        }
    }
}
