//! What the keys of the trends tab are and mean.

use super::window::Direction;
use crate::ui::tabs::prelude::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// So many steps later, or the cursor to the right.
    Side(isize),
    /// Another pen or value; a page is a whole window where curves are shown.
    Move(Motion),
    /// Switch the selected pen on or off.
    Toggle,
    /// Find values by their words.
    Find,
    /// Export the values of the view.
    Csv,
    /// Export the chart.
    Picture,
    /// Curves over time, or another plot.
    Plot,
    /// The pens as large numbers, or the curves.
    Numbers,
    /// The chart as the terminal's own picture.
    Image,
    /// The next look of the selected pen.
    Stroke,
    /// Ask for the scale of the selected pen.
    Scale,
    /// Ask for periods to lay over each other.
    Overlay,
    /// Show the curve of the selected value.
    Open,
    /// A window so many steps longer.
    Zoom(isize),
    /// The window before, or the one that was left by that.
    Revisit(Direction),
    /// Next group of pens.
    Group,
    /// Moving window, or everything since the start of the day.
    Mode,
    /// Next update rate.
    Rate,
    /// Cursor on or off.
    Cursor,
    /// Cursor B on, then which of both is moved.
    CursorB,
    /// The cursor to the next event, or to the one before.
    Event(isize),
    /// The picture stands still, or is live again.
    Hold,
    /// Back to the present.
    Live,
    /// Ask for a time to go to.
    GoTo,
    /// Curves, or the list of all values.
    Values,
    /// Say why the selected value is what it is.
    Why,
}

impl Action {
    /// Does it mean nothing in a replay, whose instant stays in the view with the cursor on it?
    pub fn is_of_present(self) -> bool {
        matches!(
            self,
            Action::Live
                | Action::Mode
                | Action::Hold
                | Action::Cursor
                | Action::Rate
                | Action::GoTo
                | Action::Event(_)
                | Action::Revisit(_)
        )
    }

    /// Does it need a plant: its station, or the window of a tab?
    pub fn is_of_plant(self) -> bool {
        matches!(
            self,
            Action::Why
                | Action::GoTo
                | Action::Find
                | Action::Scale
                | Action::Overlay
                | Action::Event(_)
                | Action::Csv
                | Action::Picture
                | Action::Image
        )
    }
}

/// Keys of this tab.
pub const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "earlier (with the cursor on: cursor to the left)", Action::Side(-1)),
    Key::new(code(KeyCode::Right), "", "later (with the cursor on: cursor to the right)", Action::Side(1)),
    Key::new(code(KeyCode::PageUp), "", "a whole window earlier", Action::Move(Motion::Pages(-1))),
    Key::new(code(KeyCode::PageDown), "", "a whole window later", Action::Move(Motion::Pages(1))),
    Key::new(code(KeyCode::Up), "", "select the pen above", Action::Move(Motion::Rows(-1))),
    Key::new(code(KeyCode::Down), "", "select the pen below", Action::Move(Motion::Rows(1))),
    Key::new(char('l'), "live", "back to the present", Action::Live),
    Key::new(char('p'), "pause", "pause, or back to the present", Action::Hold),
    Key::new(char('t'), "time", "go to a time: 03:12, 2026-11-20, or a period", Action::GoTo),
    Key::new(char('+'), "zoom", "shorter window", Action::Zoom(-1)),
    Key::new(char('='), "", "shorter window", Action::Zoom(-1)),
    Key::new(char('-'), "", "longer window", Action::Zoom(1)),
    Key::new(char('z'), "", "back to the window before the last zoom, step or jump", Action::Revisit(Direction::Back)),
    Key::new(char('Z'), "", "forward to the later window again", Action::Revisit(Direction::Forward)),
    Key::new(char('i'), "picture", "the chart as a picture of the terminal; any key closes it", Action::Image),
    Key::new(char('c'), "cursor", "cursor on or off: reads every pen at one time", Action::Cursor),
    Key::new(
        char('b'),
        "cursor B",
        "cursor B: measures from A to B; again: which one the arrows move",
        Action::CursorB,
    ),
    Key::new(char('n'), "event", "cursor to the next event: alarm, command, note, batch", Action::Event(1)),
    Key::new(char('N'), "", "cursor to the event before", Action::Event(-1)),
    Key::new(char('g'), "group", "next group of pens", Action::Group),
    Key::new(char(' '), "pen", "switch the selected pen on or off", Action::Toggle),
    Key::new(char('s'), "scale", "scale of the selected pen: 0 100, auto, own, own 0 100, plant", Action::Scale),
    Key::new(char('o'), "overlay", "lay periods over each other, as today over yesterday", Action::Overlay),
    Key::new(char('x'), "plot", "curves, x-y plot, histogram, step response, or large numbers", Action::Plot),
    Key::new(char('B'), "", "the pens as large numbers for the wall, or the curves", Action::Numbers),
    Key::new(char('k'), "", "look of the selected pen: steps, lines, dots, bars", Action::Stroke),
    Key::new(char('e'), "export", "write the values of the view as CSV", Action::Csv).needs(Role::Technician),
    Key::new(char('E'), "", "write the chart as SVG and PNG", Action::Picture).needs(Role::Technician),
    Key::new(char('/'), "find", "find values to draw: a filter of the list of all values", Action::Find),
    Key::new(char('v'), "values", "all values with their last hour, or the curves", Action::Values),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Action::Why),
    Key::new(char('m'), "mode", "moving window, or everything since the start of the day", Action::Mode),
    Key::new(char('u'), "rate", "refresh interval of the curves: 0.5, 1, 2, 5, 10 s", Action::Rate),
    Key::new(code(KeyCode::Enter), "", "zoom to the time between the cursors", Action::Open),
];

/// Keys of the list of all values.
pub const LIST: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "curve", "show the curve of the value, or of the marked ones", Action::Open),
    Key::new(char(' '), "mark", "mark the value as a pen, or unmark it", Action::Toggle),
    Key::new(char('/'), "find", "find values to draw: a filter of the list of all values", Action::Find),
    Key::new(char('v'), "curves", "back to the curves", Action::Values),
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Action::Why),
    Key::new(code(KeyCode::Up), "", "a row up", Action::Move(Motion::Rows(-1))),
    Key::new(code(KeyCode::Down), "select", "a row down", Action::Move(Motion::Rows(1))),
    Key::new(code(KeyCode::PageUp), "", "a page up", Action::Move(Motion::Pages(-1))),
    Key::new(code(KeyCode::PageDown), "", "a page down", Action::Move(Motion::Pages(1))),
];
