//! What the station says in words of its own is English, because it stands in the audit log and in logs too; here a terminal
//! reads it in its language: what is on record.

use super::{fill, patterns, translation};

/// Between the parts of what is on record.
const MARKS: [&str; 3] = [": ", "; ", ", "];

/// What is on record, an outcome or a reason, in the language of this thread; as it is where it is nothing known.
/// Of an outcome each part is read by itself: `failed: not true within the time limit, step 3 of 9; safe state written`.
pub fn recorded(text: &str) -> String {
    if let Some(translated) = translation(text) {
        return translated.to_owned();
    }
    let is_part = |value: &str| MARKS.iter().all(|mark| !value.contains(mark));
    let known = |pattern: &&'static str| {
        let values = values(pattern, text).filter(|values| values.iter().all(|(_, value)| is_part(value)));
        Some((translation(pattern)?, values?))
    };
    if let Some((translated, values)) = patterns().iter().find_map(known) {
        return filled(translated, values, recorded);
    }
    let parts = MARKS.into_iter().find_map(|mark| Some((text.split_once(mark)?, mark)));
    parts.map_or_else(|| text.to_owned(), |((one, other), mark)| recorded(one) + mark + &recorded(other))
}

/// A translated pattern with its values, each translated by itself.
fn filled(pattern: &str, values: Vec<(&str, &str)>, inner: fn(&str) -> String) -> String {
    let values: Vec<_> = values.into_iter().map(|(name, value)| (name, inner(value))).collect();
    let values: Vec<(&str, &dyn std::fmt::Display)> =
        values.iter().map(|(name, value)| (*name, value as &dyn std::fmt::Display)).collect();
    fill(pattern, &values)
}

/// What stands in the places of a pattern; `None` if the text does not fit it.
fn values<'a>(pattern: &'static str, text: &'a str) -> Option<Vec<(&'static str, &'a str)>> {
    let (before, mut places) = pattern.split_once('{').map_or((pattern, None), |(before, rest)| (before, Some(rest)));
    let mut text = text.strip_prefix(before)?;
    let mut values = Vec::new();
    while let Some((name, after)) = places.and_then(|rest| rest.split_once('}')) {
        let (between, next) = after.split_once('{').map_or((after, None), |(between, rest)| (between, Some(rest)));
        let end = if next.is_none() { text.strip_suffix(between)?.len() } else { text.find(between)? };
        values.push((name, &text[..end]));
        (text, places) = (&text[end + between.len()..], next);
    }
    text.is_empty().then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Language;

    #[test]
    fn a_refusal_on_record_is_read_in_the_language_of_the_terminal() {
        let thai = |outcome: &str| Language::THAI.locale().within(|| recorded(outcome));
        for refusal in ["wrong name or password; wait 8 s", "this needs a supervisor, you are a viewer", "log in first"]
        {
            let shown = thai(&format!("refused: {refusal}"));
            assert!(!shown.contains(refusal.split(' ').next().unwrap_or_default()), "{shown}");
        }
        assert!(thai("refused: wrong name or password; wait 8 s").ends_with("8 s"));
    }

    #[test]
    fn the_places_of_a_pattern_are_found() {
        assert_eq!(values("a {x} b {y}", "a 1 2 b 3"), Some(vec![("x", "1 2"), ("y", "3")]));
        assert_eq!(values("{x} s", "8 s"), Some(vec![("x", "8")]));
        assert_eq!((values("a {x} b", "a 1 c"), values("a", "ab")), (None, None));
    }
}
