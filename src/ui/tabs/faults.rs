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
        rights, session_lock,
        tabs::bus,
    },
};

/// State of the tab.
#[derive(Debug, Default)]
pub struct Faults {
    /// Which row is selected; headings are not counted.
    selected: usize,
    /// Parameters chosen for faults that are not active.
    numbers: BTreeMap<(FaultTarget, &'static str), InjectedFault>,
    /// The score of the drill is shown instead of the fault.
    verdict: bool,
}

/// What a key does here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select another row.
    Move(Motion),
    /// Select the first row of the next target.
    NextTarget,
    /// Inject or clear the fault.
    Toggle,
    /// Increase the parameter, or decrease it.
    Parameter(bool),
    /// Clear all faults.
    ClearAll,
    /// Points or fault.
    Verdict,
}

/// Keys of this tab.
const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Up), "", "select the fault above", Action::Move(Motion::Rows(-1))),
    Key::new(code(KeyCode::Down), "select", "select the fault below", Action::Move(Motion::Rows(1))),
    Key::new(code(KeyCode::PageDown), "", "select the next line, unit or the process", Action::NextTarget),
    Key::new(code(KeyCode::Enter), "on/off", "inject or clear the fault", Action::Toggle),
    Key::new(code(KeyCode::Left), "", "decrease its parameter", Action::Parameter(false)),
    Key::new(code(KeyCode::Right), "number", "increase its parameter", Action::Parameter(true)),
    Key::new(char('c'), "clear all", "clear all faults", Action::ClearAll),
    Key::new(char('v'), "points", "score of the drill, or the fault", Action::Verdict),
];

impl TabView for Faults {
    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let drill = extension::state::<Status>(cx).is_some_and(|status| status.scenario.is_some());
        let there = KEYS.iter().filter(|key| drill || key.action != Action::Verdict).copied();
        keys::hints(&there.collect::<Vec<_>>())
    }

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

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        keys::find(KEYS, event).map(|action| self.act(cx, action)).unwrap_or_default()
    }

    fn is_offered(cx: &ViewContext) -> bool {
        !session_lock::is_closed(cx.session) && open(cx).is_some()
    }

    #[cfg(test)]
    fn chords() -> keys::PageChords {
        vec![("faults", keys::chords_of(KEYS))]
    }
}

impl Faults {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        let Some(status) = open(cx) else { return Vec::new() };
        let rows = rows(status);
        let Some((target, offered)) = rows.get(self.selected.min(rows.len().saturating_sub(1))).copied() else {
            return Vec::new();
        };
        let fault = self.number(status, target, offered);
        let active = status.find(target, fault).is_some();
        match action {
            Action::Move(motion) => self.selected = motion.to(self.selected, rows.len(), 1),
            Action::NextTarget => {
                self.selected =
                    rows.iter().skip(self.selected).position(|row| row.0 != target).map_or(0, |by| self.selected + by);
            }
            Action::Toggle if active => return cleared(cx, SimCommand::Clear(target, fault)),
            Action::Toggle => return send(SimCommand::Inject(target, fault)),
            Action::Parameter(more) => {
                let other = fault.step(more);
                self.numbers.insert((target, fault.word()), other);
                // An active fault changes at once.
                if active && other != fault {
                    return send(SimCommand::Inject(target, other));
                }
            }
            Action::ClearAll => return cleared(cx, SimCommand::ClearAll),
            Action::Verdict => self.verdict = !self.verdict && status.scenario.is_some(),
        }
        Vec::new()
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
    fn header(&self, cx: &ViewContext) -> Vec<(usize, String, Style)> {
        [demo_part(cx, self)].into_iter().chain(result_part(cx, self)).collect()
    }
}

/// That the plant is simulated, and how many faults are active, which an exam hides.
fn demo_part(cx: &ViewContext, status: &Status) -> (usize, String, Style) {
    match (status.is_open(), status.active.len()) {
        (false, _) => {
            let left = |progress: &Progress| running(progress.duration.saturating_sub(progress.elapsed));
            let left =
                status.scenario.as_ref().map_or(String::new(), |progress| t!(" {left} left", left = left(progress)));
            (2, t!("EXAM{left}", left), cx.theme.strong())
        }
        (true, 0) => (2, t!("DEMO").to_owned(), cx.theme.strong()),
        (true, 1) => (2, t!("DEMO 1 FAULT").to_owned(), cx.theme.trouble()),
        (true, count) => (2, t!("DEMO {count} FAULTS", count), cx.theme.trouble()),
    }
}

/// The result of the drill, once it is over.
fn result_part(cx: &ViewContext, status: &Status) -> Option<(usize, String, Style)> {
    let verdict = status.scenario.as_ref().map(|progress| &progress.verdict).filter(|verdict| verdict.over)?;
    let (words, style) = match verdict.passed() {
        true => (t!("drill PASSED: see 8"), cx.theme.strong()),
        false => (t!("drill FAILED: see 8"), cx.theme.trouble()),
    };
    Some((5, words.to_owned(), style))
}

/// The state of the simulator, unless an exam hides it.
fn open<'a>(cx: &ViewContext<'a>) -> Option<&'a Status> {
    extension::state::<Status>(cx).filter(|status| status.is_open())
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
