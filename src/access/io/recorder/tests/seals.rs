//! Seals of the audit log: when they are made, and what a crash or a full disk leaves.

use super::*;

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).unwrap()
}

/// Seals of a log that is whole, and entries behind the last one.
fn sealed(log: &Path, key: &VerificationKey) -> (u64, u64) {
    let (_, sealed, is_compared) = sealing::verify(log, &[], key).unwrap_or_else(|error| panic!("{error}"));
    assert!(is_compared);
    (sealed.seals, sealed.unsealed)
}

#[test]
fn a_log_is_sealed_at_start_hourly_and_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let (history_file, log) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
    life(&history_file, &["start"]);
    let key = sealing::make(&log, at(0)).unwrap();
    assert_eq!(sealed(&log, &key), (0, 1));
    let (rows, ..) = life(&history_file, &["start"]);
    assert_eq!(
        rows.iter().filter_map(|row| row.chain_hash).map(|chain_hash| chain_hash.number).collect::<Vec<_>>(),
        [2, 3]
    );
    assert_eq!(sealed(&log, &key), (1, 0), "a seal goes to the history as well, and nothing new is not sealed again");
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    for (second, seals) in [(3_600, 2), (7_200, 3)] {
        recorder.on_group(group(&["write"], &[]));
        recorder.write();
        assert_eq!(sealed(&log, &key), (seals - 1, 1));
        recorder.seal(at(second));
        recorder.seal(at(second));
        assert_eq!(sealed(&log, &key), (seals, 0));
    }
    assert_eq!(recorder.status().log, None);
    assert_eq!(fs::metadata(sealing::beside(&log)).unwrap().permissions().mode() & 0o777, 0o600);
    assert_eq!(sealing::make(&log, at(0)).err().unwrap().kind(), io::ErrorKind::AlreadyExists);
    assert!(
        sealing::read(&sealing::beside(&log)).unwrap().unwrap().number == 3,
        "the key that was there is left alone"
    );
    fs::remove_file(sealing::beside(&log)).unwrap();
    assert_eq!(
        sealing::make(&log, at(0)).unwrap().first.number,
        3,
        "another key goes on after the seals of the first one"
    );
}

#[test]
fn a_kill_during_a_seal_leaves_no_gap_and_reuses_no_key() {
    for (step, seals) in
        [("before the entry", 2), ("within the entry", 2), ("before the key", 3), ("within the key", 3)]
    {
        let folder = tempfile::tempdir().unwrap();
        let (history_file, log) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
        let key = sealing::make(&log, at(0)).unwrap();
        life(&history_file, &["start"]);
        let (mut audit_log, _) = AuditLog::open(&log).unwrap();
        audit_log.append(&mut [record("write")]).unwrap();
        let present = sealing::read(&sealing::beside(&log)).unwrap().unwrap();
        match step {
            "before the entry" => {}
            "within the entry" => {
                let (line, _) =
                    crate::access::audit_log::line(audit_log.last(), &present.entry(audit_log.last(), at(1)));
                let mut file = OpenOptions::new().append(true).open(&log).unwrap();
                file.write_all(&line.as_bytes()[..line.len() - 1]).unwrap();
            }
            _ => drop(audit_log.seal(&present, at(1)).unwrap()),
        }
        if step == "within the key" {
            fs::write(folder.path().join("tank.audit.key.new-2147483647"), present.next().text()).unwrap();
        }
        drop(audit_log);
        let (_, status, _) = life(&history_file, &["start"]);
        assert_eq!((sealed(&log, &key), status.log), ((seals, 0), None), "{step}");
        let present = sealing::read(&sealing::beside(&log)).unwrap().unwrap();
        assert_eq!(present.number, seals, "{step}: the key of the last seal is gone");
    }
}

#[test]
fn a_log_that_cannot_be_sealed_is_reported_and_continued() {
    let folder = tempfile::tempdir().unwrap();
    let (history_file, log) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
    let (path, verification) = (sealing::beside(&log), sealing::make(&log, at(0)).unwrap());
    let first = fs::read(&path).unwrap();
    fs::hard_link(&path, folder.path().join("first")).unwrap();
    life(&history_file, &["start"]);
    life(&history_file, &["start"]);
    assert_eq!(fs::read(folder.path().join("first")).unwrap(), vec![0; first.len()], "not left in free blocks");
    let present = fs::read(&path).unwrap();
    for (what, text) in [("missing", None), ("older than the last seal", Some(&first[..])), ("damaged", Some(b"7"))] {
        fs::remove_file(&path).unwrap();
        text.iter().for_each(|text| fs::write(&path, text).unwrap());
        let (rows, status, _) = life(&history_file, &["write"]);
        assert!(rows.len() == 1 && rows[0].chain_hash.is_some(), "{what}: it is on record all the same");
        let said = status.log.unwrap();
        assert!(said.starts_with("the audit log is not sealed: ") && said.contains(what), "{what}: {said}");
        fs::write(&path, text.unwrap_or(b"")).unwrap();
    }
    fs::write(&path, present).unwrap();
    assert_eq!((life(&history_file, &["start"]).1.log, sealed(&log, &verification)), (None, (3, 0)));
}

#[test]
fn a_key_that_cannot_be_replaced_makes_one_seal_only() {
    let folder = tempfile::tempdir().unwrap();
    let (history_file, log) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
    let verification = sealing::make(&log, at(0)).unwrap();
    let (history, mut rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    let obstacle = folder.path().join(format!("tank.audit.key.new-{}", std::process::id()));
    fs::create_dir(&obstacle).unwrap();
    for action in ["start", "write"] {
        recorder.on_group(group(&[action], &[]));
        recorder.write();
        recorder.seal(at(60));
        let said = recorder.status().log.unwrap();
        assert!(said.contains("the audit log is not sealed") && !said.contains("os error"), "{said}");
    }
    assert_eq!(
        stored(&mut rows).iter().map(|row| row.action.to_string()).collect::<Vec<_>>(),
        ["start", RecordedAction::SealAuditLog.word(), "write"]
    );
    assert_eq!(sealed(&log, &verification), (1, 1));
    fs::remove_dir(&obstacle).unwrap();
    recorder.seal(at(120));
    assert_eq!((recorder.status().log, sealed(&log, &verification)), (None, (2, 0)));
    let present = sealing::read(&sealing::beside(&log)).unwrap().unwrap();
    assert!(present == verification.first.next().next());
}

#[test]
fn an_unwritten_seal_leaves_its_key_for_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let (history_file, log) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
    let verification = sealing::make(&log, at(0)).unwrap();
    let (history, _rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::new(&history_file, clock(), history);
    recorder.open();
    recorder.on_group(group(&["start"], &[]));
    recorder.write();
    fs::remove_file(&log).unwrap();
    recorder.seal(at(60));
    assert!(recorder.status().log.unwrap().starts_with("the audit log is not sealed: "));
    assert!(sealing::read(&sealing::beside(&log)).unwrap() == Some(verification.first));
}
