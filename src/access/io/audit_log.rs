//! The audit log on disk: read, verified, appended to.

use std::{
    collections::VecDeque,
    ffi::OsStr,
    fs::{File, OpenOptions, TryLockError},
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write},
    os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt},
    path::{Path, PathBuf},
    sync::Arc,
};

use jiff::Timestamp;

use crate::{
    access::{
        audit_log::{self, Check, FirstBad, Summary},
        sealing::{self, Key},
    },
    history::io::chain::CHAIN_HASHES_MAX,
    plant::{
        procedure,
        record::{ActionRecord, ChainHash},
        recorded_action::RecordedAction,
    },
    profile::io::{atomic, regular},
};

/// Why the files beside a history that another process has are left alone.
pub const IN_USE: &str = "another process records to this history";

/// The audit log beside a history: `tank.audit.jsonl` beside `tank.duckdb`.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("audit.jsonl")
}

/// Where the last chain hash is noted: `tank.audit.head` beside `tank.audit.jsonl`.
pub fn head_of(audit_log: &Path) -> PathBuf {
    audit_log.with_extension("head")
}

/// Why an audit log is not whole, or cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// It cannot be read.
    #[error("{path} cannot be read: {error}")]
    Io {
        /// The file.
        path: String,
        /// Why.
        error: io::Error,
    },
    /// It was changed.
    #[error("{path}: {bad}")]
    Bad {
        /// The file.
        path: String,
        /// Where.
        bad: FirstBad,
    },
}

/// Reads an audit log from its beginning and finds the first line that is not as it was written. `rows` are the chain hashes that the
/// history holds; empty to look at the audit log alone. Safe while a station writes.
pub fn verify(path: &Path, rows: &[ChainHash]) -> Result<Summary, VerifyError> {
    verify_each(path, rows, |_, _| {})
}

/// As [`verify`], and hands out each sound entry.
pub(super) fn verify_each(
    path: &Path,
    rows: &[ChainHash],
    mut each: impl FnMut(&audit_log::Entry, ChainHash),
) -> Result<Summary, VerifyError> {
    let failed = |error| VerifyError::Io { path: path.display().to_string(), error };
    // The note first: the audit log may be ahead of it, never behind.
    let head = read_head(path).map_err(failed)?;
    let file = regular::open(path).map_err(failed)?;
    let mut check = Check::new(head, rows);
    let scanned = scan(file, &mut check, |entry, chain_hash| each(&entry, chain_hash)).map_err(failed)?;
    check.end(scanned.torn).map_err(|bad| VerifyError::Bad { path: path.display().to_string(), bad })
}

/// Entries of before an instant behind the one of this number; none where there is no log. A station that was killed has them
/// here, and its history gets them at the next start.
pub fn count_behind(path: &Path, number: u64, until: Timestamp) -> Result<u64, VerifyError> {
    let mut count = 0;
    match verify_each(path, &[], |entry, _| count += u64::from(number < entry.n && entry.utc < until)) {
        Ok(_) => Ok(count),
        Err(VerifyError::Io { error, .. }) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error),
    }
}

fn read_head(audit_log: &Path) -> io::Result<Option<ChainHash>> {
    Ok(super::read_line_of(&head_of(audit_log))?.and_then(|text| audit_log::head(&text)))
}

/// How far the whole lines reach, in bytes, and whether something stands behind them: the beginning of a line, or what a loss of
/// power left of the last entries, zeros where a block of the disk was not written yet.
struct Scanned {
    bytes: u64,
    torn: bool,
}

fn scan(file: File, check: &mut Check, mut each: impl FnMut(audit_log::Entry, ChainHash)) -> io::Result<Scanned> {
    let length = file.metadata()?.len();
    let mut reader = BufReader::new(file);
    let mut bytes = 0;
    let mut line = Vec::new();
    loop {
        line.clear();
        let read = (&mut reader).take(audit_log::LINE_MAX as u64).read_until(b'\n', &mut line)?;
        if line.last() != Some(&b'\n') && read < audit_log::LINE_MAX {
            return Ok(Scanned { bytes, torn: read > 0 });
        }
        let is_last = length.saturating_sub(bytes) <= audit_log::LINE_MAX as u64;
        if line.contains(&0) && is_last && check.has_all_noted() {
            return Ok(Scanned { bytes, torn: true });
        }
        bytes += read as u64;
        let whole = line.strip_suffix(b"\n").unwrap_or(&line);
        if let Some(entry) = check.line(whole) {
            each(entry, check.last());
        }
    }
}

/// The number of the last seal in a log.
pub(super) fn last_seal(log: File) -> io::Result<Option<u64>> {
    let mut last = None;
    scan(log, &mut Check::new(None, &[]), |entry, _| last = sealing::number(&entry).or(last))?;
    Ok(last)
}

/// An audit log that can be written.
#[derive(Debug)]
pub struct AuditLog {
    file: File,
    head: File,
    last: ChainHash,
    bytes: u64,
    /// The number of the last seal over it, and of its entry.
    last_seal: Option<(u64, u64)>,
}

/// What was found when the audit log was opened.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Opened {
    /// What is wrong with it, each for a line of its own.
    pub wrong: Vec<String>,
    /// The hash of the plant file that was recorded last.
    pub plant_file: Option<Arc<str>>,
    /// When that was.
    pub plant_file_since: Option<Timestamp>,
    /// The hash of the users that was recorded last.
    pub users_file: Option<Arc<str>>,
    /// The last start or end of a procedure.
    pub procedure: Option<ActionRecord>,
    /// The latest sound entries, with their chain hashes, oldest first: to compare the history with, and to complete it.
    pub tail: VecDeque<ActionRecord>,
}

impl AuditLog {
    /// Opens an audit log, or begins one. Nothing in it is ever changed or removed: a torn last line is put beside, and behind
    /// lines that were tampered with it goes on from the last chain hash that the station knows.
    /// [`io::ErrorKind::WouldBlock`] while another process writes it: two writers would break the chain.
    pub fn open(path: &Path) -> io::Result<(AuditLog, Opened)> {
        let mut file = own(OpenOptions::new().read(true).append(true).create(true), path)?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => io::Error::new(io::ErrorKind::WouldBlock, IN_USE),
            TryLockError::Error(error) => error,
        })?;
        let mut opened = Opened::default();
        let head = read_head(path)?;
        let mut check = Check::new(head, &[]);
        let mut last_seal = None;
        let Scanned { bytes, torn } = scan(file.try_clone()?, &mut check, |entry, chain_hash| {
            if *entry.action == *RecordedAction::PlantFile.word() {
                opened.plant_file.clone_from(&entry.new);
                opened.plant_file_since = Some(entry.utc);
            } else if *entry.action == *RecordedAction::UsersFile.word() {
                opened.users_file.clone_from(&entry.new);
            }
            last_seal = sealing::number(&entry).map(|number| (number, entry.n)).or(last_seal);
            let record = entry.chained(chain_hash);
            if procedure::is_transition(&record) {
                opened.procedure = Some(record.clone());
            }
            opened.tail.push_back(record);
            if CHAIN_HASHES_MAX < opened.tail.len() {
                opened.tail.pop_front();
            }
        })?;
        if torn {
            let beside = set_aside(&mut file, path, bytes)?;
            opened.wrong.push(format!("the last line was torn, it is kept in {}", beside.display()));
        }
        let last = head.filter(|head| check.last().number < head.number).unwrap_or(check.last());
        if let Err(bad) = check.end(false) {
            opened.wrong.push(format!("it is broken at {bad}; it goes on after entry {}", last.number));
        }
        let head = own(OpenOptions::new().write(true).create(true).truncate(false), &head_of(path))?;
        let audit_log = AuditLog { file, head, last, bytes, last_seal };
        audit_log.note(last)?;
        audit_log.head.sync_all()?;
        // The names must outlive a loss of power too.
        atomic::sync_folder(path)?;
        Ok((audit_log, opened))
    }

    /// Is it still as it was left? If not it must be opened again.
    pub fn is_intact(&self) -> bool {
        self.file.metadata().is_ok_and(|metadata| metadata.nlink() > 0 && metadata.len() == self.bytes)
    }

    /// Writes into another handle from now on, as into a disk that refuses.
    #[cfg(test)]
    pub fn set_file(&mut self, file: File) {
        self.file = file;
    }

    /// The chain hash of the last line.
    pub fn last(&self) -> ChainHash {
        self.last
    }

    /// The number of the last seal over it.
    pub fn last_seal(&self) -> Option<u64> {
        self.last_seal.map(|(number, _)| number)
    }

    /// Is nothing behind the last seal?
    pub fn is_sealed(&self) -> bool {
        self.last_seal.is_some_and(|(_, entry)| entry == self.last.number)
    }

    /// Appends a seal over everything before it.
    pub fn seal(&mut self, key: &Key, at: Timestamp) -> io::Result<ActionRecord> {
        let mut entry = [key.entry(self.last, at)];
        self.append(&mut entry)?;
        self.last_seal = Some((key.number, self.last.number));
        let [entry] = entry;
        Ok(entry)
    }

    /// Appends records, all or none, and sets their chain hashes. When this returns they are on disk.
    pub fn append(&mut self, records: &mut [ActionRecord]) -> io::Result<()> {
        if !self.is_intact() {
            return Err(io::Error::other("another process has removed or changed it"));
        }
        let (mut last, mut text, mut chain_hashes) = (self.last, String::new(), Vec::with_capacity(records.len()));
        for record in records.iter() {
            let (line, chain_hash) = audit_log::line(last, record);
            text += &line;
            chain_hashes.push(chain_hash);
            last = chain_hash;
        }
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.sync_data());
        if let Err(error) = written {
            // Removes a partial line; if that fails, it is set aside when the audit log is opened again.
            let _ = self.file.set_len(self.bytes);
            return Err(error);
        }
        (self.last, self.bytes) = (last, self.bytes + text.len() as u64);
        for (record, chain_hash) in records.iter_mut().zip(chain_hashes) {
            record.chain_hash = Some(chain_hash);
        }
        // The records are on disk; a note that is behind is no reason to write them twice.
        if let Err(error) = self.note(last) {
            tracing::warn!(%error, "the last entry of the audit log could not be recorded");
        }
        Ok(())
    }

    fn note(&self, last: ChainHash) -> io::Result<()> {
        self.head.write_all_at(audit_log::head_text(last).as_bytes(), 0)
    }
}

/// Opens a file for the station's own user only; nothing but a plain file.
fn own(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    regular::open_no_link(options.mode(0o600), path)
}

/// Puts what stands behind the last whole line into a file beside the audit log.
fn set_aside(file: &mut File, path: &Path, bytes: u64) -> io::Result<PathBuf> {
    let mut torn = Vec::new();
    file.seek(SeekFrom::Start(bytes))?;
    file.take(audit_log::LINE_MAX as u64).read_to_end(&mut torn)?;
    let name = path.file_name().unwrap_or(OsStr::new("audit")).to_string_lossy().into_owned();
    // The place of the line, so that a second one does not replace the first.
    let mut places = (0..).map(|more| path.with_file_name(format!("{name}.torn-{bytes}-{more}")));
    let beside = places.find(|path| !path.exists()).expect("there is always one more number");
    let mut kept = own(OpenOptions::new().write(true).create_new(true), &beside)?;
    kept.write_all(&torn)?;
    kept.sync_all()?;
    file.set_len(bytes)?;
    file.sync_all()?;
    Ok(beside)
}
