//! What a backup is: a folder with a manifest, and files that are named for their content.
//!
//! ```text
//!   backup.json                                        the manifest: a folder without it is no backup
//!   history.0f3a….duckdb                               the database
//!   audit.77c1….jsonl                                  the audit log
//!   users.4d02….toml, sets/summer.b81e….toml           users and parameter sets
//!   archive/raw/date=2026-11-23/day.9b2e….parquet      the archive
//! ```
//!
//! No file is ever changed: the next backup to the same folder adds what is new, replaces the manifest, and then removes what
//! that no longer names. Whatever interrupts it, the manifest that is there names whole files.

use std::path::{Component, Path, PathBuf};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// The manifest.
pub const MANIFEST: &str = "backup.json";
/// The database, in the manifest.
pub const DATABASE: &str = "history.duckdb";
/// The folder of the archive, in the manifest.
pub const ARCHIVE: &str = "archive";
/// The audit log, in the manifest.
pub const AUDIT_LOG: &str = "audit.jsonl";
/// The users, in the manifest.
pub const USERS: &str = "users.toml";
/// The folder of the parameter sets, in the manifest.
pub const SETS: &str = "sets";
/// What the name of a file ends with until it is whole.
pub const UNFINISHED: &str = ".new";
/// The version of the manifest.
pub const VERSION: u32 = 1;

/// Letters of the hash in a name.
const HASH_LETTERS: usize = 16;
/// What a backup consists of.
const ENDINGS: [&str; 4] = ["duckdb", "jsonl", "parquet", "toml"];

/// A backup, as its manifest has it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Backup {
    /// [`VERSION`].
    pub version: u32,
    /// Of which history: the random number that its database was given when it was made.
    pub identity: u64,
    /// When it was taken.
    pub taken: Timestamp,
    /// The latest record in it.
    pub until: Option<Timestamp>,
    /// Its files; the database is the first.
    pub files: Vec<BackupFile>,
    /// Files of the archive that were missing or damaged in the history itself.
    pub missing: Vec<String>,
}

/// A file that goes with the history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BackupSource {
    /// Where it lies.
    pub from: PathBuf,
    /// What it is in the manifest.
    pub path: String,
}

/// A file of a backup.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BackupFile {
    /// What it is: `history.duckdb`, `archive/raw/date=2026-11-23/day.parquet`.
    pub path: String,
    /// Its bytes.
    pub bytes: u64,
    /// SHA-256 of them, in hexadecimal.
    pub sha256: String,
}

impl Backup {
    /// The bytes of all files.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// One sentence for the operator and the audit log.
    pub fn summary(&self) -> String {
        let until = self.until.map_or_else(|| "nothing stored yet".to_owned(), |until| format!("up to {until:.0}"));
        let missing = match self.missing.as_slice() {
            [] => String::new(),
            missing => format!("; missing or damaged in the archive itself: {}", missing.join(", ")),
        };
        let mib = self.bytes() as f64 / f64::from(1 << 20);
        format!("{until}, {} files, {mib:.1} MiB{missing}", self.files.len())
    }
}

impl BackupFile {
    /// Its path below the folder of the backup: with a part of its hash before the ending.
    pub fn stored(&self) -> String {
        hashed(&self.path, &self.sha256)
    }

    /// Whether its path is one that a backup has; one from elsewhere could lead anywhere.
    pub fn is_sound(&self) -> bool {
        let plain = Path::new(&self.path).components().all(|part| matches!(part, Component::Normal(_)));
        let is_set = self.path.strip_prefix(SETS).and_then(|path| path.strip_prefix('/'));
        let is_set = is_set.is_some_and(|name| !name.contains('/') && name.ends_with(".toml"));
        let known = [DATABASE, AUDIT_LOG, USERS].contains(&self.path.as_str()) || is_set || self.in_archive().is_some();
        plain && known && self.sha256.len() == 64 && self.sha256.bytes().all(|letter| letter.is_ascii_hexdigit())
    }

    /// The path below the folder of the archive, for a file of that.
    pub fn in_archive(&self) -> Option<&str> {
        self.path.strip_prefix(ARCHIVE)?.strip_prefix('/')
    }
}

/// The path that a file with this hash has in a backup.
pub fn hashed(path: &str, sha256: &str) -> String {
    let (name, ending) = path.rsplit_once('.').unwrap_or((path, ""));
    format!("{name}.{}.{ending}", &sha256[..HASH_LETTERS.min(sha256.len())])
}

/// Whether a file of this name is part of a backup, or of one that was interrupted.
pub fn is_of_backup(name: &str) -> bool {
    let whole = name.strip_suffix(".wal").unwrap_or(name);
    let whole = whole.strip_suffix(UNFINISHED).unwrap_or(whole);
    let mut parts = whole.rsplit('.');
    let (ending, hash) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let is_hash = hash.len() == HASH_LETTERS && hash.bytes().all(|letter| letter.is_ascii_hexdigit());
    name.starts_with(MANIFEST) || ENDINGS.contains(&ending) && is_hash
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_a_backup_are_known() {
        let hash = "0123456789abcdef".repeat(4);
        let file = |path: &str| BackupFile { path: path.into(), bytes: 0, sha256: hash.clone() };
        for (path, stored) in [
            (DATABASE, "history.0123456789abcdef.duckdb"),
            (AUDIT_LOG, "audit.0123456789abcdef.jsonl"),
            (USERS, "users.0123456789abcdef.toml"),
            ("sets/summer.toml", "sets/summer.0123456789abcdef.toml"),
            ("archive/raw/date=2026-11-23/13-2.parquet", "archive/raw/date=2026-11-23/13-2.0123456789abcdef.parquet"),
        ] {
            let file = file(path);
            assert!(file.is_sound(), "{path}");
            assert_eq!(file.stored(), stored);
            let name = stored.rsplit('/').next().unwrap_or_default();
            for name in [name.to_owned(), format!("{name}.new"), format!("{name}.new.wal")] {
                assert!(is_of_backup(&name), "{name}");
            }
        }
        for path in [
            "/etc/passwd",
            "archive/../../x.parquet",
            "../history.duckdb",
            "tank.duckdb",
            "archive",
            "sets/../users.toml",
            "sets/a/b.toml",
        ] {
            assert!(!file(path).is_sound(), "{path}");
        }
        assert!(!BackupFile { sha256: "../../etc".into(), ..file(DATABASE) }.is_sound());
        for name in ["tank.duckdb", "day.parquet", "notes.txt", "photo.0123456789abcdef.jpg"] {
            assert!(!is_of_backup(name), "{name}");
        }
    }
}
