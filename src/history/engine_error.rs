//! What a message of DuckDB or of the system means. No other module compares its words.

use std::path::Path;

use super::HistoryError;

/// What a message says is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum EngineFault {
    /// Another process has the database.
    Locked,
    /// No space, or no more of it for this user.
    DiskFull,
    /// The system does not give access: permission, a folder, the disk.
    NoAccess,
    TooManyFiles,
    OutOfMemory,
    /// A newer version of the engine wrote the file.
    NewerVersion,
    /// A block cannot be read; others may.
    Damage,
    Interrupted,
    /// A checkpoint waits for transactions.
    Busy,
    /// The engine has stopped: the database must be opened again.
    Fatal,
}

use EngineFault::{
    Busy, Damage, DiskFull, Fatal, Interrupted, Locked, NewerVersion, NoAccess, OutOfMemory, TooManyFiles,
};

/// By the words of the engine or of the system: what is wrong, and what an operator reads where its own words do not
/// serve. A message may have several; an operator reads the first.
const FAULTS: [(&str, EngineFault, Option<&str>); 24] = [
    ("Could not set lock", Locked, None),
    ("No space left", DiskFull, Some("the disk is full")),
    ("Disk quota exceeded", DiskFull, Some("the disk quota is exhausted")),
    ("Read-only file system", NoAccess, Some("the disk is read-only")),
    ("Permission denied", NoAccess, Some("no permission for its files")),
    ("Too many open files", TooManyFiles, Some("too many files are open")),
    ("Input/output error", NoAccess, Some("the disk reports a read or write error")),
    ("No such file", NoAccess, Some("its folder or file is missing")),
    ("Is a directory", NoAccess, None),
    ("in read-only mode", NoAccess, None),
    ("Out of Memory", OutOfMemory, Some("not enough memory")),
    ("Cannot allocate memory", OutOfMemory, Some("not enough memory")),
    ("bad_alloc", OutOfMemory, Some("not enough memory")),
    ("memory allocation of", OutOfMemory, Some("not enough memory")),
    ("Resource temporarily unavailable", OutOfMemory, Some("not enough memory or threads")),
    ("newer version", NewerVersion, None),
    ("newer DuckDB", NewerVersion, None),
    ("checksum", Damage, Some("a damaged block, its checksum is wrong")),
    ("Corrupt", Damage, None),
    ("INTERRUPT", Interrupted, Some("interrupted")),
    ("Interrupted", Interrupted, Some("interrupted")),
    ("Cannot CHECKPOINT", Busy, None),
    ("FATAL", Fatal, None),
    ("invalidated", Fatal, Some("the database has stopped after an error")),
];

/// Does it say one of these?
fn says(message: &str, faults: &[EngineFault]) -> bool {
    FAULTS.iter().any(|(words, fault, _)| faults.contains(fault) && message.contains(words))
}

/// What an operator reads of the message, if its own words do not serve.
pub(super) fn label(message: &str) -> Option<&'static str> {
    FAULTS.iter().find_map(|(words, _, label)| label.filter(|_| message.contains(words)))
}

/// Another process has the database.
pub(super) fn is_locked(message: &str) -> bool {
    says(message, &[Locked])
}

/// The file may be as it should be, but something stands in the way.
pub(super) fn is_obstacle(message: &str) -> bool {
    says(message, &[DiskFull, NoAccess, TooManyFiles, OutOfMemory, NewerVersion])
}

/// Whether a message of damage is certainly about the database, not about its log.
pub(super) fn is_of_database(message: &str) -> bool {
    message.contains("Corrupt database file") && !message.contains("WAL")
}

/// Which log of a database is damaged, and how many bytes come before the entry that cannot be read.
pub(super) fn damaged_log_entry(message: &str) -> Option<(&Path, u64)> {
    let (_, named) = message.split_once("replaying WAL file \"")?;
    let (log, rest) = named.split_once("\":")?;
    let (_, rest) = rest.split_once("entry at byte position ")?;
    let position: u64 = rest.split(' ').next()?.parse().ok()?;
    // It is that of the content: size and checksum come before.
    Some((Path::new(log), position.checked_sub(16)?))
}

impl HistoryError {
    fn says(&self, faults: &[EngineFault]) -> bool {
        matches!(self, HistoryError::Engine(message) if says(message, faults))
    }

    /// A block of the file cannot be read; what lies in other blocks can.
    pub(super) fn is_damage(&self) -> bool {
        self.says(&[Damage])
    }

    /// A file of the archive cannot be read. Its damage has many names; what else can fail has few.
    pub(super) fn is_damage_of_file(&self) -> bool {
        matches!(self, HistoryError::Engine(_)) && !self.says(&[Interrupted, OutOfMemory, TooManyFiles, Fatal])
    }

    /// The engine has stopped: the database must be opened again.
    pub(super) fn is_fatal(&self) -> bool {
        self.says(&[Fatal])
    }

    /// A checkpoint failed because queries are answered at the same time: they read, or have all the memory.
    pub(super) fn is_of_queries(&self) -> bool {
        self.says(&[Busy, OutOfMemory]) && !self.is_fatal()
    }
}
