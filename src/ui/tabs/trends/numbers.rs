//! The pens as numbers that are read from across the room: value, unit, setpoint and state of each.

use ratatui::widgets::Widget;
use tui_big_text::{BigText, PixelSize};

use super::*;
use crate::{
    plant::{def::Subject, sample::Quality},
    ui::{layout::Size, theme::Glyphs},
};

/// Sizes of a letter, the largest first: columns, rows.
const SIZES: [(PixelSize, (u16, u16)); 3] =
    [(PixelSize::Full, (8, 8)), (PixelSize::HalfHeight, (8, 4)), (PixelSize::Quadrant, (4, 4))];
/// Rows of a number beside its letters: name, setpoint and a blank.
const AROUND: u16 = 3;

/// Draws as many pens as there is room for, all alike.
pub(super) fn draw_numbers(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas) {
    let pens = trends.drawn(cx);
    let (width, height) = (canvas.width(), canvas.height());
    let columns = if Size::is_wide(width) && 2 < pens.len() { 2 } else { 1 };
    let rows = to_u16(pens.len().div_ceil(columns).max(1)).min((height / (4 + AROUND)).max(1));
    let (wide, high) = (width / to_u16(columns), height / rows);
    for (n, (_, pen)) in pens.iter().take(usize::from(rows) * columns).enumerate() {
        let (x, y) = (to_u16(n % columns) * wide, to_u16(n / columns) * high);
        number(cx, &mut canvas.part(x, y, wide, high), pen.tag);
    }
    let more = pens.len().saturating_sub(usize::from(rows) * columns);
    if more > 0 {
        canvas.text_right(width.saturating_sub(1), 0, &t!("{more} more pens need more room", more), cx.theme.strong());
    }
}

/// One value: large only while it is good, so that a doubted one is not taken for it.
fn number(cx: &ViewContext, canvas: &mut Canvas, tag: TagId) {
    let (theme, def) = (cx.theme, cx.def().tag(tag));
    let (quality, shown) = (cx.snapshot.sample(tag).quality, value::show(cx, tag));
    let end = canvas.text(1, 0, &fit(&format!("{}  {}", def.name, def.label), canvas.width() / 2), theme.strong());
    let of_tag = cx.snapshot.alarms.iter().filter(|alarm| cx.def().alarm(alarm.id).subject == Subject::Tag(tag));
    if let Some(alarm) = of_tag.min_by_key(|alarm| cx.def().alarm(alarm.id).priority) {
        let of = cx.def().alarm(alarm.id);
        let words = format!("{} {}", theme.priority_tag(of.priority), translate(&of.message));
        let room = canvas.width().saturating_sub(end + 3);
        canvas.text(end + 2, 0, &fit_words(&words, room), theme.alarm(of.priority, alarm.state, cx.flash()));
    }
    let (width, room) = (canvas.width(), canvas.height().saturating_sub(AROUND));
    let letters = to_u16(shown.text.chars().count());
    let fits = |(_, (columns, rows)): &&(PixelSize, (u16, u16))| {
        letters.saturating_mul(*columns) + text::width(&shown.unit) + 3 <= width && *rows <= room
    };
    let size = SIZES.iter().find(fits).filter(|_| quality == Quality::Good && shown.text.is_ascii());
    let mut y = 1;
    if let Some((size, (columns, rows))) = size {
        let area = canvas.part(1, y, letters * columns, *rows).area();
        let big = BigText::builder().pixel_size(*size).lines([shown.text.as_str().into()]).style(shown.style).build();
        big.render(area, canvas.buffer());
        if theme.glyphs == Glyphs::Ascii {
            in_ascii(canvas, area);
        }
        y += rows;
        canvas.text(2 + letters * columns, y - 1, &shown.unit, theme.strong());
    } else {
        canvas.text(1, y + 1, &fit_words(&shown.whole(), width.saturating_sub(2)), shown.style);
        y += 2;
    }
    canvas.text(1, y, &fit_words(&state(cx, tag), width.saturating_sub(2)), theme.normal());
}

/// The blocks of the letters as a sign of seven bits.
fn in_ascii(canvas: &mut Canvas, area: Rect) {
    for position in area.positions() {
        if let Some(cell) = canvas.buffer().cell_mut(position).filter(|cell| !cell.symbol().is_ascii()) {
            cell.set_symbol("#");
        }
    }
}

/// `SV 70.0 °C   RUN`, of the controller that measures it; of another value its quality.
fn state(cx: &ViewContext, tag: TagId) -> String {
    let face = cx.def().devices.iter().filter_map(|device| device.faceplate.as_ref()).find(|face| face.pv == tag);
    let Some(face) = face else { return cx.snapshot.sample(tag).quality.to_string() };
    let set = t!("SV {value}", value = value::show(cx, face.sv_to_show()).whole());
    let run = face.run.map(|run| value::show(cx, run).whole()).unwrap_or_default();
    format!("{set}   {run}   {}", cx.snapshot.sample(tag).quality)
}
