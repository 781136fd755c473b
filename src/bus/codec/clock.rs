//! The clock of a device as text; what is no date or time is none.

use jiff::{
    Timestamp,
    civil::{Date, DateTime, Time},
};

use crate::plant::data_type::Clock;

/// The text of words, the most significant first.
pub(super) fn text(clock: Clock, words: &[u16]) -> Option<String> {
    let bytes = || words.first_chunk::<3>().map(|words| words.map(u16::to_be_bytes).concat());
    let of_parts = |parts: Vec<Option<i16>>| {
        let parts = parts.into_iter().collect::<Option<Vec<i16>>>()?;
        let small = |place: usize| i8::try_from(*parts.get(place)?).ok();
        let date = Date::new(*parts.first()?, small(1)?, small(2)?).ok()?;
        let time = Time::new(small(3)?, small(4)?, small(5)?, 0).ok()?;
        Some(DateTime::from_parts(date, time).strftime("%Y-%m-%d %H:%M:%S").to_string())
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
