//! The plant at a glance: every device as a card, what needs an action, what is not normal, the shift and what comes next.

use super::{
    attention::{AttentionRow, needs_action, not_normal, sections},
    cards::{self, Card},
    forecast, shift,
    shift::Shift,
};
use crate::ui::{layout::Size, tabs::prelude::*};
use crate::{history::Series, ui::tabs::trends::span::View};

/// The curves show so much, in this many columns.
const WINDOW_S: i64 = 3_600;
const COLUMNS: usize = 120;
const EVERY_S: f64 = 10.0;
const TIMEOUT_S: f64 = 30.0;
/// Columns of the lists beside the cards.
const LISTS: (u16, u16) = (36, 56);
/// Rows of the lists below the cards, where there is no room beside them.
const LISTS_BELOW: (u16, u16) = (5, 10);
/// Rows of a list beside the cards.
const ROWS_MAX: usize = 6;

#[derive(Debug, Default)]
pub struct Overview {
    selected: usize,
    curves: Answered<Vec<Series>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Parts {
    cards: Rect,
    /// The lists, beside the cards or below them.
    lists: Option<Rect>,
    shift: Option<Rect>,
}

/// The parts of the page, where the shift needs so many rows.
fn parts(cx: &ViewContext, area: Rect, shift: u16) -> Parts {
    if cx.size < Size::Normal {
        return Parts { cards: area, lists: None, shift: None };
    }
    let wide = Size::is_wide(area.width);
    let shift = if wide || 30 <= area.height { shift } else { 2 };
    let below = if wide { 0 } else { (area.height / 4).clamp(LISTS_BELOW.0, LISTS_BELOW.1) };
    let aside = if wide { (area.width * 3 / 10).clamp(LISTS.0, LISTS.1) } else { 0 };
    let high = area.height.saturating_sub(shift + 1);
    let cards = Rect { width: area.width - if wide { aside + 2 } else { 0 }, height: high - below, ..area };
    let lists = if wide {
        Rect { x: area.right() - aside, width: aside, height: high, ..area }
    } else {
        Rect { y: area.y + high - below, height: below, ..area }
    };
    let shift = Rect { y: area.y + high + 1, height: shift, ..area };
    Parts { cards, lists: Some(lists), shift: Some(shift) }
}

impl Overview {
    /// Asks for the curves of the values that are seen.
    pub fn ask(&mut self, cx: &ViewContext, shift: &Shift) -> Vec<UiAction> {
        let cards = cards::cards(cx);
        let parts = parts(cx, cx.area, shift.height(cx));
        let arrangement = cards::arrange(&cards, self.selected, (parts.cards.width, parts.cards.height));
        if arrangement.density == cards::Density::Line {
            return Vec::new();
        }
        let is_stored = |tag: &TagId| cx.def().tag(*tag).is_stored();
        let seen = arrangement.places.iter().filter_map(|(n, ..)| cards.get(*n));
        let tags: Vec<TagId> = seen.flat_map(|card| card.tags.iter().copied()).filter(is_stored).collect();
        if tags.is_empty() {
            return Vec::new();
        }
        let view = View::ending(cx.now, WINDOW_S, COLUMNS);
        let query = Query::Series { tags, from: view.from, to: cx.now, buckets: view.columns };
        let (every, timeout) = (real(cx, EVERY_S), real(cx, TIMEOUT_S));
        self.curves.ask(cx, Tab::Mimic, every, timeout, query).into_iter().collect()
    }

    pub fn queries(&mut self) -> Queries<'_> {
        vec![&mut self.curves]
    }

    pub fn card(&self, cx: &ViewContext) -> Option<Card> {
        cards::cards(cx).into_iter().nth(self.selected)
    }

    /// Selects another card: arrows move by rows and columns.
    pub fn on_move(&mut self, cx: &ViewContext, shift: &Shift, (dx, dy): (i32, i32)) {
        let cards = cards::cards(cx);
        let area = parts(cx, cx.area, shift.height(cx)).cards;
        let step = cards::arrange(&cards, self.selected, (area.width, area.height)).step;
        let by = dy as isize + dx as isize * step.cast_signed();
        self.selected = self.selected.saturating_add_signed(by).min(cards.len().saturating_sub(1));
        self.curves.query.want();
    }

    pub fn view(&self, cx: &ViewContext, frame: &mut Frame, area: Rect, shift: &Shift) {
        let parts = parts(cx, area, shift.height(cx));
        let series = self.curves.value.as_deref().unwrap_or_default();
        let cards = cards::cards(cx);
        let left = Rect { x: parts.cards.x + 1, width: parts.cards.width.saturating_sub(1), ..parts.cards };
        cards::view(cx, &mut Canvas::new(frame.buffer_mut(), left), &cards, self.selected, series);
        let next: Vec<AttentionRow> = forecast::next(cx, series).into_iter().chain(shift::end(cx)).collect();
        let beside = Size::is_wide(area.width);
        if let Some(lists) = parts.lists {
            let mut canvas = Canvas::new(frame.buffer_mut(), lists);
            let lists =
                [(t!("needs action"), needs_action(cx)), (t!("not normal"), not_normal(cx)), (t!("next"), next)];
            if beside {
                sections(
                    cx,
                    &mut canvas.part(0, 0, canvas.width().saturating_sub(1), canvas.height()),
                    ROWS_MAX,
                    &lists,
                );
            } else {
                below(cx, &mut canvas, &lists);
            }
        }
        if let Some(place) = parts.shift {
            let mut canvas = Canvas::new(frame.buffer_mut(), place);
            let (width, height) = (canvas.width().saturating_sub(2), canvas.height());
            shift.view(cx, &mut canvas.part(1, 0, width, height));
        }
    }

    /// Columns of the time axis of the shift.
    pub fn columns(cx: &ViewContext) -> u16 {
        cx.area.width.saturating_sub(2)
    }
}

/// The lists beside each other, a line for each row.
fn below(cx: &ViewContext, canvas: &mut Canvas, lists: &[(&str, Vec<AttentionRow>)]) {
    let wide = canvas.width() / to_u16(lists.len().max(1));
    let rows_max = usize::from(canvas.height().saturating_sub(1));
    for (n, (title, rows)) in lists.iter().enumerate() {
        let mut part = canvas.part(1 + to_u16(n) * wide, 0, wide.saturating_sub(2), canvas.height());
        let (width, theme) = (part.width(), cx.theme);
        let x = part.text(0, 0, title, theme.dim());
        if rows.is_empty() {
            part.text(x + 2, 0, t!("none"), theme.dim());
        } else {
            part.text_right(width, 0, &rows.len().to_string(), theme.normal());
        }
        let shown = if rows.len() <= rows_max { rows.len() } else { rows_max.saturating_sub(1) };
        for (y, (text, style)) in rows.iter().take(shown).enumerate() {
            part.text(0, 1 + y, &fit(text, width), *style);
        }
        if let more @ 1.. = rows.len() - shown {
            part.text(0, 1 + shown, &t!("and {more} more", more), theme.normal());
        }
    }
}
