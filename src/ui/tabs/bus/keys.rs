//! The keys of the bus tab, page by page.

use super::*;
use crate::ui::modal::LineSettings;

type Key = crate::ui::key_table::Key<Bus>;

const MOVE: [Key; 6] = motions!("select", Bus::scroll);
const SCROLL: [Key; 6] = motions!("scroll", Bus::scroll);
const TURN: [Key; 2] = [
    Key::change(code(KeyCode::Left), "", "previous page", |bus, cx| bus.turn(cx, -1)),
    Key::change(code(KeyCode::Right), "page", "next page", |bus, cx| bus.turn(cx, 1)),
];
const PAGES: [Key; 5] = [
    Key::change(char('l'), "", "page Line", |bus, cx| bus.show(cx, Page::Line)),
    Key::change(char('B'), "", "page Plan: the blocks that are read", |bus, cx| bus.show(cx, Page::Plan)),
    Key::change(char('F'), "", "page Frames", |bus, cx| bus.show(cx, Page::Frames)),
    Key::change(char('T'), "", "page Test", |bus, cx| bus.show(cx, Page::Test)),
    Key::change(char('n'), "line", "next line of the plant", |bus, cx| bus.choose_line(cx, 1))
        .when(|_, cx| Offer::footer_if(1 < cx.def().lines.len())),
];
/// The key of the last page, which a bench does not have.
const REGISTERS: [Key; 1] =
    [Key::change(char('R'), "", "page Registers: those of the device, live", |bus, cx| bus.show(cx, Page::Registers))
        .when(|_, cx| Offer::only_if(Page::offered(cx).contains(&Page::Registers)))];

const LINE: &[Key] = &[
    Key::new(char('r'), "retry", "retry devices that do not respond, now", |bus, cx| retry(cx, Some(bus.line)))
        .when(sends)
        .needs(Role::Technician),
    Key::new(char('D'), "connect", "disconnect the line, or connect it again (asks first)", |bus, cx| {
        bus.on_line(cx, |bus, _| open(Modal::Confirm(line_switch::confirm(cx, bus.line))))
    })
    .needs(Role::Technician),
    Key::new(char('c'), "settings", "communication settings of the line", |bus, cx| {
        bus.on_line(cx, |bus, at| {
            let kind = CommandKind::Configure(Box::new(at.settings.clone()));
            let window = Modal::LineSettings(Box::new(LineSettings::new(cx, bus.line)));
            vec![Notice::or(cx, t!("settings of the line"), &kind, window)]
        })
    })
    .when(sends),
];
const PLAN: &[Key] = &[
    Key::new(code(KeyCode::Enter), "tags", "the tags of the block", |bus, cx| bus.plan.open(cx).into_iter().collect()),
    Key::new(char('w'), "why", "explain the values of the block", |bus, cx| bus.plan.why(cx)),
];
const FRAMES: &[Key] = &[
    Key::new(char(' '), "pause", "pause or resume", |bus, cx| {
        bus.on_line(cx, |bus, at| {
            bus.frames.toggle(cx, at);
            Vec::new()
        })
    }),
    Key::new(code(KeyCode::Enter), "decode", "every byte of the frame", |bus, cx| {
        bus.on_line(cx, |bus, at| bus.frames.open(at).into_iter().collect())
    }),
    Key::new(char('f'), "filter", "filter frames", |bus, _| vec![bus.frames.ask_filter()]),
    Key::new(char('x'), "save", "save them as text and for Wireshark", |bus, cx| {
        bus.on_line(cx, |bus, at| bus.frames.save(cx, at))
    }),
];
const TEST: &[Key] = &[
    Key::new(code(KeyCode::Enter), "start", "start the selected test", |bus, cx| bus.try_out(cx, bus.test.selected()))
        .needs(Role::Technician),
    Key::new(char('t'), "", "enter bytes and send them", |bus, cx| bus.try_out(cx, TestKind::Bytes)),
    Key::new(char('f'), "", "build a request from its fields", |bus, cx| bus.try_out(cx, TestKind::Request)),
    Key::new(char('b'), "", "loopback", |bus, cx| bus.try_out(cx, TestKind::Loopback)),
    Key::new(char('p'), "", "loopback plug", |bus, cx| bus.try_out(cx, TestKind::Plug)),
    Key::new(char('g'), "", "raise or lower RTS or DTR for a time", |bus, cx| bus.try_out(cx, TestKind::Signal)),
    Key::new(char('i'), "", "identify a device", |bus, cx| bus.try_out(cx, TestKind::Identify)),
    Key::new(char('s'), "", "scan for units", |bus, cx| bus.try_out(cx, TestKind::Scan)),
    Key::new(char('m'), "", "map of the addresses that a unit answers at", |bus, cx| bus.try_out(cx, TestKind::Sweep)),
    Key::new(char('r'), "again", "repeat the last test", |bus, cx| bus.on_line(cx, |_, at| test::again(cx, at)))
        .needs(Role::Technician),
    Key::new(char('x'), "stop", "stop the running test", |bus, cx| bus.on_line(cx, |_, at| test::stop(at)))
        .when(|bus, cx| Offer::footer_if(LineView::new(cx, bus.line).is_some_and(|at| at.is_testing())))
        .needs(Role::Technician),
];

/// Nothing is sent on the line of another master, and it has no settings to try.
fn sends(bus: &Bus, cx: &ViewContext) -> Offer {
    Offer::only_if(!cx.def().listens_on(bus.line))
}

/// The registers of the device have keys of their own.
const OF_REGISTERS: Below<Bus> = Below {
    hints: |bus, cx| bus.registers.hints(&below(cx)),
    press: |bus, cx, event| bus.registers.press(&below(cx), event),
};

impl KeyTable for Bus {
    fn keys(&self, cx: &ViewContext) -> Keys<Bus> {
        match self.page(cx) {
            Page::Registers if self.registers.has_graph() => Keys::below(&OF_REGISTERS),
            Page::Registers => table(Page::Registers).and(Keys::below(&OF_REGISTERS)),
            page => table(page),
        }
    }

    fn before_key(&mut self) {
        self.frames.dismiss();
    }

    #[cfg(test)]
    fn chords() -> crate::ui::key_table::PageChords {
        let of_page = |page: &Page| match page {
            Page::Registers => [table(*page).chords(), super::super::registers::chords_of_page()].concat(),
            page => table(*page).chords(),
        };
        Page::ALL.iter().map(|page| (page.title(), of_page(page))).collect()
    }
}

/// The keys of a page: those of every page first.
fn table(page: Page) -> Keys<Bus> {
    Keys::of(match page {
        Page::Line => &[&TURN, &PAGES, &REGISTERS, &SCROLL, LINE],
        Page::Plan => &[&TURN, &PAGES, &REGISTERS, &MOVE, PLAN],
        Page::Frames => &[&TURN, &PAGES, &REGISTERS, &MOVE, FRAMES],
        Page::Test => &[&TURN, &PAGES, &REGISTERS, &MOVE, TEST],
        // The arrows choose the table there.
        Page::Registers => &[&PAGES, &REGISTERS],
    })
}

impl Bus {
    fn on_line(&mut self, cx: &ViewContext, act: impl FnOnce(&mut Bus, &LineView) -> Vec<UiAction>) -> Vec<UiAction> {
        LineView::new(cx, self.line).map_or_else(Vec::new, |at| act(self, &at))
    }

    /// Turns to the page so many further on; of the past there is one.
    fn turn(&mut self, cx: &ViewContext, by: isize) {
        let pages = Page::offered(cx);
        self.show(cx, pages[around(self.page(cx) as usize, by, pages.len())]);
    }

    fn try_out(&mut self, cx: &ViewContext, kind: TestKind) -> Vec<UiAction> {
        self.on_line(cx, |bus, at| bus.test.open(cx, at, kind))
    }
}
