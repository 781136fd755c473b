//! The list of all values with their last hour.

use super::{view::resolution, *};
use crate::{
    plant::{exact::Exact, tag::TagDef},
    ui::widgets::{chart::mark, spark::spark},
};

/// All stored tags, in the order of the plant.
#[derive(Debug, Default)]
pub struct StoredValues {
    /// The tags that the operator has made pens.
    pub picked: Vec<TagId>,
}

/// A tag with its place among the pens, and its last hour where it was asked for.
#[derive(Debug, Clone)]
pub struct StoredValue {
    tag: TagId,
    pen: Option<usize>,
    hour: Option<Series>,
}

impl Listing for StoredValues {
    type Answer = Vec<Series>;
    type Row = StoredValue;
    type Id = TagId;

    const NEWEST_FIRST: bool = false;
    const ACTS: bool = false;

    fn heading<'a>(&self, cx: &ViewContext<'a>, _: Option<&'a Vec<Series>>) -> Heading<'a> {
        let count = cx.def().tags.iter().filter(|tag| tag.is_stored()).count();
        Heading::new(t!("All values"), t!("no value of this plant is stored")).words(count.to_string(), cx.theme.dim())
    }

    fn rows<'a>(&'a self, cx: &ViewContext<'a>, hours: Option<&'a Vec<Series>>) -> Vec<Cow<'a, StoredValue>> {
        let row = |tag: &TagDef| StoredValue {
            tag: tag.id,
            pen: self.picked.iter().position(|picked| *picked == tag.id),
            hour: hours.into_iter().flatten().find(|series| series.tag == tag.id).cloned(),
        };
        cx.def().tags.iter().filter(|tag| tag.is_stored()).map(|tag| Cow::Owned(row(tag))).collect()
    }

    fn id(row: &StoredValue) -> TagId {
        row.tag
    }

    /// What there is no room for gives way: the hour first, then its bounds. A number whose end is cut off would be another.
    fn columns(&self, cx: &ViewContext, room: u16) -> Vec<Column<StoredValue>> {
        let wide = room.saturating_sub(80);
        let now = if cx.is_past() { t!("then") } else { t!("now") };
        vec![
            left(1, "", |cx, row: &StoredValue| row.pen.map_or(String::new(), |pen| mark(cx.theme, pen).to_string()))
                .styled(|cx, row| row.pen.map_or(cx.theme.normal(), |pen| cx.theme.pen(pen))),
            left(14 + wide / 5, t!("tag"), |cx, row| cx.def().tag(row.tag).name.clone()),
            left(12 + wide / 4, t!("label"), |cx, row: &StoredValue| of_plant(&cx.def().tag(row.tag).label).to_owned())
                .rank(1)
                .dim()
                .runs_on(),
            right(13, now, |cx, row: &StoredValue| value::show(cx, row.tag).within(13))
                .styled(|cx, row| value::show(cx, row.tag).style),
            right(7, t!("1 h min"), |cx, row: &StoredValue| bound(cx, row, |(min, _, _)| min)).rank(2).unsorted().dim(),
            right(7, t!("1 h max"), |cx, row: &StoredValue| bound(cx, row, |(_, _, max)| max)).rank(2).unsorted().dim(),
            rest(8, t!("last hour"), last_hour).rank(3).unsorted(),
        ]
    }

    fn copied(&self, cx: &ViewContext, row: &StoredValue, _: Option<&Vec<Series>>) -> Option<String> {
        Some(value::line(cx, row.tag))
    }

    fn searched(&self, cx: &ViewContext, row: &StoredValue) -> Option<String> {
        let tag = cx.def().tag(row.tag);
        Some(format!("{} {} {} {}", tag.name, tag.label, of_plant(&tag.label), cx.snapshot.unit(tag.id)))
    }
}

/// A bound of the last hour, of a tag that is a number.
fn bound(cx: &ViewContext, row: &StoredValue, of: fn((Exact, Exact, Exact)) -> Exact) -> String {
    let is_number = cx.def().tag(row.tag).enum_labels.is_empty();
    let summary = row.hour.as_ref().and_then(|hour| hour.summary).filter(|_| is_number);
    summary.map_or(String::new(), |summary| cx.snapshot.format(row.tag, of(summary)))
}

fn last_hour(cx: &ViewContext, row: &StoredValue, room: u16) -> String {
    let Some(series) = &row.hour else { return String::new() };
    let cells = usize::from(room).min(series.buckets.len());
    spark(series, cells, resolution(cx, row.tag), cx.theme.glyphs)
}

impl Trends {
    /// The tags whose last hour is on the screen of the list.
    pub(super) fn seen(&self, cx: &ViewContext) -> Vec<TagId> {
        self.values.seen(cx).into_iter().map(|row| row.tag).collect()
    }

    /// The selected value, while they are listed.
    pub(super) fn listed_value(&self, cx: &ViewContext) -> Option<TagId> {
        self.values.selected(cx).filter(|_| self.listed).map(|row| row.tag)
    }

    /// Shows the list, and asks for the words of its filter.
    pub(super) fn find(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        self.list_values(true);
        listing::ask_filter(self, cx)
    }

    /// Shows the curve of the selected value.
    pub(super) fn open(&mut self, cx: &ViewContext) {
        if let Some(tag) = self.listed_value(cx) {
            self.open_value(cx, tag);
        }
    }
}
