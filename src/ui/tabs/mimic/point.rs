//! Which item of a picture stands where.

use crate::{
    plant::def::Picture,
    ui::{
        tabs::prelude::*,
        widgets::mimic::{Bounds, CanvasScale, place},
    },
};
use ratatui::layout::Position;

/// Columns and rows beside an item that count as it: a label reaches so far.
const NEAR: (u16, u16) = (3, 1);

/// The item of a picture at this place of the screen, or the nearest beside it; of two the smaller one, which stands in the
/// other.
pub(super) fn item_at(picture: &Picture, area: Rect, at: Position) -> Option<usize> {
    let (scale, left) = placed(picture, area);
    let (x, y) = (at.x.checked_sub(area.x + left)?, at.y - area.y);
    let outside = |at: u16, from: u16, length: u16| {
        from.saturating_sub(at) + at.saturating_sub(from.saturating_add(length.saturating_sub(1)))
    };
    let size = |at: Bounds| u32::from(at.width) * u32::from(at.height);
    let distance = |at: Bounds| (outside(x, at.x, at.width), outside(y, at.y, at.height), size(at));
    let items = picture.items.iter().enumerate();
    let near = items.filter_map(|(n, item)| Some((distance(scale.place(place(item)?)), n)));
    let near = near.filter(|((x, y, _), _)| *x <= NEAR.0 && *y <= NEAR.1);
    near.min_by_key(|((x, y, size), _)| (x + 2 * y, *size)).map(|(_, n)| n)
}

pub(super) fn scale(picture: &Picture, area: Rect) -> CanvasScale {
    CanvasScale::new(picture.size, (area.width, area.height))
}

/// The scale of a picture, and its first column: one that is not stretched stands in the middle.
pub(super) fn placed(picture: &Picture, area: Rect) -> (CanvasScale, u16) {
    let scale = scale(picture, area);
    let spare = area.width.saturating_sub(scale.column(picture.size.0));
    (scale, spare / 2)
}
