//! The keys of the alarms tab, page by page.

use super::Page;
use crate::ui::tabs::prelude::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select another row, or scroll.
    Move(Motion),
    /// So many views further on.
    View(isize),
    /// The bell rings for new alarms, or not.
    Bell,
    /// Open the guidance of the alarm, whole.
    Open,
    /// Fold the first-out group of the alarm, or show it.
    Fold(bool),
    /// Mark the alarm for what is done with several, or take the mark off.
    Mark,
    /// The next order of the list.
    Sort,
    /// Acknowledge with a note.
    Note,
    /// Acknowledge all that is on this page of the list.
    AcknowledgePage,
    /// Shelve.
    Shelve,
    /// Take out of service.
    OutOfService,
    /// Unshelve, or put back in service.
    PutBack,
    /// Reset a latched alarm.
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
    /// Show or hide what was not annunciated.
    Quiet,
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

const MOVE: [Row; 6] = motions!("select", Action::Move);

const VIEWS: [Row; 3] = [
    Key::new(char('v'), "view", "next view: active, suppressed, system, journal, metrics, handover", Action::View(1)),
    Key::new(char('V'), "", "previous view", Action::View(-1)),
    Key::new(char('b'), "", "bell for new alarms on or off", Action::Bell),
];

const RESET: [Row; 1] =
    [Key::new(char('r'), "reset", "reset a latched alarm whose condition has cleared (asks first)", Action::Reset)
        .needs(Role::Technician)];

const ACTIONS: [Row; 11] = [
    Key::new(char('n'), "note", "acknowledge with a note", Action::Note).needs(Role::Technician),
    Key::new(char('z'), "shelve", "shelve the alarm for a time, with a reason", Action::Shelve).needs(Role::Technician),
    Key::new(char('/'), "filter", "show only alarms with these words; Esc: show all", Action::Words),
    Key::new(char('p'), "page", "acknowledge all on this page of the list (asks first)", Action::AcknowledgePage)
        .needs(Role::Technician),
    Key::new(char(' '), "mark", "mark several alarms: a, n and z act on all marked ones; Esc: no marks", Action::Mark),
    Key::new(code(KeyCode::Right), "expand", "show the consequences of a first-out group", Action::Fold(false)),
    Key::new(code(KeyCode::Left), "fold", "hide the consequences of a first-out group", Action::Fold(true)),
    Key::new(char('s'), "sort", "sort: most urgent first, latest first, by tag", Action::Sort),
    Key::new(
        char('o'),
        "out of service",
        "take the alarm out of service until it is returned, with a reason",
        Action::OutOfService,
    )
    .needs(Role::Supervisor),
    Key::new(char('f'), "", "filter: next priority", Action::Priority),
    Key::new(char('d'), "", "filter: next state", Action::State),
];

const AREA: [Row; 1] = [Key::new(char('g'), "area", "filter: next area", Action::Area)];

const OPEN: [Row; 1] = [Key::new(
    code(KeyCode::Enter),
    "guidance",
    "full guidance; ⏎ again: the faceplate of the alarm source",
    Action::Open,
)];

const GO: [Row; 5] = [
    Key::new(char('m'), "", "go to the mimic, with the source of the alarm selected", Action::Mimic),
    Key::new(char('t'), "", "go to the trend at the time of the alarm", Action::Trend),
    Key::new(char('c'), "", "go to the controller of the alarm", Action::Controller),
    Key::new(char('j'), "journal", "journal of the alarm source", Action::Journal),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Action::Why),
];

const BACK: [Row; 1] =
    [Key::new(char('u'), "return", "unshelve, or return to service", Action::PutBack).needs(Role::Technician)];

const SEARCH: [Row; 2] = [
    Key::new(char('/'), "search", "search by words of tag, message, user; and by time: 06:00-14:00", Action::Words),
    Key::new(char('j'), "list", "back to the list", Action::Journal),
];

const QUIET: [Row; 1] = [Key::new(
    char('d'),
    "by design",
    "show or hide what was not annunciated: suppression by design, events of suppressed alarms",
    Action::Quiet,
)];

const SHIFT: [Row; 3] = [
    Key::new(code(KeyCode::Left), "", "previous shift", Action::Shift(-1)),
    Key::new(code(KeyCode::Right), "shift", "next shift", Action::Shift(1)),
    Key::new(char('l'), "now", "present", Action::Now),
];

const HANDOVER: [Row; 2] = [
    Key::new(char('n'), "hand over", "hand over the plant to the next shift, with a note", Action::HandOver)
        .needs(Role::Technician),
    Key::new(char('o'), "take over", "take over the plant from the previous shift", Action::TakeOver)
        .needs(Role::Technician),
];

/// The keys of a page, the most wanted ones first: these must not fall off a narrow footer.
pub fn table(page: Page) -> Vec<Row> {
    let parts: &[&[Row]] = match page {
        Page::Active | Page::System => &[&RESET, &VIEWS, &OPEN, &ACTIONS, &AREA, &MOVE, &GO],
        Page::Suppressed => &[&BACK, &VIEWS, &OPEN, &MOVE, &GO],
        Page::Journal => &[&SEARCH, &VIEWS, &QUIET, &AREA, &SHIFT, &MOVE],
        Page::Metrics => &[&VIEWS, &SHIFT, &MOVE],
        Page::Handover => &[&HANDOVER, &VIEWS, &SHIFT, &MOVE],
    };
    parts.concat()
}

/// Keys of every tab, but here is where they are looked for.
pub fn everywhere(page: Page) -> Vec<Hint> {
    match page {
        Page::Active | Page::System => vec![
            Hint::new("a", t!("ack"), t!("acknowledge the selected alarm")).needs(Role::Technician),
            Hint::new("A", t!("all"), t!("acknowledge all that are listed (asks first)")).needs(Role::Technician),
        ],
        Page::Suppressed | Page::Journal | Page::Metrics | Page::Handover => Vec::new(),
    }
}
