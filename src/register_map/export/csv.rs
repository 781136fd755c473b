//! A list with a heading.

use super::{Exported, decimals};
use crate::{
    plant::{
        raw_number::BadSpan,
        role::Role,
        tag::{Access, Bound, Point, TagDef},
    },
    register_map::list::{
        Column, cells,
        headings::OWN,
        words::{labels_text, poll_text},
    },
};

/// `-32768`, `1001..65535`.
fn bad_text(point: Point, bad: BadSpan) -> String {
    match bad.single() {
        Some(bad) => point.raw_text(bad),
        None => format!("{}..{}", point.raw_text(bad.first), point.raw_text(bad.last)),
    }
}

/// Writes it: addresses are as they are sent, and say so.
pub fn write(tags: &[&TagDef], exported: &mut Exported) {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // A vector takes everything.
    let _ = writer.write_record(OWN.map(|(_, word)| word));
    for tag in tags {
        let _ = writer.write_record(OWN.map(|(column, _)| cells::as_text(cell(tag, column))));
        exported.count += 1;
        exported.lose(
            tag,
            &[
                (tag.quality_from.is_some(), "its quality from another tag"),
                (tag.when.is_some(), "when the device has it"),
                (tag.unit_from.is_some(), "its unit from another tag"),
                (tag.writable() && !is_kept(tag), "writing it, which needs more than a list can say"),
                (is_open(tag.min) || is_open(tag.max), "limits from another tag"),
                (tag.confirm.is_some(), "the question before it is written"),
                (tag.role != Role::Technician || tag.reauthenticate.is_some(), "who may write it"),
                (!tag.meaning.is_empty(), "what it means"),
                (tag.normal.is_some(), "where it usually lies"),
                (tag.counter.is_some() || tag.modulus.is_some() || tag.max_rate.is_some(), "how it counts"),
            ],
        );
    }
    let bytes = writer.into_inner().unwrap_or_default();
    exported.text = String::from_utf8_lossy(&bytes).into_owned();
}

fn is_open(bound: Option<Bound>) -> bool {
    matches!(bound, Some(bound) if !matches!(bound, Bound::Fixed(_)))
}

/// Can a list say all that keeps a write from doing something else?
fn is_kept(tag: &TagDef) -> bool {
    tag.write_unlock.is_none() && !is_open(tag.min) && !is_open(tag.max)
}

fn cell(tag: &TagDef, column: Column) -> String {
    let point = tag.point;
    let number = |usual: f64, number: f64| if number == usual { String::new() } else { number.to_string() };
    let bound = |bound: Option<Bound>| match bound {
        Some(Bound::Fixed(value)) => value.to_string(),
        Some(_) | None => String::new(),
    };
    let is_written = tag.writable() && is_kept(tag);
    match column {
        Column::Address => format!("{}:{}", point.table.word(), point.address),
        Column::Table => point.table.word().to_owned(),
        Column::Name => tag.short.clone(),
        Column::Label => tag.label.clone(),
        Column::Type if point.table.is_bits() => "bool".to_owned(),
        Column::Type => point.kind.to_string(),
        Column::Order if point.table.is_bits() => String::new(),
        Column::Order => point.order.word().to_owned(),
        Column::Field => point.field.map_or(String::new(), |(low, width)| match width {
            1 => low.to_string(),
            _ => format!("{}-{low}", low + width - 1),
        }),
        Column::Scale => number(1.0, tag.scale),
        Column::Offset => number(0.0, tag.offset),
        Column::Decimals if tag.is_text() => String::new(),
        Column::Decimals => decimals(tag).to_string(),
        // One that the device chooses is none of the file.
        Column::Unit if tag.unit_from.is_some() => String::new(),
        Column::Unit => tag.unit.clone(),
        Column::Access => if is_written { tag.access } else { Access::Read }.word().to_owned(),
        Column::Min => bound(tag.min),
        Column::Max => bound(tag.max),
        Column::Labels => labels_text(tag.enum_labels.iter().map(|(number, text)| (*number, text.as_str()))),
        Column::Bits => labels_text(tag.bit_labels.iter().map(|(bit, text)| (i128::from(*bit), text.as_str()))),
        Column::Bad => tag.bad_if.iter().map(|bad| bad_text(point, *bad)).collect::<Vec<_>>().join(" "),
        Column::Group => tag.group.clone(),
        Column::WriteAt => match tag.write_at.filter(|_| is_written) {
            Some((table, address)) => format!("{}:{address}", table.word()),
            None => String::new(),
        },
        Column::WriteWith => tag.write_fc.filter(|_| is_written).map_or(String::new(), |function| function.to_string()),
        // What is usual depends on the profile.
        Column::Poll => poll_text(tag.poll),
        // Said otherwise.
        Column::HexAddress
        | Column::Signed
        | Column::Length
        | Column::Bytes
        | Column::Width
        | Column::Divisor
        | Column::Exponent
        | Column::Places
        | Column::Area
        | Column::Device
        | Column::Formula => String::new(),
    }
}
