//! Which item an arrow key leads to.

use crate::plant::def::{MimicItem, MimicRect};
use crate::ui::widgets::mimic::place;

/// The nearest item in a direction; the first one when none is selected; the same when there is none further on.
pub(super) fn neighbour(items: &[MimicItem], selected: Option<usize>, (dx, dy): (i32, i32)) -> Option<usize> {
    let centre = |place: MimicRect| {
        let middle = |from: u16, length: u16| i32::from(from) * 2 + i32::from(length);
        // A row is about as high as two columns are wide.
        (middle(place.x, place.width), middle(place.y, place.height) * 2)
    };
    let places = || items.iter().enumerate().filter_map(|(n, item)| Some((n, centre(place(item)?))));
    let Some((_, (x, y))) = selected.and_then(|selected| places().find(|(n, _)| *n == selected)) else {
        return places().next().map(|(n, _)| n);
    };
    let ahead = places().filter_map(|(n, (to_x, to_y))| {
        let along = (to_x - x) * dx + (to_y - y) * dy;
        let aside = ((to_x - x) * dy).abs() + ((to_y - y) * dx).abs();
        (along > 0 && aside <= along * 3).then_some((along + 2 * aside, n))
    });
    ahead.min().map(|(_, n)| n).or(selected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::Fixture;

    #[test]
    fn arrow_keys_reach_every_item() {
        let items = Fixture::normal().def.mimic.pages[0].pictures[0].items.clone();
        let mut reached = vec![false; items.len()];
        let mut open: Vec<usize> = neighbour(&items, None, (1, 0)).into_iter().collect();
        while let Some(n) = open.pop() {
            if !std::mem::replace(&mut reached[n], true) {
                open.extend(
                    [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().filter_map(|way| neighbour(&items, Some(n), way)),
                );
            }
        }
        for (n, item) in items.iter().enumerate() {
            assert_eq!(reached[n], place(item).is_some(), "{item:?}");
        }
    }
}
