//! The keys of the controllers tab, page by page.

use super::{Controllers, Page, compare::Compare, lamps, sets::Source};
use crate::ui::tabs::prelude::*;

type Key = crate::ui::key_table::Key<Controllers>;

const SELECT: [Key; 6] = motions!("select", Controllers::step);
const SCROLL: [Key; 6] = motions!("scroll", Controllers::step);
const BACK: Key = Key::elsewhere(code(KeyCode::Esc), "back", "previous page");
const GUIDE: Key =
    Key::change(char('h'), "guide", "what P, I, D, fuzzy and tuning do, and what to change", Controllers::show_guide);
const REFRESH: Key = Key::new(
    char('u'),
    "refresh",
    "read all parameters of the device now; retry it at once if it does not respond",
    Controllers::refresh,
)
.when(|tab, cx| Offer::footer_if(!tab.reads_only(cx)))
.needs(Role::Technician);
const WHY: Key = Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", Controllers::why);
const ACTIONS: Key =
    Key::new(char('f'), "actions", "actions of the device (save to memory)", Controllers::choose_action)
        .when(|tab, cx| tab.offer(cx, |device| !device.actions.is_empty()))
        .needs(Role::Technician)
        .writes(Controllers::role_for_actions);
const LINE: Key =
    Key::new(char('D'), "line", "disconnect the device's line, or connect it again (asks first)", Controllers::switch)
        .needs(Role::Technician);
const SETTINGS: Key = Key::new(
    char('c'),
    "settings",
    "communication settings of the device's line: baud rate, parity, timeout …",
    Controllers::open_settings,
)
.when(|tab, cx| Offer::footer_if(!tab.reads_only(cx)));
const PROCEDURES_PAGE: Key = Key::new(
    char('e'),
    "procedures",
    "procedures: steps that the station carries out, and what they measured",
    Controllers::show_procedures,
)
.when(|_, cx| Offer::footer_if(!cx.def().procedures.is_empty() && !cx.is_past()));

const LIST: &[Key] = &[
    Key::change(code(KeyCode::Enter), "open", "faceplate and parameters of the device", |tab, cx| {
        let id = tab.device(cx).map(|device| device.id);
        id.into_iter().for_each(|id| tab.show(id));
    }),
    Key::change(char('v'), "view", "devices as faceplates or as a table", |tab, cx| {
        tab.wall = Some(!tab.is_wall(cx));
    }),
    REFRESH,
    GUIDE,
    WHY,
    SETTINGS,
    PROCEDURES_PAGE,
    LINE,
    Key::change(code(KeyCode::Left), "", "the faceplate to the left", |tab, cx| tab.neighbour(cx, -1)),
    Key::change(code(KeyCode::Right), "", "the faceplate to the right", |tab, cx| tab.neighbour(cx, 1)),
];
const DEVICE_FIRST: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "previous device", |tab, cx| tab.next_device(cx, -1)),
    Key::change(code(KeyCode::Right), "device", "next device", |tab, cx| tab.next_device(cx, 1)),
];
const DEVICE: &[Key] = &[
    Key::new(
        code(KeyCode::Enter),
        "edit",
        "change the parameter, or view a read-only one",
        Controllers::open_parameter,
    )
    .needs(Role::Technician)
    .writes(|tab, cx| tab.role_for(cx, |_| Some(tab.table.tag(cx, tab.device).filter(|tag| tag.writable())?.id))),
    // There is no room left for a key that every operator tries anyway; in the past there is.
    BACK.when(|_, cx| Offer::only_if(cx.is_past() && 1 < cx.def().devices.len())),
    Key::new(
        char('i'),
        "lamps",
        "inputs, outputs and relays as lamps, if the device has them",
        Controllers::open_lamps,
    )
    .when(|tab, cx| tab.offer(cx, |device| lamps::has_any(cx, device))),
    Key::new(char('g'), "program", "the ramp/soak program, if the device has one", Controllers::show_program)
        .when(|tab, cx| tab.offer(cx, |device| device.program.is_some())),
    Key::new(char('s'), "sets", "parameter sets: save, compare, restore, copy", Controllers::show_sets),
    Key::new(char('r'), "runs", "control runs: what each change of SV led to, compared", Controllers::show_runs)
        .when(|tab, cx| tab.offer(cx, |device| cx.snapshot.has_runs(device.id))),
    GUIDE,
    Key::new(char('T'), "tune", "start auto-tuning, or stop it", Controllers::tune)
        .when(|tab, cx| tab.offer(cx, |device| tune(device).is_some()))
        .needs(Role::Technician)
        .writes(|tab, cx| tab.role_for(cx, tune)),
    ACTIONS,
    WHY,
    REFRESH,
    Key::new(char('/'), "find", "filter the parameters by words of name or meaning", listing::ask_filter),
    Key::change(char('d'), "defaults", "mark differences from the factory default", |tab, _| {
        tab.table.defaults = !tab.table.defaults;
    })
    .when(|tab, cx| tab.offer(cx, |device| cx.def().tags_of(device.id).any(|tag| tag.default.is_some()))),
    Key::new(char('S'), "standby", "run or standby, if the device has it", Controllers::toggle_standby)
        .when(|tab, cx| tab.offer(cx, |device| run(device).is_some()))
        .needs(Role::Technician)
        .writes(|tab, cx| tab.role_for(cx, run)),
    PROCEDURES_PAGE,
    LINE,
    SETTINGS,
];
const LAMPS: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "previous device", |tab, cx| tab.show_lamps(cx, -1)),
    Key::change(code(KeyCode::Right), "device", "next device", |tab, cx| tab.show_lamps(cx, 1)),
    REFRESH,
    LINE,
    BACK,
];
const PROGRAM_FIRST: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "the cell to the left", |tab, _| tab.cell.turn(-1)),
    Key::change(code(KeyCode::Right), "cell", "the cell to the right", |tab, _| tab.cell.turn(1)),
];
const PROGRAM: &[Key] = &[
    Key::new(code(KeyCode::Enter), "edit", "change the target or time", |tab, cx| {
        tab.write(cx, |tab, device| tab.cell_tag(device))
    })
    .needs(Role::Technician)
    .writes(|tab, cx| tab.role_for(cx, |device| tab.cell_tag(device))),
    BACK,
    Key::new(char('r'), "run", "run the program, or resume after a hold (asks first)", |tab, cx| {
        tab.control(cx, |program| Some(program.run))
    })
    .needs(Role::Technician)
    .writes(role_to_control),
    Key::new(char('p'), "hold", "hold the program where it is (asks first)", |tab, cx| {
        tab.control(cx, |program| program.halt)
    })
    .when(|tab, cx| tab.offer(cx, |device| device.program.as_ref().is_some_and(|program| program.halt.is_some())))
    .needs(Role::Technician)
    .writes(role_to_control),
    Key::new(char('o'), "off", "stop the program (asks first)", |tab, cx| tab.control(cx, |program| Some(program.off)))
        .needs(Role::Technician)
        .writes(role_to_control),
    Key::new(char('t'), "pattern", "steps to run", |tab, cx| tab.write(cx, |_, device| pattern(device)))
        .needs(Role::Technician)
        .writes(|tab, cx| tab.role_for(cx, pattern)),
    Key::new(char('m'), "mode", "behavior at the end and at power-on", |tab, cx| {
        tab.write(cx, |_, device| mode(device))
    })
    .needs(Role::Technician)
    .writes(|tab, cx| tab.role_for(cx, mode)),
    REFRESH,
    GUIDE,
    Key::new(char('w'), "why", "explain the value: quality, scaling, bytes", |tab, cx| {
        let tag = tab.device(cx).and_then(|device| tab.cell_tag(device));
        Why::open(Why::new(tag.into_iter().collect(), 0))
    }),
];
const SETS: &[Key] = &[
    Key::new(code(KeyCode::Enter), "compare", "what differs between the set and the device", Controllers::compare),
    BACK,
    Key::new(char('n'), "new", "save the settings of the device as a set", Controllers::ask_set_name)
        .needs(Role::Technician),
    Key::new(char('u'), "read", "refresh the list of sets", |_, _| vec![UiAction::Command(CommandKind::ReadSets)])
        .needs(Role::Technician),
    GUIDE,
];
const COMPARE: &[Key] = &[
    Key::new(code(KeyCode::Enter), "restore", "write what differs to the device (asks first)", Controllers::restore)
        .needs(Role::Technician)
        .writes(|tab, cx| tab.compared()?.role_to_restore(cx, tab.device(cx)?)),
    BACK,
    Key::new(char('x'), "stop", "stop after the current write", |tab, _| {
        vec![UiAction::Command(CommandKind::StopRestore(tab.device))]
    })
    .when(|tab, cx| tab.offer(cx, |device| cx.snapshot.restore(device.id).is_some_and(|run| run.at_work())))
    .needs(Role::Technician),
    Key::change(char('='), "all", "show or hide equal settings", |tab, _| {
        if let Some(Page::Compare(compare)) = tab.pages.last_mut() {
            compare.all = !compare.all;
        }
    }),
    Key::new(char('t'), "reverse", "copy in the other direction", Controllers::swap_direction)
        .when(|tab, _| Offer::footer_if(matches!(tab.compared(), Some(Compare { source: Source::Device(_), .. })))),
    ACTIONS,
    REFRESH,
    GUIDE,
];
const RUNS: &[Key] = &[
    Key::change(char('o'), "overlay", "overlay the curves of the marked runs", Controllers::swap_overlay),
    GUIDE,
    BACK,
];
const PROCEDURES: &[Key] = &[
    Key::new(code(KeyCode::Enter), "start", "start the procedure (asks first)", |tab, cx| tab.procedures.start(cx))
        .needs(Role::Technician)
        .writes(Controllers::role_to_start),
    BACK,
    Key::new(char('x'), "abort", "abort the running procedure: the safe state is written at once", |tab, cx| {
        tab.procedures.abort(cx)
    })
    .when(|tab, cx| Offer::footer_if(tab.procedures.to_abort(cx).is_some()))
    .needs(Role::Technician),
    Key::change(
        char('o'),
        "overlay",
        "overlay the curves that the procedures measured last",
        Controllers::swap_overlay,
    ),
    GUIDE,
];
const OVERLAY: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "previous tag", |tab, _| tab.runs.next_tag(-1)),
    Key::change(code(KeyCode::Right), "tag", "next tag", |tab, _| tab.runs.next_tag(1)),
    Key::change(char('o'), "list", "back to the list", Controllers::swap_overlay),
    BACK,
];
const READ: &[Key] = &[
    Key::change(code(KeyCode::Left), "", "previous page", |tab, _| tab.turn(-1)),
    Key::change(code(KeyCode::Right), "page", "next page", |tab, _| tab.turn(1)),
    Key::change(code(KeyCode::Up), "", "previous page", |tab, _| tab.turn(-1)),
    Key::change(code(KeyCode::Down), "", "next page", |tab, _| tab.turn(1)),
    BACK,
];

impl KeyTable for Controllers {
    fn keys(&self, _cx: &ViewContext) -> Keys<Controllers> {
        table(self.page())
    }

    /// Nothing is written or sent on the line of another master, and it has no settings to try.
    fn reads_only(&self, cx: &ViewContext) -> bool {
        self.device(cx).is_some_and(|device| cx.def().listens_on(device.line))
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        let compare = Page::Compare(Compare::new(Source::Set(String::new())));
        let pages = [Page::List, Page::Device, Page::Lamps, Page::Program, Page::Sets, compare];
        let runs = [Page::Runs, Page::Procedures, Page::Overlay, Page::Guide(0)];
        pages.into_iter().chain(runs).map(|page| ("controllers", table(&page).chords())).collect()
    }
}

fn table(page: &Page) -> Keys<Controllers> {
    Keys::of(match page {
        Page::List => &[&SELECT, LIST],
        Page::Device => &[DEVICE_FIRST, &SELECT, DEVICE],
        Page::Lamps => &[LAMPS],
        Page::Program => &[PROGRAM_FIRST, &SELECT, PROGRAM],
        Page::Sets => &[SETS],
        Page::Compare(_) => &[&SCROLL, COMPARE],
        Page::Runs => &[RUNS],
        Page::Procedures => &[PROCEDURES],
        Page::Overlay => &[OVERLAY],
        Page::Guide(_) => &[READ],
    })
}

/// What auto-tuning is written to.
pub(super) fn tune(device: &DeviceDef) -> Option<TagId> {
    device.faceplate.as_ref()?.tune
}

/// What run or standby is written to.
pub(super) fn run(device: &DeviceDef) -> Option<TagId> {
    device.faceplate.as_ref()?.run
}

fn pattern(device: &DeviceDef) -> Option<TagId> {
    device.program.as_ref()?.pattern
}

fn mode(device: &DeviceDef) -> Option<TagId> {
    device.program.as_ref()?.mode
}

fn role_to_control(tab: &Controllers, cx: &ViewContext) -> Option<Role> {
    tab.role_for(cx, |device| Some(device.program.as_ref()?.command))
}
