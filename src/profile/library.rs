//! What a list of device profiles shows of each and finds it by, read without a check: a whole library at once.

use nucleo_matcher::{
    Config, Matcher, Utf32Str,
    pattern::{Atom, AtomKind, CaseMatching, Normalization, Pattern},
};
use serde::Deserialize;

use super::{Listed, plant::Text};

/// A device profile at a glance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Card {
    /// Its name, folder and file.
    pub listed: Listed,
    /// `EASTRON`.
    pub vendor: String,
    /// `SDM630`.
    pub model: String,
    /// How sure it is: `verified`, `manual`, `partial`.
    pub status: String,
    /// Where its facts come from.
    pub source: String,
    /// The short names of its tags.
    pub tags: Vec<String>,
}

/// The keys of a profile that a card is made of.
#[derive(Default, Deserialize)]
#[serde(default)]
struct File {
    vendor: String,
    model: String,
    status: String,
    source: String,
    tag: Vec<Row>,
    repeat: Vec<Repeat>,
}

#[derive(Deserialize)]
struct Row {
    name: String,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Repeat {
    count: usize,
    names: Vec<String>,
    tag: Vec<Row>,
}

/// The cards of device profiles, the kinds of device one after the other; one without a text has only its name.
pub(super) fn cards(texts: impl Iterator<Item = (Listed, Option<Text>)>) -> Vec<Card> {
    let mut cards: Vec<Card> = texts.map(|(listed, text)| card(listed, text)).collect();
    cards.sort_by(|a, b| (&a.listed.folder, &a.listed.name).cmp(&(&b.listed.folder, &b.listed.name)));
    cards
}

fn card(listed: Listed, text: Option<Text>) -> Card {
    let text = text.map(|text| String::from_utf8_lossy(&text.bytes).into_owned()).unwrap_or_default();
    let File { vendor, model, status, source, tag, repeat } = toml::from_str(&text).unwrap_or_default();
    let repeated = repeat.iter().flat_map(Repeat::tags);
    let tags = tag.into_iter().map(|row| row.name).chain(repeated).collect();
    Card { listed, vendor, model, status, source, tags }
}

impl Repeat {
    fn tags(&self) -> impl Iterator<Item = String> {
        let names = match self.names.as_slice() {
            [] => (1..=self.count.min(1_000)).map(|n| n.to_string()).collect(),
            names => names.to_vec(),
        };
        names.into_iter().enumerate().flat_map(|(place, name)| {
            let place = place.to_string();
            self.tag.iter().map(move |row| row.name.replace("{n}", &name).replace("{i}", &place))
        })
    }
}

/// The profiles that fit what was typed, best first: each word fits the name, kind, maker or model as in the palette, or
/// stands in the name of a tag.
pub fn find_cards(cards: Vec<Card>, words: &str) -> Vec<Card> {
    let words = Pattern::parse(words, CaseMatching::Ignore, Normalization::Smart);
    let mut matcher = Matcher::new(Config::DEFAULT);
    let mut found: Vec<(u32, Card)> =
        cards.into_iter().filter_map(|card| Some((score(&card, &words.atoms, &mut matcher)?, card))).collect();
    let best = found.iter().map(|(score, _)| *score).max().unwrap_or_default();
    // Letters of a short word stand somewhere in most long names.
    found.retain(|(score, _)| best <= score * 3 / 2);
    found.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    found.into_iter().map(|(_, card)| card).collect()
}

/// `None` where a word fits nothing.
fn score(card: &Card, words: &[Atom], matcher: &mut Matcher) -> Option<u32> {
    let mut buffer = Vec::new();
    let Card { listed, vendor, model, tags, .. } = card;
    let mut sum = 0;
    for word in words {
        let mut within = word.clone();
        within.kind = AtomKind::Substring;
        let mut fits = |atom: &Atom, text: &String| atom.score(Utf32Str::new(text, &mut buffer), matcher);
        let name = [&listed.name, &listed.folder, vendor, model].into_iter().filter_map(|text| fits(word, text)).max();
        let tag = tags.iter().filter_map(|tag| fits(&within, tag)).max();
        sum += u32::from(name.max(tag)?);
    }
    Some(sum)
}
