//! A vessel: its liquid follows the level, and is unknown without a good value; and what stands in it.

use std::collections::BTreeMap;

use crate::t;
use ratatui::style::Style;

use super::{Bounds, cut, is_liquid, label_style, limits, put_value};
use crate::{
    plant::{
        def::{Level, TagId},
        number::{to_u16, to_u32},
    },
    ui::{
        ViewContext,
        theme::Colours,
        widgets::{
            actuator_mark,
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// Draws a box with its label; with a level also its liquid, and the limits of its alarms on the right edge.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, label: &str, level: Option<TagId>, selected: bool) {
    let mut canvas = canvas.part(at.x, at.y, at.width, at.height);
    canvas.frame("", cx.theme.dim());
    let room = at.width.saturating_sub(2);
    let words = if width(label) + 2 <= room { format!(" {label} ") } else { fit(label, room) };
    if !label.is_empty() {
        canvas.text(1, 0, &words, label_style(cx, selected));
    }
    let (columns, rows) = (at.width.saturating_sub(2), at.height.saturating_sub(2));
    let Some(level) = level else { return };
    if let Some(eighths) = eighths(cx, level, rows) {
        liquid(cx, &mut canvas.part(1, 1, columns, rows), eighths);
    }
    for (row, _) in limit_rows(cx, level, rows) {
        canvas.glyph(at.width.saturating_sub(1), 1 + row, '┤', cx.theme.normal());
    }
}

/// The rows of the limits, in a vessel with so many inside, each with its letters.
fn limit_rows(cx: &ViewContext, level: TagId, rows: u16) -> BTreeMap<u16, String> {
    let mut marks: BTreeMap<u16, String> = BTreeMap::new();
    let Some((min, max)) = cx.snapshot.range(level) else { return marks };
    for (limit, kind) in limits(cx, level) {
        let share = (limit - min) / (max - min);
        if (0.0..=1.0).contains(&share) {
            let row = to_u16((f64::from(rows.saturating_sub(1)) * (1.0 - share)).round());
            let letters = match kind {
                Level::HighHigh => "HH",
                Level::High => "H",
                Level::Low => "L",
                Level::LowLow => "LL",
            };
            let mark = marks.entry(row).or_default();
            *mark = if mark.is_empty() { letters.to_owned() } else { format!("{mark}/{letters}") };
        }
    }
    marks
}

/// The letters of the limits, inside the right edge or else behind it. They are drawn when all else is, and never over it.
pub fn limit_marks(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, level: TagId) {
    for (row, letters) in limit_rows(cx, level, at.height.saturating_sub(2)) {
        let (y, wide) = (at.y + 1 + row, width(&letters));
        let edge = at.x + at.width.saturating_sub(1);
        let inside = edge.saturating_sub(wide);
        let is_free = |canvas: &Canvas, x: u16| {
            let is_ground = |symbol: &str| symbol == " " || is_liquid(symbol);
            (x.saturating_sub(1)..x + wide).all(|x| canvas.symbol(x, y).is_some_and(is_ground))
        };
        if at.width > wide + 3 && is_free(canvas, inside) {
            cut(canvas, inside, y, wide);
            canvas.text(inside, y, &letters, cx.theme.normal());
        } else if canvas.is_blank(edge + 1, y, wide + 1) {
            canvas.text(edge + 1, y, &letters, cx.theme.normal());
        }
    }
}

/// An agitator: its picture turns while it works; beside it its state.
pub fn agitator(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, tag: TagId, selected: bool, motion: bool) {
    let theme = cx.theme;
    let (shown, on) = (value::show(cx, tag), value::is_on(cx, tag));
    let turn = motion && cx.phase % 4 >= 2;
    let (picture, style) = match (on, turn) {
        (Some(true), false) => (theme.pick("╶─╂─╴", "-+-"), theme.running()),
        (Some(true), true) => (theme.pick(" ╶╂╴ ", " + "), theme.running()),
        (Some(false), _) => (theme.pick("╶─┼─╴", "-|-"), theme.dim()),
        (None, _) => (" ? ", theme.trouble()),
    };
    let words = fit(&shown.text, at.width.saturating_sub(width(picture) + 1));
    cut(canvas, at.x, at.y, width(picture) + 1 + width(&words));
    let x = canvas.text(at.x, at.y, picture, style);
    let style = if on == Some(true) { theme.running() } else { shown.style };
    let x = canvas.text(x + 1, at.y, &words, if selected { theme.focus() } else { style });
    shape_of_mark(cx, canvas, x + 1, at.y, tag);
}

/// A heater: glows while it works; beside it its power.
pub fn heater(cx: &ViewContext, canvas: &mut Canvas, at: Bounds, tag: TagId, selected: bool) {
    let theme = cx.theme;
    let (picture, words, style) = match value::is_on(cx, tag) {
        Some(true) => (theme.pick("≋≋≋", "^^^"), None, theme.running()),
        Some(false) => (theme.pick("───", "---"), Some(t!("off")), theme.dim()),
        None => (t!("heater"), None, theme.dim()),
    };
    let room = at.width.saturating_sub(width(picture) + 1);
    let length = words.map_or_else(|| width(&value::show(cx, tag).within(room)), width);
    cut(canvas, at.x, at.y, width(picture) + 1 + length);
    let x = canvas.text(at.x, at.y, picture, style) + 1;
    let end = match words {
        Some(words) => canvas.text(x, at.y, words, style),
        None => put_value(cx, canvas, x, at.y, tag, room),
    };
    if selected {
        canvas.paint(at.x, at.y, end.saturating_sub(at.x), 1, theme.focus());
    }
    shape_of_mark(cx, canvas, end + 1, at.y, tag);
}

/// The level in eighths of a row; `None` unless the value is good and its range known.
fn eighths(cx: &ViewContext, level: TagId, rows: u16) -> Option<u32> {
    let value = cx.snapshot.sample(level).good_value()?;
    let (min, max) = cx.snapshot.range(level)?;
    let share = ((value - min) / (max - min)).clamp(0.0, 1.0);
    // A little is not nothing.
    let least = u32::from(share > 0.005);
    share.is_finite().then(|| to_u32((share * f64::from(rows) * 8.0).round()).max(least))
}

/// Without colour liquid is a pattern, so that it is seen beside words and above the bottom of the vessel.
const BODY: char = '▒';
/// A row that is filled in part.
const SHALLOW: char = '░';

fn liquid(cx: &ViewContext, canvas: &mut Canvas, eighths: u32) {
    const SURFACE: [char; 7] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇'];
    let plain = cx.theme.colours == Colours::None;
    let style = if plain { Style::new() } else { cx.theme.liquid() };
    let (width, height) = (canvas.width(), canvas.height());
    let full = to_u16(eighths / 8);
    for y in height.saturating_sub(full)..height {
        canvas.run(0, y, width, if plain { BODY } else { '█' }, style);
    }
    let rest = (eighths % 8) as usize;
    if rest > 0 && full < height {
        let surface = if plain { SHALLOW } else { SURFACE[rest - 1] };
        canvas.run(0, height - full - 1, width, surface, style);
    }
}

/// The mark of an actuator inside the vessel: its shape alone, the faceplate has the words.
fn shape_of_mark(cx: &ViewContext, canvas: &mut Canvas, x: u16, y: u16, output: TagId) {
    if let Some((words, style)) = actuator_mark::mark(cx, output) {
        canvas.text(x, y, words.split(' ').next().unwrap_or_default(), style);
    }
}
