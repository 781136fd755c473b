//! The numbers of a row: scale, bounds and normal band against each other and against what the register can hold.

use super::{
    super::{
        diagnostic::Problems,
        reader::{At, OptionalKey},
        schema::TagTable,
    },
    Raws,
};
use crate::plant::{
    exact::Exact,
    scale::scaled,
    tag::{Decimals, TagDef},
};

/// Checks scale and bounds against each other and against what the raw type can hold.
pub(super) fn check_scaling(row: &TagTable, kind: Option<Raws>, decimals: Decimals, problems: &mut Problems) {
    if let Some(scale) = row.scale.filter(|scale| scale.value == 0.0) {
        problems.add(scale.at, "a scale of 0 makes every value 0").label("expected a number other than 0");
        return;
    }
    if let Some(deadband) = row.deadband.filter(|deadband| deadband.value < 0.0) {
        problems.add(deadband.at, "a deadband cannot be negative").label("expected 0 or more");
    }
    if let (Some(min), Some(max)) = (row.min, row.max)
        && min.value >= max.value
    {
        problems
            .add(max.at, format!("max {} is not above min {}", max.value, min.value))
            .label("too low")
            .also(min.at, "min");
    }
    check_normal(row, problems);
    let (Some(kind), Decimals::Fixed(_)) = (kind, decimals) else { return };
    let scale = row.scale.value_or(1.0);
    let offset = row.offset.value_or(0.0);
    let Some((low, high)) = value_range(kind, scale, offset) else { return };
    for (bound, word) in [(row.min, "min"), (row.max, "max")] {
        let Some(bound) = bound.filter(|bound| bound.value < low || bound.value > high) else { continue };
        let problem = problems.add(bound.at, format!("{word} {} is outside what the register can hold", bound.value));
        problem.label(format!("it holds {low} to {high}"));
    }
}

/// The normal band is a range, and lies within the bounds that are numbers.
fn check_normal(row: &TagTable, problems: &mut Problems) {
    let Some(At { value: [low, high], at }) = row.normal else { return };
    if high <= low {
        problems.add(at, format!("the normal band ends at {high} and begins at {low}")).label("expected [low, high]");
        return;
    }
    if let Some(min) = row.min.filter(|min| min.value > Exact::from(low)) {
        let problem = problems.add(at, format!("the normal band begins below min {}", min.value));
        problem.label("expected it between min and max").also(min.at, "min");
    }
    if let Some(max) = row.max.filter(|max| max.value < Exact::from(high)) {
        let problem = problems.add(at, format!("the normal band ends above max {}", max.value));
        problem.label("expected it between min and max").also(max.at, "max");
    }
}

/// What a tag can hold at all, in its unit; `None` if its decimals come from the device or it is a float.
pub(in crate::profile) fn range_of(tag: &TagDef) -> Option<(Exact, Exact)> {
    let kind = (tag.point.kind, tag.point.field.map(|(_, bits)| bits));
    match tag.decimals {
        Decimals::Fixed(_) => value_range(kind, tag.scale, tag.offset),
        Decimals::From(_) | Decimals::PowerFrom(_) => None,
    }
}

fn value_range(kind: Raws, scale: f64, offset: f64) -> Option<(Exact, Exact)> {
    let (low, high) = raw_range(kind)?;
    let held = |raw: i128| {
        let value = scaled(Exact::whole(raw), scale, offset, 0);
        value.rest().map_or_else(|| ((value.near() * 1e6).round() / 1e6).into(), |_| value)
    };
    let (a, b) = (held(low), held(high));
    Some(if a < b { (a, b) } else { (b, a) })
}

pub(super) fn raw_range((kind, field): Raws) -> Option<(i128, i128)> {
    kind.raw_range(field)
}
