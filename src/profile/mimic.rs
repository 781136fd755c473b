//! What is drawn: the pages and commands of the mimic, and the pens of the trends.

use std::collections::BTreeMap;

use super::{
    diagnostic::Problems,
    names::{Defs, Unique, check_writable, number_of},
    picture::{SymbolKind, Vocabulary, picture},
    reader::{At, Raw, Value, text},
    schema::{CommandTable, MimicTable, TrendTable},
};
use crate::plant::{
    def::{MimicCommand, MimicDef, MimicPage, Pen, Picture, TagId, TrendGroup},
    tag::{Poll, TagDef},
};

/// What a terminal of 80 by 24 leaves for the mimic.
const USUAL_ROOM: (u16, u16) = (80, 18);

/// Most pages.
const PAGES_MAX: usize = 100;

/// The mimic of the process.
pub(super) fn mimic(table: &MimicTable, defs: &Defs, problems: &mut Problems) -> MimicDef {
    let aliases = aliases(&table.aliases, problems);
    let titled = titled(table, problems);
    let names: Vec<String> = titled.iter().map(|(name, _)| name.clone()).collect();
    let vocabulary = Vocabulary { defs, aliases: &aliases, pages: &names };
    let pages = titled.into_iter().map(|(name, texts)| {
        let drawn = texts.iter().map(|text| (picture(text, &vocabulary, problems), text));
        let mut drawn: Vec<(Picture, &At<String>)> = drawn.collect();
        drawn.sort_by_key(|(picture, _)| picture.size);
        drawn.first().into_iter().for_each(|(least, text)| check_smallest(least, text, problems));
        MimicPage { name, pictures: drawn.into_iter().map(|(picture, _)| picture).collect() }
    });
    let pages = pages.collect();
    let mut keys = Unique::default();
    let commands = table.commands.iter().filter_map(|command| self::command(&command.value, defs, &mut keys, problems));
    MimicDef { pages, commands: commands.collect() }
}

/// The pages with their pictures. Of several each has a name of its own, which is its heading and what leads to it.
fn titled<'a>(table: &'a MimicTable, problems: &mut Problems) -> Vec<(String, &'a [At<String>])> {
    match (&table.name, &table.pictures) {
        (Some(name), None) => {
            problems.add(name.at, "a page without a picture").label("expected `picture` beside it");
        }
        (None, Some(first)) if !table.pages.is_empty() => {
            let problem = problems.add(first.at, "the first of several pages needs a name");
            problem.label("expected `name` beside it: its heading, and what {page NAME} leads to");
        }
        (Some(_), Some(_)) | (None, _) => {}
    }
    let count = table.pages.len() + usize::from(table.pictures.is_some());
    if let Some(last) = table.pages.last().filter(|_| PAGES_MAX < count) {
        let problem = problems.add(last.at, format!("{count} pages of the mimic are too many"));
        problem.label(format!("expected at most {PAGES_MAX}"));
        return Vec::new();
    }
    let further = table.pages.iter().map(|page| (&page.value.name, &page.value.pictures));
    let (mut named, mut titled) = (Unique::default(), Vec::new());
    for (name, pictures) in std::iter::once((&table.name, &table.pictures)).chain(further) {
        if let Some(name) = name {
            named.insert(&name.value, name.at, format!("duplicate page `{}`", name.value), problems);
            if name.value.trim().is_empty() {
                problems.add(name.at, "a page without a name").label("expected its heading");
            }
        }
        let Some(pictures) = pictures else { continue };
        if pictures.value.0.is_empty() {
            problems.add(pictures.at, "a page without a picture").label("expected at least one");
        }
        titled.push((text(name), &pictures.value.0[..]));
    }
    titled
}

/// A usual terminal shows no picture that is larger than its room.
fn check_smallest(picture: &Picture, text: &At<String>, problems: &mut Problems) {
    let ((width, height), (columns, rows)) = (picture.size, USUAL_ROOM);
    if width > columns || height > rows {
        let message =
            format!("a terminal of 80 by 24 shows a list instead of this picture of {width} by {height} cells");
        problems.warn(text.at, message).label("expected at most 80 by 18, or a smaller picture beside it");
    }
}

/// Reads the short names of symbols.
fn aliases(table: &Option<At<Raw>>, problems: &mut Problems) -> BTreeMap<String, At<String>> {
    let rows = table.iter().flat_map(|table| &table.value.table);
    let mut aliases = BTreeMap::new();
    for (name, (at, node)) in rows {
        if name.contains('.') || SymbolKind::ALL.iter().any(|kind| kind.word() == name) {
            problems
                .add(*at, format!("`{name}` cannot be an alias"))
                .label("expected a word that is no symbol and no tag");
        }
        if let Some(text) = String::read(&node.value, node.at, problems) {
            aliases.insert(name.clone(), At { value: text, at: node.at });
        }
    }
    aliases
}

/// Letters that mean something on every screen, so that no plant can give them another meaning.
const KEYS_TAKEN: [char; 5] = ['a', 'q', 'v', 'w', 'y'];

fn command(table: &CommandTable, defs: &Defs, keys: &mut Unique, problems: &mut Problems) -> Option<MimicCommand> {
    let (key, name) = (table.key.as_ref()?, table.tag.as_ref()?);
    let mut letters = key.value.chars();
    let letter = letters.next().filter(|c| c.is_ascii_lowercase() && letters.next().is_none());
    if letter.is_none() {
        problems.add(key.at, format!("`{}` is not a key", key.value)).label("expected one lower-case letter");
    }
    if letter.is_some_and(|letter| KEYS_TAKEN.contains(&letter)) {
        problems
            .add(key.at, format!("key `{}` is taken", key.value))
            .label("`a` acknowledges an alarm, `q` quits, `v` shows the overview, `w` says why and `y` copies");
    }
    keys.insert(&key.value, key.at, format!("duplicate key `{}`", key.value), problems);
    let tag = defs.tag(name, problems)?;
    check_writable(name, tag, problems);
    let value = match &table.value {
        Some(choice) => Some(number_of(choice, tag, problems)?),
        None => None,
    };
    Some(MimicCommand { key: letter?, label: text(&table.label), tag: tag.id, value })
}

/// Most pens of a group: more curves cannot be distinguished.
const PENS_MAX: usize = 8;

/// The groups of pens; one is made up if the plant file has none.
pub(super) fn trends(tables: &[At<TrendTable>], defs: &Defs, problems: &mut Problems) -> Vec<TrendGroup> {
    let mut seen = Unique::default();
    let mut groups = Vec::new();
    for table in tables.iter().map(|table| &table.value) {
        let Some(name) = &table.name else { continue };
        seen.insert(&name.value, name.at, format!("duplicate trend `{}`", name.value), problems);
        if table.pens.is_empty() || table.pens.len() > PENS_MAX {
            problems
                .add(table.at, format!("a trend with {} pens", table.pens.len()))
                .label(format!("expected 1 to {PENS_MAX}"));
        }
        let pens = table.pens.iter().filter_map(|pen| {
            let scale = pen.value.scale.map(|scale| (scale.value[0], scale.value[1]));
            if let Some(at) = pen.value.scale.filter(|scale| scale.value[0] >= scale.value[1]) {
                problems.add(at.at, "the scale is empty or reversed").label("expected [low, high]");
            }
            let tag: TagId = defs.tag_id(&pen.value.tag, problems)?;
            Some(Pen { tag, scale })
        });
        groups.push(TrendGroup { name: name.value.clone(), pens: pens.collect() });
    }
    if tables.is_empty() {
        let curve = |tag: &&TagDef| {
            tag.enum_labels.is_empty()
                && tag.is_stored()
                && (matches!(tag.poll, Poll::Every(_)) || tag.calculation.is_some())
        };
        let pens = defs.tags.iter().filter(curve).take(PENS_MAX).map(|tag| Pen { tag: tag.id, scale: None });
        groups.push(TrendGroup { name: "all".to_owned(), pens: pens.collect() });
    }
    groups
}
