//! The keys of the alarms tab, page by page.

use crossterm::event::KeyCode;

use super::Page;
use crate::ui::keys::{Chord, Hint, Key, char, code, hints};

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select so many rows further on, or scroll.
    Move(isize),
    /// The same by pages.
    Page(isize),
    /// So many views further on.
    View(isize),
    /// The bell rings for new alarms, or not.
    Bell,
    /// Open the guidance of the alarm, whole.
    Open,
    /// Fold or unfold the burst of the alarm.
    Fold,
    /// Acknowledge with a note.
    Note,
    /// Acknowledge all that is on this page of the list.
    AcknowledgePage,
    /// Put aside for a time.
    Shelve,
    /// Put aside until somebody puts it back.
    OutOfService,
    /// Take back what was put aside.
    PutBack,
    /// Let go an alarm that latches.
    Reset,
    /// Type words to filter or to search by.
    Words,
    /// The next priority.
    Priority,
    /// The next state.
    State,
    /// The next area.
    Area,
    /// Say why the value that the alarm watches is what it is.
    Why,
    /// Show what the alarm watches in the mimic.
    Mimic,
    /// Show the curve at the moment of the alarm.
    Trend,
    /// Show the device of the alarm.
    Controller,
    /// The journal of what the alarm watches; from the journal back to the list.
    Journal,
    /// The shift before or after.
    Shift(isize),
    /// The present.
    Now,
    /// Hand over to the next shift.
    HandOver,
    /// Take over from the shift before.
    TakeOver,
}

type Row = Key<Action>;

const fn row(chord: Chord, label: &'static str, help: &'static str, action: Action) -> Row {
    Key { chord, label, help, action }
}

const MOVE: [Row; 6] = [
    row(code(KeyCode::Up), "", "select the row above, or scroll", Action::Move(-1)),
    row(code(KeyCode::Down), "select", "select the row below, or scroll", Action::Move(1)),
    row(code(KeyCode::PageUp), "", "a page up", Action::Page(-1)),
    row(code(KeyCode::PageDown), "", "a page down", Action::Page(1)),
    row(code(KeyCode::Home), "", "first row", Action::Move(-99_999)),
    row(code(KeyCode::End), "", "last row", Action::Move(99_999)),
];

const VIEWS: [Row; 3] = [
    row(char('v'), "view", "next view: active, suppressed, system, journal, metrics, handover", Action::View(1)),
    row(char('V'), "", "view before", Action::View(-1)),
    row(char('b'), "", "bell for new alarms on or off", Action::Bell),
];

const ACTIONS: [Row; 9] = [
    row(char('n'), "note", "acknowledge with a note", Action::Note),
    row(char('z'), "shelve", "shelve the alarm for a time, with a reason", Action::Shelve),
    row(char('/'), "filter", "show only alarms with these words; Esc shows all again", Action::Words),
    row(char('p'), "page", "acknowledge all on this page of the list (asks first)", Action::AcknowledgePage),
    row(char(' '), "unfold", "show or fold away the consequences of a burst", Action::Fold),
    row(char('r'), "reset", "reset a latched alarm whose cause is gone (asks first)", Action::Reset),
    row(
        char('o'),
        "out of service",
        "take the alarm out of service until it is put back, with a reason",
        Action::OutOfService,
    ),
    row(char('f'), "", "filter: next priority", Action::Priority),
    row(char('d'), "", "filter: next state", Action::State),
];

const AREA: [Row; 1] = [row(char('g'), "", "filter: next area", Action::Area)];

const OPEN: [Row; 1] = [row(
    code(KeyCode::Enter),
    "guidance",
    "the guidance in full; ⏎ again: the faceplate of what the alarm watches",
    Action::Open,
)];

const GO: [Row; 5] = [
    row(char('m'), "", "go to the mimic, with what the alarm watches selected", Action::Mimic),
    row(char('t'), "", "go to the trend at the moment of the alarm", Action::Trend),
    row(char('c'), "", "go to the controller of the alarm", Action::Controller),
    row(char('j'), "journal", "journal of what the alarm watches", Action::Journal),
    row(char('w'), "why", "why the value is what it is: quality, scaling, bytes", Action::Why),
];

const BACK: [Row; 1] = [row(char('u'), "put back", "take it back: from the shelf, or into service", Action::PutBack)];

const SEARCH: [Row; 2] = [
    row(char('/'), "search", "search by words of tag, text, user; and by time: 06:00-14:00", Action::Words),
    row(char('j'), "list", "back to the list", Action::Journal),
];

const SHIFT: [Row; 3] = [
    row(code(KeyCode::Left), "", "the shift before", Action::Shift(-1)),
    row(code(KeyCode::Right), "shift", "the shift after", Action::Shift(1)),
    row(char('l'), "now", "the present", Action::Now),
];

const HANDOVER: [Row; 2] = [
    row(char('n'), "hand over", "hand the plant over to the next shift, with a note", Action::HandOver),
    row(char('o'), "take over", "take the plant over from the shift before", Action::TakeOver),
];

/// The keys of a page, the most wanted ones first.
pub fn table(page: Page) -> Vec<Row> {
    let parts: &[&[Row]] = match page {
        Page::Active | Page::System => &[&OPEN, &ACTIONS, &VIEWS, &MOVE, &GO, &AREA],
        Page::Aside => &[&BACK, &OPEN, &VIEWS, &MOVE, &GO],
        Page::Journal => &[&SEARCH, &SHIFT, &VIEWS, &MOVE],
        Page::Metrics => &[&SHIFT, &VIEWS, &MOVE],
        Page::Handover => &[&HANDOVER, &SHIFT, &VIEWS, &MOVE],
    };
    parts.concat()
}

/// The same for footer and help.
pub fn told(page: Page) -> Vec<Hint> {
    let everywhere = match page {
        // Keys of every tab, but here is where they are looked for.
        Page::Active | Page::System => vec![
            Hint::new("a", "ack", "acknowledge the selected alarm"),
            Hint::new("A", "all", "acknowledge all that are listed (asks first)"),
        ],
        Page::Aside | Page::Journal | Page::Metrics | Page::Handover => Vec::new(),
    };
    everywhere.into_iter().chain(hints(&table(page))).collect()
}

/// The chords of every page, for the test that no key means two things.
#[cfg(test)]
pub fn all_chords() -> Vec<(&'static str, Vec<Chord>)> {
    Page::ALL.map(|page| (page.title(), table(page).iter().map(|key| key.chord).collect())).to_vec()
}
