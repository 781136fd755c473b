//! What several tabs draw and open alike.

use super::prelude::*;
use ratatui::widgets::Widget;

use crate::{
    history::Series,
    plant::{def::Pen, number::to_usize, record::ActionRecord},
    ui::{
        tabs::trends::span::View,
        widgets::chart::{Chart, Curve, mark, trace::Trace},
    },
};

/// Opens a window, if there is one.
pub fn open(window: impl Into<Option<Modal>>) -> Vec<UiAction> {
    window.into().map(UiAction::Open).into_iter().collect()
}

/// The place so many further on among so many, around the end.
pub fn around(place: usize, by: isize, count: usize) -> usize {
    let count = count.max(1).cast_signed();
    (place.cast_signed() + by).rem_euclid(count).cast_unsigned()
}

/// How a row of a list looks.
pub fn row_style(cx: &ViewContext, selected: bool, trouble: bool) -> Style {
    match (selected, trouble) {
        (true, _) => cx.theme.focus(),
        (false, true) => cx.theme.trouble(),
        (false, false) => cx.theme.normal(),
    }
}

/// Texts in columns with a blank between them. A negative width fills from the left, a column without width is left out.
pub fn columns<const N: usize>(widths: [i16; N], cells: [&str; N]) -> String {
    let cell = |(text, width): (&str, i16)| match width {
        0 => None,
        ..0 => Some(pad_left(text, width.unsigned_abs())),
        1.. => Some(pad(text, width.unsigned_abs())),
    };
    cells.into_iter().zip(widths).filter_map(cell).collect::<Vec<_>>().join(" ")
}

/// A share as a bar: `██████────`.
pub fn bar(cx: &ViewContext, share: f64, cells: usize) -> String {
    let full = to_usize((share.clamp(0.0, 1.0) * cells as f64).round()).max(usize::from(0.0 < share));
    "█".repeat(full) + &cx.theme.pick("─", "-").repeat(cells - full)
}

/// `60.0 °C → 70.0 °C`: what an operator action has changed.
pub fn change(cx: &ViewContext, action: &ActionRecord) -> String {
    let arrow = cx.theme.pick("→", "->");
    match (&action.old, &action.new) {
        (Some(old), Some(new)) => format!("{old} {arrow} {new}"),
        (None, Some(new)) => format!("{arrow} {new}"),
        (Some(old), None) => old.to_string(),
        (None, None) => String::new(),
    }
}

/// Curves of these pens with their names above, from what the history has answered of them; a cursor stands at an instant
/// where what came after it is shown too.
pub fn curves(
    cx: &ViewContext,
    canvas: &mut Canvas,
    title: &str,
    (view, cursor): (View, Option<Timestamp>),
    pens: &[Pen],
    series: &[Series],
) {
    let theme = cx.theme;
    let mut x = canvas.text(1, 0, title, theme.dim());
    for (n, pen) in pens.iter().enumerate() {
        let words = format!("{} {}", mark(theme, n), cx.def().tag(pen.tag).name);
        x = canvas.text(x + 3, 0, &words, theme.pen(n));
    }
    let trace = |pen: &Pen| {
        let mut trace = Trace::default();
        if let Some(series) = series.iter().find(|series| series.tag == pen.tag) {
            trace.set_past(series.clone(), Timestamp::MAX);
        }
        trace
    };
    let traces: Vec<Trace> = pens.iter().map(trace).collect();
    let curve = |(n, (pen, trace)): (usize, (&Pen, _))| Curve {
        fixed: pen.scale,
        ..Curve::new(trace, n, cx.snapshot.unit(pen.tag), cx.snapshot.decimals[pen.tag.index()])
    };
    let curves = pens.iter().zip(&traces).enumerate().map(curve).collect();
    let zone = Some(&cx.def().time_zone);
    let now = if cursor.is_some() { cx.present() } else { cx.now };
    let cursors = cursor.map(|at| (at, cx.local(at, "%T").into())).into_iter().collect();
    let chart = Chart { zone, cursors, ..Chart::new(theme, (view.from, view.to, now), curves) };
    let area = canvas.part(0, 1, canvas.width(), canvas.height().saturating_sub(1)).area();
    chart.render(area, canvas.buffer());
}

/// Draws lines from the scrolled one on; returns how many more there are below.
pub fn lines(canvas: &mut Canvas, lines: &[(String, Style)], scroll: Scroll) -> usize {
    let room = usize::from(canvas.height());
    let first = scroll.first(lines.len(), room);
    for (y, _, (text, style)) in on_screen(lines, first, room) {
        canvas.text(1, y, text, *style);
    }
    lines.len().saturating_sub(first + room)
}

/// How many of so many rows are shown in this room, where the last row says how many are left out.
pub fn shown(cx: &ViewContext, canvas: &mut Canvas, count: usize, room: usize) -> usize {
    if count <= room {
        return count;
    }
    let shown = room.saturating_sub(1);
    canvas.text(1, to_u16(room), &t!("… and {count} more", count = count - shown), cx.theme.dim());
    shown
}
