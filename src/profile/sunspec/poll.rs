//! How often a point of a SunSpec model is read.

use std::ops::RangeInclusive;

use super::{
    COMMON,
    models::{Kind, ModelPoint},
    text::Place,
};
use crate::plant::tag::DataType;

/// Models of what is measured: read often.
const MEASURED: [RangeInclusive<u16>; 10] =
    [101..=113, 160..=160, 201..=220, 302..=308, 401..=404, 501..=502, 601..=601, 701..=701, 713..=714, 802..=809];
/// Not at all.
pub(super) const NEVER: &str = "never";
/// Models up to this length are read with one request, their powers of ten with the values that they scale.
const ONE_REQUEST: u16 = 125;

/// How often a point at an address is read; `None`: slow.
pub(super) fn poll_of(point: &ModelPoint, address: u32, place: &Place) -> Option<&'static str> {
    let id = place.found.id;
    let power = place.known.get(point.scale).and_then(|(_, at)| place.found.word(*at));
    // Without a power of ten a value is none. Of one that every device has, the marker may stand for now only.
    if power == Some(0x8000) || (!point.is_mandatory && is_marked(point, address, place)) {
        return Some(NEVER);
    }
    if point.kind == Kind::Power {
        // As often as the values; where these are read with another request, they wait for it.
        return (place.found.length <= ONE_REQUEST).then_some("once");
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
        Kind::NotZero(_) | Kind::Wide | Kind::Text => all(0),
        Kind::Power => *first == 0x8000,
        Kind::Pad => true,
    }
}
