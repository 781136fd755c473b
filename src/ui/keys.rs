//! Keys are tables: dispatch, footer and help are read from the same rows.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::tabs::Tab;

/// One row of a key table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key<A: 'static> {
    /// What is pressed.
    pub chord: Chord,
    /// Its name in the footer; empty keeps it out of the footer (the help still has it).
    pub label: &'static str,
    /// What it does, for the help.
    pub help: &'static str,
    /// What it means.
    pub action: A,
}

/// What is pressed: a key, alone or with Ctrl.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chord {
    /// The key.
    pub code: KeyCode,
    /// With Ctrl.
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
}

impl Hint {
    /// A hint that is no row of a table (keys that the plant file defines).
    pub fn new(key: impl Into<String>, label: impl Into<String>, help: impl Into<String>) -> Hint {
        Hint { key: key.into(), label: label.into(), help: help.into() }
    }
}

/// The modifier of Ctrl keys.
pub const CONTROL: KeyModifiers = KeyModifiers::CONTROL;

/// A letter or sign as a chord.
pub const fn char(c: char) -> Chord {
    Chord { code: KeyCode::Char(c), ctrl: false }
}
/// Ctrl with a letter.
pub const fn ctrl(c: char) -> Chord {
    Chord { code: KeyCode::Char(c), ctrl: true }
}
/// Any other key.
pub const fn code(code: KeyCode) -> Chord {
    Chord { code, ctrl: false }
}

/// The action of the row that fits what was pressed.
pub fn find<A: Copy>(table: &[Key<A>], event: KeyEvent) -> Option<A> {
    table.iter().find(|key| key.chord.is(event)).map(|key| key.action)
}

/// The rows of a table for footer and help.
pub fn hints<A>(table: &[Key<A>]) -> Vec<Hint> {
    table.iter().map(|key| Hint::new(key.chord.name(), key.label, key.help)).collect()
}

impl Chord {
    /// Was it this? Alt never matches: over a slow line a lone Esc and a letter arrive as Alt with that letter.
    pub fn is(self, event: KeyEvent) -> bool {
        event.code == self.code
            && event.modifiers.contains(KeyModifiers::CONTROL) == self.ctrl
            && !event.modifiers.contains(KeyModifiers::ALT)
    }
    /// Its name on screen.
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

/// What the keys of every tab mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Global {
    /// Show a tab.
    Show(Tab),
    /// Show the next tab.
    Next,
    /// Show the one before.
    Previous,
    /// List the keys.
    Help,
    /// Ask, then leave.
    Quit,
    /// Acknowledge the selected or most urgent alarm.
    Acknowledge,
    /// Ask, then acknowledge all.
    AcknowledgeAll,
    /// End the sound of the alarms that sound now.
    Silence,
    /// Draw everything anew.
    Redraw,
    /// Take the outcome of the last command off the screen.
    Dismiss,
    /// Lock this terminal at once.
    Lock,
}

/// Keys of every tab.
pub const GLOBAL: &[Key<Global>] = &[
    Key { chord: char('1'), label: "", help: "mimic", action: Global::Show(Tab::Mimic) },
    Key { chord: char('2'), label: "", help: "trends", action: Global::Show(Tab::Trends) },
    Key { chord: char('3'), label: "", help: "alarms", action: Global::Show(Tab::Alarms) },
    Key { chord: char('4'), label: "", help: "controllers", action: Global::Show(Tab::Controllers) },
    Key { chord: char('5'), label: "", help: "reports", action: Global::Show(Tab::Reports) },
    Key { chord: char('6'), label: "", help: "bus: lines, frames, tests", action: Global::Show(Tab::Bus) },
    Key {
        chord: char('7'),
        label: "",
        help: "users and audit list: for a Supervisor",
        action: Global::Show(Tab::Users),
    },
    Key { chord: char('8'), label: "", help: "faults: of a simulated plant only", action: Global::Show(Tab::Faults) },
    Key {
        chord: char('0'),
        label: "",
        help: "who sits here: log in, log out, password",
        action: Global::Show(Tab::Login),
    },
    Key { chord: code(KeyCode::Tab), label: "", help: "next tab", action: Global::Next },
    Key { chord: code(KeyCode::BackTab), label: "", help: "previous tab", action: Global::Previous },
    Key {
        chord: char('a'),
        label: "",
        help: "acknowledge the selected or most urgent alarm",
        action: Global::Acknowledge,
    },
    Key { chord: char('A'), label: "", help: "acknowledge all alarms (asks first)", action: Global::AcknowledgeAll },
    Key {
        chord: code(KeyCode::Esc),
        label: "",
        help: "close a window; take a failure off the screen; a page back",
        action: Global::Dismiss,
    },
    Key { chord: ctrl('k'), label: "", help: "lock this terminal; works in every window too", action: Global::Lock },
    Key {
        chord: ctrl('s'),
        label: "",
        help: "silence what sounds now; nothing is acknowledged",
        action: Global::Silence,
    },
    Key { chord: ctrl('l'), label: "", help: "draw everything anew", action: Global::Redraw },
    Key { chord: ctrl('c'), label: "", help: "quit (asks first)", action: Global::Quit },
    Key {
        chord: char('q'),
        label: "quit",
        help: "quit (asks first, and says what stops with it)",
        action: Global::Quit,
    },
    Key { chord: char('?'), label: "help", help: "all keys", action: Global::Help },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::tabs::{alarms, bus, controllers, faults, login, mimic, reports, trends, users};

    fn no_clash(name: &str, chords: Vec<Chord>) {
        let global = GLOBAL.iter().map(|key| key.chord);
        let all: Vec<Chord> = chords.into_iter().chain(global).collect();
        for (n, chord) in all.iter().enumerate() {
            assert!(!all[..n].contains(chord), "{name}: {} means two things", chord.name());
        }
    }

    #[test]
    fn no_key_means_two_things_on_one_tab() {
        fn chords<A>(table: &[Key<A>]) -> Vec<Chord> {
            table.iter().map(|key| key.chord).collect()
        }
        no_clash("global", vec![]);
        no_clash("mimic", chords(mimic::KEYS));
        no_clash("trends", chords(trends::KEYS));
        no_clash("reports", chords(reports::KEYS));
        no_clash("faults", chords(faults::KEYS));
        no_clash("login", chords(login::KEYS));
        no_clash("users", chords(users::LIST));
        no_clash("audit", chords(users::AUDIT));
        let pages = bus::all_chords().into_iter().chain(controllers::all_chords());
        for (page, chords) in pages.chain(alarms::all_chords()) {
            no_clash(page, chords);
        }
    }

    #[test]
    fn a_split_escape_sequence_is_no_key() {
        let alt_a = KeyEvent::new(KeyCode::Char('a'), KeyModifiers::ALT);
        assert_eq!(find(GLOBAL, alt_a), None);
        let shifted = KeyEvent::new(KeyCode::Char('A'), KeyModifiers::SHIFT);
        assert_eq!(find(GLOBAL, shifted), Some(Global::AcknowledgeAll));
        let ctrl_a = KeyEvent::new(KeyCode::Char('a'), KeyModifiers::CONTROL);
        assert_eq!(find(GLOBAL, ctrl_a), None);
    }
}
