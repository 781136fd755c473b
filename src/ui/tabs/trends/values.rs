//! The list of all values with their last hour.

use super::{
    view::{hour, resolution, trouble},
    *,
};
use crate::{
    plant::tag::TagDef,
    ui::widgets::{chart::mark, spark::spark},
};

impl Trends {
    /// The stored tags that fit the filter, in the order of the plant.
    pub(super) fn listed(&self, cx: &ViewContext) -> Vec<TagId> {
        let fits = |tag: &TagDef| {
            self.filter.is_empty()
                || self.filter.fit(&format!(
                    "{} {} {} {}",
                    tag.name,
                    tag.label,
                    of_plant(&tag.label),
                    cx.snapshot.unit(tag.id)
                ))
        };
        cx.def().tags.iter().filter(|tag| tag.is_stored() && fits(tag)).map(|tag| tag.id).collect()
    }

    /// The selected value, while they are listed.
    pub(super) fn listed_value(&self, cx: &ViewContext) -> Option<TagId> {
        self.values.and_then(|(_, row)| self.listed(cx).get(row).copied())
    }

    /// Shows the list, and asks for the words of its filter.
    pub(super) fn find(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.values.get_or_insert((0, 0));
        self.hours.query.want();
        listing::ask_filter(self, cx)
    }

    /// Shows the curve of the selected value.
    pub(super) fn open(&mut self, cx: &ViewContext) {
        if let Some(tag) = self.listed_value(cx) {
            self.open_value(cx, tag);
        }
    }
}

/// The list of values.
impl ListPage for Trends {
    fn step(&mut self, cx: &ViewContext, motion: Motion) {
        let (first, row) = self.values.unwrap_or_default();
        let rows = usize::from(cx.area.height.saturating_sub(2)).max(1);
        let row = motion.to(row, self.listed(cx).len(), rows);
        let first_now = first.clamp((row + 1).saturating_sub(rows), row);
        if first_now != first {
            self.hours.query.want();
        }
        self.values = Some((first_now, row));
    }

    fn back(&mut self, cx: &ViewContext) -> bool {
        let filtered = !self.filter.is_empty();
        if filtered {
            self.set_filter(cx, "");
        }
        filtered
    }

    fn copied(&self, cx: &ViewContext) -> Vec<String> {
        self.listed_value(cx).into_iter().map(|tag| value::line(cx, tag)).collect()
    }

    fn filter(&self) -> String {
        self.filter.to_string()
    }

    fn filter_hint(&self) -> &'static str {
        t!("words of name, label or unit; none lists all")
    }

    fn set_filter(&mut self, _cx: &ViewContext, text: &str) {
        (self.filter, self.values) = (Words::parse(text), Some((0, 0)));
        self.hours.query.want();
    }
}

/// Every stored value with its last hour.
pub(super) fn draw_values(trends: &Trends, cx: &ViewContext, canvas: &mut Canvas, first: usize, selected: usize) {
    let (theme, all) = (cx.theme, trends.listed(cx));
    let rows = usize::from(canvas.height().saturating_sub(2)).max(1);
    let last = (first + rows).min(all.len());
    let x = canvas.text(1, 0, t!("All values"), theme.strong());
    let range = t!("{min}–{last} of {count}", min = (first + 1).min(last), last, count = all.len());
    let x = canvas.text(x + 3, 0, &range, theme.dim());
    if !trends.filter.is_empty() {
        canvas.text(x + 2, 0, &format!("/{}", trends.filter), theme.strong());
    }
    let wide = canvas.width().saturating_sub(80);
    let name = 15 + wide / 5;
    // The label gives way: a number whose end is cut off would be another number.
    let label = (name + 18 + wide / 4).min(canvas.width().saturating_sub(32)).max(name + 2);
    let (value, low, high) = (label + 15, label + 23, label + 31);
    let has_room = high <= canvas.width();
    canvas.text(2, 1, t!("tag"), theme.dim());
    let now = if cx.is_past() { t!("then") } else { t!("now") };
    canvas.text_right(value, 1, now, theme.dim());
    for (end, text) in [(low, t!("1 h min")), (high, t!("1 h max"))].into_iter().filter(|_| has_room) {
        canvas.text_right(end, 1, text, theme.dim());
    }
    canvas.text(high + 2, 1, t!("last hour"), theme.dim());
    if let Some(trouble) = trouble(trends, cx) {
        let room = canvas.width().saturating_sub(30);
        canvas.text_right(canvas.width().saturating_sub(1), 0, &fit(&trouble, room), theme.trouble());
    }
    for (y, (n, tag)) in all.iter().enumerate().skip(first).take(rows).enumerate() {
        let (y, def, shown) = (to_u16(y) + 2, cx.def().tag(*tag), value::show(cx, *tag));
        let style = if n == selected { theme.strong() } else { theme.normal() };
        if n == selected {
            canvas.text(0, y, theme.pick("▸", ">"), theme.strong());
        }
        if let Some(pen) = trends.picked.iter().position(|picked| picked == tag) {
            canvas.text(1, y, mark(theme, pen), theme.pen(pen));
        }
        canvas.text(2, y, &pad(&def.name, name.saturating_sub(1)), style);
        let text = shown.within(value - label);
        canvas.text_right(value, y, &text, shown.style);
        // What the value leaves is the label's.
        let room = value.saturating_sub(width(&text) + name + 4);
        canvas.text(2 + name, y, &fit(of_plant(&def.label), room), theme.dim());
        let Some(series) = hour(trends, *tag) else { continue };
        if let Some((min, _, max)) = series.summary.filter(|_| has_room && def.enum_labels.is_empty()) {
            for (end, value) in [(low, min), (high, max)] {
                canvas.text_right(end, y, &fit(&cx.snapshot.format(*tag, value), 7), theme.dim());
            }
        }
        let cells = usize::from(canvas.width().saturating_sub(high + 3)).min(series.buckets.len());
        canvas.text(high + 2, y, &spark(series, cells, resolution(cx, *tag), theme.glyphs), style);
    }
}
