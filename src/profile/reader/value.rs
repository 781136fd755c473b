//! What a TOML value can become: numbers, texts, times, and a few forms of the format.

use std::time::Duration;

use jiff::{SignedDuration, civil::Time};

use super::{At, Node, Raw, Value};
use crate::{
    plant::exact::Exact,
    profile::diagnostic::{Problems, Span},
};

impl Value for Raw {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Table(table) => Some(Raw { at, table: table.clone() }),
            _ => wrong_type(value, at, "a table", problems),
        }
    }
}

impl Value for String {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Text(text) => Some(text.clone()),
            _ => wrong_type(value, at, "a string", problems),
        }
    }
}

impl Value for bool {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Flag(flag) => Some(*flag),
            _ => wrong_type(value, at, "true or false", problems),
        }
    }
}

impl Value for f64 {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let number = Exact::read(value, at, problems)?;
        let is_rounded = number.is_rounded();
        if is_rounded {
            let problem = problems.add(at, format!("{number} has more digits than are kept here"));
            problem.label(format!("the nearest that can be kept is {:.0}", number.near()));
        }
        Some(number.near()).filter(|_| !is_rounded)
    }
}

/// With all its digits.
impl Value for Exact {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let number = match value {
            Node::Whole(number) => Exact::whole(*number),
            Node::Number(number) => *number,
            Node::Text(_) | Node::Flag(_) | Node::Time(_) | Node::Array(_) | Node::Table(_) => {
                return wrong_type(value, at, "a number", problems);
            }
        };
        if !number.is_finite() {
            problems.add(at, "not a usable number").label("expected a finite number");
        }
        Some(number).filter(|number| number.is_finite())
    }
}

/// Whole numbers, with their range in the message.
macro_rules! whole {
    ($($type:ty),*) => { $(
        impl Value for $type {
            fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
                let expected = format!("a whole number from {} to {}", <$type>::MIN, <$type>::MAX);
                let Node::Whole(number) = value else { return wrong_type(value, at, &expected, problems) };
                let parsed = <$type>::try_from(*number).ok();
                if parsed.is_none() {
                    problems.add(at, format!("{number} is out of range")).label(format!("expected {expected}"));
                }
                parsed
            }
        }
    )* };
}
whole!(u8, u16, u32, u64, i64, i128);

impl Value for Duration {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        const FORM: &str = "a duration such as \"500ms\", \"10s\", \"5 min\" or \"1h 30m\"";
        let Node::Text(text) = value else { return wrong_type(value, at, FORM, problems) };
        let usable = duration(text);
        if usable.is_none() {
            problems
                .add(at, format!("`{text}` is not a duration"))
                .label("not understood")
                .help(format!("write {FORM}"));
        }
        usable
    }
}

/// A time from its text. A hundred days is beyond every use, and keeps sums of times far from overflow.
pub(crate) fn duration(text: &str) -> Option<Duration> {
    let duration = Duration::try_from(text.parse::<SignedDuration>().ok()?).ok()?;
    (duration <= Duration::from_secs(100 * 86_400)).then_some(duration)
}

impl Value for Time {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let text = match value {
            Node::Text(text) | Node::Time(text) => text,
            _ => return wrong_type(value, at, "a time of day such as \"06:00\"", problems),
        };
        let time = text.parse().ok();
        if time.is_none() {
            problems.add(at, format!("`{text}` is not a time of day")).label("expected \"06:00\"");
        }
        time
    }
}

/// An array of exactly two.
impl<T: Value + Copy> Value for [T; 2] {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let pair = match value {
            Node::Array(array) if array.len() == 2 => array,
            _ => return wrong_type(value, at, "an array of two", problems),
        };
        let mut both = pair.iter().map(|item| T::read(&item.value, item.at, problems));
        let (first, second) = (both.next()?, both.next()?);
        Some([first?, second?])
    }
}

/// A table with numbers for keys: `{ 0 = "STOP", 1 = "RUN" }`.
#[derive(Debug, Clone)]
pub(crate) struct Numbered(pub Vec<(At<i128>, String)>);

impl Value for Numbered {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let raw = Raw::read(value, at, problems)?;
        let mut rows = Vec::new();
        for (word, (at, text)) in &raw.table {
            let hex = word.strip_prefix("0x").and_then(|digits| i128::from_str_radix(digits, 16).ok());
            match hex.or_else(|| word.parse().ok()) {
                Some(value) => {
                    let text = String::read(&text.value, text.at, problems);
                    rows.extend(text.map(|text| (At { value, at: *at }, text)));
                }
                None => {
                    problems.add(*at, format!("`{word}` is not a whole number")).label("expected 0 = \"…\", 1 = \"…\"");
                }
            }
        }
        rows.sort_by_key(|(number, _)| number.value);
        Some(Numbered(rows))
    }
}

/// A string, or an array of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Texts(pub Vec<At<String>>);

impl Value for Texts {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let mut text = |value: &Node, at| String::read(value, at, problems).map(|value| At { value, at });
        Some(Texts(match value {
            Node::Array(array) => array.iter().filter_map(|item| text(&item.value, item.at)).collect(),
            _ => text(value, at).into_iter().collect(),
        }))
    }
}

/// A number, or what stands for one: a word (`value = "RUN"`), or `true` and `false` for 1 and 0 of two states.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Choice {
    Number(Exact),
    Flag(bool),
    Word(String),
}

impl Value for Choice {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Text(word) => Some(Choice::Word(word.clone())),
            Node::Flag(flag) => Some(Choice::Flag(*flag)),
            Node::Whole(_) | Node::Number(_) => Exact::read(value, at, problems).map(Choice::Number),
            Node::Time(_) | Node::Array(_) | Node::Table(_) => wrong_type(value, at, "a number or a word", problems),
        }
    }
}

pub(crate) fn wrong_type<T>(value: &Node, at: Span, expected: &str, problems: &mut Problems) -> Option<T> {
    let found = match value {
        Node::Text(_) => "a string",
        Node::Whole(_) => "a whole number",
        Node::Number(_) => "a number with a point",
        Node::Flag(_) => "true or false",
        Node::Time(_) => "a date or time",
        Node::Array(_) => "an array",
        Node::Table(_) => "a table",
    };
    problems.add(at, format!("found {found}, expected {expected}")).label(format!("expected {expected}"));
    None
}
