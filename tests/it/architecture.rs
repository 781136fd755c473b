//! The rules of the house, held by the compiler's own view of the files.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Modules in reading order; a module may use only what stands before it.
const LINE: [&str; 11] =
    ["plant", "profile", "bus", "sim", "report", "history", "access", "station", "attach", "ui", "cli"];

fn sources() -> Vec<(PathBuf, String)> {
    fn walk(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() {
                walk(&entry, found);
            } else if entry.extension().is_some_and(|ending| ending == "rs") {
                let text = fs::read_to_string(&entry).unwrap();
                found.push((entry, text));
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    walk(&root, &mut found);
    assert!(found.len() > 30, "the sources were found");
    // Modules that exist only for tests may use anything.
    let declared: Vec<(PathBuf, String)> = found.clone();
    found.retain(|(path, _)| {
        let parts = path.with_extension("");
        !parts.ancestors().any(|part| {
            let name = part.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let parents = [part.with_file_name("mod.rs"), part.parent().unwrap_or(part).with_extension("rs")];
            declared.iter().any(|(file, text)| {
                parents.contains(file)
                    && ["mod", "pub mod", "pub(crate) mod"]
                        .iter()
                        .any(|word| text.contains(&format!("#[cfg(test)]\n{word} {name};")))
            })
        })
    });
    found.iter().map(|(path, text)| (path.strip_prefix(&root).unwrap().to_owned(), text.clone())).collect()
}

/// The text without tests (they may use anything) and without comments (they may name anything).
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(text);
    let lines = code.lines().map(|line| line.split("//").next().unwrap_or(line));
    lines.collect::<Vec<_>>().join("\n")
}

fn module(path: &Path) -> String {
    path.components().next().unwrap().as_os_str().to_string_lossy().trim_end_matches(".rs").to_owned()
}

#[test]
fn modules_form_a_line() {
    let place = |name: &str| LINE.iter().position(|module| *module == name);
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let Some(own) = place(&module(&path)) else { continue };
        // `use crate::{ a::…, b::… }` names its modules at the start of a line or after a brace.
        let code = code(&text);
        for (index, other) in LINE.iter().enumerate().skip(own + 1) {
            let direct = code.contains(&format!("crate::{other}"));
            let listed = code.split("use crate::{").skip(1).any(|list| {
                let list = list.split(";\n").next().unwrap_or(list);
                list.split(|letter: char| !letter.is_alphanumeric() && letter != '_' && letter != ':')
                    .any(|word| word == *other || word.starts_with(&format!("{other}::")))
            });
            if direct || listed {
                wrong.push(format!("{} uses {other} (place {index}), which stands right of it", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn lib_names_the_modules_in_their_order() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let named: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';')).collect();
    assert_eq!(named, LINE);
}

#[test]
fn the_outside_world_is_spelled_io() {
    let outside = [
        "tokio",
        "duckdb::",
        "std::fs",
        "std::net",
        "std::process",
        "crossterm",
        "SystemTime",
        "Instant::now",
        "Timestamp::now",
        "Zoned::now",
    ];
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let edge = path.components().any(|part| part.as_os_str() == "io" || part.as_os_str() == "io.rs")
            || ["station", "cli", "main"].contains(&module(&path).as_str());
        // The vocabulary of keys and colours is crossterm's; only its input and output are outside.
        let code = code(&text).replace("crossterm::event::{Key", "").replace("crossterm::event::Key", "");
        for word in outside.into_iter().filter(|word| !edge && code.contains(word)) {
            wrong.push(format!("{} names {word}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_file_says_its_duty_first() {
    let silent: Vec<_> =
        sources().into_iter().filter(|(_, text)| !text.starts_with("//! ")).map(|(path, _)| path).collect();
    assert!(silent.is_empty(), "{silent:?}");
}
