//! Addresses as lists write them: alone, or the first and last of several.

use crate::plant::{
    address::{AddressBase, AddressContext, wire},
    tag::Table,
};

/// Is it an address in any reading?
pub fn is_address(cell: &str) -> bool {
    let any = AddressContext { table: Table::Holding, is_stated: false, base: AddressBase::Modicon };
    any.parse(first_of(cell)).is_some()
}

/// Of `41003-41004` the first.
pub fn first_of(cell: &str) -> &str {
    match ends_of(cell) {
        Some((first, last)) if number_as(first, last).is_none_or(|(first, last)| first <= last) => first,
        _ => cell.trim(),
    }
}

/// How many registers a span takes: 2 of `41003-41004` and of `41003-04`.
pub fn span_of(cell: &str) -> Option<u16> {
    let (first, last) = ends_of(cell)?;
    let (first, last) = number_as(first, last)?;
    u16::try_from(last.checked_sub(first)?.checked_add(1)?).ok()
}

/// First and last of a span: two numbers. A date is no address.
fn ends_of(cell: &str) -> Option<(&str, &str)> {
    let (first, last) = cell.split_once(['-', '–', '…'])?;
    let last = last.trim();
    (!last.contains(['-', '–', '…']) && last.starts_with(|sign: char| sign.is_ascii_digit()))
        .then_some((first.trim(), last))
}

/// Both as numbers; the last may have its last digits only.
fn number_as(first: &str, last: &str) -> Option<(u32, u32)> {
    let number = |text: &str| wire(text).map(u32::from).or_else(|| text.parse().ok());
    let front = first.get(..first.len().saturating_sub(last.len())).unwrap_or_default();
    let is_short = last.bytes().chain(first.bytes()).all(|byte| byte.is_ascii_digit());
    Some((number(first)?, if is_short { number(&format!("{front}{last}"))? } else { number(last)? }))
}
