//! What a person types to name a period: `last`, `night@2026-11-20`, `2026-11-21 06:00`.

use jiff::{Timestamp, civil, tz::AmbiguousOffset};

use super::{
    Period, PeriodName, calendar,
    shift::{instant, previous, recent, shift_at, shift_on},
};
use crate::plant::{def::PlantDef, keyword::Keyword, report::PeriodKind};

/// What is wrong with a period as it was typed: what was found, and what was expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PeriodError {
    /// A shift was asked of a plant without shifts.
    #[error("this plant has no shifts: give its beginning and its end")]
    NoShifts,
    /// No shift has this name.
    #[error("no shift `{found}`: expected last, current, {expected}, or one of these with @YYYY-MM-DD")]
    NoSuchShift {
        /// As typed.
        found: String,
        /// The names there are.
        expected: String,
    },
    /// What stands behind the @ is not a date.
    #[error("`{0}` is not a date: expected YYYY-MM-DD, as in 2026-11-21")]
    NotADate(String),
    /// The clocks skipped the shift on this date.
    #[error("there was no shift `{name}` on {date}: the clocks skipped it")]
    Skipped {
        /// Its name.
        name: String,
        /// Its date.
        date: civil::Date,
    },
    /// What stands behind the @ of a day, week or month is none.
    #[error("`{found}` is not a date: expected {expected}")]
    NotOfCalendar {
        /// As typed.
        found: String,
        /// The forms there are.
        expected: &'static str,
    },
    /// No kind of period has this name.
    #[error("no period `{0}`: expected day, week or month, or one of these with @DATE")]
    NoSuchPeriod(String),
    /// Not a time.
    #[error("`{0}` is not a time: expected local 2026-11-21T06:00, or with offset 2026-11-21T06:00+07:00")]
    NotATime(String),
    /// The instant lies in the future.
    #[error("{0} lies in the future")]
    InFuture(String),
    /// The period lies in the future.
    #[error("{0} has not started yet")]
    NotBegun(String),
    /// It ends before it begins, or at once.
    #[error("the period is empty: from {from} to {to}")]
    Empty {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
    },
    /// An end without a beginning.
    #[error("--to needs --from")]
    NoFrom,
    /// Both a shift and a free period.
    #[error("give either --shift or --from and --to, not both")]
    Both,
}

/// The period that was asked for; by default the last shift that is over.
///
/// `shift` is `last`, `current`, `NAME` (the latest of that name that has begun) or `NAME@YYYY-MM-DD` (the local date of
/// its start). `from` and `to` are local times of the plant or RFC 3339; without `to` the period ends now. A local time
/// that happens twice is read so that the period is the longer one.
pub fn period(
    def: &PlantDef,
    shift: Option<&str>,
    from: Option<&str>,
    to: Option<&str>,
    now: Timestamp,
) -> Result<Period, PeriodError> {
    match (shift, from, to) {
        (Some(_), Some(_), _) | (Some(_), _, Some(_)) => Err(PeriodError::Both),
        (None, None, Some(_)) => Err(PeriodError::NoFrom),
        (shift, None, None) => shift_named(def, shift.unwrap_or("last"), now),
        (None, Some(from), to) => {
            let from = moment(def, from, DstFold::First)?;
            let to = to.map_or(Ok(now), |to| moment(def, to, DstFold::Second))?;
            if from >= to {
                return Err(PeriodError::Empty { from, to });
            }
            begun(Period::free(from, to), now)
        }
    }
}

/// The period of a name: `day`, `week` or `month` as [`of_calendar`] reads it, else a shift as [`period`] does. A shift may have
/// one of these names, too, and comes first.
pub fn named(def: &PlantDef, text: &str, now: Timestamp) -> Result<Period, PeriodError> {
    let name = text.split_once('@').map_or(text, |(name, _)| name);
    let is_shift = def.shifts.iter().any(|shift| shift.name == name);
    match calendar_kind(name).filter(|_| !is_shift) {
        Some(_) => of_calendar(def, text, now),
        None => period(def, Some(text), None, None, now),
    }
}

/// A period of the calendar as it was typed: `day`, `week` or `month` for the last one that is over; with `@` and a date for the one
/// in which that date lies, which may still run. A week may also be given as `2026-W47`, a month as `2026-11`.
pub fn of_calendar(def: &PlantDef, text: &str, now: Timestamp) -> Result<Period, PeriodError> {
    let (name, date) = text.split_once('@').map_or((text, None), |(name, date)| (name, Some(date)));
    let kind = calendar_kind(name).ok_or_else(|| PeriodError::NoSuchPeriod(name.into()))?;
    let outside = || PeriodError::NotATime(text.into());
    let Some(date) = date else {
        let running = calendar::period_at(def, kind, now).ok_or_else(outside)?;
        return calendar::previous(def, kind, &running).ok_or_else(outside);
    };
    let date = calendar_date(kind, date)?;
    begun(calendar::period_of(def, kind, date).ok_or_else(outside)?, now)
}

/// The kind of a name that is not a shift's.
fn calendar_kind(name: &str) -> Option<PeriodKind> {
    PeriodKind::from_word(name).filter(|kind| *kind != PeriodKind::Shift)
}

/// A date in a period of this kind.
fn calendar_date(kind: PeriodKind, text: &str) -> Result<civil::Date, PeriodError> {
    let first = |form: &str| civil::Date::strptime(form, format!("{text}-01")).ok();
    let monday = || {
        let (year, week) = text.split_once("-W")?;
        let date = civil::ISOWeekDate::new(year.parse().ok()?, week.parse().ok()?, civil::Weekday::Monday);
        Some(date.ok()?.date())
    };
    let (other, expected) = match kind {
        PeriodKind::Shift | PeriodKind::Day => (None, "YYYY-MM-DD, as in 2026-11-21"),
        PeriodKind::Week => (monday(), "YYYY-MM-DD or YYYY-Www, as in 2026-W47"),
        PeriodKind::Month => (first("%Y-%m-%d"), "YYYY-MM-DD or YYYY-MM, as in 2026-11"),
    };
    let whole = civil::Date::strptime("%Y-%m-%d", text).ok();
    whole.or(other).ok_or_else(|| PeriodError::NotOfCalendar { found: text.into(), expected })
}

/// A past instant as it was typed: like the beginning of a period, or `03:12`, the last time that it was that time of day.
pub fn past_instant(def: &PlantDef, text: &str, now: Timestamp) -> Result<Timestamp, PeriodError> {
    // A date is read as a time, too.
    let time = text.parse::<civil::Time>().ok().filter(|_| !text.contains('-'));
    let at = match time {
        None => moment(def, text, DstFold::Second)?,
        Some(time) => {
            let today = now.to_zoned(def.time_zone.clone()).date();
            let days = [Some(today), today.yesterday().ok()];
            let times = days.into_iter().flatten().filter_map(|day| instant(&def.time_zone, day.to_datetime(time)));
            times.filter(|at| *at <= now).max().ok_or_else(|| PeriodError::NotATime(text.into()))?
        }
    };
    if at <= now { Ok(at) } else { Err(PeriodError::InFuture(text.into())) }
}

fn shift_named(def: &PlantDef, text: &str, now: Timestamp) -> Result<Period, PeriodError> {
    let current = shift_at(def, now).ok_or(PeriodError::NoShifts)?;
    match text {
        "current" => return Ok(current),
        "last" => return previous(def, &current).ok_or(PeriodError::NoShifts),
        _ => {}
    }
    let (name, date) = match text.split_once('@') {
        Some((name, date)) => (name, Some(date.parse().map_err(|_| PeriodError::NotADate(date.into()))?)),
        None => (text, None),
    };
    if !def.shifts.iter().any(|shift| shift.name == name) {
        let names: Vec<_> = def.shifts.iter().map(|shift| shift.name.as_str()).collect();
        return Err(PeriodError::NoSuchShift { found: name.into(), expected: names.join(", ") });
    }
    match date {
        Some(date) => {
            let period = shift_on(def, name, date).ok_or(PeriodError::Skipped { name: name.into(), date })?;
            begun(period, now)
        }
        // Two days of shifts hold every name, even if a clock change skipped one of them.
        None => recent(def, now, 2 * def.shifts.len() + 1)
            .into_iter()
            .find(|period| matches!(&period.name, PeriodName::Shift { name: found, .. } if found == name))
            .ok_or(PeriodError::NoShifts),
    }
}

fn begun(period: Period, now: Timestamp) -> Result<Period, PeriodError> {
    if period.from < now { Ok(period) } else { Err(PeriodError::NotBegun(period.name.to_string())) }
}

/// Which of two equal local times is meant.
enum DstFold {
    First,
    Second,
}

/// An instant with offset, or a local time of the plant (a date alone is its midnight).
fn moment(def: &PlantDef, text: &str, fold: DstFold) -> Result<Timestamp, PeriodError> {
    let wrong = || PeriodError::NotATime(text.into());
    // First, because a local time may be followed by an offset that reading it as local would pass over.
    if let Ok(at) = text.parse::<Timestamp>() {
        return Ok(at);
    }
    let offset = |c: char| c == '+' || c == 'Z' || c == 'z' || c == '[';
    let local: civil::DateTime = match text.contains(offset) {
        true => return Err(wrong()),
        false => text.parse().map_err(|_| wrong())?,
    };
    match (def.time_zone.to_ambiguous_timestamp(local).offset(), fold) {
        (AmbiguousOffset::Fold { after, .. }, DstFold::Second) => after.to_timestamp(local).ok(),
        (_, DstFold::First | DstFold::Second) => instant(&def.time_zone, local),
    }
    .ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{THREE, at, named, plant};

    const NOW: &str = "2026-11-21T09:00+07";

    #[test]
    fn an_instant_is_read_as_the_last_time_of_day() {
        let def = plant("Asia/Bangkok", &THREE);
        for (text, expect) in [
            ("03:12", Ok("2026-11-21T03:12+07")),
            ("09:00", Ok(NOW)),
            ("2026-11-21T09:00", Ok(NOW)),
            ("09:00:01", Ok("2026-11-20T09:00:01+07")),
            ("2026-11-20 22:15", Ok("2026-11-20T22:15+07")),
            ("2026-11-20T22:15Z", Ok("2026-11-20T22:15Z")),
            ("2026-11-21T09:01", Err(PeriodError::InFuture("2026-11-21T09:01".into()))),
            ("soon", Err(PeriodError::NotATime("soon".into()))),
        ] {
            assert_eq!(past_instant(&def, text, at(NOW)), expect.map(at), "{text}");
        }
    }

    fn ask(typed: (Option<&str>, Option<&str>, Option<&str>)) -> Result<Period, PeriodError> {
        period(&plant("Asia/Bangkok", &THREE), typed.0, typed.1, typed.2, at(NOW))
    }

    fn check(typed: (Option<&str>, Option<&str>, Option<&str>), name: &str, from: &str, to: &str) {
        assert_eq!(ask(typed), Ok(Period { name: named(name), from: at(from), to: at(to) }), "{typed:?}");
    }

    #[test]
    fn a_shift_is_found_by_its_name_and_date() {
        let night = ("night 2026-11-20", "2026-11-20T22:00+07", "2026-11-21T06:00+07");
        for typed in [None, Some("last"), Some("night"), Some("night@2026-11-20")] {
            check((typed, None, None), night.0, night.1, night.2);
        }
        for typed in [Some("current"), Some("morning"), Some("morning@2026-11-21")] {
            check((typed, None, None), "morning 2026-11-21", "2026-11-21T06:00+07", "2026-11-21T14:00+07");
        }
        let afternoon = ("afternoon 2026-11-20", "2026-11-20T14:00+07", "2026-11-20T22:00+07");
        check((Some("afternoon"), None, None), afternoon.0, afternoon.1, afternoon.2);
    }

    #[test]
    fn a_day_week_or_month_is_the_last_or_that_of_a_date() {
        let def = plant("Asia/Bangkok", &THREE);
        let check = |text: &str, expect: &str| {
            let got = of_calendar(&def, text, at(NOW)).map(|period| period.name.to_string());
            assert_eq!(got.unwrap_or_else(|error| error.to_string()), expect, "{text}");
        };
        check("day", "day 2026-11-20");
        check("day@2026-11-21", "day 2026-11-21");
        check("week", "2026-W46");
        check("week@2026-11-21", "2026-W47");
        check("week@2026-W01", "2026-W01");
        check("month", "2026-10");
        check("month@2026-11", "2026-11");
        check("month@2026-02-28", "2026-02");
        check("month@2026-12", "2026-12 has not started yet");
        check("week@2026-W60", "`2026-W60` is not a date: expected YYYY-MM-DD or YYYY-Www, as in 2026-W47");
        check("day@2026-11", "`2026-11` is not a date: expected YYYY-MM-DD, as in 2026-11-21");
        check("year", "no period `year`: expected day, week or month, or one of these with @DATE");
        check("shift", "no period `shift`: expected day, week or month, or one of these with @DATE");
        let other = plant("Asia/Bangkok", &[("day", 6, 0), ("night", 18, 0)]);
        let name = |text| super::named(&other, text, at(NOW)).expect("a period").name;
        assert_eq!(name("day"), PeriodName::Shift { name: "day".into(), date: civil::date(2026, 11, 21) });
        assert_eq!(name("week"), PeriodName::Week(civil::date(2026, 11, 9)));
    }

    #[test]
    fn a_free_period_is_local_unless_it_says_its_offset() {
        let expect = ("period", "2026-11-20T06:00+07", "2026-11-20T18:30+07");
        for (from, to) in [
            ("2026-11-20T06:00", "2026-11-20T18:30"),
            ("2026-11-20 06:00:00", "2026-11-20T18:30:00+07:00"),
            ("2026-11-19T23:00Z", "2026-11-20T12:30+01:00"),
        ] {
            check((None, Some(from), Some(to)), expect.0, expect.1, expect.2);
        }
        check((None, Some("2026-11-20"), None), "period", "2026-11-20T00:00+07", NOW);
    }

    #[test]
    fn a_repeated_hour_is_read_so_that_nothing_is_left_out() {
        let def = plant("Europe/Berlin", &THREE);
        let got = period(&def, None, Some("2026-10-25T02:30"), Some("2026-10-25T02:30"), at(NOW));
        let expect = Period::free(at("2026-10-25T02:30+02"), at("2026-10-25T02:30+01"));
        assert_eq!(got, Ok(expect));
    }

    #[test]
    fn a_wrong_period_is_answered_with_what_was_expected() {
        for (typed, words) in [
            ((Some("nite"), None, None), "no shift `nite`: expected last, current, morning, afternoon, night"),
            ((Some("night@20.11."), None, None), "`20.11.` is not a date: expected YYYY-MM-DD"),
            ((Some("night@2026-11-21"), None, None), "night 2026-11-21 has not started yet"),
            ((None, Some("six"), None), "`six` is not a time: expected local 2026-11-21T06:00"),
            ((None, Some("2026-11-20T06:00+banana"), None), "is not a time"),
            ((None, Some("2026-11-20T06:00[Europe/Berlin]"), None), "is not a time"),
            ((None, Some("2026-11-21T08:00"), Some("2026-11-21T07:00")), "the period is empty"),
            ((None, Some("2026-11-22"), Some("2026-11-23")), "period has not started yet"),
            ((None, None, Some("2026-11-22")), "--to needs --from"),
            ((Some("last"), Some("2026-11-22"), None), "either --shift or --from"),
        ] {
            let error = ask(typed).expect_err("a wrong period").to_string();
            assert!(error.contains(words), "{error}");
        }
        let none = period(&plant("Asia/Bangkok", &[]), None, None, None, at(NOW));
        assert_eq!(none, Err(PeriodError::NoShifts));
    }
}
