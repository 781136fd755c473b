//! The keys of the bus tab, page by page.

use super::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// So many pages on.
    Turn(isize),
    /// This page.
    Show(Page),
    /// The next line of the plant.
    NextLine,
    /// Another row.
    Move(Motion),
    /// Opens what is selected.
    Open,
    /// Why the values of the selected block are what they are.
    Why,
    /// Holds the frames still, or lets them run.
    Freeze,
    /// Asks which frames are shown.
    Filter,
    /// Writes the frames to files.
    Save,
    /// Prepares a test.
    Try(Tried),
    /// The last test once more.
    Again,
    /// Stops the test at work.
    Stop,
    /// The communication settings of the line.
    Settings,
    /// Asks the devices that do not answer at once.
    Retry,
    /// Closes the line, or opens it again.
    Line,
}

/// Keys of every page.
const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "previous page", Action::Turn(-1)),
    Key::new(code(KeyCode::Right), "page", "next page", Action::Turn(1)),
    Key::new(char('l'), "", "page Line", Action::Show(Page::Line)),
    Key::new(char('B'), "", "page Plan: the blocks that are read", Action::Show(Page::Plan)),
    Key::new(char('F'), "", "page Frames", Action::Show(Page::Frames)),
    Key::new(char('T'), "", "page Test", Action::Show(Page::Test)),
    Key::new(char('n'), "", "next line of the plant", Action::NextLine),
];
/// Keys of the first page.
const LINE_KEYS: &[Key<Action>] = &[
    Key::new(char('r'), "retry", "retry devices that do not respond, now", Action::Retry).needs(Role::Technician),
    Key::new(char('D'), "connect", "disconnect the line, or connect it again (asks first)", Action::Line)
        .needs(Role::Technician),
    Key::new(char('c'), "settings", "communication settings of the line", Action::Settings),
];
const PLAN_KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "tags", "the tags of the block", Action::Open),
    Key::new(char('w'), "why", "explain the values of the block", Action::Why),
];
const FRAMES_KEYS: &[Key<Action>] = &[
    Key::new(char(' '), "pause", "pause or resume", Action::Freeze),
    Key::new(code(KeyCode::Enter), "decode", "every byte of the frame", Action::Open),
    Key::new(char('f'), "filter", "filter frames", Action::Filter),
    Key::new(char('x'), "save", "save them as text and for Wireshark", Action::Save),
];
const TEST_KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "start", "start the selected test", Action::Open).needs(Role::Technician),
    Key::new(char('t'), "", "enter bytes and send them", Action::Try(Tried::Bytes)),
    Key::new(char('f'), "", "build a request from its fields", Action::Try(Tried::Request)),
    Key::new(char('b'), "", "loopback", Action::Try(Tried::Loopback)),
    Key::new(char('p'), "", "loopback plug", Action::Try(Tried::Plug)),
    Key::new(char('g'), "", "raise or lower RTS or DTR for a time", Action::Try(Tried::Signal)),
    Key::new(char('i'), "", "identify a device", Action::Try(Tried::Identify)),
    Key::new(char('s'), "", "scan for units", Action::Try(Tried::Scan)),
    Key::new(char('m'), "", "map of the addresses that a unit answers at", Action::Try(Tried::Sweep)),
    Key::new(char('r'), "again", "repeat the last test", Action::Again).needs(Role::Technician),
    Key::new(char('x'), "stop", "stop the running test", Action::Stop).needs(Role::Technician),
];

/// The key of the last page, which a bench does not have.
const REGISTERS_KEY: Key<Action> =
    Key::new(char('R'), "", "page Registers: those of the device, live", Action::Show(Page::Registers));

/// The keys of a page here, for the line that is shown.
pub(super) fn table(cx: &ViewContext, page: Page, line: LineId) -> Vec<Key<Action>> {
    let mut keys = all(page);
    keys.retain(|key| key.action != REGISTERS_KEY.action || Page::offered(cx).contains(&Page::Registers));
    // Nothing is sent on the line of another master, and it has no settings to try.
    keys.retain(|key| ![Action::Retry, Action::Settings].contains(&key.action) || !cx.def().listens_on(line));
    keys
}

/// The chords of a page, for the test that no key means two things.
#[cfg(test)]
pub(super) fn chords(page: Page) -> Vec<crate::ui::keys::Chord> {
    let chords = crate::ui::keys::chords_of(&all(page)).into_iter();
    if page != Page::Registers {
        return chords.collect();
    }
    chords.chain(super::super::registers::chords_of_page()).collect()
}

/// The keys of a page: those of every page first.
fn all(page: Page) -> Vec<Key<Action>> {
    let (moves, own) = match page {
        Page::Line => (motions!("scroll", Action::Move), LINE_KEYS),
        Page::Plan => (motions!("select", Action::Move), PLAN_KEYS),
        Page::Frames => (motions!("select", Action::Move), FRAMES_KEYS),
        Page::Test => (motions!("select", Action::Move), TEST_KEYS),
        // Its other keys are those of the registers: the arrows choose the table.
        Page::Registers => return [&KEYS[2..], &[REGISTERS_KEY]].concat(),
    };
    [KEYS, &[REGISTERS_KEY], &moves, own].concat()
}
