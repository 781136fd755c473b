//! The ramp/soak program of a profile: which tags show it, and which start and stop it.

use super::{
    diagnostic::Problems,
    names::{Names, number_of},
    reader::At,
    schema::{ProgramTable, StepTable},
};
use crate::plant::{
    def::{ProgramDef, ProgramStep, TagId},
    tag::TagDef,
};

/// The program of a device.
pub(super) fn program(
    table: &ProgramTable,
    device: &str,
    names: &Names,
    tags: &[TagDef],
    problems: &mut Problems,
) -> Option<ProgramDef> {
    let mut find = |name: &Option<At<String>>| name.as_ref().and_then(|name| names.near(name, device, problems));
    let (position, command) = (find(&table.position), find(&table.command));
    let (pattern, mode) = (find(&table.pattern), find(&table.mode));
    if table.steps.is_empty() {
        problems.add(table.at, "a program needs `steps`").label("expected steps = [{ sv = …, ramp = …, soak = … }]");
    }
    let steps: Vec<_> =
        table.steps.iter().filter_map(|step| step_of(&step.value, device, names, tags, problems)).collect();
    let patterns = patterns(table, steps.len(), problems);
    let (position, command) = (position?, command?);
    let target = &tags[command.index()];
    if let Some(name) = table.command.as_ref().filter(|_| !target.writable()) {
        problems.add(name.at, format!("{} cannot be written", target.name)).label("expected access = \"rw\"");
    }
    let mut value = |choice: &Option<_>| choice.as_ref().and_then(|choice| number_of(choice, target, problems));
    let (run, halt, off) = (value(&table.run), value(&table.halt), value(&table.off));
    Some(ProgramDef { position, command, run: run?, halt, off: off?, pattern, patterns, mode, steps })
}

fn step_of(
    step: &StepTable,
    device: &str,
    names: &Names,
    tags: &[TagDef],
    problems: &mut Problems,
) -> Option<ProgramStep> {
    let mut find = |name: &Option<At<String>>| -> Option<TagId> {
        let name = name.as_ref()?;
        let id = names.near(name, device, problems)?;
        if !tags[id.index()].writable() {
            let problem = problems.add(name.at, format!("{} cannot be written", tags[id.index()].name));
            problem.label("expected access = \"rw\"");
        }
        Some(id)
    };
    let (sv, ramp, soak) = (find(&step.sv), find(&step.ramp), find(&step.soak));
    Some(ProgramStep { sv: sv?, ramp: ramp?, soak: soak? })
}

/// First and last step of each pattern, from 0.
fn patterns(table: &ProgramTable, steps: usize, problems: &mut Problems) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for At { value: [first, last], at } in &table.patterns {
        let (first, last) = (usize::from(*first), usize::from(*last));
        if first == 0 || last < first || steps < last {
            let problem = problems.add(*at, format!("a pattern from step {first} to step {last} is not possible"));
            problem.label(format!("expected [FIRST, LAST] within 1 to {steps}"));
        }
        found.push((first.saturating_sub(1), last.saturating_sub(1)));
    }
    found
}
