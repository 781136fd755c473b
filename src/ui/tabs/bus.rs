//! Tab 6: the line explains itself: how it does, its read plan, its frames,
//! tests of it, and the registers of its devices, live. Five pages.

mod frames;
mod keys;
mod line;
mod lines;
mod plan;
mod registers;
mod results;
mod test;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

pub use frames::around as frames_around;

use super::{line_switch, registers::Registers};
use crate::ui::tabs::prelude::*;
use crate::{
    plant::{line_minute::LineMinute, line_state::LineState, request_refusal::RequestRefusal},
    ui::{
        bus_text::{broken, bytes_text, ms, short_ms},
        layout::Size,
        line_view::LineView,
        modal::bus::{Shown, TextWindow, Window, start::TestKind},
        widgets::{
            line_trend::{self, line_trend},
            rows,
        },
    },
};
use registers::below;

/// The day of a line grows by the minute.
const ASK_EVERY: SignedDuration = SignedDuration::from_secs(60);
const TIMEOUT: SignedDuration = SignedDuration::from_secs(10);
const DAY_HEIGHT: u16 = 3;
/// Least rows of the recent frames below them.
const FRAMES_MIN: u16 = 4;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Page {
    /// Settings, load, counters, devices.
    Line,
    /// The read plan, block by block.
    Plan,
    /// What went over the line.
    Frames,
    Test,
    /// The registers of a device, live; on a bench a tab of its own.
    Registers,
}

impl Page {
    const ALL: [Page; 5] = [Page::Line, Page::Plan, Page::Frames, Page::Test, Page::Registers];

    fn offered(cx: &ViewContext) -> &'static [Page] {
        // Of the past only what the history has of a line.
        match (cx.is_past(), cx.def().is_bench()) {
            (true, _) => &Page::ALL[..1],
            (false, true) => &Page::ALL[..4],
            (false, false) => &Page::ALL,
        }
    }

    fn title(self) -> &'static str {
        match self {
            Page::Line => t!("Line"),
            Page::Plan => t!("Plan"),
            Page::Frames => t!("Frames"),
            Page::Test => t!("Test"),
            Page::Registers => t!("Registers"),
        }
    }
}

#[derive(Debug)]
pub struct Bus {
    line: LineId,
    page: Page,
    /// The first page.
    scroll: Scroll,
    plan: plan::Plan,
    frames: frames::Ring,
    pub(super) test: test::Bench,
    /// How the line did over the last day, and the query for it.
    minutes: Answered<Vec<LineMinute>>,
    /// The last page, which counts the queries of all.
    registers: Registers,
}

impl TabView for Bus {
    fn new(snapshot: &Snapshot) -> Bus {
        Bus {
            line: LineId(0),
            page: Page::Line,
            scroll: Scroll::default(),
            plan: plan::Plan::new(plan::Blocks { line: LineId(0) }),
            frames: frames::Ring::default(),
            test: test::Bench::default(),
            minutes: Answered::default(),
            registers: Registers::within(snapshot, Tab::Bus),
        }
    }

    fn list(&self, cx: &ViewContext) -> Option<&dyn ListPage> {
        match self.page(cx) {
            Page::Plan => Some(&self.plan),
            Page::Registers => self.registers.list(cx),
            Page::Line | Page::Frames | Page::Test => None,
        }
    }

    fn list_mut(&mut self, cx: &ViewContext) -> Option<&mut dyn ListPage> {
        match self.page(cx) {
            Page::Plan => Some(&mut self.plan),
            Page::Registers => self.registers.list_mut(cx),
            Page::Line | Page::Frames | Page::Test => None,
        }
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        if self.page(cx) == Page::Registers {
            return self.registers.copied(&below(cx));
        }
        self.list(cx).map_or(Vec::new(), |list| list.copied(cx))
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        self.frames.dismiss();
        if self.list_mut(cx).is_some_and(|list| list.back(cx)) {
            return true;
        }
        if self.page(cx) == Page::Registers {
            if !self.registers.back(cx) {
                self.page = Page::Line;
            }
            return true;
        }
        LineView::new(cx, self.line).is_some_and(|at| self.page(cx) == Page::Frames && self.frames.back(cx, &at))
    }

    fn fingerprint(&self, cx: &ViewContext) -> Rows {
        match (self.page(cx), LineView::new(cx, self.line)) {
            (Page::Plan, Some(_)) => self.plan.fingerprint(cx),
            (Page::Frames, Some(_)) => self.frames.drawn_rows(),
            (Page::Line | Page::Plan | Page::Frames | Page::Test | Page::Registers, _) => Rows::default(),
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if let (Page::Frames, Some(at)) = (self.page(cx), LineView::new(cx, self.line)) {
            self.frames.follow(cx, &at);
        }
        match self.page(cx) {
            Page::Plan | Page::Frames | Page::Test => return Vec::new(),
            Page::Registers => return self.registers.on_snapshot(&below(cx)),
            Page::Line => {}
        }
        let query = line_trend::query(self.line, cx.now);
        self.minutes.ask(cx, Tab::Bus, ASK_EVERY, TIMEOUT, query).into_iter().collect()
    }

    fn awaits(&mut self, number: u32) -> bool {
        self.minutes.query.awaits(number) || self.registers.awaits(number)
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        if self.registers.awaits(number) {
            let next = self.registers.on_answer(&below(cx), number, answer);
            // Nothing is read where nothing is seen; the page asks when it is shown.
            return if self.page(cx) == Page::Registers { next } else { self.registers.rest() };
        }
        self.minutes.on_answer(cx, number, &answer);
        Vec::new()
    }

    fn on_request_done(&mut self, _cx: &ViewContext, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        self.frames.on_request_done(answer)
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        if self.page(cx) == Page::Registers {
            return self.registers.on_text(&below(cx), text);
        }
        self.frames.set_filter(text).map(|()| Vec::new())
    }

    fn on_saved(&mut self, _cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.frames.on_saved(result);
        Vec::new()
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let Some(at) = LineView::new(cx, self.line) else {
            canvas.text(1, 1, t!("this plant has no lines"), cx.theme.normal());
            return;
        };
        self.heading(cx, &at, &mut canvas);
        let (width, height) = (canvas.width(), canvas.height());
        let mut page = canvas.part(0, 1, width, height.saturating_sub(1));
        match self.page(cx) {
            Page::Line => {
                let rows = line::rows(cx, &at, width);
                rows::draw(cx, &mut page, &rows, self.scroll.first(rows.len(), self.room(cx) - 1));
                let used = self.day(cx, &mut page, to_u16(rows.len()));
                let left = page.height().saturating_sub(used + 1);
                if Size::Wide <= cx.size && FRAMES_MIN < left {
                    frames::recent(cx, &at, &mut page.part(0, used + 1, width, left));
                }
            }
            Page::Plan => self.plan.view(cx, &mut page),
            Page::Frames => self.frames.view(cx, &at, &mut page),
            Page::Test => self.test.view(cx, &at, &mut page),
            Page::Registers => {
                let cx = below(cx);
                self.registers.view(&cx, frame, cx.area);
            }
        }
    }
}

impl Bus {
    /// What was filled in for a test, for the next time.
    pub fn keep(&mut self, window: Window) {
        self.test.keep(window);
    }

    /// What comes of a test of this line.
    pub fn show_test(&mut self, line: LineId) {
        (self.line, self.page, self.test.first) = (line, Page::Test, None);
    }

    /// The page that is shown: of the past there is one.
    fn page(&self, cx: &ViewContext) -> Page {
        if cx.is_past() { Page::Line } else { self.page }
    }

    /// Rows that a page has below the heading.
    fn room(&self, cx: &ViewContext) -> usize {
        usize::from(cx.area.height.saturating_sub(1)).max(2)
    }

    /// How the line did over the last day, below the rows where there is room for it; returns the row after it.
    fn day(&self, cx: &ViewContext, page: &mut Canvas, rows: u16) -> u16 {
        let (width, height) = (page.width(), page.height());
        if height < rows + DAY_HEIGHT {
            return height;
        }
        let below = (rows + 1).min(height - DAY_HEIGHT);
        let mut day = page.part(1, below, width.saturating_sub(2), DAY_HEIGHT);
        line_trend(cx, &mut day, self.minutes.value.as_deref().unwrap_or_default());
        below + DAY_HEIGHT
    }

    /// So many lines on, around the end.
    fn choose_line(&mut self, cx: &ViewContext, by: isize) {
        self.line = lines::next(cx, self.line, by);
        (self.scroll, self.plan) = (Scroll::default(), plan::Plan::new(plan::Blocks { line: self.line }));
        self.frames.forget();
        self.test.first = None;
        self.minutes = Answered::default();
        self.show(cx, self.page);
    }

    fn scroll(&mut self, cx: &ViewContext, motion: Motion) {
        let (Some(at), room) = (LineView::new(cx, self.line), self.room(cx)) else { return };
        match (self.page(cx), motion) {
            (Page::Line, Motion::Rows(by)) if 1 < cx.def().lines.len() => self.choose_line(cx, by),
            (Page::Line, _) => self.scroll.on(motion, line::rows(cx, &at, cx.area.width).len(), room - 1),
            (Page::Plan, _) => self.plan.step(cx, motion),
            (Page::Frames, _) => self.frames.scroll(cx, &at, motion, room),
            (Page::Test, _) => self.test.scroll(cx, &at, motion),
            // It scrolls by its own keys.
            (Page::Registers, _) => {}
        }
    }

    /// The pages, and the line with its state.
    fn heading(&self, cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
        let mut x = 1;
        for page in Page::offered(cx) {
            let shown = *page == self.page(cx);
            let text = if shown { format!("‹{}›", page.title()) } else { format!(" {} ", page.title()) };
            x = canvas.text(x, 0, &text, if shown { cx.theme.focus() } else { cx.theme.dim() });
        }
        let end = canvas.width().saturating_sub(1);
        let place = match cx.def().lines.len() {
            1 => String::new(),
            count => format!(" {}/{count}", at.id.0 + 1),
        };
        let words = fit_words(
            &format!("{}{place}  {}", at.settings.name, lines::state_text(cx, at)),
            end.saturating_sub(x + 2),
        );
        let style = if at.status.state == LineState::Connected { cx.theme.normal() } else { cx.theme.trouble() };
        canvas.text(end.saturating_sub(width(&words)), 0, &words, style);
    }
}

/// The devices that do not answer are asked at once: those of a line, or of all.
pub fn retry(cx: &ViewContext, line: Option<LineId>) -> Vec<UiAction> {
    let silent = |device: &&DeviceDef| match cx.snapshot.device(device.id).state {
        DeviceState::Failing(_) | DeviceState::Down { .. } => line.is_none_or(|line| line == device.line),
        DeviceState::Unknown | DeviceState::Responding => false,
    };
    cx.def().devices.iter().filter(silent).map(|device| UiAction::Command(CommandKind::Refresh(device.id))).collect()
}
