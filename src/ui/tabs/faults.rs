//! Tab 8, in demonstrations only: available and active faults, and actual beside displayed values.

mod view;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::ui::tabs::prelude::*;
use crate::{
    sim::{
        drill::{Progress, SimCommand, Status},
        faults::{FaultTarget, InjectedFault},
    },
    ui::{
        Effect,
        extension::{self, Extension, ExtensionMessage},
        rights,
        tabs::bus,
        theme::Theme,
    },
};

#[derive(Debug, Default)]
pub struct Faults {
    /// Which row is selected; headings are not counted.
    selected: usize,
    /// Parameters chosen for faults that are not active.
    numbers: BTreeMap<(FaultTarget, &'static str), InjectedFault>,
    /// The score of the drill is shown instead of the fault.
    verdict: bool,
}

type Key = crate::ui::key_table::Key<Faults>;

const KEYS: &[Key] = &[
    Key::change(code(KeyCode::Up), "", "select the fault above", |faults, cx| faults.step(cx, -1)),
    Key::change(code(KeyCode::Down), "select", "select the fault below", |faults, cx| faults.step(cx, 1)),
    Key::change(code(KeyCode::PageDown), "", "select the next line, unit or the process", Faults::next_target),
    Key::new(code(KeyCode::Enter), "on/off", "inject or clear the fault", Faults::toggle),
    Key::new(code(KeyCode::Left), "", "decrease its parameter", |faults, cx| faults.change_parameter(cx, false)),
    Key::new(code(KeyCode::Right), "number", "increase its parameter", |faults, cx| faults.change_parameter(cx, true)),
    Key::new(char('c'), "clear all", "clear all faults", |_, cx| cleared(cx, SimCommand::ClearAll)),
    Key::change(char('v'), "points", "score of the drill, or the fault", |faults, _| faults.verdict = !faults.verdict)
        .when(|_, cx| {
            Offer::only_if(extension::state::<Status>(cx.extension).is_some_and(|status| status.scenario.is_some()))
        }),
];

impl TabView for Faults {
    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        let Some(status) = open(cx) else { return Rows::default() };
        let rows = rows(status);
        let seen = |(target, fault): &(FaultTarget, InjectedFault)| {
            (format!("{target:?}"), translate(fault.word()), status.find(*target, *fault).is_some())
        };
        Rows::of(rows.iter().map(seen), self.selected.min(rows.len().saturating_sub(1)))
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::view(self, cx, frame, area);
    }

    fn new(_snapshot: &Snapshot) -> Faults {
        Faults::default()
    }
}

impl KeyTable for Faults {
    fn keys(&self, _cx: &ViewContext) -> Keys<Faults> {
        Keys::of(&[KEYS])
    }

    #[cfg(test)]
    fn chords() -> key_table::PageChords {
        vec![("faults", Keys::of(&[KEYS]).chords())]
    }
}

impl Faults {
    fn step(&mut self, cx: &ViewContext, by: isize) {
        let count = open(cx).map_or(0, |status| rows(status).len());
        self.selected = Motion::Rows(by).to(self.selected.min(count.saturating_sub(1)), count, 1);
    }

    fn next_target(&mut self, cx: &ViewContext) {
        let Some((status, target, _)) = self.selected(cx) else { return };
        let rows = rows(status);
        self.selected += rows.iter().skip(self.selected).position(|row| row.0 != target).unwrap_or(0);
    }

    fn toggle(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match self.selected(cx) {
            Some((status, target, fault)) if status.find(target, fault).is_some() => {
                cleared(cx, SimCommand::Clear(target, fault))
            }
            Some((_, target, fault)) => send(SimCommand::Inject(target, fault)),
            None => Vec::new(),
        }
    }

    fn change_parameter(&mut self, cx: &ViewContext, more: bool) -> Vec<UiAction> {
        let Some((status, target, fault)) = self.selected(cx) else { return Vec::new() };
        let other = fault.step(more);
        self.numbers.insert((target, fault.word()), other);
        // An active fault changes at once.
        let changes = other != fault && status.find(target, fault).is_some();
        if changes { send(SimCommand::Inject(target, other)) } else { Vec::new() }
    }

    fn selected<'a>(&self, cx: &ViewContext<'a>) -> Option<(&'a Status, FaultTarget, InjectedFault)> {
        let status = open(cx)?;
        let rows = rows(status);
        let (target, offered) = *rows.get(self.selected.min(rows.len().saturating_sub(1)))?;
        Some((status, target, self.number(status, target, offered)))
    }

    /// The fault with its present or chosen parameter.
    fn number(&self, status: &Status, target: FaultTarget, offered: InjectedFault) -> InjectedFault {
        match status.find(target, offered) {
            Some(active) => active.fault,
            None => self.numbers.get(&(target, offered.word())).copied().unwrap_or(offered),
        }
    }
}

impl Extension for Status {
    fn header(&self, theme: &Theme) -> Vec<(usize, String, Style)> {
        [demo_part(theme, self)].into_iter().chain(result_part(theme, self)).collect()
    }

    /// An exam hides it.
    fn has_tab(&self) -> bool {
        self.is_open()
    }
}

/// That the plant is simulated, and how many faults are active, which an exam hides.
fn demo_part(theme: &Theme, status: &Status) -> (usize, String, Style) {
    match (status.is_open(), status.active.len()) {
        (false, _) => {
            let left = |progress: &Progress| running(progress.duration.saturating_sub(progress.elapsed));
            let left =
                status.scenario.as_ref().map_or(String::new(), |progress| t!(" {left} left", left = left(progress)));
            (2, t!("EXAM{left}", left), theme.strong())
        }
        (true, 0) => (2, t!("DEMO").to_owned(), theme.strong()),
        (true, 1) => (2, t!("DEMO 1 FAULT").to_owned(), theme.trouble()),
        (true, count) => (2, t!("DEMO {count} FAULTS", count), theme.trouble()),
    }
}

/// The result of the drill, once it is over.
fn result_part(theme: &Theme, status: &Status) -> Option<(usize, String, Style)> {
    let verdict = status.scenario.as_ref().map(|progress| &progress.verdict).filter(|verdict| verdict.over)?;
    let (words, style) = match verdict.passed() {
        true => (t!("drill PASSED: see 8"), theme.strong()),
        false => (t!("drill FAILED: see 8"), theme.trouble()),
    };
    Some((5, words.to_owned(), style))
}

/// The state of the simulator, unless an exam hides it.
fn open<'a>(cx: &ViewContext<'a>) -> Option<&'a Status> {
    extension::state::<Status>(cx.extension).filter(|status| status.is_open())
}

fn rows(status: &Status) -> Vec<(FaultTarget, InjectedFault)> {
    status
        .available
        .iter()
        .flat_map(|available| available.faults.iter().map(|fault| (available.target, *fault)))
        .collect()
}

/// Polls silent devices at once, if the user may: they may answer again.
fn cleared(cx: &ViewContext, command: SimCommand) -> Vec<UiAction> {
    let allowed = |act: &UiAction| matches!(act, UiAction::Command(kind) if rights::missing(cx, kind).is_none());
    send(command).into_iter().chain(bus::retry(cx, None).into_iter().filter(allowed)).collect()
}

fn send(command: SimCommand) -> Vec<UiAction> {
    vec![UiAction::Do(Effect::Extension(ExtensionMessage::new(command)))]
}
