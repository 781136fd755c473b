//! The watched values as curves, full screen: the tab of the trends, over what was read here instead of the history.

use std::{collections::VecDeque, sync::Arc};

use super::{Named, Registers, WatchList, Watched};
use crate::ui::tabs::{
    prelude::*,
    registers::{
        save,
        view::{is_past, state},
    },
    trends,
};
use crate::{
    history::{
        Series,
        series::{Curve, Span},
    },
    plant::{
        PlantDef,
        def::{Pen, TrendGroup},
        number::to_u16,
        sample::{Cause, Sample},
        tag::{ByteOrder, DataType, Table, TagDef},
        time::instant_of_grid,
    },
    report::{
        step_series::{HOLD_MAX, HeldValue, ValuesAt},
        value_log::reader::{LoggedValue, ValueLog},
    },
    ui::Effect,
};

const PENS: usize = 8;
/// The window of what goes on is at least so wide at first.
const WINDOW_MIN: SignedDuration = SignedDuration::from_mins(2);
/// Damaged lines that are named.
const PROBLEMS_MAX: usize = 10;
/// What one key or snapshot makes the trends ask at most.
const QUERIES_MAX: usize = 16;

/// The trends, and the watched values as tags.
#[derive(Debug)]
pub(super) struct Graph {
    trends: trends::Trends,
    snapshot: Snapshot,
    /// It shows a log: its end, and how much was read of it.
    log: Option<(Timestamp, String)>,
}

impl Graph {
    /// Of the values of a list, the first of them selected.
    fn new(
        cx: &ViewContext,
        title: &str,
        tags: Vec<TagDef>,
        span: SignedDuration,
        log: Option<(Timestamp, String)>,
    ) -> Graph {
        let ids: Vec<TagId> = tags.iter().map(|tag| tag.id).collect();
        let group = |pens: &[TagId]| TrendGroup {
            name: title.to_owned(),
            pens: pens.iter().map(|tag| Pen { tag: *tag, scale: None }).collect(),
        };
        let trends = ids.chunks(PENS).map(group).collect();
        let def = PlantDef { time_zone: cx.def().time_zone.clone(), tags, trends, ..PlantDef::default() };
        let mut snapshot = Snapshot::blank(Arc::new(def));
        snapshot.decimals = snapshot.def.tags.iter().map(save::decimals).collect();
        Graph { trends: trends::Trends::of_registers(&snapshot, span, log.is_some()), snapshot, log }
    }

    /// What the trends may read.
    fn context<'a>(snapshot: &'a Snapshot, cx: &ViewContext<'a>) -> ViewContext<'a> {
        ViewContext { snapshot, now: snapshot.at, ..*cx }
    }

    /// Lets the trends act, and answers what they ask.
    fn act(
        &mut self,
        cx: &ViewContext,
        items: &[Watched],
        act: impl FnOnce(&mut trends::Trends, &ViewContext) -> Vec<UiAction>,
    ) {
        let Graph { trends, snapshot, log: _ } = self;
        let cx = Graph::context(snapshot, cx);
        let mut actions = act(trends, &cx);
        for _ in 0..QUERIES_MAX {
            let Some(action) = actions.pop() else { break };
            // They ask for nothing but curves, and the alarms beside them.
            if let UiAction::Do(Effect::Query(id, query)) = action {
                actions.extend(trends.on_answer(&cx, id.number, answer(items, query, cx.now)));
            }
        }
    }
}

/// What the history would say.
fn answer(items: &[Watched], query: Query, now: Timestamp) -> Result<Answer, HistoryError> {
    let of = |tag: TagId| items.get(tag.index()).map(|item| &item.samples);
    if let Query::Values { tags, from, every, count } = query {
        let instants: Arc<[Timestamp]> = (1..=count).map_while(|n| instant_of_grid(from, every, n)).collect();
        return Ok(Answer::Values(tags.into_iter().map(|tag| held(of(tag), instants.clone())).collect()));
    }
    let Query::Series { tags, from, to, buckets } = query else { return Ok(Answer::Journal(Vec::new())) };
    let known = tags.into_iter().filter_map(|tag| Some((tag, of(tag)?)));
    let span = Span { from, to, until: now };
    Ok(Answer::Series(known.map(|(tag, samples)| series(samples, tag, span, buckets)).collect()))
}

fn held(samples: Option<&VecDeque<Sample>>, instants: Arc<[Timestamp]>) -> Vec<Option<HeldValue>> {
    let mut values = ValuesAt::new(instants);
    samples.into_iter().flatten().for_each(|sample| values.next(*sample));
    values.end().into_iter().map(|sample| sample.map(HeldValue::from)).collect()
}

fn series(samples: &VecDeque<Sample>, tag: TagId, span: Span, buckets: usize) -> Series {
    let mut curve = Curve::new(tag, span, buckets);
    let before = span.from.checked_sub(HOLD_MAX).unwrap_or(span.from);
    let first = samples.partition_point(|sample| sample.at < before);
    samples.range(first..).take_while(|sample| sample.at < span.to).for_each(|sample| curve.next(*sample));
    curve.end()
}

impl WatchList {
    pub fn has_graph(&self) -> bool {
        self.graph.is_some()
    }

    /// Is it the graph of a log? There is nothing else then.
    pub fn is_shown_log(&self) -> bool {
        self.graph.as_ref().is_some_and(|graph| graph.log.is_some())
    }

    pub fn close_graph(&mut self) -> bool {
        !self.is_shown_log() && self.graph.take().is_some()
    }

    /// When the first of the values that are remembered was read.
    fn since(&self) -> Option<Timestamp> {
        self.items.iter().filter_map(|item| item.samples.front()).map(|sample| sample.at).min()
    }
}

impl Watched {
    /// As it stands: a value that is not good has the time of the read that brought it.
    fn shown(&self) -> Option<Sample> {
        let last = *self.samples.back()?;
        let read = self.samples.iter().rev().find(|sample| sample.quality.is_good());
        Some(Sample { at: read.filter(|_| last.value.is_some()).map_or(last.at, |read| read.at), ..last })
    }
}

impl Registers {
    /// Shows a log, and says what is damaged in it.
    pub(super) fn show_log(&mut self, cx: &ViewContext, file: &str, log: ValueLog) {
        let ValueLog { columns, end, rows, problems, damaged } = log;
        for (n, column) in columns.into_iter().enumerate() {
            let LoggedValue { name, unit, decimals, samples } = column;
            let named = Named::new(Table::Holding, to_u16(n), DataType::F64, ByteOrder::Abcd, &name);
            self.names.put(Named { unit, decimals, ..named });
            self.watch.items.push(Watched { samples: samples.into(), ..Watched::new((Table::Holding, to_u16(n))) });
        }
        let words = match damaged {
            0 => t!("{rows} rows", rows),
            _ => t!("{rows} rows, DAMAGED: {damaged}", rows, damaged),
        };
        self.show_graph(cx, file, Some((end, words)));
        if damaged == 0 {
            return;
        }
        let more = damaged.saturating_sub(PROBLEMS_MAX);
        let mut words: Vec<String> = problems.iter().take(PROBLEMS_MAX).map(|why| format!("{file}: {why}")).collect();
        if more != 0 {
            words.push(t!("and {more} more", more));
        }
        self.said = Some(UiAction::Open(Modal::Notice(Notice::new(t!("damaged: the rest is shown"), words))));
    }

    /// Shows what is watched; where nothing is, the selected register.
    pub(in crate::ui::tabs::registers) fn open_graph(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        if self.watch.items.is_empty() {
            let refused = self.toggle_watch();
            if !refused.is_empty() {
                return refused;
            }
        }
        self.show_graph(cx, t!("watched"), None);
        Vec::new()
    }

    fn show_graph(&mut self, cx: &ViewContext, title: &str, log: Option<(Timestamp, String)>) {
        let (now, least) = log.as_ref().map_or((cx.now, WINDOW_MIN), |(end, _)| (*end, SignedDuration::ZERO));
        let named = self.watch.items.iter().filter_map(|item| self.names.get(item.at.0, item.at.1));
        let tag =
            |(n, named): (usize, &Named)| TagDef { id: TagId(to_u16(n)), ..self.cells.scaled(named).tag(&named.name) };
        let past = self.watch.since().map_or(SignedDuration::ZERO, |since| now.duration_since(since));
        let mut graph = Graph::new(cx, title, named.enumerate().map(tag).collect(), past.max(least), log);
        let selected = self.watch.items.iter().position(|item| item.at == (self.table, self.selected)).unwrap_or(0);
        graph.act(cx, &self.watch.items, |trends, cx| {
            trends.open_tag(cx, TagId(to_u16(selected)));
            Vec::new()
        });
        self.watch.graph = Some(graph);
        self.follow_graph(cx);
    }

    /// Gives the graph what was read.
    pub(in crate::ui::tabs::registers) fn follow_graph(&mut self, cx: &ViewContext) {
        let old: Vec<bool> = self.watch.items.iter().map(|item| self.is_old(cx, item)).collect();
        let WatchList { graph, items, .. } = &mut self.watch;
        let Some(graph) = graph else { return };
        let now = graph.log.as_ref().map_or(cx.now, |(end, _)| *end);
        (graph.snapshot.at, graph.snapshot.stepped) = (now, cx.snapshot.stepped);
        for ((shown, item), old) in graph.snapshot.samples.iter_mut().zip(items.iter()).zip(old) {
            let sample = item.shown().unwrap_or(*shown);
            *shown = if old { sample.uncertain(Cause::Stale) } else { sample };
        }
        graph.act(cx, items, |trends, cx| trends.on_snapshot(cx));
    }

    fn is_old(&self, cx: &ViewContext, item: &Watched) -> bool {
        let good = item.samples.back().filter(|last| last.quality.is_good());
        !self.watch.is_shown_log() && good.is_some_and(|last| is_past(self, cx, last.at))
    }

    /// The keys of the trends, but for those that ask the plant.
    pub(in crate::ui::tabs::registers) fn graph_hints(&self, cx: &ViewContext) -> Vec<Hint> {
        let graph = self.watch.graph.as_ref();
        graph.map_or(Vec::new(), |graph| graph.trends.hints(&Graph::context(&graph.snapshot, cx)))
    }

    /// One of them.
    pub(in crate::ui::tabs::registers) fn press_on_graph(
        &mut self,
        cx: &ViewContext,
        event: KeyEvent,
    ) -> Option<Vec<UiAction>> {
        let WatchList { graph, items, .. } = &mut self.watch;
        let mut is_key = false;
        graph.as_mut()?.act(cx, items, |trends, cx| {
            let actions = trends.press(cx, event);
            is_key = actions.is_some();
            actions.unwrap_or_default()
        });
        is_key.then(Vec::new)
    }
}

/// Draws it; where it has room, what is wrong with reading, or the log.
pub fn view(tab: &Registers, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let Some(graph) = &tab.watch.graph else { return };
    graph.trends.view(&Graph::context(&graph.snapshot, cx), frame, area);
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    let shown = graph.log.as_ref().map(|(_, words)| words.clone());
    let (words, style) = match (state(tab, cx), tab.watch.log_words()) {
        _ if shown.is_some() => (shown.into_iter().collect(), cx.theme.normal()),
        _ if tab.paused => (vec![t!("reading is paused").to_owned()], cx.theme.trouble()),
        ((why, false), _) => (vec![why], cx.theme.trouble()),
        (_, Some((words, true))) => (words.to_vec(), cx.theme.strong()),
        (_, Some((words, false))) => (words.to_vec(), cx.theme.trouble()),
        ((_, true), None) => return,
    };
    let end = canvas.width().saturating_sub(1);
    let fits = |words: &&String| canvas.is_blank(end.saturating_sub(width(words) + 2), 0, width(words) + 2);
    if let Some(words) = words.iter().find(fits) {
        canvas.text_right(end, 0, words, style);
    }
}
