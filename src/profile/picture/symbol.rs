//! What stands between `{` and `}` in a picture: a tag, or a kind with its tag and options.

use std::{collections::BTreeMap, time::Duration};

use crate::{
    plant::{
        def::{DeviceId, TagId},
        keyword::{Keyword, keyword_enum},
        tag::TagDef,
    },
    profile::{
        diagnostic::{Problems, Span},
        names::Defs,
        reader::{self, At},
    },
};

/// What names in a picture can lead to.
pub(crate) struct Vocabulary<'a> {
    pub defs: &'a Defs<'a>,
    /// `[mimic.alias]`: short names for long symbols.
    pub aliases: &'a BTreeMap<String, At<String>>,
    /// Names of the pages.
    pub pages: &'a [String],
}

/// A symbol, resolved.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Symbol {
    Value(TagId),
    Level(TagId),
    Valve { tag: TagId, label: String, flow: Option<TagId> },
    Pump { tag: TagId, label: String, flow: Option<TagId> },
    Agitator(TagId),
    Heater(TagId),
    Flow(TagId),
    Bar(TagId),
    Trend(TagId, Duration),
    Controller(DeviceId),
    Sequence { step: TagId, label: String, remaining: Option<TagId>, states: Vec<TagId> },
    Page(usize),
}

impl Symbol {
    /// What measures the flow through its pipe.
    pub fn measured_flow(&self) -> Option<TagId> {
        if let Symbol::Flow(tag) = self { Some(*tag) } else { self.inline()?.1 }
    }
    /// What lets through or moves the flow of its pipe.
    pub fn actuator(&self) -> Option<TagId> {
        self.inline().map(|(tag, _)| tag)
    }
    fn inline(&self) -> Option<(TagId, Option<TagId>)> {
        match self {
            Symbol::Valve { tag, flow, .. } | Symbol::Pump { tag, flow, .. } => Some((*tag, *flow)),
            Symbol::Value(_)
            | Symbol::Level(_)
            | Symbol::Agitator(_)
            | Symbol::Heater(_)
            | Symbol::Flow(_)
            | Symbol::Bar(_)
            | Symbol::Trend(..)
            | Symbol::Controller(_)
            | Symbol::Sequence { .. }
            | Symbol::Page(_) => None,
        }
    }
}

keyword_enum! {
    /// The first word of a symbol.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub(crate) enum SymbolKind: "symbol" {
        Value => "value",
        Level => "level",
        Valve => "valve",
        Pump => "pump",
        Agitator => "agitator",
        Heater => "heater",
        Flow => "flow",
        Bar => "bar",
        Trend => "trend",
        Controller => "controller",
        Sequence => "sequence",
        Page => "page",
    }
}

impl SymbolKind {
    /// Columns and rows of a symbol that covers an area, where the picture gives none.
    fn usual_size(self) -> Option<(u16, u16)> {
        match self {
            SymbolKind::Trend => Some((20, 3)),
            SymbolKind::Controller => Some((26, 6)),
            SymbolKind::Sequence => Some((26, 5)),
            SymbolKind::Value
            | SymbolKind::Level
            | SymbolKind::Valve
            | SymbolKind::Pump
            | SymbolKind::Agitator
            | SymbolKind::Heater
            | SymbolKind::Flow
            | SymbolKind::Bar
            | SymbolKind::Page => None,
        }
    }

    /// Does the picture give its size? Others take the columns between their braces.
    fn has_size(self) -> bool {
        self == SymbolKind::Bar || self.usual_size().is_some()
    }

    /// The options that have a name.
    fn options(self) -> &'static [&'static str] {
        match self {
            SymbolKind::Valve | SymbolKind::Pump => &["flow"],
            SymbolKind::Sequence => &["left", "states"],
            _ => &[],
        }
    }
}

/// The window of a trend that gives none.
const WINDOW: Duration = Duration::from_secs(3_600);

/// What the words after the name may say.
#[derive(Default)]
struct Options {
    size: Option<(u16, u16)>,
    window: Option<Duration>,
    remaining: Option<TagId>,
    states: Vec<TagId>,
    flow: Option<TagId>,
    label: Vec<String>,
}

/// Reads a symbol; with its size, if it covers an area. `None` after the problem was added.
pub(super) fn read(
    text: &str,
    at: Span,
    vocabulary: &Vocabulary,
    problems: &mut Problems,
) -> Option<(Symbol, Option<(u16, u16)>)> {
    let mut words: Vec<At<String>> = words(text, at);
    if let Some(alias) = words.first().and_then(|word| vocabulary.aliases.get(&word.value)) {
        let long = alias.value.split_whitespace().map(|word| At { value: word.to_owned(), at: alias.at });
        words.splice(0..1, long);
    }
    let Some(first) = words.first() else {
        problems.add(at, "a symbol without a name").label("expected {DEVICE.TAG} or {valve DEVICE.TAG}");
        return None;
    };
    let kind = SymbolKind::from_word(&first.value);
    let (kind, rest) = match kind {
        Some(kind) => (kind, &words[1..]),
        None if first.value.contains('.') => (SymbolKind::Value, &words[..]),
        None => {
            let known = SymbolKind::ALL.iter().map(|kind| kind.word());
            let known = known.chain(vocabulary.aliases.keys().map(String::as_str));
            problems.unknown("symbol", first, known);
            return None;
        }
    };
    let Some((name, options)) = rest.split_first() else {
        problems.add(at, format!("`{}` needs a name", kind.word())).label("expected DEVICE.TAG, a device or a page");
        return None;
    };
    if kind == SymbolKind::Page {
        // The name of a page may have several words.
        let value = rest.iter().map(|word| word.value.as_str()).collect::<Vec<_>>().join(" ");
        return Some((symbol(kind, &At { value, at }, Options::default(), vocabulary, problems)?, None));
    }
    let options = read_options(kind, options, vocabulary.defs, problems);
    let size = options.size.or(kind.usual_size());
    Some((symbol(kind, name, options, vocabulary, problems)?, size))
}

/// The words of a symbol, each with its place.
fn words(text: &str, at: Span) -> Vec<At<String>> {
    let place = |word: &str| {
        let start = at.start + (word.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
        // Where escapes hide the place, the whole picture is meant.
        if at.end - at.start == text.len() { Span { start, end: start + word.len(), ..at } } else { at }
    };
    text.split_whitespace().map(|word| At { value: word.to_owned(), at: place(word) }).collect()
}

fn read_options(kind: SymbolKind, words: &[At<String>], defs: &Defs, problems: &mut Problems) -> Options {
    let mut options = Options::default();
    for word in words {
        let named = word.value.split_once('=').filter(|(key, _)| kind.options().contains(key));
        let tag = |name: &str, problems: &mut Problems| {
            defs.tag(&At { value: name.to_owned(), at: word.at }, problems).map(|tag| tag.id)
        };
        let size = word.value.split_once('x').and_then(|(columns, rows)| columns.parse().ok().zip(rows.parse().ok()));
        let window = reader::duration(&word.value).filter(|window| *window >= Duration::from_secs(60));
        match (named, size, window.filter(|_| kind == SymbolKind::Trend)) {
            (Some(("left", name)), _, _) => options.remaining = tag(name, problems),
            (Some(("flow", name)), _, _) => options.flow = tag(name, problems),
            (Some((_, names)), _, _) => {
                options.states = names.split(',').filter_map(|name| tag(name, problems)).collect();
            }
            (_, Some(size), _) if kind.has_size() => options.size = Some(size),
            (_, None, Some(window)) => options.window = Some(window),
            _ => match kind {
                SymbolKind::Valve | SymbolKind::Pump | SymbolKind::Sequence if size.is_none() => {
                    options.label.push(word.value.clone());
                }
                SymbolKind::Value
                | SymbolKind::Valve
                | SymbolKind::Pump
                | SymbolKind::Sequence
                | SymbolKind::Level
                | SymbolKind::Agitator
                | SymbolKind::Heater
                | SymbolKind::Flow
                | SymbolKind::Bar
                | SymbolKind::Trend
                | SymbolKind::Controller
                | SymbolKind::Page => {
                    let problem = problems.add(word.at, format!("`{}` means nothing here", word.value));
                    problem.label(expected_options(kind));
                }
            },
        }
    }
    options
}

fn expected_options(kind: SymbolKind) -> &'static str {
    match kind {
        SymbolKind::Trend => "expected a size as 30x5 or a window as 1h, from 1min to 100 days",
        SymbolKind::Bar | SymbolKind::Controller => "expected a size as 26x6",
        SymbolKind::Sequence => "expected a size as 26x5, left=TAG, states=TAG,TAG or a label",
        SymbolKind::Valve | SymbolKind::Pump => "expected a label or flow=TAG",
        SymbolKind::Value
        | SymbolKind::Level
        | SymbolKind::Agitator
        | SymbolKind::Heater
        | SymbolKind::Flow
        | SymbolKind::Page => "expected }",
    }
}

fn symbol(
    kind: SymbolKind,
    name: &At<String>,
    options: Options,
    vocabulary: &Vocabulary,
    problems: &mut Problems,
) -> Option<Symbol> {
    let defs = vocabulary.defs;
    let label = |tag: &TagDef| match options.label.as_slice() {
        [] => tag.short.clone(),
        words => words.join(" "),
    };
    Some(match kind {
        // The one symbol that can show words as well as a number.
        SymbolKind::Value => Symbol::Value(defs.names.full(name, problems)?),
        SymbolKind::Level => Symbol::Level(defs.tag(name, problems)?.id),
        SymbolKind::Valve => {
            let tag = defs.tag(name, problems)?;
            Symbol::Valve { tag: tag.id, label: label(tag), flow: options.flow }
        }
        SymbolKind::Pump => {
            let tag = defs.tag(name, problems)?;
            Symbol::Pump { tag: tag.id, label: label(tag), flow: options.flow }
        }
        SymbolKind::Agitator => Symbol::Agitator(defs.tag(name, problems)?.id),
        SymbolKind::Heater => Symbol::Heater(defs.tag(name, problems)?.id),
        SymbolKind::Flow => Symbol::Flow(defs.tag(name, problems)?.id),
        SymbolKind::Bar => Symbol::Bar(defs.tag(name, problems)?.id),
        SymbolKind::Trend => Symbol::Trend(defs.tag(name, problems)?.id, options.window.unwrap_or(WINDOW)),
        SymbolKind::Controller => {
            let device = defs.device(name, problems)?;
            if defs.devices[device.index()].faceplate.is_none() {
                let problem = problems.add(name.at, format!("{} is not a controller", name.value));
                problem.label("its profile has no [faceplate]");
            }
            Symbol::Controller(device)
        }
        SymbolKind::Sequence => {
            let tag = defs.tag(name, problems)?;
            if tag.enum_labels.is_empty() {
                problems.add(name.at, format!("{} has no steps", tag.name)).label("expected a tag with an `enum`");
            }
            let (step, label) = (tag.id, label(tag));
            Symbol::Sequence { step, label, remaining: options.remaining, states: options.states }
        }
        SymbolKind::Page => {
            let found = vocabulary.pages.iter().position(|known| *known == name.value);
            if found.is_none() {
                let named = vocabulary.pages.iter().filter(|page| !page.is_empty());
                problems.unknown("page", name, named.map(String::as_str));
            }
            Symbol::Page(found?)
        }
    })
}
