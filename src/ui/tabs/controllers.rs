//! Tab 4: every device in a list; one as faceplate and parameter table; its program, its parameter sets, and a guide.

mod navigate;
mod ask;
mod compare;
mod actions;
mod device;
mod guide;
mod keys;
mod lamps;
pub(super) mod list;
mod faceplate;
pub(super) mod program;
mod procedures;
mod runs;
mod sets;
mod table;
mod wall;

#[cfg(test)]
mod tests;

pub use device::signal_mark;
pub use keys::Action;

use self::{
    actions::{notice, write},
    compare::Compare,
    keys::page_keys,
    procedures::Procedures,
    program::Cell,
    runs::Runs,
    sets::Source,
    table::Table,
};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::parameter_set,
    ui::{keys::find, layout::Size},
};

/// The small trend is asked for again after this time.
const TREND_EVERY: SignedDuration = SignedDuration::from_secs(10);
const TIMEOUT: SignedDuration = SignedDuration::from_secs(30);
/// Columns of the small trend to ask for: two dots a cell, and some to spare.
const TREND_BUCKETS: usize = 80;
/// What is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Page {
    /// All devices.
    List,
    /// One device.
    Device,
    /// Its bits as lamps.
    Lamps,
    /// Its ramp/soak program.
    Program,
    /// Its parameter sets.
    Sets,
    /// A set against it.
    Compare(Compare),
    /// Its control runs.
    Runs,
    /// The procedures of the plant.
    Procedures,
    /// Some runs over each other, and the page to go back to.
    Overlay(Box<Page>),
    /// Words to read, and the page to go back to.
    Guide(usize, Box<Page>),
}

/// What the text is for that is being typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Filter,
    SetName,
}

/// State of this tab.
#[derive(Debug)]
pub struct Controllers {
    page: Page,
    /// The device that is shown or selected.
    device: DeviceId,
    table: Table,
    cell: Cell,
    /// The devices as faceplates or as a table; `None` as there is room.
    wall: Option<bool>,
    runs: Runs,
    procedures: Procedures,
    lamps: lamps::Live,
    /// The selected row of the sets.
    set: usize,
    asked_for: Asked,
    /// The small trend, of which tag, and the query for it.
    trend: Answered<Vec<Series>>,
    /// The tags that it was asked for last.
    curves: Vec<TagId>,
    asked: u32,
}

impl TabView for Controllers {
    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        let device = cx.def().devices.get(self.device.index());
        let tag = device.and_then(|device| match self.page {
            Page::Device => self.table.tag(cx, device.id).map(|tag| tag.id),
            Page::List => device.faceplate.as_ref().map(|faceplate| faceplate.pv),
            Page::Program => device.program.as_ref().and_then(|program| self.cell.tag(program)),
            Page::Lamps | Page::Sets | Page::Compare(..) | Page::Runs | Page::Guide(..) => None,
            Page::Procedures | Page::Overlay(_) => None,
        });
        tag.into_iter().map(|tag| value::line(cx, tag)).collect()
    }

    fn new(snapshot: &Snapshot) -> Controllers {
        let page = if snapshot.def.devices.len() == 1 { Page::Device } else { Page::List };
        Controllers::on_page(page, DeviceId(0), Table::default())
    }

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        let Some(action) = find(&page_keys(&self.page), event) else { return Vec::new() };
        let Some(device) = cx.def().devices.get(self.device.index()) else { return Vec::new() };
        match action {
            Action::Guide => {
                let before = std::mem::replace(&mut self.page, Page::List);
                self.page = Page::Guide(0, Box::new(before));
            }
            Action::Turn(by) => {
                if let Page::Guide(page, _) = &mut self.page {
                    *page = page.saturating_add_signed(by).min(guide::count() - 1);
                }
            }
            Action::Device(by) if self.page == Page::Lamps => self.show_lamps(cx, by),
            Action::Device(by) => self.show(DeviceId(to_u16(around(device.id.index(), by, cx.def().devices.len())))),
            Action::Move(motion) => self.move_by(cx, device, motion),
            Action::Wall => self.wall = Some(!self.is_wall(cx)),
            Action::Column(by) if self.page == Page::List => {
                let last = cx.def().devices.len().saturating_sub(1);
                self.device = DeviceId(to_u16(device.id.index().saturating_add_signed(by).min(last)));
            }
            Action::Column(by) => self.cell.column = self.cell.column.saturating_add_signed(by).min(2),
            Action::Open => return self.open_selected(cx, device),
            Action::Lamps if lamps::has_any(cx, device) => self.page = Page::Lamps,
            Action::Lamps => return notice(device, t!("this device has no bits to show as lamps")),
            Action::Program if device.program.is_some() => self.page = Page::Program,
            Action::Program => return notice(device, t!("this device has no ramp/soak program")),
            Action::Sets if cx.is_past() => return notice(device, t!("parameter sets are shown in the present only")),
            Action::Sets => (self.page, self.set) = (Page::Sets, 0),
            Action::Runs if cx.snapshot.has_runs(device.id) => {
                (self.page, self.runs) = (Page::Runs, Runs::default());
            }
            Action::Runs => return notice(device, t!("this device has no SV and PV")),
            Action::Procedures if cx.is_past() || cx.def().procedures.is_empty() => {
                return notice(device, procedures::why_none(cx));
            }
            Action::Procedures => self.page = Page::Procedures,
            Action::Abort => return self.procedures.abort(cx),
            Action::Trend => return self.runs.trend(cx, device.id).into_iter().collect(),
            Action::Mark => self.runs.mark(),
            Action::Overlay => self.swap_overlay(cx, device.id),
            Action::Tag(by) => self.runs.overlay.iter_mut().for_each(|overlay| overlay.next_tag(by)),
            Action::Find => {
                self.asked_for = Asked::Filter;
                let (title, hint) = (t!("find a parameter"), t!("words in name or meaning; empty shows all"));
                return open(Modal::Prompt(Prompt::new(title, hint, &self.table.filter.to_string())));
            }
            Action::Defaults => self.table.defaults = !self.table.defaults,
            Action::Save => {
                self.asked_for = Asked::SetName;
                let title = t!("save the settings of {name} as a set", name = device.name);
                return open(Modal::Prompt(Prompt::new(title, sets::save_hint(cx, device.id), "")));
            }
            Action::All | Action::SwapDirection => return self.in_compare(cx, action),
            Action::Why
            | Action::Refresh
            | Action::Actions
            | Action::Tune
            | Action::Run
            | Action::Line
            | Action::Settings
            | Action::Control(_)
            | Action::Mode
            | Action::Pattern
            | Action::Stop
            | Action::ReadSets => return self.on_device(cx, device, action),
        }
        self.on_snapshot(cx)
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        self.page_hints(cx)
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        let page = std::mem::replace(&mut self.page, Page::List);
        let alone = cx.def().devices.len() <= 1;
        self.page = match page {
            Page::Device if !self.table.filter.is_empty() => {
                (self.table.filter, self.table.selected) = (Words::default(), 0);
                Page::Device
            }
            Page::Device if !alone => {
                self.trend = Answered::default();
                self.table = Table { defaults: self.table.defaults, ..Table::default() };
                Page::List
            }
            Page::Lamps | Page::Program | Page::Sets | Page::Runs => Page::Device,
            Page::Procedures if alone => Page::Device,
            Page::Procedures => Page::List,
            Page::Overlay(before) => {
                self.runs.overlay = None;
                *before
            }
            Page::Compare(_) => Page::Sets,
            Page::Guide(_, before) => *before,
            page @ (Page::List | Page::Device) => {
                self.page = page;
                return false;
            }
        };
        true
    }

    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        match (&self.page, cx.def().devices.get(self.device.index())) {
            (Page::Sets, Some(device)) => {
                Rows::of(sets::sources(cx, device).iter().map(|source| source.words(cx)), self.set)
            }
            (Page::List | Page::Device | Page::Program | Page::Sets | Page::Compare(_), _)
            | (Page::Lamps | Page::Runs | Page::Procedures | Page::Overlay(_) | Page::Guide(..), _) => Rows::default(),
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if cx.is_past() && matches!(self.page, Page::Sets | Page::Compare(_) | Page::Procedures) {
            self.page = Page::Device;
        }
        let device = cx.def().devices.get(self.device.index());
        match (&self.page, device) {
            (Page::Runs | Page::Overlay(_), Some(device)) => return self.runs.ask(cx, device, &mut self.asked),
            (Page::Lamps, Some(device)) => return self.lamps.ask(cx, device, &mut self.asked),
            (Page::Procedures, _) => return self.procedures.ask(cx, &mut self.asked),
            _ => {}
        }
        let faceplate = device.and_then(|device| device.faceplate.as_ref());
        let tags = match &self.page {
            Page::Device => faceplate.map(|faceplate| faceplate.pv).into_iter().collect(),
            Page::List if self.is_wall(cx) => wall::tags(cx, self.device.index()),
            Page::List | Page::Program | Page::Sets | Page::Compare(_) => Vec::new(),
            Page::Lamps | Page::Runs | Page::Procedures | Page::Overlay(_) | Page::Guide(..) => Vec::new(),
        };
        if tags.is_empty() {
            return Vec::new();
        }
        if tags != self.curves {
            self.curves.clone_from(&tags);
            self.trend.query.want();
        }
        let from = cx.now.checked_sub(faceplate::WINDOW).unwrap_or(cx.now);
        let query = Query::Series { tags, from, to: cx.now, buckets: TREND_BUCKETS };
        let number = (Tab::Controllers, &mut self.asked);
        self.trend.ask(cx, number, TREND_EVERY, TIMEOUT, query).into_iter().collect()
    }

    fn awaits(&self, number: u32) -> bool {
        let (runs, procedures, lamps) = (&self.runs, &self.procedures, &self.lamps);
        self.trend.query.awaits(number) || runs.awaits(number) || procedures.awaits(number) || lamps.awaits(number)
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.trend.on_answer(cx, number, &answer);
        self.runs.on_answer(cx, number, &answer);
        self.procedures.on_answer(cx, number, &answer);
        self.lamps.on_answer(cx, number, &answer);
        Vec::new()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let text = text.trim();
        match self.asked_for {
            Asked::Filter => {
                let filter = Words::parse(text);
                let mut table = Table { selected: 0, filter, ..self.table.clone() };
                if table.rows(cx, self.device).is_empty() {
                    return Err(t!("no parameter has \"{text}\" in its name or meaning", text));
                }
                table.selected = table.best(cx, self.device);
                self.table = table;
                Ok(Vec::new())
            }
            Asked::SetName => {
                parameter_set::check_name(text)?;
                let there = cx.snapshot.sets.iter().find(|stored| stored.name == text);
                let kind = CommandKind::SaveSet { device: self.device, name: text.into(), replace: there.is_some() };
                let Some(there) = there else { return Ok(vec![UiAction::Command(kind)]) };
                let words = sets::replace_text(cx, there);
                Ok(open(Modal::Confirm(Confirm::command(t!("save set {text}", text), words, kind))))
            }
        }
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        if let (Page::Overlay(_), Some(overlay)) = (&self.page, &self.runs.overlay) {
            return overlay.view(cx, frame, area);
        }
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let Some(device) = cx.def().devices.get(self.device.index()) else {
            canvas.text(1, 1, t!("this plant has no devices"), cx.theme.normal());
            return;
        };
        match (&self.page, &device.program) {
            (Page::List, _) if self.is_wall(cx) => {
                wall::view(cx, &mut canvas, self.device.index(), &self.trend);
            }
            (Page::List, _) => list::view(cx, &mut canvas, self.device.index()),
            (Page::Lamps, _) => lamps::view(cx, &mut canvas, device, &self.lamps),
            (Page::Program, Some(program)) => program::view(cx, &mut canvas, device, program, self.cell),
            (Page::Device | Page::Program, _) => {
                let trend = self.trend.value.as_ref().and_then(|series| series.first());
                device::view(cx, &mut canvas, device, &self.table, trend)
            }
            (Page::Procedures, _) => self.procedures.view(cx, &mut canvas),
            (Page::Runs | Page::Overlay(_), _) => self.runs.view(cx, &mut canvas, device),
            (Page::Sets, _) => sets::view(cx, &mut canvas, device, self.set),
            (Page::Compare(compare), _) => compare.view(cx, &mut canvas, device),
            (Page::Guide(page, _), _) => guide::view(cx, &mut canvas, *page),
        }
    }

    #[cfg(test)]
    fn chords() -> crate::ui::keys::PageChords {
        let compare = Page::Compare(Compare::new(Source::Set(String::new())));
        let guide = Page::Guide(0, Box::new(Page::List));
        let runs = [Page::Runs, Page::Procedures, Page::Overlay(Box::new(Page::Runs))];
        let pages = [Page::List, Page::Device, Page::Lamps, Page::Program, Page::Sets, compare, guide];
        let pages = pages.into_iter().chain(runs);
        pages.map(|page| ("controllers", crate::ui::keys::chords_of(&page_keys(&page)))).collect()
    }
}

impl Controllers {
    fn on_page(page: Page, device: DeviceId, table: Table) -> Controllers {
        let (cell, asked_for, trend) = (Cell::default(), Asked::Filter, Answered::default());
        let (runs, procedures, curves) = (Runs::default(), Procedures::default(), Vec::new());
        Controllers {
            page,
            device,
            table,
            cell,
            wall: None,
            runs,
            procedures,
            lamps: lamps::Live::default(),
            set: 0,
            asked_for,
            trend,
            curves,
            asked: 0,
        }
    }

    /// Are the devices shown as faceplates? So they are on a wide screen, unless the operator wants the table.
    fn is_wall(&self, cx: &ViewContext) -> bool {
        self.wall.unwrap_or(Size::Wide <= cx.size)
    }

    /// The lamps of the next device that has any.
    fn show_lamps(&mut self, cx: &ViewContext, by: isize) {
        let devices = &cx.def().devices;
        let mut place = self.device.index();
        for _ in devices {
            place = around(place, by, devices.len());
            if lamps::has_any(cx, &devices[place]) {
                self.device = devices[place].id;
                return;
            }
        }
    }

    /// Shows a device.
    pub fn show(&mut self, device: DeviceId) {
        let table = Table { defaults: self.table.defaults, ..Table::default() };
        *self = Controllers { asked: self.asked, wall: self.wall, ..Controllers::on_page(Page::Device, device, table) };
    }

    /// Shows a procedure.
    pub fn show_procedure(&mut self, id: ProcedureId) {
        self.page = Page::Procedures;
        self.procedures.select(id);
    }

    /// Shows the device of a tag with the tag selected.
    pub fn show_parameter(&mut self, cx: &ViewContext, tag: TagId) {
        let device = cx.def().tag(tag).device;
        self.show(device);
        self.table.selected = self.table.rows(cx, device).iter().position(|row| row.id == tag).unwrap_or(0);
    }
}
