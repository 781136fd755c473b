//! Several batches or control runs over each other: the curves of one tag, each from its own begin on.

use ratatui::widgets::Widget;

use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::number::to_usize,
    ui::widgets::chart::{self, Chart, Curve, mark, trace::Trace},
};

/// Curves over each other at most: a pen has one of so many marks.
const CURVES_MAX: usize = 8;
/// Those that are shown where none is marked: the selected one and those before it.
pub const UNMARKED: usize = 3;
/// How often the curve of what still runs is read again, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;

/// What a key means here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Another tag.
    Tag(isize),
    /// The list.
    Back,
}

/// Keys of this page.
pub const KEYS: &[Key<Action>] = &[
    Key::new(code(KeyCode::Left), "", "previous tag", Action::Tag(-1)),
    Key::new(code(KeyCode::Right), "tag", "next tag", Action::Tag(1)),
    Key::new(char('o'), "list", "back to the list", Action::Back),
];

/// What is laid over each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Batches, with the figures of the tag.
    Batches,
    /// Control runs, with their own figures.
    Runs,
}

/// One of them.
#[derive(Debug, Clone)]
pub struct Item {
    /// `hot-water-17`.
    pub label: String,
    /// Its begin.
    pub from: Timestamp,
    /// Its end; `None` while it runs.
    pub to: Option<Timestamp>,
    /// The figures below the chart; empty for those of the tag.
    pub figures: [String; 5],
}

impl Item {
    fn until(&self, now: Timestamp) -> Timestamp {
        self.to.unwrap_or(now)
    }
}

/// State of the page.
#[derive(Debug)]
pub struct Overlay {
    kind: Kind,
    /// Each of them with the curve of the tag.
    items: Vec<(Item, Answered<Vec<Series>>)>,
    tags: Vec<TagId>,
    tag: usize,
}

impl Overlay {
    /// Of the curves of these tags; `None` without any.
    pub fn new(kind: Kind, tags: Vec<TagId>, items: impl IntoIterator<Item = Item>) -> Option<Overlay> {
        let items = items.into_iter().take(CURVES_MAX).map(|item| (item, Answered::default())).collect();
        (!tags.is_empty()).then_some(Overlay { kind, items, tags, tag: 0 })
    }

    pub fn act(&mut self, by: isize) {
        self.tag = around(self.tag, by, self.tags.len());
        self.items.iter_mut().for_each(|(_, curve)| *curve = Answered::default());
    }

    /// The longest of them.
    fn span(&self, now: Timestamp) -> SignedDuration {
        let lasted = self.items.iter().map(|(item, _)| item.until(now).duration_since(item.from));
        lasted.max().unwrap_or_default().max(SignedDuration::from_secs(60))
    }

    /// Asks for the curves: of what has ended once.
    pub fn ask(&mut self, cx: &ViewContext, number: &mut u32) -> Vec<UiAction> {
        let (span, tag, columns) = (self.span(cx.now), self.tags[self.tag], chart::dots(cx.theme, cx.area.width, 1));
        let tab = match self.kind {
            Kind::Batches => Tab::Reports,
            Kind::Runs => Tab::Controllers,
        };
        let ask = |(item, curve): &mut (Item, Answered<Vec<Series>>)| {
            // The past stays as it is.
            let known = item.to.is_some() && curve.trouble.is_none();
            let every = if known { SignedDuration::MAX } else { real(cx, EVERY_S) };
            // Its own figures, and columns as wide as those of the longest.
            let to = item.until(cx.now).max(item.from + SignedDuration::from_secs(1));
            let share = to.duration_since(item.from).as_secs_f64() / span.as_secs_f64();
            let buckets = to_usize(columns as f64 * share).max(2);
            let query = Query::Series { tags: vec![tag], from: item.from, to, buckets };
            curve.ask(cx, (tab, number), every, real(cx, TIMEOUT_S), query)
        };
        self.items.iter_mut().filter_map(ask).collect()
    }

    pub fn awaits(&self, number: u32) -> bool {
        self.items.iter().any(|(_, curve)| curve.query.awaits(number))
    }

    pub fn on_answer(&mut self, cx: &ViewContext, number: u32, answer: &Result<Answer, HistoryError>) {
        self.items.iter_mut().for_each(|(_, curve)| curve.on_answer(cx, number, answer));
    }

    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let (theme, tag) = (cx.theme, self.tags[self.tag]);
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let (width, height) = (canvas.width(), canvas.height());
        let def = cx.def().tag(tag);
        let count = self.items.len();
        let words = match self.kind {
            Kind::Batches => t!("{tag} of {count} batches", tag = def.name, count),
            Kind::Runs => t!("{tag} of {count} runs", tag = def.name, count),
        };
        let x = canvas.text(1, 0, &words, theme.strong());
        let trouble = self.items.iter().find_map(|(_, curve)| curve.trouble.as_deref());
        match trouble {
            Some(trouble) => canvas.text(x + 2, 0, &fit(trouble, width.saturating_sub(x + 3)), theme.trouble()),
            None => canvas.text(x + 2, 0, &fit(&def.label, width.saturating_sub(x + 3)), theme.normal()),
        };
        let legend = to_u16(self.items.len()) + 1;
        let traces: Vec<Trace> = self.items.iter().map(|(item, curve)| from_begin(item, curve)).collect();
        let decimals = cx.snapshot.decimals[tag.index()];
        let curve = |(pen, trace)| Curve::new(trace, pen, cx.snapshot.unit(tag), decimals);
        let curves = traces.iter().enumerate().map(curve).collect();
        let end = BEGIN.checked_add(self.span(cx.now)).unwrap_or(BEGIN);
        let chart = Chart::new(theme, (BEGIN, end, end), curves);
        let plot = canvas.part(0, 1, width, height.saturating_sub(legend + 1)).area();
        chart.render(plot, canvas.buffer());
        let y = height.saturating_sub(legend);
        let head = match self.kind {
            Kind::Batches => [t!("batch"), t!("begin"), t!("minutes"), t!("min"), t!("mean"), t!("max"), t!("good")],
            Kind::Runs => [t!("run"), t!("begin"), t!("at SV"), t!("steady"), t!("over"), t!("offset"), t!("IAE")],
        };
        canvas.text(3, y, &fit(&draw::columns(WIDTHS, head), width.saturating_sub(3)), theme.dim());
        for (n, (item, curve)) in self.items.iter().enumerate() {
            let y = y + 1 + to_u16(n);
            canvas.text(1, y, mark(theme, n), theme.pen(n));
            canvas.text(3, y, &fit(&row(cx, tag, item, curve), width.saturating_sub(3)), theme.normal());
        }
    }
}

/// The begin of each on the common axis.
const BEGIN: Timestamp = Timestamp::UNIX_EPOCH;
const WIDTHS: [i16; 7] = [15, 12, -7, -9, -9, -9, -8];

/// The curve of one, moved to the common begin.
fn from_begin(item: &Item, curve: &Answered<Vec<Series>>) -> Trace {
    let mut trace = Trace::default();
    if let Some(series) = curve.value.iter().flatten().next() {
        let from = BEGIN.checked_add(series.from.duration_since(item.from)).unwrap_or(BEGIN);
        trace.set_past(Series { from, ..series.clone() }, Timestamp::MAX);
    }
    trace
}

/// The figures of one.
fn row(cx: &ViewContext, tag: TagId, item: &Item, curve: &Answered<Vec<Series>>) -> String {
    let begin = moment(item.from, cx.now, &cx.def().time_zone);
    if item.figures.iter().any(|figure| !figure.is_empty()) {
        let [a, b, c, d, e] = item.figures.each_ref();
        return draw::columns(WIDTHS, [&item.label, &begin, a, b, c, d, e]);
    }
    let lasted = format!("{:.1}", item.until(cx.now).duration_since(item.from).as_secs_f64() / 60.0);
    let series = curve.value.iter().flatten().next();
    let value = |value: Option<f64>| value.map_or("–".to_owned(), |value| cx.snapshot.format(tag, value));
    let summary = series.and_then(|series| series.summary);
    let good = series.map_or("–".to_owned(), |series| format!("{:.1} %", (series.good * 1_000.0).floor() / 10.0));
    let [min, mean, max] = match summary {
        Some((min, mean, max)) => [Some(min), Some(mean), Some(max)],
        None => [None; 3],
    };
    draw::columns(WIDTHS, [&item.label, &begin, &lasted, &value(min), &value(mean), &value(max), &good])
}
