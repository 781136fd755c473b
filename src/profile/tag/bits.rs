//! Fields of bits in a register, and the names of numbers and bits.

use super::Raws;
use crate::{
    plant::{
        exact::Exact,
        number::to_u8,
        raw_number::RawNumber,
        tag::{DataType, Point, Table},
    },
    profile::{
        diagnostic::{Problems, Span},
        reader::{At, Choice, Numbered},
        schema::TagTable,
    },
};

/// `"5-4"` or `3`: lowest bit and number of bits.
pub(super) fn bit_field(
    field: &At<Choice>,
    (kind, kind_at): (DataType, Option<Span>),
    table: Table,
    problems: &mut Problems,
) -> Option<(u8, u8)> {
    let is_whole = !table.is_bits() && (kind.is_binary() || kind == DataType::Bool);
    if !is_whole {
        let found = if table.is_bits() { format!("a {}", table.word()) } else { format!("type {kind}") };
        let problem = problems.add(kind_at.unwrap_or(field.at), format!("{found} has no field of bits"));
        problem.label("expected a whole number in a register, such as uint16, or int16 where the field has a sign");
        problem.also(field.at, "the field");
        return None;
    }
    let bounds = match &field.value {
        Choice::Number(bit) if bit.as_whole().is_some_and(|bit| (0..64).contains(&bit)) => {
            Some((to_u8(bit.near()), to_u8(bit.near())))
        }
        Choice::Number(_) | Choice::Flag(_) => None,
        Choice::Word(word) => match word.split_once('-') {
            Some((high, low)) => high.trim().parse().ok().zip(low.trim().parse().ok()),
            None => word.trim().parse().ok().map(|bit: u8| (bit, bit)),
        },
    };
    let size = u16::from(kind.bits());
    let valid = bounds.filter(|(high, low)| low <= high && u16::from(*high) < size);
    if valid.is_none() {
        let problem = problems.add(field.at, "this is not a field of bits");
        problem.label(format!("expected \"HIGH-LOW\" or one bit, 0 to {} of a whole number", size - 1));
    }
    valid.map(|(high, low)| (low, high - low + 1))
}

/// The names of raw numbers. A number of a signed register may be written as its pattern of bits.
pub(super) fn enum_labels(row: &TagTable, point: Option<Point>, problems: &mut Problems) -> Vec<(i128, String)> {
    let Some(Numbered(rows)) = row.enum_labels.as_ref().map(|labels| &labels.value) else { return Vec::new() };
    let mut labels: Vec<(i128, String)> = Vec::new();
    for (number, text) in rows {
        let meant =
            point.map_or(RawNumber::Is(Exact::whole(number.value)), |point| point.raw_number(number.value, false));
        if let (RawNumber::Impossible, Some((low, high))) = (meant, point.and_then(Point::raw_range)) {
            let problem =
                problems.add(number.at, format!("enum value {} ({text}) does not fit the type", number.value));
            problem.label(format!("the type holds {low} to {high}"));
        }
        let meant = meant.number().and_then(Exact::as_whole).unwrap_or(number.value);
        if labels.iter().any(|(other, _)| *other == meant) {
            problems.add(number.at, format!("enum value {} is {meant} once more", number.value)).label("again");
        }
        labels.push((meant, text.clone()));
    }
    labels.sort_by_key(|(number, _)| *number);
    labels
}

pub(super) fn bit_labels(
    bits: &Option<At<Numbered>>,
    kind: Option<Raws>,
    problems: &mut Problems,
) -> Vec<(u8, String)> {
    named_bits(bits.as_ref(), kind.map_or(64, |(kind, field)| field.unwrap_or(kind.bits()).into()), problems)
}

/// The names of bits of a word of this many.
pub(in crate::profile) fn named_bits(
    bits: Option<&At<Numbered>>,
    size: i128,
    problems: &mut Problems,
) -> Vec<(u8, String)> {
    let Some(Numbered(rows)) = bits.map(|bits| &bits.value) else { return Vec::new() };
    let mut labels = Vec::new();
    for (bit, text) in rows {
        match u8::try_from(bit.value).ok().filter(|_| bit.value < size) {
            Some(number) => labels.push((number, text.clone())),
            None => {
                let problem = problems.add(bit.at, format!("there is no bit {}", bit.value));
                problem.label(format!("expected 0 to {}", size - 1));
            }
        }
    }
    labels
}
