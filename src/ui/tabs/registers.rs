//! The registers of a unit, live: every table from any address, each word as all that it may mean.
//!
//! It is the tab of a bench, and a page of the tab Bus in a plant, where it only reads.
//! The tab asks the line for what is on the screen; each answer brings the next query, due one period later.

mod advice;
mod cells;
mod compare;
mod detail;
mod find;
mod keys;
mod layout;
mod likely;
mod lists;
mod page;
mod preview;
mod recognise;
mod save;
mod unit;
mod view;
mod watch;
mod window;
mod writing;

#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, path::PathBuf};

#[cfg(test)]
pub use self::keys::chords_of_page;
pub use self::watch::start::parse_all as parse_watched;
use self::{cells::Cells, recognise::Recognition};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        address::{AddressBase, TABLES},
        live::{AddressSpan, LiveRead, LiveReading, ReplyTimes},
        tag::{ByteOrder, Table},
    },
    profile::OwnProfiles,
    register_map::named::Names,
    ui::Effect,
};

/// An answer that is not there after so long is asked for again: the line has dropped it.
const LOST_AFTER: SignedDuration = SignedDuration::from_secs(15);
#[derive(Debug)]
pub struct Registers {
    /// Where it is shown: what it asks is answered there.
    tab: Tab,
    line: LineId,
    unit: u8,
    table: Table,
    /// The first row of the window.
    first: u16,
    selected: u16,
    order: ByteOrder,
    base: AddressBase,
    period: SignedDuration,
    /// When the next read of the rhythm is due; one that a key asked for before that changes nothing of it.
    due: Option<Timestamp>,
    paused: bool,
    cells: Cells,
    names: Names,
    /// What the plant file calls the registers of this unit.
    names_of_plant: Names,
    /// What the profile that was taken calls them.
    names_of_profile: Names,
    /// Names of the units that were shown before, and those of their profiles.
    names_of: BTreeMap<u8, (Names, Names)>,
    recognition: Recognition,
    /// Of the user.
    pub profiles: OwnProfiles,
    /// What is to be chosen from a list, and what is read for it.
    picking: Option<lists::Picking>,
    listed_spans: Vec<AddressSpan>,
    /// What came of a log, said with the next snapshot.
    said: Option<UiAction>,
    /// A list that was loaded and is not taken yet.
    preview: Option<preview::Preview>,
    /// A list that was pasted, which is read with the next snapshot.
    pasted: Option<String>,
    sent: Vec<SentRead>,
    relearn: bool,
    last: Option<LiveReading>,
    replies: ReplyTimes,
    /// How long the last read took, with its way to this terminal.
    took: SignedDuration,
    /// Reads answered, and requests that they took.
    reads: u64,
    trouble: Option<String>,
    writing: writing::Writing,
    watch: watch::WatchList,
    comparison: Option<compare::Comparison>,
    asking: Asking,
}

/// A read on its way.
#[derive(Debug)]
struct SentRead {
    number: u32,
    /// Steady time.
    at: Timestamp,
    what: ReadFor,
}

/// What a read is for; there is one of each at most.
#[derive(Debug, PartialEq)]
enum ReadFor {
    Window(AddressSpan),
    /// The window of another unit.
    Comparison(AddressSpan),
    Recognition,
    /// What a map of addresses has found, in which this number is looked for.
    Search(String),
}

/// What a text that was entered means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asking {
    Address,
    Unit,
    Value,
    Enable,
    Name,
    Save,
    Profile,
    List,
    Write,
    Compare,
    Log,
}

impl TabView for Registers {
    fn new(snapshot: &Snapshot) -> Registers {
        let device = snapshot.def.devices.first();
        Registers {
            tab: Tab::Registers,
            line: device.map_or(LineId(0), |device| device.line),
            unit: device.map_or(1, |device| device.unit),
            table: Table::Holding,
            first: 0,
            selected: 0,
            order: ByteOrder::Abcd,
            base: AddressBase::Modicon,
            period: SignedDuration::from_secs(1),
            due: None,
            paused: false,
            cells: Cells::default(),
            names: Names::default(),
            names_of_plant: Names::default(),
            names_of_profile: Names::default(),
            names_of: BTreeMap::new(),
            recognition: Recognition::default(),
            profiles: OwnProfiles::default(),
            picking: None,
            listed_spans: Vec::new(),
            said: None,
            preview: None,
            pasted: None,
            sent: Vec::new(),
            relearn: false,
            last: None,
            replies: ReplyTimes::default(),
            took: SignedDuration::ZERO,
            reads: 0,
            trouble: None,
            writing: writing::Writing::default(),
            watch: watch::WatchList::default(),
            comparison: None,
            asking: Asking::Address,
        }
    }

    /// Where a plant file says what the registers mean, the other tabs show them.
    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.list(cx).map_or_else(|| view::copied(self, cx), |list| list.copied(cx))
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.list_mut(cx).is_some_and(|list| list.back(cx)) {
            return true;
        }
        self.watch.close_graph() || self.preview.take().is_some() || self.picking.take().is_some()
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        self.picking.as_ref().map(|picking| picking as &dyn ListPage)
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        self.picking.as_mut().map(|picking| picking as &mut dyn ListPage)
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        if self.watch.has_graph() {
            return watch::graph::view(self, cx, frame, area);
        }
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        match (&self.preview, &self.picking) {
            (Some(_), _) => preview::view(self, cx, &mut canvas),
            (None, Some(picking)) => picking.view(cx, &mut canvas),
            (None, None) => view::view(self, cx, &mut canvas),
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.writing.follow(cx, self.line);
        self.name_by_plant(cx.snapshot);
        let mut actions = self.watch_time(cx);
        self.follow_graph(cx);
        actions.extend(self.recognise(cx));
        // A window closes when a session begins.
        actions.extend(self.said.take_if(|_| cx.session.who.is_some()));
        if let Some(text) = self.pasted.take_if(|_| cx.session.who.is_some()) {
            actions.extend(self.load_list(cx, text.as_bytes()));
        }
        if !self.paused && !self.is_on_way(cx, &ReadFor::Window(self.span(cx))) {
            actions.extend(self.ask(cx, None));
        }
        actions
    }

    fn awaits(&mut self, number: u32) -> bool {
        self.sent.iter().any(|sent| sent.number == number)
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        let Some(sent) = self.sent.iter().position(|sent| sent.number == number) else { return Vec::new() };
        let what = self.sent.swap_remove(sent).what;
        let reading = answer.map(|answer| LiveReading::from_answer(&answer));
        match (what, reading) {
            (ReadFor::Search(text), reading) => {
                reading.ok().flatten().iter().for_each(|reading| self.cells.on_reading(reading));
                self.list_of(cx, lists::PicksOf::Hits(text))
            }
            (ReadFor::Recognition, reading) => self.on_probed(cx, reading.ok().flatten()),
            (ReadFor::Comparison(_), reading) => {
                self.on_compared(reading.ok().flatten());
                Vec::new()
            }
            (ReadFor::Window(_), Ok(reading)) => reading.map_or(Vec::new(), |reading| self.on_window(cx, reading)),
            (ReadFor::Window(_), Err(error)) => {
                self.trouble = Some(error.to_string());
                Vec::new()
            }
        }
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let text = text.trim();
        match self.asking {
            Asking::Address => {
                let (table, address) = self.parse_address(text)?;
                (self.table, self.selected) = (table, address);
                self.first = address;
            }
            Asking::Unit => self.unit_typed(cx, text)?,
            Asking::Compare => self.compare_typed(cx, text)?,
            Asking::Save => return self.save(cx, text),
            Asking::Log => return self.log_typed(text),
            Asking::Profile => return self.save_profile(text),
            Asking::List => {
                return Ok(vec![UiAction::Do(Effect::Load { tab: Tab::Registers, path: PathBuf::from(text) })]);
            }
            Asking::Name => self.name_typed(text)?,
            Asking::Enable => return self.enable_writing(text),
            Asking::Write => return self.write_typed(cx, text),
            Asking::Value => return self.find(cx, text),
        }
        Ok(self.read_now(cx))
    }

    fn on_loaded(&mut self, cx: &ViewContext, result: Result<Vec<u8>, String>) -> Vec<UiAction> {
        match result {
            Ok(bytes) => self.load_list(cx, &bytes),
            Err(why) => vec![save::no_list(why)],
        }
    }

    /// A list that was copied; it is shown with the next snapshot.
    fn on_paste(&mut self, text: &str) {
        self.pasted = Some(text.to_owned());
    }

    fn on_saved(&mut self, _cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.on_written(result)
    }

    fn on_log_failed(&mut self, why: &str) {
        self.watch.on_lost(why);
    }
}

impl Registers {
    /// Reads, in place of an earlier read for the same.
    fn send(&mut self, cx: &ViewContext, what: ReadFor, read: LiveRead) -> UiAction {
        let (number, at) = (cx.numbers.next(), cx.monotonic_now());
        self.sent.retain(|sent| std::mem::discriminant(&sent.what) != std::mem::discriminant(&what));
        self.sent.push(SentRead { number, at, what });
        UiAction::query(self.tab, number, Query::Registers(read))
    }

    /// Is this very read on its way, and not lost?
    fn is_on_way(&self, cx: &ViewContext, what: &ReadFor) -> bool {
        let lost = LOST_AFTER + self.period;
        self.sent.iter().any(|sent| sent.what == *what && cx.monotonic_now().duration_since(sent.at) <= lost)
    }

    fn ask_text(&mut self, asking: Asking, title: &str, hint: &str) -> Vec<UiAction> {
        self.asking = asking;
        vec![UiAction::Open(Modal::Prompt(Prompt::new(title, hint, "")))]
    }
}

fn next<T: PartialEq + Copy>(all: &[T], now: T) -> T {
    let at = all.iter().position(|one| *one == now).unwrap_or(0);
    all[(at + 1) % all.len()]
}
