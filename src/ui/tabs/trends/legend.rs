//! The legend: of every pen its value now or at the cursor, and its figures of the view.

use super::{
    cursors::Measured,
    view::{at_cursor, hour, number, resolution, share},
    *,
};
use crate::{
    report::step_series::HeldValue,
    ui::widgets::{
        chart::{Axis, Plan, mark},
        spark::spark,
        text::whole,
    },
};

/// Columns of a figure, without the one between it and the next.
const FIGURE: u16 = 7;

/// Columns of the legend: right ends of the numbers, and where the last column begins.
struct Ends {
    name: u16,
    value: u16,
    min: u16,
    mean: u16,
    max: u16,
    good: u16,
    hour: u16,
}

impl Ends {
    fn new(width: u16) -> Ends {
        let name = 13 + width.saturating_sub(80).min(40) / 2;
        // Where the share of good time would stand outside, the value has less room.
        let value = 4 + name + 13 + width.saturating_sub(80).min(40) / 4 - 63_u16.saturating_sub(width).min(4);
        Ends { name, value, min: value + 8, mean: value + 16, max: value + 24, good: value + 33, hour: value + 36 }
    }
}

pub(super) fn draw_legend(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, plan: Option<&Plan>) {
    let (columns, dim) = (Ends::new(canvas.width()), cx.theme.dim());
    if canvas.height() == 0 {
        return;
    }
    if let Some(span) = trends.both() {
        return draw_measured(trends, cx, canvas, span);
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
    let drawn = trends.curved(cx);
    each_row(trends, cx, canvas, |row, (n, pen)| {
        let place = drawn.iter().position(|(of, _)| *of == n);
        let scale = plan.zip(place).and_then(|(plan, place)| plan.scales.get(place));
        let own = scale.filter(|(axis, _)| *axis == Axis::Own).map(|(_, scale)| (scale.low, scale.high));
        draw_pen(trends, cx, row, (n, pen), cursor, own);
    });
}

/// The pens, as many as there is room for, the selected one among them.
fn each_row(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, mut draw: impl FnMut(&mut Canvas, (usize, Pen))) {
    let (pens, rows) = (trends.pens(cx), usize::from(canvas.height() - 1));
    let first = (trends.selected + 1).saturating_sub(rows).min(pens.len().saturating_sub(rows));
    for (y, n, pen) in on_screen(&pens, first, rows) {
        draw(&mut canvas.part(0, y + 1, canvas.width(), 1), (n, *pen));
    }
}

/// Mark and name of a pen; its style, and whether it is switched off.
fn draw_name(trends: &Trends, cx: &ViewContext, row: &mut Canvas, (n, pen): (usize, Pen), room: u16) -> (Style, bool) {
    let (theme, def) = (cx.theme, cx.def().tag(pen.tag));
    let (selected, off) = (trends.selected == n, trends.off.contains(&pen.tag));
    if selected {
        row.text(0, 0, theme.pick("▸", ">"), theme.strong());
    }
    let style = if off { theme.dim() } else { theme.pen(n) };
    row.text(2, 0, if off { "-" } else { mark(theme, n) }, style);
    let name = if row.width() >= 100 { format!("{}  {}", def.name, of_plant(&def.label)) } else { def.name.clone() };
    row.text(4, 0, &fit(&name, room), if selected { theme.strong() } else { style });
    (style, off)
}

/// What every pen did between both cursors: values at A and B, difference, slope, and the figures between them.
fn draw_measured(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, (a, b): (Timestamp, Timestamp)) {
    let (theme, span) = (cx.theme, b.duration_since(a));
    let column = (8 + canvas.width().saturating_sub(80) / 14).min(12);
    // Where there is no room for all figures and the name, the first ones stay.
    let count = if canvas.width() < 8 * column + 15 { 4 } else { 8 };
    let room = canvas.width().saturating_sub(count * column + 1);
    let end = |n: usize| room + column * (to_u16(n) + 1);
    let delta = theme.pick("Δ", "d");
    let per_minute = t!("{delta}/min", delta);
    let heads = ["A", "B", delta, &per_minute, t!("min"), t!("mean"), t!("max"), t!("good")];
    for (n, head) in heads.into_iter().take(count.into()).enumerate() {
        canvas.text_right(end(n), 0, head, theme.dim());
    }
    let time = format!("{delta}t {}", signed_time(span));
    canvas.text(4, 0, &fit(&time, room.saturating_sub(4)), theme.strong());
    each_row(trends, cx, canvas, |row, pen| {
        let (_, off) = draw_name(trends, cx, row, pen, room.saturating_sub(4));
        if off {
            row.text_right(end(0), 0, t!("off"), theme.dim());
            return;
        }
        let Some(measured) = trends.measured(cx, pen.1.tag) else { return };
        let cells = cells(cx, pen.1.tag, &measured, span).into_iter().take(count.into());
        for (n, (text, style)) in cells.enumerate() {
            row.text_right(end(n), 0, &whole(&text, column - 1), style);
        }
    });
}

/// The cells of [`draw_measured`]: no arithmetic with the numbers of an enumeration.
fn cells(cx: &ViewContext, tag: TagId, measured: &Measured, span: SignedDuration) -> Vec<(String, Style)> {
    let theme = cx.theme;
    let is_number = cx.def().tag(tag).enum_labels.is_empty();
    let style = |text: &str| if text == "–" { theme.dim() } else { theme.normal() };
    let plain = |text: Option<String>| {
        let text = text.filter(|_| is_number).unwrap_or_else(|| "–".to_owned());
        let style = style(&text);
        (text, style)
    };
    let signed = |text: String| if text.starts_with('-') { text } else { format!("+{text}") };
    let difference = measured.difference().map(|difference| signed(cx.snapshot.format(tag, difference)));
    let decimals = usize::from(cx.snapshot.decimals[tag.index()]) + 1;
    let slope = measured.slope(span).map(|slope| signed(format!("{slope:.decimals$}")));
    let summary = measured.figures.and_then(|(summary, _)| summary);
    let of = |pick: fn((Exact, Exact, Exact)) -> Exact| summary.map(|all| cx.snapshot.format(tag, pick(all)));
    let good = measured.figures.map(|(_, good)| share(good));
    let good_style = if measured.figures.is_some_and(|(_, good)| good < 0.9995) { theme.strong() } else { theme.dim() };
    let [a, b] = measured.ends.map(|end| held(cx, tag, end));
    let numbers = [difference, slope, of(|all| all.0), of(|all| all.1), of(|all| all.2)].map(plain);
    [a, b].into_iter().chain(numbers).chain([(good.unwrap_or_default(), good_style)]).collect()
}

/// A stored value with its quality: `72.4`, `72.4?`, `----`.
fn held(cx: &ViewContext, tag: TagId, held: Option<HeldValue>) -> (String, Style) {
    match held {
        Some(HeldValue { value: Some(value), quality }) => {
            let doubt = if quality.is_good() { "" } else { "?" };
            (format!("{}{doubt}", cx.snapshot.format(tag, value)), cx.theme.quality(quality))
        }
        Some(HeldValue { value: None, quality }) => ("----".to_owned(), cx.theme.quality(quality)),
        None => ("----".to_owned(), cx.theme.dim()),
    }
}

/// `+1:50`, `-0:07.5`, `1d 02:00:00`: tenths of seconds below ten minutes.
pub(super) fn signed_time(span: SignedDuration) -> String {
    let sign = if span.is_negative() { "-" } else { "" };
    let tenths = span.unsigned_abs().as_millis() / 100;
    match tenths {
        0..6_000 => format!("{sign}{}:{:02}.{}", tenths / 600, tenths / 10 % 60, tenths % 10),
        _ => format!("{sign}{}", running(span.unsigned_abs())),
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
    let (theme, columns) = (cx.theme, Ends::new(row.width()));
    let (pen_style, off) = draw_name(trends, cx, row, (n, pen), columns.name);
    let room = columns.value - columns.name - 5;
    let (text, style) = match cursor {
        None => {
            let shown = value::show(cx, pen.tag);
            (shown.within(room), shown.style)
        }
        Some(at) => match at_cursor(trends, cx, pen.tag, at) {
            Some(text) => {
                let with_unit = format!("{text} {}", cx.snapshot.unit(pen.tag));
                let shown = if width(with_unit.trim_end()) <= room { with_unit } else { whole(&text, room) };
                (shown, theme.normal())
            }
            None => (fit(t!("---- no data"), room), theme.dim()),
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
    let (columns, style) = (Ends::new(row.width()), cx.theme.normal());
    let Some((summary, good)) = trends.figures.get(&tag) else { return };
    if cx.def().tag(tag).enum_labels.is_empty() {
        for (end, value) in [columns.min, columns.mean, columns.max]
            .into_iter()
            .zip(summary.map_or([None; 3], |s| [Some(s.0), Some(s.1), Some(s.2)]))
        {
            let text = value.map_or("–".to_owned(), |value| cx.snapshot.format(tag, value));
            row.text_right(end, 0, &whole(&text, FIGURE), style);
        }
    }
    row.text_right(columns.good, 0, &share(*good), if *good < 0.9995 { cx.theme.strong() } else { cx.theme.dim() });
}
