//! The rooms of a module form a line too: each uses only those that its `mod.rs` declares before it.

use std::{collections::BTreeSet, fs};

use super::{
    Breaches, assert_law_counted,
    source::{self, Facts, snippet},
};

/// The rooms of a module in the order of their declarations, without those of tests.
fn declared(text: &str) -> Vec<&str> {
    let lines = [""].into_iter().chain(text.lines()).zip(text.lines());
    let of_tests = |before: &str| before.starts_with("#[cfg(") && before.contains("test");
    lines
        .filter(|(before, _)| !of_tests(before))
        .filter_map(|(_, line)| {
            let line = line.strip_prefix("pub(crate) ").or(line.strip_prefix("pub ")).unwrap_or(line);
            line.strip_prefix("mod ")?.strip_suffix(';')
        })
        .collect()
}

/// A step back is counted once for each two rooms, however often it is taken.
fn breaches(files: &[Facts], order: impl Fn(&str) -> Vec<String>) -> Breaches {
    let mut wrong = Breaches::new();
    for module in files.iter().map(Facts::top_module).collect::<BTreeSet<_>>() {
        let rooms = order(module);
        let position = |room: &str| rooms.iter().position(|name| name == room);
        for file in files.iter().filter(|file| file.top_module() == module) {
            let Some(own) = file.path.split('/').nth(2).and_then(|room| position(room.trim_end_matches(".rs"))) else {
                continue;
            };
            for name in file.production_names() {
                let mut segments = name.path.split("::");
                let is_here = segments.next() == Some("crate") && segments.next() == Some(module);
                let used = segments.next().filter(|_| is_here).and_then(position);
                if let Some(used) = used.filter(|used| own < *used) {
                    let place = format!("{module}: {} uses {}", rooms[own], rooms[used]);
                    let found = wrong.entry(place).or_default();
                    if found.is_empty() {
                        found.push(format!("{}:{} uses {}", file.path, name.line, name.path));
                    }
                }
            }
        }
    }
    wrong
}

#[test]
fn rooms_form_a_line() {
    let order = |module: &str| {
        let text = fs::read_to_string(source::root().join(format!("src/{module}/mod.rs"))).unwrap_or_default();
        declared(&text).into_iter().map(str::to_owned).collect()
    };
    assert_law_counted("rooms", breaches(&source::ALL, order));
}

#[test]
fn a_room_that_uses_a_later_one_is_seen() {
    let text = "//! A module.\n\npub mod tag;\nmod alarm;\n#[cfg(test)]\npub mod fixture;\npub(crate) mod snapshot;\n";
    assert_eq!(declared(text), ["tag", "alarm", "snapshot"]);
    let found = |path: &str, text: &str| {
        let order = |_: &str| ["tag", "alarm", "snapshot"].map(str::to_owned).to_vec();
        breaches(&snippet(path, text), order).into_keys().collect::<Vec<_>>()
    };
    let back = ["plant: alarm uses snapshot"];
    assert_eq!(found("src/plant/alarm.rs", "use super::snapshot::Snapshot;"), back);
    assert_eq!(found("src/plant/alarm/lists.rs", "fn f(_: &crate::plant::snapshot::Snapshot) {}"), back);
    for (path, text) in [
        ("src/plant/snapshot.rs", "use super::{alarm, tag::Tag};"),
        ("src/plant/alarm.rs", "use super::tag::Tag; use crate::bus::snapshot::Snapshot;"),
        ("src/plant/mod.rs", "pub use snapshot::Snapshot;"),
        ("src/plant/alarm.rs", "#[cfg(test)] mod tests { use super::super::snapshot::Snapshot; }"),
    ] {
        assert!(found(path, text).is_empty(), "{path}: {text}");
    }
}
