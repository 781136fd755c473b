//! The parameter table of a device: grouped as the maker groups them, with value, range, default, age and meaning.

use crate::ui::tabs::prelude::*;
use crate::{
    plant::{
        entry,
        tag::{Access, Poll, TagDef},
    },
    ui::{
        rights,
        widgets::text::{age, whole},
    },
};

/// What is shown of the table, and what is selected in it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ParameterTable {
    /// The selected parameter, by its place among those shown.
    pub selected: usize,
    /// Only parameters with these words in name or meaning.
    pub filter: Words,
    /// Rows that differ from the maker's default are marked.
    pub defaults: bool,
}

impl ParameterTable {
    /// The tags that are shown, those of one group together, in the order of the profile.
    pub fn rows<'a>(&self, cx: &ViewContext<'a>, device: DeviceId) -> Vec<&'a TagDef> {
        let tags: Vec<&TagDef> = cx.def().tags_of(device).filter(|tag| self.fits(tag)).collect();
        let mut sorted = tags.clone();
        sorted.sort_by_key(|tag| tags.iter().position(|first| first.group == tag.group));
        sorted
    }

    pub fn tag<'a>(&self, cx: &ViewContext<'a>, device: DeviceId) -> Option<&'a TagDef> {
        self.rows(cx, device).into_iter().nth(self.selected)
    }

    /// The place of the parameter that the filter means most likely: its exact name, then one with it in its name, then
    /// one with it in its meaning.
    pub fn best(&self, cx: &ViewContext, device: DeviceId) -> usize {
        let typed = self.filter.to_string();
        let rank = |tag: &TagDef| match (tag.short.to_lowercase(), of_plant(&tag.label).to_lowercase()) {
            (short, label) if short == typed || label == typed => 0,
            (short, label) if short.contains(&typed) || label.contains(&typed) => 1,
            _ => 2,
        };
        let ranked = self.rows(cx, device).into_iter().map(rank).enumerate();
        ranked.min_by_key(|(place, rank)| (*rank, *place)).map_or(0, |(place, _)| place)
    }

    fn fits(&self, tag: &TagDef) -> bool {
        let words = [&tag.label, &tag.meaning, &tag.group].map(|text| format!("{text} {}", of_plant(text)));
        self.filter.fit(&format!("{} {}", tag.short, words.join(" ")))
    }

    /// Parameters under the names of their groups, the selected one in sight; returns how many rows are out of sight
    /// below.
    pub fn view(&self, cx: &ViewContext, canvas: &mut Canvas, device: DeviceId) -> usize {
        let theme = cx.theme;
        let tags = self.rows(cx, device);
        let columns = ParameterColumns::new(cx, device, canvas.width());
        let names = ["", t!("parameter"), t!("value"), "", t!("range"), t!("default"), t!("age"), t!("meaning")];
        canvas.text(1, 0, &columns.row(names), theme.dim());
        if tags.is_empty() {
            let words =
                if self.filter.is_empty() { t!("this device has no values") } else { t!("no matching parameter") };
            canvas.text(1, 1, words, theme.dim());
            return 0;
        }
        let mut rows: Vec<Result<(usize, &TagDef), &str>> = Vec::new();
        for (n, tag) in tags.iter().enumerate() {
            if n == 0 || tags[n - 1].group != tag.group {
                rows.push(Err(of_plant(&tag.group)));
            }
            rows.push(Ok((n, tag)));
        }
        let place = rows.iter().position(|row| row.is_ok_and(|(n, _)| n == self.selected)).unwrap_or(0);
        let room = usize::from(canvas.height().saturating_sub(1)).max(1);
        let first = first(place, rows.len(), room);
        for (y, _, row) in on_screen(&rows, first, room) {
            let y = y + 1;
            match row {
                Ok((place, tag)) => self.parameter(cx, canvas, y, &columns, tag, *place == self.selected),
                Err(group) => {
                    canvas.text(1, y, group, theme.strong());
                }
            }
        }
        rows.len().saturating_sub(first + room)
    }

    fn parameter(
        &self,
        cx: &ViewContext,
        canvas: &mut Canvas,
        y: u16,
        columns: &ParameterColumns,
        tag: &TagDef,
        selected: bool,
    ) {
        let theme = cx.theme;
        let shown = value::show(cx, tag.id);
        let text = shown.bare(columns.value);
        let now = matches!(tag.poll, Poll::Every(_))
            && cx.age(tag.id).as_secs() < 60
            && cx.snapshot.sample(tag.id).quality.is_good();
        let read = if now || tag.access == Access::Write { String::new() } else { age(cx.age(tag.id)) };
        let range = entry::range_text(cx.snapshot, tag.id);
        // What is only read needs no range; what can be written says that its range is not known.
        let writable = tag.writable() && !cx.def().listens_on(cx.def().device(tag.device).line);
        let is_number = writable && !tag.is_text();
        let none = !is_number && tag.enum_labels.is_empty() && cx.snapshot.range(tag.id).is_none();
        let range = if none { "–".to_owned() } else { range };
        let range = range.trim_start_matches(t!("range ")).trim_end_matches(&shown.unit).trim_end().to_owned();
        let may = writable && rights::lacks(cx, rights::to_write(cx, [tag.id])).is_none();
        let pen = match (self.defaults && differs(cx, tag), may) {
            (true, _) => theme.pick("≠", "#"),
            (false, true) => theme.pick("✎", "w"),
            (false, false) => " ",
        };
        let known = shown.note.is_empty() || cx.snapshot.sample(tag.id).value.is_some();
        let meaning = if known { of_plant(&tag.meaning) } else { &shown.note };
        let name = format!("{} {}", pad(&tag.short, columns.short), of_plant(&tag.label));
        let default = default_text(cx, tag).unwrap_or_default();
        let range = whole(&range, ParameterColumns::RANGE);
        let row = columns.row([pen, &name, &text, &shown.unit, &range, &default, &read, meaning]);
        canvas.text(1, y, &row, if selected { theme.focus() } else { theme.normal() });
        if !selected && tag.is_read() && !cx.snapshot.sample(tag.id).quality.is_good() {
            canvas.text(1 + columns.value_at(), y, &pad_left(&text, columns.value), shown.style);
        }
    }
}

/// Is the value known, and another than the maker delivers?
pub fn differs(cx: &ViewContext, tag: &TagDef) -> bool {
    let now = cx.snapshot.sample(tag.id).good_value();
    // Half of the last digit shown: what looks the same is the same.
    let least = 0.5 * 10f64.powi(-i32::from(cx.snapshot.decimals[tag.id.index()]));
    tag.default.zip(now).is_some_and(|(default, now)| least <= (default - now).abs())
}

/// The default as the value is written.
pub fn default_text(cx: &ViewContext, tag: &TagDef) -> Option<String> {
    tag.default.map(|default| cx.snapshot.format(tag.id, default))
}

/// Widths of the columns that depend on device and screen.
struct ParameterColumns {
    short: u16,
    name: u16,
    value: u16,
    range: u16,
    default: u16,
    meaning: u16,
}

impl ParameterColumns {
    const VALUE: u16 = 10;
    /// Of a value that is a text, at most.
    const TEXT: u16 = 26;
    const UNIT: u16 = 6;
    const RANGE: u16 = 16;
    const AGE: u16 = 6;
    /// Of a label, at least.
    const LABEL: u16 = 8;

    fn new(cx: &ViewContext, device: DeviceId, wide: u16) -> ParameterColumns {
        let tags = || cx.def().tags_of(device);
        let short = tags().map(|tag| width(&tag.short)).max().unwrap_or(0).min(10);
        let label = tags().map(|tag| width(of_plant(&tag.label))).max().unwrap_or(0);
        let fixed = 3 + ParameterColumns::VALUE + ParameterColumns::UNIT + ParameterColumns::AGE + 5;
        // Before a name is a stump, the range gives way: the window of a change has it.
        let is_narrow = wide < fixed + ParameterColumns::RANGE + short + 1 + ParameterColumns::LABEL.min(label);
        let range = if is_narrow { 0 } else { ParameterColumns::RANGE };
        let free = wide.saturating_sub(fixed + range);
        let name = (short + 1 + label).min(free);
        let left = free - name;
        // A text, a date, an address in full, where there is room.
        let text = tags().filter_map(|tag| cx.snapshot.texts[tag.id.index()].as_deref()).map(width).max().unwrap_or(0);
        let longer = text.clamp(ParameterColumns::VALUE, ParameterColumns::TEXT) - ParameterColumns::VALUE;
        let (value, left) = (ParameterColumns::VALUE + longer.min(left), left - longer.min(left));
        let any = tags().any(|tag| tag.default.is_some());
        let default = if any && left >= 8 { 7 } else { 0 };
        ParameterColumns { short, name, value, range, default, meaning: left.saturating_sub(default + 1) }
    }
    fn value_at(&self) -> u16 {
        2 + self.name + 1
    }
    fn row(&self, [pen, name, value, unit, range, default, age, meaning]: [&str; 8]) -> String {
        // The line below the table has the selected meaning in full: a stump in the table does not help.
        let meaning = if self.meaning < 12 { "" } else { meaning };
        let range = if self.range == 0 { String::new() } else { format!("{} ", pad(range, self.range)) };
        let default = if self.default == 0 { String::new() } else { format!("{} ", pad_left(default, self.default)) };
        format!(
            "{pen:1} {} {} {} {range}{default}{} {}",
            pad(name, self.name),
            pad_left(value, self.value),
            pad(unit, ParameterColumns::UNIT),
            pad_left(age, ParameterColumns::AGE),
            pad(meaning, self.meaning)
        )
    }
}
