//! Tab 6: the line explains itself: how it does, its read plan, its frames, and tests of it. Four pages.

mod frames;
mod line;
mod plan;
mod registers;
mod request;
mod results;
mod rows;
mod test;
mod window;

#[cfg(test)]
mod tests;

use std::path::PathBuf;

use crossterm::event::{KeyCode, KeyEvent};
use jiff::SignedDuration;
use ratatui::{Frame, layout::Rect};

pub use window::Window;

use super::{Tab, periodic_query::PeriodicQuery};
use crate::{
    history::{Answer, HistoryError},
    plant::{
        command::CommandKind,
        def::{DeviceDef, LineDef, LineId},
        event::LineState,
        line_minute::LineMinute,
        line_report::LineReport,
        snapshot::{DeviceState, LineStatus, Snapshot},
    },
    ui::{
        UiAction, ViewContext,
        keys::{self, Hint, Key, char, code},
        last_frame::Rows,
        modal::{Modal, Notice, Settings},
        widgets::{
            line_trend::{self, line_trend},
            text::{Canvas, between, fit_words, running, width},
        },
    },
};
use test::Tried;

/// The day of a line grows by the minute.
const ASK_EVERY: SignedDuration = SignedDuration::from_secs(60);
const PATIENCE: SignedDuration = SignedDuration::from_secs(10);
/// Rows of the day.
const DAY_HEIGHT: u16 = 3;

/// What is shown of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Page {
    /// Settings, load, counters, devices.
    Line,
    /// The read plan, block by block.
    Plan,
    /// What went over the line.
    Frames,
    /// Tests of the line.
    Test,
}

impl Page {
    const ALL: [Page; 4] = [Page::Line, Page::Plan, Page::Frames, Page::Test];

    fn title(self) -> &'static str {
        match self {
            Page::Line => "Line",
            Page::Plan => "Plan",
            Page::Frames => "Frames",
            Page::Test => "Test",
        }
    }
}

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// So many pages on.
    Turn(isize),
    /// This page.
    Show(Page),
    /// The next line of the plant.
    NextLine,
    /// So many rows down.
    Move(isize),
    /// So many screens down.
    Screen(isize),
    /// To the first or last row.
    Jump(isize),
    /// Opens what is selected.
    Open,
    /// Why the values of the selected block are what they are.
    Why,
    /// Holds the frames still, or lets them run.
    Freeze,
    /// Asks which frames are shown.
    Filter,
    /// Writes the frames to files.
    Save,
    /// Prepares a test.
    Try(Tried),
    /// The last test once more.
    Again,
    /// Stops the test at work.
    Stop,
    /// The communication settings of the line.
    Settings,
    /// Asks the devices that do not answer at once.
    Retry,
}

/// Keys of every page.
pub const KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Left), label: "", help: "the page before", action: Action::Turn(-1) },
    Key { chord: code(KeyCode::Right), label: "page", help: "the next page", action: Action::Turn(1) },
    Key { chord: char('L'), label: "", help: "page Line", action: Action::Show(Page::Line) },
    Key { chord: char('P'), label: "", help: "page Plan", action: Action::Show(Page::Plan) },
    Key { chord: char('F'), label: "", help: "page Frames", action: Action::Show(Page::Frames) },
    Key { chord: char('T'), label: "", help: "page Test", action: Action::Show(Page::Test) },
    Key { chord: char('n'), label: "", help: "the next line of the plant", action: Action::NextLine },
    Key { chord: code(KeyCode::PageUp), label: "", help: "a screen up", action: Action::Screen(-1) },
    Key { chord: code(KeyCode::PageDown), label: "", help: "a screen down", action: Action::Screen(1) },
    Key { chord: code(KeyCode::Home), label: "", help: "to the first row", action: Action::Jump(-1) },
    Key { chord: code(KeyCode::End), label: "", help: "to the last row", action: Action::Jump(1) },
    Key { chord: code(KeyCode::Up), label: "", help: "a row up", action: Action::Move(-1) },
];
/// Keys of the first page.
const LINE_KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Down), label: "scroll", help: "a row down", action: Action::Move(1) },
    Key { chord: char('r'), label: "retry", help: "ask devices that do not answer now", action: Action::Retry },
    Key { chord: char('c'), label: "settings", help: "communication settings of the line", action: Action::Settings },
];
const PLAN_KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Down), label: "select", help: "a row down", action: Action::Move(1) },
    Key { chord: code(KeyCode::Enter), label: "tags", help: "the tags of the block", action: Action::Open },
    Key { chord: char('w'), label: "why", help: "why the values of the block are what they are", action: Action::Why },
];
const FRAMES_KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Down), label: "select", help: "a row down", action: Action::Move(1) },
    Key { chord: char(' '), label: "hold", help: "hold the frames still, or let them run", action: Action::Freeze },
    Key { chord: code(KeyCode::Enter), label: "decode", help: "every byte of the frame", action: Action::Open },
    Key { chord: char('f'), label: "filter", help: "choose which frames are shown", action: Action::Filter },
    Key { chord: char('x'), label: "save", help: "write them as text and for Wireshark", action: Action::Save },
];
const TEST_KEYS: &[Key<Action>] = &[
    Key { chord: code(KeyCode::Down), label: "select", help: "a row down", action: Action::Move(1) },
    Key { chord: code(KeyCode::Enter), label: "start", help: "start the selected test", action: Action::Open },
    Key { chord: char('t'), label: "", help: "type bytes and send them", action: Action::Try(Tried::Bytes) },
    Key { chord: char('f'), label: "", help: "a request by its fields", action: Action::Try(Tried::Request) },
    Key { chord: char('b'), label: "", help: "browse registers", action: Action::Try(Tried::Registers) },
    Key { chord: char('l'), label: "", help: "loopback", action: Action::Try(Tried::Loopback) },
    Key { chord: char('i'), label: "", help: "identify a device", action: Action::Try(Tried::Identify) },
    Key { chord: char('s'), label: "", help: "scan for units", action: Action::Try(Tried::Scan) },
    Key { chord: char('r'), label: "again", help: "the last test once more", action: Action::Again },
    Key { chord: char('x'), label: "stop", help: "stop the test at work", action: Action::Stop },
];

/// State of this tab.
#[derive(Debug)]
pub struct Bus {
    line: LineId,
    page: Page,
    /// First row shown of the first page.
    first: usize,
    plan: plan::Plan,
    frames: frames::Ring,
    /// The bench of tests.
    pub(super) test: test::Bench,
    /// How the line did over the last day, and the query for it.
    minutes: Vec<LineMinute>,
    periodic: PeriodicQuery,
    asked: u32,
}

impl Bus {
    /// The first line of the plant.
    pub fn new(_snapshot: &Snapshot) -> Bus {
        Bus {
            line: LineId(0),
            page: Page::Line,
            first: 0,
            plan: plan::Plan::default(),
            frames: frames::Ring::default(),
            test: test::Bench::default(),
            minutes: Vec::new(),
            periodic: PeriodicQuery::default(),
            asked: 0,
        }
    }

    /// Any key: first those of the page, then those of every page.
    pub fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        let action = keys::find(page_keys(self.page), event).or_else(|| keys::find(KEYS, event));
        let (Some(action), Some(at)) = (action, Place::of(cx, self.line)) else { return Vec::new() };
        let screen = isize::try_from(self.room(cx)).unwrap_or(1).max(2) - 1;
        self.frames.dismiss();
        match action {
            Action::Turn(by) => {
                let place = Page::ALL.iter().position(|page| *page == self.page).unwrap_or(0) as isize;
                self.page = Page::ALL[(place + by).rem_euclid(Page::ALL.len() as isize) as usize];
            }
            Action::Show(page) => self.page = page,
            Action::NextLine => self.choose_line(cx, 1),
            Action::Move(by) => self.scroll(cx, &at, by),
            Action::Screen(by) => self.scroll(cx, &at, by * screen),
            Action::Jump(by) => self.scroll(cx, &at, by * 100_000),
            Action::Open => return self.open(cx, &at),
            Action::Why => return self.plan.why(cx, &at),
            Action::Freeze => self.frames.toggle(cx, &at),
            Action::Filter => return vec![self.frames.ask_filter()],
            Action::Save => return self.frames.save(cx, &at),
            Action::Try(tried) => return self.test.open(cx, &at, tried),
            Action::Again => return test::again(cx, &at),
            Action::Stop => return test::stop(&at),
            Action::Retry => return retry(cx, Some(self.line)),
            Action::Settings => {
                let kind = CommandKind::Configure(Box::new(at.settings.clone()));
                let window = Modal::Settings(Box::new(Settings::new(cx, self.line)));
                return vec![Notice::or(cx, "settings of the line", &kind, window)];
            }
        }
        self.on_snapshot(cx)
    }

    /// Esc: frames that were held still run on, `false` where there is no step back.
    pub fn back(&mut self, cx: &ViewContext) -> bool {
        self.frames.dismiss();
        Place::of(cx, self.line).is_some_and(|at| self.page == Page::Frames && self.frames.back(cx, &at))
    }

    /// The list that keys act on.
    pub fn drawn_rows(&self, cx: &ViewContext) -> Rows {
        match (self.page, Place::of(cx, self.line)) {
            (Page::Plan, Some(at)) => self.plan.drawn_rows(&at),
            (Page::Frames, Some(_)) => self.frames.drawn_rows(),
            (Page::Line | Page::Plan | Page::Frames | Page::Test, _) => Rows::default(),
        }
    }

    /// The keys of the moment.
    pub fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let mut hints = keys::hints(page_keys(self.page));
        if self.page == Page::Test && !Place::of(cx, self.line).is_some_and(|at| at.is_testing()) {
            for hint in hints.iter_mut().filter(|hint| hint.label == "stop") {
                hint.label.clear();
            }
        }
        let mut common = keys::hints(KEYS);
        if 1 < cx.def().lines.len() {
            common.iter_mut().filter(|hint| hint.key == "n").for_each(|hint| hint.label = "line".to_owned());
        }
        // `↑` stands last of the common keys, so that it is shown with the page's own `↓`.
        common.into_iter().chain(hints).collect()
    }

    /// News: frames that run are taken in now and then.
    pub fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if let (Page::Frames, Some(at)) = (self.page, Place::of(cx, self.line)) {
            self.frames.follow(cx, &at);
        }
        if self.page != Page::Line || !self.periodic.due(cx.steady(), ASK_EVERY, PATIENCE) {
            return Vec::new();
        }
        self.asked = self.asked.wrapping_add(1);
        self.periodic.asked(self.asked, cx.steady());
        vec![UiAction::query(Tab::Bus, self.asked, line_trend::query(self.line, cx.now))]
    }

    /// Is the answer to query `number` waited for?
    pub fn awaits(&self, number: u32) -> bool {
        self.periodic.awaits(number)
    }

    /// The history has answered. Without an answer the day before is left as it was.
    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) {
        if let (Some(_), Ok(Answer::LineMinutes(minutes))) = (self.periodic.answered(number, cx.steady()), answer) {
            self.minutes = minutes;
        }
    }

    /// A filter was typed.
    pub fn on_text(&mut self, _cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        self.frames.set_filter(text).map(|()| Vec::new())
    }

    /// The station has put a capture on record, or refuses it.
    pub fn on_request_done(&mut self, answer: Result<(), String>) -> Vec<UiAction> {
        self.frames.on_request_done(answer)
    }

    /// A capture was written, or why not.
    pub fn on_saved(&mut self, result: Result<PathBuf, String>) {
        self.frames.on_saved(result);
    }

    /// Draws it.
    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let Some(at) = Place::of(cx, self.line) else {
            canvas.text(1, 1, "this plant has no lines", cx.theme.normal());
            return;
        };
        self.heading(cx, &at, &mut canvas);
        let (width, height) = (canvas.width(), canvas.height());
        let mut page = canvas.part(0, 1, width, height.saturating_sub(1));
        match self.page {
            Page::Line => {
                let rows = line::rows(cx, &at, width);
                rows::draw(cx, &mut page, &rows, self.first);
                self.day(cx, &mut page, rows.len() as u16);
            }
            Page::Plan => self.plan.view(cx, &at, &mut page),
            Page::Frames => self.frames.view(cx, &at, &mut page),
            Page::Test => self.test.view(cx, &at, &mut page),
        }
    }
}

impl Bus {
    /// Rows that a page has below the heading.
    fn room(&self, cx: &ViewContext) -> usize {
        usize::from(cx.area.height.saturating_sub(1))
    }

    /// How the line did over the last day, below the rows where there is room for it.
    fn day(&self, cx: &ViewContext, page: &mut Canvas, rows: u16) {
        let (width, height) = (page.width(), page.height());
        if height < rows + DAY_HEIGHT {
            return;
        }
        let below = (rows + 1).min(height - DAY_HEIGHT);
        let mut day = page.part(1, below, width.saturating_sub(2), DAY_HEIGHT);
        line_trend(cx, &mut day, &self.minutes);
    }

    /// So many lines on, around the end.
    fn choose_line(&mut self, cx: &ViewContext, by: isize) {
        let count = cx.def().lines.len().max(1) as isize;
        self.line = LineId((self.line.index() as isize + by).rem_euclid(count) as u16);
        (self.first, self.plan) = (0, plan::Plan::default());
        self.frames.forget();
        self.test.first = None;
        self.minutes.clear();
        self.periodic = PeriodicQuery::default();
    }

    fn scroll(&mut self, cx: &ViewContext, at: &Place, by: isize) {
        match self.page {
            Page::Line if by.abs() == 1 && 1 < cx.def().lines.len() => self.choose_line(cx, by),
            Page::Line => {
                let rows = line::rows(cx, at, cx.area.width).len();
                self.first = self.first.saturating_add_signed(by).min(rows::last_first(rows, self.room(cx)));
            }
            Page::Plan => self.plan.scroll(at, by),
            Page::Frames => self.frames.scroll(cx, at, by),
            Page::Test => self.test.scroll(cx, at, by),
        }
    }

    fn open(&mut self, cx: &ViewContext, at: &Place) -> Vec<UiAction> {
        match self.page {
            Page::Line => Vec::new(),
            Page::Plan => self.plan.open(at).into_iter().collect(),
            Page::Frames => self.frames.open(at).into_iter().collect(),
            Page::Test => self.test.open(cx, at, self.test.selected()),
        }
    }

    /// The pages, and the line with its state.
    fn heading(&self, cx: &ViewContext, at: &Place, canvas: &mut Canvas) {
        let mut x = 1;
        for page in Page::ALL {
            let shown = page == self.page;
            let text = if shown { format!("‹{}›", page.title()) } else { format!(" {} ", page.title()) };
            x = canvas.text(x, 0, &text, if shown { cx.theme.focus() } else { cx.theme.dim() });
        }
        let end = canvas.width().saturating_sub(1);
        let place = match cx.def().lines.len() {
            1 => String::new(),
            count => format!(" {}/{count}", at.id.0 + 1),
        };
        let words =
            fit_words(&format!("{}{place}  {}", at.settings.name, state_words(cx, at)), end.saturating_sub(x + 2));
        let style = if at.status.state == LineState::Connected { cx.theme.normal() } else { cx.theme.trouble() };
        canvas.text(end.saturating_sub(width(&words)), 0, &words, style);
    }
}

/// A line and all that is known of it.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Which.
    id: LineId,
    /// Its state and totals.
    status: &'a LineStatus,
    /// In use now.
    settings: &'a LineDef,
    /// `None` until the line has reported.
    report: Option<&'a LineReport>,
}

impl<'a> Place<'a> {
    fn of(cx: &ViewContext<'a>, id: LineId) -> Option<Place<'a>> {
        let def = cx.def().lines.get(id.index())?;
        let status = cx.snapshot.lines.get(id.index())?;
        let report = status.report.as_deref();
        Some(Place { id, status, settings: report.map_or(def, |report| &report.settings), report })
    }

    fn is_testing(&self) -> bool {
        use crate::plant::diagnostics::DiagnosticState;
        self.status.test.as_ref().is_some_and(|run| run.state == DiagnosticState::Running)
    }
}

/// The devices that do not answer are asked at once: those of a line, or of all.
pub fn retry(cx: &ViewContext, line: Option<LineId>) -> Vec<UiAction> {
    let silent = |device: &&DeviceDef| match cx.snapshot.device(device.id).state {
        DeviceState::Failing(_) | DeviceState::Down { .. } => line.is_none_or(|line| line == device.line),
        DeviceState::Unknown | DeviceState::Answering => false,
    };
    cx.def().devices.iter().filter(silent).map(|device| UiAction::Command(CommandKind::Refresh(device.id))).collect()
}

/// `connected since 13:02:11`, `DOWN 00:12: No such file or directory, next try in 4s`.
fn state_words(cx: &ViewContext, at: &Place) -> String {
    let zone = &cx.def().time_zone;
    let since = at
        .status
        .since
        .map_or(String::new(), |since| format!(" since {}", crate::ui::widgets::text::moment(since, cx.now, zone)));
    match &at.status.state {
        LineState::Connected => format!("connected{since}"),
        LineState::Connecting => "connecting".to_owned(),
        LineState::Waiting { why, retry_at } => {
            let lost =
                at.status.lost_since.map_or(String::new(), |lost| format!(" {}", running(between(lost, cx.now))));
            format!("DOWN{lost}, next try in {}s: {why}", between(cx.now, *retry_at).as_secs())
        }
        LineState::Disconnected => format!("DISCONNECTED by an operator{since}"),
        LineState::Testing => format!("TEST{since}, nobody is polled"),
    }
}

fn page_keys(page: Page) -> &'static [Key<Action>] {
    match page {
        Page::Line => LINE_KEYS,
        Page::Plan => PLAN_KEYS,
        Page::Frames => FRAMES_KEYS,
        Page::Test => TEST_KEYS,
    }
}

/// The keys of each page together with those of every page, for the test that no key means two things.
#[cfg(test)]
pub fn all_chords() -> Vec<(&'static str, Vec<keys::Chord>)> {
    let chords = |page: &Page| page_keys(*page).iter().chain(KEYS).map(|key| key.chord).collect();
    Page::ALL.iter().map(|page| (page.title(), chords(page))).collect()
}
