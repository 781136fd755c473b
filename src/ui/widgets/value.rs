//! A value as an operator sees it: number, unit and how far to trust it, with one look everywhere.

use crate::t;
use crate::text::{of_plant, translate};
use ratatui::style::Style;

use super::text;
use crate::{
    plant::{
        def::TagId,
        exact::Exact,
        sample::{Cause, Quality},
        tag::Access,
    },
    ui::ViewContext,
};

/// The parts of a shown value, to be arranged as there is room.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// `72.4`, `72.4?` or `----`.
    pub text: String,
    /// `°C`; empty without a value.
    pub unit: String,
    /// Why not to trust it: the age of an uncertain value, the cause of a bad one; empty if good.
    pub note: String,
    /// A number, which is shown whole or not at all; words may be cut with a mark.
    pub number: bool,
    pub style: Style,
}

/// A tag as it stands.
pub fn show(cx: &ViewContext, tag: TagId) -> Shown {
    let sample = cx.snapshot.sample(tag);
    let style = cx.theme.quality(sample.quality);
    let def = cx.def().tag(tag);
    let unit = cx.snapshot.unit(tag).to_owned();
    let number = def.enum_labels.is_empty() && def.bit_labels.is_empty() && !def.is_text();
    let nothing = |text: &str, note: &str, style| Shown {
        text: text.to_owned(),
        unit: String::new(),
        note: note.to_owned(),
        number: false,
        style,
    };
    match (sample.quality, words(cx, tag)) {
        _ if def.access == Access::Write => nothing("–", t!("write only"), cx.theme.dim()),
        (Quality::Good, Some(text)) if text.is_empty() => nothing("\"\"", t!("empty text"), style),
        (Quality::Good, Some(text)) => Shown { text, unit, note: String::new(), number, style },
        (Quality::Uncertain(_), Some(text)) => {
            Shown { text: format!("{text}?"), unit, note: text::age(cx.age(tag)), number, style }
        }
        (quality, _) => nothing("----", translate(quality.cause().unwrap_or(Cause::NotRead).word()), style),
    }
}

/// Name, value, unit, quality and time of a tag, separated by tabs.
pub fn line(cx: &ViewContext, tag: TagId) -> String {
    let (def, sample, shown) = (cx.def().tag(tag), cx.snapshot.sample(tag), show(cx, tag));
    let quality = match sample.quality {
        Quality::Good => t!("good").to_owned(),
        Quality::Uncertain(cause) => t!("uncertain: {cause}", cause = translate(cause.word())),
        Quality::Bad(cause) => t!("bad: {cause}", cause = translate(cause.word())),
    };
    [def.name.clone(), shown.text, shown.unit, quality, text::stamp(sample.at, &cx.def().time_zone)].join("\t")
}

fn words(cx: &ViewContext, tag: TagId) -> Option<String> {
    let def = cx.def().tag(tag);
    if def.is_text() {
        return cx.snapshot.text(tag);
    }
    cx.snapshot.sample(tag).exact().map(|value| number(cx, tag, value))
}

/// A number of a tag in words: a state by its name, a status word as the names of its set bits.
pub fn number(cx: &ViewContext, tag: TagId, value: impl Into<Exact>) -> String {
    let value = value.into();
    let def = cx.def().tag(tag);
    if def.bit_labels.is_empty() {
        return cx.snapshot.format(tag, value);
    }
    let set: Vec<&str> = def
        .bit_labels
        .iter()
        .filter(|(bit, _)| value.bits() >> (*bit).min(63) & 1 == 1)
        .map(|(_, name)| of_plant(name))
        .collect();
    if set.is_empty() { t!("none").to_owned() } else { set.join(", ") }
}

impl Shown {
    /// Value and unit: `72.4 °C`.
    pub fn with_unit(&self) -> String {
        if self.unit.is_empty() { self.text.clone() } else { format!("{} {}", self.text, self.unit) }
    }
    /// All of it: `72.4? °C 12s`, `---- device not responding`.
    pub fn whole(&self) -> String {
        if self.note.is_empty() { self.with_unit() } else { format!("{} {}", self.with_unit(), self.note) }
    }
    /// The text alone, `##` for a number that does not fit: a part of a number is another number.
    pub fn bare(&self, room: u16) -> String {
        if self.number { text::whole(&self.text, room) } else { text::fit(&self.text, room) }
    }
    /// As much as fits: the note goes first, then the unit; the doubt itself is part of the text and stays.
    pub fn within(&self, room: u16) -> String {
        [self.whole(), self.with_unit()]
            .into_iter()
            .find(|text| text::width(text) <= room)
            .unwrap_or_else(|| self.bare(room))
    }
}

/// `on` for a good value that is not zero; `None` when unknown.
pub fn is_on(cx: &ViewContext, tag: TagId) -> Option<bool> {
    cx.snapshot.sample(tag).good_value().map(|value| value != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ui::fixture::{Fixture, with_cx};

    #[test]
    fn a_text_is_shown_with_its_doubt_like_any_value() {
        let mut fixture = Fixture::normal();
        let tag = fixture.tag("TIC-1.MV");
        fixture.def.tags[tag.index()].point.kind = crate::plant::tag::DataType::Text(8);
        fixture.def.tags[tag.index()].unit.clear();
        let mut check = |text: Option<&str>, quality, room, expect: &str| {
            fixture.samples[tag.index()].value = None;
            fixture.samples[tag.index()].quality = quality;
            let mut snapshot = (*fixture.snapshot()).clone();
            std::sync::Arc::make_mut(&mut snapshot.texts)[tag.index()] = text.map(Into::into);
            with_cx(&snapshot, |cx| assert_eq!(show(cx, tag).within(room), expect));
        };
        check(Some("PXR4TAY1"), Quality::Good, 20, "PXR4TAY1");
        check(Some("PXR4TAY1"), Quality::Good, 5, "PXR4…");
        check(Some(""), Quality::Good, 20, "\"\" empty text");
        check(None, Quality::Bad(Cause::Timeout), 30, "---- response timeout");
        check(Some("PXR4"), Quality::Uncertain(Cause::Timeout), 5, "PXR4?");
    }

    #[test]
    fn a_number_is_whole_or_not_there() {
        let mut fixture = Fixture::normal();
        fixture.set("TIC-1.MV", 100.0);
        let check = |name: &str, room: u16, expect: &str| {
            with_cx(&fixture.snapshot(), |cx| {
                assert_eq!(show(cx, fixture.tag(name)).within(room), expect, "{name} in {room}");
            });
        };
        check("TIC-1.MV", 7, "100.0 %");
        check("TIC-1.MV", 6, "100.0");
        check("TIC-1.MV", 5, "100.0");
        check("TIC-1.MV", 4, "##");
        check("TIC-1.MV", 1, "#");
        check("TIC-1.MV", 0, "");
        check("PLC-1.AUTO", 3, "AU…");
        check("TIC-1.FIX", 20, "– write only");
    }
}
