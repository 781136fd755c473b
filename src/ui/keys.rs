//! What is pressed, and the rows of footer and help that say so.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::{plant::role::Role, t, text::translate};

/// What is pressed: a key, alone or with Ctrl.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chord {
    pub code: KeyCode,
    pub ctrl: bool,
}

/// A row of footer or help: key, label, explanation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hint {
    /// `⏎`.
    pub key: String,
    /// `open`; empty for keys that only the help shows.
    pub label: String,
    /// `open the faceplate of the selected item`.
    pub help: String,
    /// The least role that may press it.
    pub needs: Option<Role>,
    /// The key, where the hint is of one.
    pub chord: Option<Chord>,
}

impl Hint {
    /// A hint that is no row of a table (keys that the plant file defines).
    pub fn new(key: impl Into<String>, label: impl Into<String>, help: impl Into<String>) -> Hint {
        let key = key.into();
        let mut letters = key.chars();
        let chord = match key.as_str() {
            "⏎" => Some(code(KeyCode::Enter)),
            "Tab" => Some(code(KeyCode::Tab)),
            escape if escape == t!("Esc") => Some(code(KeyCode::Esc)),
            _ => letters.next().filter(|_| letters.next().is_none()).map(char),
        };
        Hint { key, label: label.into(), help: help.into(), needs: None, chord }
    }
    /// That of a row of a table.
    pub(super) fn of(chord: Chord, label: &'static str, help: &'static str) -> Hint {
        Hint { chord: Some(chord), ..Hint::new(chord.name(), translate(label), translate(help)) }
    }
    /// A hint of a window, which the help does not list.
    pub(crate) fn in_window(key: impl Into<String>, label: impl Into<String>) -> Hint {
        Hint::new(key, label, "")
    }
    /// The same for users of at least this role.
    pub fn needs(self, role: Role) -> Hint {
        Hint { needs: Some(role), ..self }
    }
}

/// A letter or sign as a chord.
pub const fn char(c: char) -> Chord {
    Chord { code: KeyCode::Char(c), ctrl: false }
}
pub const fn ctrl(c: char) -> Chord {
    Chord { code: KeyCode::Char(c), ctrl: true }
}
/// Any other key.
pub const fn code(code: KeyCode) -> Chord {
    Chord { code, ctrl: false }
}

impl Chord {
    pub fn event(self) -> KeyEvent {
        KeyEvent::new(self.code, if self.ctrl { KeyModifiers::CONTROL } else { KeyModifiers::NONE })
    }
    /// Was it this? Alt never matches: over a slow line a lone Esc and a letter arrive as Alt with that letter.
    pub fn is(self, event: KeyEvent) -> bool {
        event.code == self.code
            && event.modifiers.contains(KeyModifiers::CONTROL) == self.ctrl
            && !event.modifiers.contains(KeyModifiers::ALT)
    }
    pub fn name(self) -> String {
        let name = match self.code {
            KeyCode::Char(' ') => "space".to_owned(),
            KeyCode::Char(c) => c.to_string(),
            KeyCode::F(n) => format!("F{n}"),
            KeyCode::Enter => "⏎".to_owned(),
            KeyCode::Esc => "Esc".to_owned(),
            KeyCode::Tab => "Tab".to_owned(),
            KeyCode::BackTab => "Shift-Tab".to_owned(),
            KeyCode::Up => "↑".to_owned(),
            KeyCode::Down => "↓".to_owned(),
            KeyCode::Left => "←".to_owned(),
            KeyCode::Right => "→".to_owned(),
            KeyCode::PageUp => "PgUp".to_owned(),
            KeyCode::PageDown => "PgDn".to_owned(),
            KeyCode::Home => "Home".to_owned(),
            KeyCode::End => "End".to_owned(),
            other => format!("{other:?}"),
        };
        if self.ctrl { format!("Ctrl-{}", name.to_uppercase()) } else { name }
    }
}
