//! The keys of a tag: those that one which holds text, or is calculated, does not have, and its poll period.

use std::time::Duration;

use super::{
    address::{Scheme, memory_table},
    diagnostic::{Problems, Span},
    reader::{At, Node, Raw},
    schema::TagTable,
};
use crate::plant::{
    address::{in_table, table_named},
    tag::{Access, ByteOrder, DataType, Point, StorePolicy},
};

/// Keys that a text does not have.
#[rustfmt::skip]
const FOR_NUMBERS: [&str; 17] = [
    "scale", "offset", "decimals", "decimals_from", "scale_from", "unit", "unit_from", "min", "max", "min_from", "max_from", "enum", "bits",
    "bad_if", "quality_from", "deadband", "normal",
];

/// Keys that belong to a register.
#[rustfmt::skip]
const FOR_REGISTERS: [&str; 30] = [
    "table", "address", "modicon", "type", "order", "field", "scale", "offset", "decimals_from", "scale_from", "unit_from", "access", "verify",
    "confirm", "reauthenticate", "role", "bits", "bad_if", "quality_from", "quality_mask", "write_fc", "write_address", "write", "write_unlock", "poll",
    "poll_class", "simulate", "default", "set", "when",
];

/// A poll period that a line can keep and an operator can wait for.
pub(super) fn period(written: Option<At<Duration>>, default_s: u64, problems: &mut Problems) -> Duration {
    let Some(period) = written else { return Duration::from_secs(default_s) };
    if period.value < Duration::from_millis(50) || period.value > Duration::from_secs(86_400) {
        problems.add(period.at, "this is not a poll period").label("expected 50ms to 1 day");
    }
    period.value
}

/// The defaults of a profile without those that its kind of tag does not have: a type of registers is no coil's, a scale no
/// text's.
pub(super) fn strip_default(mut defaults: Raw, own: &[Raw], scheme: Scheme) -> Raw {
    let written = |layers: &[Raw], key: &str| {
        let node = layers.iter().find_map(|layer| layer.table.get(key)).map(|(_, node)| &node.value);
        node.and_then(|node| if let Node::Text(text) = node { Some(text.clone()) } else { None })
    };
    let of_default = std::slice::from_ref(&defaults);
    let address = written(own, "address").unwrap_or_default();
    let by_address = in_table(&address).map(|(table, _)| table);
    let by_name = || memory_table(&address).filter(|_| scheme == Scheme::DirectLogic);
    let named = written(own, "table").or_else(|| written(of_default, "table").filter(|_| by_address.is_none()));
    let table = by_address.or_else(by_name).or_else(|| named.and_then(|word| table_named(&word)));
    let kind = written(own, "type").or_else(|| written(of_default, "type")).unwrap_or_default();
    let mut foreign: Vec<&str> = Vec::new();
    if own.iter().any(|layer| layer.table.contains_key("expr")) {
        foreign.extend(FOR_REGISTERS);
    } else if table.is_some_and(|table| table.is_bits()) {
        foreign.extend(["type", "order", "field"].into_iter().chain(FOR_NUMBERS));
    } else if kind.parse().is_ok_and(DataType::is_text) {
        foreign.extend(FOR_NUMBERS);
        // Only the bytes of a text have an order.
        foreign.extend(written(of_default, "order").filter(|order| order == ByteOrder::Cdab.word()).map(|_| "order"));
    }
    if by_address.is_some() {
        foreign.push("table");
    }
    foreign.into_iter().for_each(|key| {
        defaults.table.remove(key);
    });
    defaults
}

/// What is calculated is neither read nor written.
pub(super) fn check_calculated(row: &TagTable, expr: Span, problems: &mut Problems) {
    // What the defaults of a profile say is for its registers.
    let own = |at: &Span| at.source == row.at.source && row.at.start <= at.start;
    for (key, at) in FOR_REGISTERS.into_iter().filter_map(|key| Some((key, row.span_of(key).filter(own)?))) {
        problems
            .add(at, format!("`{key}` is for what is read from a device, this is calculated"))
            .label("leave it out")
            .also(expr, "calculated here");
    }
}

/// Words have no scale, no limits and no names of numbers, and are not kept in the history.
pub(super) fn check_text(row: &TagTable, point: Point, problems: &mut Problems) {
    for (key, at) in FOR_NUMBERS.into_iter().filter_map(|key| Some((key, row.span_of(key)?))) {
        problems.add(at, format!("`{key}` is for numbers, this is a text")).label("leave it out");
    }
    let is_reversed = |order: &At<ByteOrder>| matches!(order.value, ByteOrder::Cdab | ByteOrder::Dcba);
    if let Some(order) = row.order.filter(|order| is_reversed(order) && !point.kind.is_reversible()) {
        let problem = problems.add(order.at, "the words of a text cannot be reversed");
        problem.label("expected \"ABCD\", high byte first, or \"BADC\", low byte first");
    }
    if point.table.is_bits() {
        problems.add(row.at, "a text needs registers").label("expected table = \"holding\" or \"input\"");
    }
    let is_version = matches!(point.kind, DataType::Version(_));
    if let Some(access) = row.access.filter(|access| is_version && access.value != Access::Read) {
        problems.add(access.at, "a version can only be read").label("expected access = \"r\"");
    }
    if let Some(store) = row.store.filter(|store| store.value != StorePolicy::Never) {
        problems.add(store.at, "the history keeps numbers, this is a text").label("leave it out");
    }
}
