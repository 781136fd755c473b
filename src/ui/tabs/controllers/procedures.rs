//! The procedures of the plant file: how each stands, what it measured beside its reference, and the curves over each other.

use super::{runs::figures, sets::some_lines};
use crate::ui::tabs::{
    overlay::{Kind, Laid, Overlay},
    prelude::*,
};
use crate::{
    plant::{
        control_run::{ControlRun, RunCause},
        def::ProcedureDef,
        procedure::{ProcedureEnd, ProcedureRun},
    },
    report::{control_runs, procedures},
};

/// Runs of one answer, among them those that no procedure has measured.
const ROWS: usize = 200;
/// The list reaches back so far.
const SPAN: SignedDuration = SignedDuration::from_hours(24 * 90);
/// Columns and lines that a window of 24 rows has room for.
const ROOM: u16 = 68;
const LINES_MAX: usize = 6;

pub type Procedures = List<PlantProcedures>;

#[derive(Debug, Default)]
pub struct PlantProcedures;

/// A procedure, and the latest run that it has measured under its own name.
#[derive(Debug, Clone)]
pub struct Procedure {
    id: ProcedureId,
    run: Option<ControlRun>,
}

impl Procedure {
    fn figure<const N: usize>(_cx: &ViewContext, procedure: &Procedure) -> String {
        procedure.run.as_ref().map_or(String::new(), |run| std::mem::take(&mut figures(run)[N]))
    }

    fn reference<const N: usize>(cx: &ViewContext, procedure: &Procedure) -> String {
        let decimals = procedure.run.as_ref().map_or(1, |run| run.decimals);
        let reference = cx.def().procedure(procedure.id).reference.as_ref();
        reference.map_or(String::new(), |known| std::mem::take(&mut procedures::reference(known, decimals)[N]))
    }
}

impl Listing for PlantProcedures {
    type Answer = Vec<ControlRun>;
    type Row = Procedure;
    type Id = ProcedureId;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a Vec<ControlRun>>) -> Heading<'a> {
        let (words, style) = match cx.snapshot.procedure_at_work() {
            Some((id, run)) => (
                t!("{name} is running, started by {by}", name = cx.def().procedure(id).name, by = run.by),
                cx.theme.strong(),
            ),
            None => (t!("one at a time, carried out by the station").to_owned(), cx.theme.normal()),
        };
        Heading::new(t!("Procedures"), t!("this plant has no procedures")).words(words, style)
    }

    fn query(&self, cx: &ViewContext) -> Option<Query> {
        let to = cx.now + SignedDuration::from_secs(1);
        Some(Query::ControlRuns { controller: None, from: to - SPAN, to, limit: ROWS })
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, runs: Option<&'a Vec<ControlRun>>) -> Vec<Cow<'a, Procedure>> {
        let all = cx.def().procedures.iter().enumerate();
        let row = |(n, def)| Procedure { id: ProcedureId(to_u16(n)), run: run_of(cx, def, runs) };
        all.map(row).map(Cow::Owned).collect()
    }

    fn id(procedure: &Procedure) -> ProcedureId {
        procedure.id
    }

    fn columns(&self, _cx: &ViewContext, _room: u16) -> Vec<Column<Procedure>> {
        vec![
            left(13, t!("procedure"), |cx, procedure| cx.def().procedure(procedure.id).name.to_string()),
            left(17, t!("state"), |cx, procedure| procedures::state(cx.snapshot, procedure.id)),
            right(7, t!("at SV"), Procedure::figure::<0>),
            right(7, t!("ref."), Procedure::reference::<0>),
            right(7, t!("steady"), Procedure::figure::<1>),
            right(7, t!("ref."), Procedure::reference::<1>),
            right(5, t!("over"), Procedure::figure::<2>),
            right(5, t!("ref."), Procedure::reference::<2>),
        ]
    }

    fn style(&self, cx: &ViewContext, procedure: &Procedure) -> Style {
        let run = cx.snapshot.procedures.get(procedure.id.index()).and_then(Option::as_deref);
        row_style(cx, false, run.is_some_and(ProcedureRun::is_fault))
    }

    fn details(&self, cx: &ViewContext, procedure: &Procedure, _: Option<&Vec<ControlRun>>) -> Vec<(String, Style)> {
        let def = cx.def().procedure(procedure.id);
        let mut texts = vec![(def.about.clone(), false)];
        texts.extend(procedures::progress(cx.snapshot, procedure.id));
        if let Some(run) = &procedure.run {
            let figures = control_runs::figures(run).join(", ");
            let begin = moment(run.from, cx.now, &cx.def().time_zone);
            texts.push((format!("{}, {begin}: {figures}", run.label()), false));
            texts.push((run.settings.to_string(), false));
        }
        if let Some(reference) = &def.reference {
            texts.push((t!("reference: {source}", source = reference.source), false));
        }
        texts.into_iter().map(|(text, is_trouble)| (text, row_style(cx, false, is_trouble))).collect()
    }
}

/// The latest run that a procedure has measured under its own name.
fn run_of(cx: &ViewContext, def: &ProcedureDef, runs: Option<&Vec<ControlRun>>) -> Option<ControlRun> {
    let (controller, label) = def.measured().find(|(_, label)| **label == def.name)?;
    let is_own = |run: &&ControlRun| run.cause == RunCause::Procedure && run.detail == *label;
    // That at work is newer than what the history has answered.
    let live = cx.snapshot.control_run(controller).filter(is_own);
    let name = cx.def().device(controller).name.as_str();
    let mut stored = runs.into_iter().flatten().filter(is_own);
    live.cloned().or_else(|| stored.find(|run| &*run.controller == name).cloned())
}

/// What is done with the selected one.
impl Procedures {
    pub fn id(&self, cx: &ViewContext) -> Option<ProcedureId> {
        self.selected(cx).map(|procedure| procedure.id)
    }

    /// What an abort would end: the one at work, else the selected one where it was interrupted or is not in its safe state.
    pub fn to_abort(&self, cx: &ViewContext) -> Option<ProcedureId> {
        let interrupted = |id: &ProcedureId| {
            let run = cx.snapshot.procedures.get(id.index()).and_then(Option::as_deref);
            let is_open =
                |run: &ProcedureRun| run.is_safe() == Some(false) || run.end() == Some(&ProcedureEnd::Interrupted);
            run.is_some_and(|run| !run.at_work() && is_open(run))
        };
        cx.snapshot.procedure_at_work().map(|(id, _)| id).or_else(|| self.id(cx).filter(interrupted))
    }

    /// The confirmation to start the selected one: all that it would write.
    pub fn start(&self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(id) = self.id(cx) else { return Vec::new() };
        let def = cx.def().procedure(id);
        let (name, count) = (&def.name, def.steps.len());
        if let Some((other, _)) = cx.snapshot.procedure_at_work() {
            let words = t!("procedure {name} is running", name = cx.def().procedure(other).name);
            return open(Modal::Notice(Notice::new(name.to_string(), vec![words])));
        }
        let (written, safe) = (procedures::writes(cx.snapshot, def), procedures::safe_state(cx.snapshot, def));
        let prompt = match written.len() {
            0 => t!("Carry out the {count} steps of {name}? They write nothing.", count, name),
            _ => t!("Carry out the {count} steps of {name}? Each write is read back. They write:", count, name),
        };
        let mut notes = some_lines(&[written.join(", ")], ROOM, LINES_MAX);
        let safe = t!("A failure or an abort (x) writes the safe state: {writes}", writes = safe.join(", "));
        notes.extend(some_lines(&[safe], ROOM, LINES_MAX));
        let kind = CommandKind::StartProcedure(id);
        let confirm = Confirm::command(t!("start procedure {name}", name), prompt, kind.clone());
        let confirm = confirm.with_notes(notes).with_reauthentication(cx);
        vec![Notice::or(cx, name, &kind, Modal::Confirm(confirm))]
    }

    /// Ends the one at work, at once: an abort is a stop.
    pub fn abort(&self, cx: &ViewContext) -> Vec<UiAction> {
        self.to_abort(cx).map(|id| UiAction::Command(CommandKind::AbortProcedure(id))).into_iter().collect()
    }

    /// The latest runs of all procedures that measure the same controller as the selected one, over each other.
    pub fn overlay(&self, cx: &ViewContext) -> Option<Overlay> {
        let selected = cx.def().procedure(self.id(cx)?);
        let (controller, _) = selected.measured().next()?;
        let rule = cx.def().runs.iter().find(|rule| rule.controller == controller)?;
        let is_same = |row: &Procedure| cx.def().procedure(row.id).measured().any(|(of, _)| of == controller);
        let rows = self.all(cx);
        let same = rows.iter().filter(|row| is_same(row)).filter_map(|row| row.run.as_ref());
        let laid: Vec<Laid> = same.map(|run| Laid::of_run(run, figures(run))).collect();
        (!laid.is_empty()).then(|| Overlay::new(Kind::Runs, laid, (rule.tags.clone(), 0))).flatten()
    }
}

pub fn why_none(cx: &ViewContext) -> &'static str {
    if cx.is_past() { t!("procedures are shown in the present only") } else { t!("this plant has no procedures") }
}
