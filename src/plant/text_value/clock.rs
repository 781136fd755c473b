//! The clock of a device as text; what is no date or time is none.

use std::time::Duration;

use jiff::{
    Timestamp, Zoned,
    civil::{Date, DateTime, Time},
    tz::TimeZone,
};

use super::NOW;
use crate::plant::{
    data_type::Clock,
    number::{to_u8, to_u16},
};

/// As a date and time is shown.
const DATE_TIME: &str = "%Y-%m-%d %H:%M:%S";
/// A clock may be set, and read, this many seconds beside the second that is meant.
const TOLERANCE: i64 = 2;

/// The text of words, the most significant first.
pub(super) fn text(clock: Clock, words: &[u16]) -> Option<String> {
    let bytes = || words.first_chunk::<3>().map(|words| words.map(u16::to_be_bytes).concat());
    let of_parts = |parts: Vec<Option<i16>>| {
        let parts = parts.into_iter().collect::<Option<Vec<i16>>>()?;
        let small = |place: usize| i8::try_from(*parts.get(place)?).ok();
        let date = Date::new(*parts.first()?, small(1)?, small(2)?).ok()?;
        let time = Time::new(small(3)?, small(4)?, small(5)?, 0).ok()?;
        Some(DateTime::from_parts(date, time).strftime(DATE_TIME).to_string())
    };
    // Two digits of a year are those of this century.
    let of_bytes = |number: fn(u8) -> Option<i16>| {
        let parts = bytes()?.into_iter().enumerate();
        of_parts(parts.map(|(place, byte)| Some(number(byte)? + if place == 0 { 2_000 } else { 0 })).collect())
    };
    // Midnight at the end of a day has a number of its own.
    let of_time = |hour: u16, minute: u16| {
        let is_time = hour < 24 && minute < 60 || (hour, minute) == (24, 0);
        is_time.then(|| format!("{hour:02}:{minute:02}"))
    };
    let digits = |byte: u16| (byte & 0xF <= 9).then_some(10 * (byte >> 4) + (byte & 0xF));
    match clock {
        Clock::TimeDecimal => of_time(words.first()? / 100, words.first()? % 100),
        Clock::TimeBytes => of_time(words.first()? >> 8, words.first()? & 0xFF),
        Clock::TimeBcd => of_time(digits(words.first()? >> 8)?, digits(words.first()? & 0xFF)?),
        Clock::TimeWords => of_time(*words.first()?, *words.get(1)?),
        Clock::Epoch => {
            let [high, low] = *words.first_chunk::<2>()?;
            Some(Timestamp::from_second(i64::from(high) << 16 | i64::from(low)).ok()?.to_string())
        }
        Clock::Words => of_parts(words.first_chunk::<6>()?.iter().map(|word| i16::try_from(*word).ok()).collect()),
        Clock::Bytes => of_bytes(|byte| (byte < 100).then(|| byte.into())),
        Clock::Bcd => of_bytes(|byte| {
            let (tens, ones) = (i16::from(byte >> 4), i16::from(byte & 0xF));
            (tens <= 9 && ones <= 9).then_some(10 * tens + ones)
        }),
    }
}

/// The words of a text as it is shown, the most significant first; what no word has room for is cut, so that it is shown as another text.
pub(super) fn words(clock: Clock, text: &str) -> Option<Vec<u16>> {
    let parts = || {
        let at = DateTime::strptime(DATE_TIME, text).ok()?;
        let small = [at.month(), at.day(), at.hour(), at.minute(), at.second()].map(i16::from);
        Some([&[at.year()][..], &small].concat())
    };
    let pairs = |bytes: Vec<u8>| bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    // Two digits of a year are those of this century.
    let bytes = |byte: fn(u8) -> u8| {
        let parts = parts()?.into_iter().enumerate();
        Some(pairs(parts.map(|(place, part)| byte(to_u8(part - if place == 0 { 2_000 } else { 0 }))).collect()))
    };
    let time = || {
        let (hour, minute) = text.split_once(':')?;
        Some((hour.parse::<u8>().ok()?, minute.parse::<u8>().ok()?))
    };
    match clock {
        Clock::Epoch => {
            let seconds = u32::try_from(text.parse::<Timestamp>().ok()?.as_second()).ok()?;
            Some(pairs(seconds.to_be_bytes().to_vec()))
        }
        Clock::Words => Some(parts()?.into_iter().map(to_u16).collect()),
        Clock::Bytes => bytes(|byte| byte),
        Clock::Bcd => bytes(bcd),
        Clock::TimeDecimal => time().map(|(hour, minute)| vec![u16::from(hour) * 100 + u16::from(minute)]),
        Clock::TimeBytes => time().map(|(hour, minute)| vec![u16::from_be_bytes([hour, minute])]),
        Clock::TimeBcd => time().map(|(hour, minute)| vec![u16::from_be_bytes([bcd(hour), bcd(minute)])]),
        Clock::TimeWords => time().map(|(hour, minute)| vec![hour.into(), minute.into()]),
    }
}

/// Two decimal digits.
fn bcd(byte: u8) -> u8 {
    ((byte / 10) << 4) | (byte % 10)
}

/// A typed date or time as it is shown. Where a device counts in UTC, one without an offset is of the zone of the plant.
pub(super) fn typed(clock: Clock, typed: &str, now: &Zoned) -> Option<String> {
    let is_now = typed.eq_ignore_ascii_case(NOW);
    match clock {
        Clock::Epoch if is_now => Some(Timestamp::from_second(now.timestamp().as_second()).ok()?.to_string()),
        Clock::Epoch => {
            let local = || typed.parse::<DateTime>().ok()?.to_zoned(now.time_zone().clone()).ok();
            let at = typed.parse::<Timestamp>().ok().or_else(|| Some(local()?.timestamp()))?;
            Some(Timestamp::from_second(at.as_second()).ok()?.to_string())
        }
        // An offset would be lost.
        Clock::Words | Clock::Bytes | Clock::Bcd if typed.parse::<Timestamp>().is_ok() => None,
        Clock::Words | Clock::Bytes | Clock::Bcd => {
            let at = if is_now { now.datetime() } else { typed.parse().ok()? };
            Some(at.strftime(DATE_TIME).to_string())
        }
        Clock::TimeDecimal | Clock::TimeBytes | Clock::TimeBcd | Clock::TimeWords => {
            Some(if is_now { now.strftime("%H:%M").to_string() } else { typed.to_owned() })
        }
    }
}

/// Does a clock show what it was set to this long ago, or what it should show by now, or between both? It never shows less.
pub(super) fn goes_on(clock: Clock, written: &str, shown: &str, ago: Duration) -> bool {
    let Some((written, shown)) = seconds(clock, written).zip(seconds(clock, shown)) else { return false };
    let most = i64::try_from(ago.as_secs()).unwrap_or(0) + TOLERANCE;
    (0..=most).contains(&(shown - written))
}

/// Is it a date and time, so that it goes on? A time of day is a setting: when something begins.
pub(super) fn is_running(clock: Clock) -> bool {
    matches!(clock, Clock::Epoch | Clock::Words | Clock::Bytes | Clock::Bcd)
}

/// Seconds of a date and time, since an instant that is the same for all of one clock.
fn seconds(clock: Clock, shown: &str) -> Option<i64> {
    match clock {
        Clock::Epoch => Some(shown.parse::<Timestamp>().ok()?.as_second()),
        Clock::Words | Clock::Bytes | Clock::Bcd => {
            Some(shown.parse::<DateTime>().ok()?.to_zoned(TimeZone::UTC).ok()?.timestamp().as_second())
        }
        Clock::TimeDecimal | Clock::TimeBytes | Clock::TimeBcd | Clock::TimeWords => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_is_shown_as_date_and_time_or_not_at_all() {
        let check = |clock, words: &[u16], expect: Option<&str>| {
            assert_eq!(text(clock, words).as_deref(), expect, "{clock:?} {words:04X?}");
        };
        check(Clock::Epoch, &[0x6929, 0xD6F1], Some("2025-11-28T17:08:01Z"));
        check(Clock::Words, &[2026, 2, 28, 23, 59, 5], Some("2026-02-28 23:59:05"));
        check(Clock::Words, &[2026, 2, 29, 23, 59, 5], None);
        check(Clock::Bytes, &[0x1A0B, 0x1C11, 0x031D], Some("2026-11-28 17:03:29"));
        check(Clock::Bcd, &[0x2611, 0x2817, 0x0329], Some("2026-11-28 17:03:29"));
        check(Clock::Bcd, &[0x2611, 0x2817, 0x032A], None);
        check(Clock::Bcd, &[0, 0, 0], None);
        check(Clock::Bytes, &[0x1A0B], None);
        check(Clock::TimeDecimal, &[2_359], Some("23:59"));
        check(Clock::TimeDecimal, &[1_260], None);
        check(Clock::TimeDecimal, &[2_400], Some("24:00"));
        check(Clock::TimeBytes, &[0x173B], Some("23:59"));
        check(Clock::TimeBcd, &[0x2359], Some("23:59"));
        check(Clock::TimeBcd, &[0x235A], None);
        check(Clock::TimeWords, &[7, 5], Some("07:05"));
        check(Clock::TimeWords, &[24, 1], None);
    }
}
