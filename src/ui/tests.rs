//! Tests of the whole terminal: what an operator sees, and what the keys do; here is what they share.

mod keys;
mod pictures;
mod replay;
mod users;
mod screens;
mod texts;
mod windows;

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::{Terminal, backend::TestBackend, buffer::Buffer};

use super::{Effect, Model, Msg, fixture::Fixture, theme::Theme, update, view};
use crate::{access::SessionRequest, plant::command::CommandKind, text::Language};

/// The languages that every layout is tested in: that of the code, Thai, and one with longer words.
pub const LANGUAGES: [Language; 3] = [Language::ENGLISH, Language::THAI, Language::PSEUDO];

pub fn model(fixture: &Fixture, theme: Theme) -> Model {
    let mut model = Model::new(fixture.snapshot(), theme, 1, crate::ui::fixture::session());
    update(&mut model, Msg::Resize(80, 24));
    model
}

pub fn draw(model: &mut Model, width: u16, height: u16) -> Buffer {
    update(model, Msg::Resize(width, height));
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a test backend");
    terminal.draw(|frame| view(model, frame)).expect("a test backend takes every frame");
    update(model, Msg::Drawn);
    terminal.backend().buffer().clone()
}

pub(crate) use super::screen_dump::text;

/// The screen as text, one line a row.
pub fn screen(model: &mut Model, width: u16, height: u16) -> String {
    text(&draw(model, width, height))
}

/// Types keys: characters as they are, `⏎`, `⎋`, arrows, `⇥` for Tab.
pub fn type_keys(model: &mut Model, keys: &str) -> Vec<Effect> {
    let code = |c| match c {
        '⏎' => KeyCode::Enter,
        '⎋' => KeyCode::Esc,
        '⇥' => KeyCode::Tab,
        '↑' => KeyCode::Up,
        '↓' => KeyCode::Down,
        '←' => KeyCode::Left,
        '→' => KeyCode::Right,
        '\u{8}' => KeyCode::Backspace,
        c => KeyCode::Char(c),
    };
    let press = |c| update(model, Msg::Key(KeyEvent::new(code(c), KeyModifiers::NONE)));
    // That a key was pressed at all is reported to the station now and then.
    let is_sent = |effect: &Effect| !matches!(effect, Effect::SessionRequest(_, SessionRequest::Active));
    keys.chars().flat_map(press).filter(is_sent).collect()
}

/// A key for a row that changed after it was drawn does nothing and says so; once the change is drawn, it acts.
pub fn assert_acts_only_on_what_was_drawn(model: &mut Model, change: impl FnOnce(&mut Model), key: &str) {
    screen(model, 80, 24);
    change(model);
    assert_eq!((type_keys(model, key), &model.modal), (Vec::new(), &None), "{key} acts on a row that was not drawn");
    let shown = screen(model, 80, 24);
    assert!(shown.contains("The list has changed, press again"), "{shown}");
    let effects = type_keys(model, key);
    assert!(!effects.is_empty() || model.modal.is_some(), "{key} does nothing once the change is drawn");
}

pub fn sent_kind(effects: &[Effect]) -> Option<&CommandKind> {
    effects.iter().find_map(|effect| match effect {
        Effect::Command(command, _) => Some(&command.kind),
        Effect::SessionRequest(..) => None,
        Effect::Query(..)
        | Effect::Extension(_)
        | Effect::SaveReport { .. }
        | Effect::SaveNew { .. }
        | Effect::Load { .. }
        | Effect::Append { .. }
        | Effect::Bell
        | Effect::Redraw
        | Effect::Copy(_)
        | Effect::KeepPreferences(..)
        | Effect::Quit => None,
    })
}
