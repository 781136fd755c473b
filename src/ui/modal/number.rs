//! A typed number: what it means, whether it can be written, and why to ask again before it is.

use crate::t;
use crate::{
    access::control::reauthentication,
    plant::{
        command::CommandKind,
        def::{Condition, Level, Subject, TagId},
        exact::Exact,
        number::digits,
        scale,
    },
    text::translate,
    ui::{ViewContext, modal::confirm::subject},
};

/// A step over this share of the range is asked again: more than an operator usually changes at once.
const STEP_MAX: f64 = 0.2;

/// Can this character be in a number?
pub fn is_numeric(c: char) -> bool {
    c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | ',' | '=')
}

/// The number that is meant if it can be written; else what is wrong with it. Courtesy: the station checks again.
pub fn check(cx: &ViewContext, tag: TagId, text: &str) -> Result<Exact, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err(t!("enter a number").to_owned());
    }
    let (number, typed) = parse(text).ok_or_else(|| t!("\"{text}\" is not a number", text))?;
    // Trailing zeros count as decimals: a tag without decimals refuses `1,000` and `1.000`, which mean a thousand to their author.
    let decimals = usize::from(cx.snapshot.decimals[tag.index()]);
    if typed > decimals {
        return Err(match decimals {
            0 => t!("whole numbers only").to_owned(),
            1 => t!("at most 1 decimal").to_owned(),
            n => t!("at most {n} decimals", n),
        });
    }
    let value = match number {
        Number::Absolute(value) => value,
        Number::Step(by) => {
            stepped(cx, tag, by).ok_or(t!("the current value is unknown: enter the new value without a sign"))?
        }
    };
    let Some((min, max)) = cx.snapshot.bounds(tag) else { return Ok(value) };
    let inside = |value| scale::is_inside(Some(min), Some(max), value);
    let rounded = cx.snapshot.rounded_to_device(tag, value);
    match (inside(value), inside(rounded)) {
        (false, _) => Err(t!("outside {range_text}", range_text = range_text(cx, tag))),
        (true, false) => Err(t!(
            "the device would store {plain}, outside {range_text}",
            plain = plain(rounded),
            range_text = range_text(cx, tag)
        )),
        (true, true) => Ok(value),
    }
}

/// `70.0 → 75.0`, while a number with a sign is typed.
pub fn relative_text(cx: &ViewContext, tag: TagId, text: &str) -> Option<String> {
    let (Number::Step(by), _) = parse(text.trim())? else { return None };
    let text = |value| cx.snapshot.format(tag, value);
    Some(format!("{} → {}", text(cx.snapshot.sample(tag).good_exact()?), text(stepped(cx, tag, by)?)))
}

/// How to type a change.
pub fn help(cx: &ViewContext, tag: TagId) -> String {
    match cx.snapshot.range(tag) {
        Some((min, _)) if min < 0.0 => t!("+5 adds 5, -5 subtracts 5, =-5 sets -5").to_owned(),
        Some(_) | None => t!("+5 adds 5, -5 subtracts 5").to_owned(),
    }
}

/// Is a number for this tag asked again in a window of its own? A tag with reauthentication is.
pub fn needs_confirmation(cx: &ViewContext, tag: TagId, value: Exact) -> bool {
    cx.def().tag(tag).confirm.is_some()
        || reauthentication::required(cx.def(), &CommandKind::Write { tag, value }).is_some()
        || rounded_text(cx, tag, value).is_some()
        || !warnings(cx, tag, value).is_empty()
}

/// `72.3 → the resolution of the device is 0.5: 72.5`; `None` where it holds what was typed.
pub fn rounded_text(cx: &ViewContext, tag: TagId, value: Exact) -> Option<String> {
    let rounded = cx.snapshot.rounded_to_device(tag, value);
    // A single-precision register is as good as exact.
    let apart = (rounded - value).near().abs();
    let same = if value.rest().is_some() { rounded == value } else { apart <= 1e-6 * value.near().abs().max(1.0) };
    let step = plain(cx.snapshot.step(tag).into());
    (!same).then(|| {
        t!(
            "{format} → the resolution of the device is {step}: {plain}",
            format = cx.snapshot.format(tag, value),
            step,
            plain = plain(rounded)
        )
    })
}

/// Why a number that is allowed may still not be what its author meant.
pub fn warnings(cx: &ViewContext, tag: TagId, value: Exact) -> Vec<String> {
    let text =
        |value: Exact| format!("{} {}", cx.snapshot.format(tag, value), cx.snapshot.unit(tag)).trim_end().to_owned();
    let step = cx.snapshot.sample(tag).exact().map(|now| (value - now).abs());
    let share = step.zip(cx.snapshot.range(tag)).map(|(step, (min, max))| (step, step.near() / (max - min)));
    let large = share.filter(|(_, share)| STEP_MAX < *share);
    let large = large.map(|(step, share)| {
        t!("! a change of {text}, {share} % of the range", text = text(step), share = format!("{:.0}", share * 100.0))
    });
    let faceplate = cx.def().device(cx.def().tag(tag).device).faceplate.as_ref();
    let process = faceplate.filter(|faceplate| faceplate.sv == tag).map(|faceplate| faceplate.pv);
    let alarms = cx.def().alarms.iter().filter(|alarm| alarm.subject == Subject::Tag(process.unwrap_or(tag)));
    let limits = alarms.filter_map(|alarm| {
        let Condition::Limit { level, limit, .. } = alarm.condition else { return None };
        let beyond = match level {
            Level::High | Level::HighHigh => (value - limit.into()).near(),
            Level::Low | Level::LowLow => (Exact::from(limit) - value).near(),
        };
        let place = if beyond > 0.0 { t!("beyond") } else { t!("at") };
        (beyond >= 0.0).then(|| {
            t!(
                "! {place} the alarm limit of {subject} {message} ({text})",
                place,
                subject = subject(cx, alarm.id),
                message = translate(&alarm.message),
                text = text(limit.into())
            )
        })
    });
    large.into_iter().chain(limits).collect()
}

/// The permitted range in words.
pub fn range_text(cx: &ViewContext, tag: TagId) -> String {
    let labels = &cx.def().tag(tag).enum_labels;
    if !labels.is_empty() {
        return t!("range one of {count}", count = labels.len());
    }
    match cx.snapshot.bounds(tag) {
        Some((min, max)) => {
            let unit = cx.snapshot.unit(tag);
            t!(
                "range {format} … {format2} {unit}",
                format = cx.snapshot.format(tag, min),
                format2 = cx.snapshot.format(tag, max),
                unit
            )
            .trim_end()
            .to_owned()
        }
        None => t!("range unknown").to_owned(),
    }
}

/// The present value and a step from it.
fn stepped(cx: &ViewContext, tag: TagId, by: Exact) -> Option<Exact> {
    let now = cx.snapshot.sample(tag).good_exact()?;
    // As many decimals as are shown: 0.1 + 0.2 is 0.3.
    digits(now + by, Some(cx.snapshot.decimals[tag.index()])).parse().ok()
}

/// With as many decimals as it has.
fn plain(value: Exact) -> String {
    value.rest().map_or_else(|| format!("{}", (value.near() * 1e9).round() / 1e9), |_| value.to_string())
}

/// What was typed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    /// A new value.
    Absolute(Exact),
    /// A change of the present one.
    Step(Exact),
}

/// A number and its decimals: digits and one decimal mark, a point or a comma. A sign before it makes it a step; `=` makes
/// it a value all the same. No exponent, no `inf`.
fn parse(text: &str) -> Option<(Number, usize)> {
    let (whole, text) = text.strip_prefix('=').map_or((false, text), |rest| (true, rest));
    let unsigned = text.strip_prefix(['-', '+']);
    let point = text.replacen(',', ".", 1);
    let digits = unsigned.unwrap_or(text).replacen(',', ".", 1);
    let (before, after) = digits.split_once('.').unwrap_or((&digits, ""));
    let numeric = |text: &str| text.bytes().all(|c| c.is_ascii_digit());
    if !numeric(before) || !numeric(after) || before.is_empty() && after.is_empty() {
        return None;
    }
    let value = point.parse().ok()?;
    let number = if unsigned.is_some() && !whole { Number::Step(value) } else { Number::Absolute(value) };
    Some((number, after.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        plant::{
            sample::{Cause, Sample},
            tag::Bound,
        },
        ui::fixture::{Fixture, now, with_cx},
    };

    fn checked(fixture: &Fixture, text: &str) -> Result<f64, String> {
        with_cx(&fixture.snapshot(), |cx| check(cx, fixture.tag("TIC-1.SV"), text)).map(Exact::near)
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
        for text in ["7-0", "7OO", "1e1", "1e5", "7 0", "1,0.5", "1.0.5", "inf", "NaN", "-", "=", "+", ".", "0x10", "๗"]
        {
            check(text, Err(&format!("\"{text}\" is not a number")));
        }
        check("70.55", Err("at most 1 decimal"));
        check("1,000", Err("at most 1 decimal"));
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
            assert_eq!(relative_text(cx, sv, "+5").as_deref(), Some("70.0 → 75.0"));
            assert_eq!((relative_text(cx, sv, "5"), relative_text(cx, sv, "+")), (None, None));
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
            with_cx(&fixture.snapshot(), |cx| (needs_confirmation(cx, sv, value), warnings(cx, sv, value)))
        };
        assert_eq!(asked(65.0), (false, Vec::new()));
        let (again, why) = asked(5.0);
        assert!(again && why[0].starts_with("! a change of 65.0 °C, 54 % of the range"), "{why:?}");
        let (again, why) = asked(72.0);
        assert!(again && why[0].contains("at the alarm limit of TIC-1.PV temperature high (72.0 °C)"), "{why:?}");
        let (_, why) = asked(73.0);
        assert!(why[0].contains("beyond the alarm limit of TIC-1.PV"), "{why:?}");
    }
}
