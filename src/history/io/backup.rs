//! Writes a backup, beside a station that records or from a closed history.

use std::{
    collections::HashSet,
    fs::{self, File, TryLockError},
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use super::{
    archive::{Steps, TAGS, sync_and_hash},
    files,
    store::Store,
};
use crate::{
    history::{
        ArchiveFile, HistoryError,
        backup::{
            ARCHIVE, AUDIT_LOG, Backup, BackupFile, BackupSource, DATABASE, MANIFEST, SETS, UNFINISHED, VERSION,
            hashed, is_of_backup,
        },
    },
    profile::io::{
        atomic::{sync_folder, with_suffix, write_atomic},
        regular,
    },
};

/// Many times the longest manifest.
const MANIFEST_BYTES_MAX: u64 = 64 << 20;
/// Instead of the hash in the name of a file that is not whole yet.
const NO_HASH: &str = "0000000000000000";

/// Where a backup goes.
struct Target {
    folder: PathBuf,
    /// It was not there before.
    made: bool,
    /// Held while it is written.
    _lock: File,
}

impl Store {
    /// Writes a backup into a folder that is new or empty, or has an earlier backup of this history: then only what is new.
    /// [`HistoryError::Refused`] for any other folder; on an error nothing new is left in it.
    pub fn back_up(
        &self,
        to: &Path,
        companions: &[BackupSource],
        now: Timestamp,
        steps: Steps,
    ) -> Result<Backup, HistoryError> {
        let target = self.target(to)?;
        let mut new = Vec::new();
        let written = self.write_backup(&target, companions, now, &mut new, steps);
        match &written {
            Ok(backup) => sweep(&target.folder, &backup.files),
            Err(_) => {
                new.iter().for_each(|path| remove(path));
                remove_empty_folders(&target.folder);
                if target.made {
                    // What is in it is not of this backup.
                    let _ = fs::remove_dir(&target.folder);
                }
            }
        }
        written
    }

    /// A backup that ends at a step as if the program were killed there: nothing is removed.
    #[cfg(test)]
    pub(super) fn write_killed(&self, to: &Path, now: Timestamp, steps: Steps) -> Result<Backup, HistoryError> {
        let target = self.target(to)?;
        self.write_backup(&target, &[], now, &mut Vec::new(), steps)
    }

    /// Checks the folder of a backup, makes it where it is missing, and locks it.
    fn target(&self, to: &Path) -> Result<Target, HistoryError> {
        let refuse = |why: &str| Err(HistoryError::Refused(format!("{}: {why}", to.display())));
        let made = !to.exists();
        if made {
            // Not the folders above it: where a disk is not mounted there would be room for half a backup.
            fs::create_dir(to).map_err(|error| failed(to, &error))?;
        }
        let folder = fs::canonicalize(to).map_err(|error| failed(to, &error))?;
        if !folder.is_dir() {
            return refuse("found a file, expected a folder");
        }
        let own = self.path.parent().and_then(|own| fs::canonicalize(own).ok());
        let archive = fs::canonicalize(self.archive_folder()).ok();
        let lock = File::open(&folder).map_err(|error| failed(to, &error))?;
        let unfit = || {
            if own.as_ref() == Some(&folder) || archive.is_some_and(|archive| folder.starts_with(archive)) {
                return Some("the history itself lies here: choose a folder on another disk".to_owned());
            }
            match lock.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Some("another backup is being written to it".to_owned()),
                Err(TryLockError::Error(error)) => return Some(error.to_string()),
            }
            match read_manifest(&folder) {
                Ok(Some(before)) if before.identity != self.last_commit().identity => {
                    Some("it has the backup of another history: choose another folder".to_owned())
                }
                Ok(_) => foreign(&folder).map(|name| {
                    format!("it has other files ({name}): choose a new or empty folder, or that of an earlier backup")
                }),
                Err(error) => Some(error.to_string()),
            }
        };
        match unfit() {
            Some(why) => {
                if made {
                    // Nothing is in it.
                    let _ = fs::remove_dir(&folder);
                }
                refuse(&why)
            }
            None => Ok(Target { folder, made, _lock: lock }),
        }
    }

    /// Everything up to the manifest, with which the backup is whole. `new` are the files that were not there before.
    fn write_backup(
        &self,
        target: &Target,
        companions: &[BackupSource],
        now: Timestamp,
        new: &mut Vec<PathBuf>,
        steps: Steps,
    ) -> Result<Backup, HistoryError> {
        let folder = &target.folder;
        self.refuse_without_room(folder)?;
        let unfinished = folder.join(hashed(DATABASE, NO_HASH) + UNFINISHED);
        new.extend([unfinished.clone(), with_suffix(&unfinished, ".wal")]);
        steps("begun")?;
        self.copy_database(&unfinished)
            .map_err(|error| HistoryError::Refused(format!("{}: {}", folder.display(), error.words())))?;
        steps("database copied")?;
        // The archive as the copy knows it, which is not touched while this runs.
        let copy = Store::peek(&unfinished)?;
        let (archive, last) = (copy.files(None)?, copy.last_commit());
        drop(copy);
        let mut files = vec![named(&unfinished, folder, DATABASE, new)?];
        steps("database named")?;
        let mut missing = Vec::new();
        for file in &archive {
            match copy_file(&self.archive_folder(), file, folder, new)? {
                Some(file) => files.push(file),
                None => missing.push(file.path.clone()),
            }
            steps("file copied")?;
        }
        let tags = BackupSource { from: self.archive_folder().join(TAGS), path: format!("{ARCHIVE}/{TAGS}") };
        for BackupSource { from, path } in [&tags].into_iter().chain(companions).filter(|source| source.from.exists()) {
            files.push(copy_growing(from, folder, path, new)?);
        }
        steps("side files copied")?;
        let (identity, until) = (last.identity, last.at);
        let backup = Backup { version: VERSION, identity, taken: now, until, files, missing };
        sync_folders(folder).map_err(|error| failed(folder, &error))?;
        let text = serde_json::to_vec_pretty(&backup).expect("its keys are words");
        write_atomic(&folder.join(MANIFEST), &text, 0o640).map_err(|error| failed(folder, &error))?;
        Ok(backup)
    }

    /// Refuses before anything is written what would not fit.
    fn refuse_without_room(&self, folder: &Path) -> Result<(), HistoryError> {
        let Some(disk) = files::disk(&folder.join(MANIFEST)) else { return Ok(()) };
        let archive = self.files(None)?;
        let missing = archive.iter().filter(|file| !folder.join(backup_file(file).stored()).exists());
        let needed = self.file_bytes() + missing.map(|file| file.bytes).sum::<u64>();
        match disk.free < needed {
            true => Err(HistoryError::Refused(format!(
                "{}: found {} MiB free, expected {} MiB or more",
                folder.display(),
                disk.free >> 20,
                (needed >> 20) + 1
            ))),
            false => Ok(()),
        }
    }
}

/// The manifest of a folder; `None` where there is none. [`HistoryError::Refused`] for one that cannot be read.
pub fn read_manifest(folder: &Path) -> Result<Option<Backup>, HistoryError> {
    let path = folder.join(MANIFEST);
    let refuse = |why: String| Err(HistoryError::Refused(format!("{}: {why}", path.display())));
    let text = match regular::read(&path, MANIFEST_BYTES_MAX) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(|error| failed(&path, &error))?,
    };
    let backup: Backup = match serde_json::from_slice(&text) {
        Ok(backup) => backup,
        Err(error) => return refuse(format!("it is not the manifest of a backup: {error}")),
    };
    if backup.version != VERSION {
        return refuse(format!("found a backup of version {}, expected {VERSION}", backup.version));
    }
    match backup.files.iter().find(|file| !file.is_sound()) {
        Some(file) => refuse(format!("found the file `{}`, which no backup has", file.path)),
        None if backup.files.first().is_none_or(|first| first.path != DATABASE) => refuse("it has no database".into()),
        None => Ok(Some(backup)),
    }
}

/// A file of the archive as one of a backup.
fn backup_file(file: &ArchiveFile) -> BackupFile {
    let ArchiveFile { path, bytes, sha256, .. } = file;
    BackupFile { path: format!("{ARCHIVE}/{path}"), bytes: *bytes, sha256: sha256.clone() }
}

/// Copies a file of the archive, if it is not there yet; `None` where the file itself is not as the manifest has it.
fn copy_file(
    archive: &Path,
    file: &ArchiveFile,
    folder: &Path,
    new: &mut Vec<PathBuf>,
) -> Result<Option<BackupFile>, HistoryError> {
    let is_sound = |path: &Path| {
        sync_and_hash(path).map(|(bytes, sha256)| (bytes, sha256.as_str()) == (file.bytes, file.sha256.as_str()))
    };
    let (from, copied) = (archive.join(&file.path), backup_file(file));
    let to = folder.join(copied.stored());
    if is_sound(&to).unwrap_or(false) {
        return Ok(Some(copied));
    }
    let unfinished = with_suffix(&to, UNFINISHED);
    new.push(unfinished.clone());
    let done = fs::create_dir_all(to.parent().unwrap_or(folder)).and_then(|()| regular::copy(&from, &unfinished));
    match done.and_then(|_| is_sound(&unfinished)) {
        Ok(true) => {
            fs::rename(&unfinished, &to).map_err(|error| failed(&to, &error))?;
            new.push(to);
            Ok(Some(copied))
        }
        done => {
            remove(&unfinished);
            match (is_sound(&from), done) {
                (Ok(true), Ok(_)) => {
                    Err(HistoryError::Engine(format!("{} is not what was written to it", to.display())))
                }
                (Ok(true), Err(error)) => Err(failed(&to, &error)),
                (Ok(false) | Err(_), _) => Ok(None),
            }
        }
    }
}

/// Copies a file to which others may append lines meanwhile, up to its last whole line.
fn copy_growing(from: &Path, folder: &Path, path: &str, new: &mut Vec<PathBuf>) -> Result<BackupFile, HistoryError> {
    let unfinished = folder.join(hashed(path, NO_HASH) + UNFINISHED);
    new.push(unfinished.clone());
    fs::create_dir_all(unfinished.parent().unwrap_or(folder))
        .and_then(|()| regular::copy(from, &unfinished))
        .and_then(|_| if path == AUDIT_LOG { cut_last_line(&unfinished) } else { Ok(()) })
        .map_err(|error| failed(&unfinished, &error))?;
    named(&unfinished, folder, path, new)
}

fn cut_last_line(path: &Path) -> std::io::Result<()> {
    let (mut reader, mut line, mut whole) = (BufReader::new(regular::open(path)?), Vec::new(), 0);
    while reader.read_until(b'\n', &mut line)? > 0 {
        whole += if line.ends_with(b"\n") { line.len() as u64 } else { 0 };
        line.clear();
    }
    regular::open_with(File::options().write(true), path)?.set_len(whole)
}

/// Syncs a file that is whole and gives it the name that says so.
fn named(unfinished: &Path, folder: &Path, path: &str, new: &mut Vec<PathBuf>) -> Result<BackupFile, HistoryError> {
    let (bytes, sha256) = sync_and_hash(unfinished).map_err(|error| failed(unfinished, &error))?;
    let file = BackupFile { path: path.to_owned(), bytes, sha256 };
    let to = folder.join(file.stored());
    if !to.exists() {
        new.push(to.clone());
    }
    fs::rename(unfinished, &to).map_err(|error| failed(&to, &error))?;
    Ok(file)
}

/// Removes what a backup no longer names, and what interrupted ones left behind.
fn sweep(folder: &Path, files: &[BackupFile]) {
    let named: HashSet<PathBuf> = files.iter().map(|file| folder.join(file.stored())).collect();
    for path in all_files(folder) {
        let of_backup = path.file_name().and_then(|name| name.to_str()).is_some_and(is_of_backup);
        if of_backup && !named.contains(&path) && path != folder.join(MANIFEST) {
            remove(&path);
        }
    }
    remove_empty_folders(folder);
}

/// The name of a file or folder that is not of a backup.
fn foreign(folder: &Path) -> Option<String> {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_foreign = |path: &PathBuf| match path.is_dir() {
        true => ![ARCHIVE, SETS].contains(&name(path).as_str()),
        false => !is_of_backup(&name(path)),
    };
    // What else lies in the folder may be a whole disk: it is not searched.
    let below = [ARCHIVE, SETS].into_iter().flat_map(|below| all_files(&folder.join(below)));
    let mut below = below.filter(|path| !is_of_backup(&name(path)));
    entries(folder).into_iter().find(is_foreign).or_else(|| below.next()).map(|path| name(&path))
}

/// What the disk says of a file of the backup.
pub(super) fn failed(path: &Path, error: &std::io::Error) -> HistoryError {
    HistoryError::Refused(format!("{}: {error}", path.display()))
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect()
}

fn all_files(folder: &Path) -> Vec<PathBuf> {
    let (folders, mut files): (Vec<_>, Vec<_>) =
        entries(folder).into_iter().partition(|path| path.is_dir() && !path.is_symlink());
    files.extend(folders.iter().flat_map(|folder| all_files(folder)));
    files
}

fn remove_empty_folders(folder: &Path) {
    for path in entries(folder).into_iter().filter(|path| path.is_dir() && !path.is_symlink()) {
        remove_empty_folders(&path);
        // One that is not empty stays.
        let _ = fs::remove_dir(&path);
    }
}

/// Makes the names in a folder, and in those below it, lasting.
pub(super) fn sync_folders(folder: &Path) -> std::io::Result<()> {
    for path in entries(folder).into_iter().filter(|path| path.is_dir()) {
        sync_folders(&path)?;
    }
    File::open(folder)?.sync_all()?;
    sync_folder(folder)
}

fn remove(path: &Path) {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            tracing::warn!(%error, path = %path.display(), "a leftover of a backup is not removed");
        }
        Ok(()) | Err(_) => {}
    }
}
