//! A small trend of the last minutes: its curve, its name and its scale.

use crate::t;
use std::time::Duration;

use ratatui::style::Style;

use super::{Bounds, label_style};
use crate::{
    history::Series,
    plant::{
        def::TagId,
        number::{to_u16, to_usize},
    },
    ui::{
        ViewContext,
        theme::Glyphs,
        widgets::text::{Canvas, fit, whole},
    },
};

/// Draws the curve of a tag, a gap where nothing good is known.
pub fn view(
    cx: &ViewContext,
    canvas: &mut Canvas,
    at: Bounds,
    tag: TagId,
    window: Duration,
    series: Option<&Series>,
    selected: bool,
) {
    let mut canvas = canvas.part(at.x, at.y, at.width, at.height);
    let theme = cx.theme;
    let minutes = window.as_secs() / 60;
    let span = if minutes.is_multiple_of(60) && minutes > 0 {
        format!("{} h", minutes / 60)
    } else {
        t!("{minutes} min", minutes)
    };
    let x = canvas.text(0, 0, &fit(&cx.def().tag(tag).name, at.width), label_style(cx, selected));
    canvas.text(x + 1, 0, &t!("last {span}", span), theme.dim());
    // A good value now will be a curve soon, whatever the past lacks.
    let soon = series.is_none() || cx.snapshot.sample(tag).good_value().is_some();
    let Some((series, (low, _, high))) = series.and_then(|series| Some((series, series.summary?))) else {
        canvas.text(0, 1, if soon { t!("collecting data") } else { t!("no good value") }, theme.dim());
        return;
    };
    let label = |value| cx.snapshot.format(tag, value);
    let (top, bottom) = (label(high), label(low));
    let (end, room) = (canvas.width(), to_u16(top.len().max(bottom.len())) + 1);
    let (rows, columns) = (at.height.saturating_sub(1), end.saturating_sub(room));
    let [top, bottom] = [top, bottom].map(|text| whole(&text, end));
    canvas.text_right(end, 1, &top, theme.dim());
    if rows > 1 {
        canvas.text_right(end, rows, &bottom, theme.dim());
    }
    let style = theme.pen(0);
    curve(&mut canvas.part(0, 1, columns, rows), series, (low.near(), high.near()), theme.glyphs, style);
}

/// Two dots a cell across and four down in braille; else one bar a cell in eighths.
pub fn curve(canvas: &mut Canvas, series: &Series, (low, high): (f64, f64), glyphs: Glyphs, style: Style) {
    let (across, down) = match glyphs {
        Glyphs::Braille => (2, 4),
        Glyphs::Block | Glyphs::Ascii => (1, 8),
    };
    let (width, height) = (usize::from(canvas.width()), usize::from(canvas.height()));
    if width == 0 || height == 0 {
        return;
    }
    let dots = height * down;
    let level = |value: f64| {
        let share = if high > low { (value - low) / (high - low) } else { 0.5 };
        to_usize(((1.0 - share.clamp(0.0, 1.0)) * (dots - 1) as f64).round())
    };
    let columns = width * across;
    for y in 0..height {
        for x in 0..width {
            let mut bits = 0u32;
            let mut filled = 0;
            for dx in 0..across {
                let Some((top, bottom)) = span(series, x * across + dx, columns) else { continue };
                let (top, bottom) = (level(top), level(bottom));
                for dy in 0..down {
                    let row = y * down + dy;
                    let lit = if across == 2 { (top..=bottom).contains(&row) } else { row >= top };
                    if lit {
                        bits |= braille(dx, dy);
                        filled += 1;
                    }
                }
            }
            let glyph = match (glyphs, filled) {
                (_, 0) => continue,
                (Glyphs::Braille, _) => char::from_u32(0x2800 + bits).unwrap_or(' '),
                (Glyphs::Block | Glyphs::Ascii, n) => ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'][n - 1],
            };
            canvas.glyph(x, y, glyph, style);
        }
    }
}

/// Highest and lowest value in one column of dots.
fn span(series: &Series, column: usize, columns: usize) -> Option<(f64, f64)> {
    let count = series.buckets.len();
    let from = column * count / columns;
    let to = ((column + 1) * count / columns).clamp(from + 1, count.max(from + 1));
    let good = series.buckets.get(from..to.min(count))?.iter().flatten();
    good.map(|bucket| (bucket.max, bucket.min)).reduce(|(top, low), (max, min)| (top.max(max), low.min(min)))
}

/// The bit of a dot in the braille block of Unicode.
fn braille(dx: usize, dy: usize) -> u32 {
    const BITS: [[u32; 8]; 2] = [[0x01, 0x02, 0x04, 0x40, 0, 0, 0, 0], [0x08, 0x10, 0x20, 0x80, 0, 0, 0, 0]];
    BITS[dx][dy]
}
