//! The book changed by hand, and what `sightglass audit verify` says about it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::support::{Process, folder, sightglass};

/// A book as a station leaves it: several lives of it, each with its start and stop.
fn written(folder: &Path) -> PathBuf {
    for _ in 0..3 {
        let mut station = Process::start(
            sightglass()
                .args(["run", "tank", "--for", "1s", "--port", "L1=/dev/none", "--history"])
                .arg(folder.join("tank.duckdb"))
                .env("XDG_STATE_HOME", folder),
        );
        assert_eq!(station.end(), Some(0), "{:?}", station.said);
    }
    let book = folder.join("tank.audit.jsonl");
    assert!(4 < fs::read_to_string(&book).unwrap().lines().count());
    book
}

/// The exit code, and everything that it says.
fn verify(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let mut command = sightglass();
    command.args(["audit", "verify", "tank"]).args(args).env("XDG_STATE_HOME", folder);
    let output = command.output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

#[test]
fn whatever_is_done_to_the_book_by_hand_the_first_bad_line_is_named() {
    let folder = folder();
    let book = written(folder.path());
    let good = fs::read_to_string(&book).unwrap();
    let lines: Vec<&str> = good.split_inclusive('\n').collect();
    let count = lines.len();
    let history = folder.path().join("tank.duckdb");
    let (code, said) = verify(folder.path(), &["--history", history.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains(": whole") && said.contains(&format!("history    {count} of {count} entries")), "{said}");

    let without = |place: usize| [&lines[..place], &lines[place + 1..]].concat().concat();
    let swapped = {
        let mut lines = lines.clone();
        lines.swap(1, 3);
        lines.concat()
    };
    let doubled = [&lines[..3], &lines[2..]].concat().concat();
    let edited = good.replacen("\"outcome\":\"done\"", "\"outcome\":\"undone\"", 1);
    let cases = [
        ("edited", edited, 1, "this line was changed or put in"),
        ("cut", without(2), 3, "lines before it were cut out or moved"),
        ("first line cut", without(0), 1, "lines before it were cut out or moved"),
        ("tail cut", lines[..count - 2].concat(), count - 1, &format!("the station has noted {count} entries")),
        ("everything cut", String::new(), 1, "the book was cut here"),
        ("half of the tail", good[..good.len() - 20].to_owned(), count, "the book was cut here"),
        ("reordered", swapped, 2, "lines before it were cut out or moved"),
        ("doubled", doubled, 4, "it was moved or doubled"),
        ("put in", [lines[0], "{\"n\":2}\n", &lines[1..].concat()].concat(), 2, "this does not end with a hash"),
    ];
    let head = folder.path().join("tank.audit.head");
    let noted = fs::read_to_string(&head).unwrap();
    for (what, text, line, why) in cases {
        fs::write(&book, text).unwrap();
        for args in [&["--book", book.to_str().unwrap()][..], &["--history", history.to_str().unwrap()]] {
            let (code, said) = verify(folder.path(), args);
            assert_eq!(code, Some(1), "{what}: {said}");
            assert!(said.contains(&format!("line {line}: ")) && said.contains(why), "{what}: {said}");
        }
    }
    // Who knows how can cut the tail and the note that the station keeps of it, but not the rows of the history.
    let second: serde_json::Value = serde_json::from_str(lines[1]).unwrap();
    fs::write(&book, lines[..2].concat()).unwrap();
    fs::write(&head, format!("{:020} {}\n", 2, second["hash"].as_str().unwrap())).unwrap();
    let (code, said) = verify(folder.path(), &["--history", history.to_str().unwrap()]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("line 3: the book was cut here: the history holds entry 3"), "{said}");

    fs::write(&book, &good).unwrap();
    fs::write(&head, noted).unwrap();
    assert_eq!(verify(folder.path(), &["--history", history.to_str().unwrap()]).0, Some(0), "as it was");
}

#[test]
fn an_audit_log_that_was_not_compared_with_the_history_is_no_success() {
    let folder = folder();
    written(folder.path());
    let history = folder.path().join("tank.duckdb");
    let args = ["--history", history.to_str().unwrap()];
    let not_compared = |why: &str| {
        let (code, said) = verify(folder.path(), &args);
        assert_eq!(code, Some(5), "{said}");
        assert!(said.contains(": whole") && said.contains("not compared with the history: "), "{said}");
        assert!(said.contains(why), "{said}");
    };
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--port", "L1=/dev/none", "--history"])
            .arg(&history)
            .env("XDG_STATE_HOME", folder.path())
            .env("XDG_RUNTIME_DIR", folder.path()),
    );
    station.wait_for("tags on 1 line");
    not_compared("in use");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{:?}", station.said);
    assert_eq!(verify(folder.path(), &args).0, Some(0));
    fs::remove_file(&history).unwrap();
    not_compared("tank.duckdb");
}

#[test]
fn a_book_that_is_not_there_is_told_by_name() {
    let folder = folder();
    let (code, said) = verify(folder.path(), &["--book", "/nowhere/tank.audit.jsonl"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("/nowhere/tank.audit.jsonl cannot be read"), "{said}");
}

#[test]
fn a_station_goes_on_after_a_book_that_was_changed_and_says_where_it_is_broken() {
    let folder = folder();
    let book = written(folder.path());
    let good = fs::read_to_string(&book).unwrap();
    fs::write(&book, good.replacen("\"outcome\":\"done\"", "\"outcome\":\"undone\"", 1)).unwrap();
    written(folder.path());
    let after = fs::read_to_string(&book).unwrap();
    assert!(after.len() > good.len() && after.contains("it is broken at line 1"), "{after}");
    let (code, said) = verify(folder.path(), &["--book", book.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains("line 1: "), "{said}");
}
