//! Every text of a screen comes from the catalogue, and longer words break no layout.

use std::collections::BTreeSet;

use super::{model, screen, type_keys};
use crate::{
    text::Language,
    ui::{fixture::Fixture, tabs::Tab, theme::Theme},
};

/// Words that no language changes: letters of controllers, names of protocols, standards and keys.
const SAME: &[&str] = &[
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
];

/// Words of sentences that `plant` and `bus` write with `Display`, of the system's own errors and of cut lines: not in the catalogue yet.
const OPEN: &[&str] = &[
    "No",
    "ago",
    "an",
    "and",
    "asked",
    "because",
    "connected",
    "cool",
    "device",
    "directory",
    "do",
    "fault",
    "ff",
    "file",
    "fill",
    "has",
    "heat",
    "hold",
    "holding",
    "host",
    "idle",
    "it",
    "last",
    "line",
    "other",
    "port",
    "program",
    "read",
    "registers",
    "return",
    "sp",
    "such",
    "te",
    "that",
    "there",
    "where",
];

/// Names and texts of the plant file: everything in quotes.
fn plant_words(fixture: &Fixture) -> BTreeSet<String> {
    let def = format!("{:?}", fixture.def);
    words(&def.split('"').skip(1).step_by(2).collect::<Vec<_>>().join(" ")).collect()
}

/// Runs of two or more ASCII letters; a letter of the test's language ends none.
fn words(text: &str) -> impl Iterator<Item = String> {
    text.split(|letter: char| !letter.is_alphanumeric())
        .filter(|word| word.len() > 1 && word.chars().all(|letter| letter.is_ascii_alphabetic()))
        .map(str::to_owned)
}

#[test]
fn every_text_of_a_screen_is_in_the_catalogue() {
    let tabs: [(Tab, &[&str]); 8] = [
        (Tab::Mimic, &["", "?", "q", "⏎", "s", "C", "w"]),
        (Tab::Trends, &["", "?", "p", "⏎"]),
        (Tab::Alarms, &["", "?", "v", "vv", "vvv", "vvvv", "vvvvv", "⏎", "z", "o"]),
        (Tab::Controllers, &["", "?", "⏎", "T", "f", "⏎p"]),
        (Tab::Reports, &["", "?", "⏎"]),
        (Tab::Bus, &["", "?", "v", "vv", "vvv", "vvvv", "⏎", "w"]),
        (Tab::Users, &["", "?", "n", "⏎"]),
        (Tab::Login, &["", "p", "⏎"]),
    ];
    let mut missed = BTreeSet::new();
    for fixture in [Fixture::normal(), Fixture::alarm(), Fixture::line_down()] {
        let plant = plant_words(&fixture);
        for (tab, typed) in tabs {
            for keys in typed {
                let mut model = model(&fixture, Theme::FULL);
                model.language = Language::Pseudo;
                model.tabs.shown = tab;
                type_keys(&mut model, keys);
                let shown = screen(&mut model, 160, 50);
                missed.extend(words(&shown).filter(|word| !plant.contains(word) && !SAME.contains(&word.as_str())));
            }
        }
    }
    let open: BTreeSet<String> = OPEN.iter().map(ToString::to_string).collect();
    let (new, done): (Vec<_>, Vec<_>) = (missed.difference(&open).collect(), open.difference(&missed).collect());
    assert!(new.is_empty() && done.is_empty(), "in no catalogue: {new:?}; no longer open: {done:?}");
}
