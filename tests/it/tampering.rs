//! The audit log changed by hand, and what `sightglass audit verify` says about it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sightglass::api::access::audit_log::{Check, Entry, START, head_text, line};

use crate::support::{Process, folder, sightglass};

/// An audit log as a station leaves it: several lives of it, each with its start and stop.
fn written(folder: &Path) -> PathBuf {
    let audit_log = folder.join("tank.audit.jsonl");
    for _ in 0..3 {
        let mut station = Process::start(
            sightglass()
                .args(["run", "tank", "--for", "1s", "--port", "L1=/dev/none", "--history"])
                .arg(folder.join("tank.duckdb"))
                .env("XDG_STATE_HOME", folder),
        );
        assert_eq!(station.end(), Some(0), "{:?}", station.said);
        let text = fs::read_to_string(&audit_log).unwrap();
        let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
        let anchor = format!("audit log: entry {} {}", last["n"], last["hash"].as_str().unwrap());
        assert!(station.said.contains(&anchor), "the end has its anchor: {:?}", station.said);
    }
    assert!(4 < fs::read_to_string(&audit_log).unwrap().lines().count());
    audit_log
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
fn the_first_bad_line_of_an_edited_audit_log_is_named() {
    let folder = folder();
    let audit_log = written(folder.path());
    let good = fs::read_to_string(&audit_log).unwrap();
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
        ("edited", edited, 1, "this line was changed or inserted"),
        ("cut", without(2), 3, "lines before it were cut out or moved"),
        ("first line cut", without(0), 1, "lines before it were cut out or moved"),
        ("tail cut", lines[..count - 2].concat(), count - 1, &format!("the station has noted {count} entries")),
        ("everything cut", String::new(), 1, "the audit log was cut here"),
        ("half of the tail", good[..good.len() - 20].to_owned(), count, "the audit log was cut here"),
        ("reordered", swapped, 2, "lines before it were cut out or moved"),
        ("doubled", doubled, 4, "it was moved or doubled"),
        ("put in", [lines[0], "{\"n\":2}\n", &lines[1..].concat()].concat(), 2, "the line has no hash at its end"),
    ];
    let head = folder.path().join("tank.audit.head");
    let noted = fs::read_to_string(&head).unwrap();
    for (what, text, line, why) in cases {
        fs::write(&audit_log, text).unwrap();
        for args in [&["--log", audit_log.to_str().unwrap()][..], &["--history", history.to_str().unwrap()]] {
            let (code, said) = verify(folder.path(), args);
            assert_eq!(code, Some(1), "{what}: {said}");
            assert!(said.contains(&format!("line {line}: ")) && said.contains(why), "{what}: {said}");
        }
    }
    // Who knows how can cut the tail and the note that the station keeps of it, but not the rows of the history.
    let second: serde_json::Value = serde_json::from_str(lines[1]).unwrap();
    fs::write(&audit_log, lines[..2].concat()).unwrap();
    fs::write(&head, format!("{:020} {}\n", 2, second["hash"].as_str().unwrap())).unwrap();
    let (code, said) = verify(folder.path(), &["--history", history.to_str().unwrap()]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("line 3: the audit log was cut here: the history holds entry 3"), "{said}");

    fs::write(&audit_log, &good).unwrap();
    fs::write(&head, noted).unwrap();
    assert_eq!(verify(folder.path(), &["--history", history.to_str().unwrap()]).0, Some(0), "as it was");
}

#[test]
fn audit_without_a_comparison_with_the_history_fails() {
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
fn a_book_that_is_not_there_is_reported_by_name() {
    let folder = folder();
    let (code, said) = verify(folder.path(), &["--log", "/nowhere/tank.audit.jsonl"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("/nowhere/tank.audit.jsonl cannot be read"), "{said}");
}

#[test]
fn a_station_continues_an_edited_audit_log_and_names_the_break() {
    let folder = folder();
    let audit_log = written(folder.path());
    let good = fs::read_to_string(&audit_log).unwrap();
    fs::write(&audit_log, good.replacen("\"outcome\":\"done\"", "\"outcome\":\"undone\"", 1)).unwrap();
    written(folder.path());
    let after = fs::read_to_string(&audit_log).unwrap();
    assert!(after.len() > good.len() && after.contains("it is broken at line 1"), "{after}");
    let (code, said) = verify(folder.path(), &["--log", audit_log.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains("line 1: "), "{said}");
}

/// Makes the sealing key and keeps what is printed: elsewhere, for the test.
fn make_key(folder: &Path, name: &str) -> (Option<i32>, PathBuf) {
    let mut command = sightglass();
    command.args(["audit", "key", "tank", "--history"]).arg(folder.join("tank.duckdb"));
    let output = command.env("XDG_STATE_HOME", folder).output().unwrap();
    let path = folder.join(name);
    fs::write(&path, output.stdout).unwrap();
    (output.status.code(), path)
}

/// Writes a log with its chain and its note computed again, as who owns the files can.
fn rewrite(audit_log: &Path, entries: &[Entry]) {
    let (mut text, mut last) = (String::new(), START);
    for entry in entries {
        let (line, chain_hash) = line(last, &entry.clone().chained(last));
        (text, last) = (text + &line, chain_hash);
    }
    fs::write(audit_log, text).unwrap();
    fs::write(audit_log.with_extension("head"), head_text(last)).unwrap();
}

#[test]
fn a_sealed_log_that_was_rewritten_or_cut_is_found() {
    let folder = folder();
    let (code, key) = make_key(folder.path(), "kept");
    assert_eq!(code, Some(0), "{}", fs::read_to_string(&key).unwrap());
    let text = fs::read(folder.path().join("tank.audit.key")).unwrap();
    assert_eq!(make_key(folder.path(), "refused").0, Some(1), "once");
    assert_eq!(fs::read(folder.path().join("tank.audit.key")).unwrap(), text, "the key that was there is left alone");
    let audit_log = written(folder.path());
    let history = folder.path().join("tank.duckdb");
    let verify = |extra: &[&str]| verify(folder.path(), &[&["--log", audit_log.to_str().unwrap()], extra].concat());
    let (code, said) =
        self::verify(folder.path(), &["--history", history.to_str().unwrap(), "--key", key.to_str().unwrap()]);
    assert!(code == Some(0) && said.contains("; 0 entries behind it are not sealed yet"), "{said}");
    let mut check = Check::new(None, &[]);
    let text = fs::read_to_string(&audit_log).unwrap();
    let good: Vec<Entry> = text.lines().map(|line| check.line(line.as_bytes()).unwrap()).collect();
    let seals: Vec<usize> = (0..good.len()).filter(|place| &*good[*place].action == "seal audit log").collect();
    assert!(3 <= seals.len() && seals.last() == Some(&(good.len() - 1)), "at the end of each life: {text}");
    let key = key.to_str().unwrap();
    let found = |entries: &[Entry], line: usize, why: &str| {
        rewrite(&audit_log, entries);
        assert_eq!(verify(&[]).0, Some(0), "the chain is whole");
        let (code, said) = verify(&["--key", key]);
        assert!(code == Some(1) && said.contains(&format!("line {line}: ")) && said.contains(why), "{said}");
    };
    let mut other = good.clone();
    other[seals[1] - 1].outcome = "undone".into();
    found(&other, seals[1] + 1, "seal 1 is wrong: entries before it were changed");
    other.clone_from(&good);
    other.remove(seals[1]);
    (0..).zip(&mut other).for_each(|(place, entry)| entry.n = place + 1);
    found(&other, seals[2], "found seal 2, expected seal 1");
    found(
        &good[..seals[1]],
        seals[1] + 1,
        &format!("the log was cut here: seals 1 to {} are missing", seals.len() - 1),
    );
    found(&good[..1], 2, "seals 0 to ");

    // Not detectable: changes and cuts behind the last seal. The output says how far the seals reach.
    rewrite(&audit_log, &[&good[..], &[Entry { n: good.len() as u64 + 1, ..good[0].clone() }]].concat());
    let (code, said) = verify(&["--key", key]);
    assert!(code == Some(0) && said.contains(&format!("up to entry {} of", good.len())), "{said}");
    assert!(said.contains("; 1 entries behind it are not sealed yet"), "{said}");
    rewrite(&audit_log, &good);
    assert_eq!(fs::read_to_string(&audit_log).unwrap(), text, "as it was");

    let present = audit_log.with_extension("key");
    fs::write(folder.path().join("garbage"), "garbage").unwrap();
    assert_eq!(verify(&["--key", folder.path().join("garbage").to_str().unwrap()]).0, Some(2));
    fs::rename(&present, folder.path().join("moved")).unwrap();
    let (code, said) = verify(&["--key", key]);
    assert!(code == Some(5) && said.contains("it may have been cut behind the last seal"), "{said}");
    let (_, other) = make_key(folder.path(), "other");
    let (code, said) = verify(&["--key", key]);
    assert!(code == Some(1) && said.contains("the station has a key that never followed this one"), "{said}");
    fs::remove_file(&present).unwrap();
    let (code, said) = verify(&["--key", other.to_str().unwrap()]);
    assert!(code == Some(5) && said.contains("nothing yet"), "seals of an earlier key: {said}");
}

#[test]
fn a_station_whose_sealing_key_is_missing_says_so_and_goes_on() {
    let folder = folder();
    make_key(folder.path(), "kept");
    let audit_log = written(folder.path());
    fs::remove_file(audit_log.with_extension("key")).unwrap();
    let mut station = Process::start(
        sightglass()
            .args(["run", "tank", "--port", "L1=/dev/none", "--history"])
            .arg(folder.path().join("tank.duckdb"))
            .env("XDG_STATE_HOME", folder.path()),
    );
    station.wait_for("the sealing key is missing");
    station.signal("TERM");
    assert_eq!(station.end(), Some(0), "{:?}", station.said);
}
