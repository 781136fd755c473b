//! The keys of the mimic tab.

use crate::ui::tabs::prelude::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Select the next item in a direction (columns, rows).
    Move(i32, i32),
    /// Open the faceplate of the selected item.
    Open,
    /// Say why a value of the selected item is what it is.
    Why,
    /// Open all actuators in one window.
    Actuators,
    /// Stop or start the motion of agitators and arrows.
    Motion,
    /// Show a page so many further on.
    Page(isize),
    /// Show the overview, or the mimic.
    Overview,
    /// Close the line of the selected item, or open it again.
    Line,
}

/// Keys of this tab; the plant file adds its own, and [`super::Mimic::hints`] lists the four arrows as one.
pub const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "", Action::Move(-1, 0)),
    Key::new(code(KeyCode::Right), "", "", Action::Move(1, 0)),
    Key::new(code(KeyCode::Up), "", "", Action::Move(0, -1)),
    Key::new(code(KeyCode::Down), "", "", Action::Move(0, 1)),
    Key::new(code(KeyCode::Enter), "open", "faceplate of the selected item", Action::Open),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Action::Why),
    Key::new(char('C'), "commands", "all valves, pumps and heaters with their commands", Action::Actuators),
    Key::new(char('v'), "overview", "all devices at a glance, or the mimic", Action::Overview),
    Key::new(char('D'), "", "disconnect a line, or connect it again (asks first)", Action::Line)
        .needs(Role::Technician),
    Key::new(char('M'), "", "animation of agitators and arrows on or off", Action::Motion),
    Key::new(code(KeyCode::PageUp), "", "the page before", Action::Page(-1)),
    Key::new(code(KeyCode::PageDown), "page", "the next page of the mimic", Action::Page(1)),
];
