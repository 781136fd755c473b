//! The sealing key beside the audit log: made once, replaced after each seal, and the check of all seals.

use std::{
    fs::{self, OpenOptions},
    io,
    os::unix::fs::{FileExt, MetadataExt, fchown},
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use super::{
    audit_log::{self, AuditLog, VerifyError, verify_each},
    random, read_line_of,
};
use crate::{
    access::{
        audit_log::Summary,
        sealing::{Key, SealCheck, Sealed, VerificationKey},
    },
    history::words::plain,
    plant::record::{ActionRecord, ChainHash},
    profile::io::{
        atomic::{self, write_atomic},
        regular,
    },
};

/// The key beside a log: `tank.audit.key` beside `tank.audit.jsonl`.
pub fn beside(log: &Path) -> PathBuf {
    log.with_extension("key")
}

/// Reads the present key; `None` where there is none.
pub fn read(path: &Path) -> io::Result<Option<Key>> {
    let damaged = || io::Error::new(io::ErrorKind::InvalidData, "the sealing key is damaged");
    read_line_of(path)?.map(|text| Key::parse(&text).ok_or_else(damaged)).transpose()
}

/// Makes the first key of a log, for the user who owns the log; [`io::ErrorKind::AlreadyExists`] if there is a key. Where a
/// log has seals of an earlier key the numbers go on.
pub fn make(log: &Path, made: Timestamp) -> io::Result<VerificationKey> {
    let path = beside(log);
    let last = match regular::open(log) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        file => audit_log::last_seal(file?)?,
    };
    let bytes = random().map_err(io::Error::other)?;
    let first = Key::new(last.map_or(0, |last| last + 1), bytes);
    atomic::write_placed(&path, first.text().as_bytes(), 0o600, |file, new| {
        let owner = fs::metadata(log).or_else(|_| fs::metadata(path.parent().unwrap_or(Path::new("."))))?;
        let own = file.metadata()?.uid();
        if own == 0 && owner.uid() != own {
            fchown(file, Some(owner.uid()), Some(owner.gid()))?;
        }
        // Unlike a rename, a link never replaces a key that is there.
        fs::hard_link(new, &path)
    })?;
    Ok(VerificationKey { first, made })
}

/// Seals a log as far as it goes, if it has a key. Gives the entry that was appended, and why it failed, in words for the
/// operator: both if the key could not be replaced behind the seal.
///
/// The seal is on disk before its key is replaced, and a key that the log has a seal of is replaced before the next one: a
/// process that is killed in between leaves neither a gap nor two seals of one key.
pub fn seal(audit_log: &mut AuditLog, log: &Path, at: Timestamp) -> (Option<ActionRecord>, Result<(), String>) {
    let path = beside(log);
    let failed = |why: &str| Err(format!("the audit log is not sealed: {why}: {}", path.display()));
    let present = match read(&path) {
        Ok(Some(key)) => key,
        Ok(None) if audit_log.last_seal().is_none() => return (None, Ok(())),
        Ok(None) => return (None, failed("the sealing key is missing")),
        Err(error) => return (None, failed(&plain(&error.to_string()))),
    };
    let Some(key) = present.after(audit_log.last_seal()) else {
        return (None, failed("the sealing key is older than the last seal"));
    };
    if key != present
        && let Err(error) = replace(&path, &key)
    {
        return (None, failed(&plain(&error.to_string())));
    }
    if audit_log.is_sealed() {
        return (None, Ok(()));
    }
    match audit_log.seal(&key, at) {
        Ok(entry) => (Some(entry), replace(&path, &key.next()).or_else(|error| failed(&plain(&error.to_string())))),
        Err(error) => (None, Err(format!("the audit log is not sealed: {}", plain(&error.to_string())))),
    }
}

/// Replaces the key on disk and overwrites the old one, which would else stay readable in free blocks of the disk.
fn replace(path: &Path, key: &Key) -> io::Result<()> {
    let old = regular::open_with(OpenOptions::new().write(true), path)?;
    write_atomic(path, key.text().as_bytes(), 0o600)?;
    old.write_all_at(&vec![0; key.text().len()], 0)?;
    old.sync_data()
}

/// Reads a log as [`audit_log::verify`] does, and checks its seals. `false` if the present key is missing: then a log that was cut
/// with its last seals is not found.
pub fn verify(log: &Path, rows: &[ChainHash], key: &VerificationKey) -> Result<(Summary, Sealed, bool), VerifyError> {
    let path = beside(log);
    // Before the log, which may be ahead of it. Once more where the station replaces it at this moment.
    let present = read(&path).or_else(|_| read(&path));
    let present = present.map_err(|error| VerifyError::Io { path: path.display().to_string(), error })?;
    let mut check = SealCheck::new(key);
    let summary = verify_each(log, rows, |entry, chain_hash| check.entry(entry, chain_hash))?;
    let sealed = check.end(present).map_err(|bad| VerifyError::Bad { path: log.display().to_string(), bad })?;
    Ok((summary, sealed, present.is_some()))
}
