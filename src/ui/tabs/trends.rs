//! Tab 2: curves of the plant's groups over a moving window or since the start of the day, past and live as one curve;
//! and a page with every stored value and its last hour.

mod data;
mod keys;
mod replay;
pub(super) mod span;
mod view;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

pub use self::keys::{Action, KEYS};
use self::span::{RATES, View, WINDOWS, around, midnight, nearest, pan};
use crate::ui::tabs::{prelude::*, reports::period};
use crate::{
    history::Series,
    plant::{
        def::{Pen, TrendGroup},
        record::AlarmRecord,
    },
    ui::{
        keys::{find, hints},
        widgets::chart::{self, trace::Trace},
    },
};

/// An answer that takes longer (real time) is taken for lost.
const TIMEOUT_S: f64 = 15.0;
/// The tab was out of sight if it got no snapshot for so long (real time): what happened meanwhile only the history knows.
const UNSEEN_S: f64 = 3.0;
/// The history may lag behind the present: it commits once a second (real time), and a commit takes up to another.
const COMMIT_LAG_S: f64 = 3.0;
/// Columns of the last hour, a minute each.
const HOUR_COLUMNS: usize = 60;
/// Alarms marked on the time axis at most.
const MARKS_MAX: usize = 200;

/// State of this tab.
#[derive(Debug, Default)]
pub struct Trends {
    /// Groups of the plant, and behind them the tag that was picked in the list of values.
    group: usize,
    picked: Option<TagId>,
    off: Vec<TagId>,
    selected: usize,
    /// Place in [`WINDOWS`].
    window: usize,
    /// Place in [`RATES`].
    rate: usize,
    /// Everything since the start of the day instead of a window.
    accumulate: bool,
    /// The column in which the first value of the day was found.
    since: Option<Timestamp>,
    /// Right edge of a view of the past; `None` is the present.
    end: Option<Timestamp>,
    cursor: Option<Timestamp>,
    /// The instant of the replay that it follows.
    replayed: Option<Timestamp>,
    /// The list of values instead of the curves: first row shown, row selected.
    values: Option<(usize, usize)>,
    /// When the tab last got a snapshot.
    seen: Option<Timestamp>,
    traces: BTreeMap<TagId, Trace>,
    /// Figures of the view up to now, by tag: (min, mean, max) and the share of good time.
    figures: BTreeMap<TagId, Figures>,
    /// The query for curves, and why the last one failed.
    curves: PeriodicQuery,
    trouble: Option<String>,
    hours: Answered<Vec<Series>>,
    raised: Answered<Vec<AlarmRecord>>,
    /// Queries asked so far.
    asked: u32,
    /// Values without a unit have a scale each: nothing says that they are alike.
    apart: bool,
    /// Nothing comes any more: what is shown is a log.
    ended: bool,
}

type Figures = (Option<(f64, f64, f64)>, f64);

impl TabView for Trends {
    fn new(_snapshot: &Snapshot) -> Trends {
        let window = WINDOWS.iter().position(|window| *window == 600).unwrap_or(0);
        Trends { window, rate: 1, ..Trends::default() }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.follow_replay(cx);
        // Either way: the time of a snapshot may lie a little before what was guessed until it came.
        let away = |seen: Timestamp| cx.present().duration_since(seen).abs() > real(cx, UNSEEN_S);
        let unseen = self.seen.is_none_or(away);
        if unseen {
            self.traces.clear();
            self.moved();
            self.hours.query.want();
        }
        self.seen = Some(cx.present());
        self.push_live(cx);
        self.ask(cx)
    }

    fn awaits(&self, number: u32) -> bool {
        [&self.curves, &self.hours.query, &self.raised.query].iter().any(|query| query.awaits(number))
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        self.hours.on_answer(cx, number, &answer);
        self.raised.on_answer(cx, number, &answer);
        if let Some(asked) = self.curves.answered(number, cx.steady()) {
            self.trouble = answer.as_ref().err().map(HistoryError::to_string);
            if let Ok(Answer::Series(series)) = answer {
                // Asked at a steady time, about times in UTC.
                self.accept_curves(cx, series, asked.checked_add(cx.snapshot.stepped).unwrap_or(asked));
            }
        }
        self.ask(cx)
    }

    fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        self.cursor(cx)
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        let cancelled = [&mut self.curves, &mut self.hours.query].map(|query| query.cancel(cx));
        cancelled.contains(&true)
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        find(KEYS, event).map(|action| self.act(cx, action)).unwrap_or_default()
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        let asked = period::typed(cx.def(), text, cx.present())?;
        if asked.to < cx.present() {
            self.window = nearest(asked.to.duration_since(asked.from));
            (self.accumulate, self.since, self.end) = (false, None, Some(asked.to));
            self.moved();
        } else {
            self.go_to_moment(cx, asked.from);
        }
        Ok(self.ask(cx))
    }

    fn hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let of_present = [Action::Live, Action::Mode, Action::Hold, Action::Cursor, Action::Rate, Action::GoTo];
        let keys = KEYS.iter().filter(|key| !cx.is_past() || !of_present.contains(&key.action));
        hints(&keys.copied().collect::<Vec<_>>())
    }

    #[cfg(test)]
    fn chords() -> crate::ui::keys::PageChords {
        vec![("trends", crate::ui::keys::chords_of(KEYS))]
    }
}

impl Trends {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        match (self.values, action) {
            (Some((first, row)), Action::Move(motion)) => self.select_value(cx, first, row, motion),
            (Some((_, row)), Action::Open) => {
                if let Some(tag) = stored(cx).get(row) {
                    self.open_tag(cx, *tag);
                }
            }
            (Some((_, row)), Action::Why) => return Why::open(Why::new(stored(cx), row)),
            (None, Action::Why) => {
                let pens = self.pens(cx).into_iter().map(|pen| pen.tag).collect();
                return Why::open(Why::new(pens, self.selected));
            }
            (_, Action::Values) => {
                self.values = if self.values.is_some() { None } else { Some((0, 0)) };
                self.hours.query.want();
            }
            (Some(_), _) => {}
            (None, Action::Side(by)) if cx.is_past() => return self.replay_by(self.cell(cx), by),
            (None, Action::Move(Motion::Pages(by))) if cx.is_past() => {
                return self.replay_by(SignedDuration::from_secs(WINDOWS[self.window]), by);
            }
            (None, Action::Live) if cx.is_past() => self.go_to_moment(cx, cx.now),
            // The instant of the replay is in the view with the cursor on it, and nothing moves.
            (None, Action::Mode | Action::Hold | Action::Cursor | Action::Rate | Action::GoTo) if cx.is_past() => {}
            (None, Action::Side(by)) => self.step(cx, by),
            (None, Action::Move(Motion::Pages(by))) => self.pan(cx, 4 * by),
            (None, Action::Move(motion)) => self.selected = motion.to(self.selected, self.pens(cx).len(), 1),
            (None, Action::Toggle) => self.toggle(cx),
            (None, Action::Open) => {}
            (None, Action::Zoom(by)) => self.zoom(cx, by),
            (None, Action::Group) => self.next_group(cx),
            (None, Action::Mode) => {
                (self.accumulate, self.since, self.end) = (!self.accumulate, None, None);
                self.moved();
            }
            (None, Action::Hold) => {
                self.end = if self.end.is_some() { None } else { Some(cx.now) };
                if std::mem::take(&mut self.accumulate) {
                    self.window = nearest(self.span(cx).width());
                }
                self.moved();
            }
            (None, Action::Rate) => self.rate = (self.rate + 1) % RATES.len(),
            (None, Action::Cursor) => self.cursor = if self.cursor.is_some() { None } else { Some(cx.now) },
            // A log has no history behind it.
            (None, Action::GoTo) if self.apart => {}
            (None, Action::GoTo) => {
                let prompt = Prompt::new(t!("Go to a time"), t!("03:12   2026-11-20   2026-11-20 22:00-06:00"), "");
                return vec![UiAction::Open(Modal::Prompt(prompt))];
            }
            (None, Action::Live) => {
                (self.end, self.cursor) = (None, None);
                self.moved();
            }
        }
        self.ask(cx)
    }

    /// Shows the curve of a tag over a stretch of time, with a little before and after it; at a moment, with the cursor.
    pub fn show(&mut self, cx: &ViewContext, tag: TagId, (from, to): (Timestamp, Timestamp)) {
        self.open_tag(cx, tag);
        if from == to {
            return self.go_to_moment(cx, from);
        }
        let (window, end) = around((from, to));
        (self.accumulate, self.since, self.cursor) = (false, None, None);
        (self.window, self.end) = (window, Some(end).filter(|end| *end < cx.present()));
        self.moved();
    }

    /// The width of a cell of the chart.
    fn cell(&self, cx: &ViewContext) -> SignedDuration {
        self.span(cx).width() / i32::from(cx.area.width.saturating_sub(12).max(10))
    }

    /// Puts the cursor on a moment, and a quarter of the window after it.
    fn go_to_moment(&mut self, cx: &ViewContext, at: Timestamp) {
        let after = SignedDuration::from_secs(WINDOWS[self.window]) / 4;
        let end = at.checked_add(after).ok().filter(|end| *end < cx.present());
        (self.accumulate, self.since, self.end, self.cursor) = (false, None, end, Some(at));
        self.moved();
    }
}

impl Trends {
    /// The pens of the shown group, at most eight; behind the plant's groups comes the tag picked from the list.
    fn pens(&self, cx: &ViewContext) -> Vec<Pen> {
        let picked = || self.picked.map(|tag| Pen { tag, scale: None }).into_iter().collect();
        cx.def().trends.get(self.group).map_or_else(picked, |group| group.pens.iter().take(8).copied().collect())
    }

    /// The pens that are switched on, with their place in the group.
    fn drawn(&self, cx: &ViewContext) -> Vec<(usize, Pen)> {
        self.pens(cx).into_iter().enumerate().filter(|(_, pen)| !self.off.contains(&pen.tag)).collect()
    }

    /// What the chart shows now.
    fn span(&self, cx: &ViewContext) -> View {
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

    /// The cursor, kept on the screen.
    fn cursor(&self, cx: &ViewContext) -> Option<Timestamp> {
        let view = self.span(cx);
        let last = view.to.min(cx.present()).checked_sub(SignedDuration::from_micros(1)).unwrap_or(view.to);
        self.cursor.map(|at| at.min(last).max(view.from))
    }

    /// A step to the side: of the cursor by one cell, or of the view by a quarter.
    fn step(&mut self, cx: &ViewContext, by: isize) {
        let Some(at) = self.cursor(cx) else { return self.pan(cx, by) };
        let view = self.span(cx);
        let to = at.checked_add(self.cell(cx) * i32::try_from(by).unwrap_or_default()).unwrap_or(at);
        if to < view.from || (to >= view.to && self.end.is_some()) {
            self.pan(cx, by);
        }
        self.cursor = Some(to);
        self.cursor = self.cursor(cx);
    }

    /// Moves the view by quarters; a view of the whole day becomes a window.
    fn pan(&mut self, cx: &ViewContext, quarters: isize) {
        let end = self.end.unwrap_or(cx.present());
        if self.accumulate {
            self.window = nearest(self.span(cx).width());
            self.accumulate = false;
        }
        let by = SignedDuration::from_secs(WINDOWS[self.window]) / 4 * i32::try_from(quarters).unwrap_or_default();
        self.end = pan(end, by, cx.present());
        self.moved();
    }

    fn zoom(&mut self, cx: &ViewContext, by: isize) {
        if self.accumulate {
            self.window = nearest(self.span(cx).width());
            self.accumulate = false;
        } else {
            self.window = self.window.saturating_add_signed(by).min(WINDOWS.len() - 1);
        }
        self.moved();
    }

    fn toggle(&mut self, cx: &ViewContext) {
        let Some(pen) = self.pens(cx).get(self.selected).copied() else { return };
        match self.off.iter().position(|off| *off == pen.tag) {
            Some(place) => drop(self.off.remove(place)),
            None => self.off.push(pen.tag),
        }
        self.curves.want();
    }

    fn next_group(&mut self, cx: &ViewContext) {
        let count = cx.def().trends.len() + usize::from(self.picked.is_some());
        self.show_group(cx, (self.group + 1) % count.max(1), 0);
    }

    fn show_group(&mut self, cx: &ViewContext, group: usize, selected: usize) {
        (self.group, self.selected, self.since) = (group, selected, None);
        let tags: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        self.traces.retain(|tag, _| tags.contains(tag));
        self.moved();
        self.hours.query.want();
        self.push_live(cx);
    }

    /// The chart shows another stretch of time or other pens; figures of the old one must not stand beside it.
    fn moved(&mut self) {
        self.figures.clear();
        self.curves.want();
        self.raised.query.want();
    }

    fn select_value(&mut self, cx: &ViewContext, first: usize, row: usize, motion: Motion) {
        let rows = usize::from(cx.area.height.saturating_sub(2)).max(1);
        let row = motion.to(row, stored(cx).len(), rows);
        let first_now = first.clamp((row + 1).saturating_sub(rows), row);
        if first_now != first {
            self.hours.query.want();
        }
        self.values = Some((first_now, row));
    }

    /// Trends of values of which no plant file says what they are, in a window of so much time, as far as one can be;
    /// `ended` where they are those of a log.
    pub fn of_registers(snapshot: &Snapshot, span: SignedDuration, ended: bool) -> Trends {
        Trends { window: nearest(span), apart: true, ended, ..TabView::new(snapshot) }
    }

    /// Shows the curve of a tag: in the group of the plant that has it, or alone.
    pub fn open_tag(&mut self, cx: &ViewContext, tag: TagId) {
        let groups = &cx.def().trends;
        let place = |group: &TrendGroup| group.pens.iter().take(8).position(|pen| pen.tag == tag);
        let found = groups.iter().enumerate().find_map(|(n, group)| Some((n, place(group)?)));
        if found.is_none() {
            self.picked = Some(tag);
        }
        self.values = None;
        self.off.retain(|off| *off != tag);
        let (group, selected) = found.unwrap_or((groups.len(), 0));
        self.show_group(cx, group, selected);
    }
}

/// All stored tags, in the order of the plant.
fn stored(cx: &ViewContext) -> Vec<TagId> {
    cx.def().tags.iter().filter(|tag| tag.is_stored()).map(|tag| tag.id).collect()
}
