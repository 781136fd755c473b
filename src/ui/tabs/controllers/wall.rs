//! The first page where there is room: every device as a small faceplate, as many beside and below each other as fit.

use super::{
    faceplate::{self, Bars},
    list::{self, Devices},
};
use crate::ui::tabs::prelude::*;
use crate::{
    attach::check::SERIES_MAX,
    history::Series,
    plant::{def, tag::TagDef},
    ui::{
        layout::Size,
        widgets::{
            mimic::{Bounds, trend},
            spark::spark,
        },
    },
};

/// Columns of a faceplate with its frame, at least and at most.
const WIDTH: (u16, u16) = (39, 68);
/// The same on a wide screen.
const WIDTH_WIDE: u16 = 48;
/// Rows of it: three bars, deviation, states, trend and frame; at most with a trend of several rows.
const HEIGHT: (u16, u16) = (8, 18);
/// Rows of it without the trend.
const FIXED: u16 = 7;
/// Rows above and below the faceplates.
const AROUND: u16 = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Beside each other.
    pub columns: usize,
    /// Rows of them that are seen.
    pub rows: usize,
    width: u16,
    height: u16,
}

impl Grid {
    /// As many as fit on this area; where all of them fit they grow into it.
    pub fn new(size: Size, area: Rect, devices: usize) -> Grid {
        let least = if size < Size::Wide { WIDTH.0 } else { WIDTH_WIDE };
        let columns = usize::from(area.width / least).clamp(1, devices.max(1));
        let width = (area.width / to_u16(columns)).min(WIDTH.1);
        let free = area.height.saturating_sub(AROUND);
        let needed = to_u16(devices.max(1).div_ceil(columns));
        let height = (free / needed).clamp(HEIGHT.0, HEIGHT.1);
        let rows = usize::from(free / height).min(SERIES_MAX / columns).max(1);
        Grid { columns, rows, width, height }
    }

    /// Those on the screen while this one of so many devices is selected: the first, and how many at most.
    fn seen(self, selected: usize, devices: usize) -> (usize, usize) {
        let first = first(selected / self.columns, devices.div_ceil(self.columns), self.rows);
        (first * self.columns, self.rows * self.columns)
    }

    /// The faceplate so many rows below this one of so many; the same where there is none.
    pub fn step(self, at: usize, by: isize, count: usize) -> usize {
        let row = (at / self.columns).saturating_add_signed(by).min(count.saturating_sub(1) / self.columns);
        (row * self.columns + at % self.columns).min(count.saturating_sub(1))
    }
}

/// The tags whose curves it shows.
pub fn tags(cx: &ViewContext, list: &List<Devices>) -> Vec<TagId> {
    let devices = list.rows(cx);
    let (first, count) = Grid::new(cx.size, cx.area, devices.len()).seen(list.place(&devices), devices.len());
    let seen = devices.iter().skip(first).take(count);
    seen.filter_map(|device| Some(device.faceplate.as_ref()?.pv)).collect()
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, list: &List<Devices>, curves: &Answered<Vec<Series>>) {
    let series = curves.value.as_deref().unwrap_or_default();
    let (end, bottom) = (canvas.width().saturating_sub(1), canvas.height().saturating_sub(1));
    let devices = list.rows(cx);
    let (selected, grid) = (list.place(&devices), Grid::new(cx.size, canvas.area(), devices.len()));
    let heading = list.view_heading(cx, canvas, devices.len());
    if devices.is_empty() {
        return list.view_empty(cx, canvas, &heading);
    }
    if let Some(trouble) = &curves.trouble {
        let words = fit_words(&t!("no curves: {trouble}", trouble), end / 2);
        canvas.text(end.saturating_sub(width(&words) + 14), 0, &words, cx.theme.trouble());
    }
    let rows: Vec<&[Cow<DeviceDef>]> = devices.chunks(grid.columns).collect();
    let first = grid.seen(selected, devices.len()).0 / grid.columns;
    for (y, row, devices) in on_screen(&rows, first, grid.rows) {
        for (column, device) in devices.iter().enumerate() {
            let mut card = canvas.part(to_u16(column) * grid.width, 1 + y * grid.height, grid.width, grid.height);
            self::card(cx, &mut card, device, row * grid.columns + column == selected, series);
        }
    }
    let below = rows.iter().skip(first + grid.rows).map(|row| row.len()).sum::<usize>();
    if below > 0 {
        canvas.text_right(end, 0, &t!("{below} more ▼", below), cx.theme.normal());
    }
    if let Some(device) = devices.get(selected) {
        list::foot(cx, &mut canvas.part(0, bottom, end + 1, 1), device);
    }
}

/// One device in its frame: heavy words where it is selected, its alarm and how it stands at the right.
fn card(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef, selected: bool, series: &[Series]) {
    let theme = cx.theme;
    let (width, height) = (canvas.width(), canvas.height());
    canvas.frame("", if selected { theme.strong() } else { theme.dim() });
    let (mark, _, style) = list::state(cx, device.id);
    canvas.text_right(width.saturating_sub(2), 0, &format!(" {mark} "), style);
    let (alarm, style) = list::alarm(cx, device.id);
    let end = width.saturating_sub(5 + text::width(&mark));
    if !alarm.is_empty() {
        canvas.text_right(end, 0, &format!(" {alarm} "), style);
    }
    let room = end.saturating_sub(3 + text::width(&alarm) + 3);
    let name = format!(" {} ", fit(&device.name, room.saturating_sub(2)));
    let x = canvas.text(2, 0, &name, if selected { theme.focus() } else { theme.strong() });
    let title = fit_words(of_plant(&device.title), room.saturating_sub(x + 1));
    if !title.is_empty() {
        canvas.text(x, 0, &format!(" {title} "), theme.normal());
    }
    let mut inner = canvas.part(1, 1, width.saturating_sub(2), height.saturating_sub(2));
    match &device.faceplate {
        Some(faceplate) => controller(cx, &mut inner, device, faceplate, series),
        None => values(cx, &mut inner, device),
    }
}

fn controller(
    cx: &ViewContext,
    canvas: &mut Canvas,
    device: &DeviceDef,
    faceplate: &def::Faceplate,
    series: &[Series],
) {
    let (width, height) = (canvas.width(), canvas.height());
    faceplate::bars(cx, &mut canvas.part(0, 0, width.saturating_sub(1), 3), faceplate, Bars::Bare);
    deviation(cx, &mut canvas.part(1, 3, width.saturating_sub(3), 1), faceplate);
    faceplate::states(cx, &mut canvas.part(0, 4, width, 1), device, faceplate);
    let series = series.iter().find(|series| series.tag == faceplate.pv);
    let rows = height.saturating_sub(FIXED - 2);
    if rows > 3 {
        let at = Bounds { x: 1, y: FIXED - 2, width: width.saturating_sub(2), height: rows };
        trend::view(cx, canvas, at, faceplate.pv, faceplate::WINDOW, series, false);
    } else if let Some(series) = series {
        let minutes = faceplate::WINDOW.as_secs() / 60;
        let x = canvas.text(1, FIXED - 2, &t!("{minutes} min", minutes), cx.theme.dim()) + 1;
        let cells = usize::from(width.saturating_sub(x + 1));
        let resolution = 10f64.powi(-i32::from(cx.snapshot.decimals[faceplate.pv.index()]));
        canvas.text(x, FIXED - 2, &spark(series, cells, resolution, cx.theme.glyphs), cx.theme.pen(0));
    }
}

/// `PV−SV −4.7 °C  ├────◆──┼───────┤`: in the middle PV is at SV, at the ends a tenth of the range away from it.
fn deviation(cx: &ViewContext, canvas: &mut Canvas, faceplate: &def::Faceplate) {
    let theme = cx.theme;
    let value = |tag| cx.snapshot.sample(tag).good_value();
    let apart = value(faceplate.pv).zip(value(faceplate.sv_to_show())).map(|(pv, sv)| pv - sv);
    let number = apart.map_or("----".to_owned(), |apart| {
        let sign = if apart > 0.0 { "+" } else { "" };
        format!("{sign}{} {}", cx.snapshot.format(faceplate.pv, apart), cx.snapshot.unit(faceplate.pv))
    });
    let x = canvas.text(0, 0, t!("PV-SV"), theme.dim()) + 1;
    let x = canvas.text(x, 0, &pad_left(number.trim_end(), 10), theme.normal()) + 1;
    let wide = canvas.width().saturating_sub(x);
    if wide < 7 {
        return;
    }
    let half = (wide - 1) / 2;
    canvas.run(x, 0, half * 2 + 1, '─', theme.dim());
    canvas.glyph(x, 0, '├', theme.dim());
    canvas.glyph(x + half * 2, 0, '┤', theme.dim());
    canvas.glyph(x + half, 0, '┼', theme.set_value());
    let Some((apart, (low, high))) = apart.zip(cx.snapshot.range(faceplate.pv)) else { return };
    let share = (apart / ((high - low) / 10.0)).clamp(-1.0, 1.0);
    if share.is_finite() {
        let at = f64::from(x + half) + share * f64::from(half);
        canvas.glyph(to_u16(at.round()), 0, theme.pick('■', '#'), theme.strong());
    }
}

/// A device that controls nothing: how many of its values are good, and the first of those that are stored.
fn values(cx: &ViewContext, canvas: &mut Canvas, device: &DeviceDef) {
    let (words, style) = list::values_good(cx, device);
    canvas.text(1, 0, &words, style);
    let half = canvas.width() / 2;
    let stored: Vec<&TagDef> = cx.def().tags_of(device.id).filter(|tag| tag.is_stored()).collect();
    let room = usize::from(canvas.height().saturating_sub(1));
    for (n, tag) in stored.into_iter().take(room * 2).enumerate() {
        let mut cell = canvas.part(to_u16(n / room) * half, 1 + n % room, half, 1);
        let shown = value::show(cx, tag.id);
        let text = shown.within(half.saturating_sub(4));
        let name = fit(&tag.short, half.saturating_sub(width(&text) + 3));
        cell.text(1, 0, &name, cx.theme.dim());
        cell.text_right(half.saturating_sub(1), 0, &text, shown.style);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_room_shows_more_faceplates_not_wider_ones() {
        let check = |size, (width, height): (u16, u16), devices, columns, rows| {
            let grid = Grid::new(size, Rect::new(0, 0, width, height), devices);
            assert_eq!((grid.columns, grid.rows), (columns, rows), "{devices} at {width}x{height}");
            assert!(grid.width * to_u16(columns) <= width && grid.width <= WIDTH.1, "{grid:?}");
        };
        check(Size::Normal, (80, 18), 31, 2, 2);
        check(Size::Wide, (120, 34), 31, 2, 4);
        check(Size::Overview, (160, 44), 31, 3, 5);
        check(Size::Overview, (200, 54), 31, 4, 6);
        check(Size::Overview, (160, 44), 1, 1, 2);
        check(Size::Wide, (120, 34), 2, 2, 1);
    }

    #[test]
    fn arrows_move_between_faceplates() {
        let grid = Grid::new(Size::Overview, Rect::new(0, 0, 160, 44), 8);
        assert_eq!((grid.step(1, 1, 8), grid.step(4, 1, 8), grid.step(5, 1, 8)), (4, 7, 7));
        assert_eq!((grid.step(1, -1, 8), grid.step(7, -1, 8), grid.step(7, 1, 8)), (1, 4, 7));
    }
}
