//! What each user has chosen about looks and sounds of a terminal: one file an account, a section a logged-in user.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use jiff::Timestamp;

use super::{
    Model,
    graphics::Pictures,
    theme::{Glyphs, Theme, ThemeName},
};
use crate::{
    plant::keyword::keyword_enum,
    profile::{
        diagnostic::{Problems, Span},
        reader::{self, At, Node, OptionalKey, Raw, Texts, Value, toml_tables},
    },
    t,
    text::{Language, Locale},
};

keyword_enum! {
    /// Which characters are drawn, as far as the terminal has them.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Characters: "set of characters" {
        /// All that the terminal has.
        #[default]
        Automatic => "automatic",
        /// No braille dots.
        Blocks => "blocks",
        /// Seven bits.
        Ascii => "ASCII",
    }
}

keyword_enum! {
    /// When the bell of the terminal rings.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Bell: "bell" {
        /// Never.
        #[default]
        Off => "off",
        /// Once for each new alarm.
        Once => "once an alarm",
        /// The same, and again while an alarm is unacknowledged.
        Repeated => "until acknowledged",
    }
}

/// What a user has chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preferences {
    /// Colours.
    pub theme: ThemeName,
    /// Characters.
    pub characters: Characters,
    /// The terminal's own pictures.
    pub pictures: Pictures,
    /// Agitators turn and flow arrows travel.
    pub motion: bool,
    /// The bell.
    pub bell: Bell,
    /// The mouse acts; else it selects text, as the terminal has it.
    pub mouse: bool,
    /// The language; `None` is that of the environment.
    pub language: Option<Language>,
}

impl Default for Preferences {
    fn default() -> Preferences {
        Preferences {
            theme: ThemeName::default(),
            characters: Characters::default(),
            pictures: Pictures::default(),
            motion: true,
            bell: Bell::default(),
            mouse: false,
            language: None,
        }
    }
}

impl Preferences {
    /// The looks on a terminal that can show so much.
    pub fn theme(&self, limits: &Theme) -> Theme {
        let glyphs = match (self.characters, limits.glyphs) {
            (Characters::Ascii, _) | (_, Glyphs::Ascii) => Glyphs::Ascii,
            (Characters::Blocks, _) | (_, Glyphs::Block) => Glyphs::Block,
            (Characters::Automatic, Glyphs::Braille) => Glyphs::Braille,
        };
        Theme { name: self.theme, glyphs, motion: self.motion && limits.motion, ..*limits }
    }
}

/// A past instant with a name, to go to again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bookmark {
    /// The instant.
    pub at: Timestamp,
    /// What its user calls it.
    pub name: String,
}

impl Bookmark {
    fn parse(text: &str) -> Option<Bookmark> {
        let (at, name) = text.split_once(' ').unwrap_or((text, ""));
        Some(Bookmark { at: at.parse().ok()?, name: name.to_owned() })
    }
}

#[derive(Debug, Clone, PartialEq)]
pub enum Kept {
    Preferences(Preferences),
    /// All bookmarks.
    Bookmarks(Vec<Bookmark>),
}

impl From<Preferences> for Kept {
    fn from(chosen: Preferences) -> Kept {
        Kept::Preferences(chosen)
    }
}

/// The preferences of all users of an account.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PreferencesFile {
    /// Where it is, for people.
    pub path: String,
    /// What is wrong with it: file, line, found, expected. What is right is used; the file is not written over.
    pub problem: Option<String>,
    /// For a terminal without a login, and for users without a section.
    default: Preferences,
    users: BTreeMap<String, Preferences>,
    /// Bookmarks of each user; those of a terminal without a login are of the empty name.
    bookmarks: BTreeMap<String, Vec<Bookmark>>,
}

toml_tables! {
    /// The file.
    FileTable, "the preferences" {
        opt "default" default: SectionTable,
        opt "users" users: Raw,
        opt "bookmarks" bookmarks: Raw,
    }
    /// What one user has chosen.
    SectionTable, "the preferences of a user" {
        opt "theme" theme: ThemeName,
        opt "characters" characters: Characters,
        opt "pictures" pictures: Pictures,
        opt "motion" motion: bool,
        opt "bell" bell: Bell,
        opt "mouse" mouse: bool,
        opt "language" language: Language,
    }
}

impl Value for Language {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Language> {
        let code = String::read(value, at, problems)?;
        let language = Language::from_code(&code);
        if language.is_none() {
            let known: Vec<&str> = Language::all().map(Language::code).collect();
            problems
                .add(at, format!("unknown language `{code}`"))
                .label(format!("expected one of {}", known.join(", ")));
        }
        language
    }
}

impl PreferencesFile {
    /// Nothing chosen, because there is no file at this path yet, or because of a problem with it.
    pub fn new(path: &str, problem: Option<String>) -> PreferencesFile {
        PreferencesFile { path: path.to_owned(), problem, ..PreferencesFile::default() }
    }

    /// What this user has chosen.
    pub fn of(&self, user: Option<&str>) -> Preferences {
        user.and_then(|user| self.users.get(user)).copied().unwrap_or(self.default)
    }

    /// The bookmarks of this user.
    pub fn bookmarks(&self, user: Option<&str>) -> &[Bookmark] {
        self.bookmarks.get(user.unwrap_or_default()).map_or(&[], Vec::as_slice)
    }

    /// Takes in what this user wants kept.
    pub fn set(&mut self, user: Option<&str>, kept: impl Into<Kept>) {
        match (kept.into(), user) {
            (Kept::Preferences(chosen), Some(user)) => drop(self.users.insert(user.to_owned(), chosen)),
            (Kept::Preferences(chosen), None) => self.default = chosen,
            (Kept::Bookmarks(all), user) => {
                drop(self.bookmarks.insert(user.unwrap_or_default().to_owned(), all));
            }
        }
    }

    /// Reads its text, key by key: where one is wrong, its usual value stands in and the problem is named. An empty text
    /// holds no choice.
    pub fn read(path: &str, bytes: &[u8]) -> PreferencesFile {
        let mut file = PreferencesFile::new(path, None);
        if bytes.trim_ascii().is_empty() {
            return file;
        }
        let mut problems = Problems::default();
        if let Some(raw) = reader::parse(path, bytes, &mut problems) {
            let table = FileTable::of(&[raw], &mut problems);
            file.default = table.default.map_or_else(Preferences::default, |section| of_section(&section.value));
            let users = table.users.map(|users| users.value.table).unwrap_or_default();
            for (user, (_, At { value, at })) in users {
                let section = SectionTable::read(&value, at, &mut problems);
                file.users.extend(section.map(|section| (user, of_section(&section))));
            }
            let bookmarks = table.bookmarks.map(|all| all.value.table).unwrap_or_default();
            for (user, (_, At { value, at })) in bookmarks {
                file.bookmarks.extend(of_bookmarks(&value, at, &mut problems).map(|all| (user, all)));
            }
        }
        if let Err(errors) = problems.finish(()) {
            let first = errors.full_lines().next().unwrap_or_default();
            file.problem = Some(match errors.count() - 1 {
                0 => first,
                more => t!("{first}, and {more} more", first, more),
            });
        }
        file
    }

    pub fn text(&self) -> String {
        let users: toml::Table = self.users.iter().map(|(user, chosen)| (user.clone(), section(chosen))).collect();
        let mut body = toml::Table::new();
        body.insert("default".to_owned(), section(&self.default));
        body.insert("users".to_owned(), users.into());
        let line = |mark: &Bookmark| toml::Value::from(format!("{} {}", mark.at, mark.name));
        let all = |marks: &Vec<Bookmark>| marks.iter().map(line).collect::<Vec<_>>().into();
        let kept = self.bookmarks.iter().filter(|(_, marks)| !marks.is_empty());
        let kept: toml::Table = kept.map(|(user, marks)| (user.clone(), all(marks))).collect();
        if !kept.is_empty() {
            body.insert("bookmarks".to_owned(), kept.into());
        }
        format!("# What users have chosen about the terminals of sightglass; written by its settings (F2).\n\n{body}")
    }
}

fn of_bookmarks(value: &Node, at: Span, problems: &mut Problems) -> Option<Vec<Bookmark>> {
    let mut texts = Vec::new();
    for text in Texts::read(value, at, problems)?.0 {
        match Bookmark::parse(&text.value) {
            Some(bookmark) => texts.push(bookmark),
            None => {
                problems
                    .add(text.at, format!("`{}` is not a bookmark", text.value))
                    .label("expected an instant and a name: `2026-11-21T13:52:31Z pump tripped`");
            }
        }
    }
    Some(texts)
}

fn of_section(section: &SectionTable) -> Preferences {
    let usual = Preferences::default();
    Preferences {
        theme: section.theme.value_or(usual.theme),
        characters: section.characters.value_or(usual.characters),
        pictures: section.pictures.value_or(usual.pictures),
        motion: section.motion.value_or(usual.motion),
        bell: section.bell.value_or(usual.bell),
        mouse: section.mouse.value_or(usual.mouse),
        language: section.language.map(|written| written.value),
    }
}

fn section(chosen: &Preferences) -> toml::Value {
    let keys = [
        ("theme", Some(chosen.theme.word().into())),
        ("characters", Some(chosen.characters.word().into())),
        ("pictures", Some(chosen.pictures.word().into())),
        ("motion", Some(chosen.motion.into())),
        ("bell", Some(chosen.bell.word().into())),
        ("mouse", Some(chosen.mouse.into())),
        ("language", chosen.language.map(|language| language.code().into())),
    ];
    let written = keys.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
    toml::Value::Table(written.collect())
}

impl Model {
    /// The name of who is logged in.
    pub(super) fn user(&self) -> Option<&str> {
        self.session.who.as_ref().map(|who| who.user.as_ref())
    }

    /// The bookmarks of who is logged in.
    pub(super) fn bookmarks(&self) -> &[Bookmark] {
        self.preferences_file.bookmarks(self.user())
    }

    /// Has the terminal the letters of this language?
    pub(super) fn can_show(&self, locale: Locale) -> bool {
        locale.language == Language::ENGLISH || self.theme.has_all_letters()
    }

    /// The preferences were kept, or not: that is said.
    pub(super) fn on_kept(&mut self, kept: Result<PreferencesFile, String>) {
        match kept {
            Ok(file) => self.preferences_file = file,
            Err(why) => self.note = Some(t!("Not kept: {why}", why).into()),
        }
    }
}
