//! Texts, dates, times and addresses, there and back.

use super::*;
use jiff::{Timestamp, tz::TimeZone};
use proptest::prelude::*;

/// 2026-11-30 14:05:07 in Bangkok.
fn now() -> Zoned {
    "2026-11-30T07:05:07.8Z"
        .parse::<Timestamp>()
        .expect("a time")
        .to_zoned(TimeZone::get("Asia/Bangkok").expect("a zone"))
}

fn clock(clock: Clock) -> DataType {
    DataType::Clock(clock)
}

#[test]
fn what_is_typed_is_held_as_the_device_shows_it() {
    let check = |kind: DataType, typed: &str, expect: Option<&str>| {
        assert_eq!(as_held(kind, typed, &now()).ok().as_deref(), expect, "{kind} {typed:?}");
    };
    check(DataType::Text(6), "Line 3", Some("Line 3"));
    check(DataType::Text(6), "", Some(""));
    for text in ["Line 33", "Line ", "a\nb", "·"] {
        check(DataType::Text(6), text, None);
    }
    check(DataType::Chars(3), "AB", Some("AB"));
    check(DataType::Chars(3), "ABCD", None);
    for kind in [Clock::Words, Clock::Bytes, Clock::Bcd].map(clock) {
        check(kind, "now", Some("2026-11-30 14:05:07"));
        check(kind, " 2026-02-28 23:59:05 ", Some("2026-02-28 23:59:05"));
        check(kind, "2026-02-28T23:59", Some("2026-02-28 23:59:00"));
        check(kind, "2026-02-29 10:00", None);
        check(kind, "2026-02-28T23:59:00+09:00", None);
        check(kind, "14:05", None);
    }
    check(clock(Clock::Words), "1999-12-31 23:59:59", Some("1999-12-31 23:59:59"));
    for kind in [Clock::Bytes, Clock::Bcd].map(clock) {
        check(kind, "1999-12-31 23:59:59", None);
        check(kind, "2099-12-31 23:59:59", Some("2099-12-31 23:59:59"));
        check(kind, "2100-01-01 00:00:00", None);
    }
    check(clock(Clock::Epoch), "now", Some("2026-11-30T07:05:07Z"));
    check(clock(Clock::Epoch), "2026-11-30 14:05:07", Some("2026-11-30T07:05:07Z"));
    check(clock(Clock::Epoch), "2026-11-30T14:05:07+09:00", Some("2026-11-30T05:05:07Z"));
    check(clock(Clock::Epoch), "1969-12-31T23:59:59Z", None);
    check(clock(Clock::Epoch), "2106-02-07T06:28:16Z", None);
    for kind in [Clock::TimeDecimal, Clock::TimeBytes, Clock::TimeBcd, Clock::TimeWords].map(clock) {
        check(kind, "NOW", Some("14:05"));
        check(kind, "07:30", Some("07:30"));
        check(kind, "24:00", Some("24:00"));
        for text in ["24:01", "7:30", "12:60", "1230", "-1:30"] {
            check(kind, text, None);
        }
    }
    check(DataType::NetworkAddress(NetworkAddress::Ipv4), "192.168.0.7", Some("192.168.0.7"));
    check(DataType::NetworkAddress(NetworkAddress::Ipv4), "192.168.0.256", None);
    let local = "fe80:0000:0000:0000:0000:0000:0000:0007";
    check(DataType::NetworkAddress(NetworkAddress::Ipv6), "fe80::7", Some(local));
    check(DataType::NetworkAddress(NetworkAddress::Eui48), "00-1b-44-11-3a-b7", Some("00:1B:44:11:3A:B7"));
    check(DataType::NetworkAddress(NetworkAddress::Eui48), "00:1B:44:11:3A", None);
    check(DataType::Version(1), "1.0.A.2", None);
    check(DataType::U16, "5", None);
}

#[test]
fn what_cannot_be_printed_is_shown_as_the_device_holds_it() {
    let check = |kind: DataType, words: &[u16], expect: &str| {
        assert_eq!(decode(kind, words).as_deref(), Some(expect), "{kind} {words:04X?}");
    };
    check(DataType::Chars(3), &[0x2744, 0xD4DF, 0x2E89], "2744 D4DF 2E89");
    check(DataType::Chars(3), &[0x4142, 0x0005, 0x0020], "4142 05");
    check(DataType::Chars(3), &[0x0041, 0x4142, 0x0043], "A·C");
    check(DataType::Text(3), &[0xE900, 0x0520], "E9 00 05");
    check(DataType::Text(4), &[0x4101, 0x0000], "A·");
}

#[test]
fn a_clock_holds_what_was_written_while_it_goes_on() {
    let check = |kind, written: &str, shown: &str, ago, expect| {
        let held = is_held(DataType::Clock(kind), written, shown, Duration::from_secs(ago));
        assert_eq!(held, expect, "{kind:?} {written} {shown} {ago} s");
    };
    for (written, shown, ago, expect) in [
        ("2026-11-30 14:05:07", "2026-11-30 14:05:07", 0, true),
        ("2026-11-30 14:05:07", "2026-11-30 14:05:09", 0, true),
        ("2026-11-30 14:05:07", "2026-11-30 14:05:10", 0, false),
        ("2026-11-30 14:05:07", "2026-11-30 14:05:37", 30, true),
        ("2026-11-30 14:05:07", "2026-11-30 14:05:06", 30, false),
        ("2026-12-31 23:59:59", "2027-01-01 00:00:01", 1, true),
    ] {
        check(Clock::Words, written, shown, ago, expect);
        let [written, shown] = [written, shown].map(|text| format!("{}Z", text.replace(' ', "T")));
        check(Clock::Epoch, &written, &shown, ago, expect);
    }
    // When something begins is a setting, which is held or not.
    check(Clock::TimeBcd, "07:30", "07:30", 30, true);
    check(Clock::TimeBcd, "07:30", "07:31", 90, false);
    assert!(!is_held(DataType::Text(4), "AB", "AC", Duration::from_secs(30)));
}

proptest! {
    #[test]
    fn what_can_be_encoded_is_shown_as_it_was(seconds in 0i64..4_102_444_800, text in "[ -~°ก-๙:.]{0,12}") {
        let at = Timestamp::from_second(seconds).expect("a time");
        let local = at.to_zoned(TimeZone::UTC);
        let shown = [local.strftime("%Y-%m-%d %H:%M:%S").to_string(), at.to_string(), local.strftime("%H:%M").to_string(), text];
        let kinds = Clock::ALL.map(DataType::Clock);
        let addresses = NetworkAddress::ALL.iter().copied().map(DataType::NetworkAddress);
        let texts = [DataType::Text(8), DataType::TextToNul(8), DataType::Chars(8)];
        for kind in kinds.into_iter().chain(addresses).chain(texts) {
            let held: Vec<&String> = shown.iter().filter(|text| encode(kind, text).is_some()).collect();
            for text in &held {
                let words = encode(kind, text).expect("it was held");
                prop_assert_eq!(words.len(), usize::from(kind.words()));
                prop_assert_eq!(decode(kind, &words), Some((*text).clone()), "{}", kind);
            }
            let is_clock = matches!(kind, DataType::Clock(Clock::Words));
            prop_assert!(!is_clock || held.len() == 1, "{} holds {:?}", kind, held);
        }
    }
}
