//! Audit log and alarm state on a disk that tears, fails and is tampered with.
#![allow(clippy::unwrap_used)]

use std::{
    fs::{self, OpenOptions},
    io::Write,
    os::unix::fs::PermissionsExt,
};

use super::*;
use crate::{
    access::{
        io::audit_log::{VerifyError, beside, verify},
        sealing::VerificationKey,
    },
    plant::{
        def::Priority,
        record::{AlarmEvent, ChainHash},
    },
};

mod completion;
mod seals;
mod torn;

fn record(what: &str) -> ActionRecord {
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
        chain_hash: None,
    }
}

fn clock() -> Clock {
    Clock::starting_at(jiff::Timestamp::from_second(1_000_000).unwrap(), 1.0)
}

fn group(actions: &[&str], events: &[AlarmEvent]) -> WriteGroup {
    let at = jiff::Timestamp::from_second(1_000_000).unwrap();
    let event = |kind: &AlarmEvent| AlarmRecord::new(at, "TIC-1.PV", "high", Priority::High, *kind);
    WriteGroup {
        actions: actions.iter().map(|what| record(what)).collect(),
        events: events.iter().map(event).collect(),
    }
}

/// What went to the history.
fn stored(rows: &mut mpsc::Receiver<HistoryInput>) -> Vec<ActionRecord> {
    let mut kept = Vec::new();
    while let Ok(input) = rows.try_recv() {
        let HistoryInput::Records(group) = input else { continue };
        kept.extend(group.into_iter().map(|record| match record {
            Record::Action(record) => record,
            other => panic!("{other:?}"),
        }));
    }
    kept
}

/// One life of a station beside `tank.duckdb`: opens the log, writes each of these actions, ends.
fn life(history_file: &Path, actions: &[&str]) -> (Vec<ActionRecord>, Recorded, Opened) {
    let (history, mut rows) = mpsc::channel(64);
    let Handle { groups, recorded, opened, alarms: _, join } = start(history_file, clock(), history);
    for what in actions {
        groups.try_send(Message::WriteGroup(group(&[what], &[]))).unwrap();
    }
    drop(groups);
    join.unwrap().join().unwrap();
    (stored(&mut rows), recorded.borrow().clone(), opened)
}

fn chain_hashes(rows: &[ActionRecord]) -> Vec<ChainHash> {
    rows.iter().filter_map(|row| row.chain_hash).collect()
}

#[test]
fn several_runs_make_one_chain_in_a_private_file() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("tank.duckdb");
    let path = beside(&history);
    assert!(path.ends_with("tank.audit.jsonl"));
    let mut rows = Vec::new();
    for records in [&["start", "write"][..], &[], &["plant file", "stop"]] {
        rows.extend(life(&history, records).0);
    }
    let summary = verify(&path, &chain_hashes(&rows)).unwrap();
    assert_eq!((summary.entries, summary.compared), (4, 4));
    let opened = life(&history, &[]).2;
    assert!(opened.plant_file_since.is_some());
    let expect = Opened { plant_file: Some("x".into()), ..Opened::default() };
    assert_eq!(Opened { plant_file_since: None, ..opened }, expect);
    for file in [path.clone(), path.with_extension("head")] {
        assert_eq!(fs::metadata(file).unwrap().permissions().mode() & 0o777, 0o600);
    }
}

#[test]
fn a_tampered_log_is_reported_kept_and_continued() {
    for (what, line) in [("changed", 2), ("cut in the middle", 2), ("cut at the end", 3), ("removed", 1)] {
        let folder = tempfile::tempdir().unwrap();
        let (history, path) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
        life(&history, &["start", "write", "stop"]);
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
            let (rows, status, _) = life(&history, &["start"]);
            assert!(status.log.unwrap().contains("tampered"), "{what}");
            assert!(rows[0].outcome.contains("broken") && rows.iter().all(|row| row.chain_hash.is_some()), "{what}");
        }
        assert!(fs::read_to_string(&path).unwrap().starts_with(&tampered), "{what}: nothing is ever removed");
        let VerifyError::Bad { bad, .. } = verify(&path, &[]).unwrap_err() else { panic!("{what}") };
        assert_eq!(bad.line, line, "{what}: still the first bad line");
    }
}

#[test]
fn without_a_disk_actions_go_to_the_history_only() {
    let folder = tempfile::tempdir().unwrap();
    let (rows, status, _) = life(&folder.path().join("gone").join("tank.duckdb"), &["start", "write"]);
    assert!(rows.len() == 2 && rows.iter().all(|row| row.chain_hash.is_none()), "each once");
    let trouble = status.log.unwrap();
    assert!(trouble.starts_with("the audit log cannot be written: "), "{trouble}");
    assert!(trouble.contains("2 actions are not in it"), "{trouble}");
    assert_eq!((status.groups, status.waiting), (0, 2));
}

#[test]
fn a_log_removed_while_open_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.audit.jsonl");
    let (mut audit_log, _) = AuditLog::open(&path).unwrap();
    audit_log.append(&mut [record("start")]).unwrap();
    fs::remove_file(&path).unwrap();
    assert!(audit_log.append(&mut [record("write")]).unwrap_err().to_string().contains("removed"));
    let (_, opened) = AuditLog::open(&path).unwrap();
    assert!(opened.wrong[0].contains("broken"), "{opened:?}");
}

#[test]
fn the_latest_plant_file_and_users_file_are_found_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.audit.jsonl");
    let (mut audit_log, _) = AuditLog::open(&path).unwrap();
    let file = |what, new: &str| ActionRecord { new: Some(new.into()), ..record(what) };
    let mut records = [file("plant file", "old"), file("users file", "u"), file("plant file", "p"), record("stop")];
    audit_log.append(&mut records).unwrap();
    drop(audit_log);
    let (_, opened) = AuditLog::open(&path).unwrap();
    assert_eq!((opened.plant_file.as_deref(), opened.users_file.as_deref()), (Some("p"), Some("u")));
}

#[test]
fn a_false_note_of_an_empty_log_begins_no_other_chain() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tank.audit.jsonl");
    let note = crate::access::audit_log::head_text(ChainHash { number: 0, hash: [1; 32] });
    fs::write(path.with_extension("head"), note).unwrap();
    let (mut audit_log, _) = AuditLog::open(&path).unwrap();
    audit_log.append(&mut [record("start")]).unwrap();
    assert_eq!(verify(&path, &[]).unwrap().entries, 1);
}

#[test]
fn actions_that_the_history_does_not_take_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _rows) = mpsc::channel(1);
    let (mut recorder, _) = Recorder::new(&folder.path().join("tank.duckdb"), clock(), history);
    recorder.open();
    for (count, lost) in [(1, 0), (2, 2), (1, 3)] {
        recorder.on_group(group(&vec!["write"; count], &[]));
        recorder.write();
        assert_eq!(recorder.status().lost, lost);
    }
}

#[test]
fn refused_writes_are_unrecorded_until_the_disk_is_back() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("later").join("tank.duckdb");
    let (history, mut rows) = mpsc::channel(64);
    let (mut recorder, found) = Recorder::new(&history_file, clock(), history);
    assert_eq!(found, RestoredAlarms::default());
    recorder.open();
    recorder.on_group(group(&["start", "acknowledge"], &[AlarmEvent::Raised, AlarmEvent::Acknowledged]));
    recorder.write();
    let status = recorder.status();
    assert_eq!((status.groups, status.waiting), (0, 1));
    assert!(status.log.unwrap().contains("2 actions are not in it"));
    assert!(status.alarms.unwrap().contains("the state of the alarms cannot be written"));
    assert_eq!(
        stored(&mut rows).iter().filter(|row| row.chain_hash.is_none()).count(),
        2,
        "in the history all the same"
    );
    fs::create_dir(folder.path().join("later")).unwrap();
    recorder.on_group(group(&["write"], &[]));
    recorder.write();
    assert_eq!(recorder.status().groups, 0, "the log is not opened again before its time");
    recorder.opened_at -= REOPEN;
    recorder.write();
    let status = recorder.status();
    assert_eq!(status.last.map(|chain_hash| chain_hash.number), Some(3));
    assert_eq!(status, Recorded { groups: 2, last: status.last, ..Recorded::default() });
    let rows = stored(&mut rows);
    let sealed: Vec<_> = rows.iter().filter(|row| row.chain_hash.is_some()).map(|row| &*row.action).collect();
    assert_eq!(sealed, ["start", "acknowledge", "write"]);
    assert_eq!(verify(&beside(&history_file), &chain_hashes(&rows)).unwrap().compared, 3);
    let events = AlarmFile::open(&alarm_file::beside(&history_file), clock().now()).1.events.unwrap();
    assert_eq!(events, group(&[], &[AlarmEvent::Raised, AlarmEvent::Acknowledged]).events);
}

#[test]
fn what_the_disk_took_despite_its_error_is_not_written_twice() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let (history, mut rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.on_group(group(&["write", "acknowledge"], &[]));
    recorder.write();
    assert!(chain_hashes(&stored(&mut rows)).is_empty());
    // The first of both has come to the disk.
    life(&history_file, &["start", "write"]);
    recorder.opened_at -= REOPEN;
    recorder.write();
    let log = fs::read_to_string(beside(&history_file)).unwrap();
    let counts = ["start", "write", "acknowledge"].map(|what| log.matches(&format!("\"{what}\"")).count());
    assert_eq!(counts, [1, 1, 1], "{log}");
    let numbers: Vec<u64> = chain_hashes(&stored(&mut rows)).iter().map(|chain_hash| chain_hash.number).collect();
    assert_eq!(numbers, [2, 3]);
    assert_eq!(recorder.status().log, None);
}

#[test]
fn a_long_fault_keeps_the_latest_actions_and_counts_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("later").join("tank.duckdb");
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    recorder.on_group(group(&vec!["write"; PENDING_MAX + 7], &[]));
    recorder.write();
    assert!(recorder.status().log.unwrap().contains(&format!("{} actions are not in it", PENDING_MAX + 7)));
    fs::create_dir(folder.path().join("later")).unwrap();
    recorder.opened_at -= REOPEN;
    recorder.write();
    assert_eq!(recorder.status().log, None);
    let text = fs::read_to_string(beside(&history_file)).unwrap();
    assert_eq!(text.lines().count(), PENDING_MAX + 1);
    assert!(text.lines().next().unwrap().contains("7 actions before this one are not in it"));
}

#[test]
fn a_long_full_disk_leaves_a_trace_in_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let path = beside(&history_file);
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    // The file stays as it is and takes nothing, so it is not opened again.
    recorder.audit_log.as_mut().unwrap().set_file(fs::File::open(&path).unwrap());
    recorder.on_group(group(&vec!["write"; PENDING_MAX + 7], &[]));
    recorder.write();
    assert!(recorder.status().log.unwrap().contains(&format!("{} actions are not in it", PENDING_MAX + 7)));
    recorder.audit_log.as_mut().unwrap().set_file(OpenOptions::new().append(true).open(&path).unwrap());
    recorder.write();
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.lines().next().unwrap().contains("7 actions before this one are not in it"));
    assert_eq!(verify(&path, &[]).unwrap().entries, PENDING_MAX as u64 + 1);
}

#[test]
fn entries_about_the_log_itself_wait_for_the_disk_too() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    life(&history_file, &["start"]);
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    assert!(recorder.is_written());
    recorder.audit_log.as_mut().unwrap().set_file(fs::File::open(beside(&history_file)).unwrap());
    recorder.on_stored(StoredEntries::default());
    recorder.write();
    assert!(!recorder.is_written(), "it is tried again each second");
}

#[test]
fn acknowledgements_survive_without_a_history() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let (history, rows) = mpsc::channel(1);
    drop(rows);
    let Handle { groups, mut recorded, join, .. } = start(&history_file, clock(), history);
    let done = group(&["acknowledge"], &[AlarmEvent::Raised, AlarmEvent::Acknowledged]);
    groups.try_send(Message::WriteGroup(done)).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(recorded.wait_for(|recorded| recorded.groups == 1)).unwrap();
    // Killed here: only what is on disk counts.
    let found = AlarmFile::open(&alarm_file::beside(&history_file), clock().now()).1;
    assert_eq!(found.events.unwrap(), group(&[], &[AlarmEvent::Raised, AlarmEvent::Acknowledged]).events);
    drop(groups);
    join.unwrap().join().unwrap();
}

#[test]
fn files_in_use_by_another_process_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    life(&history_file, &["start"]);
    let state = alarm_file::beside(&history_file);
    let (log, alarms) = (fs::read(beside(&history_file)).unwrap(), fs::read(&state).ok());
    let (other, _) = AuditLog::open(&beside(&history_file)).unwrap();
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    recorder.on_group(group(&["acknowledge"], &[AlarmEvent::Raised, AlarmEvent::Acknowledged]));
    recorder.write();
    let status = recorder.status();
    assert!(status.log.unwrap().contains(IN_USE) && status.alarms.unwrap().contains(IN_USE));
    assert_eq!((fs::read(beside(&history_file)).unwrap(), fs::read(&state).ok()), (log, alarms));
    drop(other);
    recorder.opened_at -= REOPEN;
    recorder.write();
    assert_eq!((recorder.status().log, recorder.status().alarms), (None, None));
    assert_eq!(verify(&beside(&history_file), &[]).unwrap().entries, 2);
}

#[tokio::test]
async fn a_log_that_was_not_waited_for_is_written_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("h.duckdb");
    for (number, max) in [Duration::MAX, Duration::ZERO].into_iter().enumerate() {
        let (records, _rows) = mpsc::channel(8);
        let mut recorder = start_within(max, &history, clock(), records);
        let written = group(&[["first", "second"][number]], &[AlarmEvent::Raised]);
        recorder.groups.try_send(Message::WriteGroup(written)).unwrap();
        recorder.recorded.wait_for(|recorded| recorded.groups == 1).await.unwrap();
        drop(recorder.groups);
        assert!(recorder.join.unwrap().ended().await.unwrap().is_some());
    }
    let log = fs::read_to_string(beside(&history)).unwrap();
    assert!(log.find("first").unwrap() < log.find("second").unwrap());
    assert_eq!(verify(&beside(&history), &[]).unwrap().entries, 2);
}
