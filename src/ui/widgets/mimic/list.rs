//! The items of the mimic as a list of values, on a screen that is too small for the mimic.

use ratatui::layout::Rect;

use super::{label_style, place, put_value, tags, title};
use crate::{
    plant::{
        def::{MimicItem, Picture, TagId},
        number::to_u16,
    },
    ui::{
        ViewContext,
        widgets::{
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// Columns of half a row for a value with its unit and its alarm mark.
const VALUE: u16 = 18;

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

/// The items of each row: two in a row where one is short.
fn rows(items: &[MimicItem]) -> Vec<Vec<usize>> {
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
    let row = |row: &[(usize, &MimicItem)]| row.iter().map(|(n, _)| *n).collect();
    wide.chunks(1).map(row).chain(narrow.chunks(2).map(row)).collect()
}

/// The item that an arrow key leads to; the first one when none is selected; the same when there is none further on.
pub fn neighbour(items: &[MimicItem], selected: Option<usize>, (dx, dy): (i32, i32)) -> Option<usize> {
    let rows = rows(items);
    let at = |n: usize| rows.iter().enumerate().find_map(|(y, row)| Some((row.iter().position(|of| *of == n)?, y)));
    let Some((x, y)) = selected.and_then(at) else { return rows.first().map(|row| row[0]) };
    let moved = |place: usize, by: i32, last: usize| place.saturating_add_signed(by as isize).min(last);
    let row = &rows[moved(y, dy, rows.len() - 1)];
    Some(row[moved(x, dx, row.len() - 1)])
}

/// Every item with its values; the page with the selected one.
pub fn view(cx: &ViewContext, canvas: &mut Canvas, items: &[MimicItem], selected: Option<usize>) {
    let (all, half) = (canvas.width(), canvas.width() / 2);
    let rows = rows(items);
    let names = half.saturating_sub(VALUE).clamp(11, 24);
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

/// `TIC-1  PV 72.4 °C  SV 70.0 °C`: as many values as fit whole.
fn item(cx: &ViewContext, canvas: &mut Canvas, item: &MimicItem, names: u16, selected: bool) {
    let (name, tags): (String, Vec<TagId>) = match item {
        MimicItem::Controller { device, .. } => {
            let device = cx.def().device(*device);
            let faceplate = device.faceplate.as_ref();
            let tags = faceplate.map(|faceplate| {
                [Some(faceplate.pv), Some(faceplate.sv_to_show()), faceplate.mv].into_iter().flatten().collect()
            });
            (device.name.clone(), tags.unwrap_or_default())
        }
        _ => (title(cx, item), tags(cx, item)),
    };
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
        let items = Fixture::normal().def.mimic.pages[0].pictures[0].items.clone();
        let rows = rows(&items);
        assert_eq!(neighbour(&items, None, (0, 1)), Some(rows[0][0]));
        let mut selected = Some(rows[0][0]);
        for row in &rows[1..] {
            selected = neighbour(&items, selected, (0, 1));
            assert_eq!(selected, Some(row[0]), "one row down");
        }
        assert_eq!(neighbour(&items, selected, (0, 1)), selected, "the last row");
        let pair = rows.iter().find(|row| row.len() == 2).expect("two short items stand in one row");
        assert_eq!(neighbour(&items, Some(pair[0]), (1, 0)), Some(pair[1]));
        assert_eq!(neighbour(&items, Some(pair[1]), (1, 0)), Some(pair[1]), "the last column");
        assert_eq!(neighbour(&items, Some(pair[1]), (-1, 0)), Some(pair[0]));
        let listed: Vec<TagId> = with_cx(&Fixture::normal().snapshot(), |cx| {
            rows.iter().flatten().flat_map(|n| tags(cx, &items[*n])).collect()
        });
        let all = with_cx(&Fixture::normal().snapshot(), |cx| {
            items.iter().flat_map(|item| tags(cx, item)).collect::<Vec<_>>()
        });
        assert!(all.iter().all(|tag| listed.contains(tag)), "every value has its place");
    }
}
