//! Modules form a line, not a graph: a module uses only what stands before it.

use std::fs;

use super::source::{self, Facts, snippet};

/// Modules in reading order; a module may use only what stands before it.
const LINE: [&str; 15] = [
    "text",
    "plant",
    "profile",
    "bus",
    "register_map",
    "sim",
    "report",
    "history",
    "access",
    "north",
    "station",
    "attach",
    "ui",
    "cli",
    "api",
];

fn breaches(files: &[Facts]) -> Vec<String> {
    let position = |name: &str| LINE.iter().position(|module| *module == name);
    let mut wrong = Vec::new();
    for file in files {
        let own = position(file.top_module());
        for name in file.production_names() {
            let mut segments = name.path.split("::");
            let used = segments.next().filter(|first| *first == "crate").and(segments.next());
            let is_right = used.and_then(position).zip(own).is_some_and(|(used, own)| used > own);
            // The binary knows the command line and nothing else.
            let escapes = file.path == "src/main.rs" && used.is_some_and(|module| module != "cli");
            if is_right || escapes {
                wrong.push(format!("{}:{} uses {}", file.path, name.line, name.path));
            }
        }
    }
    wrong
}

#[test]
fn modules_form_a_line() {
    let wrong = breaches(&source::ALL);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn lib_lists_private_modules_in_order_then_their_surface() {
    let text = fs::read_to_string(source::root().join("src/lib.rs")).unwrap();
    let modules = |prefix: &str| -> Vec<&str> {
        text.lines().filter_map(|line| line.strip_prefix(prefix)?.strip_suffix(';')).collect()
    };
    assert_eq!([modules("mod "), modules("pub mod ")].concat(), LINE);
    assert_eq!(modules("pub mod "), ["api"]);
}

#[test]
fn every_spelling_of_a_step_back_is_seen() {
    let check = |path: &str, text: &str| {
        let wrong = breaches(&snippet(path, text));
        assert_eq!(wrong.len(), 1, "{path}: {text}: {wrong:?}");
    };
    check("src/plant/sample.rs", "use crate::ui::Model;");
    check("src/plant/sample.rs", "use crate::{profile as p};");
    check("src/plant/sample.rs", "use crate::{self as root, plant::{tag::Tag}}; fn f() { root::ui::draw() }");
    check("src/plant/sample.rs", "use super::super::bus::Frame;");
    check("src/plant/alarm/manager.rs", "use super::super::super::{cli};");
    check("src/plant/mod.rs", "fn f() -> self::super::bus::Frame { panic!() }");
    check("src/bus/mod.rs", "fn f() { let x: Vec<crate::sim::World> = vec![]; }");
    check("src/bus/mod.rs", "fn f() { println!(\"{}\", crate::sim::NAME) }");
    check("src/bus/mod.rs", "macro_rules! m { () => { $crate::sim::NAME } }");
    check("src/bus/mod.rs", "mod inner { use super::super::sim::World; }");
    check("src/bus/mod.rs", "#[serde(with = \"x\", from = crate::ui::X)] struct S;");
    check("src/bus/mod.rs", "#[cfg(test)] mod tests { use crate::ui::X; } use crate::sim::World;");
    check("src/bus/mod.rs", "#[cfg(any(test, unix))] use crate::sim::World;");
    check("src/ui/mod.rs", "use crate::api::plant::Plant;");
    check("src/main.rs", "fn main() { sightglass::ui::run() }");
}

#[test]
fn a_re_export_hides_no_step_back() {
    let files = [("src/plant/mod.rs", "pub use super::ui::Model;"), ("src/plant/tag.rs", "use super::Model;")];
    let files: Vec<_> = files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
    assert_eq!(breaches(&source::facts(&files)).len(), 2, "the re-export and its use");
}

#[test]
fn tests_and_texts_may_name_any_module() {
    let check = |path: &str, text: &str| assert_eq!(breaches(&snippet(path, text)), Vec::<String>::new(), "{text}");
    check("src/plant/sample.rs", "//! crate::ui\n// crate::ui\n/// [`crate::ui`]\nfn f() { \"crate::ui::X\"; }");
    check("src/plant/sample.rs", "#[cfg(test)] mod tests { use crate::ui::X; }");
    check("src/plant/sample.rs", "#[cfg(all(test, unix))] use crate::ui::X;");
    check("src/plant/sample.rs", "struct S { #[cfg(test)] x: crate::ui::X }");
    check("src/plant/sample.rs", "impl S { #[cfg(test)] fn f() { crate::ui::x() } }");
    check("src/plant/sample.rs", "fn f() { #[cfg(test)] let x = crate::ui::x(); }");
    check("src/plant/sample.rs", "#![cfg(test)] use crate::ui::X;");
    check("src/ui/mod.rs", "use crate::{plant::Plant, bus}; use super::history;");
}

#[test]
fn a_file_behind_cfg_test_is_a_test() {
    let files = [
        ("src/plant/mod.rs", "#[cfg(test)]\npub(crate) mod fixture;\n#[cfg(test)] #[path = \"a/tests.rs\"] mod tests;"),
        ("src/plant/fixture.rs", "mod deep; use crate::ui::X;"),
        ("src/plant/fixture/deep.rs", "use crate::ui::X;"),
        ("src/plant/a/tests.rs", "use crate::ui::X;"),
        ("tests/it/main.rs", "use sightglass::ui::X;"),
    ];
    let files: Vec<_> = files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
    assert_eq!(breaches(&source::facts(&files)), Vec::<String>::new());
}
