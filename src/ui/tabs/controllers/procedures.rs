//! The procedures of the plant file: how each stands, what it measured beside its reference, and the curves over each other.

use super::{runs::figures, sets::some_lines};
use crate::ui::tabs::{
    overlay::{CURVES_MAX, Overlay},
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
/// How often the runs are refreshed, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;
/// Columns and lines that a window of 24 rows has room for.
const ROOM: u16 = 68;
const LINES_MAX: usize = 6;

/// State of the page.
#[derive(Debug, Default)]
pub struct Procedures {
    runs: Answered<Vec<ControlRun>>,
    selected: usize,
}

impl Procedures {
    /// Selects a procedure.
    pub fn select(&mut self, id: ProcedureId) {
        self.selected = id.index();
    }

    pub fn move_by(&mut self, cx: &ViewContext, motion: Motion) {
        self.selected = motion.to(self.selected, cx.def().procedures.len(), room(cx, cx.area.height));
    }

    /// The selected one.
    pub fn id(&self, cx: &ViewContext) -> Option<ProcedureId> {
        (self.selected < cx.def().procedures.len()).then(|| ProcedureId(to_u16(self.selected)))
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

    /// The latest run that a procedure has measured under its own name.
    fn run_of(&self, cx: &ViewContext, def: &ProcedureDef) -> Option<ControlRun> {
        let (controller, label) = def.measured().find(|(_, label)| **label == def.name)?;
        let is_own = |run: &&ControlRun| run.cause == RunCause::Procedure && run.detail == *label;
        // That at work is newer than what the history has answered.
        let live = cx.snapshot.control_run(controller).filter(is_own);
        let name = cx.def().device(controller).name.as_str();
        let mut stored = self.runs.value.iter().flatten().filter(is_own);
        live.cloned().or_else(|| stored.find(|run| &*run.controller == name).cloned())
    }

    /// The latest runs of all procedures that measure the same controller as the selected one, over each other.
    pub fn overlay(&self, cx: &ViewContext) -> Option<Overlay> {
        let selected = cx.def().procedure(self.id(cx)?);
        let (controller, _) = selected.measured().next()?;
        let rule = cx.def().runs.iter().find(|rule| rule.controller == controller)?;
        let same = cx.def().procedures.iter().filter(|def| def.measured().any(|(of, _)| of == controller));
        let measured: Vec<ControlRun> = same.filter_map(|def| self.run_of(cx, def)).take(CURVES_MAX).collect();
        let with_figures = measured.into_iter().map(|run| {
            let figures = figures(&run);
            (run, figures)
        });
        let laid: Vec<_> = with_figures.collect();
        if laid.is_empty() {
            None
        } else {
            Overlay::of_runs(rule, laid.iter().map(|(run, figures)| (run, figures.clone())))
        }
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Vec<UiAction> {
        let to = cx.now + SignedDuration::from_secs(1);
        let query = Query::ControlRuns { controller: None, from: to - SPAN, to, limit: ROWS };
        let number = (Tab::Controllers, number);
        self.runs.ask(cx, number, real(cx, EVERY_S), real(cx, TIMEOUT_S), query).into_iter().collect()
    }

    pub fn awaits(&self, number: u32) -> bool {
        self.runs.query.awaits(number)
    }

    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        self.runs.on_answer(cx, number, answer);
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let (theme, all) = (cx.theme, &cx.def().procedures);
        let (end, height) = (canvas.width().saturating_sub(1), canvas.height());
        let x = canvas.text(1, 0, t!("Procedures"), theme.strong()) + 2;
        let words = match (&self.runs.trouble, cx.snapshot.procedure_at_work()) {
            (Some(trouble), _) => (trouble.clone(), theme.trouble()),
            (None, Some((id, run))) => (
                t!("{name} is running, started by {by}", name = cx.def().procedure(id).name, by = run.by),
                theme.strong(),
            ),
            (None, None) => (t!("one at a time, carried out by the station").to_owned(), theme.normal()),
        };
        canvas.text(x, 0, &fit(&words.0, end.saturating_sub(x)), words.1);
        let (reference, over) = (t!("ref."), t!("over"));
        let names =
            ["", t!("procedure"), t!("state"), t!("at SV"), reference, t!("steady"), reference, over, reference];
        canvas.text(1, 1, &fit(&draw::columns(WIDTHS, names), end), theme.dim());
        let room = room(cx, height);
        for (y, n, def) in on_screen(all, first(self.selected, all.len(), room), room) {
            let (text, is_trouble) = self.row(cx, n, def);
            canvas.text(1, y + 2, &pad(&fit(&text, end), end), row_style(cx, n == self.selected, is_trouble));
        }
        let below = to_u16(room.min(all.len())) + 3..height;
        for (y, (text, is_trouble)) in below.zip(self.details(cx, end.saturating_sub(1))) {
            canvas.text(1, y, &text, if is_trouble { theme.trouble() } else { theme.normal() });
        }
    }

    fn row(&self, cx: &ViewContext, place: usize, def: &ProcedureDef) -> (String, bool) {
        let id = ProcedureId(to_u16(place));
        let mark = if place == self.selected { cx.theme.pick("▸", ">") } else { "" };
        let run = cx.snapshot.procedures.get(place).and_then(Option::as_deref);
        let state = procedures::state(cx.snapshot, id);
        let measured = self.run_of(cx, def);
        let [at_sv, steady, over, ..] = measured.as_ref().map(figures).unwrap_or_default();
        let decimals = measured.as_ref().map_or(1, |run| run.decimals);
        let reference = def.reference.as_ref().map(|reference| procedures::reference(reference, decimals));
        let [at_sv_ref, steady_ref, over_ref] = reference.unwrap_or_default();
        let cells = [mark, &def.name, &state, &at_sv, &at_sv_ref, &steady, &steady_ref, &over, &over_ref];
        (draw::columns(WIDTHS, cells), run.is_some_and(ProcedureRun::is_fault))
    }

    /// The selected one in words.
    fn details(&self, cx: &ViewContext, room: u16) -> Vec<(String, bool)> {
        let Some(id) = self.id(cx) else { return Vec::new() };
        let def = cx.def().procedure(id);
        let mut texts = vec![(def.about.clone(), false)];
        texts.extend(procedures::progress(cx.snapshot, id));
        if let Some(run) = self.run_of(cx, def) {
            let figures = control_runs::figures(&run).join(", ");
            texts.push((
                format!("{}, {}: {figures}", run.label(), moment(run.from, cx.now, &cx.def().time_zone)),
                false,
            ));
            texts.push((run.settings.to_string(), false));
        }
        if let Some(reference) = &def.reference {
            texts.push((t!("reference: {source}", source = reference.source), false));
        }
        let lines =
            |(text, is_trouble): (String, bool)| wrap(&text, room).into_iter().map(move |line| (line, is_trouble));
        texts.into_iter().flat_map(lines).collect()
    }
}

/// Why the page is not shown.
pub fn why_none(cx: &ViewContext) -> &'static str {
    if cx.is_past() { t!("procedures are shown in the present only") } else { t!("this plant has no procedures") }
}

/// Mark, name, state; first at SV, steady and overshoot, each beside the reference.
const WIDTHS: [i16; 9] = [1, 11, 17, -7, -7, -7, -7, -5, -5];

/// Rows of the list on a tab of this height: the rest is about the selected one.
fn room(cx: &ViewContext, height: u16) -> usize {
    let count = cx.def().procedures.len();
    count.min(usize::from(height).saturating_sub(3 + 6)).max(3)
}
