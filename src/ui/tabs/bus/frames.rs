//! Page Frames: what went over the line, newest at the bottom, in words; runs, or is held still.

use std::{collections::VecDeque, path::PathBuf};

use super::{LineView, Shown, TextWindow, Window, bytes_text};
use crate::ui::tabs::prelude::*;
use crate::{
    bus::{capture, dissect, filter::Filter, wide_addresses::WideAddresses},
    plant::{
        def::LineId,
        request_refusal::RequestRefusal,
        traffic::{Frame, Frames},
    },
    text::file,
    ui::tabs::Outgoing,
};

/// The page takes in what is new every this many half seconds: reading needs time, and slow lines have few bytes a second.
const EVERY: u32 = 4;

#[derive(Debug, Default)]
pub struct Ring {
    /// Takes in nothing new.
    paused: bool,
    held: Frames,
    /// Tick at which they were taken in; `None` before the first time.
    read_at: Option<u32>,
    /// Number of the selected frame; `None`: the newest.
    selected: Option<u64>,
    filter: Filter,
    saved: Vec<Result<PathBuf, String>>,
    /// Files that wait for the station's word; two at most.
    outgoing: VecDeque<Outgoing>,
}

impl Ring {
    /// Another line: its frames are taken in at once.
    pub fn forget(&mut self) {
        let outgoing = std::mem::take(&mut self.outgoing);
        *self = Ring { filter: self.filter.clone(), outgoing, ..Ring::default() };
    }

    /// Takes in what is new, if it runs and it is time.
    pub fn follow(&mut self, cx: &ViewContext, at: &LineView) {
        let due = self.read_at.is_none_or(|taken| EVERY <= cx.phase.wrapping_sub(taken));
        if (!self.paused || self.read_at.is_none()) && due {
            self.read_frames(cx, at);
        }
    }

    fn read_frames(&mut self, cx: &ViewContext, at: &LineView) {
        if let Some(report) = at.report {
            self.held = report.frames.clone();
            self.read_at = Some(cx.phase);
        }
    }

    /// Holds still, or runs on from the newest frame.
    pub fn toggle(&mut self, cx: &ViewContext, at: &LineView) {
        self.paused = !self.paused;
        self.selected = None;
        if !self.paused {
            self.read_frames(cx, at);
        }
    }

    /// Frames that were held still run on; `false` if they ran.
    pub fn back(&mut self, cx: &ViewContext, at: &LineView) -> bool {
        let paused = self.paused;
        if paused {
            self.toggle(cx, at);
        }
        paused
    }

    /// Clears the note about the last files.
    pub fn dismiss(&mut self) {
        self.saved.clear();
    }

    /// Moves the selection; looking back holds still.
    pub fn scroll(&mut self, cx: &ViewContext, at: &LineView, motion: Motion, room: usize) {
        if self.read_at.is_none() {
            self.read_frames(cx, at);
        }
        self.paused = true;
        let shown = self.shown();
        let place = motion.to(self.place(&shown), shown.len(), room);
        self.selected = shown.get(place).map(|frame| frame.number);
    }

    /// The selected frame, byte by byte.
    pub fn open(&mut self, at: &LineView) -> Option<UiAction> {
        let shown = self.shown();
        // Frames that run go on below the window, which has this one for itself.
        let frame = (*shown.get(self.place(&shown))?).clone();
        let before: Vec<Frame> = self.before(frame.number).take(16).cloned().collect();
        let shown = Shown::Frame { line: at.settings.name.clone(), frame: Box::new(frame), before };
        Some(Window::Text(TextWindow::new(shown)).open())
    }

    pub fn ask_filter(&self) -> UiAction {
        let hint = t!("unit 1   fc 3   tx   rx   error   03EA (bytes); all must match; empty: all frames");
        UiAction::Open(Modal::Prompt(Prompt::new(t!("filter frames"), hint, &self.filter.to_string())))
    }

    pub fn set_filter(&mut self, text: &str) -> Result<(), String> {
        self.filter = Filter::parse(text).map_err(|error| error.to_string())?;
        Ok(())
    }

    /// Writes the frames that are shown, as text and as a capture.
    pub fn save(&mut self, cx: &ViewContext, at: &LineView) -> Vec<UiAction> {
        if !self.outgoing.is_empty() {
            return Vec::new();
        }
        if self.read_at.is_none() {
            self.read_frames(cx, at);
        }
        let frames: Vec<Frame> = self.shown().into_iter().cloned().collect();
        self.saved.clear();
        if frames.is_empty() {
            self.saved.push(Err(t!("no frames to save").to_owned()));
            return Vec::new();
        }
        let stamp = cx.local(cx.now, "%Y-%m-%d-%H%M%S");
        let name = |end: &str| cx.def().report.folder.join(format!("{}-{stamp}.{end}", at.settings.name));
        let outgoing = |path, bytes| Outgoing { tab: Tab::Bus, path, bytes, new: false };
        let text = outgoing(name("txt"), file(|| capture::text(&frames)).into_bytes());
        self.outgoing = VecDeque::from([text, outgoing(name("pcapng"), file(|| capture::pcapng(&frames)))]);
        self.outgoing.front().map(Outgoing::export_request).into_iter().collect()
    }

    /// The station has put a file on record, which is then written, and the next one is asked for; or it refuses.
    pub fn on_request_done(&mut self, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        if let Err(why) = answer {
            self.outgoing.clear();
            self.saved.push(Err(why.to_string()));
            return Vec::new();
        }
        let written = self.outgoing.pop_front().map(Outgoing::write);
        let next = self.outgoing.front().map(Outgoing::export_request);
        written.into_iter().chain(next).collect()
    }

    /// A file was written, or why not.
    pub fn on_saved(&mut self, result: Result<PathBuf, String>) {
        self.saved.push(result);
    }

    pub fn view(&self, cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
        let theme = cx.theme;
        // Before the first message has come the page is drawn from the report itself.
        let held = at.report.map(|report| report.frames.clone()).unwrap_or_default();
        let now = Ring { held, filter: self.filter.clone(), ..Ring::default() };
        let ring = if self.read_at.is_some() { self } else { &now };
        let shown = ring.shown();
        let (width, height) = (canvas.width(), canvas.height());
        let (words, style) = self.heading(cx, shown.len());
        canvas.text(1, 0, &fit_words(&words, width.saturating_sub(2)), style);
        let notice = self.notice();
        let room = usize::from(height).saturating_sub(1 + notice.len());
        if shown.is_empty() {
            canvas.text(1, 2, t!("no frames, or none that match the filter"), theme.dim());
        }
        let place = ring.place(&shown);
        let first = list::first(place, shown.len(), room);
        let wide = WideAddresses::of(cx.def(), at.id);
        for (y, n, frame) in on_screen(&shown, first, room) {
            ring.row(cx, &wide, frame, self.selected.is_some() && n == place, &mut canvas.part(0, y + 1, width, 1));
        }
        for (n, (words, good)) in notice.iter().enumerate() {
            let y = height.saturating_sub(to_u16(notice.len() - n));
            canvas.text(1, y, words, if *good { theme.done() } else { theme.trouble() });
        }
    }

    fn heading(&self, cx: &ViewContext, count: usize) -> (String, ratatui::style::Style) {
        let filter = self.filter.to_string();
        let filter = if filter.is_empty() { String::new() } else { t!("   filter: {filter}", filter) };
        let zone = &cx.def().time_zone;
        let newest = self.held.iter().next_back().map_or(String::new(), |frame| clock(frame.at, zone));
        let (state, style) = match self.paused {
            true => (t!("PAUSED at {newest}, Esc resumes", newest), cx.theme.strong()),
            false => (t!("running, newest {newest} below", newest), cx.theme.dim()),
        };
        (t!("{count} of {max} frames, {state}{filter}", count, max = self.held.len().max(count), state, filter), style)
    }

    /// What became of the files, and how to open them.
    fn notice(&self) -> Vec<(String, bool)> {
        let line = |result: &Result<PathBuf, String>| match result {
            Ok(path) => {
                let wireshark = path.extension().is_some_and(|end| end == "pcapng");
                let how = if wireshark { t!("open with: wireshark ") } else { t!("read with: less ") };
                (t!("written; {how}{display}", how, display = path.display()), true)
            }
            Err(why) => (t!("NOT WRITTEN: {why}", why), false),
        };
        self.saved.iter().map(line).collect()
    }

    fn shown(&self) -> Vec<&Frame> {
        self.held.iter().filter(|frame| self.filter.matches(frame)).collect()
    }

    /// Place of the selected frame among those shown, or of the next one that is; else the last.
    fn place(&self, shown: &[&Frame]) -> usize {
        let last = shown.len().saturating_sub(1);
        self.selected.map_or(last, |number| shown.partition_point(|frame| frame.number < number).min(last))
    }

    /// The list that keys act on.
    pub fn drawn_rows(&self) -> Rows {
        let shown = self.shown();
        Rows::of(shown.iter().map(|frame| frame.number), self.place(&shown))
    }

    /// Earlier frames, the latest first.
    fn before(&self, number: u64) -> impl Iterator<Item = &Frame> {
        self.held.iter().rev().skip_while(move |frame| number <= frame.number)
    }

    /// `02:31.412 TX   1 01 03 03 E8 00 03 85 BB  read holding 41001–41003 (0x03E8, 3)`.
    fn row(&self, cx: &ViewContext, wide: &WideAddresses, frame: &Frame, selected: bool, canvas: &mut Canvas) {
        let theme = cx.theme;
        let has_room = 100 <= canvas.width();
        let time = cx.local(frame.at, if has_room { "%H:%M:%S%.3f" } else { "%M:%S%.3f" });
        let dissection = dissect::in_traffic(wide, frame, self.before(frame.number));
        let good = !frame.result.is_wrong();
        let refused = !frame.sent && dissection.message.get(1).is_some_and(|code| 0x80 <= *code);
        let style = match frame.sent && good && !selected {
            true => theme.dim(),
            false => row_style(cx, selected, !good || refused),
        };
        let bytes_room = (canvas.width().saturating_sub(20) * 2 / 5).clamp(11, 60);
        let bytes = pad(&cut_bytes(&bytes_text(frame.framing, &frame.bytes), bytes_room), bytes_room);
        let direction = if frame.sent { "TX" } else { "RX" };
        let unit = frame.unit.map_or(String::new(), |unit| unit.to_string());
        let x = canvas.text(1, 0, &format!("{time} {direction} {unit:>3} {bytes} "), style);
        let room = canvas.width().saturating_sub(x + 1);
        let summary = if has_room { dissection.summary } else { short(&dissection.what) };
        let words = match (good, refused) {
            (true, false) => summary,
            (true, true) => format!("! {summary}"),
            (false, _) if has_room => format!("✗ {}   {summary}", frame.result),
            (false, _) => format!("✗ {}", frame.result),
        };
        canvas.text(x, 0, &pad(&fit_words(&words, room), room), style);
    }
}

/// The newest frames below what else is shown of a line, as many as there is room for.
pub fn recent(cx: &ViewContext, at: &LineView, canvas: &mut Canvas) {
    let Some(report) = at.report else { return };
    let ring = Ring { held: report.frames.clone(), ..Ring::default() };
    let (shown, width) = (ring.shown(), canvas.width());
    canvas.run(0, 0, width, '─', cx.theme.dim());
    canvas.text(1, 0, t!(" recent frames, newest below "), cx.theme.dim());
    let (room, wide) = (usize::from(canvas.height().saturating_sub(1)), WideAddresses::of(cx.def(), at.id));
    for (y, _, frame) in on_screen(&shown, shown.len().saturating_sub(room), room) {
        ring.row(cx, &wide, frame, false, &mut canvas.part(0, y + 1, width, 1));
    }
}

/// The frames around an instant, as many as there is room for.
pub fn around(cx: &ViewContext, (line, frames): (LineId, &Frames), at: Timestamp, canvas: &mut Canvas) {
    let wide = WideAddresses::of(cx.def(), line);
    let ring = Ring { held: frames.clone(), ..Ring::default() };
    let (shown, room) = (ring.shown(), usize::from(canvas.height()));
    let place = shown.partition_point(|frame| frame.at <= at);
    let first = place.saturating_sub(room.div_ceil(2)).min(shown.len().saturating_sub(room));
    let width = canvas.width();
    for (y, n, frame) in on_screen(&shown, first, room) {
        ring.row(cx, &wide, frame, n + 1 == place, &mut canvas.part(0, y, width, 1));
    }
}

/// `read holding 41001–41003 (0x03E8, 3)`.
fn short(what: &str) -> String {
    let words =
        [(t!("holding registers"), t!("holding")), (t!("input registers"), t!("input")), (t!(" registers:"), ":")];
    words.into_iter().fold(what.to_owned(), |text, (long, short)| text.replacen(long, short, 1))
}

/// Whole bytes only: `01 03 14 00 …`.
fn cut_bytes(text: &str, room: u16) -> String {
    if text.contains(' ') { fit_words(text, room) } else { fit(text, room) }
}
