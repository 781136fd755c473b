//! What is drawn: the items and commands of the mimic, and the pens of the trends.

use std::time::Duration;

use super::{
    diagnostic::{Problems, Span},
    names::{Defs, Unique, check_writable, number_of},
    reader::{At, OptionalKey, Raw, kind_of, text, toml_tables},
    schema::{CommandTable, MimicTable, TrendTable},
};
use crate::plant::{
    def::{MimicCommand, MimicDef, MimicItem, MimicRect, Pen, TagId, TrendGroup},
    keyword::keyword_enum,
    tag::{Poll, TagDef},
};

/// The mimic of the process.
pub(super) fn mimic(table: &MimicTable, defs: &Defs, problems: &mut Problems) -> MimicDef {
    let size = table.size.map_or((80, 18), |size| (size.value[0], size.value[1]));
    if size.0 == 0 || size.1 == 0 || size.0 > 500 || size.1 > 200 {
        let at = table.size.map_or(table.at, |size| size.at);
        problems.add(at, "a canvas of this size cannot be drawn").label("expected [80, 18] for a terminal of 80 by 24");
    }
    let items = table.items.iter().filter_map(|item| {
        let item = item_of(item.value.clone(), defs, problems)?;
        check_inside(&item.value, item.at, size, problems);
        Some(item.value)
    });
    let items = items.collect();
    let mut keys = Unique::default();
    let commands = table.commands.iter().filter_map(|command| self::command(&command.value, defs, &mut keys, problems));
    MimicDef { size, items, commands: commands.collect() }
}

/// Declares the tables of the items: every item has a kind and a place.
macro_rules! items {
    ($($name:ident, $what:literal { $($mode:ident $key:literal $field:ident: $type:ty,)* })*) => { $(
        toml_tables!(
            #[doc = $what]
            $name, $what {
                need "kind" _kind: String,
                need "x" x: u16,
                need "y" y: u16,
                opt "width" width: u16,
                opt "height" height: u16,
                $($mode $key $field: $type,)*
            }
        );
        impl $name {
            fn place(&self) -> MimicRect {
                let cells = |value: Option<At<u16>>, usual| value.value_or(usual);
                MimicRect { x: cells(self.x, 0), y: cells(self.y, 0), width: cells(self.width, 1), height: cells(self.height, 1) }
            }
        }
    )* };
}

items! {
    TankItem, "a tank" {
        opt "label" label: String,
        opt "level" level: String,
        opt "temperature" temperature: String,
        opt "heater" heater: String,
        opt "agitator" agitator: String,
    }
    ValveItem, "a valve" { need "label" label: String, need "tag" tag: String, opt "vertical" vertical: bool, }
    PumpItem, "a pump" { need "label" label: String, need "tag" tag: String, }
    ValueItem, "a value" { opt "label" label: String, need "tag" tag: String, }
    ControllerItem, "a controller" { need "device" device: String, }
    SequenceItem, "a sequence" {
        opt "label" label: String,
        need "step" step: String,
        opt "remaining" remaining: String,
        list "states" states: String,
    }
    TrendItem, "a trend" { need "tag" tag: String, need "window" window: Duration, }
    TextItem, "a text" { need "text" text: String, }
}

toml_tables! {
    /// A pipe has no place but its points.
    PipeItem, "a pipe" { need "kind" _kind: String, list "points" points: [u16; 2], list "flow" flow: String, }
}

keyword_enum! {
    #[derive(Debug, Clone, Copy)]
    enum ItemKind: "kind" {
        Tank => "tank",
        Valve => "valve",
        Pump => "pump",
        Pipe => "pipe",
        Value => "value",
        Controller => "controller",
        Sequence => "sequence",
        Trend => "trend",
        Text => "text",
    }
}

/// Reads an item by its kind. The problems of a wrong item are added even where `None` is returned.
fn item_of(raw: Raw, defs: &Defs, problems: &mut Problems) -> Option<At<MimicItem>> {
    let at = raw.at;
    let kind = kind_of::<ItemKind>(&raw, "a mimic item", "kind", problems)?;
    let layers = &[raw];
    let value = match kind {
        ItemKind::Tank => {
            let item = TankItem::of(layers, problems);
            MimicItem::Tank {
                place: item.place(),
                label: text(&item.label),
                level: defs.tag_id(&item.level, problems),
                temperature: defs.tag_id(&item.temperature, problems),
                heater: defs.tag_id(&item.heater, problems),
                agitator: defs.tag_id(&item.agitator, problems),
            }
        }
        ItemKind::Valve => {
            let item = ValveItem::of(layers, problems);
            let tag = defs.tag_id(&item.tag, problems)?;
            let vertical = item.vertical.value_or(false);
            MimicItem::Valve { place: item.place(), label: text(&item.label), tag, vertical }
        }
        ItemKind::Pump => {
            let item = PumpItem::of(layers, problems);
            MimicItem::Pump { place: item.place(), label: text(&item.label), tag: defs.tag_id(&item.tag, problems)? }
        }
        ItemKind::Pipe => pipe(PipeItem::of(layers, problems), defs, problems),
        ItemKind::Value => {
            let item = ValueItem::of(layers, problems);
            // The one item that can show words as well as a number.
            let tag = defs.names.full(item.tag.as_ref()?, problems)?;
            MimicItem::Value { place: item.place(), label: text(&item.label), tag }
        }
        ItemKind::Controller => controller(ControllerItem::of(layers, problems), defs, problems)?,
        ItemKind::Sequence => sequence(SequenceItem::of(layers, problems), defs, problems)?,
        ItemKind::Trend => {
            let item = TrendItem::of(layers, problems);
            let tag = defs.tag_id(&item.tag, problems)?;
            MimicItem::Trend { place: item.place(), tag, window: item.window.value_or(Duration::ZERO) }
        }
        ItemKind::Text => {
            let item = TextItem::of(layers, problems);
            MimicItem::Text { place: item.place(), text: text(&item.text) }
        }
    };
    Some(At { value, at })
}

fn pipe(item: PipeItem, defs: &Defs, problems: &mut Problems) -> MimicItem {
    if item.points.len() < 2 {
        problems.add(item.at, "a pipe needs at least two points").label("expected points = [[5, 4], [5, 9]]");
    }
    for pair in item.points.windows(2) {
        let (a, b) = (pair[0].value, pair[1].value);
        if a[0] != b[0] && a[1] != b[1] {
            problems.add(pair[1].at, "a pipe runs along rows and columns").label(format!("slanting from {a:?}"));
        }
    }
    MimicItem::Pipe {
        points: item.points.iter().map(|point| (point.value[0], point.value[1])).collect(),
        flow: item.flow.iter().filter_map(|tag| Some(defs.tag(tag, problems)?.id)).collect(),
    }
}

fn controller(item: ControllerItem, defs: &Defs, problems: &mut Problems) -> Option<MimicItem> {
    let name = item.device.as_ref()?;
    let device = defs.device(name, problems)?;
    if defs.devices[device.index()].faceplate.is_none() {
        problems.add(name.at, format!("{} is no controller", name.value)).label("its profile has no [faceplate]");
    }
    Some(MimicItem::Controller { place: item.place(), device })
}

fn sequence(item: SequenceItem, defs: &Defs, problems: &mut Problems) -> Option<MimicItem> {
    let name = item.step.as_ref()?;
    let step = defs.tag(name, problems)?;
    if step.enum_labels.is_empty() {
        problems.add(name.at, format!("{} has no steps", step.name)).label("expected a tag with an `enum`");
    }
    Some(MimicItem::Sequence {
        place: item.place(),
        label: text(&item.label),
        step: step.id,
        remaining: defs.tag_id(&item.remaining, problems),
        states: item.states.iter().filter_map(|tag| Some(defs.tag(tag, problems)?.id)).collect(),
    })
}

/// Nothing may lie outside the canvas: it would not be drawn.
fn check_inside(item: &MimicItem, at: Span, size: (u16, u16), problems: &mut Problems) {
    let corner = |place: &MimicRect| (place.x.saturating_add(place.width), place.y.saturating_add(place.height));
    let (right, bottom) = match item {
        MimicItem::Tank { place, .. }
        | MimicItem::Valve { place, .. }
        | MimicItem::Pump { place, .. }
        | MimicItem::Value { place, .. }
        | MimicItem::Controller { place, .. }
        | MimicItem::Sequence { place, .. }
        | MimicItem::Trend { place, .. }
        | MimicItem::Text { place, .. } => corner(place),
        MimicItem::Pipe { points, .. } => points
            .iter()
            .fold((0, 0), |(x, y), point| (x.max(point.0.saturating_add(1)), y.max(point.1.saturating_add(1)))),
    };
    if right > size.0 || bottom > size.1 {
        let problem = problems.add(at, "this item reaches out of the mimic");
        problem.label(format!("to column {right}, row {bottom} of {} by {}", size.0, size.1));
    }
}

/// Letters that mean something on every screen, so that no plant can give them another meaning.
const KEYS_TAKEN: [char; 3] = ['a', 'q', 'w'];

fn command(table: &CommandTable, defs: &Defs, keys: &mut Unique, problems: &mut Problems) -> Option<MimicCommand> {
    let (key, name) = (table.key.as_ref()?, table.tag.as_ref()?);
    let mut letters = key.value.chars();
    let letter = letters.next().filter(|c| c.is_ascii_lowercase() && letters.next().is_none());
    if letter.is_none() {
        problems.add(key.at, format!("`{}` is not a key", key.value)).label("expected one lower-case letter");
    }
    if letter.is_some_and(|letter| KEYS_TAKEN.contains(&letter)) {
        problems
            .add(key.at, format!("key `{}` is taken", key.value))
            .label("on every screen `a` acknowledges an alarm, `q` quits and `w` says why");
    }
    keys.insert(&key.value, key.at, format!("duplicate key `{}`", key.value), problems);
    let tag = defs.tag(name, problems)?;
    check_writable(name, tag, problems);
    let value = match &table.value {
        Some(choice) => Some(number_of(choice, tag, problems)?),
        None => None,
    };
    Some(MimicCommand { key: letter?, label: text(&table.label), tag: tag.id, value })
}

/// Most pens of a group: more curves cannot be distinguished.
const PENS_MAX: usize = 8;

/// The groups of pens; one is made up if the plant file has none.
pub(super) fn trends(tables: &[At<TrendTable>], defs: &Defs, problems: &mut Problems) -> Vec<TrendGroup> {
    let mut seen = Unique::default();
    let mut groups = Vec::new();
    for table in tables.iter().map(|table| &table.value) {
        let Some(name) = &table.name else { continue };
        seen.insert(&name.value, name.at, format!("duplicate trend `{}`", name.value), problems);
        if table.pens.is_empty() || table.pens.len() > PENS_MAX {
            problems
                .add(table.at, format!("a trend with {} pens", table.pens.len()))
                .label(format!("expected 1 to {PENS_MAX}"));
        }
        let pens = table.pens.iter().filter_map(|pen| {
            let scale = pen.value.scale.map(|scale| (scale.value[0], scale.value[1]));
            if let Some(at) = pen.value.scale.filter(|scale| scale.value[0] >= scale.value[1]) {
                problems.add(at.at, "the scale is empty or reversed").label("expected [low, high]");
            }
            let tag: TagId = defs.tag_id(&pen.value.tag, problems)?;
            Some(Pen { tag, scale })
        });
        groups.push(TrendGroup { name: name.value.clone(), pens: pens.collect() });
    }
    if tables.is_empty() {
        let curve = |tag: &&TagDef| {
            tag.enum_labels.is_empty()
                && tag.is_stored()
                && (matches!(tag.poll, Poll::Every(_)) || tag.calculation.is_some())
        };
        let pens = defs.tags.iter().filter(curve).take(PENS_MAX).map(|tag| Pen { tag: tag.id, scale: None });
        groups.push(TrendGroup { name: "all".to_owned(), pens: pens.collect() });
    }
    groups
}
