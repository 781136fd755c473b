//! The ramp/soak program of a profile: which tags show it, and which start and stop it.

use super::{
    diagnostic::Problems,
    names::{Scope, number_of},
    reader::At,
    schema::{ProgramTable, StepTable},
};
use crate::plant::def::{ProgramDef, ProgramStep};

/// The program of a device.
pub(super) fn program(table: &ProgramTable, scope: &Scope, problems: &mut Problems) -> Option<ProgramDef> {
    let mut find = |name: &Option<At<String>>| scope.tag_id(name, problems);
    let (position, pattern, mode) = (find(&table.position), find(&table.pattern), find(&table.mode));
    let command = scope.writable(&table.command, problems);
    if table.steps.is_empty() {
        problems.add(table.at, "a program needs `steps`").label("expected steps = [{ sv = …, ramp = …, soak = … }]");
    }
    let steps: Vec<_> = table.steps.iter().filter_map(|step| step_of(&step.value, scope, problems)).collect();
    let patterns = patterns(table, steps.len(), problems);
    let (position, command) = (position?, command?);
    let mut value = |choice: &Option<_>| choice.as_ref().and_then(|choice| number_of(choice, command, problems));
    let (run, halt, off) = (value(&table.run), value(&table.halt), value(&table.off));
    Some(ProgramDef { position, command: command.id, run: run?, halt, off: off?, pattern, patterns, mode, steps })
}

fn step_of(step: &StepTable, scope: &Scope, problems: &mut Problems) -> Option<ProgramStep> {
    let mut find = |name| scope.writable(name, problems).map(|tag| tag.id);
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
