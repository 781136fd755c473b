//! The items of the picture as a list of values, on a screen that is narrower than the picture.

use super::{label_style, place, put_value, tags, title};
use crate::{
    plant::def::{MimicItem, TagId},
    ui::{
        Cx,
        widgets::{
            text::{Canvas, fit, width},
            value,
        },
    },
};

/// Columns for the name of an item.
const NAMES: u16 = 11;

/// Every item with its values, in two columns where one is too short; the page with the selected one.
pub fn view(cx: &Cx, canvas: &mut Canvas, selected: Option<usize>) {
    let items = cx.def().mimic.items.iter().enumerate();
    let items: Vec<(usize, &MimicItem)> = items.filter(|(_, item)| place(item).is_some()).collect();
    // Controllers and tanks have more to tell than half a row takes.
    let (wide, narrow): (Vec<_>, Vec<_>) =
        items.into_iter().partition(|(_, item)| matches!(item, MimicItem::Controller { .. } | MimicItem::Tank { .. }));
    let (all, half) = (canvas.width(), canvas.width() / 2);
    let rows: Vec<Vec<_>> = wide.chunks(1).chain(narrow.chunks(2)).map(|row| row.to_vec()).collect();
    let room = usize::from(canvas.height()).max(1);
    let place = rows.iter().position(|row| row.iter().any(|(n, _)| Some(*n) == selected)).unwrap_or(0);
    for (y, row) in rows.iter().skip(place / room * room).take(room).enumerate() {
        for (column, (n, item)) in row.iter().enumerate() {
            let length = if row.len() == 1 { all } else { half };
            let mut cell = canvas.part(column as u16 * half, y as u16, length, 1);
            self::item(cx, &mut cell, item, selected == Some(*n));
        }
    }
}

/// `TIC-1  PV 72.4 °C  SV 70.0 °C`: as many values as fit whole.
fn item(cx: &Cx, canvas: &mut Canvas, item: &MimicItem, selected: bool) {
    let (name, tags): (String, Vec<TagId>) = match item {
        MimicItem::Controller { device, .. } => {
            let device = cx.def().device(*device);
            let plate = device.faceplate.as_ref();
            let tags = plate.map(|plate| [Some(plate.pv), Some(plate.aim()), plate.mv].into_iter().flatten().collect());
            (device.name.clone(), tags.unwrap_or_default())
        }
        _ => (title(cx, item), tags(cx, item)),
    };
    let end = canvas.width();
    canvas.text(1, 0, &fit(&name, NAMES), label_style(cx, selected));
    let mut x = NAMES + 2;
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
