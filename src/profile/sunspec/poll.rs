//! How often a point of a SunSpec model is read.

use std::ops::RangeInclusive;

use super::{
    COMMON,
    models::{Kind, ModelPoint},
    text::Place,
};
use crate::plant::{def::READ_REGISTERS_MAX, tag::DataType};

/// Models of what is measured: read often.
const MEASURED: [RangeInclusive<u16>; 10] =
    [101..=113, 160..=160, 201..=220, 302..=308, 401..=404, 501..=502, 601..=601, 701..=701, 713..=714, 802..=809];
/// Not at all.
pub(super) const NEVER: &str = "never";

/// How often a point at an address is read; `None`: slow.
pub(super) fn poll_of(point: &ModelPoint, address: u32, place: &Place) -> Option<&'static str> {
    let id = place.found.id;
    let power = place.known.get(point.scale).and_then(|(_, at)| place.found.word(*at));
    // A value without its power of ten is none. One that every device has may hold the marker for a while, as at night.
    if power == Some(0x8000) || (!point.is_mandatory && is_marked(point, address, place)) {
        return Some(NEVER);
    }
    if point.kind == Kind::Power {
        // In a model of one request it is read with the values that it scales; in a longer one it may be in another request, and is
        // read as often.
        return (place.found.length <= READ_REGISTERS_MAX).then_some("once");
    }
    if (point.is_static || id == COMMON) && point.scale.is_empty() {
        return Some("once");
    }
    let is_measured = !point.is_static && !point.is_writable && MEASURED.iter().any(|range| range.contains(&id));
    is_measured.then_some("fast")
}

/// Does it hold the marker of its type for what is not implemented?
fn is_marked(point: &ModelPoint, address: u32, place: &Place) -> bool {
    let words: Option<Vec<u16>> = (0..u32::from(point.registers)).map(|n| place.found.word(address + n)).collect();
    let Some((first, rest)) = words.as_deref().and_then(<[u16]>::split_first) else { return false };
    let all = |word: u16| *first == word && rest.iter().all(|other| *other == word);
    match point.kind {
        Kind::Number(DataType::I16 | DataType::I32 | DataType::I64) => {
            *first == 0x8000 && rest.iter().all(|word| *word == 0)
        }
        Kind::Number(DataType::F32 | DataType::F64) => first & 0x7FC0 == 0x7FC0,
        Kind::Number(_) | Kind::Enum(_) | Kind::Bits(_) => all(u16::MAX),
        // It may count, or be set, from now on.
        Kind::NotZero(_) => false,
        Kind::Address(_) | Kind::Text => all(0),
        Kind::Power => *first == 0x8000,
        Kind::Pad => true,
    }
}
