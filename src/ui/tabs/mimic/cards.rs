//! Every device as a card: its main values on their ranges, as much of each as there is room for.

use crate::ui::{
    tabs::{controllers::list as devices, prelude::*},
    widgets::mimic::{bar, put_value, trend},
};
use crate::{history::Series, plant::tag::Access};

use super::{
    attention::outside_text,
    forecast::{moving, resolution},
};
use crate::ui::widgets::spark::spark;

const TAGS_MAX: usize = 8;
/// Least columns of a card, and of one that is a single line.
const WIDTH_MIN: u16 = 46;
const LINE_MIN: u16 = 38;
/// Columns of a value with its unit and its alarm mark.
const VALUE: u16 = 16;
/// Columns of the curve and of the rate behind a value, and from which width on they are drawn.
const SPARK: (u16, u16) = (16, 72);
const RATE: (u16, u16) = (9, 92);

/// A device and the values that are shown of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Card {
    pub device: DeviceId,
    pub tags: Vec<TagId>,
}

/// The devices of the plant: of a controller PV and MV, of any other the measured values that have a range.
pub fn cards(cx: &ViewContext) -> Vec<Card> {
    let mut cards: Vec<Card> =
        cx.def().devices.iter().map(|device| Card { device: device.id, tags: Vec::new() }).collect();
    for tag in &cx.def().tags {
        let Some(card) = cards.get_mut(tag.device.index()) else { continue };
        let of_controller = cx.def().device(tag.device).faceplate.as_ref();
        let is_main = match of_controller {
            Some(faceplate) => faceplate.pv == tag.id || faceplate.mv == Some(tag.id),
            None => {
                let is_measured = tag.access == Access::Read && tag.enum_labels.is_empty() && !tag.is_text();
                is_measured && tag.is_stored() && tag.min.is_some() && tag.max.is_some()
            }
        };
        if is_main && card.tags.len() < TAGS_MAX {
            card.tags.push(tag.id);
        }
    }
    cards
}

/// How much of each device is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Density {
    /// A value with its range and its curve below it.
    Tall,
    Rows,
    /// So many values at most, without a blank row.
    Short(u16),
    /// The first value in the row of the device.
    Line,
}

impl Density {
    fn rows(self, card: &Card) -> u16 {
        let tags = to_u16(card.tags.len());
        match self {
            Density::Tall => 2 + 5 * tags,
            Density::Rows => 2 + tags,
            Density::Short(most) => 1 + tags.min(most),
            Density::Line => 1,
        }
    }
    fn width_min(self) -> u16 {
        match self {
            Density::Tall | Density::Rows | Density::Short(_) => WIDTH_MIN,
            Density::Line => LINE_MIN,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrangement {
    pub density: Density,
    /// The cards that are seen, with their column and row.
    pub places: Vec<(usize, u16, u16)>,
    pub width: u16,
    /// Cards of a column, for a step to the side.
    pub step: usize,
    /// Cards behind those that are seen.
    pub below: usize,
}

/// The most detailed arrangement in which all cards fit; where none does a line each, the selected one in sight.
pub fn arrange(cards: &[Card], selected: usize, (width, height): (u16, u16)) -> Arrangement {
    let short = (1..=to_u16(TAGS_MAX)).rev().map(Density::Short);
    for density in [Density::Tall, Density::Rows].into_iter().chain(short) {
        let columns = (width / density.width_min()).max(1);
        let (mut x, mut y) = (0, 0);
        let mut places = Vec::new();
        for (n, card) in cards.iter().enumerate() {
            let rows = density.rows(card);
            if 0 < y && height < y + rows {
                (x, y) = (x + 1, 0);
            }
            places.push((n, x, y));
            y += rows;
        }
        // The last row of a card may be a blank one.
        let blank = match density {
            Density::Tall | Density::Rows => 1,
            Density::Short(_) | Density::Line => 0,
        };
        let fits = |(n, x, y): &(usize, u16, u16)| *x < columns && y + density.rows(&cards[*n]) <= height + blank;
        if places.iter().all(fits) {
            let width = width / (x + 1);
            let step = places.iter().filter(|(_, x, _)| *x == 0).count().max(1);
            let places = places.into_iter().map(|(n, x, y)| (n, x * width, y)).collect();
            return Arrangement { density, places, width, step, below: 0 };
        }
    }
    let columns = (width / LINE_MIN).clamp(1, 3);
    let (rows, width) = (usize::from(height.max(1)), width / columns);
    let room = rows * usize::from(columns);
    let first = list::first(selected, cards.len(), room);
    let place = |n: usize| (first + n, to_u16(n / rows) * width, to_u16(n % rows));
    let seen = room.min(cards.len() - first.min(cards.len()));
    let places = (0..seen).map(place).collect();
    Arrangement { density: Density::Line, places, width, step: rows, below: cards.len().saturating_sub(first + seen) }
}

pub fn view(cx: &ViewContext, canvas: &mut Canvas, cards: &[Card], selected: usize, series: &[Series]) {
    let area = canvas.area();
    let arrangement = arrange(cards, selected, (area.width, area.height));
    for (n, x, y) in &arrangement.places {
        let Some(card) = cards.get(*n) else { continue };
        let rows = arrangement.density.rows(card);
        let mut part = canvas.part(*x, *y, arrangement.width.saturating_sub(1), rows);
        self::card(cx, &mut part, card, arrangement.density, *n == selected, series);
    }
    if 0 < arrangement.below {
        let last = area.height.saturating_sub(1);
        canvas.text_right(area.width, last, &t!("{below} more ▼", below = arrangement.below), cx.theme.strong());
    }
}

fn card(cx: &ViewContext, canvas: &mut Canvas, card: &Card, density: Density, selected: bool, series: &[Series]) {
    let theme = cx.theme;
    let device = cx.def().device(card.device);
    let (alarm, alarm_style) = devices::alarm(cx, device.id);
    let (mark, _, mark_style) = devices::state(cx, device.id);
    let end = canvas.width();
    let name = if selected { theme.focus() } else { theme.strong() };
    if density == Density::Line {
        let names = (end / 3).min(12);
        canvas.text(0, 0, &fit(&device.name, names), name);
        let x = canvas.text(names + 1, 0, &mark, mark_style) + 1;
        let value = VALUE.min(end.saturating_sub(x));
        if let Some(tag) = card.tags.first() {
            let wide = end.saturating_sub(x + value + 1);
            bar::indicator(cx, &mut canvas.part(x, 0, wide, 1), *tag, false);
            put_value(cx, canvas, x + wide + 1, 0, *tag, value);
        }
        return;
    }
    let outside = card.tags.iter().any(|tag| outside_text(cx, *tag).is_some());
    let abnormal = outside || !alarm.is_empty() || cx.snapshot.device(device.id).state != DeviceState::Responding;
    let (rule, style) = if abnormal { (theme.pick('━', '='), theme.strong()) } else { ('─', theme.dim()) };
    canvas.run(0, 0, end, rule, style);
    canvas.text_right(end.saturating_sub(2), 0, &format!(" {mark} "), mark_style);
    let at = end.saturating_sub(3 + width(&mark) + 2);
    if !alarm.is_empty() {
        canvas.text_right(at, 0, &format!(" {alarm} "), alarm_style);
    }
    let room = at.saturating_sub(width(&alarm) + 6);
    let x = canvas.text(2, 0, &format!(" {} ", fit(&device.name, room)), name);
    let title = fit_words(of_plant(&device.title), room.saturating_sub(x));
    if !title.is_empty() {
        canvas.text(x, 0, &format!("{title} "), theme.normal());
    }
    for (n, tag) in card.tags.iter().enumerate() {
        let series = series.iter().find(|series| series.tag == *tag);
        if density == Density::Tall {
            tall(cx, &mut canvas.part(1, 1 + n * 5, end.saturating_sub(2), 5), *tag, series);
        } else {
            row(cx, &mut canvas.part(1, 1 + n, end.saturating_sub(1), 1), *tag, series);
        }
    }
    if card.tags.is_empty() {
        let (words, style) = devices::values_good(cx, device);
        canvas.text(1, 1, &words, style);
    }
}

/// `level TK-1  ░░▒▒▒◆▒▒╎░  22.1 cm  ▁▂▃▅  +0.3 /min`.
fn row(cx: &ViewContext, canvas: &mut Canvas, tag: TagId, series: Option<&Series>) {
    let end = canvas.width();
    let names = (end / 4).clamp(8, 18);
    canvas.text(0, 0, &fit(label(cx, tag, names), names), cx.theme.dim());
    let curve = if SPARK.1 <= end { SPARK.0 + 1 } else { 0 };
    let rate = if RATE.1 <= end { RATE.0 + 1 } else { 0 };
    let wide = end.saturating_sub(names + 1 + 1 + VALUE + curve + rate);
    bar::indicator(cx, &mut canvas.part(names + 1, 0, wide, 1), tag, false);
    let x = names + wide + 2;
    put_value(cx, canvas, x, 0, tag, VALUE);
    let Some(series) = series else { return };
    if 0 < curve {
        let text = spark(series, usize::from(SPARK.0), resolution(cx, tag), cx.theme.glyphs);
        canvas.text(x + VALUE, 0, &text, cx.theme.pen(0));
    }
    if 0 < rate {
        canvas.text_right(end, 0, &rate_text(cx, tag, series), cx.theme.normal());
    }
}

/// Name, value and rate, below them the range and the curve of the last hour.
fn tall(cx: &ViewContext, canvas: &mut Canvas, tag: TagId, series: Option<&Series>) {
    let end = canvas.width();
    let names = end / 2;
    let x = canvas.text(0, 0, &fit(label(cx, tag, names), names), cx.theme.dim());
    put_value(cx, canvas, x + 2, 0, tag, VALUE);
    bar::indicator(cx, &mut canvas.part(0, 1, end, 1), tag, false);
    let Some(series) = series else { return };
    canvas.text_right(end, 0, &rate_text(cx, tag, series), cx.theme.normal());
    if let Some(range) = cx.snapshot.range(tag) {
        trend::curve(&mut canvas.part(0, 2, end, 2), series, range, cx.theme.glyphs, cx.theme.pen(0));
    }
}

/// `+0.3 /min`, where the rate is known.
fn rate_text(cx: &ViewContext, tag: TagId, series: &Series) -> String {
    moving(cx, series).map_or(String::new(), |(_, rate)| {
        let sign = if 0.0 < rate { "+" } else { "" };
        t!("{sign}{rate} /min", sign, rate = cx.snapshot.format(tag, rate))
    })
}

/// The words for a tag, or its short name where they do not fit.
fn label<'a>(cx: &ViewContext<'a>, tag: TagId, room: u16) -> &'a str {
    let def = cx.def().tag(tag);
    let label = of_plant(&def.label);
    if width(label) <= room { label } else { &def.short }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn devices(tags: &[usize]) -> Vec<Card> {
        let card = |(n, tags): (usize, &usize)| Card { device: DeviceId(to_u16(n)), tags: vec![TagId(0); *tags] };
        tags.iter().enumerate().map(card).collect()
    }

    #[test]
    fn cards_show_as_much_as_there_is_room_for() {
        let check = |tags: &[usize], room: (u16, u16), density, seen, below| {
            let found = arrange(&devices(tags), 0, room);
            assert_eq!(
                (found.density, found.places.len(), found.below),
                (density, seen, below),
                "{tags:?} in {room:?}"
            );
        };
        check(&[2, 7], (108, 38), Density::Tall, 2, 0);
        check(&[2, 7], (80, 13), Density::Rows, 2, 0);
        check(&[2, 7], (80, 10), Density::Short(6), 2, 0);
        check(&[2; 20], (108, 34), Density::Short(8), 20, 0);
        check(&[2; 30], (108, 34), Density::Short(1), 30, 0);
        check(&[2; 64], (108, 34), Density::Line, 64, 0);
        check(&[2; 64], (80, 9), Density::Line, 18, 46);
        check(&[], (80, 9), Density::Tall, 0, 0);
    }

    #[test]
    fn cards_lie_beside_each_other_and_the_selected_one_is_seen() {
        for (width, height) in (38..200).step_by(7).flat_map(|width| (1..50).map(move |height| (width, height))) {
            for (count, selected) in [(1, 0), (5, 4), (64, 40)] {
                let cards = devices(&vec![3; count]);
                let found = arrange(&cards, selected, (width, height));
                assert!(found.places.iter().any(|(n, ..)| *n == selected), "{selected} in {width}x{height}");
                let mut cells: Vec<(u16, u16)> = found.places.iter().map(|(_, x, y)| (*x, *y)).collect();
                cells.dedup();
                assert_eq!(cells.len(), found.places.len());
                assert!(cells.iter().all(|(x, y)| x + found.width <= width && *y < height), "{found:?}");
            }
        }
    }
}
