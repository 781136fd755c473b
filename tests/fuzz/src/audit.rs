//! The audit log: a damaged one is not taken for a whole one, and whatever is written is read again.

use sightglass::api::{
    access::{
        audit_log::{Check, Entry, START, fit, head, head_text, line},
        sealing::{Key, SealCheck, VerificationKey},
    },
    plant::{ActionRecord, ChainHash, is_control_or_bidi},
};

/// A log; of its lines those that are entries are written once more.
pub fn run(data: &[u8]) {
    let mut check = Check::new(None, &[]);
    data.split(|byte| *byte == b'\n').for_each(|line| _ = check.line(line));
    if let Err(bad) = check.end(false) {
        assert!(!bad.why.contains(is_control_or_bidi), "{bad}");
    }
    rewrite(data);
    if let Ok(text) = std::str::from_utf8(data) {
        if let Some(noted) = head(text) {
            assert_eq!(head(&head_text(noted)), Some(noted));
        }
        if let Some(key) = Key::parse(text) {
            assert!(Key::parse(&key.text()) == Some(key));
        }
        if let Some(key) = VerificationKey::parse(text) {
            assert!(VerificationKey::parse(&key.text()) == Some(key));
        }
    }
}

/// A log of the entries that a text holds is whole, and holds them.
fn rewrite(data: &[u8]) {
    let entries = data.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice::<Entry>(line).ok());
    let (mut last, mut written) = (START, Vec::new());
    for entry in entries {
        let record = entry.chained(last);
        let (line, chain_hash) = line(last, &record);
        written.push((fit(record), line, chain_hash));
        last = chain_hash;
    }
    let key = VerificationKey { first: Key::new(1, [7; 32]), made: jiff::Timestamp::UNIX_EPOCH };
    let rows: Vec<ChainHash> = written.iter().map(|(_, _, chain_hash)| *chain_hash).collect();
    let (mut check, mut seals) = (Check::new(Some(last), &rows), SealCheck::new(&key));
    for (record, line, chain_hash) in &written {
        let text = line.strip_suffix('\n').expect("an end of line");
        assert!(!text.contains('\n'), "{text}");
        let entry = check.line(text.as_bytes()).expect("a line that was just written");
        seals.entry(&entry, *chain_hash);
        assert_eq!(entry.chained(*chain_hash), ActionRecord { chain_hash: Some(*chain_hash), ..record.clone() });
    }
    let summary = check.end(false).expect("a whole log");
    assert_eq!((summary.entries, summary.last, summary.compared), (written.len() as u64, last, written.len() as u64));
    _ = seals.end(None);
}
