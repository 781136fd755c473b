//! Procedures: the steps that the station carries out on request, and the safe state that ends them.

use std::{sync::Arc, time::Duration};

use super::{
    diagnostic::{Problems, Span},
    expr,
    names::{Defs, Unique, check_name, held_number_of},
    reader::{At, Choice, text},
    schema::{ProcedureStepTable, ProcedureTable, ReferenceTable},
};
use crate::plant::{
    control_run::LEAST,
    def::{DeviceId, ProcedureDef, ProcedureStep, Reference, RunDef, TagId},
    exact::{Exact, digits},
    scale,
    tag::{Access, Bound, TagDef},
};

/// Steps of a procedure at most, those of others that it names among them.
const STEPS_MAX: usize = 500;
/// The longest hold, and the longest time limit.
const TIME_MAX: Duration = Duration::from_secs(7 * 86_400);

/// Those of a plant file, in its order. Steps of another procedure are copied here, so that no procedure can name itself.
pub(super) fn procedures(
    tables: &[At<ProcedureTable>],
    runs: &[RunDef],
    defs: &Defs,
    problems: &mut Problems,
) -> Vec<ProcedureDef> {
    let (mut found, mut names): (Vec<ProcedureDef>, _) = (Vec::new(), Unique::default());
    for table in tables.iter().map(|table| &table.value) {
        let Some(name) = &table.name else { continue };
        check_name(name, "procedure", problems);
        names.insert(&name.value, name.at, format!("duplicate procedure `{}`", name.value), problems);
        if table.steps.is_empty() {
            problems.add(table.at, format!("procedure {} has no steps", name.value)).label("expected `steps`");
        }
        let safe = safe_state(table, &name.value, &found, defs, problems);
        let label: Arc<str> = name.value.as_str().into();
        let steps = StepReader { label: &label, earlier: &found, runs, defs, problems }.steps(&table.steps);
        let reference = table.reference.as_ref().map(|table| reference(&table.value));
        found.push(ProcedureDef { name: label, about: text(&table.about), steps, safe, reference });
    }
    found
}

/// What is written when it fails or is aborted; where the table is silent, that of the first procedure whose steps it has.
fn safe_state(
    table: &ProcedureTable,
    name: &str,
    earlier: &[ProcedureDef],
    defs: &Defs,
    problems: &mut Problems,
) -> Vec<(TagId, f64)> {
    if table.safe.is_empty() {
        let Some(from) = table.steps.iter().find_map(|step| step.value.steps_of.as_ref()) else {
            let problem = problems.add(table.at, format!("procedure {name} has no safe state"));
            problem.label("expected `safe`: what is written when it fails or is aborted");
            return Vec::new();
        };
        return earlier.iter().find(|def| *def.name == *from.value).map_or(Vec::new(), |def| def.safe.clone());
    }
    let mut written = Unique::default();
    let rows = table.safe.iter().map(|row| &row.value).filter_map(|row| {
        let tag = row.write.as_ref()?;
        written.insert(&tag.value, tag.at, format!("{} is written twice", tag.value), problems);
        write(tag, row.value.as_ref()?, defs, problems)
    });
    rows.collect()
}

fn reference(table: &ReferenceTable) -> Reference {
    Reference {
        source: text(&table.source),
        at_sv: table.at_sv.map(|time| time.value),
        steady: table.steady.map(|time| time.value),
        overshoot: table.overshoot.map(|value| value.value),
    }
}

/// A measurement that has begun and not ended.
struct Measurement {
    controller: DeviceId,
    at: Span,
    /// The longest that it can last up to here, where that is known.
    at_most: Option<Duration>,
}

/// Reads the steps of one procedure.
struct StepReader<'a, 'd> {
    label: &'a Arc<str>,
    /// The procedures that stand before it.
    earlier: &'a [ProcedureDef],
    runs: &'a [RunDef],
    defs: &'a Defs<'d>,
    problems: &'a mut Problems,
}

impl StepReader<'_, '_> {
    fn steps(&mut self, tables: &[At<ProcedureStepTable>]) -> Vec<ProcedureStep> {
        let mut steps = Vec::new();
        let mut open: Vec<Measurement> = Vec::new();
        for table in tables {
            for step in self.step(&table.value) {
                self.pair(&step, table.at, &mut open);
                steps.push(step);
            }
        }
        for Measurement { at, .. } in open {
            self.problems.add(at, "this measurement never ends").label("expected an `end_measurement` after it");
        }
        if let Some(table) = tables.last().filter(|_| STEPS_MAX < steps.len()) {
            let message = format!("too many steps: {} of {}", steps.len(), self.label);
            self.problems.add(table.at, message).label(format!("expected at most {STEPS_MAX}"));
        }
        steps
    }

    /// A measurement begins before it ends, and ends before the next one of its controller begins.
    fn pair(&mut self, step: &ProcedureStep, at: Span, open: &mut Vec<Measurement>) {
        match step {
            ProcedureStep::BeginMeasurement { controller, .. } => {
                if open.iter().any(|measurement| measurement.controller == *controller) {
                    self.problems.add(at, "the measurement before this one has not ended").label("begins again");
                }
                open.push(Measurement { controller: *controller, at, at_most: Some(Duration::ZERO) });
            }
            ProcedureStep::EndMeasurement { controller } => {
                let (ended, others) = open.drain(..).partition(|measurement| measurement.controller == *controller);
                let ended: Vec<Measurement> = ended;
                *open = others;
                if ended.is_empty() {
                    self.problems.add(at, "no measurement has begun").label("expected a `begin_measurement` before it");
                }
                // So short a run is not kept: the procedure would be carried out up to here, and then fail.
                if ended.iter().any(|measurement| measurement.at_most.is_some_and(|at_most| at_most < LEAST)) {
                    let problem = self.problems.add(at, "this measurement is too short to be kept");
                    problem.label(format!("expected {} s at least after its `begin_measurement`", LEAST.as_secs()));
                }
            }
            ProcedureStep::Hold(time) | ProcedureStep::WaitUntil { limit: time, .. } => {
                let times = open.iter_mut().filter_map(|measurement| measurement.at_most.as_mut());
                times.for_each(|at_most| *at_most += *time);
            }
            // How long a write takes is not known.
            ProcedureStep::Write { .. } => open.iter_mut().for_each(|measurement| measurement.at_most = None),
        }
    }

    /// Exactly one of the kinds; more than one step only where those of another procedure are named.
    fn step(&mut self, table: &ProcedureStepTable) -> Vec<ProcedureStep> {
        let ProcedureStepTable { write, value, wait_until, limit, hold, begin_measurement, end_measurement, .. } =
            table;
        let places = [
            write.as_ref().map(|key| key.at),
            wait_until.as_ref().map(|key| key.at),
            hold.map(|key| key.at),
            begin_measurement.as_ref().map(|key| key.at),
            end_measurement.as_ref().map(|key| key.at),
            table.steps_of.as_ref().map(|key| key.at),
        ];
        let kinds: Vec<Span> = places.into_iter().flatten().collect();
        const KINDS: &str =
            "expected `write`, `wait_until`, `hold`, `begin_measurement`, `end_measurement` or `steps_of`";
        match kinds.as_slice() {
            [_] => {}
            // A key of the wrong type is reported already.
            [] if !table.valid => return Vec::new(),
            [] => {
                self.problems.add(table.at, "a step needs an action").label(KINDS);
                return Vec::new();
            }
            [_, second, ..] => {
                self.problems.add(*second, "a step has one action").label("expected a step of its own");
                return Vec::new();
            }
        }
        self.beside(value.as_ref().map(|key| key.at), write.is_some(), ("value", "write"), table);
        self.beside(limit.map(|key| key.at), wait_until.is_some(), ("limit", "wait_until"), table);
        if let Some(other) = &table.steps_of {
            return self.steps_of(other);
        }
        let step = if let (Some(tag), Some(value)) = (write, value) {
            self::write(tag, value, self.defs, self.problems).map(|(tag, value)| ProcedureStep::Write { tag, value })
        } else if let (Some(words), Some(limit)) = (wait_until, limit) {
            let limit = self.time(*limit);
            let condition = expr::expr(words, self.defs, self.problems);
            condition.map(|condition| ProcedureStep::WaitUntil { text: words.value.as_str().into(), condition, limit })
        } else if let Some(hold) = hold {
            Some(ProcedureStep::Hold(self.time(*hold)))
        } else if let Some(name) = begin_measurement {
            let label = self.label.clone();
            self.controller(name).map(|controller| ProcedureStep::BeginMeasurement { controller, label })
        } else {
            let controller = end_measurement.as_ref().and_then(|name| self.controller(name));
            controller.map(|controller| ProcedureStep::EndMeasurement { controller })
        };
        step.into_iter().collect()
    }

    /// A key that belongs to another one: each needs the other.
    fn beside(&mut self, key: Option<Span>, wanted: bool, (name, of): (&str, &str), table: &ProcedureStepTable) {
        match (key, wanted) {
            (None, true) if table.valid => {
                self.problems.add(table.at, format!("`{of}` needs `{name}`")).label("missing here");
            }
            (Some(at), false) => {
                self.problems.add(at, format!("`{name}` belongs to `{of}`")).label("without it here");
            }
            (None, _) | (Some(_), true) => {}
        }
    }

    fn steps_of(&mut self, other: &At<String>) -> Vec<ProcedureStep> {
        match self.earlier.iter().find(|def| *def.name == *other.value) {
            Some(def) => def.steps.clone(),
            None => {
                let problem = self.problems.add(other.at, format!("no procedure `{}` before this one", other.value));
                problem
                    .label("expected the name of an earlier [[procedure]]")
                    .suggest(&other.value, self.earlier.iter().map(|def| &*def.name));
                Vec::new()
            }
        }
    }

    fn time(&mut self, time: At<Duration>) -> Duration {
        if time.value.is_zero() || TIME_MAX < time.value {
            self.problems.add(time.at, "this is not the time of a step").label("expected more than 0s, 7 days at most");
        }
        time.value
    }

    fn controller(&mut self, name: &At<String>) -> Option<DeviceId> {
        let id = self.defs.device(name, self.problems)?;
        if !self.runs.iter().any(|run| run.controller == id) {
            let message = format!("{} has no SV and PV", name.value);
            self.problems.add(name.at, message).label("expected a device with a [faceplate]");
        }
        Some(id)
    }
}

/// A tag and the value that it gets, as the device will hold it. What cannot be read back cannot be verified.
fn write(name: &At<String>, value: &At<Choice>, defs: &Defs, problems: &mut Problems) -> Option<(TagId, f64)> {
    let tag = defs.tag(name, problems)?;
    if tag.access != Access::ReadWrite {
        let problem = problems.add(name.at, format!("{} cannot be written and read back", tag.name));
        problem.label("expected access = \"rw\"");
    }
    if defs.listens_to(tag) {
        let problem = problems.add(name.at, format!("{} is on a line that only listens", tag.name));
        problem.label("another master polls it: nothing can be written");
    }
    let held = held_number_of(value, tag, problems)?;
    check_limits(value, held, tag, problems);
    Some((tag.id, held))
}

/// Limits that are fixed are known here already; the others are checked by the write.
fn check_limits(value: &At<Choice>, held: f64, tag: &TagDef, problems: &mut Problems) {
    let fixed = |bound: &Option<Bound>| match bound {
        Some(Bound::Fixed(bound)) => Some(*bound),
        Some(Bound::From(_)) | None => None,
    };
    let (min, max) = (fixed(&tag.min), fixed(&tag.max));
    if !scale::is_inside(min, max, held.into()) {
        let text = |bound: Option<Exact>, none: &str| bound.map_or(none.to_owned(), |bound| digits(bound, None));
        let held = digits(held, None);
        let problem = problems.add(value.at, format!("{held} is outside the range of {}", tag.name));
        problem.label(format!("expected {} … {}", text(min, "−∞"), text(max, "∞")));
    }
}
