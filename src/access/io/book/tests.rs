//! The book on a disk that tears, fails and is tampered with.
#![allow(clippy::unwrap_used)]

use std::{fs, os::unix::fs::PermissionsExt};

use super::*;

fn deed(what: &str) -> ActionRecord {
    ActionRecord {
        at: jiff::Timestamp::from_second(1_000_000).unwrap(),
        by: "anna".into(),
        from: "here".into(),
        action: what.into(),
        target: "TIC-1.SV".into(),
        old: None,
        new: Some("x".into()),
        outcome: "verified".into(),
        note: None,
        seal: None,
    }
}

/// One life of a station: opens the book, writes each of these deeds, ends. Gives what went to the history.
fn life(path: &Path, deeds: &[&str]) -> (Vec<ActionRecord>, BookStatus, Opened) {
    let (history, mut rows) = mpsc::channel(64);
    let clock = Clock::starting_at(jiff::Timestamp::from_second(1_000_000).unwrap(), 1.0);
    let Handle { deeds: queue, status, opened, join } = start(path, clock, history).unwrap();
    for what in deeds {
        queue.blocking_send(vec![deed(what)]).unwrap();
    }
    drop(queue);
    join.join().unwrap();
    let mut kept = Vec::new();
    while let Ok(batch) = rows.try_recv() {
        kept.extend(batch.into_iter().map(|record| match record {
            Record::Action(deed) => deed,
            other => panic!("{other:?}"),
        }));
    }
    (kept, status.borrow().clone(), opened)
}

fn seals(rows: &[ActionRecord]) -> Vec<Seal> {
    rows.iter().filter_map(|row| row.seal).collect()
}

#[test]
fn deeds_of_several_lives_are_one_chain_and_only_the_station_can_read_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = beside(&folder.path().join("tank.duckdb"));
    assert!(path.ends_with("tank.audit.jsonl"));
    let mut rows = Vec::new();
    for deeds in [&["start", "write"][..], &[], &["plant file", "stop"]] {
        rows.extend(life(&path, deeds).0);
    }
    let summary = verify(&path, &seals(&rows)).unwrap();
    assert_eq!((summary.entries, summary.compared), (4, 4));
    assert_eq!(life(&path, &[]).2, Opened { wrong: Vec::new(), plant_file: Some("x".into()), users_file: None });
    for file in [path.clone(), head_of(&path)] {
        assert_eq!(fs::metadata(file).unwrap().permissions().mode() & 0o777, 0o600);
    }
}

#[test]
fn a_torn_last_line_is_put_beside_and_said_and_the_chain_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.audit.jsonl");
    life(&path, &["start", "write"]);
    let mut file = OpenOptions::new().append(true).open(&path).unwrap();
    file.write_all(b"{\"n\":3,\"utc\":\"20").unwrap();
    assert!(verify(&path, &[]).unwrap().torn);
    let (rows, status, opened) = life(&path, &["start"]);
    assert!(opened.wrong[0].contains("torn"), "{opened:?}");
    assert_eq!((rows.len(), status.trouble), (2, None), "one for the torn line, one for the start");
    assert_eq!(verify(&path, &[]).unwrap().entries, 4);
    let beside = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let beside = beside.filter(|path| path.to_string_lossy().contains("torn")).collect::<Vec<_>>();
    assert_eq!(fs::read_to_string(&beside[0]).unwrap(), "{\"n\":3,\"utc\":\"20");
}

#[test]
fn a_book_that_was_tampered_with_is_said_stays_as_it_is_and_goes_on() {
    for (what, line) in [("changed", 2), ("cut in the middle", 2), ("cut at the end", 3), ("removed", 1)] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tank.audit.jsonl");
        life(&path, &["start", "write", "stop"]);
        let text = fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        let tampered = match what {
            "changed" => text.replacen("\"write\"", "\"wrote\"", 1),
            "cut in the middle" => [lines[0], lines[2]].concat(),
            "cut at the end" => [lines[0], lines[1]].concat(),
            _ => String::new(),
        };
        fs::write(&path, &tampered).unwrap();
        let VerifyError::Bad { bad, .. } = verify(&path, &[]).unwrap_err() else { panic!("{what}") };
        assert_eq!(bad.line, line, "{what}: {bad}");
        for _ in 0..2 {
            let (rows, status, _) = life(&path, &["start"]);
            assert!(status.trouble.unwrap().contains("tampered"), "{what}");
            assert!(rows[0].outcome.contains("broken") && rows.iter().all(|row| row.seal.is_some()), "{what}");
        }
        assert!(fs::read_to_string(&path).unwrap().starts_with(&tampered), "{what}: nothing is ever removed");
        let VerifyError::Bad { bad, .. } = verify(&path, &[]).unwrap_err() else { panic!("{what}") };
        assert_eq!(bad.line, line, "{what}: still the first bad line");
    }
}

#[test]
fn without_a_disk_deeds_go_to_the_history_without_a_seal_and_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gone").join("tank.audit.jsonl");
    let (rows, status, _) = life(&path, &["start", "write"]);
    assert!(rows.len() == 2 && rows.iter().all(|row| row.seal.is_none()));
    assert!(status.trouble.unwrap().starts_with("the audit trail cannot be written: "));
    assert_eq!(status.taken, 2);
}

#[test]
fn a_book_that_is_taken_away_while_it_is_written_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.audit.jsonl");
    let (mut book, _) = Book::open(&path).unwrap();
    book.append(&mut [deed("start")]).unwrap();
    fs::remove_file(&path).unwrap();
    assert!(book.append(&mut [deed("write")]).unwrap_err().to_string().contains("removed"));
    let (_, opened) = Book::open(&path).unwrap();
    assert!(opened.wrong[0].contains("broken"), "{opened:?}");
}

#[test]
fn a_book_whose_disk_comes_back_goes_on_and_says_what_is_missing_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("later").join("tank.audit.jsonl");
    let (history, mut rows) = mpsc::channel(64);
    let clock = Clock::starting_at(jiff::Timestamp::from_second(1_000_000).unwrap(), 1.0);
    let mut scribe = Scribe::new(&path, clock, history);
    scribe.take(vec![deed("start"), deed("write")]);
    assert!(scribe.status().trouble.is_some_and(|trouble| trouble.ends_with("2 deeds are not in it")));
    fs::create_dir(folder.path().join("later")).unwrap();
    scribe.take(vec![deed("write")]);
    assert!(scribe.status().trouble.is_some(), "not tried again before its time");
    scribe.tried = None;
    scribe.take(vec![deed("stop")]);
    assert_eq!(scribe.status(), BookStatus { taken: 4, lost: 0, trouble: None });
    let mut kept = Vec::new();
    while let Ok(batch) = rows.try_recv() {
        kept.extend(batch.into_iter().map(|record| match record {
            Record::Action(deed) => (deed.outcome.to_string(), deed.seal.is_some()),
            other => panic!("{other:?}"),
        }));
    }
    let plain = |sealed| ("verified".to_owned(), sealed);
    let told = ("3 deeds before this one are not in it".to_owned(), true);
    assert_eq!(kept, [plain(false), plain(false), plain(false), told, plain(true)]);
}
