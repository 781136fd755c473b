//! The keys of the registers tab.

use super::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Another address.
    Move(Motion),
    /// The table so many further on.
    Table(isize),
    /// Asks for an address.
    GoTo,
    /// Asks for a value.
    Find,
    /// Asks for another unit.
    Unit,
    /// Asks with what to compare, or ends that.
    Compare,
    /// The next byte order.
    Order,
    /// The next way to write addresses.
    Base,
    /// Stops or resumes reading.
    Pause,
    /// A shorter period.
    Faster,
    /// A longer one.
    Slower,
    /// Asks for a sweep: which addresses answer.
    Sweep,
    /// Asks again for what was refused.
    Relearn,
    /// Names of the profile that the unit looks like.
    Names,
    /// Asks for the file of a register list.
    Load,
    /// Asks for the file to save a plant in.
    Save,
    /// Shows what is watched as curves.
    Graph,
    /// Watches the selected register, or no longer.
    Watch,
    /// Asks for its name and type.
    Name,
    /// Begins or ends a log of what is watched.
    Log,
    /// Asks for a value to write.
    Write,
    /// Adds to the selected register.
    Add(i16),
    /// Writes back what was replaced.
    Undo,
    /// Lists what was written.
    Writes,
}

pub(super) const KEYS: &[Key<Action>] = &[
    Key::new(
        code(KeyCode::Right),
        "table",
        "next table: coils, discrete inputs, input and holding registers",
        Action::Table(1),
    ),
    Key::new(code(KeyCode::Left), "", "previous table", Action::Table(-1)),
    Key::new(
        code(KeyCode::Enter),
        "names",
        "take names, units and scales of the device that it looks like",
        Action::Names,
    ),
    Key::new(char('j'), "go to", "go to an address: 1002, 0x3EA, 41003, input:1000", Action::GoTo),
    Key::new(char('/'), "find", "find a value in what was read", Action::Find),
    Key::new(char('o'), "order", "byte order: ABCD, CDAB, BADC, DCBA", Action::Order),
    Key::new(char('b'), "base", "addresses as Modicon numbers, from 0 or from 1", Action::Base),
    Key::new(char(' '), "pause", "pause or resume reading", Action::Pause),
    Key::new(char('+'), "", "read more often", Action::Faster),
    Key::new(char('-'), "", "read less often", Action::Slower),
    Key::new(char('p'), "watch", "watch the selected register, or no longer", Action::Watch),
    Key::new(char('g'), "graph", "graph of what is watched, full screen", Action::Graph),
    Key::new(char('e'), "name", "name, type, scale and unit of the selected register", Action::Name),
    Key::new(char('R'), "log", "begin or end a log of what is watched, as CSV: a row for every read", Action::Log),
    Key::new(
        char('w'),
        "write",
        "write the selected register; asks first, and once whether writing is wanted at all",
        Action::Write,
    )
    .needs(Role::Supervisor),
    Key::new(char('I'), "", "write one more than it holds (asks first)", Action::Add(1)).needs(Role::Supervisor),
    Key::new(char('D'), "", "write one less than it holds (asks first)", Action::Add(-1)).needs(Role::Supervisor),
    Key::new(char('u'), "", "undo the last verified write (asks first)", Action::Undo).needs(Role::Supervisor),
    Key::new(char('W'), "", "list what was written", Action::Writes),
    Key::new(char('N'), "", "load a register list from a manual: CSV or columns; or paste it here", Action::Load),
    Key::new(
        char('S'),
        "save",
        "save what has a name as a plant file: sightglass FILE is then the same device",
        Action::Save,
    ),
    Key::new(char('U'), "unit", "read another unit", Action::Unit),
    Key::new(
        char('c'),
        "compare",
        "compare with another unit, or with this moment later; again to end it",
        Action::Compare,
    ),
    Key::new(char('m'), "map", "map of the addresses that answer, 0 to 65535", Action::Sweep).needs(Role::Technician),
    Key::new(char('r'), "", "ask again for what the unit has refused", Action::Relearn),
];

/// All keys; where a plant file says what may be written and taken away, those that read.
pub(in crate::ui::tabs) fn table(cx: &ViewContext) -> Vec<Key<Action>> {
    if cx.def().is_bench() { [&motions!("", Action::Move), KEYS].concat() } else { of_plant() }
}

/// The keys that read.
pub(super) fn of_plant() -> Vec<Key<Action>> {
    let keys = [&motions!("", Action::Move), KEYS].concat();
    keys.into_iter().filter(|key| key.action.only_reads()).collect()
}

/// The key of the log, which the graph has too.
pub(super) fn log(cx: &ViewContext) -> Vec<Key<Action>> {
    table(cx).into_iter().filter(|key| key.action == Action::Log).collect()
}

impl Action {
    fn only_reads(self) -> bool {
        match self {
            Action::Move(_)
            | Action::Table(_)
            | Action::GoTo
            | Action::Find
            | Action::Unit
            | Action::Compare
            | Action::Order
            | Action::Base
            | Action::Pause
            | Action::Faster
            | Action::Slower
            | Action::Relearn
            | Action::Sweep
            | Action::Graph
            | Action::Watch
            | Action::Name => true,
            Action::Names
            | Action::Load
            | Action::Save
            | Action::Log
            | Action::Write
            | Action::Add(_)
            | Action::Undo
            | Action::Writes => false,
        }
    }
}
