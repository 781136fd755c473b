//! The files of a plant besides its history, which go with a backup of it: the audit log, the users and the parameter sets.
//! The sealing key does not: whoever has an old one can forge every seal since.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::sets;
use crate::{
    access::io::{audit_log, users_beside},
    history::backup::{AUDIT_LOG, BackupSource, SETS, USERS},
};

/// Those that there are. Blocks while the disk works.
pub fn companions(history: &Path, plant: &str) -> Vec<BackupSource> {
    let own = [(audit_log::beside(history), AUDIT_LOG), (users_beside(history), USERS)];
    let own = own.map(|(from, path)| BackupSource { from, path: path.to_owned() });
    let found = fs::read_dir(sets::folder(history, plant)).into_iter().flatten().flatten().filter_map(|entry| {
        let name = entry.file_name().into_string().ok().filter(|name| name.ends_with(".toml"))?;
        Some(BackupSource { from: entry.path(), path: format!("{SETS}/{name}") })
    });
    own.into_iter().chain(found).filter(|source| source.from.is_file()).collect()
}

/// Where a file of a backup belongs that is restored only where it is missing; `None` for the history and its audit log.
pub fn place(history: &Path, plant: &str, path: &str) -> Option<PathBuf> {
    match path.strip_prefix(SETS).and_then(|path| path.strip_prefix('/')) {
        Some(name) => Some(sets::folder(history, plant).join(name)),
        None => (path == USERS).then(|| users_beside(history)),
    }
}
