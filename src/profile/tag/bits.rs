//! Fields of bits in a register, and the names of numbers and bits.

use super::{Raws, scaling::raw_range};
use crate::{
    plant::{
        number::to_u8,
        tag::{DataType, Table},
    },
    profile::{
        diagnostic::Problems,
        reader::{At, Choice, Numbered},
        schema::TagTable,
    },
};

/// `"5-4"` or `3`: lowest bit and number of bits.
pub(super) fn bit_field(field: &At<Choice>, kind: DataType, table: Table, problems: &mut Problems) -> Option<(u8, u8)> {
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
    let size = kind.registers() * 16;
    let whole = !table.is_bits() && (kind.is_binary() || kind == DataType::Bool);
    let valid = bounds.filter(|(high, low)| low <= high && u16::from(*high) < size && whole);
    if valid.is_none() {
        let problem = problems.add(field.at, "this is not a field of bits");
        problem.label(format!("expected \"HIGH-LOW\" or one bit, 0 to {} of a whole number", size - 1));
    }
    valid.map(|(high, low)| (low, high - low + 1))
}

pub(super) fn enum_labels(row: &TagTable, kind: Option<Raws>, problems: &mut Problems) -> Vec<(i128, String)> {
    let Some(Numbered(rows)) = row.enum_labels.as_ref().map(|labels| &labels.value) else { return Vec::new() };
    let range = kind.and_then(raw_range);
    for (number, text) in rows {
        let outside = range.filter(|(low, high)| !(low..=high).contains(&&number.value));
        if let Some((low, high)) = outside {
            let problem =
                problems.add(number.at, format!("enum value {} ({text}) does not fit the type", number.value));
            problem.label(format!("the type holds {low} to {high}"));
        }
    }
    rows.iter().map(|(number, text)| (number.value, text.clone())).collect()
}

pub(super) fn bit_labels(
    bits: &Option<At<Numbered>>,
    kind: Option<Raws>,
    problems: &mut Problems,
) -> Vec<(u8, String)> {
    named_bits(
        bits.as_ref(),
        kind.map_or(64, |(kind, field)| field.map_or(i128::from(kind.registers()) * 16, i128::from)),
        problems,
    )
}

/// The names of bits of a word of so many.
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
