//! Raw numbers of a profile, as numbers or as patterns of bits, and what they mean to a tag.

use super::{
    diagnostic::{Problems, Span},
    reader::{At, Node, Raw, Value, wrong_type},
    type_name::TypeName,
};
use crate::plant::{
    raw_number::{BadSpan, RawNumber},
    tag::{DataType, Point},
};

/// A raw number: `-32768`, or a pattern of bits, `0x8000`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct RawPattern {
    pub number: i128,
    /// Written with `0x`, `0o` or `0b`.
    pub is_pattern: bool,
}

impl Value for RawPattern {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let number = i128::read(value, at, problems)?;
        Some(RawPattern { number, is_pattern: is_pattern(at, problems) })
    }
}

/// Is a number written as bits: with `0x`, `0o` or `0b`?
pub(super) fn is_pattern(at: Span, problems: &Problems) -> bool {
    let text = problems.text(at.source).get(at.start..at.end).unwrap_or_default();
    ["0x", "0o", "0b"].iter().any(|prefix| text.starts_with(prefix))
}

/// A raw number, or all from the first to the last: `[1001, 65535]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mark {
    first: RawPattern,
    last: RawPattern,
}

impl Value for Mark {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let Node::Array(ends) = value else {
            return RawPattern::read(value, at, problems).map(|number| Mark { first: number, last: number });
        };
        let mut end = |n: usize| {
            let Some(end) = ends.get(n).filter(|_| ends.len() == 2) else {
                return wrong_type(value, at, "the lowest and the highest of these numbers", problems);
            };
            RawPattern::read(&end.value, end.at, problems)
        };
        Some(Mark { first: end(0)?, last: end(1)? })
    }
}

/// The raw numbers that mean "no value": of every tag that has this key, or by type, for `[default]`.
#[derive(Debug, Clone)]
pub(crate) struct BadIf(pub Vec<(Option<DataType>, Vec<At<Mark>>)>);

impl Value for BadIf {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let numbers = |value: &Node, at: Span, problems: &mut Problems| match value {
            Node::Array(items) => {
                let read = items.iter().filter_map(|item| {
                    Mark::read(&item.value, item.at, problems).map(|value| At { value, at: item.at })
                });
                Some(read.collect())
            }
            _ => wrong_type(value, at, "an array of raw numbers", problems),
        };
        if let Node::Text(word) = value {
            return sunspec(word, at, problems);
        }
        let Node::Table(_) = value else { return Some(BadIf(vec![(None, numbers(value, at, problems)?)])) };
        let raw = Raw::read(value, at, problems)?;
        let mut of_type = |(word, (key, node)): (&String, &(Span, At<Node>))| {
            let TypeName(kind) = TypeName::read(&Node::Text(word.clone()), *key, problems)?;
            Some((Some(kind), numbers(&node.value, node.at, problems)?))
        };
        Some(BadIf(raw.table.iter().filter_map(&mut of_type).collect()))
    }
}

/// What each type of SunSpec holds where a point is not implemented (SunSpec device information model, data types). A float
/// holds NaN then, which is no number in any case.
const SUNSPEC: [(DataType, i128); 6] = [
    (DataType::I16, 0x8000),
    (DataType::U16, 0xFFFF),
    (DataType::I32, 0x8000_0000),
    (DataType::U32, 0xFFFF_FFFF),
    (DataType::I64, 0x8000_0000_0000_0000),
    (DataType::U64, 0xFFFF_FFFF_FFFF_FFFF),
];

/// What a number of this type holds where SunSpec has no value.
pub(crate) fn sunspec_marker(kind: DataType) -> Option<i128> {
    SUNSPEC.iter().find(|(of, _)| *of == kind).map(|(_, marker)| *marker)
}

/// The patterns of a word for them all, `"sunspec"`.
fn sunspec(word: &str, at: Span, problems: &mut Problems) -> Option<BadIf> {
    if word != "sunspec" {
        problems.add(at, format!("`{word}` stands for no raw numbers")).label("expected \"sunspec\", or an array");
        return None;
    }
    let mark = |number| {
        let pattern = RawPattern { number, is_pattern: true };
        vec![At { value: Mark { first: pattern, last: pattern }, at }]
    };
    Some(BadIf(SUNSPEC.map(|(kind, number)| (Some(kind), mark(number))).into()))
}

impl BadIf {
    /// The raw numbers of a tag. One that it can never hold is a warning, unless it is for all tags of the profile.
    pub fn of(&self, point: Point, is_default: bool, problems: &mut Problems) -> Vec<BadSpan> {
        let of_type = self.0.iter().filter(|(kind, _)| kind.is_none_or(|kind| kind == point.kind));
        let mut found = Vec::new();
        for mark in of_type.flat_map(|(_, marks)| marks) {
            let meant = [mark.value.first, mark.value.last].map(|end| point.raw_number(end.number, end.is_pattern));
            if meant.contains(&RawNumber::Impossible) && !is_default {
                let problem = problems.warn(mark.at, format!("{} never reads as this", type_of(point)));
                problem.label(held_words(point));
            }
            let [Some(first), Some(last)] = meant.map(RawNumber::number) else { continue };
            if last < first {
                let problem = problems.add(mark.at, format!("these numbers begin at {first} and end at {last}"));
                problem.label(format!("as {} reads them; expected [lowest, highest]", type_of(point)));
            }
            found.push(BadSpan { first, last });
        }
        found
    }
}

/// `an int16`, `a field of 4 bits`.
fn type_of(point: Point) -> String {
    match point.field {
        Some((_, bits)) => format!("a field of {bits} bits of {}", point.kind),
        None => format!("type {}", point.kind),
    }
}

fn held_words(point: Point) -> String {
    let bits = point.field.map_or(point.kind.bits(), |(_, bits)| bits);
    match point.raw_range() {
        Some((low, high)) if low < 0 => {
            format!("it holds {low} to {high}, as patterns 0 to 0x{:X}", (1_i128 << bits) - 1)
        }
        Some((low, high)) => format!("it holds {low} to {high}"),
        None => format!("expected a number that it can hold, or a pattern of {bits} bits such as 0x7FC00000"),
    }
}
