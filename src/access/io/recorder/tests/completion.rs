//! The history and the log complete each other.

use super::*;

/// What a start sends to a history that holds these entries, and what is wrong with the log then.
fn compared(history_file: &Path, entries: StoredEntries) -> (Vec<ActionRecord>, Option<String>) {
    let (history, mut stored_rows) = mpsc::channel(64);
    let Handle { groups, recorded, join, .. } = start(history_file, clock(), history);
    groups.try_send(Message::Stored(entries)).unwrap();
    drop(groups);
    join.unwrap().join().unwrap();
    (stored(&mut stored_rows), recorded.borrow().log.clone())
}

/// What a station that was killed had written into the history while the log could not be written.
#[test]
fn the_log_is_completed_from_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let (rows, ..) = life(&history_file, &["start", "write"]);
    let bare = |row: &ActionRecord| ActionRecord { chain_hash: None, ..row.clone() };
    let only_there = ActionRecord { note: Some("by hand".into()), ..bare(&rows[1]) };
    // The last entry was in the log, and the station killed before the history had its hash.
    let unchained = vec![bare(&rows[1]), only_there.clone()];
    let (sent, log) = compared(&history_file, StoredEntries { chain_hashes: chain_hashes(&rows[..1]), unchained });
    assert_eq!(log, None, "nothing is wrong with the log");
    assert_eq!(sent[0], rows[1], "it is in the log");
    assert_eq!((bare(&sent[1]), sent[1].chain_hash.map(|hash| hash.number)), (only_there, Some(3)));
    assert!(sent[2].outcome.contains("1 entries were missing in the history"), "{sent:?}");
    assert!(sent[3].outcome.contains("1 actions were in the history only"), "{sent:?}");
    let summary = verify(&beside(&history_file), &chain_hashes(&rows[..1])).unwrap();
    assert_eq!((sent.len(), summary.entries), (4, 5));
}

/// What a station that was killed had written into the log and not into the history.
#[test]
fn the_history_is_completed_and_differences_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let (rows, ..) = life(&history_file, &["start", "write", "acknowledge"]);
    let compared = |chain_hashes| compared(&history_file, StoredEntries { chain_hashes, unchained: Vec::new() });
    let (sent, log) = compared(chain_hashes(&rows[..1]));
    assert_eq!(sent[..2], rows[1..], "the very entries, with their chain hashes");
    assert!(sent.len() == 3 && sent[2].outcome.contains("2 entries were missing in the history"), "{sent:?}");
    assert_eq!(log, None, "nothing is wrong with the log");
    let all: Vec<ChainHash> = chain_hashes(&rows).into_iter().chain(chain_hashes(&sent[2..])).collect();
    assert_eq!(compared(all.clone()), (Vec::new(), None), "nothing is missing any more");
    let forged = ChainHash { hash: [7; 32], ..all[1] };
    let (_, log) = compared([&all[..1], &[forged], &all[2..]].concat());
    assert!(log.unwrap().contains("1 entries differ from the history, the first is 2"));
    let ahead = ChainHash { number: 99, hash: [7; 32] };
    let (_, log) = compared([&all[..], &[ahead]].concat());
    assert!(log.unwrap().contains("lacks 1 entries that the history holds, from 99 on"));
}

/// The disk was full at the start, or another process had the log: what the history lacks of it is sent all the same.
#[test]
fn a_log_that_opens_late_is_compared_with_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let history_file = folder.path().join("tank.duckdb");
    let (rows, ..) = life(&history_file, &["start", "write"]);
    let (other, _) = AuditLog::open(&beside(&history_file)).unwrap();
    let (history, mut stored_rows) = mpsc::channel(64);
    let (mut recorder, _) = Recorder::opened(&history_file, clock(), history);
    recorder.on_group(group(&["acknowledge"], &[]));
    recorder.write();
    let stored_entries = StoredEntries { chain_hashes: chain_hashes(&rows[..1]), unchained: Vec::new() };
    recorder.on_stored(stored_entries);
    assert_eq!(stored(&mut stored_rows).len(), 1, "the new one, without a chain hash");
    drop(other);
    recorder.opened_at -= REOPEN;
    recorder.write();
    let sent = stored(&mut stored_rows);
    assert!(sent.contains(&rows[1]), "the very entry, with its chain hash: {sent:?}");
    assert!(sent.iter().any(|row| row.outcome.contains("1 entries were missing in the history")), "{sent:?}");
    assert_eq!(sent.iter().filter(|row| &*row.action == "acknowledge").count(), 1, "{sent:?}");
    assert_eq!(verify(&beside(&history_file), &[]).unwrap().entries, 4);
    // Opened once more, it is not compared again.
    recorder.audit_log = None;
    recorder.opened_at -= REOPEN;
    recorder.write();
    assert_eq!(stored(&mut stored_rows), []);
}
