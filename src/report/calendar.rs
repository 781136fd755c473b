//! The calendar of reports: the shift, local day, ISO week or month that an instant lies in.
//!
//! Days, weeks and months last from local midnight to local midnight, whatever the clocks do in between: a day has 23 or 25 h
//! where they change.

use jiff::{Timestamp, ToSpan, civil::Date};

use super::{
    Period, PeriodName,
    shift::{instant, shift_at, shift_on},
};
use crate::plant::{def::PlantDef, report::PeriodKind};

/// The period of a kind in which an instant lies; `None` for a shift of a plant without shifts, and at the very ends of the
/// calendar.
pub fn period_at(def: &PlantDef, kind: PeriodKind, at: Timestamp) -> Option<Period> {
    let date = || at.to_zoned(def.time_zone.clone()).date();
    match kind {
        PeriodKind::Shift => shift_at(def, at),
        PeriodKind::Day | PeriodKind::Week | PeriodKind::Month => period_of(def, kind, date()),
    }
}

/// The day, week or month of a local date; `None` for shifts, of which a date has several.
pub fn period_of(def: &PlantDef, kind: PeriodKind, date: Date) -> Option<Period> {
    let (first, next, name): (Date, Date, fn(Date) -> PeriodName) = match kind {
        PeriodKind::Shift => return None,
        PeriodKind::Day => (date, date.tomorrow().ok()?, PeriodName::Day),
        PeriodKind::Week => {
            let monday = date.checked_sub(i64::from(date.weekday().to_monday_zero_offset()).days()).ok()?;
            (monday, monday.checked_add(1.week()).ok()?, PeriodName::Week)
        }
        PeriodKind::Month => {
            let first = date.first_of_month();
            (first, first.checked_add(1.month()).ok()?, PeriodName::Month)
        }
    };
    let midnight = |date: Date| instant(&def.time_zone, date.to_datetime(jiff::civil::Time::midnight()));
    Some(Period { name: name(first), from: midnight(first)?, to: midnight(next)? })
}

/// What a period is compared with: the one before it, and for a shift or day that of a week before.
pub fn comparable(def: &PlantDef, period: &Period) -> Vec<Period> {
    let Some(kind) = period.name.kind() else { return Vec::new() };
    let week_before = match &period.name {
        PeriodName::Shift { name, date } => date.checked_sub(1.week()).ok().and_then(|date| shift_on(def, name, date)),
        PeriodName::Day(date) => date.checked_sub(1.week()).ok().and_then(|date| period_of(def, kind, date)),
        PeriodName::Week(_) | PeriodName::Month(_) | PeriodName::Free | PeriodName::Batch(_) => None,
    };
    let mut periods: Vec<Period> = previous(def, kind, period).into_iter().chain(week_before).collect();
    periods.dedup();
    periods
}

/// The period before one of the same kind.
pub fn previous(def: &PlantDef, kind: PeriodKind, period: &Period) -> Option<Period> {
    period_at(def, kind, period.from.checked_sub(1.nanosecond()).ok()?)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use jiff::SignedDuration;
    use proptest::prelude::*;

    use super::*;
    use crate::report::testing::{THREE, at, plant};

    fn check(zone: &str, kind: PeriodKind, now: &str, name: &str, from: &str, to: &str) {
        let period = period_at(&plant(zone, &THREE), kind, at(now)).unwrap();
        assert_eq!((period.name.to_string().as_str(), period.from, period.to), (name, at(from), at(to)), "{now}");
    }

    #[test]
    fn days_weeks_and_months_begin_at_local_midnight() {
        use PeriodKind::{Day, Month, Shift, Week};
        let (zone, now) = ("Asia/Bangkok", "2026-11-21T09:00+07");
        check(zone, Shift, now, "morning 2026-11-21", "2026-11-21T06:00+07", "2026-11-21T14:00+07");
        check(zone, Day, now, "day 2026-11-21", "2026-11-21T00:00+07", "2026-11-22T00:00+07");
        check(zone, Week, now, "2026-W47", "2026-11-16T00:00+07", "2026-11-23T00:00+07");
        check(zone, Month, now, "2026-11", "2026-11-01T00:00+07", "2026-12-01T00:00+07");
        // The week of a date around New Year belongs to the year of its Thursday.
        check(zone, Week, "2027-01-02T09:00+07", "2026-W53", "2026-12-28T00:00+07", "2027-01-04T00:00+07");
        check(zone, Week, "2024-12-30T00:00+07", "2025-W01", "2024-12-30T00:00+07", "2025-01-06T00:00+07");
    }

    #[test]
    fn a_day_with_a_clock_change_has_23_or_25_hours() {
        use PeriodKind::{Day, Month, Week};
        let zone = "Europe/Berlin";
        check(zone, Day, "2026-10-25T12:00+01", "day 2026-10-25", "2026-10-25T00:00+02", "2026-10-26T00:00+01");
        check(zone, Day, "2026-03-29T12:00+02", "day 2026-03-29", "2026-03-29T00:00+01", "2026-03-30T00:00+02");
        let hours = |kind, now: &str| {
            let period = period_at(&plant(zone, &THREE), kind, at(now)).unwrap();
            period.to.duration_since(period.from)
        };
        for (kind, now, expect) in [
            (Day, "2026-10-25T12:00+01", 25),
            (Day, "2026-03-29T12:00+02", 23),
            (Week, "2026-10-20T12:00+02", 169),
            (Month, "2026-03-20T12:00+01", 743),
        ] {
            assert_eq!(hours(kind, now), SignedDuration::from_hours(expect), "{kind:?} of {now}");
        }
        // Cuba changes at midnight: that midnight is the instant of the change.
        check(
            "America/Havana",
            Day,
            "2026-03-08T12:00-04",
            "day 2026-03-08",
            "2026-03-08T01:00-04",
            "2026-03-09T00:00-04",
        );
    }

    proptest! {
        #[test]
        fn periods_of_a_kind_tile_time(
            second in 0i64..4_000_000_000,
            zone in prop::sample::select(vec!["Europe/Berlin", "America/Havana", "Asia/Bangkok", "Australia/Lord_Howe"]),
            kind in prop::sample::select(PeriodKind::ALL.to_vec()),
        ) {
            let def = plant(zone, &THREE);
            let now = Timestamp::from_second(second).unwrap();
            let period = period_at(&def, kind, now).unwrap();
            prop_assert!(period.from <= now && now < period.to);
            prop_assert_eq!(period_at(&def, kind, period.from).unwrap(), period.clone());
            let before = previous(&def, kind, &period).unwrap();
            prop_assert_eq!(before.to, period.from);
        }
    }
}
