//! A set against a device: what differs, why it cannot be written, and how a restore of it goes.

use super::{
    ask,
    sets::{Source, shown, shown_of_set, some_lines, trusted},
};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        interlock::role_to_write,
        parameter_set::{self, Compared, PlannedChange, Problem},
        restore::{Restore, State},
    },
    ui::command_text::outcome_words,
};

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Compare {
    pub source: Source,
    /// The first row shown.
    scroll: Scroll,
    /// Rows that are the same are shown too.
    pub all: bool,
}

/// What can be written, or why not.
type Plan = Result<Vec<PlannedChange>, Vec<Problem>>;

impl Compare {
    pub fn new(source: Source) -> Compare {
        Compare { source, scroll: Scroll::default(), all: false }
    }

    fn rows(&self, cx: &ViewContext, device: &DeviceDef) -> Vec<Compared> {
        let Some(set) = self.source.set(cx) else { return Vec::new() };
        let rows = parameter_set::compare(cx.def(), device.id, &set, &trusted(cx));
        let run = self.at_work(cx, device);
        let written =
            |row: &Compared| run.is_some_and(|run| run.steps.iter().any(|step| Some(step.change.tag) == row.tag));
        rows.into_iter().filter(|row| self.all || (row.set.is_some() && !row.same) || written(row)).collect()
    }

    /// The restore of this very source to this device, at work or the last one.
    fn run<'a>(&self, cx: &ViewContext<'a>, device: &DeviceDef) -> Option<&'a Restore> {
        let run = cx.snapshot.restore(device.id).filter(|run| *run.from == *self.source.words(cx))?;
        let same = match self.source {
            // Another set may have got the name since.
            Source::Set(_) => self.source.set(cx).is_some_and(|set| *set == *run.set),
            // A copy was taken at the moment of its restore, and is of that moment.
            Source::Device(_) => true,
        };
        same.then_some(run)
    }

    /// The same while it has not ended. What it has written later may have changed since, so only then its steps are shown.
    fn at_work<'a>(&self, cx: &ViewContext<'a>, device: &DeviceDef) -> Option<&'a Restore> {
        self.run(cx, device).filter(|run| run.at_work())
    }

    fn plan(&self, cx: &ViewContext, device: &DeviceDef) -> Option<Plan> {
        let set = self.source.set(cx)?;
        Some(parameter_set::plan(cx.def(), device.id, &set, &trusted(cx)))
    }

    pub fn scroll(&mut self, cx: &ViewContext, device: &DeviceDef, motion: Motion, room: usize) {
        self.scroll.on(motion, self.rows(cx, device).len(), room);
    }

    /// The least role that may write all differences; `None` where there is nothing to write.
    pub fn role_to_restore(&self, cx: &ViewContext, device: &DeviceDef) -> Option<Role> {
        let changes = self.plan(cx, device)?.ok()?;
        changes.iter().map(|change| role_to_write(cx.def(), change.tag, change.new)).max()
    }

    /// The confirmation to write the differences, or why they cannot be written.
    pub fn restore(&self, cx: &ViewContext, device: &DeviceDef) -> Result<Confirm, Notice> {
        let words = |words: Vec<String>| Err(Notice::new(device.name.clone(), words));
        if let Some(notice) = Notice::unreachable(cx, device.id) {
            return Err(notice);
        }
        let Some((set, plan)) = self.source.set(cx).zip(self.plan(cx, device)) else {
            return words(vec![t!("{words} no longer exists", words = self.source.words(cx))]);
        };
        let changes = match plan {
            Ok(changes) if changes.is_empty() => {
                return words(vec![t!("nothing differs: nothing to write").to_owned()]);
            }
            Ok(changes) => changes,
            Err(problems) => {
                let mut lines =
                    vec![t!("{words} cannot be written to {name}", words = self.source.words(cx), name = device.name)];
                lines.extend(problems.iter().take(8).map(Problem::to_string));
                return words(lines);
            }
        };
        Ok(ask::confirm_restore(cx, device, &self.source, set, changes))
    }

    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef) {
        let theme = cx.theme;
        let (end, bottom) = (canvas.width().saturating_sub(1), canvas.height().saturating_sub(1));
        let x = canvas.text(1, 0, &format!("{} → {}", self.source.words(cx), device.name), theme.focus());
        let Some(plan) = self.plan(cx, device) else {
            canvas.text(1, 2, t!("it no longer exists"), theme.trouble());
            return;
        };
        let run = self.at_work(cx, device);
        let rows = self.rows(cx, device);
        canvas.text(x + 2, 0, &fit_words(&self.summary(cx, device, &rows), end.saturating_sub(x + 2)), theme.normal());
        let mut top = 1;
        if let (Err(problems), None) = (&plan, run) {
            let words: Vec<String> =
                problems.iter().map(|problem| t!("cannot be written: {problem}", problem)).collect();
            for line in some_lines(&words, end, 3) {
                canvas.text(1, top, &line, theme.trouble());
                top += 1;
            }
        }
        let names = [t!("parameter"), "", t!("in the set"), t!("in the device"), ""];
        canvas.text(1, top + 1, &columns(names, end), theme.dim());
        let room = usize::from(bottom.saturating_sub(top + 3)).max(1);
        let first = self.scroll.first(rows.len(), room);
        for (y, _, row) in on_screen(&rows, first, room) {
            self.row(cx, canvas, top + 2 + y, row, run);
        }
        if rows.is_empty() {
            canvas.text(1, top + 2, t!("nothing differs"), theme.normal());
        }
        let below = rows.len().saturating_sub(first + room);
        if below > 0 {
            canvas.text_right(end, bottom.saturating_sub(1), &t!("{below} more ▼", below), theme.normal());
        }
        if let Some(run) = self.run(cx, device) {
            let (words, trouble) = run_text(cx, device, run);
            canvas.text(1, bottom, &fit_words(&words, end), if trouble { theme.trouble() } else { theme.strong() });
        }
    }

    fn summary(&self, cx: &ViewContext, device: &DeviceDef, shown: &[Compared]) -> String {
        let Some(set) = self.source.set(cx) else { return String::new() };
        let rows = parameter_set::compare(cx.def(), device.id, &set, &trusted(cx));
        let same = rows.iter().filter(|row| row.same).count();
        let differ = rows.iter().filter(|row| row.set.is_some() && !row.same).count();
        let silent = rows.iter().filter(|row| row.set.is_none()).count();
        let silent = if silent > 0 { t!(", {silent} not in the set", silent) } else { String::new() };
        let hidden = if shown.len() < rows.len() { t!(" (=: show all)") } else { "" };
        t!("{differ} differ, {same} the same{silent}{hidden}", differ, same, silent, hidden)
    }

    fn row(&self, cx: &ViewContext, canvas: &mut Canvas, y: u16, row: &Compared, run: Option<&Restore>) {
        let theme = cx.theme;
        let step = run.and_then(|run| run.steps.iter().find(|step| Some(step.change.tag) == row.tag));
        let label = row.tag.map_or(t!("no such setting"), |tag| of_plant(&cx.def().tag(tag).label));
        let (note, trouble) = match (step, run) {
            (Some(step), Some(_)) => match (&step.outcome, step.command) {
                (Some(outcome), _) => outcome_words(outcome),
                (None, Some(_)) => (t!("writing …").to_owned(), false),
                (None, None) => (t!("waiting").to_owned(), false),
            },
            _ if row.set.is_none() => (t!("not in the set").to_owned(), false),
            _ if row.device.is_none() => (t!("unknown now").to_owned(), true),
            _ if row.same => (t!("same").to_owned(), false),
            _ => (t!("differs").to_owned(), false),
        };
        let cells = [row.short.as_str(), label, &shown_of_set(cx, row), &shown(cx, row, row.device), &note];
        let style = match (trouble, row.same && step.is_none()) {
            (true, _) => theme.trouble(),
            (false, true) => theme.dim(),
            (false, false) => theme.normal(),
        };
        canvas.text(1, y, &columns(cells, canvas.width().saturating_sub(1)), style);
    }
}

fn columns([short, label, set, device, note]: [&str; 5], end: u16) -> String {
    let room = end.saturating_sub(9 + 19 + 14 + 14 + 6);
    let cells = draw::columns([9, 19, -14, -14], [short, label, set, device]);
    format!("{cells}  {}", fit(note, room.max(10)))
}

/// How a restore goes, or how it ended.
fn run_text(cx: &ViewContext, device: &DeviceDef, run: &Restore) -> (String, bool) {
    let (done, all) = (run.done(), run.steps.len());
    let (at, by) = (moment(run.at, cx.now, &cx.def().time_zone), &run.by);
    match run.state {
        State::Reading if run.stopping => (t!("stopping: nothing is written yet").to_owned(), true),
        State::Reading => (t!("reading the device first …   x stops").to_owned(), false),
        State::Running if run.stopping => (t!("stopping: {done} of {all} written", done, all), true),
        State::Running => (t!("writing: {done} of {all} written and verified   x stops", done, all), false),
        State::Done => {
            let fix = device.actions.iter().find(|action| action.saves);
            let fix = fix.map_or(String::new(), |action| t!("   f {name} stores them", name = action.name));
            (t!("{all} of {all} written and verified, started {at} by {by}{fix}", all, at, by, fix), false)
        }
        State::Failed if run.refused.is_some() => {
            let why = run.refused.as_ref().map_or(String::new(), ToString::to_string);
            (t!("NOTHING WRITTEN, asked {at} by {by}: {why}", at, by, why), true)
        }
        State::Failed => {
            let failed = run.steps.iter().rev().find_map(|step| Some((step.change.tag, step.outcome.as_ref()?)));
            let why = failed.map_or(String::new(), |(tag, outcome)| {
                format!("{}: {}", cx.def().tag(tag).short, outcome_words(outcome).0)
            });
            (t!("STOPPED after {done} of {all}, {at}; {why}", done, all, at, why), true)
        }
        State::Stopped => {
            (t!("STOPPED by an operator: {done} of {all} written and verified, started {at}", done, all, at), true)
        }
    }
}
