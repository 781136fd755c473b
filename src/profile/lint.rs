//! The lint of alarms: what an alarm lacks that can be used but would not help an operator.
//!
//! An alarm is complete with cause, effect, action, response time and priority (ISA-18.2); one without an action is
//! none. What is plainly wrong, such as a limit without a deadband or two alarms of one name, is an error elsewhere.

use std::collections::BTreeMap;

use super::{
    condition::conditions_of,
    diagnostic::{Problems, Span},
    reader::{At, text},
    schema::AlarmTable,
};
use crate::plant::{def::Priority, tag::TagDef};

/// From this many alarms up their split by priority says something.
const SPLIT_MIN: usize = 20;
/// Most alarms of high and critical priority, percent. The target for those that are raised is 5; a file may have more of
/// them, because what is urgent should come seldom.
const URGENT_MAX: usize = 20;

/// Looks through the alarms of a plant file; those that are wrong by themselves are passed over.
pub(super) fn lint(tables: &[At<AlarmTable>], tags: &[TagDef], problems: &mut Problems) {
    let valid: Vec<&AlarmTable> = tables.iter().map(|table| &table.value).filter(|table| table.valid).collect();
    for table in &valid {
        incomplete(table, problems);
        delay(table, problems);
        normal(table, tags, problems);
    }
    twice(&valid, problems);
    split(&valid, problems);
}

/// What the operator would have to guess.
fn incomplete(table: &AlarmTable, problems: &mut Problems) {
    let empty = |words: &Option<At<String>>| words.as_ref().is_none_or(|words| words.value.trim().is_empty());
    let missing: Vec<&str> = [
        ("`cause`", empty(&table.cause)),
        ("`effect`", empty(&table.effect)),
        ("`action`", empty(&table.action)),
        ("`response_time`", table.response_time.is_none()),
    ]
    .into_iter()
    .filter_map(|(key, missing)| missing.then_some(key))
    .collect();
    if missing.is_empty() {
        return;
    }
    let message = format!("{} has no {}", name(table), missing.join(", "));
    let problem = problems.warn(place(table), message);
    problem.label("not complete").help(match missing.contains(&"`action`") {
        true => "an alarm needs an operator action: add one, or remove the alarm",
        false => "give the likely cause, the effect, the action and the response time",
    });
}

/// A limit without a delay, or with one that leaves no time.
fn delay(table: &AlarmTable, problems: &mut Problems) {
    let analog = [table.high_high, table.high, table.low, table.low_low, table.deviation].into_iter().flatten().next();
    match (analog, table.on_delay, table.response_time) {
        (Some(limit), None, _) => {
            let problem = problems.warn(limit.at, format!("{} has no `on_delay`", name(table)));
            problem.label("a single peak raises it").help(
                "usual: flow and pressure 15s, level and temperature 60s; write on_delay = \"0s\" where it must come at once",
            );
        }
        (_, Some(delay), Some(time)) if time.value < delay.value => {
            let problem =
                problems.warn(delay.at, format!("{} is raised later than the operator must respond", name(table)));
            problem.label("longer than `response_time`").also(time.at, "the response time");
        }
        (Some(_) | None, _, _) => {}
    }
}

/// A limit inside the normal band: where the value usually lies is no alarm.
fn normal(table: &AlarmTable, tags: &[TagDef], problems: &mut Problems) {
    // One that is enabled in a state of the plant only says what is normal then.
    let Some(name) = table.tag.as_ref().filter(|_| table.enabled_when.is_none()) else { return };
    let Some([low, high]) = tags.iter().find(|tag| tag.name == name.value).and_then(|tag| tag.normal) else { return };
    let limits = [table.high_high, table.high, table.low, table.low_low].into_iter().flatten();
    for limit in limits.filter(|limit| low < limit.value && limit.value < high) {
        let message = format!("the limit {} lies inside normal = [{low}, {high}] of {}", limit.value, name.value);
        problems.warn(limit.at, message).label("an alarm while the value is normal");
    }
}

/// Two alarms that say the same.
fn twice(tables: &[&AlarmTable], problems: &mut Problems) {
    let mut seen: BTreeMap<(String, String), Span> = BTreeMap::new();
    for table in tables {
        let found = conditions_of(table).into_iter().next();
        let (Some((at, word)), Some(tag)) = (found, &table.tag) else { continue };
        // There is one high limit of a tag, but an alarm for each of its states.
        let analog = ["high_high", "high", "low", "low_low", "deviation"].contains(&word);
        let value = problems.text(at.source).get(at.start..at.end).unwrap_or_default();
        let condition = if analog { word.to_owned() } else { format!("{word} = {value}") };
        // What is enabled at another time says something else.
        let condition = match &table.enabled_when {
            Some(when) => format!("{condition} when {}", when.value),
            None => condition,
        };
        match seen.get(&(tag.value.clone(), condition.clone())) {
            Some(first) => {
                let first = *first;
                let problem = problems.warn(at, format!("{} has two alarms for `{condition}`", tag.value));
                problem.label("again").also(first, "first here");
            }
            None => {
                seen.insert((tag.value.clone(), condition), at);
            }
        }
    }
}

/// Where everything is urgent nothing is.
fn split(tables: &[&AlarmTable], problems: &mut Problems) {
    let urgent = |priority: Priority| match priority {
        Priority::Critical | Priority::High => true,
        Priority::Medium | Priority::Low => false,
    };
    let priorities = tables.iter().filter_map(|table| table.priority);
    let list: Vec<_> = priorities.filter(|priority| urgent(priority.value)).collect();
    let (count, all) = (list.len(), tables.len());
    if SPLIT_MIN <= all && URGENT_MAX * all < count * 100 {
        let problem = problems.warn(list[0].at, format!("{count} of {all} alarms are high or critical"));
        problem
            .label("the first of them")
            .help(format!("expected at most {URGENT_MAX} %: about 80 % low, 15 % medium and 5 % high are usual"));
    }
}

fn name(table: &AlarmTable) -> String {
    format!("the alarm `{}` of {}", text(&table.message), table.subject().map_or("", |name| &name.value))
}

fn place(table: &AlarmTable) -> Span {
    table.message.as_ref().map_or(table.at, |text| text.at)
}

#[cfg(test)]
mod tests {
    use super::super::{
        plant::{Library, Text, build},
        tests::{METER, PLANT, PLC},
    };

    /// A complete alarm with other keys.
    fn alarm(keys: &str) -> String {
        format!(
            "[[alarm]]\n{keys}\ncause = \"a fault\"\neffect = \"a loss\"\naction = \"stop it\"\nresponse_time = \"10min\"\n"
        )
    }

    /// What the lint says of a plant with these alarms, a line each.
    fn warnings(alarms: &str) -> Vec<String> {
        warnings_with(alarms, METER)
    }

    fn warnings_with(alarms: &str, meter: &str) -> Vec<String> {
        let start = PLANT.find("[[alarm]]").expect("the plant has an alarm");
        let end = PLANT.find("[mimic]").expect("the plant has a mimic");
        let text = format!("{}{alarms}{}", &PLANT[..start], &PLANT[end..]);
        let find = |name: &str| {
            let text = if name == "meter" { meter } else { PLC };
            Ok(Some(Text { file: format!("{name}.toml"), bytes: text.as_bytes().to_vec() }))
        };
        let library = Library { find: &find, names: Vec::new(), is_program: &|_| true };
        let built = build("small", &Text { file: "small.toml".into(), bytes: text.into_bytes() }, &library);
        let (_, warnings) = built.unwrap_or_else(|errors| panic!("{errors}"));
        warnings.full_lines().collect()
    }

    fn check(alarms: &str, expect: &[&str]) {
        let found = warnings(alarms);
        assert_eq!(found.len(), expect.len(), "{alarms}\n{found:#?}");
        for (line, part) in found.iter().zip(expect) {
            assert!(line.contains(part), "no `{part}` in {line}");
        }
    }

    const HOT: &str =
        "tag = \"D1.T\"\nhigh = 80.0\ndeadband = 1.0\non_delay = \"5s\"\npriority = \"high\"\nmessage = \"hot\"";

    #[test]
    fn a_complete_alarm_is_left_in_peace() {
        check(&alarm(HOT), &[]);
        check(&alarm("device = \"D1\"\npriority = \"low\"\nmessage = \"silent\""), &[]);
        check(&alarm("tag = \"D1.MODE\"\nis = \"on\"\npriority = \"low\"\nmessage = \"runs\""), &[]);
    }

    #[test]
    fn what_an_operator_would_have_to_guess_is_named_with_its_place() {
        let bare = format!("[[alarm]]\n{HOT}\n");
        check(
            &bare,
            &["small.toml:30:11: the alarm `hot` of D1.T has no `cause`, `effect`, `action`, `response_time`"],
        );
        check(
            &alarm(HOT).replace("stop it", " "),
            &["has no `action` (not complete; an alarm needs an operator action"],
        );
        check(&alarm(HOT).replace("response_time = \"10min\"\n", ""), &["has no `response_time`"]);
    }

    #[test]
    fn a_limit_needs_a_delay_or_the_word_that_it_needs_none() {
        check(
            &alarm(&HOT.replace("on_delay = \"5s\"\n", "")),
            &["small.toml:26:8: the alarm `hot` of D1.T has no `on_delay`"],
        );
        check(&alarm(&HOT.replace("5s", "0s")), &[]);
        check(&alarm(&HOT.replace("5s", "10min")), &[]);
        check(
            &alarm(&HOT.replace("5s", "11min")),
            &["is raised later than the operator must respond (longer than `response_time`)"],
        );
    }

    #[test]
    fn a_limit_inside_the_normal_band_is_found() {
        let with =
            |band: &str| warnings_with(&alarm(HOT), &METER.replace("max = 100\n", &format!("max = 100\n{band}\n")));
        assert_eq!(with("normal = [20, 80]"), [""; 0]);
        let found = with("normal = [20, 90]");
        assert!(found.len() == 1 && found[0].contains("small.toml:26:8: the limit 80 lies inside"), "{found:?}");
    }

    #[test]
    fn two_alarms_that_say_the_same_are_found() {
        let again = HOT.replace("80.0", "85.0").replace("hot", "hotter");
        check(&(alarm(HOT) + &alarm(&again)), &["D1.T has two alarms for `high`"]);
        let is = |state: &str| {
            alarm(&format!("tag = \"D1.MODE\"\nis = \"{state}\"\npriority = \"low\"\nmessage = \"{state}!\""))
        };
        check(&(is("on") + &is("off")), &[]);
        let both = is("on") + &is("on").replace("on!", "runs");
        check(&both, &["D1.MODE has two alarms for `is = \"on\"`"]);
    }

    #[test]
    fn too_many_urgent_alarms_are_reported_from_twenty_up() {
        let alarms = |urgent: usize, all: usize| -> String {
            let one = |i: usize| {
                let priority = if i < urgent { "high" } else { "low" };
                let state = ["on", "off"][i % 2];
                let text = format!("tag = \"D1.MODE\"\nis = \"{state}\"\npriority = \"{priority}\"\nmessage = \"{i}\"");
                alarm(&text)
            };
            (0..all).map(one).collect()
        };
        let split = |urgent, all| -> Vec<String> {
            warnings(&alarms(urgent, all)).into_iter().filter(|line| line.contains("critical")).collect()
        };
        assert_eq!(split(4, 20), [""; 0]);
        assert_eq!(split(19, 19), [""; 0], "too few to say");
        let found = split(5, 20);
        assert_eq!(found.len(), 1);
        assert!(
            found[0].contains("5 of 20 alarms are high or critical (the first of them; expected at most 20 %"),
            "{found:?}"
        );
    }
}
