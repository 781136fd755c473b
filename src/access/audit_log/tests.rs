//! The chain of the audit log against changes, cuts and any text.
#![allow(clippy::unwrap_used)]

use proptest::prelude::*;

use super::*;

fn record(n: u64) -> ActionRecord {
    ActionRecord {
        at: Timestamp::from_microsecond(1_000_000 * n as i64 + 7).unwrap(),
        by: "anna".into(),
        from: "pts/3 from 10.0.0.5, user panel".into(),
        action: "write".into(),
        target: "TIC-1.SV".into(),
        old: n.is_multiple_of(2).then(|| "1.0 °C".into()),
        new: Some(format!("{n} \"°C\"\n").into()),
        outcome: "verified".into(),
        note: None,
        chain_hash: None,
    }
}

fn audit_log(count: u64) -> (Vec<String>, Vec<ChainHash>) {
    let (mut lines, mut chain_hashes, mut last) = (Vec::new(), Vec::new(), START);
    for n in 1..=count {
        let (line, chain_hash) = super::line(last, &record(n));
        lines.push(line.strip_suffix('\n').unwrap().to_owned());
        chain_hashes.push(chain_hash);
        last = chain_hash;
    }
    (lines, chain_hashes)
}

fn verify(lines: &[String], head: Option<ChainHash>, rows: &[ChainHash]) -> Result<Summary, FirstBad> {
    let mut check = Check::new(head, rows);
    for line in lines {
        check.line(line.as_bytes());
    }
    check.end(false)
}

#[test]
fn an_unchanged_log_is_whole_and_readable() {
    let (lines, chain_hashes) = audit_log(5);
    let summary = verify(&lines, chain_hashes.last().copied(), &chain_hashes).unwrap();
    assert_eq!((summary.entries, summary.compared, summary.last), (5, 5, chain_hashes[4]));
    let entry = Check::new(None, &[]).line(lines[0].as_bytes()).unwrap();
    assert_eq!((entry.n, &*entry.who, entry.new.as_deref()), (1, "anna", Some("1 \"°C\" ")));
    assert!(lines.iter().all(|line| !line.contains('\n')), "one line each, whatever the note");
    assert_eq!(head(&head_text(chain_hashes[4])), Some(chain_hashes[4]));
    assert_eq!(verify(&[], Some(START), &[]).unwrap().entries, 0);
}

#[test]
fn a_log_of_version_1_goes_on_in_its_chain() {
    let start = ChainHash { number: 0, hash: START_V1 };
    let (first, begun) = super::line(start, &record(1));
    let (second, last) = super::line(begun, &record(2));
    let lines = [&first, &second].map(|line| line.trim_end_matches('\n').to_owned());
    assert_eq!(verify(&lines, Some(last), &[begun]).unwrap().last, last);
    let moved = [lines[1].clone(), lines[0].clone()];
    assert_eq!(verify(&moved, Some(last), &[]).unwrap_err().line, 1);
    // The start of version 1 holds for the first entry only.
    let forged = super::line(ChainHash { number: 1, ..start }, &record(2)).0.trim_end_matches('\n').to_owned();
    assert_eq!(verify(&[lines[0].clone(), forged], Some(last), &[]).unwrap_err().line, 2);
}

#[test]
fn a_rewritten_log_is_found_by_the_note_and_by_the_history() {
    let (lines, chain_hashes) = audit_log(5);
    let forged = ChainHash { number: 3, hash: [1; 32] };
    assert_eq!(verify(&lines, Some(forged), &[]).unwrap_err().line, 3);
    assert_eq!(verify(&lines, chain_hashes.last().copied(), &[forged]).unwrap_err().line, 3);
    assert_eq!(
        verify(&lines[..3], Some(chain_hashes[2]), &chain_hashes).unwrap_err().line,
        4,
        "cut, and the note as well"
    );
    assert_eq!(verify(&lines, None, &[]).unwrap_err().line, 6, "without the note a cut cannot be ruled out");
    for (kept, last) in [(4, chain_hashes[3]), (0, START)] {
        let cut = verify(&lines[..kept], Some(last), &chain_hashes).unwrap_err();
        let why = format!("the audit log was cut here: the history holds entry {}", kept + 1);
        assert_eq!(cut, FirstBad { line: kept as u64 + 1, why });
    }
    let changed = [lines[0].replace("anna", "otto")];
    assert_eq!(verify(&changed, Some(START), &[]).unwrap_err().line, 1, "the first line needs its hash too");
}

#[test]
fn entries_missing_or_different_in_the_history_are_found() {
    let (lines, chain_hashes) = audit_log(6);
    let mut check = Check::new(None, &[]);
    let entry = |line: &String| check.line(line.as_bytes()).map(|entry| entry.chained(check.last()));
    let tail: Vec<_> = lines.iter().filter_map(entry).collect();
    let forged = ChainHash { number: 5, hash: [1; 32] };
    let ahead = ChainHash { number: 9, hash: [2; 32] };
    let found = compare(&tail, chain_hashes[5], &[ahead, forged, chain_hashes[3], chain_hashes[1]], 100);
    let missing: Vec<_> = found.missing.iter().map(|entry| entry.chain_hash.unwrap().number).collect();
    assert_eq!((missing, found.differing, found.not_in_log), (vec![1, 3, 6], vec![5], vec![9]));
    assert_eq!(found.missing[0].new.as_deref(), Some("1 \"°C\" "), "as it is in the log");
    assert_eq!(compare(&tail, chain_hashes[5], &chain_hashes, 100), Comparison::default());
    let found = compare(&tail, chain_hashes[5], &[chain_hashes[5], chain_hashes[3]], 2);
    assert_eq!(found.missing.len(), 1, "rows before those that were read are unknown");
    let found = compare(&tail, chain_hashes[5], &[chain_hashes[5], forged], 2);
    assert_eq!((found.missing, found.differing), (vec![], vec![5]), "the first row that was read is compared");
    assert_eq!(compare(&tail, chain_hashes[5], &[], 100).missing.len(), 6, "a new history is completed from the log");
}

#[test]
fn a_hash_is_64_small_hexadecimal_digits_and_nothing_else() {
    let text = "0f".repeat(32);
    assert_eq!(unhex(&text), Some([0x0f; 32]));
    let wrong = [text.to_uppercase(), text[2..].into(), format!("{text}0f"), text.replacen('0', "+", 1), String::new()];
    for wrong in wrong {
        assert_eq!(unhex(&wrong), None, "{wrong}");
    }
    // FIPS 180-2, appendix B.1.
    assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

proptest! {
    #[test]
    fn any_text_keeps_the_chain_whole_and_a_cut_is_found(
        texts in prop::collection::vec(("[\\PC\\x00-\\x1f\"\\\\\u{202e}]{1,40}", 1usize..4_000), 8)
    ) {
        let texts: Vec<Arc<str>> = texts.iter().map(|(text, times)| text.repeat(*times).into()).collect();
        let [by, from, action, target, outcome, old, new, note] = &texts[..] else { unreachable!() };
        let record = ActionRecord {
            by: by.clone(),
            from: from.clone(),
            action: action.clone(),
            target: target.clone(),
            outcome: outcome.clone(),
            old: Some(old.clone()),
            new: Some(new.clone()),
            note: Some(note.clone()),
            ..record(1)
        };
        let (line, chain_hash) = super::line(START, &record);
        prop_assert!(line.len() < LINE_MAX, "{} bytes", line.len());
        let mut check = Check::new(Some(chain_hash), &[]);
        let entry = check.line(line.trim_end_matches('\n').as_bytes()).unwrap();
        prop_assert!(check.end(false).is_ok());
        prop_assert_eq!(&entry.target, &fit(record.clone()).target);
        prop_assert_eq!(entry.target.ends_with(CUT), TEXT_MAX < target.len());
        let moved = entry.who.contains(['\n', '\u{1b}', '\u{202e}']);
        prop_assert!(!moved, "a cursor could be moved");
        prop_assert_eq!(fit(fit(record.clone())), fit(record));
    }

    #[test]
    fn whatever_is_done_to_a_book_the_first_bad_line_is_named(
        count in 3u64..12, what in 0u8..6, at in 0usize..100, other in 0usize..100, byte in 0usize..1000, bit in 0u8..7
    ) {
        let (good, chain_hashes) = audit_log(count);
        let (place, other) = (at % good.len(), other % good.len());
        let mut lines = good.clone();
        let first = match what {
            0 => {
                let mut bytes = lines[place].clone().into_bytes();
                let byte = byte % bytes.len();
                bytes[byte] ^= 1 << bit;
                let mut check = Check::new(chain_hashes.last().copied(), &[]);
                for (index, line) in lines.iter().enumerate() {
                    check.line(if index == place { &bytes } else { line.as_bytes() });
                }
                prop_assert_eq!(check.end(false).unwrap_err().line, place as u64 + 1);
                return Ok(());
            }
            1 => { lines.truncate(place); place }
            2 => { lines.remove(place); place }
            3 => { let line = lines[place].clone(); lines.insert(place, line); place + 1 }
            4 => { lines.swap(place, other); place.min(other) }
            _ => {
                let (line, _) = super::line(ChainHash { number: place as u64, hash: [9; 32] }, &record(99));
                lines.insert(place, line.trim_end().to_owned());
                place
            }
        };
        let verdict = verify(&lines, chain_hashes.last().copied(), &chain_hashes);
        if lines == good {
            prop_assert!(verdict.is_ok());
        } else {
            prop_assert_eq!(verdict.unwrap_err().line, first as u64 + 1);
        }
    }
}
