//! The keys of the controllers tab, page by page: footer, help and the check for clashes read these rows.

use super::Page;
use crate::ui::tabs::prelude::*;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Show the device so many further on.
    Device(isize),
    /// Select another row, or scroll.
    Move(Motion),
    /// Select so many columns further on.
    Column(isize),
    /// The devices as faceplates, or as a table.
    Wall,
    /// Open, edit or write what is selected.
    Open,
    /// Say why the selected value is what it is.
    Why,
    /// Read everything now.
    Refresh,
    /// Pick one of the device's actions.
    Actions,
    /// Start or stop auto-tuning.
    Tune,
    /// Run or standby.
    Run,
    /// Close the device's line, or open it again.
    Line,
    /// Look at the communication settings of the device's line, and change them.
    Settings,
    /// Its bits as lamps.
    Lamps,
    /// The ramp/soak program.
    Program,
    /// The parameter sets.
    Sets,
    /// The control runs.
    Runs,
    /// The procedures of the plant.
    Procedures,
    /// Abort the one at work.
    Abort,
    /// The curves of the time of the selected run.
    Trend,
    /// Mark it for the overlay, or no longer.
    Mark,
    /// The marked ones over each other, or the list again.
    Overlay,
    /// The curves of another tag.
    Tag(isize),
    /// Only parameters with some words.
    Find,
    /// Mark what differs from the maker's default.
    Defaults,
    /// Words to read about control.
    Guide,
    /// So many pages of them on.
    Turn(isize),
    /// Run, hold or stop the program.
    Control(ProgramCommand),
    /// What the program does at its end.
    Mode,
    /// Which steps it runs.
    Pattern,
    /// Save the settings as a set.
    Save,
    /// Refresh the list of sets.
    ReadSets,
    /// Show what is the same too, or hide it.
    All,
    /// Copy the other way round.
    SwapDirection,
    /// Stop the restore at work.
    Stop,
}

/// What a program is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProgramCommand {
    /// From the beginning, or on from a halt.
    Run,
    /// Stand still.
    Hold,
    /// Back to the fixed setpoint.
    Off,
}

const SELECT: [Key<Action>; 6] = motions!("select", Action::Move);
const SCROLL: [Key<Action>; 6] = motions!("scroll", Action::Move);
const GUIDE: Key<Action> =
    Key::new(char('h'), "guide", "what P, I, D, fuzzy and tuning do, and what to change", Action::Guide);
const REFRESH: Key<Action> = Key::new(
    char('u'),
    "refresh",
    "read all parameters of the device now; retry it at once if it does not respond",
    Action::Refresh,
)
.needs(Role::Technician);
const WHY: Key<Action> = Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Action::Why);
const ACTIONS: Key<Action> =
    Key::new(char('f'), "actions", "actions of the device (save to memory)", Action::Actions).needs(Role::Technician);
const LINE: Key<Action> =
    Key::new(char('D'), "line", "disconnect the device's line, or connect it again (asks first)", Action::Line)
        .needs(Role::Technician);
const SETTINGS: Key<Action> = Key::new(
    char('c'),
    "settings",
    "communication settings of the device's line: baud rate, parity, timeout …",
    Action::Settings,
);

const PROCEDURES_PAGE: Key<Action> = Key::new(
    char('e'),
    "procedures",
    "procedures: steps that the station carries out, and what they measured",
    Action::Procedures,
);

const LIST: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "open", "faceplate and parameters of the device", Action::Open),
    Key::new(char('v'), "view", "devices as faceplates or as a table", Action::Wall),
    REFRESH,
    GUIDE,
    WHY,
    SETTINGS,
    PROCEDURES_PAGE,
    LINE,
    Key::new(code(KeyCode::Left), "", "the faceplate to the left", Action::Column(-1)),
    Key::new(code(KeyCode::Right), "", "the faceplate to the right", Action::Column(1)),
];
const DEVICE_FIRST: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "previous device", Action::Device(-1)),
    Key::new(code(KeyCode::Right), "device", "next device", Action::Device(1)),
];
const DEVICE: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "edit", "change the parameter, or view a read-only one", Action::Open)
        .needs(Role::Technician),
    Key::new(char('i'), "lamps", "inputs, outputs and relays as lamps, if the device has them", Action::Lamps),
    Key::new(char('g'), "program", "the ramp/soak program, if the device has one", Action::Program),
    Key::new(char('s'), "sets", "parameter sets: save, compare, restore, copy", Action::Sets),
    Key::new(char('r'), "runs", "control runs: what each change of SV led to, compared", Action::Runs),
    GUIDE,
    Key::new(char('T'), "tune", "auto-tuning on, or off while it is on", Action::Tune).needs(Role::Technician),
    ACTIONS,
    WHY,
    REFRESH,
    Key::new(char('/'), "find", "show only parameters with some words in name or meaning", Action::Find),
    Key::new(char('d'), "defaults", "mark differences from the factory default", Action::Defaults),
    Key::new(char('S'), "standby", "run or standby, if the device has it", Action::Run).needs(Role::Technician),
    PROCEDURES_PAGE,
    LINE,
    SETTINGS,
];
const LAMPS: &[Key<Action>] = &[REFRESH, LINE];
const PROGRAM_FIRST: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "the cell to the left", Action::Column(-1)),
    Key::new(code(KeyCode::Right), "cell", "the cell to the right", Action::Column(1)),
];
const PROGRAM: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "edit", "change the target or time", Action::Open).needs(Role::Technician),
    Key::new(
        char('r'),
        "run",
        "run the program, or resume after a hold (asks first)",
        Action::Control(ProgramCommand::Run),
    )
    .needs(Role::Technician),
    Key::new(char('p'), "hold", "hold the program where it is (asks first)", Action::Control(ProgramCommand::Hold))
        .needs(Role::Technician),
    Key::new(char('o'), "off", "stop the program (asks first)", Action::Control(ProgramCommand::Off))
        .needs(Role::Technician),
    Key::new(char('t'), "pattern", "steps to run", Action::Pattern).needs(Role::Technician),
    Key::new(char('m'), "mode", "behavior at the end and at power-on", Action::Mode).needs(Role::Technician),
    REFRESH,
    GUIDE,
    WHY,
];
const SETS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "compare", "what differs between the set and the device", Action::Open),
    Key::new(char('n'), "new", "save the settings of the device as a set", Action::Save).needs(Role::Technician),
    Key::new(char('u'), "read", "refresh the list of sets", Action::ReadSets).needs(Role::Technician),
    GUIDE,
];
const COMPARE: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "restore", "write what differs to the device (asks first)", Action::Open)
        .needs(Role::Technician),
    Key::new(char('x'), "stop", "stop after the current write", Action::Stop).needs(Role::Technician),
    Key::new(char('='), "all", "show or hide equal settings", Action::All),
    Key::new(char('t'), "reverse", "copy in the other direction", Action::SwapDirection),
    ACTIONS,
    REFRESH,
    GUIDE,
];
const RUNS: &[Key<Action>] = &[
    Key::new(char('o'), "overlay", "the curves of the marked runs over each other", Action::Overlay),
    Key::new(char(' '), "mark", "mark the run for the overlay", Action::Mark),
    Key::new(char('t'), "trend", "the curves of its time", Action::Trend),
    GUIDE,
];
const PROCEDURES: &[Key<Action>] = &[
    Key::new(code(KeyCode::Enter), "start", "start the procedure (asks first)", Action::Open).needs(Role::Technician),
    Key::new(char('x'), "abort", "abort the procedure at work: the safe state is written at once", Action::Abort)
        .needs(Role::Technician),
    Key::new(char('o'), "overlay", "the curves of what the procedures measured last over each other", Action::Overlay),
    GUIDE,
];
const OVERLAY: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "previous tag", Action::Tag(-1)),
    Key::new(code(KeyCode::Right), "tag", "next tag", Action::Tag(1)),
    Key::new(char('o'), "list", "back to the list", Action::Overlay),
];
const READ: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "previous page", Action::Turn(-1)),
    Key::new(code(KeyCode::Right), "page", "next page", Action::Turn(1)),
    Key::new(code(KeyCode::Up), "", "previous page", Action::Turn(-1)),
    Key::new(code(KeyCode::Down), "", "next page", Action::Turn(1)),
];

/// Gives the keys that write the role that what they write needs.
pub fn needing(keys: Vec<Key<Action>>, role: impl Fn(Action) -> Option<Role>) -> Vec<Key<Action>> {
    let needing = |key: Key<Action>| Key { needs: role(key.action).or(key.needs), ..key };
    keys.into_iter().map(needing).collect()
}

/// The keys of a page.
pub fn page_keys(page: &Page) -> Vec<Key<Action>> {
    match page {
        Page::List => [&SELECT, LIST].concat(),
        Page::Device => [DEVICE_FIRST, &SELECT, DEVICE].concat(),
        Page::Lamps => [DEVICE_FIRST, LAMPS].concat(),
        Page::Program => [PROGRAM_FIRST, &SELECT, PROGRAM].concat(),
        Page::Sets => [&SELECT, SETS].concat(),
        Page::Compare(_) => [&SCROLL, COMPARE].concat(),
        Page::Runs => [&SELECT, RUNS].concat(),
        Page::Procedures => [&SELECT, PROCEDURES].concat(),
        Page::Overlay(_) => OVERLAY.to_vec(),
        Page::Guide(..) => READ.to_vec(),
    }
}
