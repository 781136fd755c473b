//! The watch list: registers that are read wherever the window is, with what they have held, and their log as CSV.

pub(super) mod graph;
pub(super) mod start;
mod typed_name;

use std::{collections::VecDeque, path::PathBuf};

use self::typed_name::named;
use super::{
    Asking, Registers,
    view::{is_long_ago, named_text},
};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        fault::Fault,
        live::{AddressSpan, LiveReading},
        number::{to_f32, to_u32},
        sample::{Cause, Quality, Sample},
        tag::{ByteOrder, DataType, Encoding, Table},
    },
    register_map::named::Named,
    report::value_log,
    text::file,
    ui::{Effect, widgets::spark},
};

/// Registers on the list: as many as a read has room for beside the window.
const WATCHED_MAX: usize = 32;
/// Values of each that are remembered: ten hours at one a second.
const SAMPLES_MAX: usize = 36_000;

/// One register of the list; what it is called stands in the names.
#[derive(Debug, Clone, PartialEq)]
struct Watched {
    at: (Table, u16),
    /// What each read has brought, oldest first.
    samples: VecDeque<Sample>,
    good: u32,
    sum: f64,
    least: Exact,
    greatest: Exact,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Log {
    path: PathBuf,
    rows: u64,
}

#[derive(Debug, Default)]
pub struct WatchList {
    items: Vec<Watched>,
    log: Option<Log>,
    /// Why the last log ended by itself.
    lost: Option<String>,
    graph: Option<graph::Graph>,
}

impl WatchList {
    /// Rows on the screen, the rule above them included.
    pub fn height(&self) -> u16 {
        if self.items.is_empty() { 0 } else { to_u16(self.items.len()).saturating_add(1) }
    }

    /// Is a log under way?
    pub fn is_logging(&self) -> bool {
        self.log.is_some()
    }

    /// Writes a row, where a log is under way.
    fn log_row(&mut self, at: Timestamp, cells: Vec<(String, Quality)>) -> Vec<UiAction> {
        let Some(log) = &mut self.log else { return Vec::new() };
        log.rows += 1;
        let bytes = file(|| value_log::row(at, cells.into_iter()));
        vec![UiAction::Do(Effect::Append { tab: Tab::Registers, path: log.path.clone(), bytes, new: false })]
    }

    /// How the log stands, at length and in short, and whether all is well.
    fn log_words(&self) -> Option<([String; 2], bool)> {
        if let Some(why) = &self.lost {
            return Some(([t!("LOG ENDED: {why}", why), t!("LOG ENDED").to_owned()], false));
        }
        let Log { path, rows } = self.log.as_ref()?;
        Some(([t!("logging {path}, {rows} rows", path = path.display(), rows), t!("{rows} rows", rows)], true))
    }

    /// Another unit is shown: its registers are others.
    pub fn clear(&mut self) {
        *self = WatchList::default();
    }

    /// Values of another type or scale are no values of this one.
    pub fn restart(&mut self, at: (Table, u16)) {
        self.items.iter_mut().filter(|item| item.at == at).for_each(|item| *item = Watched::new(at));
    }

    /// A write to the log failed: what it would have held is missing from there on.
    pub fn on_lost(&mut self, why: &str) {
        if self.log.take().is_some() {
            self.lost = Some(why.to_owned());
        }
    }
}

impl Watched {
    fn new(at: (Table, u16)) -> Watched {
        let (least, greatest) = (f64::INFINITY.into(), f64::NEG_INFINITY.into());
        Watched { at, samples: VecDeque::new(), good: 0, sum: 0.0, least, greatest }
    }

    fn push(&mut self, sample: Sample) {
        if self.samples.len() == SAMPLES_MAX {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
        if let Some(value) = sample.good_exact() {
            (self.good, self.sum) = (self.good.saturating_add(1), self.sum + value.near());
            self.least = if value < self.least { value } else { self.least };
            self.greatest = if value > self.greatest { value } else { self.greatest };
        }
    }
}

impl Registers {
    /// Puts the selected register on the list, or takes it off.
    pub(super) fn toggle_watch(&mut self) -> Vec<UiAction> {
        if self.watch.log.is_some() {
            return notice(t!("The list cannot change while it is logged: R ends the log.").to_owned());
        }
        let at = (self.table, self.selected);
        if let Some(index) = self.watch.items.iter().position(|item| item.at == at) {
            self.watch.items.remove(index);
            return Vec::new();
        }
        if self.watch.items.len() == WATCHED_MAX {
            return notice(t!("The list is full: {most} registers.", most = WATCHED_MAX));
        }
        if self.names.get(self.table, self.selected).is_none() {
            self.names.put(self.unnamed());
        }
        self.watch.items.push(Watched::new(at));
        Vec::new()
    }

    /// The selected register by its number: of the type that it looks like.
    fn unnamed(&self) -> Named {
        let (kind, order) = match self.cells.likely(self.table, self.selected) {
            Some(likely) => likely,
            None if self.table.is_bits() => (DataType::Bool, ByteOrder::Abcd),
            None => (DataType::U16, self.order),
        };
        let decimals = if kind == DataType::F32 { 3 } else { 0 };
        let name = self.table.modicon(self.selected);
        Named { decimals, ..Named::new(self.table, self.selected, kind, order, &name) }
    }

    /// Asks for name and type of the selected register.
    pub(super) fn ask_name(&mut self) -> Vec<UiAction> {
        let text = self.names.get(self.table, self.selected).map_or(String::new(), |named| {
            let Named { name, kind, order, scale, unit, .. } = named;
            format!("{name} {} {} {scale} {unit}", kind.name(), order.word())
        });
        let hint = t!("NAME [TYPE] [ORDER] [SCALE] [UNIT]: SV int16 0.1 °C, or energy float32 CDAB kWh");
        self.asking = Asking::Name;
        vec![UiAction::Open(Modal::Prompt(Prompt::new(t!("name of the register"), hint, text.trim_end())))]
    }

    /// Takes a name; an empty text takes it away.
    pub(super) fn name_typed(&mut self, text: &str) -> Result<(), String> {
        if self.watch.log.is_some() {
            return Err(t!("names cannot change while they are logged: R ends the log").to_owned());
        }
        let at = (self.table, self.selected);
        if text.is_empty() {
            self.names.remove(self.table, self.selected);
            self.watch.items.retain(|item| item.at != at);
            return Ok(());
        }
        let named = named(text, self.unnamed())?;
        self.names.put(named);
        self.watch.restart(at);
        Ok(())
    }

    /// What the list reads beside the window.
    pub(super) fn watched_spans(&self, window: AddressSpan) -> impl Iterator<Item = AddressSpan> {
        let span = |item: &Watched| {
            let (table, address) = item.at;
            let count = self.names.get(table, address).map_or(1, Named::count);
            let room = 0x1_0000 - u32::from(address);
            AddressSpan { table, address, count: to_u16(u32::from(count).min(room)) }
        };
        let inside = move |span: &AddressSpan| {
            let (all, own) = (window.range(), span.range());
            span.table == window.table && all.start <= own.start && own.end <= all.end
        };
        self.watch.items.iter().map(span).filter(move |span| !inside(span))
    }

    /// Takes the values of a read, and writes their row where it is due.
    pub(super) fn watch_reading(&mut self, reading: &LiveReading, is_due: bool) -> Vec<UiAction> {
        let Some(at) = reading.parts.iter().map(|part| part.at).max() else { return Vec::new() };
        let mut cells = Vec::new();
        for item in &mut self.watch.items {
            let Some(named) = self.names.get(item.at.0, item.at.1) else { continue };
            let before = item.samples.back().copied().unwrap_or(Sample::bad(Cause::NotRead, at));
            let named = &self.cells.scaled(named);
            let sample = sample(reading, named, Sample { at, ..before });
            item.push(sample);
            cells.push((sample.good_exact().map_or(String::new(), |value| logged(named, value)), sample.quality));
        }
        if is_due { self.watch.log_row(at, cells) } else { Vec::new() }
    }

    /// Ends values that may be others by now, in the graph and, by a row, in the log.
    pub(super) fn watch_time(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let good = |item: &Watched| item.samples.back().copied().filter(|last| last.quality.is_good());
        let is_old = |item: &Watched| good(item).is_some_and(|last| is_long_ago(self, cx, last.at));
        if self.watch.is_shown_log() || !self.watch.items.iter().any(is_old) {
            return Vec::new();
        }
        let latest = self.watch.items.iter().filter_map(|item| item.samples.back()).map(|last| last.at).max();
        let at = latest.and_then(|at| at.checked_add(self.period).ok()).map_or(cx.now, |at| at.min(cx.now));
        for item in &mut self.watch.items {
            if let Some(last) = good(item) {
                item.push(Sample { at, ..last }.uncertain(Cause::Stale));
            }
        }
        let qualities = self.watch.items.iter().filter_map(|item| item.samples.back()).map(|last| last.quality);
        let cells = qualities.map(|quality| (String::new(), quality)).collect();
        self.watch.log_row(at, cells)
    }

    /// Begins a log of the list, or ends it.
    pub(super) fn toggle_log(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.watch.log.take().is_some() {
            return Vec::new();
        }
        if self.watch.items.is_empty() {
            return notice(t!("Nothing is watched yet: p puts the selected register on the list.").to_owned());
        }
        self.asking = Asking::Log;
        let usual = cx.local(cx.now, "registers-%Y%m%d-%H%M%S.csv");
        let hint = t!("a new CSV file; an existing file is never overwritten");
        vec![UiAction::Open(Modal::Prompt(Prompt::new(t!("log what is watched"), hint, &usual)))]
    }

    pub(super) fn log_typed(&mut self, text: &str) -> Result<Vec<UiAction>, String> {
        match text {
            "" => Err(t!("expected the name of a file such as log.csv").to_owned()),
            _ => Ok(self.begin_log(PathBuf::from(text))),
        }
    }

    /// Begins a log of the list in a new file.
    fn begin_log(&mut self, path: PathBuf) -> Vec<UiAction> {
        let columns = self.watch.items.iter().filter_map(|item| self.names.get(item.at.0, item.at.1));
        let bytes = value_log::heading(columns.map(|named| (named.name.as_str(), named.unit.as_str())));
        (self.watch.log, self.watch.lost) = (Some(Log { path: path.clone(), rows: 0 }), None);
        vec![UiAction::Do(Effect::Append { tab: Tab::Registers, path, bytes, new: true })]
    }
}

/// What a read has brought of a value: two halves of different moments are no value. Of `before` is left what the fault
/// leaves of it; what was not read at all is stale.
fn sample(reading: &LiveReading, named: &Named, before: Sample) -> Sample {
    let wanted = AddressSpan { table: named.table, address: named.address, count: named.count() }.range();
    let of_it = || reading.parts.iter().filter(|part| part.span.table == named.table);
    let all = of_it().find_map(|part| {
        let own = part.span.range();
        let words = part.words.as_ref().ok().filter(|_| own.start <= wanted.start && wanted.end <= own.end)?;
        words.get(usize::from(named.address - part.span.address)..)
    });
    let touches = |span: AddressSpan| span.range().start < wanted.end && wanted.start < span.range().end;
    match all.map(|words| named.value(words).filter(|value| value.is_finite())) {
        Some(Some(value)) => Sample::good(value, before.at),
        Some(None) => before.after(Fault::NotANumber, before.at),
        None => match of_it().filter(|part| touches(part.span)).find_map(|part| part.words.as_ref().err()) {
            Some(fault) => before.after(*fault, before.at),
            None => before.uncertain(Cause::Stale),
        },
    }
}

/// A value for the log: a plain float with all its digits, others with the decimals of their scale.
fn logged(named: &Named, value: Exact) -> String {
    match named.kind.encoding() {
        Encoding::Float if named.scale == 1.0 && named.kind == DataType::F64 => value.to_string(),
        Encoding::Float if named.scale == 1.0 => to_f32(value.near()).to_string(),
        Encoding::Float
        | Encoding::Bit
        | Encoding::Unsigned
        | Encoding::Signed
        | Encoding::Bcd
        | Encoding::SignMagnitude
        | Encoding::Mod10k
        | Encoding::Text => digits(value, Some(named.decimals)),
    }
}

fn notice(words: String) -> Vec<UiAction> {
    vec![UiAction::Open(Modal::Notice(Notice::new(t!("watch list"), vec![words])))]
}

/// Draws the list: name, value, least, greatest and mean, and the last values.
pub fn view(tab: &Registers, cx: &ViewContext, canvas: &mut Canvas) {
    let theme = cx.theme;
    let width = canvas.width();
    canvas.run(0, 0, width, '─', theme.dim());
    canvas.text(2, 0, t!(" watch "), theme.strong());
    if let Some(([words, _], well)) = tab.watch.log_words() {
        let words = format!(" {} ", fit_words(&words, width.saturating_sub(16)));
        canvas.text_right(width.saturating_sub(2), 0, &words, if well { theme.strong() } else { theme.trouble() });
    }
    for (y, item) in tab.watch.items.iter().enumerate().map(|(n, item)| (to_u16(n) + 1, item)) {
        let (table, address) = item.at;
        let Some(named) = tab.names.get(table, address) else { continue };
        let named = &tab.cells.scaled(named);
        let (text, good) = named_text(tab, cx, named);
        canvas.text(1, y, &pad(&fit(&named.name, 16), 16), theme.normal());
        canvas.text_right(34, y, &text, if good { theme.strong() } else { theme.trouble() });
        if item.good == 0 {
            continue;
        }
        let text = |value: Exact| digits(value, Some(named.decimals));
        let (least, greatest) = (text(item.least), text(item.greatest));
        let mean = text((item.sum / f64::from(item.good)).into());
        let words = t!("{least} to {greatest}, mean {mean}", least, greatest, mean);
        let x = canvas.text(36, y, &words, theme.dim()) + 2;
        let room = usize::from(width.saturating_sub(x + 1)).min(60);
        let recent = item.samples.iter().rev().take(room).rev();
        let recent: Vec<Option<f64>> =
            recent.map(|sample| sample.good_exact().map(|value| (value - item.least).near())).collect();
        if 4 <= room && 0 < to_u32(recent.len()) {
            let range = (item.greatest - item.least).near().max(f64::MIN_POSITIVE);
            canvas.text(x, y, &spark::bars(&recent, range, theme.glyphs), theme.normal());
        }
    }
}
