//! One row of a register map becomes the definition of a tag, and is checked against itself and its device.

mod access;
mod bits;
mod place;
mod scaling;

use std::time::Duration;

use self::{
    access::{access, write_at},
    bits::{bit_labels, enum_labels},
    place::place,
    scaling::check_scaling,
};
pub(super) use self::{bits::named_bits, place::field_of, scaling::range_of};
use super::{
    address::{Scheme, is_unclear as is_unclear_at},
    diagnostic::{Problems, Span},
    names::{Names, check_name, number_of},
    reader::{At, Choice, OptionalKey, Raw, either, supersede, text},
    schema::{CounterKey, PollKey, PollWord, Roles, SimulateTable, TagTable},
    tag_keys::{period, strip_default},
    units,
};
use crate::plant::{
    def::{DeviceId, Limits, Role, TagId},
    exact::Exact,
    raw_number::BadSpan,
    tag::{
        Access, Bound, ByteOrder, Confidence, DataType, Decimals, Encoding, Point, Poll, PollClass, STORE_EVERY_MAX,
        StorePolicy, Table, TagDef,
    },
};

/// What a tag must know of its device.
pub(super) struct DeviceContext<'a> {
    pub device: DeviceId,
    pub device_name: &'a str,
    pub scheme: Scheme,
    pub limits: Limits,
    /// The last layer of each row are the defaults of its profile.
    pub has_default: bool,
    /// It is stated how addresses count.
    pub has_base: bool,
    pub fast: Duration,
    pub slow: Duration,
    pub names: &'a Names,
    /// The least role that may write the tags of a group, the plant file's before the profile's.
    pub roles: [Option<&'a Roles>; 2],
}

impl DeviceContext<'_> {
    /// The least role that may write the tags of a group.
    fn role_of(&self, group: &str) -> Role {
        let mut listed = self.roles.iter().flatten().flat_map(|roles| &roles.0);
        listed.find(|(name, _)| name.value == group).map_or(Role::Technician, |(_, role)| role.value.0)
    }
}

/// A defined tag and what must still be checked when all tags are there.
pub(super) struct Defined {
    pub tag: TagDef,
    /// The class, if it is written.
    pub class: Option<PollClass>,
    /// Whether it is part of parameter sets, if that is written.
    pub in_sets: Option<At<bool>>,
    /// Where its address stands; `None` if it has no valid point.
    pub address_at: Option<Span>,
    /// Its address could as well be a Modicon number.
    pub is_unclear: bool,
    /// Tags that this one needs to be shown right.
    pub needs: Vec<(At<TagId>, &'static str)>,
    /// Where the unlock value stands, which is resolved when the other tag is known.
    pub unlock: Option<(TagId, At<Choice>)>,
    /// What it is calculated from, which may be any tag of the plant.
    pub expr: Option<At<String>>,
    /// What must hold for its device to have it.
    pub when: Option<At<String>>,
    /// How it is simulated, which may ask any tag of the plant.
    pub simulate: Option<SimulateTable>,
}

/// Builds a tag from its layers. Where something is wrong a placeholder stands, and the problems keep it from getting out.
pub(super) fn define(id: TagId, layers: Vec<Raw>, context: &DeviceContext, problems: &mut Problems) -> Defined {
    let (row, has_default_marks) = row_of(layers, context, problems);
    let (point, kind, is_text) = place(&row, context, problems);
    let links = links(&row, context, problems);
    let decimals = match (links.decimals, links.power) {
        (Some(tag), _) => Decimals::From(tag),
        (None, Some(tag)) => Decimals::PowerFrom(tag),
        (None, None) => Decimals::Fixed(decimals(&row, kind, problems)),
    };
    check_scaling(&row, kind, decimals, problems);
    let access = access(&row, point, context.limits, problems);
    let poll = poll(&row, context, problems);
    if let Some(name) = &row.name {
        check_name(name, "tag", problems);
    }
    let short = text(&row.name);
    let name = format!("{}.{short}", context.device_name);
    let tag = TagDef {
        label: row.label.as_ref().map_or_else(|| short.clone(), |label| label.value.clone()),
        meaning: text(&row.meaning),
        scale: row.scale.value_or(1.0),
        offset: row.offset.value_or(0.0),
        decimals,
        unit: row.unit.as_ref().map(|unit| units::of(&unit.value)).unwrap_or_default(),
        unit_from: links.unit.map(|tag| (tag, Vec::new())),
        min: links.min.map(Bound::From).or(fixed(&row.min)),
        max: links.max.map(Bound::From).or(fixed(&row.max)),
        normal: row.normal.map(|normal| normal.value),
        access,
        confirm: row.confirm.as_ref().map(|confirm| confirm.value.clone()),
        reauthenticate: row.reauthenticate.map(|kind| kind.value),
        role: row.role.map_or_else(|| context.role_of(&text(&row.group)), |role| role.value.0),
        enum_labels: enum_labels(&row, point.filter(|_| row.expr.is_none()), problems),
        bit_labels: bit_labels(&row.bits, kind, problems),
        bad_if: bad_if(&row, point, has_default_marks, problems),
        quality_from: links.quality.map(|tag| (tag, row.quality_mask.value_or(u64::MAX))),
        write_fc: row.write_fc.map(|fc| fc.value),
        write_at: point.and_then(|point| write_at(&row, point, context.scheme, problems)),
        read_modify_write: row.write.is_some(),
        group: text(&row.group),
        poll,
        // Known when all tags and alarms are.
        deadband: row.deadband.map(|deadband| deadband.value),
        store: store_policy(&row, is_text, access, poll),
        store_every: store_every(&row, problems),
        counter: row.counter.map(|counter| !matches!(counter.value, CounterKey::Counts(false))),
        modulus: modulus(&row, problems),
        max_rate: row.max_rate.and_then(|rate| positive(rate, "max_rate", problems)),
        hours: row.hours.is_some_and(|hours| hours.value && is_on_or_off(kind, hours.at, problems)),
        confidence: row.confidence.value_or(Confidence::Medium),
        source: text(&row.source),
        // Needs all tags of the plant.
        ..TagDef::new(id, context.device, &name, point.unwrap_or(NOWHERE))
    };
    let default = row.default.as_ref().and_then(|default| number_of(default, &tag, problems));
    let tag = TagDef { default, ..tag };
    Defined {
        tag,
        class: row.poll_class.map(|class| class.value),
        in_sets: row.in_sets,
        is_unclear: !context.has_base && is_unclear(&row, point, problems),
        address_at: point.and(row.address.map(|address| address.at)),
        expr: row.expr,
        when: row.when,
        needs: links.needs,
        unlock: links.unlock,
        simulate: row.simulate.map(|simulate| simulate.value),
    }
}

/// The row of its layers, and whether its marks of no value are those of the defaults.
fn row_of(mut layers: Vec<Raw>, context: &DeviceContext, problems: &mut Problems) -> (TagTable, bool) {
    for (first, second) in [
        ("min", "min_from"),
        ("max", "max_from"),
        ("decimals", "decimals_from"),
        ("decimals", "scale_from"),
        ("decimals_from", "scale_from"),
    ] {
        either(&mut layers, first, second, problems);
    }
    // A plant file that moves a tag need not repeat the number of the manual.
    supersede(&mut layers, "address", "modicon");
    let mut default_marks = None;
    if let Some(defaults) = layers.pop_if(|_| context.has_default) {
        let defaults = strip_default(defaults, &layers, context.scheme);
        default_marks = defaults.table.get("bad_if").map(|(_, node)| node.at);
        layers.push(defaults);
    }
    let row = TagTable::of(&layers, problems);
    let has_default_marks = row.bad_if.as_ref().is_some_and(|marks| Some(marks.at) == default_marks);
    (row, has_default_marks)
}

fn bad_if(row: &TagTable, point: Option<Point>, is_default: bool, problems: &mut Problems) -> Vec<BadSpan> {
    let Some((marks, point)) = row.bad_if.as_ref().zip(point) else { return Vec::new() };
    marks.value.of(point, is_default, problems)
}

/// Could its address as well be a Modicon number?
fn is_unclear(row: &TagTable, point: Option<Point>, problems: &Problems) -> bool {
    let Some((location, point)) = row.address.as_ref().zip(point) else { return false };
    row.modicon.is_none() && is_unclear_at(location, point.table, problems)
}

/// The shortest interval at which an unchanged value may be stored.
const STORE_EVERY_MIN: Duration = Duration::from_secs(1);

/// Stands in for an address that is wrong; it never leaves the loader.
const NOWHERE: Point =
    Point { table: Table::Holding, address: 0, kind: DataType::U16, order: ByteOrder::Abcd, field: None };

/// The other tags that a row names.
struct Links {
    decimals: Option<TagId>,
    power: Option<TagId>,
    unit: Option<TagId>,
    min: Option<TagId>,
    max: Option<TagId>,
    quality: Option<TagId>,
    needs: Vec<(At<TagId>, &'static str)>,
    unlock: Option<(TagId, At<Choice>)>,
}

fn links(row: &TagTable, context: &DeviceContext, problems: &mut Problems) -> Links {
    let mut needs = Vec::new();
    let mut refer = |name: &Option<At<String>>, what, problems: &mut Problems| {
        let name = name.as_ref()?;
        let value = context.names.near(name, context.device_name, problems)?;
        needs.push((At { value, at: name.at }, what));
        Some(value)
    };
    let unlock = row.write_unlock.as_ref().and_then(|unlock| {
        let tag = context.names.near(unlock.value.tag.as_ref()?, context.device_name, problems)?;
        Some((tag, unlock.value.value.clone()?))
    });
    Links {
        decimals: refer(&row.decimals_from, "decimals_from", problems),
        power: refer(&row.scale_from, "scale_from", problems),
        unit: refer(&row.unit_from, "unit_from", problems),
        min: refer(&row.min_from, "min_from", problems),
        max: refer(&row.max_from, "max_from", problems),
        quality: refer(&row.quality_from, "quality_from", problems),
        needs,
        unlock,
    }
}

/// Raw type and, for a field, its number of bits.
type Raws = (DataType, Option<u8>);

/// Decimals to show if the row does not say: as many as the scale has, two for floats.
fn decimals(row: &TagTable, kind: Option<Raws>, problems: &mut Problems) -> u8 {
    if let Some(decimals) = row.decimals {
        if decimals.value > Decimals::MAX {
            problems
                .add(decimals.at, format!("{} decimals are too many", decimals.value))
                .label(format!("expected 0 to {}", Decimals::MAX));
        }
        return decimals.value;
    }
    if kind.is_some_and(|(kind, _)| kind.encoding() == Encoding::Float) {
        return 2;
    }
    let scale = row.scale.value_or(1.0);
    let whole = |digits: &u8| {
        ((scale * 10f64.powi(i32::from(*digits))).round() / 10f64.powi(i32::from(*digits)) - scale).abs() < 1e-9
    };
    (0..=6).find(whole).unwrap_or(6)
}

/// How often it is read: what is calculated never is.
fn poll(row: &TagTable, context: &DeviceContext, problems: &mut Problems) -> Poll {
    if row.expr.is_some() {
        return Poll::Never;
    }
    match row.poll.value_or(PollKey::Word(PollWord::Slow)) {
        PollKey::Word(PollWord::Fast) => Poll::Every(context.fast),
        PollKey::Word(PollWord::Slow) => Poll::Every(context.slow),
        PollKey::Word(PollWord::Once) => Poll::Once,
        PollKey::Word(PollWord::Never) => Poll::Never,
        PollKey::Every(value) => Poll::Every(period(row.poll.map(|poll| At { value, at: poll.at }), 1, problems)),
    }
}

/// Is it on or off, so that its hours can be given? A condition of an expression is.
fn is_on_or_off(kind: Option<(DataType, Option<u8>)>, at: Span, problems: &mut Problems) -> bool {
    let is = kind.is_none_or(|(kind, bits)| kind == DataType::Bool || bits == Some(1));
    if !is {
        problems.add(at, "only what is on or off has hours").label("expected a bool, one bit, or `expr = \"… > …\"`");
    }
    is
}

/// After how much a counter shows the same again.
fn modulus(row: &TagTable, problems: &mut Problems) -> Option<f64> {
    let Some(At { value: CounterKey::Rolls(Some(modulus)), .. }) = row.counter else { return None };
    positive(modulus, "modulus", problems)
}

fn positive(number: At<f64>, key: &str, problems: &mut Problems) -> Option<f64> {
    let is_right = 0.0 < number.value && number.value.is_finite();
    if !is_right {
        problems.add(number.at, format!("`{key}` must be greater than 0")).label("expected a number of its unit");
    }
    is_right.then_some(number.value)
}

/// What is read regularly is stored, unless the row says otherwise.
fn store_policy(row: &TagTable, is_text: bool, access: Access, poll: Poll) -> StorePolicy {
    let stored = !is_text && access != Access::Write && (matches!(poll, Poll::Every(_)) || row.expr.is_some());
    row.store.map_or(if stored { StorePolicy::Change } else { StorePolicy::Never }, |store| store.value)
}

/// The longest time between two stored values.
fn store_every(row: &TagTable, problems: &mut Problems) -> Duration {
    let Some(every) = row.store_every else { return STORE_EVERY_MAX };
    if every.value < STORE_EVERY_MIN || STORE_EVERY_MAX < every.value {
        problems.add(every.at, "a value can be stored every 1 to 60 s").label("expected \"1 s\" … \"60 s\"");
    }
    every.value
}

fn fixed(bound: &Option<At<Exact>>) -> Option<Bound> {
    bound.map(|bound| Bound::Fixed(bound.value))
}
