//! Gives back the room of a database that it no longer needs: deleted rows leave blocks that only a new file is without.

use std::fs;

use jiff::Timestamp;

use super::{
    archive::{LeftOut, Steps, sync_and_hash},
    backup::failed,
    files::{self, Exclusive},
    store::Store,
};
use crate::{
    history::HistoryError,
    profile::io::atomic::{sync_folder, with_suffix},
};

/// What the name of the new file ends with until it takes the place of the other.
pub(super) const UNFINISHED: &str = ".compact";

/// What was done.
#[derive(Debug, PartialEq, Eq)]
pub struct Compacted {
    /// Jobs of the archive.
    pub jobs: usize,
    /// Bytes of the database before.
    pub before: u64,
    /// And after.
    pub after: u64,
}

/// Does all jobs of the archive that are due and writes the database into a new file, which takes its place by a rename.
/// The only connection to it is closed.
pub fn compact(store: Store, now: Timestamp, steps: Steps) -> Result<Compacted, HistoryError> {
    let path = store.path.clone();
    // Of a station that was killed: an hour without the ends would be archived as if it had run on.
    store.end_curves_left_behind(now)?;
    let (before, mut jobs) = (store.file_bytes(), 0);
    while let Some(job) = store.archive_due(now, &LeftOut::default())? {
        store.archive(&job)?;
        jobs += 1;
        steps("archived")?;
    }
    store.checkpoint()?;
    if files::disk(&path).is_some_and(|disk| disk.free < store.file_bytes()) {
        let needed = (store.file_bytes() >> 20) + 1;
        return Err(HistoryError::Refused(format!("{}: expected {needed} MiB free on its disk", path.display())));
    }
    let new = with_suffix(&path, UNFINISHED);
    let copied = store.copy_database(&new).and_then(|()| Store::peek(&new)).map(drop);
    let copied = copied.and_then(|()| sync_and_hash(&new).map_err(|error| failed(&new, &error)));
    if let Err(error) = copied {
        files::remove(&new);
        return Err(error);
    }
    steps("copied")?;
    // No other process opens the file between its closing and the rename.
    let exclusive = Exclusive::hold(&path)?;
    let closed = store.alive();
    drop(store);
    if closed.strong_count() > 0 || files::has_log(&path) {
        files::remove(&new);
        return Err(HistoryError::Engine("the database did not close in order".into()));
    }
    fs::rename(&new, &path).and_then(|()| sync_folder(&path)).map_err(|error| failed(&path, &error))?;
    steps("in place")?;
    drop(exclusive);
    Ok(Compacted { jobs, before, after: files::size(&path) })
}
