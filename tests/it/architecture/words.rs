//! No text that people see, no comment and no name in the code uses a word that the vocabulary has replaced.

use std::fs;

use super::{
    Breaches, assert_law_counted,
    source::{self, Facts, snippet, walk},
};
use crate::support::sightglass;

/// What is not written, and what is written instead. A word at the end matches its plural too.
const BANNED: &[(&str, &str)] = &[
    ("a password of your own", "choose a new password"),
    ("anew", "reload, refresh, again"),
    ("asked again", "retries"),
    ("book of deeds", "audit log"),
    ("deed", "operator action"),
    ("draw everything", "redraw"),
    ("gave no values", "did not respond"),
    ("gives no values", "not responding"),
    ("he", "the user, the operator"),
    ("held still", "paused"),
    ("him", "the user, the operator"),
    ("his", "of the user"),
    ("in doubt", "bad or uncertain"),
    ("judge", "evaluate"),
    ("judged", "evaluated"),
    ("let go", "reset"),
    ("let in again", "enabled"),
    ("mend", "clear"),
    ("mended", "cleared"),
    ("no curve yet", "collecting data"),
    ("nobody", "no user, no terminal, none"),
    ("not as usual", "abnormal"),
    ("one round at worst", "worst-case scan time"),
    ("put aside", "shelved, suppressed or out of service"),
    ("raised quietly", "active (suppressed)"),
    ("read over", "gap registers read"),
    ("really so", "actual"),
    ("returned quietly", "cleared (suppressed)"),
    ("sent late by", "polling delay"),
    ("set value", "setpoint"),
    ("shut out", "disabled"),
    ("somebody", "a user, another terminal"),
    ("stands still", "does not change"),
    ("told", "reported, sent, said"),
    ("which frames", "filter frames"),
    ("wish", "request"),
    ("wished", "requested"),
];

/// The banned words of a text, each with its replacement.
fn banned(text: &str) -> Vec<String> {
    // What stands in braces is replaced before a person sees it.
    let seen: String = text.split('{').map(|part| part.split_once('}').map_or(part, |(_, after)| after)).collect();
    let text = seen.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ");
    let mut found = Vec::new();
    for (word, instead) in BANNED {
        let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
        for (at, _) in text.match_indices(word) {
            let rest = &text[at + word.len()..];
            let ends = [rest, rest.strip_prefix("es").unwrap_or(rest), rest.strip_prefix('s').unwrap_or(rest)];
            let is_whole = !text[..at].ends_with(is_part) && ends.iter().any(|end| !end.starts_with(is_part));
            if is_whole {
                found.push(format!("`{word}` (instead: {instead})"));
            }
        }
    }
    found
}

/// Literals in production code: screens, logs, errors, reports, keys of files.
fn in_literals(files: &[Facts]) -> Breaches {
    let mut breaches = Breaches::new();
    // The table of old keys has to name them.
    for file in files.iter().filter(|file| !file.test_file && file.path != "src/profile/renamed.rs") {
        for text in file.texts.iter().filter(|text| !text.in_test) {
            for word in banned(&text.text) {
                let line = format!("  line {}: {word} in {:?}", text.line, text.text);
                breaches.entry(file.path.clone()).or_default().push(line);
            }
        }
    }
    breaches
}

/// Words that neither comments nor names may use either.
const BANNED_IN_CODE: &[&str] = &["anew", "deed", "deeds", "nobody", "somebody", "told", "wish", "wished", "wishes"];

/// The comments and names of a line of code: all but its literals.
fn without_literals(line: &str) -> String {
    let line = line.replace("\\\"", "");
    let (code, comment) = line.split_once("//").unwrap_or((&line, ""));
    code.split('"').step_by(2).chain([comment]).collect::<Vec<_>>().join(" ")
}

/// Comments and names, in tests too. The lines of a literal that spans several count as well.
fn in_code(files: &[(String, String)]) -> Breaches {
    let mut breaches = Breaches::new();
    // These laws have to name the words.
    for (path, text) in files.iter().filter(|(path, _)| !path.starts_with("tests/it/architecture/")) {
        for (line, code) in text.lines().enumerate().map(|(line, code)| (line + 1, without_literals(code))) {
            let words = code.split(|letter: char| !letter.is_alphanumeric()).map(str::to_lowercase);
            for word in words.filter(|word| BANNED_IN_CODE.contains(&word.as_str())) {
                breaches.entry(path.clone()).or_default().push(format!("  line {line}: `{word}`"));
            }
        }
    }
    breaches
}

/// Files that people read or write themselves.
fn in_documents() -> Breaches {
    let mut documents = vec![("README.md".to_owned(), fs::read_to_string(source::root().join("README.md")).unwrap())];
    walk(&source::root().join("profiles"), "toml", &mut documents);
    walk(&source::root().join("profiles"), "md", &mut documents);
    let mut breaches = Breaches::new();
    for (path, text) in documents {
        // A phrase may run over the end of a line.
        let text = text.lines().map(|line| line.trim_start_matches(['#', '>', ' '])).collect::<Vec<_>>().join(" ");
        let found = banned(&text);
        if !found.is_empty() {
            breaches.insert(path, found);
        }
    }
    breaches
}

/// The help of a command and of everything below it.
fn in_help(command: &[String], breaches: &mut Breaches) {
    let output = sightglass().args(command).arg("--help").output().unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && help.contains("Usage:"), "{command:?}: {help}");
    let found = banned(&help);
    if !found.is_empty() {
        breaches.insert(format!("sightglass {}", [command, &["--help".to_owned()]].concat().join(" ")), found);
    }
    let listed = help.split("Commands:\n").nth(1).unwrap_or("").lines().take_while(|line| !line.trim().is_empty());
    let names = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    for name in names.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help") {
        in_help(&[command, &[name.to_owned()]].concat(), breaches);
    }
}

#[test]
fn no_text_uses_a_banned_word() {
    let mut breaches = in_literals(&source::ALL);
    breaches.append(&mut in_documents());
    in_help(&[], &mut breaches);
    assert_law_counted("banned_words", breaches);
}

#[test]
fn no_comment_or_name_uses_a_banned_word() {
    let mut files = Vec::new();
    for folder in ["src", "tests"] {
        walk(&source::root().join(folder), "rs", &mut files);
    }
    assert_law_counted("banned_in_code", in_code(&files));
}

#[test]
fn a_banned_word_in_code_is_seen() {
    let check = |path: &str, text: &str, expected: usize| {
        let found = in_code(&[(path.to_owned(), text.to_owned())]);
        assert_eq!(found.values().map(Vec::len).sum::<usize>(), expected, "{text}");
    };
    check("src/a.rs", "// Nobody is told.", 2);
    check("src/a.rs", "fn nobody_is_there() {}", 1);
    check("src/a.rs", "let user = \"nobody\"; // the user", 0);
    check("src/a.rs", "let user = \"a \\\"wish\\\"\"; // a wish", 1);
    check("tests/it/architecture/words.rs", "// nobody", 0);
}

#[test]
fn a_banned_word_is_seen() {
    let check = |text: &str, expected: usize| assert_eq!(banned(text).len(), expected, "{text}");
    check("Nobody is logged in", 1);
    check("the deeds of a shift", 1);
    check("put\n  aside", 1);
    check("wishes and wished", 2);
    check("he is here; the anewt, indeed, toldo, in doubtful", 1);
    check("the heater, deed_id, {deed}, {told:?}", 0);
    let literals = |text: &str| in_literals(&snippet("src/a.rs", text)).values().map(Vec::len).sum::<usize>();
    assert_eq!(literals("fn f() { tracing::info!(%x, \"told {}\", y) }"), 1, "in a macro");
    assert_eq!(literals("#[error(\"nobody\")] struct S;"), 1, "in an attribute");
    assert_eq!(literals("const A: &[(&str, &str)] = &[(\"x\", \"his\")];"), 1, "in a table");
    assert_eq!(literals("/// nobody\nfn nobody() { wish::<Deed>(1) }"), 0, "no text");
    assert_eq!(literals("#[test] fn f() { \"nobody\"; }"), 0, "a test");
}
