//! The laws of the house, held against the syntax tree of every file:
//!
//! | file | law |
//! |---|---|
//! | `line` | modules form a line; the crate lists them in reading order |
//! | `rooms` | within a module its rooms form a line, in the order in which it declares them |
//! | `edge` | only `io`, and named files of `station` and `cli`, touch the outside world |
//! | `size` | files below 400 lines, functions below 70, a header in every file |
//! | `style` | tests assert visibly, have short names and no wall clock |
//! | `arms` | a decision over an own enum names every variant |
//! | `words` | no text that people see uses a banned word |
//!
//! Each law is a function from the facts of files to complaints, and has a test with a snippet that breaks it.
//! `exceptions.toml` lists what does not hold them yet. It may only shrink: a number that is too large is an error too, and
//! `SHRINK_EXCEPTIONS=1 cargo test --release --test it architecture` writes the smaller one.

use std::{collections::BTreeMap, sync::Mutex};

mod arms;
mod edge;
mod line;
mod reader;
mod rooms;
mod size;
mod source;
mod style;
mod words;

/// A place that breaks a law: how often, and what a person reads about it.
type Breaches = BTreeMap<String, Vec<String>>;

fn exceptions(law: &str) -> BTreeMap<String, usize> {
    let all: BTreeMap<String, BTreeMap<String, usize>> = toml::from_str(include_str!("exceptions.toml")).unwrap();
    all.get(law).cloned().unwrap_or_default()
}

/// What differs between the breaches and the exceptions of a law; each line says what to write there instead.
fn compare(breaches: &BTreeMap<String, (usize, String)>, exceptions: &BTreeMap<String, usize>) -> Vec<String> {
    let mut wrong = Vec::new();
    for (place, (number, what)) in breaches {
        let allowed = exceptions.get(place).copied().unwrap_or_default();
        if *number > allowed {
            wrong.push(format!("{place}: {number}, at most {allowed} allowed\n{what}"));
        } else if *number < allowed {
            wrong.push(format!("the exception shrinks to `\"{place}\" = {number}`"));
        }
    }
    for place in exceptions.keys().filter(|place| !breaches.contains_key(*place)) {
        wrong.push(format!("the exception `\"{place}\"` is no longer needed"));
    }
    wrong
}

/// The text of the exceptions with the numbers of a law that may shrink, and without those that nothing needs.
fn shrink(text: &str, law: &str, breaches: &BTreeMap<String, (usize, String)>) -> String {
    let mut section = "";
    let mut kept = String::new();
    for line in text.lines() {
        section = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')).unwrap_or(section);
        let entry = line.strip_prefix('"').and_then(|line| line.split_once("\" = ")).filter(|_| section == law);
        let Some((place, number)) = entry else {
            kept += &format!("{line}\n");
            continue;
        };
        let allowed: usize = number.parse().unwrap();
        if let Some((present, _)) = breaches.get(place) {
            kept += &format!("\"{place}\" = {}\n", allowed.min(*present));
        }
    }
    kept
}

/// Fails if a law is broken beyond its exceptions, or if an exception is larger than needed. With the variable
/// `SHRINK_EXCEPTIONS` the latter is mended in the file.
fn assert_law(law: &str, breaches: &BTreeMap<String, (usize, String)>) {
    static FILE: Mutex<()> = Mutex::new(());
    if std::env::var_os("SHRINK_EXCEPTIONS").is_some() {
        let _alone = FILE.lock().unwrap();
        let path = source::root().join("tests/it/architecture/exceptions.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, shrink(&text, law, breaches)).unwrap();
        return;
    }
    let wrong = compare(breaches, &exceptions(law));
    assert!(wrong.is_empty(), "[{law}] in tests/it/architecture/exceptions.toml:\n{}", wrong.join("\n"));
}

/// As [`assert_law`], where every breach counts one.
fn assert_law_counted(law: &str, breaches: Breaches) {
    let counted = breaches.into_iter().map(|(place, found)| (place, (found.len(), found.join("\n"))));
    assert_law(law, &counted.collect());
}

#[test]
fn an_exception_may_only_shrink() {
    let breaches = BTreeMap::from([("a.rs".to_owned(), (3, "what".to_owned()))]);
    let check = |allowed: &[(&str, usize)], expected: &str| {
        let allowed = allowed.iter().map(|(place, number)| ((*place).to_owned(), *number)).collect();
        let wrong = compare(&breaches, &allowed).join("; ");
        assert!(wrong.contains(expected) && wrong.is_empty() == expected.is_empty(), "{wrong}");
    };
    check(&[("a.rs", 3)], "");
    check(&[], "a.rs: 3, at most 0 allowed\nwhat");
    check(&[("a.rs", 2)], "a.rs: 3, at most 2 allowed");
    check(&[("a.rs", 4)], "shrinks to `\"a.rs\" = 3`");
    check(&[("a.rs", 3), ("b.rs", 1)], "`\"b.rs\"` is no longer needed");
}

#[test]
fn exceptions_shrink_in_their_own_law_alone() {
    let text = "# Words.\n\n[a]\n\"x.rs\" = 3\n\"y.rs\" = 2\n\"z.rs\" = 1\n\n[b]\n\"x.rs\" = 3\n";
    let breaches = [("x.rs", 1), ("z.rs", 5)].map(|(place, number)| (place.to_owned(), (number, String::new())));
    let expected = "# Words.\n\n[a]\n\"x.rs\" = 1\n\"z.rs\" = 1\n\n[b]\n\"x.rs\" = 3\n";
    assert_eq!(shrink(text, "a", &BTreeMap::from(breaches)), expected);
}
