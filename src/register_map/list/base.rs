//! How the numbers of a list count: from 0, from 1, or as those of Modicon.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    ListContext,
    columns::first_of,
    row::{Row, differ},
};
use crate::plant::{
    address::{AddressBase, AddressContext, of_modicon, wire},
    tag::Table,
};

/// The first address of a list that can be read in two ways.
#[derive(Debug, Clone, PartialEq)]
pub struct Unclear {
    /// As written.
    pub written: String,
    /// How its digits may count, and the address that they then are.
    pub readings: [(AddressBase, (Table, u16)); 2],
}

/// The first number of a list of ioBroker whose numbers are too great for registers, as that program shows them: with 40001
/// or 30001 added. `None` where its numbers are those of registers, or prove nothing.
pub fn alias_of(rows: &[Row], context: &ListContext) -> Option<(Table, u32)> {
    let numbers =
        || rows.iter().filter(|row| row.is_register).filter_map(|row| row.address.as_ref()?.parse::<u32>().ok());
    let is_aliased = numbers().any(|number| u32::from(u16::MAX) < number);
    if !is_aliased || matches!(context.base, Some(AddressBase::Zero | AddressBase::One)) {
        return None;
    }
    let least = numbers().min()?;
    [(Table::Holding, 40_001), (Table::Input, 30_001)].into_iter().find(|(_, first)| *first <= least)
}

/// Is one of its numbers, if it counted as Modicon's do, that of a bit, although it is a register?
pub fn is_sent(rows: &[Row]) -> bool {
    let is_bit = |text: &String| text.len() == 5 && of_modicon(text).is_some_and(|(table, _)| table.is_bits());
    rows.iter().any(|row| row.is_register && row.address.as_ref().is_some_and(is_bit))
}

/// Gives the coils of a list of Modicon numbers the base from which they count, where they have lost the leading 0 of theirs:
/// every other number is one of Modicon, and none of theirs is 0. In a list that does not say that its numbers are those,
/// `is_modicon`, six digits do.
pub fn assign_to_coils(rows: &mut [Row], is_modicon: bool) {
    let number = |row: &Row| {
        let text = first_of(row.address.as_deref()?);
        Some(text.to_owned()).filter(|text| text.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let is_coil = |row: &Row| row.table == Some(Table::Coil) && row.base.is_none();
    let fits = |row: &Row| match number(row) {
        Some(text) if is_coil(row) => text.parse::<u32>().is_ok_and(|number| (1..=65_536).contains(&number)),
        Some(text) => {
            of_modicon(&text).is_some_and(|(table, _)| text.len() == 6 || row.table.is_none_or(|of| of == table))
        }
        None => true,
    };
    let others = || rows.iter().filter(|row| !is_coil(row)).filter_map(number);
    let is_proof = others().any(|text| is_modicon || text.len() == 6) && rows.iter().all(fits);
    rows.iter_mut()
        .filter(|row| is_proof && is_coil(row) && number(row).is_some())
        .for_each(|row| row.base = Some(AddressBase::One));
}

/// How the plain numbers of a list count: as its reader has said, else as its own numbers prove; else it is unclear. Each is
/// given as written, with the table that its row states.
pub fn base_of(written: &[(&str, Option<Table>)], context: &ListContext) -> (AddressBase, Option<Unclear>) {
    if let Some(base) = context.base {
        return (base, None);
    }
    let is_plain = |text: &str| text.len() == 5 && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_of_other =
        |text: &str, of: Option<Table>| of_modicon(text).is_some_and(|(table, _)| of.is_some_and(|of| of != table));
    // 16299 is no Modicon number of a holding register, but that of a coil without its leading 0. One of no table at all, such
    // as 50001, proves nothing of others.
    let is_short =
        |(text, of): &(&str, Option<Table>)| *of == Some(Table::Coil) && is_plain(text) && is_of_other(text, *of);
    let is_sent = written.iter().any(|one| is_plain(one.0) && is_of_other(one.0, one.1) && !is_short(one));
    let two = |bases: [AddressBase; 2], (text, of): &(&str, Option<Table>)| {
        let read = |base| {
            let place =
                AddressContext { table: of.unwrap_or(context.table), is_stated: of.is_some(), base }.parse(text);
            Some((base, place?))
        };
        let readings = [read(bases[0])?, read(bases[1])?];
        (readings[0].1 != readings[1].1).then(|| Unclear { written: (*text).to_owned(), readings })
    };
    let short = || {
        let mut all = written.iter().filter(|one| is_short(one));
        all.find_map(|one| two([AddressBase::One, AddressBase::Zero], one))
    };
    // Six digits are too many for what is sent.
    let is_modicon = written.iter().any(|(text, _)| text.len() == 6 && of_modicon(text).is_some());
    match (is_sent, is_modicon) {
        (true, false) => return (AddressBase::Zero, None),
        (false, true) => return (AddressBase::Modicon, short()),
        (true, true) | (false, false) => {}
    }
    let unclear = written.iter().find_map(|one| two([AddressBase::Modicon, AddressBase::Zero], one));
    // `0001` of an area is often its first register, unless there is one before it.
    let is_padded = |text: &str| text.len() == 4 && text.starts_with('0') && text.bytes().all(|b| b.is_ascii_digit());
    let has_first = written.iter().any(|(text, _)| is_padded(text) && text.parse() == Ok(0));
    let mut padded = written.iter().filter(|(text, _)| is_padded(text) && !has_first);
    let padded = padded.find_map(|one| two([AddressBase::One, AddressBase::Zero], one));
    (AddressBase::Modicon, unclear.or_else(short).or(padded))
}

/// How the plain numbers of a list are read: as those of Modicon only where one of them is such a number.
pub fn read_as(written: &[(&str, Option<Table>)], base: AddressBase) -> Option<AddressBase> {
    let is_plain = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let mut plain = written.iter().filter(|(text, _)| is_plain(text)).peekable();
    plain.peek()?;
    let is_modicon =
        |(text, of): &(&str, Option<Table>)| of_modicon(text).is_some_and(|(table, _)| of.is_none_or(|of| of == table));
    Some(match base {
        AddressBase::Modicon if !plain.any(is_modicon) => AddressBase::Zero,
        base => base,
    })
}

/// The rows below a heading whose addresses differ by another number than those of the others.
pub fn contradicting(rows: &mut [Row]) {
    let number = |text: &String| -> Option<[i64; 2]> {
        let text = first_of(text);
        let written = wire(text).map(i64::from).or_else(|| text.parse().ok())?;
        Some([written, of_modicon(text).map_or(written, |(_, address)| address.into())])
    };
    let differences = |row: &Row| -> Vec<i64> {
        let [first, second, ..] = row.addresses.as_slice() else { return Vec::new() };
        let (Some(first), Some(second)) = (number(first), number(second)) else { return Vec::new() };
        let all = first.into_iter().flat_map(|first| second.map(|second| second - first));
        all.collect::<BTreeSet<_>>().into_iter().collect()
    };
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    rows.iter().flat_map(differences).for_each(|one| *counts.entry(one).or_default() += 1);
    let usual = counts.iter().max_by_key(|(one, count)| (**count, std::cmp::Reverse(one.abs()))).map(|(one, _)| *one);
    for row in rows {
        let all = differences(row);
        if usual.is_some_and(|usual| !all.is_empty() && !all.contains(&usual)) {
            let (other, cell) = (&row.addresses[0], &row.addresses[1]);
            row.wrong.get_or_insert(differ(other, cell));
        }
    }
}
