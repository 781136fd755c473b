//! Reads TOML into typed tables and goes on after an error, so that all errors of a file are reported at once.
//!
//! serde stops at the first error and forgets where values stood. Here each value keeps its [`Span`], and a table may
//! have several [`Raw`] layers: a plant file's row lies on the row of the device profile, which lies on its defaults.

mod value;

use std::{collections::BTreeMap, fmt::Debug, ops::RangeInclusive};

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

pub(crate) use self::value::{Choice, Numbered, Texts, duration, wrong_type};
pub(crate) use super::diagnostic::At;
use super::{
    diagnostic::{Problems, Span},
    renamed,
};
use crate::plant::{exact::Exact, keyword::Keyword, visible::first_hidden};

/// Most unknown keys of one table that are reported.
const UNKNOWN_MAX: usize = 40;

/// A TOML value with the places of all that is in it.
#[derive(Debug, Clone)]
pub(crate) enum Node {
    Text(String),
    /// As written: what range is right depends on the key.
    Whole(i128),
    Number(Exact),
    Flag(bool),
    Time(String),
    Array(Vec<At<Node>>),
    Table(Table),
}

/// The keys of a table, each with the place of the key and its value.
pub(crate) type Table = BTreeMap<String, (Span, At<Node>)>;

/// A table as it was written.
#[derive(Debug, Clone)]
pub(crate) struct Raw {
    pub at: Span,
    pub table: Table,
}

/// A type that a TOML value can become. `None` after the problem was added.
pub(crate) trait Value: Sized {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self>;
}

/// Parses a file. `None` if it is not UTF-8, not TOML or says nothing; the problems say which.
pub(crate) fn parse(file: &str, bytes: &[u8], problems: &mut Problems) -> Option<Raw> {
    let source = problems.source(file, String::from_utf8_lossy(bytes).into_owned());
    if let Err(error) = std::str::from_utf8(bytes) {
        // Up to here the lossy text equals the file; the replacement character that follows has three bytes.
        let start = error.valid_up_to();
        let byte = bytes[start];
        problems
            .add(Span { source, start, end: start + '\u{FFFD}'.len_utf8() }, format!("{file} is not UTF-8"))
            .label(format!("byte 0x{byte:02X}"))
            .help("save the file as UTF-8");
        return None;
    }
    let text = problems.text(source).to_owned();
    if hidden(&text, source, problems) {
        return None;
    }
    let (document, errors) = DeTable::parse_recoverable(&text);
    let table = table_of(document.get_ref(), source);
    for error in &errors {
        let span = error.span().unwrap_or(0..0);
        problems
            .add(Span { source, start: span.start, end: span.end.max(span.start) }, error.message())
            .label("TOML syntax error here");
    }
    if errors.is_empty() && table.is_empty() {
        problems
            .add(Span { source, start: 0, end: 0 }, format!("{file} is empty"))
            .help("see `sightglass profiles tank`");
    }
    let before = problems.count();
    check_table(&table, problems);
    let at = Span { source, start: 0, end: 0 };
    (errors.is_empty() && !table.is_empty() && problems.count() == before).then_some(Raw { at, table })
}

/// Reports the first character that no editor shows, also in a comment: what one reads is not what is there.
fn hidden(text: &str, source: usize, problems: &mut Problems) -> bool {
    // Editors of some systems put a byte order mark at the beginning.
    let body = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let found = first_hidden(body);
    if let Some((at, letter)) = found {
        let start = text.len() - body.len() + at;
        report_hidden(letter, Span { source, start, end: start + letter.len_utf8() }, problems);
    }
    found.is_some()
}

/// The same for what TOML writes as `\u001b`, in names and texts.
fn check_table(table: &Table, problems: &mut Problems) {
    for (key, (at, value)) in table {
        check_text(key, *at, problems);
        check_node(value, problems);
    }
}

fn check_node(node: &At<Node>, problems: &mut Problems) {
    match &node.value {
        Node::Text(text) => check_text(text, node.at, problems),
        Node::Array(items) => items.iter().for_each(|item| check_node(item, problems)),
        Node::Table(table) => check_table(table, problems),
        Node::Whole(_) | Node::Number(_) | Node::Flag(_) | Node::Time(_) => {}
    }
}

fn check_text(text: &str, at: Span, problems: &mut Problems) {
    if let Some((_, letter)) = first_hidden(text) {
        report_hidden(letter, at, problems);
    }
}

fn report_hidden(letter: char, at: Span, problems: &mut Problems) {
    let message =
        format!("the character U+{:04X} is invisible, or changes the direction of writing", u32::from(letter));
    problems.add(at, message).label("expected only visible characters");
}

fn table_of(table: &DeTable<'_>, source: usize) -> Table {
    let entry = |(key, value): (&Spanned<_>, &Spanned<_>)| {
        let word: &std::borrow::Cow<'_, str> = key.get_ref();
        (word.as_ref().to_owned(), (place(key, source), node_of(value, source)))
    };
    table.iter().map(entry).collect()
}

fn node_of(value: &Spanned<DeValue<'_>>, source: usize) -> At<Node> {
    let node = match value.get_ref() {
        DeValue::String(text) => Node::Text(text.as_ref().to_owned()),
        // TOML itself promises 64 bits; a longer number is as wrong as a number that is not finite.
        DeValue::Integer(number) => {
            i128::from_str_radix(number.as_str(), number.radix()).map_or(Node::Number(f64::NAN.into()), Node::Whole)
        }
        DeValue::Float(number) => Node::Number(number.as_str().parse().unwrap_or(f64::NAN.into())),
        DeValue::Boolean(flag) => Node::Flag(*flag),
        DeValue::Datetime(time) => Node::Time(time.to_string()),
        DeValue::Array(array) => Node::Array(array.iter().map(|item| node_of(item, source)).collect()),
        DeValue::Table(table) => Node::Table(table_of(table, source)),
    };
    At { value: node, at: place(value, source) }
}

fn place<T>(spanned: &Spanned<T>, source: usize) -> Span {
    Span { source, start: spanned.span().start, end: spanned.span().end }
}

/// The fields of a table that is being read, topmost layer first.
pub(crate) struct Fields<'a> {
    layers: &'a [Raw],
    what: &'static str,
}

impl<'a> Fields<'a> {
    /// Starts reading; reports every key that is not known.
    pub fn new(layers: &'a [Raw], what: &'static str, known: &[&'static str], problems: &mut Problems) -> Self {
        for layer in layers {
            let unknown = layer.table.iter().filter(|(word, _)| !known.contains(&word.as_str()));
            for (word, (at, _)) in unknown.take(UNKNOWN_MAX) {
                let problem = problems.add(*at, format!("unknown key `{word}` in {what}")).label("unknown here");
                renamed::offer(problem, what, word, known);
            }
        }
        Fields { layers, what }
    }
    /// Do the layers still use an old name of a key?
    fn has_old_name(&self, what: &str, key: &str) -> bool {
        renamed::old_names(what, key).any(|old| self.layers.iter().any(|layer| layer.table.contains_key(old)))
    }
    /// Where the topmost layer stands.
    pub fn at(&self) -> Span {
        self.layers[0].at
    }
    /// A value that must be there.
    pub fn need<T: Value>(&self, key: &str, problems: &mut Problems) -> Option<At<T>> {
        let what = self.what;
        if self.find(key).is_none() && !self.has_old_name(what, key) {
            problems.add(self.at(), format!("{what} needs `{key}`")).label("missing here");
        }
        self.opt(key, problems)
    }
    /// A value that may be there.
    pub fn opt<T: Value>(&self, key: &str, problems: &mut Problems) -> Option<At<T>> {
        let (value, at) = self.find(key)?;
        T::read(value, at, problems).map(|value| At { value, at })
    }
    /// An array, empty if it is not there.
    pub fn list<T: Value>(&self, key: &str, problems: &mut Problems) -> Vec<At<T>> {
        let Some((value, at)) = self.find(key) else { return Vec::new() };
        let Node::Array(array) = value else {
            wrong_type::<T>(value, at, "an array", problems);
            return Vec::new();
        };
        array
            .iter()
            .filter_map(|At { value, at }| T::read(value, *at, problems).map(|value| At { value, at: *at }))
            .collect()
    }
    fn find(&self, key: &str) -> Option<(&'a Node, Span)> {
        self.layers.iter().find_map(|layer| layer.table.get(key).map(|(_, node)| (&node.value, node.at)))
    }
}

/// Keeps of two keys that exclude each other (`min` and `min_from`) the one in the upper layer.
/// Two in the same layer are a contradiction.
pub(crate) fn either(layers: &mut [Raw], first: &str, second: &str, problems: &mut Problems) {
    let Some(top) = layers.iter().position(|l| l.table.contains_key(first) || l.table.contains_key(second)) else {
        return;
    };
    let layer = &layers[top];
    if let (Some((a, _)), Some((b, _))) = (layer.table.get(first), layer.table.get(second)) {
        problems.exclusive((first, *a), (second, *b));
    }
    for below in &mut layers[top + 1..] {
        below.table.remove(first);
        below.table.remove(second);
    }
}

/// Declares tables of the format: their keys, the types, and which are needed (`need`), optional (`opt`) or arrays (`list`).
macro_rules! toml_tables {
    (@type need $type:ty) => { Option<$crate::profile::reader::At<$type>> };
    (@type opt $type:ty) => { Option<$crate::profile::reader::At<$type>> };
    (@type list $type:ty) => { Vec<$crate::profile::reader::At<$type>> };
    ($(
        $(#[$doc:meta])*
        $name:ident, $what:literal { $($(#[$note:meta])* $mode:ident $key:literal $field:ident: $type:ty,)* }
    )*) => { $(
        $(#[$doc])*
        #[derive(Debug, Clone)]
        #[allow(dead_code, reason = "some keys are only checked, and not every table is reported as a whole")]
        pub(crate) struct $name {
            /// Where the table stands.
            pub at: $crate::profile::diagnostic::Span,
            /// Nothing in it was wrong by itself. If something was, what seems missing is better not asked for.
            pub valid: bool,
            $($(#[$note])* pub $field: $crate::profile::reader::toml_tables!(@type $mode $type),)*
        }
        #[allow(dead_code, reason = "not every table is asked for the places of its keys")]
        impl $name {
            pub fn of(layers: &[$crate::profile::reader::Raw], problems: &mut $crate::profile::diagnostic::Problems) -> Self {
                let before = problems.count();
                let fields = $crate::profile::reader::Fields::new(layers, $what, &[$($key),*], problems);
                $(let $field = fields.$mode::<$type>($key, problems);)*
                $name { at: fields.at(), valid: problems.count() == before, $($field,)* }
            }

            /// Where the value of a key stands, if it is written and has the right type.
            pub fn span_of(&self, key: &str) -> Option<$crate::profile::diagnostic::Span> {
                match key {
                    $($key => self.$field.iter().next().map(|value| value.at),)*
                    _ => None,
                }
            }
        }
        impl $crate::profile::reader::Value for $name {
            fn read(
                value: &$crate::profile::reader::Node,
                at: $crate::profile::diagnostic::Span,
                problems: &mut $crate::profile::diagnostic::Problems,
            ) -> Option<Self> {
                let raw = <$crate::profile::reader::Raw as $crate::profile::reader::Value>::read(value, at, problems)?;
                Some($name::of(&[raw], problems))
            }
        }
    )* };
}
pub(crate) use toml_tables;

/// The word that decides which other keys a table has, read before them.
pub(crate) fn kind_of<T: Keyword>(raw: &Raw, what: &str, key: &str, problems: &mut Problems) -> Option<T> {
    let Some((_, value)) = raw.table.get(key) else {
        let known: Vec<&str> = T::WORDS.iter().map(|(word, _)| *word).collect();
        let problem = problems.add(raw.at, format!("{what} needs `{key}`")).label("missing here");
        problem.help(format!("known: {}", known.join(", ")));
        return None;
    };
    T::read(&value.value, value.at, problems)
}

impl<T: Keyword> Value for T {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<T> {
        let word = String::read(value, at, problems)?;
        let found = T::from_word(&word);
        if found.is_none() {
            let problem = problems.add(at, format!("unknown {} `{word}`", T::WHAT));
            let known: Vec<&str> = T::WORDS.iter().map(|(word, _)| *word).collect();
            renamed::offer(problem.label(format!("not a {}", T::WHAT)), T::WHAT, &word, &known);
        }
        found
    }
}

/// A number that must lie in a range; the usual one where it does not or is not written.
pub(crate) fn within<T: PartialOrd + Debug + Copy>(
    given: Option<At<T>>,
    range: RangeInclusive<T>,
    usual: T,
    problems: &mut Problems,
) -> T {
    let Some(given) = given else { return usual };
    if !range.contains(&given.value) {
        let expected = format!("expected {:?} … {:?}", range.start(), range.end());
        problems.add(given.at, format!("{:?} cannot be used here", given.value)).label(expected);
        return usual;
    }
    given.value
}

/// A key that may be left out.
pub(crate) trait OptionalKey<T> {
    /// What is written, or else the usual value.
    fn value_or(self, usual: T) -> T;
}

impl<T> OptionalKey<T> for Option<At<T>> {
    fn value_or(self, usual: T) -> T {
        self.map_or(usual, |written| written.value)
    }
}

/// The words of an optional string; empty if it is not there.
pub(crate) fn text(value: &Option<At<String>>) -> String {
    value.as_ref().map(|text| text.value.clone()).unwrap_or_default()
}

/// If a layer has `key`, takes `stale` out of the layers below: it belonged to their `key`.
pub(crate) fn supersede(layers: &mut [Raw], key: &str, stale: &str) {
    if let Some(top) = layers.iter().position(|layer| layer.table.contains_key(key)) {
        for below in &mut layers[top + 1..] {
            below.table.remove(stale);
        }
    }
}
