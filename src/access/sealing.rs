//! Forward-secure sealing of the audit log: an entry from time to time authenticates everything before it with a key, which
//! is then replaced by its own hash. The present key computes no earlier one, so it forges no earlier seal.
//!
//! ```text
//! key n+1 = SHA-256("sightglass, next sealing key" ‖ key n)
//! seal n  = HMAC-SHA-256(key n, hash of the entry before it ‖ time of the seal)
//! ```

use std::cmp::Ordering;

use jiff::Timestamp;
use sha2::{Digest, Sha256};

use super::audit_log::{Entry, FirstBad, START, unhex};
use crate::plant::{
    record::{ActionRecord, ChainHash, hex},
    recorded_action::RecordedAction,
};

/// Seconds between two seals of a station that runs.
const INTERVAL: i64 = 3_600;
/// Seconds after which a seal that failed is tried again.
const RETRY: i64 = 60;
/// What a key is hashed with to give the next one.
const NEXT: &str = "sightglass, next sealing key";
/// Bytes of a block of SHA-256.
const BLOCK: usize = 64;

/// Is it time for the next seal? Always for the first one of a process, then in each hour, after a failure each minute.
pub fn is_due(last: Option<(Timestamp, bool)>, now: Timestamp) -> bool {
    last.is_none_or(|(at, succeeded)| {
        let period = if succeeded { INTERVAL } else { RETRY };
        at.as_second().div_euclid(period) != now.as_second().div_euclid(period)
    })
}

/// A key, for one seal. No `Debug`: it must not get into a log.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// The number of its seal.
    pub number: u64,
    bytes: [u8; 32],
}

impl Key {
    /// A key of random bytes.
    pub fn new(number: u64, bytes: [u8; 32]) -> Key {
        Key { number, bytes }
    }

    /// The key of the next seal.
    pub fn next(&self) -> Key {
        let bytes = Sha256::new().chain_update(NEXT).chain_update(self.bytes).finalize().into();
        Key { number: self.number + 1, bytes }
    }

    /// The key of the seal after `last`, the last one in the log. A key that was used already gives the next one: the process
    /// ended before it was replaced. `None` for one that is older: it was put back.
    pub fn after(self, last: Option<u64>) -> Option<Key> {
        match last.map_or(Ordering::Less, |last| last.cmp(&self.number)) {
            Ordering::Less => Some(self),
            Ordering::Equal => Some(self.next()),
            Ordering::Greater => None,
        }
    }

    /// The seal, as an entry of the log, after the entry `last`.
    pub fn entry(&self, last: ChainHash, at: Timestamp) -> ActionRecord {
        let entry = ActionRecord::new(at, "station", RecordedAction::SealAuditLog, self.number.to_string(), "done");
        ActionRecord { new: Some(hex(&self.seal(last, at)).into()), ..entry }
    }

    fn seal(&self, last: ChainHash, at: Timestamp) -> [u8; 32] {
        hmac(&self.bytes, &[&last.hash[..], &at.as_nanosecond().to_be_bytes()].concat())
    }

    /// As a text: number and bytes.
    pub fn text(&self) -> String {
        format!("{:020} {}\n", self.number, hex(&self.bytes))
    }

    /// The key of such a text.
    pub fn parse(text: &str) -> Option<Key> {
        let (number, bytes) = text.trim_end().split_once(' ')?;
        Some(Key { number: number.parse().ok()?, bytes: unhex(bytes)? })
    }
}

/// The first key and when it was made. It gives all later keys: keep it off the machine.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct VerificationKey {
    /// The first key.
    pub first: Key,
    /// When it was made.
    pub made: Timestamp,
}

impl VerificationKey {
    /// As a text that [`VerificationKey::parse`] reads.
    pub fn text(&self) -> String {
        format!("{} {}", self.made, self.first.text())
    }

    /// The key of a text; lines that begin with `#` are comments.
    pub fn parse(text: &str) -> Option<VerificationKey> {
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
        let (Some(line), None) = (lines.next(), lines.next()) else { return None };
        let (made, first) = line.split_once(' ')?;
        Some(VerificationKey { made: made.parse().ok()?, first: Key::parse(first)? })
    }
}

/// The number of a seal, if the entry is one.
pub fn number(entry: &Entry) -> Option<u64> {
    (*entry.action == *RecordedAction::SealAuditLog.word()).then(|| entry.target.parse().ok())?
}

/// How far a log is sealed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sealed {
    /// Seals made with the key.
    pub seals: u64,
    /// The entry of the last one, which seals all before it, and its time.
    pub last: Option<(u64, Timestamp)>,
    /// Entries behind the last seal.
    pub unsealed: u64,
}

/// Finds the first wrong or missing seal of a log whose chain is whole.
pub struct SealCheck {
    first: Key,
    next: Key,
    /// The last entry that was checked.
    entry: ChainHash,
    last: Option<(u64, Timestamp)>,
    bad: Option<FirstBad>,
}

impl SealCheck {
    /// Before the first entry. Seals of an earlier key are left alone.
    pub fn new(key: &VerificationKey) -> SealCheck {
        SealCheck { first: key.first, next: key.first, entry: START, last: None, bad: None }
    }

    /// The next entry, and its place in the chain.
    pub fn entry(&mut self, entry: &Entry, chain_hash: ChainHash) {
        let before = std::mem::replace(&mut self.entry, chain_hash);
        let Some(number) = number(entry).filter(|_| self.bad.is_none()) else { return };
        let expected = self.next.number;
        if number < expected && self.last.is_none() {
            return;
        }
        let fits = entry.new.as_deref() == Some(&*hex(&self.next.seal(before, entry.utc)));
        let why = if number != expected {
            format!("found seal {number}, expected seal {expected}: seals are missing or were put in")
        } else if !fits {
            format!("seal {number} is wrong: entries before it were changed, or another key was used")
        } else {
            self.next = self.next.next();
            self.last = Some((entry.n, entry.utc));
            return;
        };
        // In a whole chain an entry stands in the line of its number.
        self.bad = Some(FirstBad { line: entry.n, why });
    }

    /// After the last entry. `present` is the key of the station, read before the log: who cuts the log with its seals has no
    /// key that fits what is left. Without one a cut behind the last seal stays unknown.
    pub fn end(self, present: Option<Key>) -> Result<Sealed, FirstBad> {
        if let Some(bad) = self.bad {
            return Err(bad);
        }
        let bad = |why| Err(FirstBad { line: self.entry.number + 1, why });
        if let Some(present) = present {
            let next = self.next.number;
            if next < present.number {
                return bad(format!("the log was cut here: seals {next} to {} are missing", present.number - 1));
            }
            let fits = (self.first.number..=next).zip(std::iter::successors(Some(self.first), |key| Some(key.next())));
            if !fits.into_iter().any(|(_, key)| key == present) {
                return bad("the log may have been cut here: the station has a key that never followed this one".into());
            }
        }
        let unsealed = self.entry.number - self.last.map_or(0, |(entry, _)| entry);
        Ok(Sealed { seals: self.next.number - self.first.number, last: self.last, unsealed })
    }
}

/// HMAC-SHA-256 of RFC 2104.
fn hmac(key: &[u8; 32], message: &[u8]) -> [u8; 32] {
    let pad = |byte: u8| {
        let mut block = [byte; BLOCK];
        block.iter_mut().zip(key).for_each(|(byte, key)| *byte ^= key);
        block
    };
    let inner = Sha256::new_with_prefix(pad(0x36)).chain_update(message).finalize();
    Sha256::new_with_prefix(pad(0x5c)).chain_update(inner).finalize().into()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::access::audit_log::{Check, line};

    const KEY: VerificationKey =
        VerificationKey { first: Key { number: 5, bytes: [7; 32] }, made: Timestamp::UNIX_EPOCH };

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).unwrap()
    }

    /// A log with an action before each seal and one behind the last; `key` makes the seals.
    fn sealed(mut key: Key, seals: u64) -> Vec<(Entry, ChainHash)> {
        let (mut check, mut entries) = (Check::new(None, &[]), Vec::new());
        let mut append = |action: ActionRecord| {
            let (text, chain_hash) = line(check.last(), &action);
            entries.push((check.line(text.trim_end().as_bytes()).unwrap(), chain_hash));
            chain_hash
        };
        for second in 0..seals {
            let last = append(ActionRecord { action: "write".into(), ..key.entry(START, at(0)) });
            append(key.entry(last, at(second as i64)));
            key = key.next();
        }
        append(ActionRecord { action: "write".into(), ..key.entry(START, at(0)) });
        entries
    }

    fn check(entries: &[(Entry, ChainHash)], present: Option<Key>) -> Result<Sealed, FirstBad> {
        let mut check = SealCheck::new(&KEY);
        entries.iter().for_each(|(entry, chain_hash)| check.entry(entry, *chain_hash));
        check.end(present)
    }

    fn key(number: u64) -> Key {
        (KEY.first.number..number).fold(KEY.first, |key, _| key.next())
    }

    #[test]
    fn the_hmac_is_that_of_rfc_4231() {
        let short = |bytes: &[u8]| {
            let mut key = [0; 32];
            key[..bytes.len()].copy_from_slice(bytes);
            key
        };
        let cases: [(&[u8], &[u8], &str); 3] = [
            (&[0x0b; 20], b"Hi There", "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7"),
            (
                b"Jefe",
                b"what do ya want for nothing?",
                "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843",
            ),
            (&[0xaa; 20], &[0xdd; 50], "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe"),
        ];
        for (key, message, expected) in cases {
            assert_eq!(hex(&hmac(&short(key), message)), expected);
        }
    }

    #[test]
    fn a_sealed_log_says_how_far_it_is_sealed() {
        let entries = sealed(KEY.first, 3);
        let found = Sealed { seals: 3, last: Some((6, at(2))), unsealed: 1 };
        for present in [None, Some(key(8)), Some(key(7))] {
            assert_eq!(
                check(&entries, present),
                Ok(found.clone()),
                "also where the process ended before the key was replaced"
            );
        }
        assert_eq!(check(&[], Some(KEY.first)), Ok(Sealed { seals: 0, last: None, unsealed: 0 }), "not sealed yet");
        let earlier = sealed(Key::new(2, [1; 32]), 3);
        assert_eq!(check(&earlier, Some(KEY.first)), Ok(Sealed { seals: 0, last: None, unsealed: 7 }), "another key's");
    }

    #[test]
    fn wrong_and_missing_seals_are_named_with_their_line() {
        let line = |entries: &[(Entry, ChainHash)], present| check(entries, present).unwrap_err().line;
        let entries = sealed(KEY.first, 3);
        // Written again with a chain that is whole, by who has the key after them.
        assert_eq!(line(&sealed(key(8), 3), Some(key(8))), 2, "a later key's number");
        assert_eq!(
            line(&sealed(Key { number: 5, ..key(8) }, 3), Some(key(8))),
            2,
            "a later key under an earlier number"
        );
        let mut other = entries.clone();
        other[2].1.hash[0] ^= 1;
        assert_eq!(line(&other, Some(key(8))), 4, "another entry before the second seal");
        other = entries.clone();
        other[5].0.utc = at(99);
        assert_eq!(line(&other, Some(key(8))), 6, "another time of the third seal");
        assert_eq!(line(&entries[..4], Some(key(8))), 5, "cut with its last seal");
        assert_eq!(line(&entries[..4], Some(Key { number: 7, ..key(8) })), 5, "cut, and the number of the key as well");
        assert_eq!(line(&entries[..1], Some(key(8))), 2, "cut with all seals");
        assert_eq!(line(&entries, Some(Key { number: u64::MAX, ..key(8) })), 8);
        assert_eq!(line(&entries, Some(Key { number: 0, ..key(8) })), 8);
    }

    #[test]
    fn a_key_makes_one_seal() {
        assert!(KEY.first.after(None) == Some(KEY.first) && KEY.first.after(Some(4)) == Some(KEY.first));
        assert!(KEY.first.after(Some(5)) == Some(key(6)), "the process ended before it was replaced");
        assert!(KEY.first.after(Some(6)).is_none(), "an older key was put back");
    }

    #[test]
    fn seals_are_due_each_hour_and_a_minute_after_a_failure() {
        assert!(is_due(None, at(7_300)));
        assert!(!is_due(Some((at(7_300), true)), at(10_799)) && is_due(Some((at(7_300), true)), at(10_800)));
        assert!(!is_due(Some((at(7_300), false)), at(7_310)) && is_due(Some((at(7_300), false)), at(7_320)));
        assert!(is_due(Some((at(7_300), true)), at(7_100)), "the clock was set back");
    }

    #[test]
    fn keys_come_back_from_their_text() {
        assert!(Key::parse(&key(9).text()) == Some(key(9)));
        let text = format!("# keep it off the machine\n\n{}", KEY.text());
        assert!(VerificationKey::parse(&text) == Some(KEY));
        for wrong in ["", "5 00", &key(9).text(), &[text.as_str(), &text].concat(), &KEY.text().replace('T', "?")] {
            assert!(VerificationKey::parse(wrong).is_none(), "{wrong}");
        }
    }
}
