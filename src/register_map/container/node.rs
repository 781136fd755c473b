//! A tree of keys and values with the line of each: what YAML, JSON and TOML have in common.

use std::collections::HashSet;

use crate::t;

/// Most nodes of a file, copies of anchors included.
pub const NODES_MAX: usize = 400_000;
/// Deepest nesting.
pub const DEPTH_MAX: usize = 48;

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// From 1.
    pub line: usize,
    /// What it is.
    pub value: Value,
}

/// What a node holds. Numbers and truth stay as they are written: who asks knows what is meant.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `null`.
    Empty,
    /// A text or number.
    Scalar(String),
    /// In order.
    List(Vec<Node>),
    /// In order; a key that stands twice counts as it stands last.
    Map(Vec<(String, Node)>),
}

/// A file.
#[derive(Debug)]
pub struct Tree {
    /// All of it.
    pub root: Node,
    /// Keys that stand twice in one place.
    pub twice: Vec<(usize, String)>,
}

/// Why a file is none, once it is known where.
pub fn broken(line: usize, why: &str) -> String {
    t!("line {number}: {why}", number = line, why)
}

/// What is too much for this program.
pub fn too_much(line: usize) -> String {
    broken(line, t!("it is nested too deeply, or too large"))
}

impl Node {
    /// What a key of a map holds; `None` also for nothing.
    pub fn get(&self, key: &str) -> Option<&Node> {
        let found = self.entries().iter().rev().find(|(own, _)| own == key).map(|(_, node)| node);
        found.filter(|node| node.value != Value::Empty)
    }

    /// The keys of a map.
    pub fn entries(&self) -> &[(String, Node)] {
        if let Value::Map(entries) = &self.value { entries } else { &[] }
    }

    /// The items of a list; a single value is a list of one.
    pub fn items(&self) -> &[Node] {
        match &self.value {
            Value::List(items) => items,
            Value::Empty => &[],
            Value::Scalar(_) | Value::Map(_) => std::slice::from_ref(self),
        }
    }

    /// The items below a key.
    pub fn all(&self, key: &str) -> &[Node] {
        self.get(key).map_or(&[], Node::items)
    }

    /// As it is written.
    pub fn text(&self) -> Option<&str> {
        if let Value::Scalar(text) = &self.value { Some(text) } else { None }
    }

    /// The text of a key.
    pub fn word(&self, key: &str) -> Option<&str> {
        self.get(key)?.text()
    }

    /// A whole number, decimal or as 0x, 0o or 0b.
    pub fn whole(&self) -> Option<i64> {
        whole(self.text()?)
    }

    /// A number.
    pub fn number(&self) -> Option<f64> {
        let text = self.text()?;
        whole_as_number(text).or_else(|| text.trim().parse().ok()).filter(|number: &f64| number.is_finite())
    }

    /// Is it said to be so?
    pub fn is_true(&self) -> bool {
        self.text().is_some_and(|text| matches!(text.to_lowercase().as_str(), "true" | "yes" | "on" | "1"))
    }

    /// As it is shown to a person.
    pub fn shown(&self) -> String {
        match &self.value {
            Value::Empty => "null".to_owned(),
            Value::Scalar(text) => text.clone(),
            Value::List(items) => format!("[{}]", items.iter().take(4).map(Node::shown).collect::<Vec<_>>().join(", ")),
            Value::Map(_) => "{…}".to_owned(),
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "a number of a file beyond 53 bits is no scale")]
fn whole_as_number(text: &str) -> Option<f64> {
    whole(text).map(|number| number as f64)
}

/// `10`, `-5`, `0x1F`, `0o17`, `0b11`, `1_000`; a number with a leading zero, but `0000`, is octal to some and decimal to others.
pub fn whole(text: &str) -> Option<i64> {
    let text = text.trim();
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let digits = digits.strip_prefix('+').unwrap_or(digits).replace('_', "");
    let lower = digits.to_ascii_lowercase();
    let radix = |prefix: &str, radix| lower.strip_prefix(prefix).map(|digits| (digits, radix));
    let (digits, radix) = radix("0x", 16).or_else(|| radix("0o", 8)).or_else(|| radix("0b", 2)).unwrap_or((&lower, 10));
    let is_plain = digits.chars().all(|sign| sign.is_digit(radix));
    let is_octal = radix == 10 && 1 < digits.len() && digits.starts_with('0') && digits.contains(|digit| digit != '0');
    let number = i64::from_str_radix(digits, radix).ok().filter(|_| is_plain && !is_octal)?;
    number.checked_mul(sign)
}

/// The keys that stand twice among these.
pub fn doubled(entries: &[(String, Node)]) -> impl Iterator<Item = (usize, String)> {
    let mut seen = HashSet::new();
    entries.iter().filter(move |(key, _)| !seen.insert(key.as_str())).map(|(key, node)| (node.line, key.clone()))
}
