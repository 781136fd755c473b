//! Small files of each form, with what is taken of them and what is not.

mod codes;
mod configurations;
mod doubtful;
mod esphome;
mod exports;
mod foreign_columns;
mod foreign_places;
mod foreign_cells;
mod foreign_words;
mod headings;
mod iobroker;
mod meanings;
mod misread;
mod odd;
mod older;
mod profiles;
mod tables;

use super::{
    list::{List, ListContext},
    named::Named,
};
use crate::plant::tag::Access;

/// What a file gives: a line for each row.
fn read(text: &str) -> (Vec<String>, Vec<String>) {
    let list = list_of(text);
    assert_eq!(list.refused, None, "{text}");
    (list.named.iter().map(shown).collect(), list.problems)
}

fn list_of(text: &str) -> List {
    super::read(text.as_bytes(), &ListContext::default())
}

/// `40006 SV int16 ABCD 0.1 °C`, and what few rows have.
fn shown(named: &Named) -> String {
    let field = named.field.map_or(String::new(), |(low, width)| format!("[{low}+{width}]"));
    let mut words = vec![
        named.table.modicon(named.address),
        named.name.clone(),
        format!("{}{field}", named.kind),
        named.order.word().to_owned(),
        format!("x{}", named.scale),
    ];
    words.extend((named.offset != 0.0).then(|| format!("{:+}", named.offset)));
    words.extend((!named.unit.is_empty()).then(|| named.unit.clone()));
    let labels = named.enum_labels.iter().map(|(number, label)| format!("{number}={label}"));
    words.extend(labels);
    words.extend(named.bit_labels.iter().map(|(bit, label)| format!("#{bit}={label}")));
    words.extend(named.bad_if.iter().map(|bad| match bad.single() {
        Some(bad) => format!("!{bad}"),
        None => format!("!{}..{}", bad.first, bad.last),
    }));
    words.extend((named.access != Access::Read).then(|| named.access.word().to_owned()));
    words.extend(named.min.map(|min| format!("min{min}")));
    words.extend(named.max.map(|max| format!("max{max}")));
    words.extend(named.write_at.map(|(table, address)| format!("->{}", table.modicon(address))));
    words.extend(named.write_fc.map(|function| format!("fc{function}")));
    words.extend(named.power_at.map(|at| format!("^{at}")));
    words.join(" ")
}
