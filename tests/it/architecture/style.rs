//! Tests assert visibly, are named for a behaviour in at most 60 characters, and read no wall clock.

use super::{
    Breaches, assert_law_counted,
    source::{self, Facts, snippet},
};

const NAME_MAX: usize = 60;

/// Files of tests that drive real processes and wait for them with a deadline, or set the clock of the system forward.
/// None of them asserts how fast something was; `masters` asserts that a paced slave is not too fast, which no load breaks.
const WALL_CLOCK: &[&str] = &[
    "src/station/plant_task/tests.rs",
    "src/station/tests.rs",
    "src/ui/io/tests.rs",
    "tests/it/endings.rs",
    "tests/it/masters.rs",
    "tests/it/mqtt.rs",
    "tests/it/outstanding.rs",
    "tests/it/pty.rs",
    "tests/it/reports.rs",
    "tests/it/support.rs",
];

fn tests(files: &[Facts]) -> impl Iterator<Item = (&Facts, &source::Function)> {
    files.iter().flat_map(|file| {
        file.functions.iter().filter(|function| function.is_test).map(move |function| (file, function))
    })
}

fn long_names(files: &[Facts]) -> Breaches {
    let mut long = Breaches::new();
    for (file, test) in tests(files).filter(|(_, test)| test.name.len() > NAME_MAX) {
        let line = format!("  line {}: {} ({} characters)", test.line, test.name, test.name.len());
        long.entry(file.path.clone()).or_default().push(line);
    }
    long
}

fn silent(files: &[Facts]) -> Breaches {
    let mut silent = Breaches::new();
    for (file, test) in tests(files).filter(|(_, test)| !test.asserts) {
        let line = format!(
            "  line {}: {} names no assert…, check…, refuse…, expect_…, until… or wait_for",
            test.line, test.name
        );
        silent.entry(file.path.clone()).or_default().push(line);
    }
    silent
}

fn wall_clocks(files: &[Facts]) -> Vec<String> {
    let is_clock = |path: &str| path.starts_with("std::time::Instant") || path.starts_with("std::time::SystemTime");
    let watched =
        files.iter().filter(|file| !file.path.starts_with("tests/bench/") && !WALL_CLOCK.contains(&file.path.as_str()));
    let names = watched.flat_map(|file| file.test_names().map(move |name| (file, name)));
    names.filter(|(_, name)| is_clock(&name.path)).map(|(file, name)| format!("{}:{}", file.path, name.line)).collect()
}

#[test]
fn test_names_have_at_most_60_characters() {
    assert_law_counted("test_names", long_names(&source::ALL));
}

#[test]
fn every_test_asserts_visibly() {
    assert_law_counted("silent_tests", silent(&source::ALL));
}

#[test]
fn no_test_reads_the_wall_clock() {
    assert_eq!(wall_clocks(&source::ALL), Vec::<String>::new(), "use tokio's paused time, or pass the time");
}

#[test]
fn a_long_name_is_seen() {
    let name = "a".repeat(61);
    for text in [format!("#[test] fn {name}() {{}}"), format!("#[tokio::test] async fn {name}() {{}}")] {
        assert_eq!(long_names(&snippet("tests/it/a.rs", &text)).len(), 1, "{text}");
    }
    let in_proptest = format!("#[cfg(test)] mod tests {{ proptest! {{ #[test] fn {name}(x in 0..9) {{}} }} }}");
    assert_eq!(long_names(&snippet("src/a.rs", &in_proptest)).len(), 1);
    assert!(long_names(&snippet("src/a.rs", &format!("#[cfg(test)] fn {name}() {{}}"))).is_empty(), "no test");
}

#[test]
fn a_silent_test_is_seen() {
    let check = |body: &str, expected: bool| {
        let text = format!("#[test] fn a() {{ {body} }}");
        assert_eq!(silent(&snippet("tests/it/a.rs", &text)).is_empty(), !expected, "{body}");
    };
    check("", true);
    check("let _ = run();", true);
    check("run().unwrap();", true);
    check("\"assert!(true)\";", true);
    check("assert_eq!(1, 1);", false);
    check("for x in 0..9 { insta::assert_snapshot!(x) }", false);
    check("check(1, 2);", false);
    check("let error = run().expect_err(\"refused\");", false);
    check("tokio::select! { x = y => assert!(x) }", false);
}

#[test]
fn a_wall_clock_is_seen() {
    let text = "use std::time::Instant; fn f() { let start = Instant::now(); assert!(start.elapsed() < MAX); }";
    assert_eq!(wall_clocks(&snippet("tests/it/a.rs", text)).len(), 2, "the import and the call");
    assert!(wall_clocks(&snippet("tests/it/a.rs", "use tokio::time::Instant;")).is_empty(), "paused time");
}
