//! Reads a scenario file: every mistake at once, with file, line, what was found and what was expected.

mod expect;
mod names;
#[cfg(test)]
mod tests;

use std::{path::Path, sync::Arc, time::Duration};

use self::names::{alarm, tag, unknown, value};
use super::{Expect, FaultEvent, OperatorAction, OperatorStep, Scenario, Start, judge::clock};
use crate::{
    plant::{PlantDef, record::AlarmEvent},
    profile::{
        self, Errors, Search,
        diagnostic::{Problems, Span},
        reader::{self, At, Choice, Node, Value, text, toml_tables},
        renamed,
    },
    sim::faults::{FaultTarget, InjectedFault, why_not_applicable},
};

toml_tables! {
    /// A scenario file.
    ScenarioTable, "the scenario" {
        need "title" title: String,
        opt "description" description: String,
        need "plant" plant: String,
        opt "start" start: Start,
        opt "warm_up" warm_up: Duration,
        need "duration" duration: Duration,
        opt "pass_percent" pass_percent: u8,
        list "event" events: EventTable,
        list "operator" operator: OperatorTable,
        list "expect" expect: ExpectTable,
    }

    /// An `[[event]]`.
    EventTable, "an event" {
        need "at" at_time: Duration,
        need "fault" fault: InjectedFault,
        opt "line" line: String,
        opt "device" device: String,
        opt "tag" tag: String,
        /// The fault is cleared after this time.
        opt "for" lasts: Duration,
        /// The fault is cleared now.
        opt "clear" clear: bool,
    }

    /// An `[[operator]]`: what a good operator does.
    OperatorTable, "an operator action" {
        need "at" at_time: Duration,
        opt "acknowledge" acknowledge: String,
        opt "message" message: String,
        opt "write" write: String,
        opt "value" value: Choice,
    }

    /// An `[[expect]]`.
    ExpectTable, "an expectation" {
        opt "what" what: String,
        opt "points" points: u16,
        /// From when, from the start if left out.
        opt "after" after: Duration,
        /// How long after that, until the end if left out.
        opt "within" within: Duration,
        opt "alarm" alarm: String,
        opt "message" message: String,
        opt "event" event: AlarmEvent,
        opt "never" never: bool,
        opt "written" written: String,
        opt "value" value: Choice,
        opt "not_good" not_good: String,
        opt "good" good: String,
        opt "process" process: String,
        opt "never_above" never_above: f64,
        opt "never_below" never_below: f64,
        opt "displayed_within" displayed_within: String,
        opt "tolerance" tolerance: f64,
    }
}

impl Value for InjectedFault {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<InjectedFault> {
        let word = String::read(value, at, problems)?;
        match word.parse() {
            Ok(fault) => Some(fault),
            Err(error) => {
                let mut known: Vec<&str> = InjectedFault::all().map(|fault| fault.word()).collect();
                known.dedup();
                let problem = problems.add(at, format!("{error}")).label("not a fault");
                renamed::offer(problem, "a fault", &word, &known);
                None
            }
        }
    }
}

/// Reads the scenario that an argument means, a path or a name, with its plant: a name, or a path beside the scenario.
pub fn load(argument: &Path, search: &Search) -> Result<(Scenario, Arc<PlantDef>), Errors> {
    let (name, found) = profile::scenario(argument, search)?;
    let find = |plant: &str| {
        let beside = argument.parent().map(|folder| folder.join(plant)).filter(|_| plant.ends_with(".toml"));
        profile::load(&beside.unwrap_or_else(|| plant.into()), search)
    };
    read(&name, &found.file, &found.bytes, &find)
}

/// How the plant of a scenario is found, by the name that the file gives.
pub type FindPlant<'a> = &'a dyn Fn(&str) -> Result<Arc<PlantDef>, Errors>;

/// Reads the scenario `name` out of the text of a file, and loads its plant.
pub fn read(name: &str, file: &str, bytes: &[u8], find: FindPlant) -> Result<(Scenario, Arc<PlantDef>), Errors> {
    let mut problems = Problems::default();
    let table = reader::parse(file, bytes, &mut problems).map(|raw| ScenarioTable::of(&[raw], &mut problems));
    let plant = match table.as_ref().and_then(|table| table.plant.as_ref()) {
        Some(plant) => find(&plant.value).map(Some),
        None => Ok(None),
    };
    let plant = match plant {
        Ok(plant) => plant,
        // The mistakes of the file itself come first; those of the plant are of another file.
        Err(errors) => {
            problems.finish(())?;
            return Err(errors);
        }
    };
    let built = table.zip(plant).map(|(table, plant)| (scenario(name, &table, &plant, &mut problems), plant));
    match problems.finish(built)? {
        Some(built) => Ok(built),
        None => Err(Errors::unreadable(format!("{file} is not a scenario"), String::new())),
    }
}

fn scenario(name: &str, table: &ScenarioTable, def: &PlantDef, problems: &mut Problems) -> Scenario {
    let duration = table.duration.map_or(Duration::ZERO, |duration| duration.value);
    let mut events: Vec<FaultEvent> =
        table.events.iter().flat_map(|event| events(&event.value, duration, def, problems)).collect();
    events.sort_by_key(|event| event.at);
    let mut operator: Vec<OperatorStep> =
        table.operator.iter().filter_map(|step| self::step(&step.value, duration, def, problems)).collect();
    operator.sort_by_key(|step| step.at);
    let expect: Vec<Expect> =
        table.expect.iter().filter_map(|expect| expect::expectation(&expect.value, duration, def, problems)).collect();
    if table.expect.is_empty() {
        problems.add(table.at, "a scenario needs at least one [[expect]]").label("nothing to evaluate");
    }
    if let Some(percent) = table.pass_percent.filter(|percent| percent.value > 100) {
        problems.add(percent.at, format!("found {} %", percent.value)).label("expected 0 to 100");
    }
    Scenario {
        name: name.to_owned(),
        title: text(&table.title),
        description: text(&table.description),
        plant: text(&table.plant),
        start: table.start.map(|start| start.value).unwrap_or_default(),
        warm_up: table.warm_up.map_or(Duration::ZERO, |warm_up| warm_up.value),
        duration,
        pass_percent: table.pass_percent.map_or(100, |percent| u32::from(percent.value)),
        events,
        operator,
        expect,
    }
}

/// The beginning of a fault and, if it lasts for a time, its end.
fn events(table: &EventTable, duration: Duration, def: &PlantDef, problems: &mut Problems) -> Vec<FaultEvent> {
    let target = target(table, def, problems);
    let (Some(at), Some(fault), Some(target)) = (in_time(table.at_time, duration, problems), table.fault, target)
    else {
        return Vec::new();
    };
    if let Some(why) = why_not_applicable(def, target, fault.value) {
        problems.add(fault.at, why).label("cannot be there");
        return Vec::new();
    }
    let begins = !table.clear.is_some_and(|clear| clear.value);
    if let (false, Some(lasts)) = (begins, table.lasts) {
        problems.add(lasts.at, "a fault that is cleared has no duration").label("leave out `for` or `clear`");
    }
    let first = FaultEvent { at, target, fault: fault.value, begins };
    let end = table.lasts.map(|lasts| FaultEvent { at: at + lasts.value, begins: false, ..first });
    [Some(first), end].into_iter().flatten().collect()
}

fn target(table: &EventTable, def: &PlantDef, problems: &mut Problems) -> Option<FaultTarget> {
    match (&table.line, &table.device, &table.tag) {
        (Some(name), None, None) => {
            let line = def.lines.iter().find(|line| line.name == name.value);
            let known = def.lines.iter().map(|line| line.name.as_str());
            unknown(line.map(|line| FaultTarget::Line(line.id)), "line", name, known, problems)
        }
        (None, Some(name), None) => {
            let device = def.devices.iter().find(|device| device.name == name.value);
            let known = def.devices.iter().map(|device| device.name.as_str());
            unknown(device.map(FaultTarget::of_unit), "device", name, known, problems)
        }
        (None, None, Some(name)) => tag(name, def, problems).map(FaultTarget::Tag),
        (None, None, None) => match table.fault {
            Some(fault) if FaultTarget::Process.accepts(fault.value) => Some(FaultTarget::Process),
            Some(fault) => {
                let problem = problems.add(table.at, format!("where is `{}`?", fault.value));
                problem.label("expected `line`, `device` or `tag`");
                None
            }
            None => None,
        },
        (_, second, third) => {
            let at = third.as_ref().or(second.as_ref()).map_or(table.at, |name| name.at);
            problems.add(at, "a fault has one target").label("keep one of `line`, `device`, `tag`");
            None
        }
    }
}

fn step(table: &OperatorTable, duration: Duration, def: &PlantDef, problems: &mut Problems) -> Option<OperatorStep> {
    let at = in_time(table.at_time, duration, problems);
    let action = match (&table.acknowledge, &table.write) {
        (Some(all), None) if all.value == "all" => OperatorAction::AcknowledgeAll,
        (Some(subject), None) => OperatorAction::Acknowledge(alarm(subject, &table.message, def, problems)?),
        (None, Some(name)) => {
            let tag = tag(name, def, problems)?;
            let value = value(&table.value, name, tag, def, problems)?;
            OperatorAction::Write(tag, value)
        }
        (Some(_), Some(write)) => {
            problems.add(write.at, "one action at a time").label("needs an [[operator]] of its own");
            return None;
        }
        (None, None) => {
            problems.add(table.at, "what does the operator do?").label("expected `acknowledge` or `write`");
            return None;
        }
    };
    Some(OperatorStep { at: at?, action })
}

fn in_time(at: Option<At<Duration>>, duration: Duration, problems: &mut Problems) -> Option<Duration> {
    let at = at?;
    if duration < at.value && !duration.is_zero() {
        let problem = problems.add(at.at, format!("the scenario is over at {}", clock(duration)));
        problem.label(format!("this is at {}", clock(at.value)));
    }
    Some(at.value)
}
