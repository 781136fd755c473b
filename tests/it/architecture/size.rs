//! Files below 400 lines, functions below 70, and the duty of a file in its first line.

use std::collections::BTreeMap;

use super::{
    assert_law,
    source::{self, Facts, snippet},
};

const FILE_LINES_MAX: usize = 399;
const FUNCTION_LINES_MAX: usize = 69;

fn long_files(files: &[Facts]) -> BTreeMap<String, (usize, String)> {
    let long = files.iter().filter(|file| file.lines > FILE_LINES_MAX);
    long.map(|file| (file.path.clone(), (file.lines, "lines; split it by subject".to_owned()))).collect()
}

fn long_functions(files: &[Facts]) -> BTreeMap<String, (usize, String)> {
    let mut long = BTreeMap::new();
    for file in files.iter().filter(|file| !file.test_file) {
        for function in
            file.functions.iter().filter(|function| !function.in_test && function.lines > FUNCTION_LINES_MAX)
        {
            let place = format!("{} {}", file.path, function.name);
            long.insert(place, (function.lines, format!("lines from line {}", function.line)));
        }
    }
    long
}

fn without_header(files: &[Facts]) -> Vec<&str> {
    files.iter().filter(|file| !file.has_header).map(|file| file.path.as_str()).collect()
}

#[test]
fn files_stay_below_400_lines() {
    assert_law("file_lines", &long_files(&source::ALL));
}

#[test]
fn functions_stay_below_70_lines() {
    assert_law("function_lines", &long_functions(&source::ALL));
}

#[test]
fn every_file_says_its_duty_first() {
    assert_eq!(without_header(&source::ALL), Vec::<&str>::new());
}

#[test]
fn what_is_too_long_is_seen() {
    let lines = |number: usize| "\n".repeat(number);
    assert_eq!(long_files(&snippet("tests/it/a.rs", &lines(400)))["tests/it/a.rs"].0, 400);
    assert!(long_files(&snippet("src/a.rs", &lines(399))).is_empty());
    let check = |text: String, expected: &[(&str, usize)]| {
        let long = long_functions(&snippet("src/a.rs", &text));
        let long: Vec<_> = long.iter().map(|(place, (lines, _))| (place.as_str(), *lines)).collect();
        assert_eq!(long, expected, "{text}");
    };
    check(format!("/// doc\n#[inline]\npub fn long() {{{}}}", lines(69)), &[("src/a.rs long", 70)]);
    check(format!("impl A {{ async fn long(\n) {{{}}} }}", lines(68)), &[("src/a.rs long", 70)]);
    check(format!("trait A {{ fn long() {{{}}} }}", lines(69)), &[("src/a.rs long", 70)]);
    check(format!("fn a() {{ fn inner() {{{}}} }}", lines(69)), &[("src/a.rs a", 70), ("src/a.rs inner", 70)]);
    check(format!("fn short() {{{}}}", lines(68)), &[]);
    check(format!("#[cfg(test)] mod tests {{ fn long() {{{}}} }}", lines(100)), &[]);
}

#[test]
fn a_missing_header_is_seen() {
    assert_eq!(without_header(&snippet("src/a.rs", "// A comment.\nfn f() {}")), ["src/a.rs"]);
    assert!(without_header(&snippet("src/a.rs", "//! Its duty.\nfn f() {}")).is_empty());
}
