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
    visible::is_control_or_bidi,
};

/// The start of the chain in version 1, whose entries have the same format.
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
    /// The action.
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

/// Compares the latest entries of the log, up to its chain hash `last`, with the latest `rows` of the history, at most `rows_max`.
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
    if text.contains(is_control_or_bidi) {
        *text =
            text.chars().map(|letter| if is_control_or_bidi(letter) { ' ' } else { letter }).collect::<String>().into();
    }
}

/// The next line after `last`, with its end of line, and its chain hash. [`Check`] accepts the line for every action.
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
    /// The chain hash of the last one.
    pub last: ChainHash,
    /// The first and the last time.
    pub span: Option<(Timestamp, Timestamp)>,
    /// Rows of the history that have their line here.
    pub compared: u64,
    /// Behind the last line stands the beginning of another one: just being written, or torn by a loss of power. It was
    /// never confirmed.
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
    /// Before the first line. `head` is the chain hash that the station noted last, `rows` are those of the history.
    pub fn new(head: Option<ChainHash>, rows: &[ChainHash]) -> Check {
        let rows = rows.iter().map(|chain_hash| (chain_hash.number, chain_hash.hash)).collect();
        Check { last: START, line: 0, span: None, bad: None, head, rows, compared: 0 }
    }

    /// The next line, without its end. Gives the entry if it is as it was written; one that is not is left out, and what
    /// continues behind it from the last sound one is sound again.
    pub fn line(&mut self, bytes: &[u8]) -> Option<Entry> {
        self.line += 1;
        match self.parse_entry(bytes) {
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

    /// Is the last entry that the station noted among the lines so far? What comes behind it may never have been confirmed.
    pub fn has_all_noted(&self) -> bool {
        self.head.is_none_or(|head| head.number <= self.last.number)
    }

    fn parse_entry(&mut self, bytes: &[u8]) -> Result<(Entry, ChainHash), String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "this is not text".to_owned())?;
        let (body, hash) =
            split(text).ok_or("the line has no hash at its end: it was cut or does not belong to an audit log")?;
        let entry: Entry = serde_json::from_str(&format!("{body}}}"))
            .map_err(|_| "this line does not belong to an audit log".to_owned())?;
        let expected = self.last.number + 1;
        if entry.n < expected {
            return Err(format!("found entry {}, expected {expected}: it was moved or doubled", entry.n));
        }
        if expected < entry.n {
            return Err(format!("found entry {}, expected {expected}: lines before it were cut out or moved", entry.n));
        }
        // A log that an earlier version began goes on in the same chain.
        let is_first_of_v1 = || self.last == START && tied(START_V1, body.as_bytes()) == hash;
        if tied(self.last.hash, body.as_bytes()) != hash && !is_first_of_v1() {
            return Err("the hash does not match: this line was changed or inserted".to_owned());
        }
        if self.head.is_some_and(|head| head.number == entry.n && head.hash != hash) {
            return Err("the station has recorded another hash for this entry: the audit log was rewritten".to_owned());
        }
        match self.rows.remove(&entry.n) {
            Some(row) if row != hash => return Err("the history holds another hash for this entry".to_owned()),
            Some(_) => self.compared += 1,
            None => {}
        }
        let number = entry.n;
        Ok((entry, ChainHash { number, hash }))
    }

    /// The chain hash of the last sound line.
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
            let why = "the record of the last entry is missing or damaged: lines may be missing here";
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

/// The chain hash of such a note.
pub fn head(text: &str) -> Option<ChainHash> {
    let (number, hash) = text.strip_suffix('\n')?.split_once(' ')?;
    Some(ChainHash { number: number.parse().ok()?, hash: unhex(hash)? })
}

#[cfg(test)]
mod tests;
