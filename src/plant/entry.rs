//! A typed number: what it means, whether it can be written, and why to ask again before it is.

use super::{
    Snapshot,
    alarm::manager::subject_name,
    def::{Condition, Level, Subject, TagId},
    exact::{Exact, digits},
    number::{to_i64, to_usize},
    scale,
};
use crate::{t, text::translate};

/// A step over this share of the range is asked again: more than an operator usually changes at once.
const STEP_MAX: f64 = 0.2;

/// Can this character be in a number?
pub fn is_numeric(c: char) -> bool {
    c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | ',' | '=')
}

/// The number that is meant if it can be written; else what is wrong with it. Courtesy: the station checks again.
pub fn check(snapshot: &Snapshot, tag: TagId, text: &str) -> Result<Exact, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err(t!("enter a number").to_owned());
    }
    let (number, typed) = parse(text).ok_or_else(|| t!("\"{text}\" is not a number", text))?;
    if is_of_thousands(text) {
        return Err(t!("\"{text}\" may be thousands: enter it with a point, or without a comma", text));
    }
    // Trailing zeros count as decimals: a tag without decimals refuses `1,000` and `1.000`, which mean a thousand to their author.
    check_decimals(typed, snapshot.decimals[tag.index()])?;
    let value = match number {
        Number::Absolute(value) => value,
        Number::Step(by) => {
            stepped(snapshot, tag, by).ok_or(t!("the current value is unknown: enter the new value without a sign"))?
        }
    };
    let Some((min, max)) = snapshot.bounds(tag) else { return Ok(value) };
    let inside = |value| scale::is_inside(Some(min), Some(max), value);
    let rounded = snapshot.rounded_to_device(tag, value);
    match (inside(value), inside(rounded)) {
        (false, _) => Err(t!("outside {range_text}", range_text = range_text(snapshot, tag))),
        (true, false) => Err(t!(
            "the device would store {plain}, outside {range_text}",
            plain = plain(rounded),
            range_text = range_text(snapshot, tag)
        )),
        (true, true) => Ok(value),
    }
}

/// `1,500`: three digits behind a comma, and not 0 before it.
fn is_of_thousands(text: &str) -> bool {
    let Some((first, last)) = text.trim_start_matches(['=', '+', '-']).split_once(',') else { return false };
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    is_digits(first) && is_digits(last) && last.len() == 3 && first.len() <= 3 && !first.starts_with('0')
}

/// Has a number this many decimals at most as its tag?
pub fn check_decimals(written: usize, of_tag: u8) -> Result<(), String> {
    match of_tag {
        most if written <= usize::from(most) => Ok(()),
        0 => Err(t!("whole numbers only").to_owned()),
        1 => Err(t!("at most 1 decimal").to_owned()),
        n => Err(t!("at most {n} decimals", n)),
    }
}

/// The decimals of a number that was computed or read from a file: zeros at its end say nothing there.
pub fn decimals_of(value: Exact) -> usize {
    let text = digits(value, None);
    let (text, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let after = text.split_once('.').map_or(0, |(_, after)| after.len());
    to_usize(to_i64(after) - i64::from(exponent))
}

/// `70.0 → 75.0`, while a number with a sign is typed.
pub fn relative_text(snapshot: &Snapshot, tag: TagId, text: &str) -> Option<String> {
    let (Number::Step(by), _) = parse(text.trim())? else { return None };
    let text = |value| snapshot.format(tag, value);
    Some(format!("{} → {}", text(snapshot.sample(tag).good_exact()?), text(stepped(snapshot, tag, by)?)))
}

/// How to type a change.
pub fn help(snapshot: &Snapshot, tag: TagId) -> String {
    match snapshot.range(tag) {
        Some((min, _)) if min < 0.0 => t!("+5 adds 5, -5 subtracts 5, =-5 sets -5").to_owned(),
        Some(_) | None => t!("+5 adds 5, -5 subtracts 5").to_owned(),
    }
}

/// Is a number for this tag asked again before it is sent?
pub fn needs_confirmation(snapshot: &Snapshot, tag: TagId, value: Exact) -> bool {
    snapshot.def.tag(tag).confirm.is_some()
        || rounded_text(snapshot, tag, value).is_some()
        || !warnings(snapshot, tag, value).is_empty()
}

/// `72.3 → the resolution of the device is 0.5: 72.5`; `None` where it holds what was typed.
pub fn rounded_text(snapshot: &Snapshot, tag: TagId, value: Exact) -> Option<String> {
    let rounded = snapshot.rounded_to_device(tag, value);
    let step = plain(snapshot.step(tag).into());
    (!scale::is_held(snapshot.def.tag(tag), value, rounded)).then(|| {
        t!(
            "{format} → the resolution of the device is {step}: {plain}",
            format = snapshot.format(tag, value),
            step,
            plain = plain(rounded)
        )
    })
}

/// The number to send once [`rounded_text`] has been read: as the device will hold it.
pub fn as_confirmed(snapshot: &Snapshot, tag: TagId, value: Exact) -> Exact {
    let rounded = snapshot.rounded_to_device(tag, value);
    if scale::is_held(snapshot.def.tag(tag), value, rounded) { value } else { rounded }
}

/// Why a number that is allowed may still not be what its author meant.
pub fn warnings(snapshot: &Snapshot, tag: TagId, value: Exact) -> Vec<String> {
    let text = |value: Exact| format!("{} {}", snapshot.format(tag, value), snapshot.unit(tag)).trim_end().to_owned();
    let step = snapshot.sample(tag).exact().map(|now| (value - now).abs());
    let share = step.zip(snapshot.range(tag)).map(|(step, (min, max))| (step, step.near() / (max - min)));
    let large = share.filter(|(_, share)| STEP_MAX < *share);
    let large = large.map(|(step, share)| {
        t!("! a change of {text}, {share} % of the range", text = text(step), share = format!("{:.0}", share * 100.0))
    });
    let faceplate = snapshot.def.device(snapshot.def.tag(tag).device).faceplate.as_ref();
    let process = faceplate.filter(|faceplate| faceplate.sv == tag).map(|faceplate| faceplate.pv);
    let alarms = snapshot.def.alarms.iter().filter(|alarm| alarm.subject == Subject::Tag(process.unwrap_or(tag)));
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
                subject = subject_name(&snapshot.def, alarm.subject),
                message = translate(&alarm.message),
                text = text(limit.into())
            )
        })
    });
    let def = snapshot.def.tag(tag);
    let raw = scale::to_raw(def, value, snapshot.scaling_decimals(tag)).filter(|raw| def.is_bad(*raw));
    let bad = raw.map(|_| t!("! for the device this number means no value").to_owned());
    bad.into_iter().chain(large).chain(limits).collect()
}

/// The permitted range in words.
pub fn range_text(snapshot: &Snapshot, tag: TagId) -> String {
    let labels = &snapshot.def.tag(tag).enum_labels;
    if !labels.is_empty() {
        return t!("range one of {count}", count = labels.len());
    }
    match snapshot.bounds(tag) {
        Some((min, max)) => {
            let unit = snapshot.unit(tag);
            t!(
                "range {format} … {format2} {unit}",
                format = snapshot.format(tag, min),
                format2 = snapshot.format(tag, max),
                unit
            )
            .trim_end()
            .to_owned()
        }
        None => t!("range unknown").to_owned(),
    }
}

/// The present value and a step from it.
fn stepped(snapshot: &Snapshot, tag: TagId, by: Exact) -> Option<Exact> {
    let now = snapshot.sample(tag).good_exact()?;
    // As many decimals as are shown: 0.1 + 0.2 is 0.3.
    digits(now + by, Some(snapshot.decimals[tag.index()])).parse().ok()
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
