//! Valves, pumps and single values: a shape that is filled while it works, a name and a word.

use super::{Bounds, cut, label_style, put_value};
use crate::t;
use crate::{
    plant::def::TagId,
    ui::{
        ViewContext,
        widgets::{
            actuator_mark,
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// A valve at a spot: bow tie, name above (beside, in a vertical pipe) and its state in a word.
pub fn valve(
    cx: &ViewContext,
    canvas: &mut Canvas,
    (x, y): (u16, u16),
    label: &str,
    tag: TagId,
    vertical: bool,
    selected: bool,
) {
    let theme = cx.theme;
    let on = value::is_on(cx, tag);
    let word = word(cx, tag, (t!("OPEN"), t!("CLOSED")));
    let (shape, style) = match on {
        Some(true) => (theme.pick("▶◀", "><"), theme.running()),
        Some(false) => (theme.pick("▷◁", "||"), theme.normal()),
        None => ("??", theme.trouble()),
    };
    let words = if on.is_some() { style } else { theme.quality(cx.snapshot.sample(tag).quality) };
    if vertical {
        canvas.text(x, y, shape, style);
        let name = canvas.text(x + 3, y, label, label_style(cx, selected));
        canvas.text(name + 1, y, &word, words);
    } else {
        canvas.text(x, y, shape, style);
        let above = x.saturating_sub(width(label) / 2);
        let name = canvas.text(above, y.saturating_sub(1), label, label_style(cx, selected));
        canvas.text(name + 1, y.saturating_sub(1), &word, words);
    }
}

/// A pump in a pipe: a filled disc while it runs, a ring while it rests. Where its place is narrow the word stands above.
pub fn pump(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, label: &str, tag: TagId, selected: bool) {
    let theme = cx.theme;
    let (shape, style) = match value::is_on(cx, tag) {
        Some(true) => (theme.pick("●", "@"), theme.running()),
        Some(false) => (theme.pick("○", "o"), theme.normal()),
        None => ("?", theme.trouble()),
    };
    let word = word(cx, tag, (t!("RUN"), t!("STOP")));
    let y = at.y + at.height / 2;
    let beside = at.width >= width(label) + width(&word) + 5;
    let (open, close) = if at.width >= width(label) + 4 { ("(", ")") } else { ("", "") };
    let x = canvas.text(at.x, y, &format!("{open}{shape} "), style);
    let x = canvas.text(x, y, label, label_style(cx, selected));
    if beside {
        canvas.text(x, y, &format!(" {word}{close}"), style);
    } else {
        canvas.text(x, y, close, style);
        canvas.text(at.x + width(open) + 2, y.saturating_sub(1), &word, style);
    }
}

/// Columns right of a symbol, and left of it, in which room for its mark is looked for.
const MARK_REACH: (u16, u16) = (14, 6);

/// What there is to say of an actuator beyond its state: blocked, sent, failed, feedback mismatch. It is drawn when all else is,
/// in the first of these rows that has room for its word, else for its shape: it never hides a number.
pub fn mark(cx: &ViewContext, canvas: &mut Canvas, x: u16, rows: &[u16], tag: TagId) {
    let Some((words, style)) = actuator_mark::mark(cx, tag) else { return };
    let shape = words.split(' ').next().unwrap_or_default().to_owned();
    for text in [&words, &shape] {
        let columns = || (x..=x.saturating_add(MARK_REACH.0)).chain((x.saturating_sub(MARK_REACH.1)..x).rev());
        let mut spots = rows.iter().flat_map(|row| columns().map(move |column| (column, *row)));
        // A column stays free on both sides.
        let free = |(column, row): &(u16, u16)| canvas.is_blank(column.saturating_sub(1), *row, width(text) + 2);
        let found = spots.find(free);
        if let Some((column, row)) = found {
            canvas.text(column, row, text, style);
            return;
        }
    }
}

pub fn labelled(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, label: &str, tag: TagId, selected: bool) {
    // In the row of the valve or pump beside it.
    let at = Bounds { y: at.y + at.height / 2, ..at };
    let style = if selected { cx.theme.focus() } else { cx.theme.dim() };
    let label = fit(label, at.width / 2);
    if !label.is_empty() {
        cut(canvas, at.x, at.y, width(&label));
    }
    let x = if label.is_empty() { at.x } else { canvas.text(at.x, at.y, &label, style) + 1 };
    let room = at.width.saturating_sub(x.saturating_sub(at.x));
    let end = put_value(cx, canvas, x, at.y, tag, room);
    if let Some((words, style)) = actuator_mark::mark(cx, tag) {
        let room = (at.x + at.width).saturating_sub(end + 1);
        let shape = words.split(' ').next().unwrap_or_default().to_owned();
        // The shape alone where there is no room for its word; the faceplate has the words.
        if let Some(fits) = [&words, &shape].into_iter().find(|words| width(words) <= room) {
            canvas.text(end + 1, at.y, fits, style);
        }
    }
    if label.is_empty() && selected {
        canvas.paint(at.x, at.y, end.saturating_sub(at.x), 1, cx.theme.focus());
    }
}

/// Tags of few states side by side: label and word, or the word alone where there is no room for labels.
pub fn states(cx: &ViewContext, canvas: &mut Canvas, y: u16, tags: &[TagId]) {
    let label = |tag: &TagId| cx.def().tag(*tag).label.as_str();
    let room: u16 = tags.iter().map(|tag| width(label(tag)) + width(&value::show(cx, *tag).text) + 3).sum();
    let mut x = 0;
    for tag in tags {
        let shown = value::show(cx, *tag);
        if room <= canvas.width() + 2 {
            x = canvas.text(x, y, label(tag), cx.theme.dim()) + 1;
        }
        let left = canvas.width().saturating_sub(x);
        x = canvas.text(x, y, &shown.bare(left), shown.style) + 2;
    }
}

/// The state in a word: the profile's, else ours; why not, when it is not known.
fn word(cx: &ViewContext, tag: TagId, (on, off): (&str, &str)) -> String {
    let shown = value::show(cx, tag);
    match (value::is_on(cx, tag), cx.def().tag(tag).enum_labels.is_empty()) {
        (Some(true), true) => on.to_owned(),
        (Some(false), true) => off.to_owned(),
        (Some(_), false) | (None, _) => shown.text,
    }
}

/// The way to another page: its name behind an arrow.
pub fn link(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, page: &str, selected: bool) {
    let x = canvas.text(at.x, at.y, cx.theme.pick("▸ ", "> "), cx.theme.strong());
    canvas.text(x, at.y, page, label_style(cx, selected));
}
