//! Reads an `[[expect]]`: what is expected, when, and its label.

use std::time::Duration;

use super::{
    super::{Expect, Expectation, judge::clock},
    ExpectTable,
    names::{alarm, tag, value},
};
use crate::{
    plant::{PlantDef, def::TagId, record::AlarmEvent},
    profile::{
        diagnostic::Problems,
        reader::{At, text},
    },
};

/// What is expected, with its words and its time.
pub(super) fn expectation(
    table: &ExpectTable,
    duration: Duration,
    def: &PlantDef,
    problems: &mut Problems,
) -> Option<Expect> {
    let (expectation, words) = expected(table, def, problems)?;
    let from = table.after.map_or(Duration::ZERO, |after| after.value);
    let until = table.within.map_or(duration, |within| from + within.value);
    if let Some(late) = table.within.or(table.after).filter(|_| until > duration || from > duration) {
        let problem = problems.add(late.at, format!("the scenario is over at {}", clock(duration)));
        problem.label(format!("this ends at {}", clock(until.max(from))));
    }
    let given = text(&table.what);
    let window = match (table.after, table.within) {
        (None, None) => String::new(),
        (_, Some(_)) => format!(" by {}", clock(until)),
        (Some(_), None) => format!(" after {}", clock(from)),
    };
    let text = if given.is_empty() { format!("{words}{window}") } else { format!("{given}{window}") };
    let points = table.points.map_or(10, |points| u32::from(points.value));
    Some(Expect { text, points, from, until, expectation })
}

/// What is expected, with words for it.
fn expected(table: &ExpectTable, def: &PlantDef, problems: &mut Problems) -> Option<(Expectation, String)> {
    let keys = [
        ("alarm", &table.alarm),
        ("written", &table.written),
        ("not_good", &table.not_good),
        ("good", &table.good),
        ("process", &table.process),
        ("displayed_within", &table.displayed_within),
    ];
    let mut found = keys.iter().filter_map(|(key, name)| name.as_ref().map(|name| (*key, name)));
    let Some((key, name)) = found.next() else {
        let words = keys.map(|(key, _)| format!("`{key}`")).join(", ");
        problems.add(table.at, "what is expected?").label(format!("expected one of {words}"));
        return None;
    };
    if let Some((second, name)) = found.next() {
        let problem = problems.add(name.at, format!("`{key}` and `{second}` are two expectations"));
        problem.label("needs an [[expect]] of its own");
        return None;
    }
    if key == "alarm" {
        let alarm = alarm(name, &table.message, def, problems)?;
        let words = &def.alarm(alarm).message;
        if table.never.is_some_and(|never| never.value) {
            return Some((Expectation::NoAlarm(alarm), format!("no alarm {} {words}", name.value)));
        }
        let step = table.event.map_or(AlarmEvent::Raised, |event| event.value);
        return Some((Expectation::Alarm(alarm, step), format!("alarm {} {words} {}", name.value, step.word())));
    }
    let tag = tag(name, def, problems)?;
    let unit = &def.tag(tag).unit;
    match key {
        "written" => {
            let value = value(&table.value, name, tag, def, problems)?;
            let shown = def.tag(tag).label_of(value).map_or_else(|| format!("{value} {unit}"), str::to_owned);
            Some((Expectation::Written(tag, value), format!("{} set to {}", name.value, shown.trim_end())))
        }
        "not_good" => Some((Expectation::NotGood(tag), format!("{} shown as not good", name.value))),
        "good" => Some((Expectation::Good(tag), format!("{} shown as good", name.value))),
        "displayed_within" => {
            if let Some(tolerance) = table.tolerance.filter(|tolerance| tolerance.value < 0.0) {
                problems
                    .add(tolerance.at, format!("found {}, expected 0 or more", tolerance.value))
                    .label("tolerance of the comparison");
                return None;
            }
            let tolerance = table.tolerance.map_or(0.0, |tolerance| tolerance.value);
            Some((
                Expectation::True(tag, tolerance),
                format!("{} never shown wrong by more than {tolerance} {unit}", name.value),
            ))
        }
        _ => within(table, name, tag, def, problems),
    }
}

fn within(
    table: &ExpectTable,
    name: &At<String>,
    tag: TagId,
    def: &PlantDef,
    problems: &mut Problems,
) -> Option<(Expectation, String)> {
    let unit = &def.tag(tag).unit;
    let (low, high) = (table.never_below.map(|low| low.value), table.never_above.map(|high| high.value));
    let words = match (low, high) {
        (None, None) => {
            problems.add(name.at, "which bounds?").label("expected `never_above` or `never_below`");
            return None;
        }
        (None, Some(high)) => format!("really never above {high} {unit}"),
        (Some(low), None) => format!("really never below {low} {unit}"),
        (Some(low), Some(high)) => format!("really between {low} and {high} {unit}"),
    };
    let expectation =
        Expectation::Within { tag, low: low.unwrap_or(f64::NEG_INFINITY), high: high.unwrap_or(f64::INFINITY) };
    Some((expectation, format!("{} {words}", name.value)))
}
