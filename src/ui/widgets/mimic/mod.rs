//! The parts of the mimic, on a canvas of nominal cells that is stretched to the screen.

pub(crate) mod bar;
pub(crate) mod list;
pub(crate) mod panel;
pub(crate) mod pipe;
pub(crate) mod trend;
pub(crate) mod unit;
pub(crate) mod vessel;

use crate::text::of_plant;
use ratatui::style::Style;

use super::text::Canvas;
use crate::{
    plant::{
        def::{Condition, Level, MimicItem, MimicRect, Subject, TagId},
        number::to_u16,
    },
    ui::ViewContext,
};

/// A picture is stretched from here on.
const STRETCH_MIN: f64 = 1.15;

/// Maps nominal cells to cells of the screen. Never shrinks: what does not fit is cut off at the right and bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CanvasScale {
    x: f64,
    y: f64,
}

/// A rectangle of the screen, relative to the mimic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    /// Left column.
    pub x: u16,
    /// Top row.
    pub y: u16,
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl CanvasScale {
    /// From the nominal size of the mimic to the room there is.
    pub fn new(nominal: (u16, u16), room: (u16, u16)) -> CanvasScale {
        let scale = |nominal: u16, room: u16| {
            let scale = f64::from(room) / f64::from(nominal.max(1));
            // A little more room would only make the spaces uneven.
            if scale < STRETCH_MIN { 1.0 } else { scale }
        };
        CanvasScale { x: scale(nominal.0, room.0), y: scale(nominal.1, room.1) }
    }
    /// The left edge of a nominal column.
    pub fn column(self, x: u16) -> u16 {
        to_u16((f64::from(x) * self.x).round())
    }
    /// The top edge of a nominal row.
    pub fn row(self, y: u16) -> u16 {
        to_u16((f64::from(y) * self.y).round())
    }
    /// The column in the middle of a nominal one.
    pub fn middle_column(self, x: u16) -> u16 {
        middle(self.column(x), self.column(x.saturating_add(1)))
    }
    /// The row in the middle of a nominal one.
    pub fn middle_row(self, y: u16) -> u16 {
        middle(self.row(y), self.row(y.saturating_add(1)))
    }
    /// A nominal rectangle.
    pub fn place(self, place: MimicRect) -> Bounds {
        let (x, y) = (self.column(place.x), self.row(place.y));
        let right = self.column(place.x.saturating_add(place.width.max(1)));
        let bottom = self.row(place.y.saturating_add(place.height.max(1)));
        Bounds { x, y, width: right.saturating_sub(x).max(1), height: bottom.saturating_sub(y).max(1) }
    }
    /// Where a symbol stands that takes some columns of a pipe; the first one in an upright pipe.
    pub fn spot(self, place: MimicRect, upright: bool) -> (u16, u16) {
        let at = self.place(place);
        let x = if upright { self.middle_column(place.x) } else { at.x + at.width.saturating_sub(1) / 2 };
        (x, self.middle_row(place.y))
    }
}

/// The cell in the middle: of a row of pipe and of what stands in it the same, however the edges were rounded.
fn middle(near: u16, far: u16) -> u16 {
    near + far.saturating_sub(near) / 2
}

/// The tags of an item, the most telling first; none for pipes and words.
pub fn tags(cx: &ViewContext, item: &MimicItem) -> Vec<TagId> {
    match item {
        MimicItem::Vessel { inside, .. } => inside.clone(),
        MimicItem::Valve { tag, .. }
        | MimicItem::Pump { tag, .. }
        | MimicItem::Agitator { tag, .. }
        | MimicItem::Heater { tag, .. }
        | MimicItem::Value { tag, .. }
        | MimicItem::Bar { tag, .. }
        | MimicItem::Trend { tag, .. } => vec![*tag],
        MimicItem::Controller { device, .. } => match &cx.def().device(*device).faceplate {
            Some(faceplate) => [
                Some(faceplate.sv),
                faceplate.sv_used,
                Some(faceplate.pv),
                faceplate.mv,
                faceplate.run,
                faceplate.mode,
                faceplate.tune,
            ]
            .into_iter()
            .flatten()
            .collect(),
            None => Vec::new(),
        },
        MimicItem::Sequence { step, remaining, states, .. } => {
            [*step].into_iter().chain(*remaining).chain(states.iter().copied()).collect()
        }
        MimicItem::Pipe { .. } | MimicItem::Joint { .. } | MimicItem::Link { .. } | MimicItem::Text { .. } => {
            Vec::new()
        }
    }
}

/// What the item is called.
pub fn title(cx: &ViewContext, item: &MimicItem) -> String {
    match item {
        MimicItem::Vessel { label, .. }
        | MimicItem::Valve { label, .. }
        | MimicItem::Pump { label, .. }
        | MimicItem::Sequence { label, .. } => of_plant(label).to_owned(),
        MimicItem::Value { tag, .. }
        | MimicItem::Agitator { tag, .. }
        | MimicItem::Heater { tag, .. }
        | MimicItem::Bar { tag, .. }
        | MimicItem::Trend { tag, .. } => of_plant(&cx.def().tag(*tag).label).to_owned(),
        MimicItem::Controller { device, .. } => {
            format!("{} {}", cx.def().device(*device).name, of_plant(&cx.def().device(*device).title))
        }
        MimicItem::Pipe { .. } | MimicItem::Joint { .. } => String::new(),
        MimicItem::Link { page, .. } => {
            cx.def().mimic.pages.get(*page).map_or(String::new(), |page| of_plant(&page.name).to_owned())
        }
        MimicItem::Text { text, .. } => of_plant(text).to_owned(),
    }
}

/// The place of an item that can be selected.
pub fn place(item: &MimicItem) -> Option<MimicRect> {
    match item {
        MimicItem::Vessel { inside, .. } if inside.is_empty() => None,
        MimicItem::Vessel { place, .. }
        | MimicItem::Valve { place, .. }
        | MimicItem::Pump { place, .. }
        | MimicItem::Agitator { place, .. }
        | MimicItem::Heater { place, .. }
        | MimicItem::Value { place, .. }
        | MimicItem::Bar { place, .. }
        | MimicItem::Controller { place, .. }
        | MimicItem::Sequence { place, .. }
        | MimicItem::Trend { place, .. }
        | MimicItem::Link { place, .. } => Some(*place),
        MimicItem::Pipe { .. } | MimicItem::Joint { .. } | MimicItem::Text { .. } => None,
    }
}

/// The limits of a tag's alarms that stand on the scale of the value.
pub(crate) fn limits(cx: &ViewContext, tag: TagId) -> impl Iterator<Item = (f64, Level)> {
    let of_tag = cx.def().alarms.iter().filter(move |alarm| alarm.subject == Subject::Tag(tag));
    of_tag.filter_map(|alarm| match alarm.condition {
        Condition::Limit { level, limit, .. } => Some((limit, level)),
        _ => None,
    })
}

/// Cuts words out of the liquid that they stand in: a number is read on the ground, not on a fill.
pub(super) fn cut(canvas: &mut Canvas, x: u16, y: u16, length: u16) {
    for column in x.saturating_sub(1)..x.saturating_add(length + 1).min(canvas.width()) {
        if canvas.symbol(column, y).is_some_and(is_liquid) {
            canvas.glyph(column, y, ' ', Style::reset());
        }
    }
}

/// Is it a part of the liquid in a vessel?
pub(super) fn is_liquid(symbol: &str) -> bool {
    "█▁▂▃▄▅▆▇▒░".contains(symbol)
}

/// The mark of the most urgent alarm of a tag.
pub(super) fn alarm_mark(cx: &ViewContext, tag: TagId) -> Option<(&'static str, Style)> {
    let alarm = cx.snapshot.alarms_of(tag).next()?;
    let priority = cx.def().alarm(alarm.id).priority;
    Some((cx.theme.priority_tag(priority), cx.theme.alarm(priority, alarm.state, cx.flash())))
}

/// Writes a value with unit, doubt and alarm mark; returns the column after it. What does not fit into the room or on
/// the screen goes in this order: the mark, the unit, the number itself (`##`).
pub(crate) fn put_value(cx: &ViewContext, canvas: &mut Canvas, x: u16, y: u16, tag: TagId, room: u16) -> u16 {
    let room = room.min(canvas.width().saturating_sub(x));
    let mark = alarm_mark(cx, tag);
    let taken = mark.map_or(0, |(mark, _)| super::text::width(mark) + 1);
    let shown = super::value::show(cx, tag);
    let taken = if super::text::width(&shown.text) + taken > room { 0 } else { taken };
    let text = shown.within(room - taken);
    cut(canvas, x, y, super::text::width(&text) + taken);
    let x = canvas.text(x, y, &text, shown.style);
    match mark {
        // Without room for the mark its colour and its flashing stand on the number.
        Some((_, style)) if taken == 0 => {
            let length = super::text::width(&text);
            canvas.paint(x - length.min(x), y, length, 1, style);
            x
        }
        Some((mark, style)) => canvas.text(x + 1, y, mark, style),
        None => x,
    }
}

/// The label of an item: reversed while it is selected.
pub(super) fn label_style(cx: &ViewContext, selected: bool) -> Style {
    if selected { cx.theme.focus() } else { cx.theme.normal() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_stay_neighbours_at_every_size() {
        for room in [(80, 18), (97, 18), (120, 34), (200, 54)] {
            let scale = CanvasScale::new((80, 18), room);
            let tank = scale.place(MimicRect { x: 14, y: 6, width: 16, height: 6 });
            let below = scale.place(MimicRect { x: 14, y: 12, width: 16, height: 1 });
            assert_eq!(tank.y + tank.height, below.y, "{room:?}");
            assert_eq!(tank.x + tank.width, scale.column(30), "{room:?}");
            assert!(scale.middle_column(14) >= tank.x && scale.middle_column(29) < tank.x + tank.width);
        }
    }

    #[test]
    fn a_pump_stands_in_its_pipe_at_every_size() {
        for rows in 18..80 {
            let scale = CanvasScale::new((80, 18), (80, rows));
            for y in 0..18 {
                let pump = scale.place(MimicRect { x: 15, y, width: 15, height: 1 });
                assert_eq!(scale.middle_row(y), pump.y + pump.height / 2, "row {y} of {rows}");
            }
        }
    }

    #[test]
    fn a_small_screen_cuts_and_never_squeezes() {
        let scale = CanvasScale::new((80, 18), (60, 10));
        assert_eq!(
            scale.place(MimicRect { x: 54, y: 6, width: 26, height: 6 }),
            Bounds { x: 54, y: 6, width: 26, height: 6 }
        );
    }
}
