//! What a loss of power leaves at the end of the audit log.

use super::*;

#[test]
fn a_torn_last_line_is_set_aside_and_reported() {
    // The beginning alone; zeros for a block that was not written yet, within the line or up to another one.
    for torn in
        ["{\"n\":3,\"utc\":\"20", "{\"n\":3,\0\0\0\0\"}\n", "\0\0\0\0\"hash\":\"00\"}\n{\"n\":4,\"utc\":\"20\"}\n"]
    {
        let folder = tempfile::tempdir().unwrap();
        let (history, path) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
        life(&history, &["start", "write"]);
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        file.write_all(torn.as_bytes()).unwrap();
        assert!(verify(&path, &[]).unwrap().torn);
        let (rows, status, opened) = life(&history, &["start"]);
        assert!(opened.wrong[0].contains("torn"), "{opened:?}");
        assert_eq!((rows.len(), status.log), (2, None), "one for the torn line, one for the start");
        assert_eq!(verify(&path, &[]).unwrap().entries, 4);
        let beside = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
        let beside = beside.filter(|path| path.to_string_lossy().contains("torn")).collect::<Vec<_>>();
        assert_eq!(fs::read_to_string(&beside[0]).unwrap(), torn);
    }
}

#[test]
fn zeros_in_place_of_a_noted_entry_are_tampering() {
    let folder = tempfile::tempdir().unwrap();
    let (history, path) = (folder.path().join("tank.duckdb"), folder.path().join("tank.audit.jsonl"));
    life(&history, &["start", "write"]);
    let mut bytes = fs::read(&path).unwrap();
    let end = bytes.len();
    bytes[end - 100..end - 50].fill(0);
    fs::write(&path, &bytes).unwrap();
    assert!(matches!(verify(&path, &[]), Err(VerifyError::Bad { bad, .. }) if bad.line == 2));
    let (_, _, opened) = life(&history, &["start"]);
    assert!(opened.wrong[0].contains("broken at line 2"), "{opened:?}");
}
