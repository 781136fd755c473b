//! The mimic tab.

use ratatui::{Frame, layout::Rect};

use crate::{
    history::{Answer, HistoryError},
    plant::snapshot::Snapshot,
    ui::{Act, Cx, keys::Key},
};

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {}

/// Keys of this tab.
pub const KEYS: &[Key<Action>] = &[];

/// State of this tab.
#[derive(Debug)]
pub struct Mimic {}

impl Mimic {
    /// As it is at the start.
    pub fn new(_snapshot: &Snapshot) -> Mimic {
        Mimic {}
    }
    /// A key of [`KEYS`].
    pub fn on_key(&mut self, _cx: &Cx, action: Action) -> Vec<Act> {
        match action {}
    }
    /// News, or time has passed.
    pub fn on_snapshot(&mut self, _cx: &Cx) -> Vec<Act> {
        Vec::new()
    }
    /// The history answered question `number`.
    pub fn on_answer(&mut self, _cx: &Cx, _number: u32, _answer: Result<Answer, HistoryError>) -> Vec<Act> {
        Vec::new()
    }
    /// A key that the plant file defines.
    pub fn on_command_key(&mut self, _cx: &Cx, _event: crossterm::event::KeyEvent) -> Vec<Act> {
        Vec::new()
    }
    /// Keys for footer and help.
    pub fn hints(&self, _cx: &Cx) -> Vec<crate::ui::keys::Hint> {
        crate::ui::keys::hints(KEYS)
    }
    /// The text of an entry window.
    pub fn on_text(&mut self, _cx: &Cx, _text: &str) -> Result<Vec<Act>, String> {
        Ok(Vec::new())
    }
    /// Draws it.
    pub fn view(&self, _cx: &Cx, _frame: &mut Frame, _area: Rect) {}
}
