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
    procedures::Procedures,
    program::Cell,
    runs::{ControlRuns, Runs},
    sets::{Sets, SetsOf},
    table::Table,
};
use crate::ui::tabs::prelude::*;
use crate::{history::Series, plant::parameter_set, ui::layout::Size};

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
    sets: Sets,
    asked_for: Asked,
    /// The small trend, of which tag, and the query for it.
    trend: Answered<Vec<Series>>,
    /// The tags that it was asked for last.
    curves: Vec<TagId>,
    asked: u32,
}

impl TabView for Controllers {
    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        if let Some(list) = self.list() {
            return list.copied(cx);
        }
        let device = cx.def().devices.get(self.device.index());
        let tag = device.and_then(|device| match self.page {
            Page::Device => self.table.tag(cx, device.id).map(|tag| tag.id),
            Page::List => device.faceplate.as_ref().map(|faceplate| faceplate.pv),
            Page::Program => device.program.as_ref().and_then(|program| self.cell.tag(program)),
            Page::Sets
            | Page::Runs
            | Page::Procedures
            | Page::Lamps
            | Page::Compare(..)
            | Page::Overlay(_)
            | Page::Guide(..) => None,
        });
        tag.into_iter().map(|tag| value::line(cx, tag)).collect()
    }

    fn new(snapshot: &Snapshot) -> Controllers {
        let page = if snapshot.def.devices.len() == 1 { Page::Device } else { Page::List };
        Controllers::on_page(page, DeviceId(0), Table::default())
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.list_mut().is_some_and(|list| list.back(cx)) {
            return true;
        }
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

    fn list(&self) -> Option<&dyn ListPage> {
        match self.page {
            Page::Sets => Some(&self.sets),
            Page::Runs => self.runs.shown(),
            Page::Procedures => Some(&self.procedures),
            Page::List | Page::Device | Page::Lamps | Page::Program | Page::Compare(_) => None,
            Page::Overlay(_) | Page::Guide(..) => None,
        }
    }

    fn list_mut(&mut self) -> Option<&mut dyn ListPage> {
        match self.page {
            Page::Sets => Some(&mut self.sets),
            Page::Runs => self.runs.shown_mut(),
            Page::Procedures => Some(&mut self.procedures),
            Page::List | Page::Device | Page::Lamps | Page::Program | Page::Compare(_) => None,
            Page::Overlay(_) | Page::Guide(..) => None,
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if cx.is_past() && matches!(self.page, Page::Sets | Page::Compare(_) | Page::Procedures) {
            self.page = Page::Device;
        }
        let device = cx.def().devices.get(self.device.index());
        let number = (Tab::Controllers, &mut self.asked);
        match (&self.page, device) {
            (Page::Runs | Page::Overlay(_), _) => return self.runs.ask(cx, number),
            (Page::Lamps, Some(device)) => return self.lamps.ask(cx, device, &mut self.asked),
            (Page::Procedures, _) => return self.procedures.ask(cx, number).into_iter().collect(),
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
        let queries = [&self.trend.query, &self.procedures.answered.query];
        queries.iter().any(|query| query.awaits(number)) || self.runs.awaits(number) || self.lamps.awaits(number)
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.trend.on_answer(cx, number, &answer);
        self.runs.on_answer(cx, number, &answer);
        self.procedures.answered.on_answer(cx, number, &answer);
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
            (Page::Runs | Page::Overlay(_), _) => self.runs.list.view(cx, &mut canvas),
            (Page::Sets, _) => self.sets.view(cx, &mut canvas),
            (Page::Compare(compare), _) => compare.view(cx, &mut canvas, device),
            (Page::Guide(page, _), _) => guide::view(cx, &mut canvas, *page),
        }
    }
}

impl Controllers {
    fn on_page(page: Page, device: DeviceId, table: Table) -> Controllers {
        let (cell, asked_for, trend) = (Cell::default(), Asked::Filter, Answered::default());
        let runs = Runs::new(ControlRuns { device });
        Controllers {
            page,
            device,
            table,
            cell,
            wall: None,
            runs,
            procedures: Procedures::default(),
            lamps: lamps::Live::default(),
            sets: Sets::new(SetsOf { device }),
            asked_for,
            trend,
            curves: Vec::new(),
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
