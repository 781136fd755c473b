//! Dates in words. In English they are figures, ISO 8601, as everywhere in files; other languages have names of months.

use jiff::civil::{Date, Weekday};

use super::{Calendar, Language, Locale};
use crate::t;

/// Years between the eras.
const BUDDHIST: i16 = 543;

/// `2026-11-21`; `21 พ.ย. 2569` in a language with names of months, its year in the calendar of the terminal.
pub fn date(date: Date) -> String {
    let locale = Locale::current();
    if locale.language == Language::ENGLISH {
        return date.to_string();
    }
    let year = match locale.calendar {
        Calendar::Gregorian => date.year(),
        Calendar::Buddhist => date.year() + BUDDHIST,
    };
    t!("{day} {month} {year}", day = date.day(), month = month(date.month()), year)
}

fn month(month: i8) -> &'static str {
    match month {
        1 => t!("Jan"),
        2 => t!("Feb"),
        3 => t!("Mar"),
        4 => t!("Apr"),
        5 => t!("May"),
        6 => t!("Jun"),
        7 => t!("Jul"),
        8 => t!("Aug"),
        9 => t!("Sep"),
        10 => t!("Oct"),
        11 => t!("Nov"),
        _ => t!("Dec"),
    }
}

/// The short name of a day: `Fri`, `ศ.`.
pub fn weekday(day: Weekday) -> &'static str {
    match day {
        Weekday::Monday => t!("Mon"),
        Weekday::Tuesday => t!("Tue"),
        Weekday::Wednesday => t!("Wed"),
        Weekday::Thursday => t!("Thu"),
        Weekday::Friday => t!("Fri"),
        Weekday::Saturday => t!("Sat"),
        Weekday::Sunday => t!("Sun"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buddhist_year_stands_beside_a_thai_month_only() {
        let day = jiff::civil::date(2026, 11, 21);
        assert_eq!(date(day), "2026-11-21");
        let thai = Language::THAI.locale();
        assert_eq!(thai.within(|| date(day)), "21 พ.ย. 2569");
        let gregorian = Locale { calendar: Calendar::Gregorian, ..thai };
        assert_eq!(gregorian.within(|| (date(day), weekday(day.weekday()))), ("21 พ.ย. 2026".to_owned(), "ส."));
    }
}
