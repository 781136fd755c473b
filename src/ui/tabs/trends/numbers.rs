//! The pens as numbers that are read from across the room: value, unit, setpoint and state of each.

use ratatui::widgets::Widget;
use tui_big_text::{BigText, PixelSize};

use super::*;
use crate::{
    plant::{def::Subject, sample::Quality},
    ui::{layout::Size, theme::Glyphs},
};

/// The size of a letter: columns, rows.
type Letters = (PixelSize, (u16, u16));

/// The largest first.
const SIZES: [Letters; 3] = [(PixelSize::Full, (8, 8)), (PixelSize::HalfHeight, (8, 4)), SMALL];
/// Of units and setpoints.
const SMALL: Letters = (PixelSize::Quadrant, (4, 4));
/// Rows of a number beside its letters: name, setpoint and a blank.
const AROUND: u16 = 3;

/// Draws as many pens as there is room for, all alike.
pub(super) fn draw_numbers(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let pens = trends.drawn(cx);
    let (width, height) = (canvas.width(), canvas.height());
    let columns = if Size::is_wide(width) && 2 < pens.len() { 2 } else { 1 };
    let rows_in = |height: u16| to_u16(pens.len().div_ceil(columns).max(1)).min((height / (4 + AROUND)).max(1));
    // What there is no room for is said in a row of its own.
    let is_all = pens.len() <= usize::from(rows_in(height)) * columns;
    let height = height.saturating_sub(u16::from(!is_all));
    let rows = rows_in(height);
    let (wide, high) = (width / to_u16(columns), height / rows);
    for (n, (_, pen)) in pens.iter().take(usize::from(rows) * columns).enumerate() {
        let (x, y) = (to_u16(n % columns) * wide, to_u16(n / columns) * high);
        number(cx, &mut canvas.part(x, y, wide, high), pen.tag);
    }
    let more = pens.len().saturating_sub(usize::from(rows) * columns);
    if more > 0 {
        canvas.text_right(
            width.saturating_sub(1),
            height,
            &t!("enlarge the screen for more pens: {more}", more),
            cx.theme.strong(),
        );
    }
}

/// One value with its setpoint: large only while it is good, so that a doubted one is not taken for it.
fn number(cx: &ViewContext, canvas: &mut Canvas, tag: TagId) {
    let (theme, def) = (cx.theme, cx.def().tag(tag));
    let (quality, shown) = (cx.snapshot.sample(tag).quality, value::show(cx, tag));
    let end =
        canvas.text(1, 0, &fit(&format!("{}  {}", def.name, of_plant(&def.label)), canvas.width() / 2), theme.strong());
    let of_tag = cx.snapshot.alarms.iter().filter(|alarm| cx.def().alarm(alarm.id).subject == Subject::Tag(tag));
    if let Some(alarm) = of_tag.min_by_key(|alarm| cx.def().alarm(alarm.id).priority) {
        let of = cx.def().alarm(alarm.id);
        let words = format!("{} {}", theme.priority_tag(of.priority), translate(&of.message));
        let room = canvas.width().saturating_sub(end + 3);
        canvas.text(end + 2, 0, &fit_words(&words, room), theme.alarm(of.priority, alarm.state, cx.flash()));
    }
    let (width, room) = (canvas.width(), canvas.height().saturating_sub(AROUND));
    let (letters, unit) = (to_u16(shown.text.chars().count()), text::width(&shown.unit));
    let fits = |(_, (columns, rows)): &&Letters| letters * *columns + unit + 3 <= width && *rows <= room;
    let size = SIZES.iter().find(fits).filter(|_| quality == Quality::Good && shown.text.is_ascii());
    let mut y = 1;
    if let Some(size) = size {
        let (columns, rows) = size.1;
        let end = 1 + letters * columns;
        large(cx, canvas, (1, y), &shown.text, shown.style, size);
        y += rows;
        let is_drawn = |letter: char| matches!(letter, ' '..='~' | '\u{a0}'..='\u{ff}');
        if shown.unit.chars().all(is_drawn) && end + 1 + unit * SMALL.1.0 <= width {
            large(cx, canvas, (end + 1, y - SMALL.1.1), &shown.unit, theme.strong(), &SMALL);
        } else {
            canvas.text(end + 1, y - 1, &shown.unit, theme.strong());
        }
    } else {
        canvas.text(1, y + 1, &fit_words(&shown.whole(), width.saturating_sub(2)), shown.style);
        y += 2;
    }
    let face = cx.def().devices.iter().filter_map(|device| device.faceplate.as_ref()).find(|face| face.pv == tag);
    let mut state = quality.to_string();
    if let Some(face) = face {
        let sv = value::show(cx, face.sv_to_show());
        let run = face.run.map(|run| value::show(cx, run).whole()).unwrap_or_default();
        let set = t!("SV {value}", value = sv.text);
        state = format!("{run}   {state}");
        let is_good = cx.snapshot.sample(face.sv_to_show()).quality == Quality::Good;
        let is_room = to_u16(set.len()) * SMALL.1.0 + 2 <= width && y + SMALL.1.1 + 2 <= canvas.height();
        if is_good && set.is_ascii() && size.is_some() && is_room {
            large(cx, canvas, (1, y + 1), &set, theme.normal(), &SMALL);
            y += SMALL.1.1 + 1;
        } else {
            state = format!("{}   {state}", t!("SV {value}", value = sv.whole()));
        }
    }
    canvas.text(1, y, &fit_words(&state, width.saturating_sub(2)), theme.normal());
}

/// A text in large letters, its upper left corner at a place.
fn large(cx: &ViewContext, canvas: &mut Canvas, (x, y): (u16, u16), text: &str, style: Style, size: &Letters) {
    let (columns, rows) = size.1;
    let area = canvas.part(x, y, to_u16(text.chars().count()) * columns, rows).area();
    BigText::builder().pixel_size(size.0).lines([text.into()]).style(style).build().render(area, canvas.buffer());
    if cx.theme.glyphs == Glyphs::Ascii {
        in_ascii(canvas, area);
    }
}

/// The blocks of the letters as a sign of seven bits.
fn in_ascii(canvas: &mut Canvas, area: Rect) {
    for position in area.positions() {
        if let Some(cell) = canvas.buffer().cell_mut(position).filter(|cell| !cell.symbol().is_ascii()) {
            cell.set_symbol("#");
        }
    }
}
