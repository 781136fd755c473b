//! The texts of a plant in other languages: `[texts.th]` of a plant file and of its profiles, beside the catalogues of the program.

use std::{
    cell::Cell,
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Language;

thread_local! {
    static TEXTS: Cell<PlantTexts> = const { Cell::new(PlantTexts::NONE) };
}

/// By the code of the language, then by the text as the file has it elsewhere.
pub type ByLanguage = BTreeMap<String, BTreeMap<String, String>>;

/// The texts of a plant in other languages. They are kept until the program ends, as those of the catalogues are: a plant has few, and
/// the same ones again when it is loaded again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlantTexts(&'static ByLanguage);

impl PlantTexts {
    /// A plant whose texts are in one language.
    pub const NONE: PlantTexts = PlantTexts(&BTreeMap::new());

    /// Keeps them.
    pub fn of(texts: ByLanguage) -> PlantTexts {
        static KEPT: Mutex<Vec<PlantTexts>> = Mutex::new(Vec::new());
        if texts.is_empty() {
            return PlantTexts::NONE;
        }
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(same) = kept.iter().find(|known| *known.0 == texts) {
            return *same;
        }
        let new = PlantTexts(Box::leak(Box::new(texts)));
        kept.push(new);
        new
    }

    /// Runs `body` with these before the catalogue of the language of this thread.
    pub fn within<R>(self, body: impl FnOnce() -> R) -> R {
        let before = TEXTS.replace(self);
        let result = body();
        TEXTS.set(before);
        result
    }
}

/// The text of the plant of this thread in this language.
pub(super) fn find(language: Language, text: &str) -> Option<&'static str> {
    let PlantTexts(texts) = TEXTS.get();
    if texts.is_empty() {
        return None;
    }
    texts.get(language.code())?.get(text).map(String::as_str)
}

/// A label or title of the plant in the language of this thread; as it is where the plant has no other. The catalogue of the
/// program is not asked: the same word may mean another thing there.
pub fn of_plant(text: &str) -> &str {
    find(super::LOCALE.get().language, text).unwrap_or(text)
}

impl Default for PlantTexts {
    fn default() -> PlantTexts {
        PlantTexts::NONE
    }
}

impl Serialize for PlantTexts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PlantTexts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<PlantTexts, D::Error> {
        ByLanguage::deserialize(deserializer).map(PlantTexts::of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::translate;

    fn texts(pairs: &[(&str, &str)]) -> PlantTexts {
        let pairs = pairs.iter().map(|(text, thai)| ((*text).to_owned(), (*thai).to_owned())).collect();
        PlantTexts::of(BTreeMap::from([("th".to_owned(), pairs)]))
    }

    #[test]
    fn a_text_of_the_plant_stands_before_that_of_the_catalogue() {
        let thai = Language::THAI.locale();
        let of_plant = texts(&[("Bath temperature", "อุณหภูมิอ่าง"), ("Log in", "เข้า")]);
        let of_catalogue = thai.within(|| translate("Log in"));
        of_plant.within(|| {
            assert_eq!(translate("Bath temperature"), "Bath temperature", "in English");
            thai.within(|| {
                assert_eq!((translate("Bath temperature"), translate("Log in")), ("อุณหภูมิอ่าง", "เข้า"));
                assert_eq!(translate("Sump level"), "Sump level", "what has no translation is as it is");
                PlantTexts::NONE.within(|| assert_eq!(translate("Log in"), of_catalogue, "another plant"));
            });
        });
        assert_eq!(thai.within(|| translate("Log in")), of_catalogue);
    }

    #[test]
    fn the_same_texts_are_kept_once_and_travel_whole() {
        let (one, same) = (texts(&[("Sump", "บ่อ")]), texts(&[("Sump", "บ่อ")]));
        assert!(std::ptr::eq(one.0, same.0) && one != texts(&[("Sump", "บ่อพัก")]));
        let travelled: PlantTexts = serde_json::from_str(&serde_json::to_string(&one).expect("JSON")).expect("texts");
        assert!(std::ptr::eq(one.0, travelled.0));
    }
}
