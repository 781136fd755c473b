//! The keys of the registers tab, and of the graph of what is watched.

use super::*;
use crate::ui::modal;
#[cfg(test)]
use crate::ui::tabs::trends;

type Key = crate::ui::key_table::Key<Registers>;

const MOVE: [Key; 6] = motions!("", Registers::scroll);
const TABLES_KEYS: &[Key] = &[
    Key::change(
        code(KeyCode::Right),
        "table",
        "next table: coils, discrete inputs, input and holding registers",
        |registers, _| registers.next_table(1),
    ),
    Key::change(code(KeyCode::Left), "", "previous table", |registers, _| registers.next_table(-1)),
];
const NAMES: &[Key] = &[
    Key::change(
        code(KeyCode::Enter),
        "names",
        "take names, units and scales of the device that it looks like",
        Registers::apply_names,
    ),
    Key::new(
        char('f'),
        "profile",
        "choose a device profile: which fits, and why the others do not",
        Registers::list_profiles,
    ),
];
const LOOK: &[Key] = &[
    Key::new(char('j'), "go to", "go to an address: 1002, 0x3EA, 41003, input:1000", |registers, _| {
        registers.ask_text(Asking::Address, t!("go to address"), t!("1002, 0x3EA, 41003, or input:1000"))
    }),
    Key::new(char('v'), "values", "list everything that has a name, with its value", Registers::list_values),
    Key::new(char('/'), "find", "find a value: every place, type, order and scale that it may have", |registers, _| {
        let hint = t!("a number, as it is or scaled: 702, 70.2, 0x2BE");
        registers.ask_text(Asking::Value, t!("find a value in what was read"), hint)
    }),
    Key::change(char('o'), "order", "byte order: ABCD, CDAB, BADC, DCBA", |registers, _| {
        registers.order = next(&ByteOrder::ALL, registers.order);
    }),
    Key::change(char('b'), "base", "addresses as Modicon numbers, from 0 or from 1", |registers, _| {
        registers.base = next(&[AddressBase::Modicon, AddressBase::Zero, AddressBase::One], registers.base);
    }),
    Key::change(char(' '), "pause", "pause or resume reading", |registers, _| registers.paused = !registers.paused),
    Key::change(char('+'), "", "read more often", |registers, _| registers.change_period(-1)),
    Key::change(char('-'), "", "read less often", |registers, _| registers.change_period(1)),
    Key::new(char('p'), "watch", "watch the selected register, or no longer", |registers, _| registers.toggle_watch()),
    Key::new(char('g'), "graph", "graph of what is watched, full screen", Registers::open_graph),
    Key::new(char('e'), "name", "name, type, scale and unit of the selected register", |registers, _| {
        registers.ask_name()
    }),
];
const LOG: &[Key] = &[Key::new(
    char('R'),
    "log",
    "start or stop a CSV log of the watch list: a row for every read",
    Registers::toggle_log,
)];
const WRITE: &[Key] = &[
    Key::new(
        char('w'),
        "write",
        "write the selected register (asks first, and once to enable writing)",
        |registers, _| registers.ask_write(),
    )
    .needs(Role::Supervisor),
    Key::new(char('I'), "", "write one more than it holds (asks first)", |registers, _| registers.add(1))
        .needs(Role::Supervisor),
    Key::new(char('D'), "", "write one less than it holds (asks first)", |registers, _| registers.add(-1))
        .needs(Role::Supervisor),
    Key::new(char('u'), "", "undo the last verified write (asks first)", |registers, cx| registers.undo(cx))
        .needs(Role::Supervisor),
    Key::new(char('W'), "", "list what was written", |registers, cx| {
        vec![registers.writing.window(cx, &registers.names)]
    }),
    Key::new(char('N'), "", "load a register list from a manual: CSV or columns; or paste it here", |registers, _| {
        let hint = t!("a file: CSV, or columns with address, name, type, scale, unit. Or paste the list into the tab");
        registers.ask_text(Asking::List, t!("load a register list"), hint)
    }),
    Key::new(
        char('S'),
        "save",
        "save what has a name as a plant file: sightglass FILE is then the same device",
        |registers, _| registers.ask_save(),
    ),
];
const UNIT: &[Key] = &[
    Key::new(char('U'), "unit", "read another unit", Registers::ask_unit),
    Key::new(
        char('c'),
        "compare",
        "compare with another unit, or with this moment later; again to end it",
        |registers, _| registers.toggle_comparison(),
    ),
    Key::new(char('m'), "map", "map of the addresses that answer, 0 to 65535", |registers, cx| {
        modal::bus::ask_sweep(cx, registers.line, registers.unit, registers.table)
    })
    .needs(Role::Technician),
    Key::change(char('r'), "", "retry what the unit has refused", |registers, _| registers.relearn = true),
];

const BENCH: &[&[Key]] = &[&MOVE, TABLES_KEYS, NAMES, LOOK, LOG, WRITE, UNIT];
/// Where a plant file says what may be written and taken away, those that read.
const PLANT: &[&[Key]] = &[&MOVE, TABLES_KEYS, LOOK, UNIT];
const BACK: &[Key] = &[Key::elsewhere(code(KeyCode::Esc), "back", "back to the registers")];
/// The keys of the trends, without those that ask the plant.
const GRAPH: Below<Registers> = Below { hints: Registers::graph_hints, press: Registers::press_on_graph };

impl KeyTable for Registers {
    fn keys(&self, cx: &ViewContext) -> Keys<Registers> {
        match (self.watch.has_graph(), cx.def().is_bench()) {
            (true, _) if self.watch.is_shown_log() => Keys::below(&GRAPH),
            (true, true) => Keys::below(&GRAPH).and(Keys::of(&[LOG, BACK])),
            (true, false) => Keys::below(&GRAPH).and(Keys::of(&[BACK])),
            (false, _) if self.preview.is_some() => Keys::of(preview::KEYS),
            (false, _) if self.picking.is_some() => Keys::of(&[lists::KEYS]),
            (false, true) => Keys::of(BENCH),
            (false, false) => Keys::of(PLANT),
        }
    }

    fn after_key(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.follow_list(cx);
        self.read_now(cx)
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        let graph = trends::Trends::chords().into_iter().map(|(_, chords)| {
            let log = Keys::of(&[LOG]).chords();
            ("graph", [chords, log].concat())
        });
        let list = ("list", Keys::of(preview::KEYS).chords());
        let picks = ("picks", listing::all_keys(Keys::<Registers>::of(&[lists::KEYS])).chords());
        [("registers", Keys::of(BENCH).chords()), list, picks].into_iter().chain(graph).collect()
    }
}

/// The chords that read, for the page of the tab Bus.
#[cfg(test)]
pub fn chords_of_page() -> Vec<crate::ui::keys::Chord> {
    Keys::of(PLANT).chords()
}

impl Registers {
    fn next_table(&mut self, by: isize) {
        let at = TABLES.iter().position(|table| *table == self.table).unwrap_or(0);
        self.table = TABLES[around(at, by, TABLES.len())];
    }
}
