//! The audit log: one line an entry, each with a hash over itself and the hash before it, so that a change, a cut, a move
//! or an insertion is found.
//!
//! ```text
//! {"n":1,"utc":"2026-05-01T12:00:00Z","who":"anna",…,"outcome":"verified","hash":"5f…"}
//!  └────────────── these bytes, after the hash of the line before ──┘        = SHA-256
//! ```

use std::{collections::BTreeMap, sync::Arc};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::plant::{
    record::{ActionRecord, ChainHash, hex},
    visible::acts,
};

/// The start of the chain in version 1.
const START_V1: [u8; 32] = *b"sightglass, the book of deeds, 1";
/// The start of the chain: version 2 of the format.
pub const START: ChainHash = ChainHash { number: 0, hash: *b"sightglass audit log, version 2." };
/// Bytes of a line at the most; whatever is longer was not written by a station.
pub const LINE_MAX: usize = 64 << 10;
/// Bytes of a text of a line at the most: eight of them, all of what must be escaped, are still shorter than a line.
pub const TEXT_MAX: usize = 3_500;
/// Ends a text that was longer.
const CUT: &str = "… (cut)";
/// What stands before the hash and after it.
const HASH: (&str, &str) = (",\"hash\":\"", "\"}");
/// Hexadecimal digits of a hash.
const DIGITS: usize = 64;
/// What a change of the plant file is called.
pub const PLANT_FILE: &str = "plant file";

/// What a change of the file of users is called.
pub const USERS_FILE: &str = "users file";

/// A line of the audit log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Running number, from 1.
    pub n: u64,
    /// When.
    pub utc: Timestamp,
    /// Who.
    pub who: Arc<str>,
    /// From where.
    pub from: Arc<str>,
    /// What he did.
    pub action: Arc<str>,
    /// To what or whom.
    pub target: Arc<str>,
    /// Value before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub old: Option<Arc<str>>,
    /// Value requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub new: Option<Arc<str>>,
    /// How it ended.
    pub outcome: Arc<str>,
    /// Why.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<Arc<str>>,
}

impl Entry {
    /// The action that it records.
    pub fn chained(self, chain_hash: ChainHash) -> ActionRecord {
        let Entry { n: _, utc: at, who: by, from, action, target, old, new, outcome, note } = self;
        ActionRecord { at, by, from, action, target, old, new, outcome, note, chain_hash: Some(chain_hash) }
    }
}

/// Whether the history holds what the audit log holds, as far as both reach back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Comparison {
    /// Entries of the log that the history lacks, oldest first.
    pub missing: Vec<ActionRecord>,
    /// Entries whose hash differs.
    pub differing: Vec<u64>,
    /// Entries of the history that the log lacks.
    pub not_in_log: Vec<u64>,
}

/// Compares the latest entries of the log, up to its chain_hash `last`, with the latest `rows` of the history, at most `rows_max`.
pub fn compare<'a>(
    tail: impl IntoIterator<Item = &'a ActionRecord>,
    last: ChainHash,
    rows: &[ChainHash],
    rows_max: usize,
) -> Comparison {
    let rows: BTreeMap<u64, [u8; 32]> = rows.iter().map(|chain_hash| (chain_hash.number, chain_hash.hash)).collect();
    // Before the first of as many as were asked for there may be others.
    let from = if rows.len() < rows_max { 0 } else { rows.keys().next().copied().unwrap_or(0) };
    let mut comparison = Comparison::default();
    for entry in tail {
        let Some(chain_hash) = entry.chain_hash.filter(|chain_hash| from <= chain_hash.number) else { continue };
        match rows.get(&chain_hash.number) {
            Some(hash) if *hash == chain_hash.hash => {}
            Some(_) => comparison.differing.push(chain_hash.number),
            None => comparison.missing.push(entry.clone()),
        }
    }
    comparison.not_in_log = rows.range(last.number + 1..).map(|(number, _)| *number).collect();
    comparison
}

/// An action as the audit log can hold it: texts are limited in length and have no characters that move a cursor or change
/// the direction of text. An action that fits stays as it is.
pub fn fit(mut record: ActionRecord) -> ActionRecord {
    let ActionRecord { at: _, by, from, action, target, old, new, outcome, note, chain_hash: _ } = &mut record;
    let texts = [by, from, action, target, outcome].into_iter();
    texts.chain([old, new, note].into_iter().flatten()).for_each(fit_text);
    record
}

fn fit_text(text: &mut Arc<str>) {
    if TEXT_MAX < text.len() {
        *text = format!("{}{CUT}", &text[..text.floor_char_boundary(TEXT_MAX - CUT.len())]).into();
    }
    if text.contains(acts) {
        *text = text.chars().map(|letter| if acts(letter) { ' ' } else { letter }).collect::<String>().into();
    }
}

/// The next line after `last`, with its end of line, and its chain_hash. [`Check`] accepts the line for every action.
pub fn line(last: ChainHash, record: &ActionRecord) -> (String, ChainHash) {
    let ActionRecord { at, by, from, action, target, old, new, outcome, note, chain_hash: _ } = fit(record.clone());
    let entry = Entry { n: last.number + 1, utc: at, who: by, from, action, target, old, new, outcome, note };
    let mut text = serde_json::to_string(&entry).expect("texts, numbers and times can always be written");
    text.pop();
    let hash = tied(last.hash, text.as_bytes());
    text += &format!("{}{}{}\n", HASH.0, hex(&hash), HASH.1);
    (text, ChainHash { number: entry.n, hash })
}

fn tied(last: [u8; 32], bytes: &[u8]) -> [u8; 32] {
    Sha256::new().chain_update(last).chain_update(bytes).finalize().into()
}

/// What is found in an audit log that is whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Lines.
    pub entries: u64,
    /// The chain_hash of the last one.
    pub last: ChainHash,
    /// The first and the last time.
    pub span: Option<(Timestamp, Timestamp)>,
    /// Rows of the history that have their line here.
    pub compared: u64,
    /// Behind the last line stands the beginning of another one: just being written, or torn by a loss of power. It was
    /// never confirmed to anybody.
    pub torn: bool,
}

/// The first line that is not as it was written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {why}")]
pub struct FirstBad {
    /// From 1.
    pub line: u64,
    /// What is wrong with it.
    pub why: String,
}

/// Reads an audit log line by line and finds what is wrong with it.
#[derive(Debug)]
pub struct Check {
    last: ChainHash,
    line: u64,
    span: Option<(Timestamp, Timestamp)>,
    bad: Option<FirstBad>,
    head: Option<ChainHash>,
    rows: BTreeMap<u64, [u8; 32]>,
    compared: u64,
}

impl Check {
    /// Before the first line. `head` is the chain_hash that the station noted last, `rows` are those of the history.
    pub fn new(head: Option<ChainHash>, rows: &[ChainHash]) -> Check {
        let rows = rows.iter().map(|chain_hash| (chain_hash.number, chain_hash.hash)).collect();
        Check { last: START, line: 0, span: None, bad: None, head, rows, compared: 0 }
    }

    /// The next line, without its end. Gives the entry if it is as it was written; one that is not is left out, and what
    /// continues behind it from the last sound one is sound again.
    pub fn line(&mut self, bytes: &[u8]) -> Option<Entry> {
        self.line += 1;
        match self.look_at(bytes) {
            Ok((entry, chain_hash)) => {
                self.last = chain_hash;
                self.span = Some((self.span.map_or(entry.utc, |span| span.0), entry.utc));
                Some(entry)
            }
            Err(why) => {
                self.bad.get_or_insert(FirstBad { line: self.line, why });
                None
            }
        }
    }

    fn look_at(&mut self, bytes: &[u8]) -> Result<(Entry, ChainHash), String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "this is no text".to_owned())?;
        let (body, hash) =
            split(text).ok_or("this does not end with a hash: it was cut or is no line of the audit log")?;
        let entry: Entry =
            serde_json::from_str(&format!("{body}}}")).map_err(|_| "this is no line of the audit log".to_owned())?;
        let expected = self.last.number + 1;
        if entry.n < expected {
            return Err(format!("found entry {}, expected {expected}: it was moved or doubled", entry.n));
        }
        if expected < entry.n {
            return Err(format!("found entry {}, expected {expected}: lines before it were cut out or moved", entry.n));
        }
        if self.last == START && tied(START_V1, body.as_bytes()) == hash {
            return Err("this audit log has the format of an earlier version: move it to another folder".to_owned());
        }
        if tied(self.last.hash, body.as_bytes()) != hash {
            return Err("the hash does not fit: this line was changed or put in".to_owned());
        }
        if self.head.is_some_and(|head| head.number == entry.n && head.hash != hash) {
            return Err("the station has noted another hash for this entry: the audit log was written anew".to_owned());
        }
        match self.rows.remove(&entry.n) {
            Some(row) if row != hash => return Err("the history holds another hash for this entry".to_owned()),
            Some(_) => self.compared += 1,
            None => {}
        }
        let number = entry.n;
        Ok((entry, ChainHash { number, hash }))
    }

    /// The chain_hash of the last sound line.
    pub fn last(&self) -> ChainHash {
        self.last
    }

    /// After the last line.
    pub fn end(self, torn: bool) -> Result<Summary, FirstBad> {
        if let Some(bad) = self.bad {
            return Err(bad);
        }
        let line = self.line + 1;
        if let Some(head) = self.head.filter(|head| self.last.number < head.number) {
            let why = format!("the audit log was cut here: the station has noted {} entries", head.number);
            return Err(FirstBad { line, why });
        }
        if self.head.is_none() && 0 < self.line {
            let why = "what the station has noted of the last entry is missing or damaged: lines may be missing here";
            return Err(FirstBad { line, why: why.to_owned() });
        }
        if let Some((row, _)) = self.rows.range(self.last.number + 1..).next() {
            return Err(FirstBad { line, why: format!("the audit log was cut here: the history holds entry {row}") });
        }
        let Check { last, span, compared, .. } = self;
        Ok(Summary { entries: self.line, last, span, compared, torn })
    }
}

/// The bytes that are tied, and their hash.
fn split(text: &str) -> Option<(&str, [u8; 32])> {
    let digits = text.strip_suffix(HASH.1)?;
    let place = digits.len().checked_sub(DIGITS)?;
    let body = digits.get(..place)?.strip_suffix(HASH.0)?;
    Some((body, unhex(&digits[place..])?))
}

pub(super) fn unhex(text: &str) -> Option<[u8; 32]> {
    let mut hash = [0; 32];
    if text.len() != DIGITS || !text.bytes().all(|digit| matches!(digit, b'0'..=b'9' | b'a'..=b'f')) {
        return None;
    }
    for (byte, digits) in hash.iter_mut().zip(text.as_bytes().chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    }
    Some(hash)
}

/// The SHA-256 of a file, as text.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// What is noted of the last entry, beside the audit log: always of the same length, so that it is written in one piece.
pub fn head_text(chain_hash: ChainHash) -> String {
    format!("{:020} {}\n", chain_hash.number, chain_hash.hash_hex())
}

/// The chain_hash of such a note.
pub fn head(text: &str) -> Option<ChainHash> {
    let (number, hash) = text.strip_suffix('\n')?.split_once(' ')?;
    Some(ChainHash { number: number.parse().ok()?, hash: unhex(hash)? })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
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
    fn a_book_as_it_was_written_is_whole_and_its_lines_can_be_read() {
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
    fn a_book_that_was_written_anew_is_found_by_the_note_and_by_the_history() {
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
    }

    #[test]
    fn what_the_history_lacks_of_the_log_is_found_and_so_is_what_differs() {
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
        assert_eq!(found.missing.len(), 1, "nobody knows what else the history holds before the rows that were read");
        assert_eq!(
            compare(&tail, chain_hashes[5], &[], 100).missing.len(),
            6,
            "a new history is completed from the log"
        );
    }

    proptest! {
        #[test]
        fn whatever_somebody_puts_on_record_the_book_stays_whole_and_says_where_it_was_cut(
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
}
