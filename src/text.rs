//! The texts of the screens: the English in the code is the key, a catalogue has each in another language.
//!
//! `t!("Log in")` is a text, `t!("locked until {until}", until)` one with values; the compiler checks the English one and its values.
//! A label of an enum and a row of a key table stay plain English in the code and pass [`translate`] where they are drawn.
//! `text/en.toml` lists all of them, by the file they stand in: a copy of it with other values is another language. A test keeps it complete.

use std::{cell::Cell, collections::HashMap, fmt::Display};

thread_local! {
    static LANGUAGE: Cell<Language> = const { Cell::new(Language::English) };
}

/// A language of the screens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Language {
    /// The language of the code: needs no catalogue.
    #[default]
    English,
    /// For tests: every catalogued text with other and more letters, so that a text without the door is seen.
    #[cfg(test)]
    Pseudo,
}

type Catalogue = HashMap<String, String>;

impl Language {
    /// The language of the code.
    pub const ENGLISH: Language = Language::English;

    /// Every language that can be chosen.
    pub fn all() -> impl Iterator<Item = Language> {
        std::iter::once(Language::ENGLISH)
    }
    /// The language of this code.
    pub fn from_code(code: &str) -> Option<Language> {
        Language::all().find(|language| language.code() == code)
    }
    /// ISO 639: in files.
    pub fn code(self) -> &'static str {
        match self {
            Language::English => "en",
            #[cfg(test)]
            Language::Pseudo => "pseudo",
        }
    }
    /// What its speakers call it.
    pub fn name(self) -> &'static str {
        match self {
            Language::English => "English",
            #[cfg(test)]
            Language::Pseudo => "pseudo",
        }
    }
    /// Runs `body` with all texts of this thread in this language.
    pub fn within<R>(self, body: impl FnOnce() -> R) -> R {
        let before = LANGUAGE.replace(self);
        let result = body();
        LANGUAGE.set(before);
        result
    }

    fn catalogue(self) -> Option<&'static Catalogue> {
        match self {
            Language::English => None,
            #[cfg(test)]
            Language::Pseudo => {
                static PSEUDO: std::sync::LazyLock<Catalogue> = std::sync::LazyLock::new(tests::pseudo);
                Some(&PSEUDO)
            }
        }
    }
}

/// The text in the language of this thread; the English one where the catalogue has none.
pub fn translate(english: &'static str) -> &'static str {
    translation(english).unwrap_or(english)
}

/// The text in the language of this thread, unless that is English.
pub fn translation(english: &str) -> Option<&'static str> {
    LANGUAGE.get().catalogue()?.get(english).map(String::as_str)
}

/// The pattern with its `{name}`s replaced by the values.
pub fn fill(pattern: &str, values: &[(&str, &dyn Display)]) -> String {
    let mut filled = String::with_capacity(pattern.len());
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('{') {
        filled.push_str(before);
        let (name, after) = after.split_once('}').unwrap_or((after, ""));
        if let Some((_, value)) = values.iter().find(|(known, _)| *known == name) {
            filled.push_str(&value.to_string());
        }
        rest = after;
    }
    filled + rest
}

/// A text for people, in the language of this thread: `t!("text")`, or `t!("text {name}", name, other = value)`.
#[macro_export]
macro_rules! t {
    ($english:literal) => { $crate::text::translate($english) };
    ($english:literal, $($name:ident $(= $value:expr)?),+ $(,)?) => {
        match $crate::text::translation($english) {
            None => format!($english, $($name = $crate::t!(@value $name $(, $value)?)),+),
            Some(pattern) => $crate::text::fill(
                pattern,
                &[$((stringify!($name), &$crate::t!(@value $name $(, $value)?) as &dyn std::fmt::Display)),+],
            ),
        }
    };
    (@value $name:ident) => { $name };
    (@value $name:ident, $value:expr) => { $value };
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every text of the catalogue with marked letters and doubled vowels; the values keep their places.
    pub(super) fn pseudo() -> Catalogue {
        let files: HashMap<String, Catalogue> = toml::from_str(include_str!("text/en.toml")).expect("en.toml is TOML");
        files.into_values().flatten().map(|(english, text)| (english, marked(&text))).collect()
    }

    fn vowel(letter: char, marked: &str) -> String {
        let place = "aeiou".find(letter.to_ascii_lowercase()).unwrap_or(0);
        marked.chars().nth(place).into_iter().cycle().take(2).collect()
    }

    fn shifted(letter: char, from: char, to: char) -> String {
        char::from_u32(u32::from(letter) - u32::from(from) + u32::from(to)).unwrap_or(letter).to_string()
    }

    fn marked(text: &str) -> String {
        let mut place = false;
        let mark = |letter: char| {
            place = letter == '{' || (place && letter != '}');
            match letter {
                _ if place => letter.to_string(),
                'a'..='z' if "aeiou".contains(letter) => vowel(letter, "áéíóú"),
                'A'..='Z' if "AEIOU".contains(letter) => vowel(letter, "ÁÉÍÓÚ"),
                'a'..='z' => shifted(letter, 'a', 'ⓐ'),
                'A'..='Z' => shifted(letter, 'A', 'Ⓐ'),
                other => other.to_string(),
            }
        };
        text.chars().map(mark).collect()
    }

    #[test]
    fn english_needs_no_catalogue() {
        let (user, left) = ("somchai", 3);
        assert_eq!(t!("Log in"), "Log in");
        assert_eq!(t!("{user} has {tries} attempts", user, tries = left), "somchai has 3 attempts");
    }

    #[test]
    fn another_language_may_order_the_values_as_it_needs() {
        assert_eq!(fill("{b} vor {a}, {b}!", &[("a", &1), ("b", &"x")]), "x vor 1, x!");
        assert_eq!(fill("{unknown} and {", &[]), " and ");
    }

    #[test]
    fn the_language_ends_with_its_body() {
        let inside = Language::Pseudo.within(|| translate("quit"));
        assert_eq!((inside, translate("quit")), ("ⓠúúííⓣ", "quit"));
    }
}
