//! Every text of a screen comes from the catalogue, and longer words break no layout.

use std::collections::BTreeSet;

use super::{LANGUAGES, model, replay::replayed, screen, type_keys};
use crate::{
    plant::{def::AlarmId, station_fault::StationFault},
    text::{Language, Locale, PlantTexts, translate},
    ui::{
        Msg,
        fixture::Fixture,
        glyph_filter::cells,
        keys,
        preferences::Preferences,
        tabs::Tab,
        theme::{Glyphs, Theme},
        update,
        widgets::text::take_overwritten,
    },
};

/// Words that no language changes: letters of controllers, names of protocols, standards and keys.
const SAME: &[&str] = &[
    // Typed as a period.
    "week",
    "sightglass",
    "SV",
    "PV",
    "MV",
    "DV",
    "Esc",
    "Tab",
    "Shift",
    "Ctrl",
    "PgUp",
    "PgDn",
    "Home",
    "End",
    "space",
    "RTU",
    "TCP",
    "ASCII",
    "tx",
    "rx",
    "FUJI",
    "UJI",
    "Modbus",
    "SHA",
    "UTF",
    "CSV",
    "English",
    "CRC",
    "LRC",
    "MBAP",
    "TX",
    "RX",
    "exception",
];

/// Screens of the usual terminals; the smallest must show everything.
const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (160, 50)];

/// Words that no catalogue has: names and texts of the plant file (all in quotes), and what the operating system says of a line.
fn given_words(fixture: &Fixture) -> BTreeSet<String> {
    let (def, lines) = (format!("{:?}", fixture.def), format!("{:?}", fixture.snapshot().lines));
    let quoted = |text| str::split(text, '"').skip(1).step_by(2);
    quoted(&def).chain(quoted(&lines)).flat_map(runs).map(|(word, ..)| word.to_lowercase()).collect()
}

/// Runs of letters and digits, each with the characters before and after it.
fn runs(text: &str) -> impl Iterator<Item = (&str, Option<char>, Option<char>)> {
    let words = text.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(move |word| {
        let start = word.as_ptr() as usize - text.as_ptr() as usize;
        (word, text[..start].chars().next_back(), text[start + word.len()..].chars().next())
    })
}

/// Words of two or more ASCII letters that are neither given nor the same in all languages. A letter of the test's
/// language ends no word; the edge of a window cuts one.
fn missed_words(line: &str, given: &BTreeSet<String>) -> Vec<String> {
    let is_edge = |letter: Option<char>| letter.is_some_and(|letter| "│┌┐└┘…█".contains(letter));
    let is_given = |word: &str, before, after| {
        let word = word.to_lowercase();
        given.contains(&word)
            || is_edge(before) && given.iter().any(|whole| whole.ends_with(&word))
            || is_edge(after) && given.iter().any(|whole| whole.starts_with(&word))
    };
    // A byte of a frame may have no digit.
    let is_byte = |word: &str| word.len() == 2 && word.chars().all(|letter| ('A'..='F').contains(&letter));
    let is_word =
        |word: &str| word.len() > 1 && !is_byte(word) && word.chars().all(|letter| letter.is_ascii_alphabetic());
    let missed = |(word, before, after): &(&str, _, _)| {
        is_word(word) && !SAME.contains(word) && !is_given(word, *before, *after)
    };
    runs(line).filter(missed).map(|(word, ..)| word.to_owned()).collect()
}

/// Pages and windows by the keys that lead to them, all of whose texts are in the catalogue.
const PAGES: &[(Tab, &[&str])] = &[
    (Tab::Mimic, &["", "?", "q", "⏎", "s", "C", "w", ":", ":pv", "@", "@x⏎", "Z"]),
    (Tab::Trends, &["", "?", "p", "⏎", "c", "v", "t", "w"]),
    (Tab::Alarms, &["", "?", "v", "vv", "vvv", "vvvv", "vvvvv", "⏎", "z", "o", "n", "r", "t", "A"]),
    (Tab::Controllers, &["", "?", "⏎", "T", "f", "⏎p", "h", "h→", "h→→", "D", "x", "⏎m", "⏎g", "⏎S"]),
    (Tab::Reports, &["", "?", "⏎", "u", "/", ";"]),
    (Tab::Bus, &["B", "B⏎", "Bw", "F", "F⏎", "T", "Ts"]),
    (Tab::Users, &["", "?", "n", "⏎", "j", "r", "p"]),
    (Tab::Login, &["", "p", "⏎"]),
];
/// Those that have words of Modbus, names of files or examples too, which are the same in every language.
const TECHNICAL: &[(Tab, &[&str])] = &[
    (Tab::Alarms, &["/"]),
    (Tab::Controllers, &["c"]),
    (Tab::Reports, &["b"]),
    (Tab::Bus, &["", "?", "Ff", "Tt", "Tf", "Tm", "R", "c"]),
];

/// Draws pages and windows with the texts of a language, in every size.
fn draw_all(language: Language, pages: &[(Tab, &[&str])], mut check: impl FnMut(&Fixture, &str, &str)) {
    let fixtures =
        [Fixture::normal(), Fixture::alarm(), Fixture::line_down(), Fixture::traffic(), Fixture::traffic_trouble()];
    for fixture in fixtures {
        for (tab, typed) in pages {
            for (keys, (width, height)) in typed.iter().flat_map(|keys| SIZES.map(|size| (keys, size))) {
                let mut model = model(&fixture, Theme::FULL);
                model.locale = language.locale();
                model.tabs.shown = *tab;
                type_keys(&mut model, keys);
                let shown = screen(&mut model, width, height);
                check(&fixture, &format!("{tab:?} {keys:?} {width}x{height}"), &shown);
            }
            for (keys, (width, height)) in ["", "?"].iter().flat_map(|keys| SIZES.map(|size| (keys, size))) {
                let mut model = replayed(&fixture, *tab);
                model.locale = language.locale();
                type_keys(&mut model, keys);
                let shown = screen(&mut model, width, height);
                check(&fixture, &format!("{tab:?} {keys:?} {width}x{height} in the past"), &shown);
            }
        }
    }
}

#[test]
fn every_text_of_a_screen_is_in_the_catalogue() {
    let mut missed = BTreeSet::new();
    draw_all(Language::PSEUDO, PAGES, |fixture, place, shown| {
        let given = given_words(fixture);
        for line in shown.lines() {
            let words = missed_words(line, &given);
            missed.extend((!words.is_empty()).then(|| format!("{words:?} in {place}: {line}")));
        }
    });
    assert!(missed.is_empty(), "in no catalogue:\n{}", missed.into_iter().collect::<Vec<_>>().join("\n"));
}

#[test]
fn no_text_overwrites_another_in_any_language() {
    let mut overwritten = BTreeSet::new();
    take_overwritten();
    for language in LANGUAGES {
        draw_all(language, &[PAGES, TECHNICAL].concat(), |_, place, _| {
            let found = take_overwritten().into_iter();
            overwritten.extend(found.map(|texts| format!("{} {place}: {texts}", language.code())));
        });
    }
    assert!(overwritten.is_empty(), "{}", overwritten.into_iter().collect::<Vec<_>>().join("\n"));
}

#[test]
fn no_label_of_the_plant_stays_in_another_language() {
    let mut missed = BTreeSet::new();
    for mut fixture in [Fixture::normal(), Fixture::alarm()] {
        // What the devices and tags are, not what they are called: of more than one word, so that it is no part of another text.
        let def = &fixture.def;
        let of_tags = def.tags.iter().flat_map(|tag| [&tag.label, &tag.meaning, &tag.group]);
        let of_devices = def.devices.iter().map(|device| &device.title);
        let labels = of_tags.chain(of_devices).chain([&def.title]).filter(|text| text.contains(' '));
        let labels: BTreeSet<String> = labels.cloned().collect();
        assert!(5 < labels.len(), "{labels:?}");
        let thai = labels.iter().enumerate().map(|(n, label)| (label.clone(), format!("ป้าย{n}"))).collect();
        fixture.def.texts = PlantTexts::of([("th".to_owned(), thai)].into());
        let mut seen = 0;
        for (tab, keys) in PAGES.iter().flat_map(|(tab, typed)| typed.iter().map(move |keys| (tab, keys))) {
            let mut model = model(&fixture, Theme::FULL);
            model.locale = Language::THAI.locale();
            model.tabs.shown = *tab;
            type_keys(&mut model, keys);
            let shown = screen(&mut model, 160, 50);
            seen += shown.matches("ป้าย").count();
            missed.extend(
                labels
                    .iter()
                    .filter(|label| shown.contains(*label))
                    .map(|label| format!("{label} on {tab:?} {keys:?}")),
            );
        }
        assert!(20 < seen, "{seen}");
    }
    assert!(missed.is_empty(), "{}", missed.into_iter().collect::<Vec<_>>().join("\n"));
}

#[test]
fn every_language_has_room_for_the_way_out() {
    for language in LANGUAGES {
        let ways = language.locale().within(|| [translate("help"), translate("Esc"), "Esc"]).map(cells);
        draw_all(language, &[PAGES, TECHNICAL].concat(), |_, place, shown| {
            let footer = shown.lines().last().unwrap_or_default();
            assert!(ways.iter().any(|way| footer.contains(&**way)), "{} {place}: {footer}", language.code());
        });
    }
}

#[test]
fn a_key_changes_the_language_and_back() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    type_keys(&mut model, "L");
    let thai = screen(&mut model, 80, 24);
    assert!(thai.contains("กราฟ") && !thai.contains("Trends"), "{thai}");
    type_keys(&mut model, "L");
    assert!(screen(&mut model, 80, 24).contains("Trends"));
    // In a form a letter is typed; Ctrl-T works there too.
    model.tabs.shown = Tab::Login;
    type_keys(&mut model, "pL");
    assert_eq!(model.locale(), Locale::ENGLISH);
    update(&mut model, Msg::Key(keys::ctrl('t').event()));
    assert_eq!(model.locale(), Language::THAI.locale());
}

#[test]
fn a_key_goes_before_the_language_that_was_kept() {
    let mut model = model(&Fixture::normal(), Theme::FULL);
    let thai = Preferences { language: Some(Language::THAI), ..Preferences::default() };
    model.preferences_file.set(Some("tech1"), thai);
    update(&mut model, Msg::Tick { silent: std::time::Duration::ZERO });
    assert_eq!(model.locale(), Language::THAI.locale());
    type_keys(&mut model, "L");
    assert_eq!(model.locale(), Locale::ENGLISH);
    // The settings begin with what is shown; there the key changes the choice.
    update(&mut model, Msg::Key(keys::code(crossterm::event::KeyCode::F(2)).event()));
    assert_eq!(model.locale(), Locale::ENGLISH);
    update(&mut model, Msg::Key(keys::ctrl('t').event()));
    assert_eq!(model.locale(), Language::THAI.locale());
    type_keys(&mut model, "⎋");
    assert_eq!(model.locale(), Locale::ENGLISH, "cancelled");
    let mut session = (*model.session).clone();
    session.who = None;
    update(&mut model, Msg::SessionStatus(std::sync::Arc::new(session)));
    assert_eq!(model.locale(), Locale::ENGLISH, "what was chosen stays for a user without a choice");
    update(&mut model, Msg::SessionStatus(crate::ui::fixture::session()));
    assert_eq!(model.locale(), Language::THAI.locale(), "the user finds what was kept");
}

#[test]
fn a_terminal_without_thai_letters_stays_english() {
    for theme in [Theme::PLAIN, Theme { glyphs: Glyphs::Block, ..Theme::FULL }] {
        let mut model = model(&Fixture::normal(), theme);
        type_keys(&mut model, "L");
        assert_eq!(model.locale(), Locale::ENGLISH);
        let shown = screen(&mut model, 80, 24);
        assert!(shown.contains("cannot show the letters of that language"), "{shown}");
    }
}

#[test]
fn thai_of_a_plant_file_is_shown_and_found() {
    let mut fixture = Fixture::normal();
    let tag = fixture.tag("TIC-1.PV");
    fixture.def.title = "ถังน้ำร้อน".into();
    fixture.def.tags[tag.index()].label = "อุณหภูมิน้ำในถัง".into();
    let mut model = model(&fixture, Theme::FULL);
    assert!(screen(&mut model, 80, 24).contains(&*cells("ถังน้ำร้อน")));
    // Typed as two characters it is the same.
    type_keys(&mut model, ":นํา");
    let shown = screen(&mut model, 80, 24);
    assert!(shown.contains("TIC-1.PV") && shown.contains(&*cells("อุณหภูมิน้ำในถัง")), "{shown}");
}

#[test]
fn alarms_of_the_station_are_in_the_language_of_the_screen() {
    for fault in StationFault::ALL {
        let def = fault.alarm(AlarmId(0));
        let texts = [&def.message, &def.guidance.cause, &def.guidance.effect, &def.guidance.action];
        for part in texts.into_iter().flat_map(|text| text.split("; ")) {
            let thai = Language::THAI.locale().within(|| translate(part));
            assert_ne!(thai, part, "{fault:?}");
        }
    }
}
