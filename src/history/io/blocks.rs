//! The blocks that a checkpoint overwrites, kept beside the database until it has ended: where power is lost meanwhile, they
//! are put back.
//!
//! The engine puts new metadata into free parts of blocks that are in use, and writes each such block as a whole, 256 KiB,
//! before its header names what is new (DuckDB 1.5). A disk writes that in parts: a loss of power leaves a block that is
//! neither the old nor the new one, its checksum is wrong, and nothing of the file can be read. The old block has all that
//! the header names, and the log all that came later.

use std::{
    fs::{self, File},
    io,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use duckdb::Connection;
use sha2::{Digest, Sha256};

use super::store::engine;
use crate::{
    history::HistoryError,
    profile::io::{
        atomic::{with_suffix, write_atomic},
        regular,
    },
};

/// The headers of a database; its blocks follow.
const HEADERS: usize = 3 * 4096;
const SHA: usize = 32;
/// More metadata than any history has: it is not kept then.
const KEPT_MAX: usize = 64 << 20;

fn beside(db: &Path) -> PathBuf {
    with_suffix(db, ".blocks")
}

/// Reads blocks of a database that is open.
#[derive(Debug, Default)]
pub struct Blocks {
    /// Closed after the last connection: whoever closes a file loses all its locks on it, those of the engine too (POSIX).
    file: OnceLock<File>,
}

impl Blocks {
    /// Keeps what the next checkpoint may overwrite.
    pub fn keep(&self, db: &Connection, path: &Path) -> Result<(), HistoryError> {
        let size: u64 =
            db.query_row("SELECT block_size FROM pragma_database_size()", [], |row| row.get(0)).map_err(engine)?;
        let mut statement = db.prepare("SELECT block_id FROM pragma_metadata_info()").map_err(engine)?;
        let blocks = statement.query_map([], |row| row.get(0)).and_then(Iterator::collect).map_err(engine)?;
        let failed = |error: io::Error| HistoryError::Engine(format!("{}: {error}", beside(path).display()));
        self.write(path, size, blocks).map_err(failed)
    }

    fn write(&self, path: &Path, size: u64, blocks: Vec<u64>) -> io::Result<()> {
        if KEPT_MAX as u64 / size < blocks.len() as u64 {
            return Ok(());
        }
        let file = match self.file.get() {
            Some(file) => file,
            None => {
                let file = regular::open(path)?;
                self.file.get_or_init(|| file)
            }
        };
        let mut kept = vec![0; SHA + HEADERS];
        file.read_exact_at(&mut kept[SHA..], 0)?;
        kept.extend(size.to_le_bytes());
        for block in blocks {
            let begin = kept.len() + 8;
            kept.extend(block.to_le_bytes());
            kept.resize(begin + usize::try_from(size).map_err(io::Error::other)?, 0);
            file.read_exact_at(&mut kept[begin..], HEADERS as u64 + block * size)?;
        }
        let sha = Sha256::digest(&kept[SHA..]);
        kept[..SHA].copy_from_slice(&sha);
        write_atomic(&beside(path), &kept, 0o640)
    }
}

/// The checkpoint has ended.
pub fn forget(db: &Path) {
    // What stays belongs to other headers, and is never put back.
    let _ = fs::remove_file(beside(db));
}

/// Whether there are blocks that may be put back.
pub fn are_kept(db: &Path) -> bool {
    beside(db).exists()
}

/// Puts the blocks back that a checkpoint without an end has overwritten; to be called for a file that cannot be read, while
/// this process does not have it open. `false` if none are kept for it as it is.
pub fn put_back(db: &Path) -> io::Result<bool> {
    let kept = match regular::read(&beside(db), KEPT_MAX as u64 + (1 << 20)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        kept => kept?,
    };
    let Some((sha, rest)) = kept.split_at_checked(SHA).filter(|(_, rest)| HEADERS + 8 <= rest.len()) else {
        return Ok(false);
    };
    let file = regular::open_with(File::options().read(true).write(true), db)?;
    let mut headers = vec![0; HEADERS];
    file.read_exact_at(&mut headers, 0)?;
    let (of_then, rest) = rest.split_at(HEADERS);
    if *Sha256::digest(&kept[SHA..]) != *sha || headers != of_then {
        return Ok(false);
    }
    let (size, blocks) = rest.split_at(8);
    let number = |bytes: &[u8]| bytes.try_into().map(u64::from_le_bytes).map_err(io::Error::other);
    let size = number(size)?;
    for block in blocks.chunks_exact(8 + usize::try_from(size).map_err(io::Error::other)?) {
        let (block, bytes) = block.split_at(8);
        file.write_all_at(bytes, HEADERS as u64 + number(block)? * size)?;
    }
    file.sync_all()?;
    Ok(true)
}
