//! The texts of a plant in other languages: the tables `[texts.th]` of a plant file and of its profiles.

use std::collections::HashSet;

use serde_json::Value;

use super::{
    diagnostic::{Problems, Span},
    reader::{At, Raw, Value as _},
};
use crate::{
    plant::def::PlantDef,
    text::{ByLanguage, Language, PlantTexts},
};

/// A text that is translated in a file.
#[derive(Debug)]
pub(super) struct Translated {
    at: Span,
    text: String,
}

/// The texts of these tables, of which the first that has one is right; and where each is translated.
pub(super) fn texts<'a>(
    tables: impl IntoIterator<Item = &'a At<Raw>>,
    problems: &mut Problems,
) -> (PlantTexts, Vec<Translated>) {
    let (mut texts, mut translated) = (ByLanguage::new(), Vec::new());
    for (code, (at, table)) in tables.into_iter().flat_map(|raw| &raw.value.table) {
        if !Language::all().any(|language| language.code() == code) {
            let codes: Vec<&str> = Language::all().map(Language::code).collect();
            let problem = problems.add(*at, format!("unknown language `{code}`"));
            problem.label(format!("expected one of {}", codes.join(", "))).suggest(code, codes);
            continue;
        }
        let Some(table) = Raw::read(&table.value, table.at, problems) else { continue };
        for (text, (at, value)) in &table.table {
            let Some(other) = String::read(&value.value, value.at, problems) else { continue };
            if other.trim().is_empty() {
                problems.add(value.at, format!("`{text}` has no text in `{code}`")).label("expected a text");
                continue;
            }
            texts.entry(code.clone()).or_default().entry(text.clone()).or_insert(other);
            translated.push(Translated { at: *at, text: text.clone() });
        }
    }
    (PlantTexts::of(texts), translated)
}

/// Warns of what is translated and stands nowhere in the plant: it was spelt otherwise, or has been changed.
pub(super) fn warn_unused(def: &PlantDef, translated: &[Translated], problems: &mut Problems) {
    if translated.is_empty() {
        return;
    }
    let mut known = HashSet::new();
    let plant = PlantDef { texts: PlantTexts::NONE, ..def.clone() };
    strings(&serde_json::to_value(&plant).unwrap_or_default(), &mut known);
    for one in translated.iter().filter(|one| !known.contains(&one.text)) {
        let problem = problems.warn(one.at, format!("no text of the plant is `{}`", one.text));
        problem
            .label("expected a text as it is written elsewhere")
            .suggest(&one.text, known.iter().map(String::as_str));
    }
}

/// Every text in it, and each part of a list of steps.
fn strings(value: &Value, found: &mut HashSet<String>) {
    match value {
        Value::String(text) => {
            found.extend(text.split("; ").map(str::to_owned));
            found.insert(text.clone());
        }
        Value::Array(items) => items.iter().for_each(|item| strings(item, found)),
        Value::Object(fields) => fields.values().for_each(|field| strings(field, found)),
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}
