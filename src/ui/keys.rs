//! Keys are tables: dispatch, footer and help are read from the same rows.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::tabs::Tab;
use crate::{plant::role::Role, t, text::translate};

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
    /// The least role that may press it; `None` where every user may.
    pub needs: Option<Role>,
}

impl<A: Copy> Key<A> {
    /// A key for every user.
    pub const fn new(chord: Chord, label: &'static str, help: &'static str, action: A) -> Key<A> {
        Key { chord, label, help, action, needs: None }
    }
    /// The same for users of at least this role.
    pub const fn needs(self, role: Role) -> Key<A> {
        Key { needs: Some(role), ..self }
    }
}

/// What is pressed: a key, alone or with Ctrl.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chord {
    /// The key.
    pub code: KeyCode,
    /// With Ctrl.
    pub ctrl: bool,
}

/// The chords of each page of a tab.
#[cfg(test)]
pub type PageChords = Vec<(&'static str, Vec<Chord>)>;

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
    /// A hint of a window, which the help does not list.
    pub(crate) fn in_window(key: impl Into<String>, label: impl Into<String>) -> Hint {
        Hint::new(key, label, "")
    }
    /// The same for users of at least this role.
    pub fn needs(self, role: Role) -> Hint {
        Hint { needs: Some(role), ..self }
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

/// The chords of a table, for the test that no key means two things.
#[cfg(test)]
pub fn chords_of<A>(table: &[Key<A>]) -> Vec<Chord> {
    table.iter().map(|key| key.chord).collect()
}

/// Takes the keys out of the footer whose actions lack what they need; the help has them all the same.
pub fn hide<A: PartialEq>(table: &mut [Key<A>], lacking: &[(A, bool)]) {
    let is_hidden = |action: &A| lacking.iter().any(|(of, lacks)| *lacks && of == action);
    table.iter_mut().filter(|key| is_hidden(&key.action)).for_each(|key| key.label = "");
}

/// The rows of a table for footer and help.
pub fn hints<A>(table: &[Key<A>]) -> Vec<Hint> {
    table
        .iter()
        .map(|key| Hint {
            needs: key.needs,
            chord: Some(key.chord),
            ..Hint::new(key.chord.name(), translate(key.label), translate(key.help))
        })
        .collect()
}

impl Chord {
    /// As it is pressed.
    pub fn event(self) -> KeyEvent {
        KeyEvent::new(self.code, if self.ctrl { KeyModifiers::CONTROL } else { KeyModifiers::NONE })
    }
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
    /// Save the screen as text and as a picture.
    Dump,
    /// Choose theme, characters, pictures, motion, bell, mouse and language.
    Settings,
    /// Copy what is selected.
    Copy,
    /// Redraw the screen.
    Redraw,
    /// Take the outcome of the last command off the screen.
    Dismiss,
    /// Show a past instant of the plant.
    Replay,
    /// Show a past instant on one page.
    EventPage,
    /// List the bookmarks.
    Bookmarks,
    /// Go to anything by its name.
    Palette,
    /// The tab before.
    Back,
    /// The tab after it again.
    Forward,
    /// Lock this terminal at once.
    Lock,
    /// Show all texts in the next language.
    Language,
}

/// Keys of every tab: first the number keys, which show one.
pub fn global() -> Vec<Key<Global>> {
    let mut shown: Vec<_> =
        Tab::ALL.iter().map(|tab| Key::new(tab.key(), "", tab.help(), Global::Show(*tab))).collect();
    shown.rotate_left(1);
    shown.into_iter().chain(GLOBAL.iter().copied()).collect()
}

/// The other keys of every tab.
const GLOBAL: &[Key<Global>] = &[
    Key::new(code(KeyCode::Tab), "", "next tab", Global::Next),
    Key::new(code(KeyCode::BackTab), "", "previous tab", Global::Previous),
    Key::new(char('a'), "", "acknowledge the selected or most urgent alarm", Global::Acknowledge),
    Key::new(char('A'), "", "acknowledge all alarms (asks first)", Global::AcknowledgeAll),
    Key::new(code(KeyCode::Esc), "", "close a window; dismiss a message; previous page", Global::Dismiss),
    Key::new(char(':'), "go to", "go to any tab, device, tag, alarm, key or past time by its name", Global::Palette),
    Key::new(ctrl('p'), "", "go to anything by its name", Global::Palette),
    Key::new(char('['), "", "back to the tab before", Global::Back),
    Key::new(char(']'), "", "forward again", Global::Forward),
    Key::new(char('@'), "", "replay: the plant as it was at a past time", Global::Replay),
    Key::new(char('!'), "", "event page: mimic, curves, journal, frames, people at one past time", Global::EventPage),
    Key::new(char('\''), "", "bookmarks: past times that were kept under a name", Global::Bookmarks),
    Key::new(ctrl('k'), "", "lock this terminal; works in every window", Global::Lock),
    Key::new(char('L'), "", "change the language of the screens", Global::Language),
    Key::new(ctrl('t'), "", "change the language, in every window too", Global::Language),
    Key::new(ctrl('s'), "", "silence the alarm sound (does not acknowledge)", Global::Silence),
    Key::new(char('P'), "", "save this screen as text, SVG and PNG in the folder of the reports", Global::Dump),
    Key::new(
        code(KeyCode::F(2)),
        "",
        "settings: theme, characters, pictures, motion, bell, mouse, language",
        Global::Settings,
    ),
    Key::new(char('y'), "", "copy what is selected, with its unit, quality and time", Global::Copy),
    Key::new(ctrl('l'), "", "redraw the screen", Global::Redraw),
    Key::new(ctrl('c'), "", "quit (asks first)", Global::Quit),
    Key::new(char('q'), "quit", "quit (asks first, and lists what stops)", Global::Quit),
    Key::new(char('?'), "help", "all keys", Global::Help),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::replay;

    fn assert_no_clash(name: &str, chords: Vec<Chord>) {
        // These mean the same in the past: a time is asked for, a step is made, and Esc leads back.
        let replayed = chords_of(replay::KEYS)
            .into_iter()
            .filter(|chord| ![char('@'), char('['), char(']'), code(KeyCode::Esc)].contains(chord));
        let all: Vec<Chord> = chords.into_iter().chain(chords_of(&global())).chain(replayed).collect();
        for (n, chord) in all.iter().enumerate() {
            assert!(!all[..n].contains(chord), "{name}: {} means two things", chord.name());
        }
    }

    #[test]
    fn no_key_means_two_things_on_one_tab() {
        assert_no_clash("global", vec![]);
        for (page, chords) in Tab::ALL.iter().flat_map(|tab| tab.chords()) {
            assert_no_clash(page, chords);
        }
    }

    #[test]
    fn a_split_escape_sequence_is_no_key() {
        let alt_a = KeyEvent::new(KeyCode::Char('a'), KeyModifiers::ALT);
        assert_eq!(find(&global(), alt_a), None);
        let shifted = KeyEvent::new(KeyCode::Char('A'), KeyModifiers::SHIFT);
        assert_eq!(find(&global(), shifted), Some(Global::AcknowledgeAll));
        let ctrl_a = KeyEvent::new(KeyCode::Char('a'), KeyModifiers::CONTROL);
        assert_eq!(find(&global(), ctrl_a), None);
    }
}
