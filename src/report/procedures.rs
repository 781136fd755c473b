//! Procedures in words: what a step does, how far one has come, and what it writes.

use super::control_runs::{clock, reached};
use crate::{
    plant::{
        Snapshot,
        command::Outcome,
        def::{ProcedureDef, ProcedureId, ProcedureStep, Reference, TagId},
        procedure::{ProcedureEnd, ProcedureRun, ProcedureState, SafeWrite},
        time::elapsed,
    },
    t,
};

/// `step 3 of 14`, `done`, `failed`; empty before the first start.
pub fn state(snapshot: &Snapshot, id: ProcedureId) -> String {
    let Some(run) = run_of(snapshot, id) else { return String::new() };
    match (&run.state, run.step) {
        (ProcedureState::Running, step) => {
            let (step, count) = (step.unwrap_or_default() + 1, snapshot.def.procedure(id).steps.len());
            t!("step {step} of {count}", step, count)
        }
        (ProcedureState::WritingSafeState(_), _) => t!("writes safe state").to_owned(),
        (ProcedureState::Ended(_), _) if run.is_safe() == Some(false) => t!("NOT in safe state").to_owned(),
        (ProcedureState::Ended(ProcedureEnd::Done), _) => t!("done").to_owned(),
        (ProcedureState::Ended(ProcedureEnd::Failed(_)), _) => t!("failed").to_owned(),
        (ProcedureState::Ended(ProcedureEnd::Aborted(_)), _) => t!("aborted").to_owned(),
        (ProcedureState::Ended(ProcedureEnd::Interrupted), _) => t!("interrupted").to_owned(),
    }
}

/// How it stands, a sentence a line; what is trouble is marked.
pub fn progress(snapshot: &Snapshot, id: ProcedureId) -> Vec<(String, bool)> {
    let (def, Some(run)) = (snapshot.def.procedure(id), run_of(snapshot, id)) else { return Vec::new() };
    let count = def.steps.len();
    let step = run.step.map(|place| (place + 1, def.steps.get(place).map(|step| step_words(snapshot, step))));
    let mut lines = Vec::new();
    match (run.end(), step) {
        (None, Some((place, words))) => {
            let (words, time) = (words.unwrap_or_default(), time_words(snapshot, def, run));
            lines.push((t!("step {place} of {count}: {words}{time}", place, count, words, time), false));
        }
        (Some(ProcedureEnd::Done) | None, _) => {}
        (Some(end), Some((place, words))) => {
            let words = words.unwrap_or_default();
            lines.push((t!("{end}, at step {place} of {count}: {words}", end, place, count, words), run.is_fault()));
        }
        (Some(end), None) => {
            lines.push((t!("{end}; what was written before is in the audit log", end), run.is_fault()));
        }
    }
    lines.extend(safe_words(snapshot, def, run));
    lines
}

fn run_of(snapshot: &Snapshot, id: ProcedureId) -> Option<&ProcedureRun> {
    snapshot.procedures.get(id.index())?.as_deref()
}

/// How long the step has lasted, and how long it may: `, 3:12 of at most 40:00`.
fn time_words(snapshot: &Snapshot, def: &ProcedureDef, run: &ProcedureRun) -> String {
    let lasted = clock(elapsed(run.since, snapshot.at));
    match run.step.and_then(|place| def.steps.get(place)) {
        Some(ProcedureStep::WaitUntil { limit, .. }) => {
            t!(", {lasted} of at most {limit}", lasted, limit = clock(*limit))
        }
        Some(ProcedureStep::Hold(time)) => t!(", {lasted} of {time}", lasted, time = clock(*time)),
        Some(
            ProcedureStep::Write { .. } | ProcedureStep::BeginMeasurement { .. } | ProcedureStep::EndMeasurement { .. },
        )
        | None => t!(", for {lasted}", lasted),
    }
}

/// What a step does.
pub fn step_words(snapshot: &Snapshot, step: &ProcedureStep) -> String {
    match step {
        ProcedureStep::Write { tag, value } => t!("write {words}", words = write_words(snapshot, (*tag, *value))),
        ProcedureStep::WaitUntil { text, .. } => t!("wait until {text}", text),
        ProcedureStep::Hold(_) => t!("hold").to_owned(),
        ProcedureStep::BeginMeasurement { controller, .. } => {
            t!("begin the measurement of {name}", name = snapshot.def.device(*controller).name)
        }
        ProcedureStep::EndMeasurement { controller } => {
            t!("end the measurement of {name}", name = snapshot.def.device(*controller).name)
        }
    }
}

/// `TIC-1.SV 70.0 °C`.
fn write_words(snapshot: &Snapshot, (tag, value): (TagId, f64)) -> String {
    let (name, unit) = (&snapshot.def.tag(tag).name, snapshot.unit(tag));
    format!("{name} {} {unit}", snapshot.format(tag, value)).trim_end().to_owned()
}

/// Everything that the steps write, each once, in order.
pub fn writes(snapshot: &Snapshot, def: &ProcedureDef) -> Vec<String> {
    let mut all = Vec::new();
    for step in &def.steps {
        let ProcedureStep::Write { tag, value } = step else { continue };
        let words = write_words(snapshot, (*tag, *value));
        if !all.contains(&words) {
            all.push(words);
        }
    }
    all
}

/// The writes of its safe state.
pub fn safe_state(snapshot: &Snapshot, def: &ProcedureDef) -> Vec<String> {
    def.safe.iter().map(|write| write_words(snapshot, *write)).collect()
}

/// The writes of the safe state with their outcomes, the worst first.
fn safe_words(snapshot: &Snapshot, def: &ProcedureDef, run: &ProcedureRun) -> Vec<(String, bool)> {
    if run.safe.is_empty() {
        let interrupted = run.end() == Some(&ProcedureEnd::Interrupted);
        let words = t!("safe state not written: {writes}", writes = safe_state(snapshot, def).join(", "));
        return if interrupted { vec![(words, true)] } else { Vec::new() };
    }
    let is_open = |write: &&SafeWrite| !write.outcome.as_ref().is_some_and(Outcome::is_done);
    let open: Vec<_> = run.safe.iter().filter(is_open).collect();
    if open.is_empty() {
        return vec![(t!("safe state written: {writes}", writes = safe_state(snapshot, def).join(", ")), false)];
    }
    let line = |write: &&SafeWrite| {
        let words = write_words(snapshot, (write.tag, write.value));
        match &write.outcome {
            Some(outcome) => (t!("safe state: {words}: {outcome}", words, outcome), true),
            None => (t!("safe state: {words}: pending", words), false),
        }
    };
    open.iter().map(line).collect()
}

/// First time at SV, steady from, overshoot of a reference.
pub fn reference(reference: &Reference, decimals: u8) -> [String; 3] {
    let overshoot = reference.overshoot.map_or_else(String::new, |over| format!("{over:.*}", usize::from(decimals)));
    [reached(reference.at_sv), reached(reference.steady), overshoot]
}
