//! Tab 2: curves of the plant's groups over a moving window or since the start of the day, past and live as one curve;
//! and a page with every stored value and its last hour.

mod data;
mod keys;
mod span;
mod view;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

pub use self::keys::{Action, KEYS};
use self::span::{RATES, View, WINDOWS, midnight, nearest, pan};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        def::{Pen, TrendGroup},
        record::{AlarmEvent, AlarmRecord},
    },
    ui::{
        keys::{find, hints},
        widgets::chart::{self, trace::Trace},
    },
};

/// An answer that takes longer (real time) is taken for lost.
const PATIENCE_S: f64 = 15.0;
/// The tab was out of sight if it heard nothing for so long (real time): what happened meanwhile only the history knows.
const UNSEEN_S: f64 = 3.0;
/// The history may lag behind the present: it commits once a second (real time), and a commit takes up to another.
const COMMIT_LAG_S: f64 = 3.0;
/// Columns of the last hour, a minute each.
const HOUR_COLUMNS: usize = 60;
/// Alarms marked on the time axis at most.
const MARKS_MAX: usize = 200;

/// State of this tab.
#[derive(Debug)]
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
    /// The list of values instead of the curves: first row shown, row selected.
    values: Option<(usize, usize)>,
    data: Data,
    periodics: PeriodicQueries,
}

/// What the history and the snapshots have told.
#[derive(Debug, Default)]
struct Data {
    traces: BTreeMap<TagId, Trace>,
    /// Figures of the view up to now, by tag: (min, mean, max) and the share of good time.
    figures: BTreeMap<TagId, Figures>,
    hours: BTreeMap<TagId, Series>,
    raised: Vec<AlarmRecord>,
    trouble: Option<String>,
    /// When the tab last heard of the plant.
    seen: Option<Timestamp>,
}

type Figures = (Option<(f64, f64, f64)>, f64);

/// The queries of this tab.
#[derive(Debug, Default)]
struct PeriodicQueries {
    curves: PeriodicQuery,
    hours: PeriodicQuery,
    raised: PeriodicQuery,
    number: u32,
}

impl TabView for Trends {
    fn new(_snapshot: &Snapshot) -> Trends {
        Trends {
            group: 0,
            picked: None,
            off: Vec::new(),
            selected: 0,
            window: WINDOWS.iter().position(|window| *window == 600).unwrap_or(0),
            rate: 1,
            accumulate: false,
            since: None,
            end: None,
            cursor: None,
            values: None,
            data: Data::default(),
            periodics: PeriodicQueries::default(),
        }
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        // Either way: the time of a snapshot may lie a little before what was guessed until it came.
        let away = |seen: Timestamp| cx.now.duration_since(seen).abs() > real(cx, UNSEEN_S);
        let unseen = self.data.seen.is_none_or(away);
        if unseen {
            self.data.traces.clear();
            self.moved();
            self.periodics.hours.want();
        }
        self.data.seen = Some(cx.now);
        self.push_live(cx);
        self.ask(cx)
    }

    fn awaits(&self, number: u32) -> bool {
        let PeriodicQueries { curves, hours, raised, number: _ } = &self.periodics;
        [curves, hours, raised].iter().any(|periodic| periodic.awaits(number))
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        let (periodics, steady) = (&mut self.periodics, cx.steady());
        let curves = periodics.curves.answered(number, steady);
        let (hours, raised) = (periodics.hours.answered(number, steady), periodics.raised.answered(number, steady));
        let answer = match answer {
            Ok(answer) => answer,
            Err(error) => {
                if curves.or(hours).or(raised).is_some() {
                    self.data.trouble = Some(error.to_string());
                }
                return Vec::new();
            }
        };
        match answer {
            Answer::Series(series) => {
                if let Some(asked) = curves {
                    self.data.trouble = None;
                    // Asked at a steady time, about times in UTC.
                    self.accept_curves(cx, series, asked.checked_add(cx.snapshot.stepped).unwrap_or(asked));
                } else if hours.is_some() {
                    self.data.trouble = None;
                    self.data.hours = series.into_iter().map(|series| (series.tag, series)).collect();
                }
            }
            Answer::Journal(records) if raised.is_some() => {
                self.data.raised = records.into_iter().filter(|record| record.event == AlarmEvent::Raised).collect();
            }
            Answer::Journal(_)
            | Answer::Actions(_)
            | Answer::LineMinutes(_)
            | Answer::Report(_)
            | Answer::AlarmMetrics(_)
            | Answer::Values(_) => {}
        }
        self.ask(cx)
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }

    fn on_key(&mut self, cx: &ViewContext, event: KeyEvent) -> Vec<UiAction> {
        find(KEYS, event).map(|action| self.act(cx, action)).unwrap_or_default()
    }

    fn hints(&self, _cx: &ViewContext) -> Vec<Hint> {
        hints(KEYS)
    }

    #[cfg(test)]
    fn chords() -> crate::ui::keys::PageChords {
        vec![("trends", crate::ui::keys::chords_of(KEYS))]
    }
}

impl Trends {
    fn act(&mut self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        match (self.values, action) {
            (Some(_), Action::Up) => self.select_value(cx, -1),
            (Some(_), Action::Down) => self.select_value(cx, 1),
            (Some(_), Action::PageBack) => self.select_value(cx, -(self.rows(cx) as isize)),
            (Some(_), Action::PageOn) => self.select_value(cx, self.rows(cx) as isize),
            (Some((_, row)), Action::Open) => self.open(cx, row),
            (Some((_, row)), Action::Why) => return Why::open(Why::new(stored(cx), row)),
            (None, Action::Why) => {
                let pens = self.pens(cx).into_iter().map(|pen| pen.tag).collect();
                return Why::open(Why::new(pens, self.selected));
            }
            (_, Action::Values) => {
                self.values = if self.values.is_some() { None } else { Some((0, 0)) };
                self.periodics.hours.want();
            }
            (Some(_), _) => {}
            (None, Action::Left) => self.step(cx, -1),
            (None, Action::Right) => self.step(cx, 1),
            (None, Action::PageBack) => self.pan(cx, -4),
            (None, Action::PageOn) => self.pan(cx, 4),
            (None, Action::Up) => self.selected = self.selected.saturating_sub(1),
            (None, Action::Down) => self.selected = (self.selected + 1).min(self.pens(cx).len().saturating_sub(1)),
            (None, Action::Toggle) => self.toggle(cx),
            (None, Action::Open) => {}
            (None, Action::ZoomIn) => self.zoom(cx, -1),
            (None, Action::ZoomOut) => self.zoom(cx, 1),
            (None, Action::Group) => self.next_group(cx),
            (None, Action::Mode) => {
                (self.accumulate, self.since, self.end) = (!self.accumulate, None, None);
                self.moved();
            }
            (None, Action::Rate) => self.rate = (self.rate + 1) % RATES.len(),
            (None, Action::Cursor) => self.cursor = if self.cursor.is_some() { None } else { Some(cx.now) },
            (None, Action::Live) => {
                (self.end, self.cursor) = (None, None);
                self.moved();
            }
        }
        self.ask(cx)
    }

    /// Shows the curve of a tag with the cursor at a moment, and a quarter of the window after it.
    pub fn show(&mut self, cx: &ViewContext, tag: TagId, at: Timestamp) {
        self.open_tag(cx, tag);
        let after = SignedDuration::from_secs(WINDOWS[self.window]) / 4;
        let end = at.checked_add(after).ok().filter(|end| *end < cx.now);
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
                let day = midnight(cx.now, &cx.def().time_zone);
                View::since(self.since.map_or(day, |since| since.max(day)), cx.now, columns)
            }
            (_, end) => View::ending(end.unwrap_or(cx.now), WINDOWS[self.window], columns),
        }
    }

    /// The cursor, kept on the screen.
    fn cursor(&self, cx: &ViewContext) -> Option<Timestamp> {
        let view = self.span(cx);
        let last = view.to.min(cx.now).checked_sub(SignedDuration::from_micros(1)).unwrap_or(view.to);
        self.cursor.map(|at| at.min(last).max(view.from))
    }

    /// A step to the side: of the cursor by one cell, or of the view by a quarter.
    fn step(&mut self, cx: &ViewContext, by: i32) {
        let Some(at) = self.cursor(cx) else { return self.pan(cx, by) };
        let view = self.span(cx);
        let cell = view.width() / i32::from(cx.area.width.saturating_sub(12).max(10));
        let to = at.checked_add(cell * by).unwrap_or(at);
        if to < view.from || (to >= view.to && self.end.is_some()) {
            self.pan(cx, by);
        }
        self.cursor = Some(to);
        self.cursor = self.cursor(cx);
    }

    /// Moves the view by quarters; a view of the whole day becomes a window.
    fn pan(&mut self, cx: &ViewContext, quarters: i32) {
        let end = self.end.unwrap_or(cx.now);
        if self.accumulate {
            self.window = nearest(self.span(cx).width());
            self.accumulate = false;
        }
        let by = SignedDuration::from_secs(WINDOWS[self.window]) / 4 * quarters;
        self.end = pan(end, by, cx.now);
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
        self.periodics.curves.want();
    }

    fn next_group(&mut self, cx: &ViewContext) {
        let count = cx.def().trends.len() + usize::from(self.picked.is_some());
        self.show_group(cx, (self.group + 1) % count.max(1), 0);
    }

    fn show_group(&mut self, cx: &ViewContext, group: usize, selected: usize) {
        (self.group, self.selected, self.since) = (group, selected, None);
        let tags: Vec<TagId> = self.pens(cx).iter().map(|pen| pen.tag).collect();
        self.data.traces.retain(|tag, _| tags.contains(tag));
        self.moved();
        self.periodics.hours.want();
        self.push_live(cx);
    }

    /// The chart shows another stretch of time or other pens; figures of the old one must not stand beside it.
    fn moved(&mut self) {
        self.data.figures.clear();
        self.periodics.curves.want();
        self.periodics.raised.want();
    }

    /// Rows that the list of values has room for.
    fn rows(&self, cx: &ViewContext) -> usize {
        usize::from(cx.area.height.saturating_sub(2)).max(1)
    }

    fn select_value(&mut self, cx: &ViewContext, by: isize) {
        let Some((first, row)) = self.values else { return };
        let row = row.saturating_add_signed(by).min(stored(cx).len().saturating_sub(1));
        let first_now = first.clamp((row + 1).saturating_sub(self.rows(cx)), row);
        if first_now != first {
            self.periodics.hours.want();
        }
        self.values = Some((first_now, row));
    }

    /// Shows the curve of a value: in the group of the plant that has it, or alone.
    fn open(&mut self, cx: &ViewContext, row: usize) {
        if let Some(tag) = stored(cx).get(row).copied() {
            self.open_tag(cx, tag);
        }
    }

    fn open_tag(&mut self, cx: &ViewContext, tag: TagId) {
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
    cx.def().tags.iter().filter(|tag| tag.store).map(|tag| tag.id).collect()
}

/// Seconds of the operator's time as plant time, which runs faster in demonstrations.
fn real(cx: &ViewContext, seconds: f64) -> SignedDuration {
    SignedDuration::from_secs_f64(seconds * cx.snapshot.speed.clamp(0.01, 1e6))
}
