//! The file of preferences, and what they make of a terminal.

use super::*;
use crate::ui::theme::Colours;

fn light() -> Preferences {
    Preferences {
        theme: ThemeName::Light,
        characters: Characters::Blocks,
        pictures: Pictures::Sixel,
        motion: false,
        bell: Bell::Repeated,
        mouse: true,
        language: Some(Language::ENGLISH),
    }
}

#[test]
fn each_user_has_a_section_and_others_the_default() {
    let mut file = PreferencesFile { path: "p.toml".to_owned(), ..PreferencesFile::default() };
    file.set(Some("som chai"), light());
    let dark = Preferences { theme: ThemeName::HighContrast, ..Preferences::default() };
    file.set(None, dark);
    let read = PreferencesFile::read("p.toml", file.text().as_bytes());
    assert_eq!(read, file, "{}", file.text());
    assert_eq!((read.of(Some("som chai")), read.of(Some("anna")), read.of(None)), (light(), dark, dark));
}

#[test]
fn what_is_wrong_in_the_file_has_line_and_expectation() {
    for (text, parts) in [
        ("[default]\ntheme = \"lihgt\"\n", ["p.toml:2:9: unknown theme `lihgt`", "light"]),
        ("[users.anna]\nbel = \"off\"\n", ["p.toml:2:1: unknown key `bel`", "bell"]),
        ("[users]\nanna = 3\n", ["p.toml:2:8: ", "expected a table"]),
        ("[default]\nmotion = \"yes\"\n", ["p.toml:2:10: ", "expected true or false"]),
        ("[default]\nlanguage = \"tlh\"\n", ["p.toml:2:12: unknown language `tlh`", "expected one of en"]),
        ("[default\n", ["p.toml:1:", "TOML syntax error"]),
    ] {
        let line = PreferencesFile::read("p.toml", text.as_bytes()).problem.expect(text);
        assert!(parts.iter().all(|part| line.contains(part)), "{line}");
    }
    assert_eq!(PreferencesFile::read("p.toml", b" \n"), PreferencesFile::new("p.toml", None));
}

#[test]
fn one_wrong_key_does_not_discard_the_others() {
    let text = "[default]\nbell = \"once an alarm\"\n[users.anna]\ntheme = \"pink\"\nmotion = false\n\
                [users.somchai]\ntheme = \"light\"\nmouse = 3\n";
    let file = PreferencesFile::read("p.toml", text.as_bytes());
    let anna = Preferences { motion: false, ..Preferences::default() };
    assert_eq!((file.of(None).bell, file.of(Some("anna"))), (Bell::Once, anna));
    assert_eq!(file.of(Some("somchai")).theme, ThemeName::Light);
    let problem = file.problem.unwrap_or_default();
    assert!(problem.contains("p.toml:4:9: unknown theme `pink`") && problem.ends_with("and 1 more"), "{problem}");
}

#[test]
fn a_terminal_shows_no_more_than_it_can() {
    let chosen = |characters| Preferences { characters, ..Preferences::default() };
    let glyphs = |characters, glyphs| chosen(characters).theme(&Theme { glyphs, ..Theme::FULL }).glyphs;
    assert_eq!(glyphs(Characters::Automatic, Glyphs::Braille), Glyphs::Braille);
    assert_eq!(glyphs(Characters::Blocks, Glyphs::Braille), Glyphs::Block);
    assert_eq!(glyphs(Characters::Blocks, Glyphs::Ascii), Glyphs::Ascii);
    assert_eq!(glyphs(Characters::Automatic, Glyphs::Block), Glyphs::Block);
    assert_eq!(glyphs(Characters::Ascii, Glyphs::Braille), Glyphs::Ascii);
    assert_eq!(light().theme(&Theme::PLAIN).colours, Colours::None, "NO_COLOR holds in every theme");
}

#[test]
fn bookmarks_are_kept_beside_the_choices() {
    let mut file = PreferencesFile { path: "p.toml".to_owned(), ..PreferencesFile::default() };
    let mark = Bookmark { at: crate::ui::fixture::now(), name: "pump \"P-1\" tripped".to_owned() };
    file.set(Some("som chai"), Kept::Bookmarks(vec![mark.clone()]));
    file.set(None, Kept::Bookmarks(vec![mark.clone(), mark.clone()]));
    let read = PreferencesFile::read("p.toml", file.text().as_bytes());
    assert_eq!(read, file, "{}", file.text());
    assert_eq!((read.bookmarks(Some("som chai")).len(), read.bookmarks(None).len()), (1, 2));
    let file = PreferencesFile::read("p.toml", b"[bookmarks]\nanna = [\"yesterday\"]\n");
    assert!(file.problem.is_some_and(|line| line.contains("p.toml:2:9: `yesterday` is not a bookmark")));
}
