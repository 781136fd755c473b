//! The view of the trends tab: title, chart, legend with figures; or the list of values.

use jiff::tz::TimeZone;
use ratatui::{
    text::{Line, Span},
    widgets::Widget,
};

use super::{
    Trends,
    span::{RATES, WINDOWS, midnight, rate_text, window_text},
    stored,
};
use crate::ui::tabs::prelude::*;
use crate::{
    history::Series,
    plant::{def::Pen, record::AlarmEvent},
    text::date,
    ui::{
        theme::Glyphs,
        widgets::{
            chart::{Axis, Chart, Curve, Plan, mark, trace::Trace},
            spark::spark,
        },
    },
};

/// Rows that the chart keeps, whatever the legend wants.
const CHART_ROWS_MIN: u16 = 7;

static NO_TRACE: Trace = Trace::EMPTY;

/// Draws the tab.
pub fn draw(trends: &Trends, cx: &ViewContext, frame: &mut Frame, area: Rect) {
    let mut canvas = Canvas::new(frame.buffer_mut(), area);
    match trends.values {
        Some((first, row)) => draw_values(trends, cx, &mut canvas, first, row),
        None => draw_curves(trends, cx, &mut canvas),
    }
}

fn draw_curves(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (width, height) = (canvas.width(), canvas.height());
    let pens = trends.pens(cx);
    let legend = (to_u16(pens.len()) + 1).min(height.saturating_sub(1 + CHART_ROWS_MIN));
    draw_title(trends, cx, canvas);
    let mut chart = chart(trends, cx);
    let area = canvas.part(0, 1, width, height.saturating_sub(1 + legend)).area();
    let plan = (!area.is_empty()).then(|| chart.plan(area));
    if let Some(plan) = &plan {
        let cursor = trends.cursor(cx);
        chart.cursor = cursor.map(|at| (at, readout(trends, cx, at, plan.plot.width)));
        chart.render(area, canvas.buffer());
        if trends.drawn(cx).is_empty() {
            let words = t!("no pen is switched on: select one below, space switches it on");
            canvas.text_centred(1 + area.height / 2, words, cx.theme.dim());
        }
    }
    let mut part = canvas.part(0, height - legend.min(height), width, legend);
    draw_legend(trends, cx, &mut part, plan.as_ref());
}

/// Group, window, live or past, rate; on the right what is wrong with the history.
fn draw_title(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let (def, theme, view) = (cx.def(), cx.theme, trends.span(cx));
    let zone = &def.time_zone;
    let name = match (def.trends.get(trends.group), trends.picked) {
        (Some(group), _) => group.name.clone(),
        (None, Some(tag)) => def.tag(tag).name.clone(),
        (None, None) => String::new(),
    };
    let trouble = trouble(trends, cx);
    let brief = trouble.is_some() && canvas.width() < 120;
    let mut x = canvas.text(1, 0, &name, theme.strong());
    let groups = def.trends.len() + usize::from(trends.picked.is_some());
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
    if let Some(trouble) = trouble {
        let room = canvas.width().saturating_sub(x + 3);
        canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&trouble, room), theme.trouble());
    }
}

/// What is wrong with the history, or that it keeps us waiting.
fn trouble(trends: &Trends, cx: &ViewContext) -> Option<String> {
    // Curves that are drawn are refreshed all the time: only a long wait is worth a word.
    let long = |query: &&PeriodicQuery| query.waiting(cx.steady()).is_some_and(|time| time >= real(cx, 2.0));
    let mut waiting =
        [&trends.curves, &trends.hours.query].into_iter().filter(long).filter_map(|query| query.shown_waiting(cx));
    let failed = [&trends.trouble, &trends.hours.trouble, &trends.raised.trouble].into_iter().flatten().next();
    failed.cloned().or_else(|| waiting.next())
}

fn chart<'a>(trends: &'a Trends, cx: &ViewContext<'a>) -> Chart<'a> {
    let view = trends.span(cx);
    let curve = |(n, pen): (usize, Pen)| Curve {
        trace: trends.traces.get(&pen.tag).unwrap_or(&NO_TRACE),
        pen: n,
        unit: axis(trends, cx, pen.tag),
        fixed: pen.scale,
        resolution: resolution(cx, pen.tag),
        dashed: is_set_value(cx, pen.tag),
    };
    let names: Vec<&str> = trends.drawn(cx).iter().map(|(_, pen)| cx.def().tag(pen.tag).name.as_str()).collect();
    let raised = trends.raised.value.iter().flatten().filter(|record| record.event == AlarmEvent::Raised);
    let marks = raised.filter(|record| names.contains(&&*record.subject));
    Chart {
        theme: cx.theme,
        zone: Some(&cx.def().time_zone),
        from: view.from,
        to: view.to,
        now: cx.present(),
        curves: trends.drawn(cx).into_iter().map(curve).collect(),
        cursor: None,
        marks: marks.map(|record| (record.at, cx.theme.severity(record.priority))).collect(),
    }
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

fn at_cursor(trends: &Trends, cx: &ViewContext, tag: TagId, at: Timestamp) -> Option<String> {
    let value = trends.traces.get(&tag)?.value_at(at)?;
    Some(cx.snapshot.format(tag, value))
}

/// Columns of the legend: right ends of the numbers, and where the last column begins.
struct Columns {
    name: u16,
    value: u16,
    min: u16,
    mean: u16,
    max: u16,
    good: u16,
    hour: u16,
}

impl Columns {
    fn new(width: u16) -> Columns {
        let name = 13 + width.saturating_sub(80).min(30) / 2;
        let value = 4 + name + 13 + width.saturating_sub(80).min(40) / 4;
        Columns { name, value, min: value + 8, mean: value + 16, max: value + 24, good: value + 33, hour: value + 36 }
    }
}

fn draw_legend(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, plan: Option<&Plan>) {
    let (columns, dim) = (Columns::new(canvas.width()), cx.theme.dim());
    if canvas.height() == 0 {
        return;
    }
    let cursor = trends.cursor(cx);
    let now = match (trends.ended, cx.is_past()) {
        (true, _) => t!("last"),
        (false, true) => t!("then"),
        (false, false) => t!("now"),
    };
    let now = cursor.map_or(now.to_owned(), |at| t!("at {clock}", clock = clock(at, &cx.def().time_zone)));
    canvas.text(4, 0, t!("pen"), dim);
    for (end, text) in [
        (columns.value, now.as_str()),
        (columns.min, t!("min")),
        (columns.mean, t!("mean")),
        (columns.max, t!("max")),
        (columns.good, t!("good")),
    ] {
        canvas.text_right(end, 0, text, dim);
    }
    canvas.text(columns.hour, 0, t!("last hour"), dim);
    let pens = trends.pens(cx);
    let rows = usize::from(canvas.height() - 1);
    let first = (trends.selected + 1).saturating_sub(rows).min(pens.len().saturating_sub(rows));
    let mut drawn = 0;
    for (n, pen) in pens.iter().enumerate() {
        let off = trends.off.contains(&pen.tag);
        let scale = plan.and_then(|plan| if off { None } else { plan.scales.get(drawn) });
        drawn += usize::from(!off);
        if (first..first + rows).contains(&n) {
            let y = to_u16(n - first) + 1;
            let own = scale.filter(|(axis, _)| *axis == Axis::Own).map(|(_, scale)| (scale.low, scale.high));
            let mut row = canvas.part(0, y, canvas.width(), 1);
            draw_pen(trends, cx, &mut row, (n, *pen), cursor, own);
        }
    }
}

/// One row of the legend. A pen with a scale of its own shows it, because no axis does.
fn draw_pen(
    trends: &Trends,
    cx: &ViewContext,
    row: &mut Canvas,
    (n, pen): (usize, Pen),
    cursor: Option<Timestamp>,
    own: Option<(f64, f64)>,
) {
    let (theme, columns, def) = (cx.theme, Columns::new(row.width()), cx.def().tag(pen.tag));
    let (selected, off) = (trends.selected == n, trends.off.contains(&pen.tag));
    if selected {
        row.text(0, 0, theme.pick("▸", ">"), theme.strong());
    }
    let pen_style = if off { theme.dim() } else { theme.pen(n) };
    row.text(2, 0, if off { "-" } else { mark(theme, n) }, pen_style);
    let name = if row.width() >= 100 { format!("{}  {}", def.name, def.label) } else { def.name.clone() };
    row.text(4, 0, &fit(&name, columns.name), if selected { theme.strong() } else { pen_style });
    let (text, style) = match cursor {
        None => {
            let shown = value::show(cx, pen.tag);
            (shown.within(columns.value - columns.name - 5), shown.style)
        }
        Some(at) => match at_cursor(trends, cx, pen.tag, at) {
            Some(text) => (format!("{text} {}", cx.snapshot.unit(pen.tag)), theme.normal()),
            None => (t!("---- no data").to_owned(), theme.dim()),
        },
    };
    row.text_right(columns.value, 0, text.trim_end(), style);
    if off {
        row.text_right(columns.min, 0, t!("off"), theme.dim());
        return;
    }
    draw_figures(trends, cx, row, pen.tag);
    let mut x = columns.hour;
    if let Some((low, high)) = own {
        let text = t!("scale {number} … {number2}  ", number = number(low), number2 = number(high));
        x = row.text(x, 0, &text, theme.dim());
    }
    if let Some(series) = hour(trends, pen.tag) {
        let cells = usize::from(row.width().saturating_sub(x + 1)).min(series.buckets.len());
        row.text(x, 0, &spark(series, cells, resolution(cx, pen.tag), theme.glyphs), pen_style);
    }
}

/// Least, mean and greatest of the window and its share of good time; nothing where there was no good value, and no
/// arithmetic with the numbers of an enumeration.
fn draw_figures(trends: &Trends, cx: &ViewContext, row: &mut Canvas, tag: TagId) {
    let (columns, style) = (Columns::new(row.width()), cx.theme.normal());
    let Some((summary, good)) = trends.figures.get(&tag) else { return };
    if cx.def().tag(tag).enum_labels.is_empty() {
        for (end, value) in [columns.min, columns.mean, columns.max]
            .into_iter()
            .zip(summary.map_or([None; 3], |s| [Some(s.0), Some(s.1), Some(s.2)]))
        {
            row.text_right(end, 0, &value.map_or("–".to_owned(), |value| cx.snapshot.format(tag, value)), style);
        }
    }
    row.text_right(columns.good, 0, &share(*good), if *good < 0.9995 { cx.theme.strong() } else { cx.theme.dim() });
}

/// Every stored value with its last hour.
fn draw_values(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, first: usize, selected: usize) {
    let (theme, all) = (cx.theme, stored(cx));
    let rows = usize::from(canvas.height().saturating_sub(2)).max(1);
    let last = (first + rows).min(all.len());
    let x = canvas.text(1, 0, t!("All values"), theme.strong());
    let range = t!("{min}–{last} of {count}", min = (first + 1).min(last), last, count = all.len());
    canvas.text(x + 3, 0, &range, theme.dim());
    let wide = canvas.width().saturating_sub(80);
    let name = 15 + wide / 5;
    let label = name + 18 + wide / 4;
    let (value, low, high) = (label + 15, label + 23, label + 31);
    canvas.text(2, 1, t!("tag"), theme.dim());
    let now = if cx.is_past() { t!("then") } else { t!("now") };
    for (end, text) in [(value, now), (low, t!("1 h min")), (high, t!("1 h max"))] {
        canvas.text_right(end, 1, text, theme.dim());
    }
    canvas.text(high + 2, 1, t!("last hour"), theme.dim());
    let (words, style) = match trouble(trends, cx) {
        Some(trouble) => (trouble, theme.trouble()),
        None => (t!("{pick} curve   v back", pick = theme.pick("⏎", t!("Enter"))), theme.dim()),
    };
    canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&words, canvas.width().saturating_sub(30)), style);
    for (y, (n, tag)) in all.iter().enumerate().skip(first).take(rows).enumerate() {
        let (y, def, shown) = (to_u16(y) + 2, cx.def().tag(*tag), value::show(cx, *tag));
        let style = if n == selected { theme.strong() } else { theme.normal() };
        if n == selected {
            canvas.text(0, y, theme.pick("▸", ">"), theme.strong());
        }
        canvas.text(2, y, &pad(&def.name, name.saturating_sub(1)), style);
        canvas.text(2 + name, y, &fit(&def.label, label - name - 2), theme.dim());
        canvas.text_right(value, y, &shown.within(value - label), shown.style);
        let Some(series) = hour(trends, *tag) else { continue };
        if let Some((min, _, max)) = series.summary.filter(|_| def.enum_labels.is_empty()) {
            canvas.text_right(low, y, &cx.snapshot.format(*tag, min), theme.dim());
            canvas.text_right(high, y, &cx.snapshot.format(*tag, max), theme.dim());
        }
        let cells = usize::from(canvas.width().saturating_sub(high + 3)).min(series.buckets.len());
        canvas.text(high + 2, y, &spark(series, cells, resolution(cx, *tag), theme.glyphs), style);
    }
}

/// The last hour of a tag.
fn hour(trends: &Trends, tag: TagId) -> Option<&Series> {
    trends.hours.value.iter().flatten().find(|series| series.tag == tag)
}

/// What the axis of a tag is called: curves with one name share it.
fn axis<'a>(trends: &Trends, cx: &ViewContext<'a>, tag: TagId) -> &'a str {
    let unit = cx.snapshot.unit(tag);
    if trends.apart && unit.is_empty() { &cx.def().tag(tag).name } else { unit }
}

/// The last digit of a tag: 0.1 for one decimal.
fn resolution(cx: &ViewContext, tag: TagId) -> f64 {
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
fn share(good: f64) -> String {
    if good >= 1.0 { "100 %".to_owned() } else { format!("{:.1} %", (good * 1_000.0).floor() / 10.0) }
}

fn number(value: f64) -> String {
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
