//! Batches, control runs or periods over each other: the curves of one tag, each from the begin of its stretch of time on.

use ratatui::widgets::Widget;

use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        control_run::{ControlRun, RunCause},
        number::to_usize,
    },
    ui::widgets::chart::{self, Chart, Curve, mark, trace::Trace},
};

/// Curves over each other at most: a pen has one of this many marks.
pub const CURVES_MAX: usize = 8;
/// Rows that are shown where none is marked: the selected one and those before it.
const UNMARKED: usize = 3;
/// How often the curve of what still runs is read again, and when an answer counts as lost (real time).
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 20.0;
/// The history has a period whole so long after its end (real time).
const STORED_S: f64 = 3.0;

/// A stretch of time whose curve lies over the others.
#[derive(Debug)]
pub struct Laid {
    /// What it is called in the legend.
    label: String,
    from: Timestamp,
    /// `None` while it runs.
    to: Option<Timestamp>,
    /// Its own figures, for the legend; of a batch or a period it has those of the tag.
    figures: Option<[String; 5]>,
    /// Its curve was asked for after it had ended.
    is_whole: bool,
}

impl Laid {
    /// The time of a batch, or a period.
    pub fn new(label: String, from: Timestamp, to: Option<Timestamp>) -> Laid {
        Laid { label, from, to, figures: None, is_whole: false }
    }

    pub fn of_run(run: &ControlRun, figures: [String; 5]) -> Laid {
        let to = (!run.is_running()).then_some(run.until);
        // What a procedure has measured has its name.
        let label = match run.cause {
            RunCause::Procedure => format!("{} {}", run.detail, run.number),
            RunCause::Setpoint | RunCause::Program | RunCause::Batch => run.label(),
        };
        Laid { figures: Some(figures), ..Laid::new(label, run.from, to) }
    }

    fn until(&self, now: Timestamp) -> Timestamp {
        self.to.unwrap_or(now)
    }
}

/// What lies over each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Batches of one rule.
    Batches,
    /// Control runs of one controller.
    Runs,
    Periods,
}

impl Kind {
    fn tab(self) -> Tab {
        match self {
            Kind::Batches => Tab::Reports,
            Kind::Runs => Tab::Controllers,
            Kind::Periods => Tab::Trends,
        }
    }
}

#[derive(Debug)]
pub struct Overlay {
    kind: Kind,
    /// Each with the curve of the tag.
    curves: Vec<(Laid, Answered<Vec<Series>>)>,
    tags: Vec<TagId>,
    tag: usize,
}

impl Overlay {
    /// Of periods, named by letters; `None` where there is no tag that has a curve.
    pub fn of_periods(spans: Vec<(Timestamp, Timestamp)>, tags: (Vec<TagId>, usize)) -> Option<Overlay> {
        let laid = |(letter, (from, to)): (char, _)| Laid::new(letter.to_string(), from, Some(to));
        Overlay::new(Kind::Periods, ('A'..).zip(spans).map(laid), tags)
    }

    /// Of some of a kind, with the curves of one of these tags; `None` where there is none.
    pub fn new(kind: Kind, laid: impl IntoIterator<Item = Laid>, (tags, tag): (Vec<TagId>, usize)) -> Option<Overlay> {
        let curves = laid.into_iter().take(CURVES_MAX).map(|laid| (laid, Answered::default())).collect();
        (!tags.is_empty()).then_some(Overlay { kind, curves, tags, tag })
    }

    /// Does one of them still run, so that its end must be looked for?
    pub fn is_running(&self) -> bool {
        self.curves.iter().any(|(laid, _)| laid.to.is_none())
    }

    /// What runs gets its figures of now, and what has ended meanwhile its end.
    pub fn follow(&mut self, listed: impl Iterator<Item = Laid>) {
        for now in listed {
            let mut running = self.curves.iter_mut().filter(|(laid, _)| laid.to.is_none());
            let Some((laid, curve)) = running.find(|(laid, _)| laid.label == now.label) else { continue };
            if now.to.is_some() {
                curve.query.want();
            }
            *laid = now;
        }
    }

    pub fn next_tag(&mut self, by: isize) {
        self.tag = around(self.tag, by, self.tags.len());
        for (laid, curve) in &mut self.curves {
            (laid.is_whole, *curve) = (false, Answered::default());
        }
    }

    /// The longest of them.
    fn span(&self, now: Timestamp) -> SignedDuration {
        let lasted = self.curves.iter().map(|(laid, _)| laid.until(now).duration_since(laid.from));
        lasted.max().unwrap_or_default().max(SignedDuration::from_secs(60))
    }

    /// Asks for the curves: of what has ended once.
    pub fn ask(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let now = cx.now;
        let (span, tag, columns) = (self.span(now), self.tags[self.tag], chart::dots(cx.theme, cx.area.width, 1));
        let ask = |(laid, curve): &mut (Laid, Answered<Vec<Series>>)| {
            // The past stays as it is.
            let is_known = laid.is_whole && curve.trouble.is_none();
            let every = if is_known { SignedDuration::MAX } else { real(cx, EVERY_S) };
            // Its own figures, and columns as wide as those of the longest.
            let to = laid.until(now).max(laid.from + SignedDuration::from_secs(1));
            let share = to.duration_since(laid.from).as_secs_f64() / span.as_secs_f64();
            let buckets = to_usize(columns as f64 * share).max(2);
            let query = Query::Series { tags: vec![tag], from: laid.from, to, buckets };
            let asked = curve.ask(cx, self.kind.tab(), every, real(cx, TIMEOUT_S), query)?;
            laid.is_whole = laid.to.is_some_and(|to| cx.present().duration_since(to) > real(cx, STORED_S));
            Some(asked)
        };
        self.curves.iter_mut().filter_map(ask).collect()
    }

    /// Those for its curves.
    pub fn queries(&mut self) -> impl Iterator<Item = &mut dyn Asked> {
        self.curves.iter_mut().map(|(_, curve)| curve as &mut dyn Asked)
    }

    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect) {
        let (theme, tag) = (cx.theme, self.tags[self.tag]);
        let mut canvas = Canvas::new(frame.buffer_mut(), area);
        let (width, height) = (canvas.width(), canvas.height());
        let def = cx.def().tag(tag);
        let (name, count) = (&def.name, self.curves.len());
        let heading = match self.kind {
            Kind::Batches => t!("{tag} of {count} batches", tag = name, count),
            Kind::Runs => t!("{tag} of {count} runs", tag = name, count),
            Kind::Periods => t!("{tag} in {count} periods", tag = name, count),
        };
        let x = canvas.text(1, 0, &heading, theme.strong());
        let trouble = self.curves.iter().find_map(|(_, curve)| curve.trouble.as_deref());
        match trouble {
            Some(trouble) => canvas.text(x + 2, 0, &fit(trouble, width.saturating_sub(x + 3)), theme.trouble()),
            None => canvas.text(x + 2, 0, &fit(of_plant(&def.label), width.saturating_sub(x + 3)), theme.normal()),
        };
        let legend = to_u16(self.curves.len()) + 1;
        self.draw_chart(cx, &mut canvas.part(0, 1, width, height.saturating_sub(legend + 1)), tag);
        let y = height.saturating_sub(legend);
        let values = |first| [first, t!("begin"), t!("minutes"), t!("min"), t!("mean"), t!("max"), t!("good")];
        let head = match self.kind {
            Kind::Batches => values(t!("batch")),
            Kind::Periods => values(t!("period")),
            Kind::Runs => [t!("run"), t!("begin"), t!("at SV"), t!("steady"), t!("over"), t!("offset"), t!("IAE")],
        };
        canvas.text(3, y, &fit(&self.columns(head), width.saturating_sub(3)), theme.dim());
        for (n, (laid, curve)) in self.curves.iter().enumerate() {
            let y = y + 1 + to_u16(n);
            canvas.text(1, y, mark(theme, n), theme.pen(n));
            canvas.text(3, y, &fit(&self.row(cx, tag, laid, curve), width.saturating_sub(3)), theme.normal());
        }
    }

    /// The curves, from a common begin: that of the first period, by its local time, or zero.
    fn draw_chart(&self, cx: &ViewContext, canvas: &mut Canvas, tag: TagId) {
        let (begin, zone) = match (self.kind, self.curves.first()) {
            (Kind::Periods, Some((first, _))) => (first.from, Some(&cx.def().time_zone)),
            (Kind::Periods, None) | (Kind::Batches | Kind::Runs, _) => (Timestamp::UNIX_EPOCH, None),
        };
        let traces: Vec<Trace> = self.curves.iter().map(|(laid, curve)| moved_to(begin, laid, curve)).collect();
        let decimals = cx.snapshot.decimals[tag.index()];
        let curve = |(pen, trace)| Curve::new(trace, pen, cx.snapshot.unit(tag), decimals);
        let curves = traces.iter().enumerate().map(curve).collect();
        let end = begin.checked_add(self.span(cx.now)).unwrap_or(begin);
        let chart = Chart { zone, ..Chart::new(cx.theme, (begin, end, end), curves) };
        chart.render(canvas.area(), canvas.buffer());
    }

    fn columns(&self, cells: [&str; 7]) -> String {
        // A period has a date where a batch has a number.
        let (label, begin) = if self.kind == Kind::Periods { (7, 20) } else { (15, 12) };
        draw::columns([label, begin, -7, -9, -9, -9, -8], cells)
    }

    fn row(&self, cx: &ViewContext, tag: TagId, laid: &Laid, curve: &Answered<Vec<Series>>) -> String {
        let begin = match self.kind {
            Kind::Batches | Kind::Runs => moment(laid.from, cx.now, &cx.def().time_zone),
            Kind::Periods => cx.local(laid.from, "%Y-%m-%d %H:%M:%S"),
        };
        if let Some([a, b, c, d, e]) = &laid.figures {
            return self.columns([&laid.label, &begin, a, b, c, d, e]);
        }
        let lasted = format!("{:.1}", laid.until(cx.now).duration_since(laid.from).as_secs_f64() / 60.0);
        let series = curve.value.iter().flatten().next();
        let value = |value: Option<Exact>| value.map_or("–".to_owned(), |value| cx.snapshot.format(tag, value));
        let summary = series.and_then(|series| series.summary);
        let good = series.map_or("–".to_owned(), |series| format!("{:.1} %", (series.good * 1_000.0).floor() / 10.0));
        let [min, mean, max] = match summary {
            Some((min, mean, max)) => [Some(min), Some(mean), Some(max)],
            None => [None; 3],
        };
        self.columns([&laid.label, &begin, &lasted, &value(min), &value(mean), &value(max), &good])
    }
}

/// A curve, moved to the common begin.
fn moved_to(begin: Timestamp, laid: &Laid, curve: &Answered<Vec<Series>>) -> Trace {
    let mut trace = Trace::default();
    if let Some(series) = curve.value.iter().flatten().next() {
        let from = begin.checked_add(series.from.duration_since(laid.from)).unwrap_or(begin);
        trace.set_past(Series { from, ..series.clone() }, Timestamp::MAX);
    }
    trace
}

/// A listing whose rows can lie over each other.
pub trait Laying: Listing {
    /// A row over others.
    fn laid(row: &Self::Row) -> Laid;

    /// What they are, and the tags that have curves of a row.
    fn curves(&self, cx: &ViewContext, row: &Self::Row) -> Option<(Kind, Vec<TagId>)>;

    /// Can two rows lie over each other?
    fn are_alike(_a: &Self::Row, _b: &Self::Row) -> bool {
        true
    }
}

/// A list whose marked rows lie over each other on request.
#[derive(Debug)]
pub struct Overlaid<L: Laying> {
    pub list: List<L>,
    /// Some of it over each other, in place of the list.
    pub overlay: Option<Overlay>,
}

impl<L: Laying> Overlaid<L> {
    /// The list alone.
    pub fn new(of: L) -> Overlaid<L> {
        Overlaid { list: List::new(of), overlay: None }
    }

    /// The list, while it is shown.
    pub fn shown(&self) -> Option<&dyn ListPage> {
        self.overlay.is_none().then_some(&self.list as &dyn ListPage)
    }

    /// The same, to change it.
    pub fn shown_mut(&mut self) -> Option<&mut dyn ListPage> {
        if self.overlay.is_none() { Some(&mut self.list) } else { None }
    }

    /// Shows the marked rows that are like the selected one over each other; where none is marked, it and those before it.
    pub fn lay_over(&mut self, cx: &ViewContext) {
        let Some(selected) = self.list.selected(cx) else { return };
        let Some((kind, tags)) = self.list.of.curves(cx, &selected) else { return };
        let all = self.list.all(cx);
        let alike = || all.iter().filter(|row| L::are_alike(row, &selected));
        let marked: Vec<Laid> = alike().filter(|row| self.list.is_marked(row)).map(|row| L::laid(row)).collect();
        let earlier = alike().skip_while(|row| L::id(row) != L::id(&selected)).take(UNMARKED).map(|row| L::laid(row));
        let laid = if marked.is_empty() { earlier.collect() } else { marked };
        self.overlay = Overlay::new(kind, laid, (tags, 0));
    }

    pub fn next_tag(&mut self, by: isize) {
        self.overlay.iter_mut().for_each(|overlay| overlay.next_tag(by));
    }

    /// Asks the history when it is time to.
    pub fn ask(&mut self, cx: &ViewContext, tab: Tab) -> Vec<UiAction> {
        let curves = self.overlay.as_mut().map_or(Vec::new(), |overlay| overlay.ask(cx));
        let is_listed = self.overlay.as_ref().is_none_or(Overlay::is_running);
        let list = if is_listed { self.list.ask(cx, tab) } else { None };
        curves.into_iter().chain(list).collect()
    }

    /// Those for the list and for the curves.
    pub fn queries(&mut self) -> Queries<'_> {
        let curves = self.overlay.iter_mut().flat_map(Overlay::queries);
        std::iter::once(&mut self.list.answered as &mut dyn Asked).chain(curves).collect()
    }

    /// An answer has come: what lies over each other follows the list.
    pub fn follow(&mut self, cx: &ViewContext) {
        if let Some(overlay) = &mut self.overlay {
            overlay.follow(self.list.all(cx).iter().map(|row| L::laid(row)));
        }
    }
}
