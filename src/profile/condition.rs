//! The condition of an alarm: exactly one, on what it fits, with what it needs beside it.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    interlock::check_bit,
    names::{Defs, number_of},
    reader::{At, OptionalKey},
    schema::AlarmTable,
    tag::range_of,
};
use crate::plant::{
    def::{Condition, Level, Subject},
    exact::Exact,
    tag::{Bound, TagDef},
};

/// Most changes that can be counted.
const CHANGES_MAX: u32 = 100;

/// What an alarm watches, and for what.
pub(super) fn subject(table: &AlarmTable, defs: &Defs, problems: &mut Problems) -> Option<(Subject, Condition)> {
    if let Some(overloaded) = table.overloaded.filter(|overloaded| table.line.is_none() || !overloaded.value) {
        problems.add(overloaded.at, "only a `line` can be overloaded").label("expected `true`, beside `line`");
    }
    if let Some(slower) = table.slower_than_stated.filter(|slower| table.device.is_none() || !slower.value) {
        problems.add(slower.at, "only a `device` can be slower than stated").label("expected `true`, beside `device`");
    }
    match (&table.tag, &table.device, &table.line) {
        (Some(tag), None, None) => {
            let tag = defs.tag(tag, problems)?;
            if let Some(ne107) = table.ne107 {
                problems.add(ne107.at, "a tag has no `ne107`").label("expected a device");
            }
            Some((Subject::Tag(tag.id), condition(table, tag, defs, problems)?))
        }
        (None, Some(device), None) => {
            let id = defs.device(device, problems)?;
            let means = "not responding, with `slower_than_stated` slower than its profile, with `ne107` a signal";
            no_condition(table, "device", means, problems);
            Some((Subject::Device(id), of_device(table)))
        }
        (None, None, Some(line)) => {
            let id = defs.line(line, problems)?;
            no_condition(table, "line", "not connected, or with `overloaded` overloaded", problems);
            let overloaded = table.overloaded.value_or(false);
            let condition = if overloaded { Condition::Overloaded } else { Condition::NotConnected };
            Some((Subject::Line(id), condition))
        }
        (None, None, None) => {
            problems.add(table.at, "an alarm needs `tag`, `device` or `line`").label("here");
            None
        }
        _ => {
            problems.add(table.at, "an alarm watches one of tag, device and line").label("here");
            None
        }
    }
}

fn of_device(table: &AlarmTable) -> Condition {
    match table.ne107 {
        Some(ne107) => Condition::Health { signal: ne107.value },
        None if table.slower_than_stated.value_or(false) => Condition::SlowerThanStated,
        None => Condition::NotResponding,
    }
}

fn no_condition(table: &AlarmTable, what: &str, means: &str, problems: &mut Problems) {
    if let Some((at, word)) = conditions_of(table).first() {
        problems
            .add(*at, format!("a {what} has no `{word}`"))
            .label("expected a tag")
            .help(format!("the alarm of a {what} means: {means}"));
    }
}

/// The keys that are conditions.
const CONDITIONS: [&str; 11] =
    ["high_high", "high", "low", "low_low", "deviation", "is", "bit", "rate", "no_change", "no_update", "changes"];

/// The conditions that an alarm table has; exactly one is right.
pub(super) fn conditions_of(table: &AlarmTable) -> Vec<(Span, &'static str)> {
    CONDITIONS.into_iter().filter_map(|word| Some((table.span_of(word)?, word))).collect()
}

fn condition(table: &AlarmTable, tag: &TagDef, defs: &Defs, problems: &mut Problems) -> Option<Condition> {
    let found = conditions_of(table);
    let [(at, word)] = found.as_slice() else {
        let words = "`high`, `high_high`, `low`, `low_low`, `deviation`, `is`, `bit`, `rate`, `no_change`, `no_update` or \
                     `changes`";
        match found.get(1) {
            Some((second, word)) => problems
                .add(*second, "an alarm has one condition")
                .label(format!("`{word}` needs an [[alarm]] of its own")),
            None => problems.add(table.at, "an alarm needs a condition").label(format!("expected {words}")),
        };
        return None;
    };
    check_companions(table, word, problems);
    if let Some(is) = &table.is {
        return number_of(is, tag, problems).map(|is| Condition::State { is });
    }
    if let Some(bit) = table.bit {
        check_bit(bit, tag, problems);
        return Some(Condition::Bit { bit: bit.value });
    }
    if let Some(lasts) = table.no_update {
        return Some(Condition::NoUpdate { lasts: some_time(lasts, problems) });
    }
    if let Some(changes) = table.changes {
        return changes_within(table, changes, problems);
    }
    if let Some(lasts) = table.no_change {
        let Some(deadband) = table.deadband else {
            let problem = problems.add(lasts.at, "`no_change` needs a `deadband`").label("how much is no change?");
            problem.help("a little more than the noise of the value, or 0");
            return None;
        };
        return Some(Condition::NoChange { lasts: some_time(lasts, problems), deadband: deadband.value.max(0.0) });
    }
    if let Some(rate) = table.rate {
        return rate_over(table, rate, problems);
    }
    let deadband = deadband(table, *at, problems);
    if let Some(deviation) = table.deviation {
        let Some(from) = &table.from else {
            problems.add(table.at, "a deviation needs `from`").label("missing here").help("from = \"TIC-1.SV\"");
            return None;
        };
        let from = defs.tag(from, problems)?.id;
        if deviation.value <= 0.0 {
            problems.add(deviation.at, "a deviation is a distance").label("expected more than 0");
        }
        return Some(Condition::Deviation { from, limit: deviation.value, deadband: deadband? });
    }
    let levels = [
        (table.high_high, Level::HighHigh),
        (table.high, Level::High),
        (table.low, Level::Low),
        (table.low_low, Level::LowLow),
    ];
    let (limit, level) = levels.into_iter().find_map(|(limit, level)| Some((limit?, level)))?;
    check_limit(limit, tag, problems);
    Some(Condition::Limit { level, limit: limit.value, deadband: deadband? })
}

/// Keys that mean something only beside another one.
fn check_companions(table: &AlarmTable, word: &str, problems: &mut Problems) {
    for (key, of) in [("over", "rate"), ("within", "changes"), ("from", "deviation")] {
        if let Some(at) = table.span_of(key).filter(|_| word != of) {
            problems.add(at, format!("`{key}` belongs to `{of}`")).label(format!("means nothing with `{word}`"));
        }
    }
}

fn changes_within(table: &AlarmTable, changes: At<u32>, problems: &mut Problems) -> Option<Condition> {
    let Some(within) = table.within else {
        problems.add(changes.at, "`changes` needs `within`").label("in which time?").help("within = \"1min\"");
        return None;
    };
    if !(2..=CHANGES_MAX).contains(&changes.value) {
        problems.add(changes.at, "not a count of changes").label(format!("expected 2 to {CHANGES_MAX}"));
    }
    let deadband = table.deadband.map_or(0.0, |deadband| deadband.value.max(0.0));
    Some(Condition::Changes { count: changes.value, within: some_time(within, problems), deadband })
}

fn rate_over(table: &AlarmTable, rate: At<f64>, problems: &mut Problems) -> Option<Condition> {
    let Some(over) = table.over else {
        let problem = problems.add(rate.at, "`rate` needs `over`").label("measured over which time?");
        problem.help("over = \"1min\": the rate is always per minute");
        return None;
    };
    if rate.value == 0.0 {
        problems.add(rate.at, "a limit of 0 always holds").label("expected above 0, or below 0 for a falling value");
        return None;
    }
    let deadband = deadband(table, rate.at, problems)?;
    if rate.value.abs() <= deadband {
        problems.add(rate.at, "the alarm would never return").label("expected more than its `deadband`");
    }
    Some(Condition::Rate { limit: rate.value, over: some_time(over, problems), deadband })
}

/// A time in which something can happen.
fn some_time(time: At<Duration>, problems: &mut Problems) -> Duration {
    if time.value < Duration::from_secs(1) {
        problems.add(time.at, "this time is too short").label("expected at least \"1s\"");
    }
    time.value
}

fn deadband(table: &AlarmTable, condition: Span, problems: &mut Problems) -> Option<f64> {
    let Some(deadband) = table.deadband else {
        let problem = problems.add(condition, "a limit needs a `deadband`").label("without it the alarm would chatter");
        problem.help("usual: temperature 1 %, pressure 2 %, level and flow 5 % of the range");
        return None;
    };
    if deadband.value <= 0.0 {
        problems.add(deadband.at, "a deadband of 0 or less lets the alarm chatter").label("expected more than 0");
    }
    Some(deadband.value)
}

/// A limit that the value can never reach would be an alarm that never comes.
fn check_limit(limit: At<f64>, tag: &TagDef, problems: &mut Problems) {
    let fixed = |bound: Option<Bound>| match bound {
        Some(Bound::Fixed(value)) => Some(value),
        Some(Bound::From(_)) | None => None,
    };
    let (low, high) = range_of(tag).unwrap_or((f64::NEG_INFINITY.into(), f64::INFINITY.into()));
    let (low, high) = (fixed(tag.min).unwrap_or(low), fixed(tag.max).unwrap_or(high));
    if !(low..=high).contains(&Exact::from(limit.value)) {
        let problem = problems.add(limit.at, format!("the limit {} is outside the range of {}", limit.value, tag.name));
        problem.label(format!("it goes from {low} to {high}"));
    }
}
