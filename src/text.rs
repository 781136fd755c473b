//! The texts of the screens: the English in the code is the key, a catalogue has each in another language.
//!
//! `t!("Log in")` is a text, `t!("locked until {until}", until)` one with values; the compiler checks the English one and its values.
//! A label of an enum and a row of a key table stay plain English in the code and pass [`translate`] where they are drawn.
//! `text/en.toml` lists all of them, by the file they stand in: a copy of it with other values is another language. A test keeps it complete.
//! In the values U+200B is where a line may break; it takes no column and is dropped where a text is drawn or searched.

mod answers;
mod date;
mod plant;

use std::{cell::Cell, collections::HashMap, fmt::Display, sync::LazyLock};

pub use answers::recorded;
pub use date::{date, weekday};
pub use plant::{ByLanguage, PlantTexts, of_plant};

thread_local! {
    static LOCALE: Cell<Locale> = const { Cell::new(Locale::ENGLISH) };
}

/// A language of the screens: a row of the table of languages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Language(usize);

struct Definition {
    /// ISO 639: in the environment and of `--language`.
    code: &'static str,
    /// What its speakers call it.
    name: &'static str,
    /// Reads its catalogue: empty for the language of the code.
    load: fn() -> Catalogue,
    /// The calendar that its readers are used to.
    calendar: Calendar,
}

/// One row a language.
static LANGUAGES: &[Definition] = &[
    Definition { code: "en", name: "English", load: Catalogue::new, calendar: Calendar::Gregorian },
    Definition {
        code: "th", name: "ไทย", load: || read(include_str!("text/th.toml")), calendar: Calendar::Buddhist
    },
    #[cfg(test)]
    Definition { code: "pseudo", name: "pseudo", load: tests::pseudo, calendar: Calendar::Gregorian },
];

/// The catalogues by language, each read when it is first shown.
static CATALOGUES: LazyLock<Vec<LazyLock<Catalogue>>> =
    LazyLock::new(|| LANGUAGES.iter().map(|language| LazyLock::new(language.load)).collect());

/// The texts with places of a catalogue, those with most words of their own first: what fits several is the most telling.
static PATTERNS: LazyLock<Vec<Vec<&'static str>>> = LazyLock::new(|| {
    let of = |language: usize| -> Vec<&'static str> {
        let own = |text: &str| -> usize {
            text.split('{').map(|part| part.split_once('}').map_or(part, |(_, own)| own).len()).sum()
        };
        let texts = CATALOGUES[language].keys().filter(|text| text.contains('{'));
        let mut all: Vec<(usize, &'static str)> = texts.map(|text| (own(text), text.as_str())).collect();
        all.retain(|(own, _)| PATTERN_MIN <= *own);
        all.sort_by(|one, other| other.cmp(one));
        all.into_iter().map(|(_, text)| text).collect()
    };
    (0..LANGUAGES.len()).map(of).collect()
});

/// Letters of its own that a text with places has at least, so that it is not any text.
const PATTERN_MIN: usize = 6;

/// How the years of a date in words are counted. Dates in figures, files and records are always Gregorian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Calendar {
    /// Common Era.
    Gregorian,
    /// Buddhist Era: 543 years more.
    Buddhist,
}

/// The language of a terminal, and what depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Locale {
    /// The language of its texts.
    pub language: Language,
    /// The years of its dates in words.
    pub calendar: Calendar,
}

type Catalogue = HashMap<String, String>;

fn read(file: &str) -> Catalogue {
    let files: HashMap<String, Catalogue> = toml::from_str(file).expect("a test reads every catalogue");
    files.into_values().flatten().collect()
}

impl Language {
    /// The language of the code.
    pub const ENGLISH: Language = Language(0);
    /// For tests: the language with the most marks.
    #[cfg(test)]
    pub const THAI: Language = Language(1);
    /// For tests: every catalogued text with other and more letters, so that a text outside of `t!` is seen.
    #[cfg(test)]
    pub const PSEUDO: Language = Language(LANGUAGES.len() - 1);

    /// Every language that can be chosen.
    pub fn all() -> impl Iterator<Item = Language> {
        (0..LANGUAGES.len() - usize::from(cfg!(test))).map(Language)
    }
    /// The language of this code, also with a country and an encoding behind it: `th`, `th_TH.UTF-8`.
    pub fn from_code(code: &str) -> Option<Language> {
        let code = code.split(['_', '-', '.', '@']).next()?;
        Language::all().find(|language| language.code().eq_ignore_ascii_case(code))
    }
    /// The language that the environment asks for.
    pub fn detect(env: impl Fn(&str) -> Option<String>) -> Language {
        let set = ["LC_ALL", "LC_MESSAGES", "LANG"].into_iter().filter_map(env).find(|value| !value.is_empty());
        set.and_then(|code| Language::from_code(&code)).unwrap_or(Language::ENGLISH)
    }
    /// `th`.
    pub fn code(self) -> &'static str {
        LANGUAGES[self.0].code
    }
    /// What its speakers call it.
    pub fn name(self) -> &'static str {
        LANGUAGES[self.0].name
    }
    /// The next one of the table, after the last the first.
    pub fn next(self) -> Language {
        Language::all().find(|language| language.0 > self.0).unwrap_or(Language::ENGLISH)
    }
    /// With the calendar that its readers are used to.
    pub fn locale(self) -> Locale {
        Locale { language: self, calendar: LANGUAGES[self.0].calendar }
    }
}

impl Locale {
    /// As the code has it.
    pub const ENGLISH: Locale = Locale { language: Language::ENGLISH, calendar: Calendar::Gregorian };

    /// That of this thread.
    pub fn current() -> Locale {
        LOCALE.get()
    }
    /// Runs `body` with all texts of this thread in this language.
    pub fn within<R>(self, body: impl FnOnce() -> R) -> R {
        let before = LOCALE.replace(self);
        let result = body();
        LOCALE.set(before);
        result
    }
}

/// The text in the language of this thread; the English one where the catalogue has none.
pub fn translate(english: &str) -> &str {
    translation(english).unwrap_or(english)
}

/// The text in the language of this thread, that of its plant first; `None` where neither has one.
pub fn translation(english: &str) -> Option<&'static str> {
    let language = LOCALE.get().language;
    plant::find(language, english).or_else(|| CATALOGUES[language.0].get(english).map(String::as_str))
}

/// The texts with places in the language of this thread.
fn patterns() -> &'static [&'static str] {
    &PATTERNS[LOCALE.get().language.0]
}

/// Makes a file, which is the same whatever language its terminal shows.
pub fn file<R>(make: impl FnOnce() -> R) -> R {
    Locale::ENGLISH.within(make)
}

/// A text as it is searched: without break points, and SARA AM always as one character.
pub fn searchable(text: &str) -> String {
    if text.is_ascii() { text.to_owned() } else { text.replace('\u{200b}', "").replace("\u{e4d}\u{e32}", "\u{e33}") }
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
        let texts = read(include_str!("text/en.toml")).into_iter();
        texts.map(|(english, text)| (english, marked(&text))).collect()
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
        let inside = Language::PSEUDO.locale().within(|| translate("quit"));
        assert_eq!((inside, translate("quit")), ("ⓠúúííⓣ", "quit"));
    }

    #[test]
    fn the_environment_chooses_the_language() {
        let check = |set: &[(&str, &str)], expect: &str| {
            let env = |name: &str| set.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
            assert_eq!(Language::detect(env).code(), expect, "{set:?}");
        };
        check(&[], "en");
        check(&[("LANG", "th_TH.UTF-8")], "th");
        check(&[("LANG", "TH")], "th");
        check(&[("LANG", "en_US.UTF-8"), ("LC_MESSAGES", "th_TH.utf8")], "th");
        check(&[("LANG", "th_TH.UTF-8"), ("LC_ALL", "C")], "en");
        check(&[("LANG", "th_TH.UTF-8"), ("LC_ALL", "")], "th");
        check(&[("LANG", "de_DE.UTF-8")], "en");
    }

    #[test]
    fn the_languages_follow_each_other_in_a_circle() {
        let codes: Vec<_> = Language::all().map(Language::code).collect();
        assert_eq!(codes, ["en", "th"]);
        assert_eq!(Language::ENGLISH.next().name(), "ไทย");
        assert_eq!(Language::ENGLISH.next().next(), Language::ENGLISH);
    }

    #[test]
    fn a_search_sees_neither_break_points_nor_two_spellings() {
        assert_eq!(searchable("ถัง\u{200b}น้ำ"), "ถังน้ำ");
        assert_eq!(searchable("ทํา"), "ทำ");
    }
}
