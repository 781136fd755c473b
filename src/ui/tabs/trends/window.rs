//! The stretch of time that is shown: zoom, pan and cursor.

use super::*;

/// Windows that can be gone back to at most; the oldest is forgotten.
const VISITED_MAX: usize = 32;

/// A way through the windows that were shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// To the one before.
    Back,
    /// To the one that was left by that.
    Forward,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Window {
    window: usize,
    end: Option<Timestamp>,
    accumulate: bool,
}

/// The windows before and after the one that is shown.
#[derive(Debug, Default)]
pub(super) struct Visited {
    back: Vec<Window>,
    forward: Vec<Window>,
    /// The last one was left by a step to the side: more steps are one move.
    stepped: bool,
}

impl Trends {
    fn shown(&self) -> Window {
        Window { window: self.window, end: self.end, accumulate: self.accumulate }
    }

    fn show_window(&mut self, window: Window) {
        (self.window, self.end, self.accumulate, self.since) = (window.window, window.end, window.accumulate, None);
        self.moved();
    }

    /// Remembers the window before another is shown.
    pub(super) fn visit(&mut self) {
        let shown = self.shown();
        let Visited { back, forward, stepped } = &mut self.visited;
        *stepped = false;
        if back.last() != Some(&shown) {
            back.push(shown);
            back.drain(..back.len().saturating_sub(VISITED_MAX));
        }
        forward.clear();
    }

    /// To the window before, or to the one that was left by that.
    pub(super) fn revisit(&mut self, direction: Direction) {
        let shown = self.shown();
        let Visited { back, forward, stepped } = &mut self.visited;
        *stepped = false;
        let (from, to) = match direction {
            Direction::Back => (back, forward),
            Direction::Forward => (forward, back),
        };
        if let Some(window) = from.pop() {
            to.push(shown);
            self.show_window(window);
        }
    }

    /// Shows the time between both cursors.
    pub(super) fn zoom_to_cursors(&mut self, cx: &ViewContext) {
        let Some((a, b)) = self.both().filter(|(a, b)| a != b) else { return };
        self.visit();
        let (window, end) = around((a.min(b), a.max(b)));
        self.show_window(Window { window, end: Some(end).filter(|end| *end < cx.present()), accumulate: false });
    }

    /// Shows a typed time or period.
    pub(super) fn go_to(&mut self, cx: &ViewContext, text: &str) -> Result<(), String> {
        let asked = period::typed(cx.def(), text, cx.present())?;
        self.visit();
        if asked.to < cx.present() {
            self.window = nearest(asked.to.duration_since(asked.from));
            (self.accumulate, self.since, self.end) = (false, None, Some(asked.to));
            self.moved();
        } else {
            self.go_to_moment(cx, asked.from);
        }
        Ok(())
    }

    /// Shows the curve of a tag over a stretch of time, with a little before and after it; at a moment, with the cursor.
    pub fn show(&mut self, cx: &ViewContext, tag: TagId, (from, to): (Timestamp, Timestamp)) {
        self.open_tag(cx, tag);
        if from == to {
            return self.go_to_moment(cx, from);
        }
        let (window, end) = around((from, to));
        (self.accumulate, self.since, self.cursor) = (false, None, None);
        self.between.clear();
        (self.window, self.end) = (window, Some(end).filter(|end| *end < cx.present()));
        self.moved();
    }

    /// The width of a cell of the chart.
    pub(super) fn cell(&self, cx: &ViewContext) -> SignedDuration {
        self.span(cx).width() / i32::from(cx.area.width.saturating_sub(12).max(10))
    }

    /// Puts the cursor on a moment, and a quarter of the window after it.
    pub(super) fn go_to_moment(&mut self, cx: &ViewContext, at: Timestamp) {
        let after = SignedDuration::from_secs(WINDOWS[self.window]) / 4;
        let end = at.checked_add(after).ok().filter(|end| *end < cx.present());
        (self.accumulate, self.since, self.end, self.cursor) = (false, None, end, Some(at));
        self.moved();
    }

    /// What the chart shows now.
    pub(super) fn span(&self, cx: &ViewContext) -> View {
        let units = self.drawn(cx).iter().map(|(_, pen)| cx.snapshot.unit(pen.tag)).collect::<BTreeSet<_>>();
        let columns = chart::dots(cx.theme, cx.area.width, units.len());
        match (self.accumulate, self.end) {
            (true, None) => {
                let day = midnight(cx.present(), &cx.def().time_zone);
                View::since(self.since.map_or(day, |since| since.max(day)), cx.present(), columns)
            }
            (_, None) => View::live(cx.present(), WINDOWS[self.window], columns),
            (_, Some(end)) => View::ending(end, WINDOWS[self.window], columns),
        }
    }

    /// An instant, kept on the screen and before now.
    pub(super) fn on_screen(&self, cx: &ViewContext, at: Timestamp) -> Timestamp {
        let view = self.span(cx);
        let last = view.to.min(cx.present()).checked_sub(SignedDuration::from_micros(1)).unwrap_or(view.to);
        at.min(last).max(view.from)
    }

    /// A moving window, or everything since the start of the day.
    pub(super) fn toggle_mode(&mut self) {
        self.visit();
        (self.accumulate, self.since, self.end) = (!self.accumulate, None, None);
        self.moved();
    }

    /// Pauses the chart, or goes on live.
    pub(super) fn hold(&mut self, cx: &ViewContext) {
        let width = self.span(cx).width();
        self.end = if self.end.is_some() { None } else { Some(cx.now) };
        if std::mem::take(&mut self.accumulate) {
            self.window = nearest(width);
        }
        self.moved();
    }

    /// Back to the present, without cursors; in a replay its instant comes into the view.
    pub(super) fn go_live(&mut self, cx: &ViewContext) {
        if cx.is_past() {
            return self.go_to_moment(cx, cx.now);
        }
        (self.end, self.cursor) = (None, None);
        self.between.clear();
        self.moved();
    }

    /// A step to the side: of the moved cursor by one cell, or of the view by a quarter.
    pub(super) fn step(&mut self, cx: &ViewContext, by: isize) {
        let Some(at) = self.moving(cx) else { return self.pan(cx, by) };
        let view = self.span(cx);
        let to = at.checked_add(self.cell(cx) * i32::try_from(by).unwrap_or_default()).unwrap_or(at);
        if to < view.from || (to >= view.to && self.end.is_some()) {
            self.pan(cx, by);
        }
        self.move_cursor(cx, to);
    }

    /// Moves the view by quarters; a view of the whole day becomes a window.
    pub(super) fn pan(&mut self, cx: &ViewContext, quarters: isize) {
        if !self.visited.stepped {
            self.visit();
            self.visited.stepped = true;
        }
        let end = self.end.unwrap_or(cx.present());
        if self.accumulate {
            self.window = nearest(self.span(cx).width());
            self.accumulate = false;
        }
        let by = SignedDuration::from_secs(WINDOWS[self.window]) / 4 * i32::try_from(quarters).unwrap_or_default();
        self.end = pan(end, by, cx.present());
        self.moved();
    }

    pub(super) fn zoom(&mut self, cx: &ViewContext, by: isize) {
        self.visit();
        if self.accumulate {
            self.window = nearest(self.span(cx).width());
            self.accumulate = false;
        } else {
            self.window = self.window.saturating_add_signed(by).min(WINDOWS.len() - 1);
        }
        self.moved();
    }

    /// The chart shows another stretch of time or other pens; figures of the old one must not stand beside it.
    pub(super) fn moved(&mut self) {
        self.figures.clear();
        self.curves.want();
        self.events.want();
    }
}
