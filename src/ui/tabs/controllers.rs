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

use self::{
    compare::Compare,
    list::Devices,
    procedures::Procedures,
    program::Cell,
    runs::{ControlRuns, Runs},
    sets::{Sets, SetsOf},
    table::ParameterTable,
};
use crate::ui::tabs::prelude::*;
use crate::{history::Series, plant::parameter_set, ui::layout::Size};

/// The small trend is asked for again after this time.
const TREND_EVERY: SignedDuration = SignedDuration::from_secs(10);
const TIMEOUT: SignedDuration = SignedDuration::from_secs(30);
/// Columns of the small trend to ask for: two dots a cell, and some to spare.
const TREND_BUCKETS: usize = 80;
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Page {
    List,
    Device,
    Lamps,
    Program,
    Sets,
    /// A set against it.
    Compare(Compare),
    Runs,
    Procedures,
    /// Some runs over each other.
    Overlay,
    /// A page of words to read.
    Guide(usize),
}

#[derive(Debug)]
pub struct Controllers {
    /// Over each other: the last one is shown, and Esc leads to the one before it.
    pages: Vec<Page>,
    devices: List<Devices>,
    /// The device of the pages over the list.
    device: DeviceId,
    table: ParameterTable,
    cell: Cell,
    /// The devices as faceplates or as a table; `None` as there is room.
    wall: Option<bool>,
    runs: Runs,
    procedures: Procedures,
    lamps: lamps::Live,
    sets: Sets,
    /// The small trend, of which tag, and the query for it.
    trend: Answered<Vec<Series>>,
    /// The tags that it was asked for last.
    curves: Vec<TagId>,
}

impl TabView for Controllers {
    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        if let Some(list) = self.list(cx) {
            return list.copied(cx);
        }
        let cell = self.device(cx).filter(|_| *self.page() == Page::Program).and_then(|device| self.cell_tag(device));
        cell.into_iter().map(|tag| value::line(cx, tag)).collect()
    }

    fn new(snapshot: &Snapshot) -> Controllers {
        let page = if snapshot.def.devices.len() == 1 { Page::Device } else { Page::List };
        Controllers::on_pages(vec![page], DeviceId(0), ParameterTable::default())
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.list_mut(cx).is_some_and(|list| list.back(cx)) {
            return true;
        }
        let popped = if 1 < self.pages.len() { self.pages.pop() } else { None };
        match popped {
            Some(Page::Device) => {
                self.trend = Answered::default();
                self.table = ParameterTable { defaults: self.table.defaults, ..ParameterTable::default() };
            }
            Some(Page::Overlay) => self.runs.overlay = None,
            Some(_) => {}
            None => return false,
        }
        true
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        match self.page() {
            Page::Sets => Some(&self.sets),
            Page::Runs => self.runs.shown(),
            Page::Procedures => Some(&self.procedures),
            Page::List => Some(&self.devices),
            Page::Device => Some(self),
            Page::Lamps | Page::Program | Page::Compare(_) | Page::Overlay | Page::Guide(_) => None,
        }
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        match self.page() {
            Page::Sets => Some(&mut self.sets),
            Page::Runs => self.runs.shown_mut(),
            Page::Procedures => Some(&mut self.procedures),
            Page::List => Some(&mut self.devices),
            Page::Device => Some(self),
            Page::Lamps | Page::Program | Page::Compare(_) | Page::Overlay | Page::Guide(_) => None,
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        while cx.is_past() && matches!(self.page(), Page::Sets | Page::Compare(_) | Page::Procedures) {
            self.pages.pop();
        }
        let device = self.device(cx);
        match (self.page(), device) {
            (Page::Runs | Page::Overlay, _) => return self.runs.ask(cx, Tab::Controllers),
            (Page::Lamps, Some(device)) => return self.lamps.ask(cx, device),
            (Page::Procedures, _) => return self.procedures.ask(cx, Tab::Controllers).into_iter().collect(),
            _ => {}
        }
        let faceplate = device.and_then(|device| device.faceplate.as_ref());
        let tags = match self.page() {
            Page::Device => faceplate.map(|faceplate| faceplate.pv).into_iter().collect(),
            Page::List if self.is_wall(cx) => wall::tags(cx, &self.devices),
            Page::List | Page::Program | Page::Sets | Page::Compare(_) => Vec::new(),
            Page::Lamps | Page::Runs | Page::Procedures | Page::Overlay | Page::Guide(_) => Vec::new(),
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
        self.trend.ask(cx, Tab::Controllers, TREND_EVERY, TIMEOUT, query).into_iter().collect()
    }

    fn queries(&mut self) -> Queries<'_> {
        let own: Queries = vec![&mut self.trend, &mut self.procedures.answered];
        own.into_iter().chain(self.runs.queries()).chain(self.lamps.queries()).collect()
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.queries().into_iter().for_each(|asked| asked.on_answer(cx, number, &answer));
        self.runs.follow(cx);
        Vec::new()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let text = text.trim();
        parameter_set::check_name(text)?;
        let there = cx.snapshot.sets.iter().find(|stored| stored.name == text);
        let kind = CommandKind::SaveSet { device: self.device, name: text.into(), replace: there.is_some() };
        let Some(there) = there else { return Ok(vec![UiAction::Command(kind)]) };
        let words = sets::replace_text(cx, there);
        Ok(open(Modal::Confirm(Confirm::command(t!("save set {text}", text), words, kind))))
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        if let (Page::Overlay, Some(overlay)) = (self.page(), &self.runs.overlay) {
            return overlay.view(cx, frame, area);
        }
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        match (self.page(), self.device(cx)) {
            (Page::List, _) if self.is_wall(cx) => wall::view(cx, &mut canvas, &self.devices, &self.trend),
            (Page::List, _) => self.devices.view(cx, &mut canvas),
            (Page::Procedures, _) => self.procedures.view(cx, &mut canvas),
            (Page::Runs | Page::Overlay, _) => self.runs.list.view(cx, &mut canvas),
            (Page::Sets, _) => self.sets.view(cx, &mut canvas),
            (Page::Guide(page), _) => guide::view(cx, &mut canvas, *page),
            (Page::Lamps, Some(device)) => lamps::view(cx, &mut canvas, device, &self.lamps),
            (Page::Compare(compare), Some(device)) => compare.view(cx, &mut canvas, device),
            (Page::Device | Page::Program, Some(device)) => match (self.page(), &device.program) {
                (Page::Program, Some(program)) => program::view(cx, &mut canvas, device, program, self.cell),
                _ => {
                    let trend = self.trend.value.as_ref().and_then(|series| series.first());
                    device::view(cx, &mut canvas, device, &self.table, trend)
                }
            },
            (Page::Device | Page::Program | Page::Lamps | Page::Compare(_), None) => {}
        }
    }
}

impl Controllers {
    fn on_pages(pages: Vec<Page>, device: DeviceId, table: ParameterTable) -> Controllers {
        let (cell, trend) = (Cell::default(), Answered::default());
        let runs = Runs::new(ControlRuns { device });
        Controllers {
            pages,
            devices: List::default(),
            device,
            table,
            cell,
            wall: None,
            runs,
            procedures: Procedures::default(),
            lamps: lamps::Live::default(),
            sets: Sets::new(SetsOf { device }),
            trend,
            curves: Vec::new(),
        }
    }

    /// The page that is shown.
    fn page(&self) -> &Page {
        self.pages.last().unwrap_or(&Page::List)
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

    pub fn show(&mut self, device: DeviceId) {
        let table = ParameterTable { defaults: self.table.defaults, ..ParameterTable::default() };
        let mut devices = std::mem::take(&mut self.devices);
        devices.select(device);
        let pages = self.pages.iter().take(1).filter(|first| **first != Page::Device).cloned();
        let pages = pages.chain([Page::Device]).collect();
        *self = Controllers { wall: self.wall, devices, ..Controllers::on_pages(pages, device, table) };
    }

    pub fn show_procedure(&mut self, id: ProcedureId) {
        self.pages.truncate(1);
        self.pages.push(Page::Procedures);
        self.procedures.select(id);
    }

    /// Shows the device of a tag with the tag selected.
    pub fn show_parameter(&mut self, cx: &ViewContext, tag: TagId) {
        let device = cx.def().tag(tag).device;
        self.show(device);
        self.table.selected = self.table.rows(cx, device).iter().position(|row| row.id == tag).unwrap_or(0);
    }
}

/// The list of the parameters of a device.
impl ListPage for Controllers {
    fn step(&mut self, cx: &ViewContext, motion: Motion) {
        Controllers::step(self, cx, motion);
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        let filtered = !self.table.filter.is_empty();
        if filtered {
            self.set_filter(cx, "");
        }
        filtered
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        let tag = self.table.tag(cx, self.device).map(|tag| tag.id);
        tag.into_iter().map(|tag| value::line(cx, tag)).collect()
    }

    fn filter(&self) -> String {
        self.table.filter.to_string()
    }

    fn set_filter(&mut self, cx: &ViewContext, text: &str) {
        (self.table.filter, self.table.selected) = (Words::parse(text), 0);
        self.table.selected = if self.table.filter.is_empty() { 0 } else { self.table.best(cx, self.device) };
    }
}
