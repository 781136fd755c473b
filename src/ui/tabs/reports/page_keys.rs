//! The keys of the report page.

use super::counters;
use crate::ui::tabs::prelude::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The shift so many further on.
    Shift(isize),
    /// The running shift.
    Running,
    /// Any period.
    Free,
    /// Scroll.
    Move(Motion),
    /// Write the CSV.
    Export,
    /// The next format.
    Format,
    /// The other way to write CSV.
    Dialect,
    /// The report as it will be written, or its figures again.
    Preview,
    /// Ask the history again.
    Refresh,
    /// Why the values of the report are what they are now.
    Why,
    /// The list of batches.
    Batches,
    /// The list of automatic reports.
    Made,
    /// The rows of the record.
    Rows,
    /// The other columns of the figures.
    Columns,
    /// Correct what a counter counted.
    Correct,
    /// Show or hide what was not annunciated.
    Quiet,
    /// The chart of the tag so many rows further on.
    Tag(isize),
}

/// Keys of this tab.
const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "earlier", "previous shift", Action::Shift(-1)),
    Key::new(code(KeyCode::Right), "later", "next shift", Action::Shift(1)),
    Key::new(char('l'), "running", "current shift", Action::Running),
    Key::new(char('/'), "period", "any period: from-to, a day, a shift", Action::Free),
    Key::new(char('e'), "export", "write the report to a file", Action::Export).needs(Role::Technician),
    Key::new(char('f'), "format", "next format: CSV, text, HTML, Excel, Word, …", Action::Format),
    Key::new(char('p'), "preview", "the report as text, as it is written", Action::Preview),
    Key::new(char('n'), "rows", "date, time, SV, PV and ER, row by row", Action::Rows),
    Key::new(char(';'), "", "CSV with , and . or with ; and ,", Action::Dialect),
    Key::new(char('r'), "automatic", "the reports that the station makes by itself", Action::Made),
    Key::new(char('t'), "tag", "chart of the next tag (110 columns or more)", Action::Tag(1)),
    Key::new(char('T'), "", "chart of the previous tag", Action::Tag(-1)),
    Key::new(char('c'), "", "the other columns (narrower than 80)", Action::Columns),
    Key::new(char('d'), "", "show or hide the alarm events that were not annunciated", Action::Quiet),
    Key::new(char('u'), "", "refresh the figures", Action::Refresh),
    Key::new(char('w'), "", "explain its current values", Action::Why),
];

/// The key of a plant that makes batches.
const BATCHES: &[Key<Action>] = &[Key::new(char('b'), "batches", "the list of batches", Action::Batches)];

/// The key of a plant that counts something.
const COUNTERS: &[Key<Action>] =
    &[Key::new(char('x'), "correct", "correct what a counter counted, with a reason", Action::Correct)
        .needs(Role::Supervisor)];

/// The keys of a plant.
pub(super) fn table(cx: &ViewContext) -> Vec<Key<Action>> {
    let batches = if cx.def().batches.is_empty() { &[] } else { BATCHES };
    let counters = if counters::of_plant(cx).next().is_none() { &[] } else { COUNTERS };
    [KEYS, batches, counters, &motions!("", Action::Move)].concat()
}

/// Those that any plant has.
#[cfg(test)]
pub(super) fn all() -> Vec<Key<Action>> {
    [KEYS, BATCHES, COUNTERS, &motions!("", Action::Move)].concat()
}
