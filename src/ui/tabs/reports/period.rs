//! Which period a report is of: the shifts of the plant, days where it has none, or a typed period; pure.

use jiff::{ToSpan, civil, tz::TimeZone};

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{def::PlantDef, report::PeriodKind},
    report::{Period, PeriodName, calendar, period_parser, shift},
    text::date,
};

/// The longest free period: five years.
const LONGEST: SignedDuration = SignedDuration::from_hours(24 * 5 * 366);
/// What may be typed, for the entry window.
pub const FORMS: &str = "06:00-14:00  2026-11-20  2026-11-20 22:00-06:00  night@2026-11-20  week";

/// The shift of an instant, or the local day where the plant has no shifts.
pub fn at(def: &PlantDef, at: Timestamp) -> Option<Period> {
    if !def.shifts.is_empty() {
        return shift::shift_at(def, at);
    }
    calendar::period_at(def, PeriodKind::Day, at)
}

/// The name of a period as it stands on a screen.
pub fn label(name: &PeriodName) -> String {
    match name {
        PeriodName::Free => t!("period").to_owned(),
        PeriodName::Day(day) => t!("day {date}", date = date(*day)),
        PeriodName::Shift { name, date: day } => format!("{name} {}", date(*day)),
        PeriodName::Week(_) | PeriodName::Month(_) | PeriodName::Batch(_) => name.to_string(),
    }
}

/// `22:00 – 11-21 06:00 +07`; dates only where the name of the period does not have them.
pub fn span(period: &Period, zone: &TimeZone) -> String {
    let (from, to) = (period.from.to_zoned(zone.clone()), period.to.to_zoned(zone.clone()));
    let form = if from.date() == to.date() { "%H:%M" } else { "%m-%d %H:%M" };
    let named = period.name.date() == Some(from.date());
    let start = from.strftime(if named { "%H:%M" } else { "%Y-%m-%d %H:%M" });
    let offset = |at: &jiff::Zoned| {
        let (seconds, sign) = (at.offset().seconds(), if at.offset().is_negative() { '-' } else { '+' });
        let minutes = seconds.abs() / 60 % 60;
        let hours = format!("{sign}{:02}", seconds.abs() / 3_600);
        if minutes == 0 { hours } else { format!("{hours}:{minutes:02}") }
    };
    // Where the clocks change in between, both ends show their offset.
    let first = if from.offset() == to.offset() { String::new() } else { format!(" {}", offset(&from)) };
    format!("{start}{first} – {} {}", to.strftime(form), offset(&to))
}

/// `morning 2026-11-21 06:00 – 14:00 +07`; a free period has its times only.
pub fn words(cx: &ViewContext, period: &Period) -> String {
    let span = span(period, &cx.def().time_zone);
    match period.name {
        PeriodName::Free => span,
        PeriodName::Shift { .. }
        | PeriodName::Day(_)
        | PeriodName::Week(_)
        | PeriodName::Month(_)
        | PeriodName::Batch(_) => format!("{} {span}", label(&period.name)),
    }
}

/// The period of the same kind at another instant; a shift or day where it has no kind.
fn like(def: &PlantDef, period: &Period, instant: Timestamp) -> Option<Period> {
    period.name.kind().map_or_else(|| at(def, instant), |kind| calendar::period_at(def, kind, instant))
}

/// The shift, day, week or month before a period.
pub fn before(def: &PlantDef, period: &Period) -> Option<Period> {
    like(def, period, period.from.checked_sub(SignedDuration::from_nanos(1)).ok()?)
}

/// The one after a period, if it has begun.
fn after(def: &PlantDef, period: &Period, now: Timestamp) -> Option<Period> {
    like(def, period, period.to).filter(|next| next.from <= now)
}

/// The shift so many further on than the one shown; `None` is the present, where `by` is 0 and after the running shift.
pub fn step(cx: &ViewContext, shown: Option<&Period>, by: isize) -> Option<Period> {
    match (by, shown) {
        (..0, None) => at(cx.def(), cx.now),
        (..0, Some(shown)) => before(cx.def(), shown).or_else(|| Some(shown.clone())),
        (1.., Some(shown)) => after(cx.def(), shown, cx.now),
        (0, _) | (1.., None) => None,
    }
}

/// The period that was typed: `from-to`, each a time, a date or both; a date alone is that day, a time alone lasts until
/// now, a shift may be named. Times without a date are of today, or of last night where the first is the later one.
pub fn typed(def: &PlantDef, text: &str, now: Timestamp) -> Result<Period, String> {
    let text = text.trim();
    let said = |error: period_parser::PeriodError| error.to_string();
    let period = match split(text) {
        _ if text.is_empty() => return Err(t!("expected {FORMS}", FORMS)),
        (from, None) if from.starts_with(|c: char| c.is_alphabetic()) => {
            return period_parser::named(def, from, now).map_err(said);
        }
        (from, to) => {
            let (from, to) = whole(def, from, to, now)?;
            period_parser::period(def, None, Some(&from), to.as_deref(), now).map_err(said)?
        }
    };
    if period.to.duration_since(period.from) > LONGEST {
        return Err(t!("five years at most").to_owned());
    }
    Ok(period)
}

/// Cuts `from-to` in two; the dashes of a date are no cut.
fn split(text: &str) -> (&str, Option<&str>) {
    for cut in ["–", "..", " - ", t!(" to ")] {
        if let Some((from, to)) = text.split_once(cut) {
            return (from.trim(), Some(to.trim()));
        }
    }
    let after_time = text.find(':').and_then(|colon| Some(colon + text[colon..].find('-')?));
    match after_time.filter(|_| !text.starts_with(char::is_alphabetic)) {
        Some(dash) => (text[..dash].trim(), Some(text[dash + 1..].trim())),
        None => (text, None),
    }
}

/// Adds what was left out: dates, and the times of whole days.
fn whole(def: &PlantDef, from: &str, to: Option<&str>, now: Timestamp) -> Result<(String, Option<String>), String> {
    let today = now.to_zoned(def.time_zone.clone()).date();
    let (from_date, from_time) = parts(from)?;
    let to = to.filter(|to| !to.is_empty() && *to != "now").map(parts).transpose()?;
    let mut first = from_date.unwrap_or(today);
    let end = match to {
        None if from_time.is_some() => None,
        None => Some((day_after(first)?, civil::Time::midnight())),
        Some((Some(date), None)) => Some((day_after(date)?, civil::Time::midnight())),
        Some((date, time)) => {
            let time = time.unwrap_or(civil::Time::midnight());
            let backwards = date.is_none() && from_time.is_some_and(|from| from >= time);
            if backwards && from_date.is_none() {
                first = first.yesterday().map_err(|error| error.to_string())?;
            }
            let last = if backwards { day_after(first)? } else { date.unwrap_or(first) };
            Some((last, time))
        }
    };
    let text = |(date, time): (civil::Date, civil::Time)| format!("{date}T{}", time.strftime("%H:%M:%S"));
    Ok((text((first, from_time.unwrap_or(civil::Time::midnight()))), end.map(text)))
}

/// Date and time of one end; at least one of them is there.
fn parts(text: &str) -> Result<(Option<civil::Date>, Option<civil::Time>), String> {
    let wrong = || t!("`{text}` is not a time: expected 06:00, 2026-11-21 or 2026-11-21 06:00", text);
    let mut words = text.split([' ', 'T']).filter(|word| !word.is_empty());
    let (first, second) = (words.next().ok_or_else(wrong)?, words.next());
    let time = |word: &str| word.contains(':').then(|| word.parse::<civil::Time>().ok()).flatten();
    let date = |word: &str| word.parse::<civil::Date>().ok().filter(|_| !word.contains(':'));
    match (date(first), second, words.next()) {
        (Some(date), None, None) => Ok((Some(date), None)),
        (Some(date), Some(second), None) => Ok((Some(date), Some(time(second).ok_or_else(wrong)?))),
        (None, None, None) => Ok((None, Some(time(first).ok_or_else(wrong)?))),
        _ => Err(wrong()),
    }
}

fn day_after(date: civil::Date) -> Result<civil::Date, String> {
    date.checked_add(1.day()).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use crate::report::FORMATS;

    use super::*;
    use crate::ui::fixture::{Fixture, now, with_cx};

    fn words(def: &PlantDef, period: &Period) -> String {
        let local = |at: Timestamp| at.to_zoned(def.time_zone.clone()).strftime("%m-%d %H:%M").to_string();
        format!("{}: {} to {}", period.name, local(period.from), local(period.to))
    }

    #[test]
    fn a_period_is_understood_as_it_is_typed() {
        let def = Fixture::normal().def;
        let check = |text: &str, expect: &str| {
            let got = typed(&def, text, now()).map_or_else(|error| error, |period| words(&def, &period));
            assert_eq!(got, expect, "{text}");
        };
        check("06:00-14:00", "period: 11-21 06:00 to 11-21 14:00");
        check(" 06:00 - 14:00 ", "period: 11-21 06:00 to 11-21 14:00");
        check("06:00–now", "period: 11-21 06:00 to 11-21 14:02");
        check("06:00", "period: 11-21 06:00 to 11-21 14:02");
        check("22:00-06:00", "period: 11-20 22:00 to 11-21 06:00");
        check("2026-11-20", "period: 11-20 00:00 to 11-21 00:00");
        check("2026-11-18..2026-11-20", "period: 11-18 00:00 to 11-21 00:00");
        check("2026-11-20 22:00-06:00", "period: 11-20 22:00 to 11-21 06:00");
        check("2026-11-19 22:00-2026-11-21 06:00", "period: 11-19 22:00 to 11-21 06:00");
        check("2026-11-19T22:00 to 2026-11-21T06:00", "period: 11-19 22:00 to 11-21 06:00");
        check("night@2026-11-19", "night 2026-11-19: 11-19 22:00 to 11-20 06:00");
        check("last", "morning 2026-11-21: 11-21 06:00 to 11-21 14:00");
        check("day", "day 2026-11-20: 11-20 00:00 to 11-21 00:00");
        check("week@2026-11-20", "2026-W47: 11-16 00:00 to 11-23 00:00");
        check("month@2026-10", "2026-10: 10-01 00:00 to 11-01 00:00");
        check("25:00-26:00", "`25:00` is not a time: expected 06:00, 2026-11-21 or 2026-11-21 06:00");
        check("6 o'clock", "`6 o'clock` is not a time: expected 06:00, 2026-11-21 or 2026-11-21 06:00");
        check("2016-01-01 - 2026-11-01", "five years at most");
        check("", &format!("expected {FORMS}"));
        for nonsense in
            ["2027-01-01", "-", "–", "::", "2026-11-20 2026-11-21", "lunch", "..", "2026-11-21 - 2026-11-20"]
        {
            assert!(typed(&def, nonsense, now()).is_err(), "{nonsense}");
        }
    }

    #[test]
    fn shifts_follow_each_other_up_to_the_running_one() {
        let def = Fixture::normal().def;
        let running = at(&def, now()).expect("a shift runs");
        assert_eq!(words(&def, &running), "afternoon 2026-11-21: 11-21 14:00 to 11-21 22:00");
        assert_eq!(after(&def, &running, now()), None);
        let last = before(&def, &running).expect("a shift before");
        assert_eq!(words(&def, &last), "morning 2026-11-21: 11-21 06:00 to 11-21 14:00");
        assert_eq!(after(&def, &last, now()), Some(running));
    }

    #[test]
    fn a_week_is_followed_by_a_week() {
        let def = Fixture::normal().def;
        let week = typed(&def, "week", now()).expect("the last week");
        assert_eq!(words(&def, &week), "2026-W46: 11-09 00:00 to 11-16 00:00");
        let next = after(&def, &week, now()).expect("the running one");
        assert_eq!(
            (words(&def, &next).as_str(), after(&def, &next, now())),
            ("2026-W47: 11-16 00:00 to 11-23 00:00", None)
        );
    }

    #[test]
    fn a_plant_without_shifts_has_days() {
        let mut def = Fixture::normal().def;
        def.shifts.clear();
        def.time_zone = TimeZone::get("Europe/Berlin").expect("a zone");
        let summer_ends = at(&def, "2026-10-25T12:00:00Z".parse().expect("a time")).expect("a day");
        assert_eq!(summer_ends.to.duration_since(summer_ends.from), SignedDuration::from_hours(25));
        assert_eq!(before(&def, &summer_ends).map(|day| day.name.to_string()).as_deref(), Some("day 2026-10-24"));
    }

    #[test]
    fn a_free_period_is_called_by_its_dates() {
        let fixture = Fixture::normal();
        let check = |text: &str, expect: &str| {
            let period = typed(&fixture.def, text, now()).expect("a period");
            with_cx(&fixture.snapshot(), |cx| assert_eq!(super::words(cx, &period), expect, "{text}"));
        };
        check("2026-11-18..2026-11-20", "2026-11-18 00:00 – 11-21 00:00 +07");
        check("2026-11-20 22:00-06:00", "2026-11-20 22:00 – 11-21 06:00 +07");
        check("night@2026-11-19", "night 2026-11-19 22:00 – 11-20 06:00 +07");
    }

    #[test]
    fn files_are_named_so_that_a_part_is_no_whole() {
        let def = Fixture::normal().def;
        let check = |text: &str, hours_left: i64, expect: &str| {
            let period = typed(&def, text, now()).expect("a period of the table");
            let until = period.to - SignedDuration::from_hours(hours_left);
            assert_eq!(FORMATS[0].file_name(&def, &period, until), expect);
        };
        check("morning@2026-11-21", 0, "2026-11-21-morning.csv");
        check("morning@2026-11-21", 2, "2026-11-21-morning-until-1200.csv");
        check("2026-11-20 22:00-06:00", 0, "2026-11-20T2200-to-2026-11-21T0600.csv");
        check("2026-11-20 22:00-06:00", 1, "2026-11-20T2200-to-2026-11-21T0500.csv");
    }
}
