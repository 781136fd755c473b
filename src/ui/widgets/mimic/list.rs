//! The items of the mimic as a list of values, on a screen that is too small for the mimic.

use ratatui::layout::Rect;

use super::{alarm_mark, label_style, place, put_value, tags, title};
use crate::{
    plant::{
        def::{MimicItem, Picture, TagId},
        number::to_u16,
    },
    ui::{
        ViewContext,
        layout::Size,
        widgets::{
            list::{first, on_screen},
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// Columns of a name, at least and at most.
const NAMES: (u16, u16) = (11, 24);

/// Is the list shown, because the mimic does not fit? Vessels and curves that are cut at the bottom still tell their values.
pub fn is_shown(cx: &ViewContext, picture: &Picture, area: Rect) -> bool {
    let bottom = |item: &MimicItem| {
        let Some(place) = place(item) else { return 0 };
        let rows = if inside(item).is_some() {
            1
        } else if matches!(item, MimicItem::Trend { .. }) {
            place.height.min(2 + to_u16(tags(cx, item).len()))
        } else {
            place.height.max(1)
        };
        place.y.saturating_add(rows)
    };
    let cut = || picture.items.iter().any(|item| area.height < bottom(item));
    area.width < picture.size.0 || area.height < picture.size.1 && cut()
}

fn inside(item: &MimicItem) -> Option<&Vec<TagId>> {
    if let MimicItem::Vessel { inside, .. } = item { Some(inside) } else { None }
}

/// The items of each row: one where there is room for that, else two where both are short. On the smallest screens each
/// value has a row of its own.
fn rows(cx: &ViewContext, items: &[MimicItem]) -> Vec<Vec<usize>> {
    if cx.size <= Size::Compact {
        let mut rows: Vec<Vec<usize>> = values(cx, items).into_iter().map(|(n, _)| vec![n]).collect();
        rows.dedup();
        return rows;
    }
    let vessels: Vec<&Vec<TagId>> = items.iter().filter_map(inside).collect();
    // What stands in a vessel is in its row.
    let is_inside = |item: &MimicItem| match item {
        MimicItem::Value { tag, .. }
        | MimicItem::Agitator { tag, .. }
        | MimicItem::Heater { tag, .. }
        | MimicItem::Bar { tag, .. } => vessels.iter().any(|vessel| vessel.contains(tag)),
        MimicItem::Vessel { .. }
        | MimicItem::Valve { .. }
        | MimicItem::Pump { .. }
        | MimicItem::Pipe { .. }
        | MimicItem::Joint { .. }
        | MimicItem::Controller { .. }
        | MimicItem::Sequence { .. }
        | MimicItem::Trend { .. }
        | MimicItem::Link { .. }
        | MimicItem::Text { .. } => false,
    };
    let all = items.iter().enumerate().filter(|(_, item)| place(item).is_some() && !is_inside(item));
    // Controllers and vessels have more values than fit into half a row.
    let (wide, narrow): (Vec<_>, Vec<_>) =
        all.partition(|(_, item)| matches!(item, MimicItem::Controller { .. } | MimicItem::Vessel { .. }));
    let each = if wide.len() + narrow.len() <= usize::from(cx.area.height) { 1 } else { 2 };
    let row = |row: &[(usize, &MimicItem)]| row.iter().map(|(n, _)| *n).collect();
    wide.chunks(1).map(row).chain(narrow.chunks(each).map(row)).collect()
}

/// The item that an arrow key leads to; the first one when none is selected; the same when there is none further on.
pub fn neighbour(
    cx: &ViewContext,
    items: &[MimicItem],
    selected: Option<usize>,
    (dx, dy): (i32, i32),
) -> Option<usize> {
    let rows = rows(cx, items);
    let at = |n: usize| rows.iter().enumerate().find_map(|(y, row)| Some((row.iter().position(|of| *of == n)?, y)));
    let Some((x, y)) = selected.and_then(at) else { return rows.first().map(|row| row[0]) };
    let moved = |place: usize, by: i32, last: usize| place.saturating_add_signed(by as isize).min(last);
    let row = &rows[moved(y, dy, rows.len() - 1)];
    Some(row[moved(x, dx, row.len() - 1)])
}

/// Every item with its values; the page with the selected one.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, items: &[MimicItem], selected: Option<usize>) {
    if cx.size <= Size::Compact {
        return view_values(cx, canvas, items, selected);
    }
    let (all, half) = (canvas.width(), canvas.width() / 2);
    let rows = rows(cx, items);
    let longest = items.iter().filter(|item| place(item).is_some()).map(|item| width(&name(cx, item))).max();
    // Beside the name there is room for the value with its unit and its alarm mark.
    let halves = rows.iter().filter(|row| row.len() > 1).flatten().flat_map(|n| listed(cx, &items[*n]));
    let value = halves.map(|tag| width(&value::show(cx, tag).with_unit()) + 7).max().unwrap_or(0);
    let room = if value == 0 { all / 2 } else { half.saturating_sub(value) };
    let names = longest.unwrap_or(0).min(room).clamp(NAMES.0, NAMES.1);
    let room = usize::from(canvas.height()).max(1);
    let place = rows.iter().position(|row| row.iter().any(|n| Some(*n) == selected)).unwrap_or(0);
    for (y, row) in rows.iter().skip(place / room * room).take(room).enumerate() {
        for (column, n) in row.iter().enumerate() {
            let length = if row.len() == 1 { all } else { half };
            let mut cell = canvas.part(to_u16(column) * half, y, length, 1);
            item(cx, &mut cell, &items[*n], names, selected == Some(*n));
        }
    }
}

/// The values of all items, each once.
fn values(cx: &ViewContext, items: &[MimicItem]) -> Vec<(usize, TagId)> {
    let mut seen = Vec::new();
    for (n, item) in items.iter().enumerate().filter(|(_, item)| place(item).is_some()) {
        for tag in listed(cx, item) {
            if !seen.iter().any(|(_, shown)| *shown == tag) {
                seen.push((n, tag));
            }
        }
    }
    seen
}

/// A value a row: name, value, unit, alarm mark and why it is not good. Rows around the selected item.
fn view_values(cx: &ViewContext, canvas: &mut Canvas, items: &[MimicItem], selected: Option<usize>) {
    let label = |(n, tag): &(usize, TagId)| match listed(cx, &items[*n]).len() {
        1 => name(cx, &items[*n]),
        _ => cx.def().tag(*tag).name.clone(),
    };
    let row = |value: &(usize, TagId)| (label(value), value::show(cx, value.1));
    let values = values(cx, items);
    let rows: Vec<(String, value::Shown)> = values.iter().map(row).collect();
    let widest = |of: fn(&(String, value::Shown)) -> &str| rows.iter().map(|row| width(of(row))).max().unwrap_or(0);
    let (numbers, units) = (widest(|(_, shown)| &shown.text).clamp(6, 12), widest(|(_, shown)| &shown.unit).min(6));
    let names = widest(|(name, _)| name).min(canvas.width().saturating_sub(numbers + units + 8));
    let room = usize::from(canvas.height()).max(1);
    let at = values.iter().position(|(n, _)| Some(*n) == selected).unwrap_or(0);
    for (y, place, (name, shown)) in on_screen(&rows, first(at, rows.len(), room), room) {
        let (item, tag) = values[place];
        canvas.text(1, y, &fit(name, names), label_style(cx, selected == Some(item)));
        let end = 2 + names + numbers;
        canvas.text_right(end, y, &shown.bare(numbers), shown.style);
        canvas.text(end + 1, y, &shown.unit, shown.style);
        let x = if shown.unit.is_empty() { end + 1 } else { end + 2 + units };
        let x = alarm_mark(cx, tag).map_or(x, |(mark, style)| canvas.text(x, y, mark, style) + 1);
        canvas.text(x, y, &fit(&shown.note, canvas.width().saturating_sub(x)), shown.style);
    }
}

/// What the item is called in the list.
fn name(cx: &ViewContext, item: &MimicItem) -> String {
    match item {
        MimicItem::Controller { device, .. } => cx.def().device(*device).name.clone(),
        _ => title(cx, item),
    }
}

/// The values of an item that the list shows.
fn listed(cx: &ViewContext, item: &MimicItem) -> Vec<TagId> {
    match item {
        MimicItem::Controller { device, .. } => {
            let faceplate = cx.def().device(*device).faceplate.as_ref();
            let tags = faceplate.map(|faceplate| {
                [Some(faceplate.pv), Some(faceplate.sv_to_show()), faceplate.mv].into_iter().flatten().collect()
            });
            tags.unwrap_or_default()
        }
        _ => tags(cx, item),
    }
}

/// `TIC-1  PV 72.4 °C  SV 70.0 °C`: as many values as fit whole.
fn item(cx: &ViewContext, canvas: &mut Canvas, item: &MimicItem, names: u16, selected: bool) {
    let (name, tags) = (name(cx, item), listed(cx, item));
    let end = canvas.width();
    canvas.text(1, 0, &fit(&name, names), label_style(cx, selected));
    let mut x = names + 2;
    for tag in &tags {
        let label = if tags.len() > 1 { format!("{} ", cx.def().tag(*tag).short) } else { String::new() };
        let shown = value::show(cx, *tag);
        if end < x + width(&label) + width(&shown.text) + 1 {
            break;
        }
        let from = canvas.text(x, 0, &label, cx.theme.dim());
        x = put_value(cx, canvas, from, 0, *tag, end.saturating_sub(from + 1)) + 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn arrows_move_by_rows_and_columns_of_the_list() {
        let snapshot = Fixture::normal().snapshot();
        for (size, rows_of_screen) in [(Size::Narrow, 10), (Size::Narrow, 60), (Size::Compact, 8)] {
            with_cx(&snapshot, |cx| {
                let area = Rect { height: rows_of_screen, ..cx.area };
                assert_moves(&ViewContext { size, area, ..*cx }, &snapshot.def.mimic.pages[0].pictures[0].items);
            });
        }
    }

    fn assert_moves(cx: &ViewContext, items: &[MimicItem]) {
        let rows = rows(cx, items);
        assert_eq!(neighbour(cx, items, None, (0, 1)), Some(rows[0][0]));
        let mut selected = Some(rows[0][0]);
        for row in &rows[1..] {
            selected = neighbour(cx, items, selected, (0, 1));
            assert_eq!(selected, Some(row[0]), "one row down");
        }
        assert_eq!(neighbour(cx, items, selected, (0, 1)), selected, "the last row");
        if let Some(pair) = rows.iter().find(|row| row.len() == 2) {
            assert_eq!(neighbour(cx, items, Some(pair[0]), (1, 0)), Some(pair[1]));
            assert_eq!(neighbour(cx, items, Some(pair[1]), (1, 0)), Some(pair[1]), "the last column");
            assert_eq!(neighbour(cx, items, Some(pair[1]), (-1, 0)), Some(pair[0]));
        }
        let listed: Vec<TagId> = rows.iter().flatten().flat_map(|n| listed(cx, &items[*n])).collect();
        let all: Vec<TagId> = items.iter().flat_map(|item| super::listed(cx, item)).collect();
        assert!(all.iter().all(|tag| listed.contains(tag)), "every value has its place");
    }
}
