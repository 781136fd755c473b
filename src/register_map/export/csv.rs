//! A list with a heading.

use super::{Exported, decimals};
use crate::plant::tag::{Bound, TagDef};

const HEADING: [&str; 16] = [
    "address",
    "table",
    "name",
    "type",
    "byte order",
    "field",
    "scale",
    "offset",
    "decimals",
    "unit",
    "access",
    "min",
    "max",
    "enum",
    "bits",
    "bad if",
];

/// Writes it: addresses are as they are sent, and say so.
pub fn write(tags: &[&TagDef], exported: &mut Exported) {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // A vector takes everything.
    let _ = writer.write_record(HEADING.iter().chain(&["group"]));
    for tag in tags {
        let _ = writer.write_record(row(tag));
        exported.count += 1;
        exported.lose(
            tag,
            &[
                (tag.quality_from.is_some(), "its quality from another tag"),
                (tag.unit_from.is_some(), "its unit from another tag"),
                (tag.write_at.is_some(), "where it is written"),
                (tag.write_unlock.is_some(), "what unlocks it"),
                (is_open(tag.min) || is_open(tag.max), "limits from another tag"),
                (tag.write_fc.is_some(), "the function that writes it"),
            ],
        );
    }
    let bytes = writer.into_inner().unwrap_or_default();
    exported.text = String::from_utf8_lossy(&bytes).into_owned();
}

fn is_open(bound: Option<Bound>) -> bool {
    matches!(bound, Some(bound) if !matches!(bound, Bound::Fixed(_)))
}

fn row(tag: &TagDef) -> Vec<String> {
    let point = tag.point;
    let number = |usual: f64, number: f64| if number == usual { String::new() } else { number.to_string() };
    let labels = |all: Vec<(i128, &String)>| {
        // What would end a label stands for itself in no list.
        let label = |(number, text): (i128, &String)| format!("{number}={}", text.replace([';', '\n'], ","));
        all.into_iter().map(label).collect::<Vec<_>>().join("; ")
    };
    let field = point.field.map_or(String::new(), |(low, width)| match width {
        1 => low.to_string(),
        _ => format!("{}-{low}", low + width - 1),
    });
    let bound = |bound: Option<Bound>| match bound {
        Some(Bound::Fixed(value)) => value.to_string(),
        Some(_) | None => String::new(),
    };
    let is_number = !tag.is_text();
    vec![
        format!("{}:{}", point.table.word(), point.address),
        point.table.word().to_owned(),
        tag.short.clone(),
        if point.table.is_bits() { "bool".to_owned() } else { point.kind.to_string() },
        if point.table.is_bits() { String::new() } else { point.order.word().to_owned() },
        field,
        number(1.0, tag.scale),
        number(0.0, tag.offset),
        if is_number { decimals(tag).to_string() } else { String::new() },
        tag.unit.clone(),
        tag.access.word().to_owned(),
        bound(tag.min),
        bound(tag.max),
        labels(tag.enum_labels.iter().map(|(number, text)| (*number, text)).collect()),
        labels(tag.bit_labels.iter().map(|(bit, text)| (i128::from(*bit), text)).collect()),
        tag.bad_if.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "),
        tag.group.clone(),
    ]
}
