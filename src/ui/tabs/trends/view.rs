//! The view of the trends tab: title, chart, legend with figures; or the list of values.

use jiff::tz::TimeZone;
use ratatui::{
    text::{Line, Span},
    widgets::Widget,
};

use super::{
    Trends,
    events::{draw_event_words, draw_events},
    lanes::draw_lane,
    legend::draw_legend,
    numbers::draw_numbers,
    plots::{Plot, draw_histogram, draw_xy},
    response::draw_response,
    span::{RATES, WINDOWS, midnight, rate_text, window_text},
};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{
        def::{Condition, Level, Pen, Subject},
        record::AlarmEvent,
    },
    text::date,
    ui::{
        theme::Glyphs,
        widgets::chart::{Chart, Curve, Limit, Plan, mark, trace::Trace},
    },
};

/// Rows that the chart keeps, whatever the legend wants.
const CHART_ROWS_MIN: u16 = 7;

pub(super) static NO_TRACE: Trace = Trace::EMPTY;

pub fn draw(trends: &Trends, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    if let Some(overlay) = &trends.overlay {
        return overlay.view(cx, frame, area);
    }
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    match trends.listed {
        true => draw_values(trends, cx, &mut canvas),
        false => draw_curves(trends, cx, &mut canvas),
    }
}

/// All values; what is wrong with the history, also with the curves, stands beside their number.
fn draw_values(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    trends.values.view(cx, canvas);
    let trouble = trouble(trends, cx).filter(|_| trends.values.answered.trouble.is_none());
    if let Some(trouble) = trouble {
        let room = canvas.width().saturating_sub(30);
        canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&trouble, room), cx.theme.trouble());
    }
}

fn legend_rows(trends: &Trends, cx: &ViewContext, height: u16) -> u16 {
    (to_u16(trends.pens(cx).len()) + 1).min(height.saturating_sub(1 + CHART_ROWS_MIN))
}

fn draw_curves(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (width, height) = (canvas.width(), canvas.height());
    let legend = legend_rows(trends, cx, height);
    draw_title(trends, cx, canvas);
    if trends.plot == Plot::Numbers {
        return draw_numbers(trends, cx, &mut canvas.part(0, 1, width, height.saturating_sub(1)));
    }
    let mut plot = canvas.part(0, 1, width, height.saturating_sub(1 + legend));
    let draw: Option<fn(&Trends, &ViewContext, &mut Canvas)> = match trends.plot {
        Plot::Time | Plot::Numbers => None,
        Plot::Xy => Some(draw_xy),
        Plot::Histogram => Some(draw_histogram),
        Plot::Response => Some(draw_response),
    };
    if let Some(draw) = draw {
        draw(trends, cx, &mut plot);
        let mut part = canvas.part(0, height - legend.min(height), width, legend);
        return draw_legend(trends, cx, &mut part, None);
    }
    let (mut chart, rows, room) = time_chart(trends, cx, height, legend);
    let area = canvas.part(0, 1, width, room).area();
    let plan = (!area.is_empty()).then(|| chart.plan(area));
    if let Some(plan) = &plan {
        chart.cursors = cursors(trends, cx, plan.plot.width);
        // Under a picture the cells stay as they are: what is written there would cover it.
        if !trends.pictured {
            chart.render(area, canvas.buffer());
        }
        if trends.drawn(cx).is_empty() {
            let words = t!("no pen is switched on: select one below, space switches it on");
            canvas.text_centred(1 + area.height / 2, words, cx.theme.dim());
        }
        let below = plan.plot.bottom().saturating_sub(canvas.area().y) + 2;
        draw_below(trends, cx, &mut canvas.part(0, below, width, rows.count()), &rows, (&chart, plan));
    }
    let mut part = canvas.part(0, height - legend.min(height), width, legend);
    draw_legend(trends, cx, &mut part, plan.as_ref());
}

/// The chart over time, the rows below it and the rows that it takes, on a tab of this height.
fn time_chart<'a>(trends: &'a Trends, cx: &ViewContext<'a>, height: u16, legend: u16) -> (Chart<'a>, Rows, u16) {
    let rows = Rows::new(trends, cx, height.saturating_sub(1 + legend + CHART_ROWS_MIN));
    let chart = chart(trends, cx, rows.events == 0);
    let room = height.saturating_sub(1 + legend + rows.count());
    // Without a curve it is only the time axis of the lanes.
    let room = if chart.curves.is_empty() && rows.lanes > 0 { room.min(CHART_ROWS_MIN) } else { room };
    (chart, rows, room)
}

/// The chart over time and its place on the screen; `None` while something else is shown.
pub(super) fn placed_chart<'a>(trends: &'a Trends, cx: &ViewContext<'a>) -> Option<(Chart<'a>, Rect)> {
    let legend = legend_rows(trends, cx, cx.area.height);
    let (chart, _, height) = time_chart(trends, cx, cx.area.height, legend);
    let area = Rect { y: cx.area.y + 1, height, ..cx.area };
    let shown = !trends.listed && trends.overlay.is_none() && trends.plot == Plot::Time;
    shown.then_some((chart, area))
}

/// Rows under the chart: lanes of states, events, and the words of the event at the cursor.
struct Rows {
    lanes: u16,
    events: u16,
    words: u16,
}

impl Rows {
    /// As many as there is room for: the events first, then the lanes, then the words.
    fn new(trends: &Trends, cx: &ViewContext, spare: u16) -> Rows {
        let events = u16::from(!trends.apart).min(spare);
        let lanes = to_u16(trends.lanes(cx).len()).min(spare - events);
        let words = u16::from(trends.cursor(cx).is_some()).min(events).min(spare - events - lanes);
        Rows { lanes, events, words }
    }

    fn count(&self) -> u16 {
        self.lanes + self.events + self.words
    }
}

/// Draws the rows under the chart, on its time axis.
fn draw_below(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, rows: &Rows, (chart, plan): (&Chart, &Plan)) {
    let (left, inner) = (plan.plot.x.saturating_sub(canvas.area().x), plan.plot.width);
    for (y, lane) in trends.lanes(cx).into_iter().take(usize::from(rows.lanes)).enumerate() {
        draw_lane(trends, cx, &mut canvas.part(0, to_u16(y), left + inner, 1), lane, left);
    }
    if rows.events > 0 {
        canvas.text(0, rows.lanes, &fit(t!("events"), left), cx.theme.dim());
        let mut row = canvas.part(left, rows.lanes, inner, 1);
        draw_events(trends, cx, &mut row, |at| chart.cell(at, inner));
    }
    if let Some(at) = trends.moving(cx).filter(|_| rows.words > 0) {
        draw_event_words(trends, cx, &mut canvas.part(left, rows.lanes + rows.events, inner, 1), at);
    }
}

/// Group, window, live or past, rate; on the right what is wrong with the history.
fn draw_title(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (def, theme, view) = (cx.def(), cx.theme, trends.span(cx));
    let zone = &def.time_zone;
    let name = trends.name(cx);
    let trouble = trouble(trends, cx);
    let brief = trouble.is_some() && canvas.width() < 120;
    let mut x = canvas.text(1, 0, &name, theme.strong());
    let groups = trends.groups(cx);
    if groups > 1 && !brief {
        x = canvas.text(x + 1, 0, &t!("group {group}/{groups}", group = trends.group + 1, groups), theme.dim());
    }
    let since = trends.since.filter(|since| *since > midnight(cx.now, zone)).map(|since| since.to_zoned(zone.clone()));
    let window = match (trends.accumulate, since) {
        (true, None) => t!("all since midnight").to_owned(),
        (true, Some(since)) if brief => t!("all since {strftime}", strftime = since.strftime("%H:%M")),
        (true, Some(since)) => t!("all since {strftime}, the first value today", strftime = since.strftime("%H:%M")),
        (false, _) => t!("window {window_text}", window_text = window_text(WINDOWS[trends.window])),
    };
    x = canvas.text(x + 3, 0, &window, theme.normal());
    let live = trends.end.is_none() && !cx.is_past();
    let (time, style) = if !live {
        (t!(" past {stretch} ", stretch = stretch(view.from, view.to, cx.present(), zone)), theme.focus())
    } else if trends.ended {
        (t!("end of the log").to_owned(), theme.normal())
    } else if theme.glyphs == Glyphs::Braille {
        (t!("live ●").to_owned(), theme.normal())
    } else {
        (t!("live *").to_owned(), theme.normal())
    };
    x = canvas.text(x + 3, 0, &time, style);
    // What is drawn of a wide column: least to greatest, so that no spike is lost.
    let column = view.step().as_secs();
    if column >= 60 && !brief {
        let column = t!("columns of {width}, min–max", width = window_text(column));
        x = canvas.text(x + 3, 0, &column, theme.normal());
    } else if live && !brief && !trends.ended {
        let rate = t!("update {rate_text}", rate_text = rate_text(RATES[trends.rate]));
        x = canvas.text(x + 3, 0, &rate, theme.normal());
    }
    let said = trends.export.said.as_ref().map(|said| match said {
        Ok(file) => (t!("{file} written", file), theme.done()),
        Err(why) => (t!("not exported: {why}", why), theme.trouble()),
    });
    let exporting = || trends.export.is_busy().then(|| (t!("exporting").to_owned(), theme.normal()));
    if let Some((words, style)) = said.or_else(exporting) {
        let room = canvas.width().saturating_sub(x + 3);
        canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&words, room), style);
    } else if let Some(trouble) = trouble {
        let room = canvas.width().saturating_sub(x + 3);
        canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&trouble, room), theme.trouble());
    }
}

/// What is wrong with the history, or that it keeps us waiting.
pub(super) fn trouble(trends: &Trends, cx: &ViewContext) -> Option<String> {
    // Curves that are drawn are refreshed all the time: only a long wait is worth a word.
    let long = |query: &&PeriodicQuery| query.waiting(cx.monotonic_now()).is_some_and(|time| time >= real(cx, 2.0));
    let mut waiting = [&trends.curves, &trends.values.answered.query]
        .into_iter()
        .filter(long)
        .filter_map(|query| query.shown_waiting(cx));
    let failed =
        [&trends.trouble, &trends.values.answered.trouble].into_iter().chain(trends.events.troubles()).flatten().next();
    failed.cloned().or_else(|| waiting.next())
}

/// The chart, with the alarms of its pens on the axis where there is no row of events.
pub(super) fn chart<'a>(trends: &'a Trends, cx: &ViewContext<'a>, with_marks: bool) -> Chart<'a> {
    let view = trends.span(cx);
    let curve = |(n, pen): (usize, Pen)| {
        let trace = trends.traces.get(&pen.tag).unwrap_or(&NO_TRACE);
        let scale = trends.scales.get(&pen.tag);
        Curve {
            own: scale.is_some_and(|scale| scale.own),
            fixed: scale.map_or(pen.scale, |scale| scale.range),
            clipped: scale.is_some_and(|scale| scale.range.is_some()),
            stroke: trends.strokes.get(&pen.tag).copied().unwrap_or_default(),
            dashed: is_set_value(cx, pen.tag),
            ..Curve::new(trace, n, axis(trends, cx, pen.tag), cx.snapshot.decimals[pen.tag.index()])
        }
    };
    let names: Vec<&str> = trends.drawn(cx).iter().map(|(_, pen)| cx.def().tag(pen.tag).name.as_str()).collect();
    let raised = trends.events.alarms.value.iter().flatten().filter(|record| record.event == AlarmEvent::Raised);
    let marks = raised.filter(|record| with_marks && names.contains(&&*record.subject));
    let curves = trends.curved(cx).into_iter().map(curve).collect();
    Chart {
        zone: Some(&cx.def().time_zone),
        right: trends.curved(cx).iter().position(|(n, _)| *n == trends.selected),
        marks: marks.map(|record| (record.at, cx.theme.severity(record.priority))).collect(),
        limits: limits(trends, cx),
        margin: margin(trends, cx),
        ..Chart::new(cx.theme, (view.from, view.to, cx.present()), curves)
    }
}

/// Room for the names of the rows under the chart.
fn margin(trends: &Trends, cx: &ViewContext) -> u16 {
    let names = trends.lanes(cx).into_iter().map(|(_, pen)| width(&cx.def().tag(pen.tag).short) + 3);
    let events = if trends.apart { 0 } else { width(t!("events")) + 1 };
    names.chain([events]).max().unwrap_or(0).min(cx.area.width / 6)
}

/// The alarm limits of the selected pen.
fn limits(trends: &Trends, cx: &ViewContext) -> Vec<Limit> {
    let curved = trends.curved(cx);
    let Some(curve) = curved.iter().position(|(n, _)| *n == trends.selected) else { return Vec::new() };
    let tag = curved[curve].1.tag;
    let of_tag = cx.def().alarms.iter().filter(|alarm| alarm.subject == Subject::Tag(tag));
    let limit = |condition: Condition| {
        let Condition::Limit { level, limit: value, .. } = condition else { return None };
        let text = cx.snapshot.format(tag, value);
        Some(match level {
            Level::HighHigh => Limit { curve, value, high: true, text: t!("HH {text}", text) },
            Level::High => Limit { curve, value, high: true, text: t!("H {text}", text) },
            Level::Low => Limit { curve, value, high: false, text: t!("L {text}", text) },
            Level::LowLow => Limit { curve, value, high: false, text: t!("LL {text}", text) },
        })
    };
    of_tag.filter_map(|alarm| limit(alarm.condition)).collect()
}

/// Where the cursors stand, and what is written above them.
fn cursors<'a>(trends: &Trends, cx: &ViewContext, room: u16) -> Vec<(Timestamp, Line<'a>)> {
    let Some((a, b)) = trends.both() else {
        return trends.cursor(cx).map(|at| (at, readout(trends, cx, at, room))).into_iter().collect();
    };
    let letter = |letter: &str, at: Timestamp, is_moved: bool| {
        let style = if is_moved { cx.theme.focus() } else { cx.theme.strong() };
        let time = moment_exact(at, cx.present(), &cx.def().time_zone);
        (at, Line::from(Span::styled(format!(" {letter} {time} "), style)))
    };
    let moves_b = trends.moves_b();
    let mut both = [letter("A", a, !moves_b), letter("B", b, moves_b)];
    both.sort_by_key(|(at, _)| *at);
    both.into()
}

/// The time at the cursor with the value of every pen; only the time where that is too wide, the legend has the values.
fn readout<'a>(trends: &Trends, cx: &ViewContext, at: Timestamp, room: u16) -> Line<'a> {
    let zone = &cx.def().time_zone;
    let mut line = Line::from(Span::styled(moment_exact(at, cx.present(), zone), cx.theme.strong()));
    let time = line.clone();
    for (n, pen) in trends.drawn(cx) {
        let text = at_cursor(trends, cx, pen.tag, at).unwrap_or_else(|| "----".to_owned());
        line.push_span(Span::styled(format!("  {} {text}", mark(cx.theme, n)), cx.theme.pen(n)));
    }
    if line.width() <= usize::from(room) { line } else { time }
}

pub(super) fn at_cursor(trends: &Trends, cx: &ViewContext, tag: TagId, at: Timestamp) -> Option<String> {
    let value = trends.traces.get(&tag)?.value_at(at)?;
    Some(cx.snapshot.format(tag, value))
}

pub(super) fn hour(trends: &Trends, tag: TagId) -> Option<&Series> {
    trends.values.answered.value.iter().flatten().find(|series| series.tag == tag)
}

/// What the axis of a tag is called: curves with one name share it.
pub(super) fn axis<'a>(trends: &Trends, cx: &ViewContext<'a>, tag: TagId) -> &'a str {
    let unit = cx.snapshot.unit(tag);
    if trends.apart && unit.is_empty() { &cx.def().tag(tag).name } else { unit }
}

/// The last digit of a tag: 0.1 for one decimal.
pub(super) fn resolution(cx: &ViewContext, tag: TagId) -> f64 {
    10f64.powi(-i32::from(cx.snapshot.decimals[tag.index()]))
}

/// Is it a written value rather than a measured one? Such pens are drawn as broken lines.
fn is_set_value(cx: &ViewContext, tag: TagId) -> bool {
    let faceplates = cx.def().devices.iter().filter_map(|device| device.faceplate.as_ref());
    let def = cx.def().tag(tag);
    faceplates.clone().any(|face| face.sv == tag || face.sv_used == Some(tag))
        || def.writable() && !faceplates.clone().any(|face| face.mv == Some(tag))
}

/// `98.9 %`; whole only when it is whole.
pub(super) fn share(good: f64) -> String {
    if good >= 1.0 { "100 %".to_owned() } else { format!("{:.1} %", (good * 1_000.0).floor() / 10.0) }
}

pub(super) fn number(value: f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6)
}

/// `14:02:31`, with the date before it when it is not today.
fn moment_exact(at: Timestamp, now: Timestamp, zone: &TimeZone) -> String {
    let (local, now) = (at.to_zoned(zone.clone()), now.to_zoned(zone.clone()));
    let form = if local.date() == now.date() { "%H:%M:%S" } else { "%m-%d %H:%M:%S" };
    local.strftime(form).to_string()
}

/// `13:40:04 – 13:50:04` today, `11-20 13:40 – 13:50` on another day, both dates where it spans midnight, with the year
/// where it begins in another.
fn stretch(from: Timestamp, to: Timestamp, now: Timestamp, zone: &TimeZone) -> String {
    let [from, to, now] = [from, to, now].map(|at| at.to_zoned(zone.clone()));
    let (first, last) = match (from.date() == to.date(), from.date() == now.date()) {
        _ if from.year() != now.year() => return format!("{} – {}", date(from.date()), date(to.date())),
        (true, true) => ("%H:%M:%S", "%H:%M:%S"),
        (true, false) => ("%m-%d %H:%M", "%H:%M"),
        (false, _) => ("%m-%d %H:%M", "%m-%d %H:%M"),
    };
    format!("{} – {}", from.strftime(first), to.strftime(last))
}
