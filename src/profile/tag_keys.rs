//! Keys that a tag which holds text, or is calculated, does not have.

use super::{
    diagnostic::{Problems, Span},
    schema::TagTable,
};
use crate::plant::tag::{Access, ByteOrder, Point, StorePolicy};

/// Keys that a text does not have.
#[rustfmt::skip]
const FOR_NUMBERS: [&str; 16] = [
    "scale", "offset", "decimals", "decimals_from", "unit", "unit_from", "min", "max", "min_from", "max_from", "enum", "bits",
    "bad_if", "quality_from", "deadband", "normal",
];

/// Keys that belong to a register.
#[rustfmt::skip]
const FOR_REGISTERS: [&str; 26] = [
    "table", "address", "modicon", "type", "order", "field", "scale", "offset", "decimals_from", "unit_from", "access", "verify",
    "confirm", "reauthenticate", "role", "bits", "bad_if", "quality_from", "quality_mask", "write_fc", "write_unlock", "poll",
    "poll_class", "simulate", "default", "set",
];

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

/// Words have no scale, no limits and no names of numbers, and are neither written nor kept in the history.
pub(super) fn check_text(row: &TagTable, point: Point, problems: &mut Problems) {
    for (key, at) in FOR_NUMBERS.into_iter().filter_map(|key| Some((key, row.span_of(key)?))) {
        problems.add(at, format!("`{key}` is for numbers, this is a text")).label("leave it out");
    }
    if let Some(order) = row.order.filter(|order| matches!(order.value, ByteOrder::Cdab | ByteOrder::Dcba)) {
        let problem = problems.add(order.at, "the words of a text cannot be reversed");
        problem.label("expected \"ABCD\", high byte first, or \"BADC\", low byte first");
    }
    if point.table.is_bits() {
        problems.add(row.at, "a text needs registers").label("expected table = \"holding\" or \"input\"");
    }
    if let Some(access) = row.access.filter(|access| access.value != Access::Read) {
        problems.add(access.at, "a text can only be read").label("expected access = \"r\"");
    }
    if let Some(store) = row.store.filter(|store| store.value != StorePolicy::Never) {
        problems.add(store.at, "the history keeps numbers, this is a text").label("leave it out");
    }
}
