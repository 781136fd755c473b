//! Numbers as they are typed.

use super::*;
use crate::{
    plant::{
        bad_span::BadSpan,
        sample::{Cause, Sample},
        tag::Bound,
    },
    ui::fixture::{Fixture, now, with_cx},
};

fn checked(fixture: &Fixture, text: &str) -> Result<f64, String> {
    with_cx(&fixture.snapshot(), |cx| entry::check(cx.snapshot, fixture.tag("TIC-1.SV"), text)).map(Exact::near)
}

#[test]
fn a_wrong_number_is_reported_before_it_is_sent() {
    let fixture = Fixture::normal();
    let check = |text: &str, expect: Result<f64, &str>| {
        assert_eq!(checked(&fixture, text), expect.map_err(str::to_owned), "{text}")
    };
    check("70", Ok(70.0));
    check("70.5", Ok(70.5));
    check("3,5", Ok(3.5));
    check("=3,5 ", Ok(3.5));
    check("70.50", Err("at most 1 decimal"));
    check("", Err("enter a number"));
    for text in ["7-0", "7OO", "1e1", "1e5", "7 0", "1,0.5", "1.0.5", "inf", "NaN", "-", "=", "+", ".", "0x10", "๗"] {
        check(text, Err(&format!("\"{text}\" is not a number")));
    }
    check("70.55", Err("at most 1 decimal"));
    check("1,000", Err("\"1,000\" may be thousands: enter it with a point, or without a comma"));
    check("0,125", Err("at most 1 decimal"));
    check("1000", Err("outside range 0.0 … 120.0 °C"));
}

#[test]
fn a_sign_makes_a_number_relative_to_the_present_value() {
    let mut fixture = Fixture::normal();
    for (text, value) in [("+5", 75.0), ("-5", 65.0), ("+0,5", 70.5), ("-0", 70.0), ("=5", 5.0)] {
        assert_eq!(checked(&fixture, text), Ok(value), "{text}");
    }
    assert_eq!(checked(&fixture, "+60"), Err("outside range 0.0 … 120.0 °C".to_owned()), "70 + 60");
    assert_eq!(checked(&fixture, "=-5"), Err("outside range 0.0 … 120.0 °C".to_owned()), "an absolute number");
    let sv = fixture.tag("TIC-1.SV");
    with_cx(&fixture.snapshot(), |cx| {
        assert_eq!(entry::relative_text(cx.snapshot, sv, "+5").as_deref(), Some("70.0 → 75.0"));
        assert_eq!(
            (entry::relative_text(cx.snapshot, sv, "5"), entry::relative_text(cx.snapshot, sv, "+")),
            (None, None)
        );
    });
    fixture.samples[sv.index()] = Sample::bad(Cause::Timeout, now());
    assert_eq!(
        checked(&fixture, "+5"),
        Err("the current value is unknown: enter the new value without a sign".to_owned())
    );
    assert_eq!(checked(&fixture, "75"), Ok(75.0));
}

#[test]
fn rounding_beyond_a_limit_is_refused_before_it_is_sent() {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    let def = &mut fixture.def.tags[sv.index()];
    (def.scale, def.max) = (0.5, Some(Bound::Fixed(99.8.into())));
    let why = "the device would store 100, outside range 0.0 … 99.8 °C";
    assert_eq!(checked(&fixture, "99.8"), Err(why.to_owned()));
    assert_eq!(checked(&fixture, "99.7"), Ok(99.7));
}

#[test]
fn a_large_step_or_a_set_value_at_an_alarm_limit_is_asked_again() {
    let fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    let asked = |value: f64| {
        let value = value.into();
        with_cx(&fixture.snapshot(), |cx| (needs_confirmation(cx, sv, value), entry::warnings(cx.snapshot, sv, value)))
    };
    assert_eq!(asked(65.0), (false, Vec::new()));
    let (again, why) = asked(5.0);
    assert!(again && why[0].starts_with("! a change of 65.0 °C, 54 % of the range"), "{why:?}");
    let (again, why) = asked(72.0);
    assert!(again && why[0].contains("at the alarm limit of TIC-1.PV temperature high (72.0 °C)"), "{why:?}");
    let (_, why) = asked(73.0);
    assert!(why[0].contains("beyond the alarm limit of TIC-1.PV"), "{why:?}");
}

#[test]
fn a_number_that_means_no_value_is_asked_again() {
    let mut fixture = Fixture::normal();
    let sv = fixture.tag("TIC-1.SV");
    let raw = Exact::from(650.0);
    fixture.def.tags[sv.index()].bad_if = vec![BadSpan { first: raw, last: raw }];
    let asked = |value: f64| {
        with_cx(&fixture.snapshot(), |cx| {
            (needs_confirmation(cx, sv, value.into()), entry::warnings(cx.snapshot, sv, value.into()))
        })
    };
    assert_eq!(asked(64.9), (false, Vec::new()));
    assert_eq!(asked(65.0), (true, vec!["! for the device this number means no value".to_owned()]));
}
