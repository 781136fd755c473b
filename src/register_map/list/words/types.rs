//! Types as manuals write them: by their words, each of which says a kind, a sign or a size.

use super::order_of;
use crate::{
    plant::tag::{ByteOrder, DataType},
    t,
};

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Whole,
    Float,
    Bcd,
    SignMagnitude,
}

/// Whether a number has a sign: as a word says it, or as one such as `int` has it where no other says more.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sign {
    Is(bool),
    Usual(bool),
}

const WHOLE: Option<Kind> = Some(Kind::Whole);
const FLOAT: Option<Kind> = Some(Kind::Float);
const MAGNITUDE: Option<Kind> = Some(Kind::SignMagnitude);
const SIGNED: Option<Sign> = Some(Sign::Is(true));
const UNSIGNED: Option<Sign> = Some(Sign::Is(false));
const AS_INT: Option<Sign> = Some(Sign::Usual(true));
const AS_WORD: Option<Sign> = Some(Sign::Usual(false));
/// A word of a type, and what it says: kind, sign and bits.
type Word = (&'static str, Option<Kind>, Option<Sign>, Option<u16>);

#[rustfmt::skip]
const WORDS: [Word; 48] = [
    ("unsigned", None, UNSIGNED, None), ("signed", None, SIGNED, None), ("u", None, UNSIGNED, None), ("s", None, SIGNED, None),
    ("int", WHOLE, AS_INT, None), ("integer", WHOLE, AS_INT, None), ("i", WHOLE, AS_INT, None), ("sint", WHOLE, SIGNED, None),
    ("uint", WHOLE, UNSIGNED, None), ("short", WHOLE, AS_INT, Some(16)), ("ushort", WHOLE, UNSIGNED, Some(16)), ("long", WHOLE, AS_INT, Some(32)),
    ("ulong", WHOLE, UNSIGNED, Some(32)), ("usint", WHOLE, UNSIGNED, Some(8)), ("dint", WHOLE, SIGNED, Some(32)), ("udint", WHOLE, UNSIGNED, Some(32)),
    ("lint", WHOLE, SIGNED, Some(64)), ("ulint", WHOLE, UNSIGNED, Some(64)), ("byte", WHOLE, AS_WORD, Some(8)), ("word", WHOLE, AS_WORD, Some(16)),
    ("dword", WHOLE, AS_WORD, Some(32)), ("qword", WHOLE, AS_WORD, Some(64)), ("enum", WHOLE, AS_WORD, None), ("e", WHOLE, AS_WORD, None),
    ("bitfield", WHOLE, AS_WORD, None), ("bitmap", WHOLE, AS_WORD, None), ("bitmask", WHOLE, AS_WORD, None), ("acc", WHOLE, AS_WORD, None),
    ("sunssf", WHOLE, SIGNED, Some(16)), ("float", FLOAT, None, None), ("floating", FLOAT, None, None), ("floatingpoint", FLOAT, None, None),
    ("real", FLOAT, None, None), ("f", FLOAT, None, None), ("ieee", FLOAT, None, None), ("half", FLOAT, None, Some(16)),
    ("single", FLOAT, None, Some(32)), ("double", FLOAT, None, Some(64)), ("lreal", FLOAT, None, Some(64)), ("bcd", Some(Kind::Bcd), None, None),
    ("sm", MAGNITUDE, None, None), ("magnitude", MAGNITUDE, None, None), ("8", None, None, Some(8)), ("16", None, None, Some(16)),
    ("24", None, None, Some(24)), ("32", None, None, Some(32)), ("48", None, None, Some(48)), ("64", None, None, Some(64)),
];
/// Words that say nothing, behind one of these.
const FILLERS: [(&str, &[&str]); 5] = [
    ("bit", &["8", "16", "24", "32", "48", "64"]),
    ("bits", &["8", "16", "24", "32", "48", "64"]),
    ("754", &["ieee"]),
    ("point", &["floating"]),
    ("precision", &["half", "single", "double"]),
];
/// Words that are none of a type without its size.
const SHORT: [&str; 8] = ["u", "s", "i", "e", "f", "acc", "sm", "magnitude"];

/// What the words of a type say together.
#[derive(Debug, Default)]
struct Said {
    kind: Option<Kind>,
    sign: Option<bool>,
    usual: Option<bool>,
    bits: Option<u16>,
}

impl Said {
    /// `None` where a word is not known, stands twice or says other than another.
    fn of(words: &[String]) -> Option<Said> {
        let mut said = Said::default();
        for (n, word) in words.iter().enumerate() {
            let is_behind = |behind: &[&str]| n.checked_sub(1).is_some_and(|n| behind.contains(&words[n].as_str()));
            if words[..n].contains(word) {
                return None;
            }
            if FILLERS.iter().any(|(known, behind)| known == word && is_behind(behind)) {
                continue;
            }
            let (_, kind, sign, bits) = WORDS.iter().find(|(known, ..)| known == word)?;
            match (said.kind, *kind) {
                // A whole number too, with a sign apart.
                (MAGNITUDE, WHOLE) | (WHOLE, MAGNITUDE) => said.kind = MAGNITUDE,
                (_, kind) => same(&mut said.kind, kind)?,
            }
            match sign {
                Some(Sign::Is(sign)) => same(&mut said.sign, Some(*sign))?,
                Some(Sign::Usual(sign)) => same(&mut said.usual, Some(*sign))?,
                None => {}
            }
            same(&mut said.bits, *bits)?;
        }
        let is_short = words.iter().all(|word| SHORT.contains(&word.as_str()));
        (!is_short || said.bits.is_some()).then_some(said)
    }

    /// Is it a whole number, of whatever size?
    fn is_whole(&self) -> bool {
        matches!(self.kind, None | Some(Kind::Whole)) && self.sign.or(self.usual).is_some()
    }

    /// Its type; of so many bits where it does not say how many.
    fn kind(&self, bits: Option<u16>) -> Option<DataType> {
        let is_signed = self.sign.or(self.usual);
        Some(match (self.kind, self.bits) {
            // `16 bit` alone may have a sign or none.
            (None | Some(Kind::Whole), own) => match (own.or(bits).unwrap_or(16), is_signed?) {
                (8, true) => DataType::I8,
                (8, false) => DataType::U8,
                (16, true) => DataType::I16,
                (16, false) => DataType::U16,
                (24, true) => DataType::I24,
                (24, false) => DataType::U24,
                (32, true) => DataType::I32,
                (32, false) => DataType::U32,
                (48, true) => DataType::I48,
                (48, false) => DataType::U48,
                (64, true) => DataType::I64,
                (64, false) => DataType::U64,
                _ => return None,
            },
            (Some(Kind::SignMagnitude), None | Some(16)) if is_signed != Some(false) => DataType::Sm16,
            (Some(Kind::SignMagnitude), Some(32)) if is_signed != Some(false) => DataType::Sm32,
            (Some(Kind::Bcd), None | Some(16)) if is_signed != Some(true) => DataType::Bcd16,
            (Some(Kind::Bcd), Some(32)) if is_signed != Some(true) => DataType::Bcd32,
            (Some(Kind::Float), Some(16)) if is_signed.is_none() => DataType::F16,
            (Some(Kind::Float), None | Some(32)) if is_signed.is_none() => DataType::F32,
            (Some(Kind::Float), Some(64)) if is_signed.is_none() => DataType::F64,
            (Some(Kind::SignMagnitude | Kind::Bcd | Kind::Float), _) => return None,
        })
    }
}

/// Keeps what a word says, unless another has said something else.
fn same<T: Copy + PartialEq>(known: &mut Option<T>, found: Option<T>) -> Option<()> {
    let is_other = found.is_some_and(|found| known.is_some_and(|known| known != found));
    *known = known.or(found);
    (!is_other).then_some(())
}

/// Its words in small letters, numbers apart: `unsigned`, `int`, `32`.
fn words_of(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut last = ' ';
    for sign in text.to_lowercase().chars() {
        let is_next = !last.is_alphanumeric() || last.is_ascii_digit() != sign.is_ascii_digit();
        match words.last_mut().filter(|_| !is_next) {
            Some(word) if sign.is_alphanumeric() => word.push(sign),
            None if sign.is_alphanumeric() => words.push(sign.to_string()),
            Some(_) | None => {}
        }
        // `unsignedint` is two words.
        if words.last().is_some_and(|word| word == "unsigned" || word == "signed") {
            last = ' ';
        } else {
            last = sign;
        }
    }
    words
}

/// The words of a type, and the order that stands behind them: `U32 (LSW first)`.
fn said_of(text: &str) -> Option<(Said, Option<ByteOrder>)> {
    let words = words_of(text);
    let order = (1..words.len()).find_map(|at| Some((at, order_of(&words[at..].concat())?)));
    let (end, order) = order.map_or((words.len(), None), |(at, order)| (at, Some(order)));
    Some((Said::of(&words[..end])?, order))
}

/// The type that a manual means by a word.
pub fn kind_of(text: &str) -> Option<DataType> {
    // As a profile says it, and an export: `cstring(8)`, `mod10k(2)`.
    if let Ok(kind) = text.trim().parse() {
        return Some(kind);
    }
    let word: String = text.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let text_bytes =
        ["string", "str", "char", "ascii"].iter().find_map(|prefix| word.strip_prefix(prefix)?.parse::<u8>().ok());
    if let Some(bytes) = text_bytes.filter(|bytes| (1..=DataType::TEXT_MAX).contains(bytes)) {
        return Some(DataType::Text(bytes));
    }
    if matches!(word.as_str(), "bool" | "boolean" | "bit") {
        return Some(DataType::Bool);
    }
    said_of(text).filter(|(_, order)| order.is_none())?.0.kind(None)
}

/// A type with its byte order: `FLOAT (CDAB)`; `uint32be`, `floatsw`, `int16le` as the lists of ioBroker have it; and in words.
fn ordered(text: &str) -> Option<(DataType, ByteOrder)> {
    let word = text.trim().to_lowercase();
    let suffixed = || {
        let (kind, suffix) = word.split_at_checked(word.len().checked_sub(2)?)?;
        // Apart from a type `LE` does not say which of two orders it means.
        let is_apart = kind.ends_with([' ', '_', '-', '(', ',']);
        let kind = kind_of(kind)?;
        let order = match (suffix, kind.registers()) {
            ("be", _) => ByteOrder::Abcd,
            ("le", 1) => ByteOrder::Badc,
            ("le", _) if !is_apart => ByteOrder::Dcba,
            ("sw", 2..) => ByteOrder::Cdab,
            ("sb", 2..) => ByteOrder::Badc,
            _ => return None,
        };
        Some((kind, order))
    };
    let behind = || {
        let (kind, order) = word.trim_end_matches(')').rsplit_once([' ', '(', '-', '_'])?;
        Some((kind_of(kind)?, ByteOrder::ALL.into_iter().find(|known| known.word().eq_ignore_ascii_case(order))?))
    };
    let in_words = || said_of(text).and_then(|(said, order)| Some((said.kind(None)?, order?)));
    in_words().or_else(behind).or_else(suffixed)
}

/// Is it the word of a type that says its size, which no name of a value is?
pub fn is_sized_type(text: &str) -> bool {
    let has_size = text.bytes().any(|byte| byte.is_ascii_digit());
    ordered(text).is_some() || has_size && kind_of(text).is_some()
}

/// The type and, where the word says it, the order; by the registers that it takes where the word does not say how many.
pub fn type_of(word: &str, length: Option<u16>) -> Result<(DataType, Option<ByteOrder>), String> {
    let plain: String = word.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    if matches!(plain.as_str(), "string" | "str" | "char" | "ascii" | "text" | "utf8" | "stringbe" | "stringle") {
        let bytes = length.and_then(|length| u8::try_from(length.checked_mul(2)?).ok());
        let bytes = bytes.filter(|bytes| (1..=DataType::TEXT_MAX).contains(bytes));
        let order = plain.ends_with("le").then_some(ByteOrder::Badc);
        return bytes
            .map(|bytes| (DataType::Text(bytes), order))
            .ok_or_else(|| t!("`{word}` does not say how long the text is", word));
    }
    if let Some((said, order)) = said_of(word).filter(|(said, _)| said.bits.is_none() && said.is_whole()) {
        let bits = [None, Some(16), Some(32), None, Some(64)];
        let kind = match length {
            None => said.kind(None),
            Some(length) => bits.get(usize::from(length)).copied().flatten().and_then(|bits| said.kind(Some(bits))),
        };
        let length = length.unwrap_or(1);
        return kind
            .map(|kind| (kind, order))
            .ok_or_else(|| t!("`{word}` of {length} registers is not known", word, length));
    }
    let found = kind_of(word).map(|kind| (kind, None));
    let found = found.or_else(|| ordered(word).map(|(kind, order)| (kind, Some(order))));
    let (kind, order) = found.ok_or_else(|| t!("`{word}` is not a known type", word))?;
    match length.filter(|length| *length != kind.registers()) {
        Some(length) => Err(t!("`{word}` does not take {length} registers", word, length)),
        None => Ok((kind, order)),
    }
}
