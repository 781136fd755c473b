//! Tab 2: curves of the plant's groups over a moving window or since the start of the day, past and live as one curve;
//! and a page with every stored value and its last hour.

mod cursors;
mod data;
mod events;
mod export;
mod keys;
mod lanes;
mod legend;
mod numbers;
mod overlay;
mod pens;
mod picture;
mod plots;
mod pointer;
mod replay;
mod response;
pub(in crate::ui) mod span;
mod values;
mod view;
mod window;

#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use self::{
    cursors::Between,
    events::Events,
    export::Export,
    pens::PenScale,
    plots::Plot,
    response::Response,
    span::{RATES, View, WINDOWS, around, midnight, nearest, pan},
    values::StoredValues,
    window::Visited,
};
use crate::ui::tabs::{overlay::Overlay, prelude::*, reports::period};
use crate::{
    history::Series,
    plant::{
        def::{Pen, TrendGroup},
        record::AlarmRecord,
        request_refusal::RequestRefusal,
    },
    ui::{
        graphics::Picture,
        widgets::chart::{self, stroke::Stroke, trace::Trace},
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

#[derive(Debug, Default)]
pub struct Trends {
    /// Groups of the plant, and behind them the tags that were picked in the list of values.
    group: usize,
    /// A tag without a group that was opened alone; the marked ones stay.
    opened: Vec<TagId>,
    /// Scales that were typed, instead of those of the plant file.
    scales: BTreeMap<TagId, PenScale>,
    /// How pens are drawn that were given another look.
    strokes: BTreeMap<TagId, Stroke>,
    plot: Plot,
    /// The terminal's own picture lies over the chart.
    pub pictured: bool,
    response: Response,
    /// Periods over each other in place of the curves, and what was typed for them last.
    overlay: Option<Overlay>,
    typed_overlay: Option<String>,
    export: Export,
    /// What the text of the open window is for.
    asking: Asking,
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
    /// Earlier and later windows, to go back to.
    visited: Visited,
    cursor: Option<Timestamp>,
    /// Cursor B, and what lies between both.
    between: Between,
    /// The instant of the replay that it follows.
    replayed: Option<Timestamp>,
    /// All values with their last hour, as that of the pens; they are listed in place of the curves.
    values: List<StoredValues>,
    listed: bool,
    /// The tags whose last hour was asked for.
    hours_of: Vec<TagId>,
    /// When the tab last got a snapshot.
    seen: Option<Timestamp>,
    traces: BTreeMap<TagId, Trace>,
    /// Figures of the view up to now, by tag: (min, mean, max) and the share of good time.
    figures: BTreeMap<TagId, Figures>,
    /// The query for curves, and why the last one failed.
    curves: PeriodicQuery,
    trouble: Option<String>,
    events: Events,
    /// Values without a unit have a scale each: nothing says that they are alike.
    apart: bool,
    /// Nothing comes any more: what is shown is a log.
    ended: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Asking {
    #[default]
    Time,
    Scale(TagId),
    /// The periods that lie over each other.
    Overlay,
}

type Figures = (Option<(Exact, Exact, Exact)>, f64);

impl TabView for Trends {
    fn new(_snapshot: &Snapshot) -> Trends {
        let window = WINDOWS.iter().position(|window| *window == 600).unwrap_or(0);
        Trends { window, rate: 1, ..Trends::default() }
    }

    fn list(&self, _cx: &ViewContext) -> Option<&dyn ListPage> {
        self.listed.then_some(&self.values as &dyn ListPage)
    }

    fn list_mut(&mut self, _cx: &ViewContext) -> Option<&mut dyn ListPage> {
        self.listed.then_some(&mut self.values as &mut dyn ListPage)
    }

    fn on_snapshot(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.follow_replay(cx);
        // Either way: the time of a snapshot may lie a little before what was guessed until it came.
        let away = |seen: Timestamp| cx.present().duration_since(seen).abs() > real(cx, UNSEEN_S);
        let unseen = self.seen.is_none_or(away);
        if unseen {
            self.traces.clear();
            self.moved();
            self.values.answered.query.want();
        }
        self.seen = Some(cx.present());
        self.push_live(cx);
        self.ask(cx)
    }

    fn queries(&mut self) -> Queries<'_> {
        let own: Queries = vec![&mut self.values.answered, self.export.asked(), self.response.asked()];
        let parts = own.into_iter().chain(self.events.queries()).chain(self.between.queries());
        parts.chain(self.overlay.iter_mut().flat_map(Overlay::queries)).collect()
    }

    fn awaits(&mut self, number: u32) -> bool {
        self.curves.awaits(number) || self.queries().iter().any(|asked| asked.query().awaits(number))
    }

    fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: Result<Answer, HistoryError>) -> Vec<UiAction> {
        let exports = self.export.asked().query().awaits(number);
        let responds = self.response.asked().query().awaits(number);
        self.queries().into_iter().for_each(|asked| asked.on_answer(cx, number, &answer));
        self.between.drop_outdated();
        if responds {
            self.response.find();
        }
        let exported = if exports { self.accept_export(cx) } else { Vec::new() };
        if let Some(asked) = self.curves.answered(number, cx.monotonic_now()) {
            self.trouble = answer.as_ref().err().map(HistoryError::to_string);
            if let Ok(Answer::Series(series)) = answer {
                // Asked at a steady time, about times in UTC.
                self.accept_curves(cx, series, asked.checked_add(cx.snapshot.stepped).unwrap_or(asked));
            }
        }
        exported.into_iter().chain(self.ask(cx)).collect()
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        pointer::copied(self, cx)
    }

    fn on_point(&mut self, cx: &ViewContext, at: Position) -> bool {
        let moment = pointer::moment_at(self, cx, at);
        // In a replay cursor A is its instant.
        self.cursor = moment.filter(|_| !cx.is_past()).or(self.cursor);
        moment.is_some()
    }

    fn moment(&self, cx: &ViewContext) -> Option<Timestamp> {
        self.cursor(cx)
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        if self.overlay.take().is_some() || self.list_mut(cx).is_some_and(|list| list.back(cx)) {
            return true;
        }
        let cancelled = [&mut self.curves, &mut self.values.answered.query].map(|query| query.cancel(cx));
        cancelled.contains(&true) || std::mem::take(&mut self.listed)
    }

    fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        view::draw(self, cx, frame, area);
    }

    fn on_request_done(&mut self, _cx: &ViewContext, answer: Result<(), RequestRefusal>) -> Vec<UiAction> {
        self.recorded(answer)
    }

    fn on_saved(&mut self, cx: &ViewContext, result: Result<PathBuf, String>) -> Vec<UiAction> {
        self.written(cx, result)
    }

    fn on_text(&mut self, cx: &ViewContext, text: &str) -> Result<Vec<UiAction>, String> {
        match self.asking {
            Asking::Time => self.go_to(cx, text)?,
            Asking::Scale(tag) => self.set_scale(tag, text)?,
            Asking::Overlay => self.lay_over(cx, text)?,
        }
        Ok(self.ask(cx))
    }
}

impl Trends {
    /// The picture over the chart, while one is wanted.
    pub fn picture(&self, cx: &ViewContext) -> Option<Picture> {
        self.pictured.then(|| picture::on_screen(self, cx)).flatten()
    }

    /// Trends of values of which no plant file says what they are, in a window of so much time, as far as one can be;
    /// `ended` where they are those of a log.
    pub fn of_registers(snapshot: &Snapshot, span: SignedDuration, ended: bool) -> Trends {
        Trends { window: nearest(span), apart: true, ended, ..TabView::new(snapshot) }
    }
}
