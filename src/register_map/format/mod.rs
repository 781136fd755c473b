//! One file a form, and what their rows have in common.

pub mod esphome;
pub mod foreign;
pub mod home_assistant;
pub mod local_gateway;
pub mod modbusscope;
pub mod modmaster;
pub mod mtui;
pub mod solarman;
pub mod sunspec;
pub mod telegraf;
pub mod wiren_board;

use super::{
    container::node::{Node, Tree},
    list::List,
    named::Named,
};
use crate::{
    plant::{
        exact::Exact,
        number::to_u8,
        raw_number::BadSpan,
        tag::{ByteOrder, DataType},
    },
    t,
};

/// Why a key makes a row none.
pub fn unsaid(key: &str) -> String {
    t!("a profile cannot express `{key}`", key)
}

/// The first of these keys that says another number than the one which changes nothing.
pub fn beside(item: &Node, plain: &[(&'static str, f64)]) -> Option<&'static str> {
    plain
        .iter()
        .find(|(key, plain)| item.get(key).is_some_and(|node| node.number() != Some(*plain)))
        .map(|(key, _)| *key)
}

/// A key that is needed and is not there.
pub fn missing(key: &str) -> String {
    t!("`{key}` is missing", key)
}

/// What is no number where one is needed, or no word that is known.
pub fn wrong(key: &str, node: &Node) -> String {
    t!("`{key}`: `{value}` is not understood", key, value = node.shown())
}

/// The registers of a row do not stand beside each other.
pub fn apart() -> String {
    t!("its registers are not consecutive").to_owned()
}

impl Node {
    /// A number that a key may have.
    pub fn opt_number(&self, key: &str) -> Result<Option<f64>, String> {
        self.get(key).map(|node| node.number().ok_or_else(|| wrong(key, node))).transpose()
    }

    /// A whole number that a key may have.
    pub fn opt_whole(&self, key: &str) -> Result<Option<i64>, String> {
        self.get(key).map(|node| node.whole().ok_or_else(|| wrong(key, node))).transpose()
    }

    /// The address that a key must have.
    pub fn wire_address(&self, key: &str) -> Result<u16, String> {
        self.get(key).ok_or_else(|| missing(key))?.address(key)
    }

    /// It is an address.
    pub fn address(&self, key: &str) -> Result<u16, String> {
        self.whole().and_then(|number| u16::try_from(number).ok()).ok_or_else(|| wrong(key, self))
    }

    /// Its keys as numbers and their texts, as an enumeration has them.
    pub fn labels(&self) -> Result<Vec<(i128, String)>, String> {
        let label = |(key, node): &(String, Node)| {
            let number = super::container::node::whole(key).ok_or_else(|| wrong(key, node))?;
            Ok((i128::from(number), node.shown()))
        };
        self.entries().iter().map(label).collect()
    }
}

impl List {
    /// A list of a tree, with the keys in it that stand twice.
    pub fn of_tree(tree: &Tree) -> List {
        let twice = |(line, key): &(usize, String)| {
            t!("line {line}: `{key}` is given twice: the last one counts", line = *line, key)
        };
        List { warnings: tree.twice.iter().map(twice).collect(), ..List::default() }
    }

    /// Notes the keys of a row that are neither used nor without meaning here.
    pub fn note_keys(&mut self, node: &Node, known: &[&[&str]]) {
        let is_known = |key: &str| known.iter().any(|keys| keys.contains(&key));
        node.entries().iter().filter(|(key, _)| !is_known(key)).for_each(|(key, one)| self.note(key.clone(), one.line));
    }
}

impl Named {
    /// The same with names of its numbers, each as its type reads it; one that can never occur is left out.
    pub fn labelled(self, labels: Vec<(i128, String)>) -> Named {
        let raw = |value| self.point().raw_number(value, false).number().and_then(Exact::as_whole);
        let mut enum_labels: Vec<(i128, String)> = Vec::new();
        for (value, text) in labels {
            if let Some(raw) = raw(value).filter(|raw| !enum_labels.iter().any(|(known, _)| known == raw)) {
                enum_labels.push((raw, text));
            }
        }
        Named { enum_labels, ..self }
    }

    /// The same in this order; words of a single register, and of a text, are not swapped.
    pub fn ordered(self, order: ByteOrder) -> Named {
        let is_single = self.kind.registers() == 1 || self.kind.is_text();
        let order = match order {
            ByteOrder::Cdab if is_single => ByteOrder::Abcd,
            ByteOrder::Dcba if is_single => ByteOrder::Badc,
            order => order,
        };
        Named { order, ..self }
    }

    /// The same with a number that means "no value", written as a pattern of its bits or as the number.
    pub fn bad_at(mut self, written: i64, is_pattern: bool) -> Named {
        let number = self.point().raw_number(i128::from(written), is_pattern).number();
        let number = number.map(BadSpan::from).filter(|number| !self.bad_if.contains(number));
        self.bad_if.extend(number);
        self
    }
}

/// The order that bytes and words are swapped from, as it is said with `byte`, `word` and both.
pub fn swapped(word: &str) -> Option<ByteOrder> {
    Some(match word {
        "none" | "" => ByteOrder::Abcd,
        "byte" => ByteOrder::Badc,
        "word" => ByteOrder::Cdab,
        "word_byte" => ByteOrder::Dcba,
        _ => return None,
    })
}

/// A text of so many registers that ends at its first NUL.
pub fn text_of(registers: i64) -> Option<DataType> {
    let bytes = u8::try_from(registers.checked_mul(2)?).ok()?;
    (1..=DataType::TEXT_MAX).contains(&bytes).then_some(DataType::TextToNul(bytes))
}

/// The field that a mask leaves: its lowest bit and its width; `None` where its bits do not stand together.
pub fn field_of(mask: u64) -> Option<(u8, u8)> {
    let low = mask.trailing_zeros();
    let width = mask.count_ones();
    (mask != 0 && mask >> low == u64::MAX >> (64 - width)).then(|| (to_u8(low), to_u8(width)))
}
