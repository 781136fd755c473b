//! Events on the time axis: alarms raised, operator actions and their notes, batches; and the one at the cursor in words.

use super::*;
use crate::{
    plant::record::{ActionRecord, AlarmEvent},
    report::batch::BatchReport,
    ui::tabs::alarms::{action_text, event_text},
};

/// Events of each kind that are read; where there are more, the oldest are missing, and the row says so.
const EVENTS_MAX: usize = 200;
/// Batches are shown in windows up to this: each costs a small report.
const BATCHES_SPAN: SignedDuration = SignedDuration::from_hours(24 * 31);

#[derive(Debug, Default)]
pub(super) struct Events {
    pub alarms: Answered<Vec<AlarmRecord>>,
    pub actions: Answered<Vec<ActionRecord>>,
    pub batches: Answered<Vec<BatchReport>>,
    /// Batches are asked for: the plant has some, and the window is not too long.
    asks_batches: bool,
}

/// What an event is; the first is shown where several happened in one column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum EventKind {
    Alarm,
    /// An operator left a note with an action.
    Note,
    /// An operator changed something.
    Command,
    /// A batch began or ended.
    Batch,
    /// Older ones were not read.
    More,
}

impl EventKind {
    /// Its mark in the row of events.
    pub fn symbol(self) -> &'static str {
        match self {
            EventKind::Alarm => "!",
            EventKind::Note => "n",
            EventKind::Command => "c",
            EventKind::Batch => "b",
            EventKind::More => "<",
        }
    }
}

/// A mark on the time axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Mark {
    pub at: Timestamp,
    pub kind: EventKind,
    pub style: Style,
    pub text: String,
}

impl Events {
    pub(super) fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.alarms, &mut self.actions, &mut self.batches]
    }

    /// Has the history answered all that is asked about the view?
    pub(super) fn is_known(&self) -> bool {
        let answered = self.alarms.value.is_some() && self.actions.value.is_some();
        let batches = self.batches.value.is_some() || !self.asks_batches;
        let queries = [&self.alarms.query, &self.actions.query, &self.batches.query];
        answered && batches && !queries.iter().any(|query| query.is_wanted())
    }

    /// Why they could not be read.
    pub(super) fn troubles(&self) -> [&Option<String>; 3] {
        [&self.alarms.trouble, &self.actions.trouble, &self.batches.trouble]
    }

    pub(super) fn want(&mut self) {
        [&mut self.alarms.query, &mut self.actions.query, &mut self.batches.query]
            .into_iter()
            .for_each(PeriodicQuery::want);
    }
}

impl Trends {
    /// Asks for the events of the view; registers without a plant file have none.
    pub(super) fn ask_events(&mut self, cx: &ViewContext, view: View, every: SignedDuration) -> Vec<UiAction> {
        if self.apart {
            return Vec::new();
        }
        let (from, to, limit) = (view.from, view.to.min(cx.present()), EVENTS_MAX);
        let (every, timeout) = (every.max(real(cx, 10.0)), real(cx, TIMEOUT_S));
        let events = &mut self.events;
        let alarms = events.alarms.ask(cx, Tab::Trends, every, timeout, Query::Journal { from, to, limit });
        let query = Query::Actions { from, to, limit };
        let actions = events.actions.ask(cx, Tab::Trends, every, timeout, query);
        events.asks_batches = !cx.def().batches.is_empty() && view.width() <= BATCHES_SPAN;
        if !events.asks_batches {
            // Those of an earlier window would look like all of this one.
            events.batches.value = None;
        }
        let query = Query::Batches { from, to, limit };
        let batches =
            if events.asks_batches { events.batches.ask(cx, Tab::Trends, every * 6, timeout, query) } else { None };
        [alarms, actions, batches].into_iter().flatten().collect()
    }

    /// The events in the view, in order of time.
    pub(super) fn marks(&self, cx: &ViewContext) -> Vec<Mark> {
        let (view, theme) = (self.span(cx), cx.theme);
        let alarms = self.events.alarms.value.as_deref().unwrap_or_default();
        let actions = self.events.actions.value.as_deref().unwrap_or_default();
        let oldest = |len: usize, at: Option<Timestamp>| at.filter(|_| len >= EVENTS_MAX);
        let ran = self.events.batches.value.as_deref().unwrap_or_default();
        let first = ran.iter().map(|report| report.batch.from.max(view.from)).min();
        let more = [
            oldest(alarms.len(), alarms.last().map(|record| record.at)),
            oldest(actions.len(), actions.last().map(|record| record.at)),
            oldest(ran.len(), first),
        ];
        let missing =
            |at, text: &str| Mark { at, kind: EventKind::More, style: theme.trouble(), text: text.to_owned() };
        let too_long = !cx.def().batches.is_empty() && view.width() > BATCHES_SPAN;
        let too_long =
            too_long.then(|| missing(view.from, t!("no batches in windows over 31 days: choose a shorter one")));
        let older = t!("too many events, older ones are not shown: choose a shorter window");
        let more = more.into_iter().flatten().map(|at| missing(at, older)).chain(too_long);
        let raised = alarms.iter().filter(|record| record.event == AlarmEvent::Raised).map(|record| Mark {
            at: record.at,
            kind: EventKind::Alarm,
            style: theme.severity(record.priority),
            text: event_text(cx, record),
        });
        let done = actions.iter().filter(|action| action.changes_plant() || action.note.is_some());
        let done = done.map(|action| Mark {
            at: action.at,
            kind: if action.note.is_some() { EventKind::Note } else { EventKind::Command },
            style: theme.normal(),
            text: action_text(cx, action).split_whitespace().collect::<Vec<_>>().join(" "),
        });
        let batches = ran.iter().flat_map(|report| {
            let (label, batch) = (report.batch.label(), &report.batch);
            let mark = |at, text| Mark { at, kind: EventKind::Batch, style: theme.normal(), text };
            let begin = mark(batch.from, t!("batch {label} begins", label));
            [Some(begin), batch.to.map(|to| mark(to, t!("batch {label} ends", label)))]
        });
        let all = raised.chain(done).chain(batches.flatten()).chain(more);
        let mut all: Vec<Mark> = all.filter(|mark| view.holds(mark.at)).collect();
        all.sort_by_key(|mark| mark.at);
        all
    }

    /// The events within half a cell of an instant, the most important first.
    pub(super) fn marks_at(&self, cx: &ViewContext, at: Timestamp) -> Vec<Mark> {
        let near = self.cell(cx) / 2;
        let mut marks = self.marks(cx);
        marks.retain(|mark| mark.at.duration_since(at).abs() <= near);
        marks.sort_by_key(|mark| mark.kind);
        marks
    }

    /// Moves the cursor to the next event, or to the one before.
    pub(super) fn go_to_event(&mut self, cx: &ViewContext, by: isize) {
        let marks = self.marks(cx);
        let view = self.span(cx);
        // Behind what stands in the same column: a step always moves.
        let near = self.cell(cx) / 2;
        let found = if by > 0 {
            let after = self.moving(cx).map_or(view.from, |at| at + near);
            marks.iter().find(|mark| mark.at > after)
        } else {
            let before = self.moving(cx).map_or(view.to, |at| at - near);
            marks.iter().rev().find(|mark| mark.at < before)
        };
        if let Some(at) = found.map(|mark| mark.at) {
            self.move_cursor(cx, at);
        }
    }
}

/// Draws the row of events: the most important of each column. That there are none is said once it is known.
pub(super) fn draw_events(
    trends: &Trends,
    cx: &ViewContext,
    canvas: &mut Canvas,
    cell: impl Fn(Timestamp) -> Option<u16>,
) {
    let mut last: Option<(u16, EventKind)> = None;
    let marks = trends.marks(cx);
    for mark in &marks {
        let Some(x) = cell(mark.at) else { continue };
        if last.is_none_or(|(column, kind)| column != x || mark.kind < kind) {
            canvas.text(x, 0, mark.kind.symbol(), mark.style);
            last = Some((x, mark.kind));
        }
    }
    if marks.is_empty() && trends.events.is_known() {
        canvas.text(0, 0, t!("no events"), cx.theme.dim());
    }
}

/// The event at the cursor in words, or what the marks mean.
pub(super) fn draw_event_words(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, at: Timestamp) {
    let marks = trends.marks_at(cx, at);
    let Some(mark) = marks.first() else {
        let words = t!("! alarm   c command   n note   b batch      n N next, previous event");
        canvas.text(0, 0, &fit_words(words, canvas.width()), cx.theme.dim());
        return;
    };
    let time = clock(mark.at, &cx.def().time_zone);
    let more = marks.len() - 1;
    let more = if more > 0 { t!("   and {more} more", more) } else { String::new() };
    let room = canvas.width().saturating_sub(width(&more) + 10);
    let x = canvas.text(0, 0, &time, cx.theme.strong());
    let x = canvas.text(x + 2, 0, &fit(&mark.text, room), mark.style);
    canvas.text(x, 0, &more, cx.theme.dim());
}
