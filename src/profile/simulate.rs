//! The words of `simulate`: how a simulated device fills a tag.

use std::sync::Arc;
use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Scope, number_of},
    reader::{At, Choice, OptionalKey},
    schema::{CheckTable, SimulateTable},
    tag::field_of,
};
use crate::plant::{
    simulate::{Case, Check, Motion, Operation, Pace, Simulate, Source, Test},
    tag::TagDef,
};

/// The simulation of a tag.
pub(super) fn simulate(
    table: &SimulateTable,
    tag: &TagDef,
    scope: &Scope,
    problems: &mut Problems,
) -> Option<Arc<Simulate>> {
    let mut cases = Vec::new();
    for case in table.cases.iter().map(|case| &case.value) {
        let when = case.when.as_ref().and_then(|when| checks(std::slice::from_ref(&when.value), scope, problems));
        let value = case.value.as_ref().and_then(|value| number_of(value, tag, problems));
        cases.extend(when.zip(value).map(|(when, value)| Case { when, value }));
    }
    let start = table.start.as_ref().and_then(|start| number_of(start, tag, problems));
    let range = table.range.and_then(|range| rising(range, "range", problems));
    if let Some(noise) = table.noise.filter(|noise| noise.value < 0.0) {
        problems.add(noise.at, "noise cannot be negative").label("expected 0 or more");
    }
    let noise = table.noise.value_or(0.0);
    let pulse = table.pulse.and_then(|pulse| lasting(pulse, "pulse", problems));
    let motion = motion(table, scope, problems);
    Some(Arc::new(Simulate { start, cases, motion, range, noise, pulse }))
}

/// The one word that says where a value goes, and what goes with it.
fn motion(table: &SimulateTable, scope: &Scope, problems: &mut Problems) -> Option<Motion> {
    let lists = [
        (&table.sum, Operation::Sum),
        (&table.mean, Operation::Mean),
        (&table.product, Operation::Product),
        (&table.difference, Operation::Difference),
        (&table.quotient, Operation::Quotient),
        (&table.reactive, Operation::Reactive),
    ];
    let mut sources: Vec<(Span, Option<Source>)> = Vec::new();
    for (list, operation) in lists.into_iter().filter(|(list, _)| !list.is_empty()) {
        let tags = list.iter().filter_map(|name| Some(scope.tag(name, problems)?.id)).collect();
        sources.push((list[0].at, Some(Source::Of(operation, tags))));
    }
    for (name, operation) in [(&table.follow, Operation::Sum), (&table.angle, Operation::Angle)] {
        let Some(name) = name else { continue };
        let tag = scope.tag(name, problems);
        sources.push((name.at, tag.map(|tag| Source::Of(operation, vec![tag.id]))));
    }
    if let Some(name) = &table.integrate {
        let time_base = table
            .time_base
            .and_then(|time_base| lasting(time_base, "time_base", problems))
            .unwrap_or(Duration::from_secs(1));
        let of = scope.tag(name, problems);
        sources.push((name.at, of.map(|of| Source::Integral { of: of.id, time_base })));
    }
    if let Some(oscillate) = table.oscillate {
        let period = table.period.and_then(|period| lasting(period, "period", problems));
        let period = period.unwrap_or(Duration::from_secs(60));
        let range = rising(oscillate, "oscillate", problems);
        sources.push((oscillate.at, range.map(|range| Source::Oscillation { range, period })));
    }
    stray(table, !sources.is_empty(), problems);
    if let [(first, _), (second, _), ..] = sources[..] {
        problems
            .add(second, "a value cannot be limited in two ways")
            .label("keep one of them")
            .also(first, "the other");
    }
    let (_, source) = sources.into_iter().next()?;
    let when =
        table.when.as_ref().map_or(Some(Vec::new()), |when| checks(std::slice::from_ref(&when.value), scope, problems));
    Some(Motion {
        source: source?,
        gain: table.gain.value_or(1.0),
        offset: table.offset.value_or(0.0),
        pace: pace(table, problems),
        when: when?,
        idle: table.idle.map(|idle| idle.value),
    })
}

/// Words that say nothing without another one.
fn stray(table: &SimulateTable, moves: bool, problems: &mut Problems) {
    const SOURCE: &str = "a source such as `follow` or `oscillate`";
    let of_motion = ["gain", "offset", "rate", "idle", "lag", "when"].map(|key| (key, SOURCE, moves));
    let others =
        [("period", "`oscillate`", table.oscillate.is_some()), ("time_base", "`integrate`", table.integrate.is_some())];
    for (key, other, _) in others.into_iter().chain(of_motion).filter(|(.., is_there)| !is_there) {
        if let Some(at) = table.span_of(key) {
            problems.add(at, format!("`{key}` says nothing without {other}")).label("not used");
        }
    }
}

fn pace(table: &SimulateTable, problems: &mut Problems) -> Pace {
    match (table.rate, table.lag) {
        (Some(rate), Some(lag)) => {
            problems.exclusive(("rate", rate.at), ("lag", lag.at));
            Pace::AtOnce
        }
        (Some(rate), None) if rate.value <= 0.0 => {
            problems.add(rate.at, "a rate is how much a second, above 0").label("expected more than 0");
            Pace::AtOnce
        }
        (Some(rate), None) => Pace::Rate(rate.value),
        (None, Some(lag)) => lasting(lag, "lag", problems).map_or(Pace::AtOnce, Pace::Lag),
        (None, None) => Pace::AtOnce,
    }
}

/// A query and what must be so besides; `None` if something is wrong with one.
fn checks(tables: &[CheckTable], scope: &Scope, problems: &mut Problems) -> Option<Vec<Check>> {
    let mut found = Vec::new();
    for table in tables {
        found.push(check(table, scope, problems)?);
        for more in &table.and {
            found.extend(checks(std::slice::from_ref(&more.value), scope, problems)?);
        }
    }
    Some(found)
}

fn check(table: &CheckTable, scope: &Scope, problems: &mut Problems) -> Option<Check> {
    let name = table.tag.as_ref()?;
    let target = scope.tag(name, problems)?;
    let field = match &table.field {
        Some(field) => Some(field_of(field, target.point, problems)?),
        None => None,
    };
    let mut tests = Vec::new();
    if let Some(is) = &table.is {
        // Bits of a word have no names of their own.
        let number = |choice: &At<Choice>, problems: &mut Problems| match (&choice.value, field) {
            (Choice::Number(number), Some(_)) => Some(number.near()),
            _ => number_of(choice, target, problems),
        };
        let wanted: Vec<f64> = is.value.0.iter().filter_map(|choice| number(choice, problems)).collect();
        tests.push((is.at, Test::Is(wanted)));
    }
    tests.extend(table.above.map(|above| (above.at, Test::Above(above.value))));
    tests.extend(table.below.map(|below| (below.at, Test::Below(below.value))));
    if let [(first, _), (second, _), ..] = tests[..] {
        problems.add(second, "one query at a time").label("put it into `and`").also(first, "the other");
    }
    let test = tests.into_iter().next().map_or(Test::On, |(_, test)| test);
    Some(Check { tag: target.id, field, test })
}

fn rising(range: At<[f64; 2]>, word: &str, problems: &mut Problems) -> Option<[f64; 2]> {
    let [low, high] = range.value;
    if low >= high {
        problems.add(range.at, format!("{word} from {low} to {high} has no room")).label("expected [lowest, highest]");
    }
    (low < high).then_some(range.value)
}

fn lasting(time: At<Duration>, word: &str, problems: &mut Problems) -> Option<Duration> {
    if time.value.is_zero() {
        problems.add(time.at, format!("{word} takes some time")).label("expected more than 0");
    }
    Some(time.value).filter(|time| !time.is_zero())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::tests::{METER, PLANT, PLC, check, load};

    /// The row of the temperature, which each case simulates in its own way.
    const ROW: &str = "modicon = 41003";

    fn check_wrong(words: &str, expect: &[&str]) {
        check(ROW, &format!("{ROW}\nsimulate = {{ {words} }}"), expect);
    }

    #[test]
    fn a_word_that_cannot_be_is_named() {
        check_wrong(
            "folow = 'DP'",
            &["unknown key `folow` in simulate", "did you mean `follow`", "[meter.toml:15:14]"],
        );
        check_wrong("follow = 'DQ'", &["unknown tag `DQ` in D1", "did you mean `DP`"]);
        check_wrong("oscillate = [5, 1]", &["oscillate from 5 to 1 has no room", "expected [lowest, highest]"]);
        check_wrong("follow = 'DP', rate = 0", &["a rate is how much a second, above 0"]);
        check_wrong("follow = 'DP', rate = 1, lag = '5s'", &["`rate` and `lag` exclude each other"]);
        check_wrong("follow = 'DP', oscillate = [0, 1]", &["a value cannot be limited in two ways"]);
        check_wrong("gain = 2", &["`gain` says nothing without a source such as `follow`"]);
        check_wrong("start = 3, period = '1min'", &["`period` says nothing without `oscillate`"]);
        check_wrong("pulse = '0s'", &["pulse takes some time"]);
        check_wrong("noise = -1", &["noise cannot be negative"]);
        check_wrong("start = 'hot'", &["`hot` is not a state of D1.T", "expected a number"]);
        check_wrong(
            "case = [{ when = { tag = 'MODE', is = 'onn' }, value = 1 }]",
            &["`onn` is not a state of D1.MODE", "on"],
        );
        check_wrong("case = [{ when = { tag = 'MODE' } }]", &["a case needs `value`"]);
        check_wrong("follow = 'DP', when = { tag = 'MODE', is = 1, above = 3 }", &["one query at a time", "`and`"]);
        check_wrong("follow = 'DP', when = { tag = 'MODE', field = '3-9', is = 1 }", &["this is not a field of bits"]);
    }

    #[test]
    fn the_functions_of_a_device_are_held_against_its_tags() {
        let listed = "source = \"manual\"\nfunctions = [3]\n\n[limits]";
        check("source = \"manual\"\n\n[limits]", listed, &["D1.MODE needs function 6, which `functions` lacks", "[3]"]);
    }

    #[test]
    fn a_tag_may_follow_one_of_another_device() {
        let meter = METER
            .replace(ROW, &format!("{ROW}\nsimulate = {{ start = 20, follow = 'PLC.STEP', lag = '10s', gain = 2 }}"));
        let plant = load(PLANT.as_bytes(), &meter, PLC).unwrap_or_else(|errors| panic!("{errors}"));
        let how = plant.tags[0].simulate.clone().expect("it is simulated");
        let step = plant.tag_named("PLC.STEP").expect("it is in the plant");
        assert_eq!(how.start, Some(20.0));
        let motion = how.motion.clone().expect("it moves");
        assert_eq!(motion.source, Source::Of(Operation::Sum, vec![step]));
        assert_eq!((motion.pace, motion.gain), (Pace::Lag(Duration::from_secs(10)), 2.0));
    }
}
