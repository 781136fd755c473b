//! Puts a backup in the place of a history, which is set aside and never deleted.
//!
//! ```text
//!   tank.restoring.new/   being put together
//!   tank.restoring/       whole: from here on the new history counts, and whoever opens it first finishes this
//!   tank.replaced-DATE/   what was there before
//! ```

use std::{
    fs,
    path::{Path, PathBuf},
};

use jiff::{Timestamp, tz::TimeZone};
use serde::{Deserialize, Serialize};

use super::{
    archive::{Steps, folder as archive_folder, sync_and_hash},
    backup::{failed, read_manifest, sync_folders},
    files, last,
    store::Store,
};
use crate::{
    history::{
        HistoryError,
        backup::{AUDIT_LOG, Backup, BackupFile, DATABASE, UNFINISHED},
    },
    plant::record::ChainHash,
    profile::io::{
        atomic::{sync_folder, with_suffix},
        regular,
    },
};

/// In the folder of a restore: what becomes of the history before it. The last to go.
const PLAN: &str = "plan.json";
const PLAN_BYTES_MAX: u64 = 1 << 20;
/// Files that are not sound and are named.
const NAMED_MAX: usize = 3;

/// A backup that was read from end to end.
#[derive(Debug)]
pub struct Sound {
    /// Its manifest.
    pub backup: Backup,
    /// The latest entries of the audit log that its database holds.
    pub chain_hashes: Vec<ChainHash>,
}

/// What becomes of the history before.
#[derive(Debug, Serialize, Deserialize)]
struct Plan {
    /// The folder beside it that it goes to.
    aside: String,
    /// Files that nothing replaces.
    also: Vec<String>,
}

/// Reads every file of a backup. [`HistoryError::Refused`] if one is not as the manifest has it.
pub fn verify(from: &Path) -> Result<Sound, HistoryError> {
    let refuse = |why: String| Err(HistoryError::Refused(format!("{}: {why}", from.display())));
    let Some(backup) = read_manifest(from)? else {
        return refuse("it is not a backup, or one that was never completed: it has no backup.json".into());
    };
    let wrong: Vec<&str> =
        backup.files.iter().filter(|file| !is_sound(from, file)).map(|file| file.path.as_str()).collect();
    if !wrong.is_empty() {
        let named = wrong[..wrong.len().min(NAMED_MAX)].join(", ");
        let all = backup.files.len();
        return refuse(format!("{} of its {all} files are missing or were changed: {named}", wrong.len()));
    }
    let database = &backup.files[0];
    let store = Store::peek(&from.join(database.stored()))?;
    let has = |path: &str| backup.files.iter().any(|file| file.in_archive() == Some(path));
    let known = |path: &str| has(path) || backup.missing.iter().any(|missing| missing == path);
    if let Some(file) = store.files(None)?.iter().find(|file| !known(&file.path)) {
        return refuse(format!("its database names {}, its manifest does not", file.path));
    }
    let chain_hashes = store.chain_hashes().unwrap_or_default();
    Ok(Sound { backup, chain_hashes })
}

fn is_sound(from: &Path, file: &BackupFile) -> bool {
    let found = sync_and_hash(&from.join(file.stored()));
    found.is_ok_and(|(bytes, sha256)| bytes == file.bytes && sha256 == file.sha256)
}

/// Puts a backup together beside the history; nothing has changed until [`commit`]. The audit log is restored to `audit_log`,
/// if to anywhere, and `also` is set aside with the history. Returns where that goes.
pub fn prepare(
    from: &Path,
    backup: &Backup,
    db: &Path,
    audit_log: Option<&Path>,
    also: &[PathBuf],
    now: Timestamp,
) -> Result<PathBuf, HistoryError> {
    let new = begin(db)?;
    if files::disk(db).is_some_and(|disk| disk.free < backup.bytes()) {
        let needed = (backup.bytes() >> 20) + 1;
        return Err(HistoryError::Refused(format!("{}: expected {needed} MiB free on its disk", db.display())));
    }
    let archive = new.join(name(&archive_folder(db)));
    let prepared = || {
        fs::create_dir_all(&archive).map_err(|error| failed(&new, &error))?;
        for file in &backup.files {
            let to = match (file.in_archive(), file.path.as_str(), audit_log) {
                (Some(path), _, _) => archive.join(path),
                (None, DATABASE, _) => new.join(name(db)),
                (None, AUDIT_LOG, Some(audit_log)) => new.join(name(audit_log)),
                (None, _, _) => continue,
            };
            copy(&from.join(file.stored()), &to, file)?;
        }
        plan(&new, db, also, now)
    };
    prepared().inspect_err(|_| {
        // A leftover is removed by the next one.
        let _ = fs::remove_dir_all(&new);
    })
}

/// The folder that a new history is put together in, empty.
pub(super) fn begin(db: &Path) -> Result<PathBuf, HistoryError> {
    let new = with_suffix(&ready(db), UNFINISHED);
    let cleared = if new.exists() { fs::remove_dir_all(&new) } else { Ok(()) };
    cleared.and_then(|()| fs::create_dir_all(&new)).map_err(|error| failed(&new, &error))?;
    Ok(new)
}

/// Completes that folder: `also` is set aside with the history. Returns where that goes.
pub(super) fn plan(new: &Path, db: &Path, also: &[PathBuf], now: Timestamp) -> Result<PathBuf, HistoryError> {
    let beside = files::LOGS.map(|log| with_suffix(db, log)).into_iter().chain([last::path(db)]);
    let also = beside.chain(also.iter().cloned()).map(|path| name(&path)).collect();
    let aside = aside(db, now);
    let plan = serde_json::to_vec(&Plan { aside: name(&aside), also }).expect("its keys are words");
    let written = fs::write(new.join(PLAN), plan).and_then(|()| sync_and_hash(&new.join(PLAN)));
    written.and_then(|_| sync_folders(new)).map_err(|error| failed(new, &error))?;
    Ok(aside)
}

fn copy(from: &Path, to: &Path, file: &BackupFile) -> Result<(), HistoryError> {
    let copied = fs::create_dir_all(to.parent().unwrap_or(to)).and_then(|()| regular::copy(from, to));
    let (bytes, sha256) = copied.and_then(|_| sync_and_hash(to)).map_err(|error| failed(to, &error))?;
    match bytes == file.bytes && sha256 == file.sha256 {
        true => Ok(()),
        false => Err(HistoryError::Refused(format!("{} is not what was written to it", to.display()))),
    }
}

/// From here on the new history counts; [`finish`] puts it in place.
pub fn commit(db: &Path) -> Result<(), HistoryError> {
    let ready = ready(db);
    let renamed = fs::rename(with_suffix(&ready, UNFINISHED), &ready).and_then(|()| sync_folder(&ready));
    renamed.map_err(|error| failed(&ready, &error))
}

/// Puts in place what was restored, also after an interruption; no other process may have the history. Returns where the history
/// before it is; `None` where nothing was to be done.
pub fn finish(db: &Path) -> Result<Option<PathBuf>, HistoryError> {
    finish_in_steps(db, &mut |_| Ok(()))
}

pub(super) fn finish_in_steps(db: &Path, steps: Steps) -> Result<Option<PathBuf>, HistoryError> {
    let ready = ready(db);
    if !ready.exists() {
        return Ok(None);
    }
    let home = db.parent().unwrap_or(Path::new(""));
    let wrong = |error: std::io::Error| failed(&ready, &error);
    let plan: Plan = match regular::read(&ready.join(PLAN), PLAN_BYTES_MAX) {
        Ok(text) => serde_json::from_slice(&text).map_err(|error| HistoryError::Refused(error.to_string()))?,
        // Everything is in place.
        Err(_) => {
            fs::remove_dir(&ready).map_err(wrong)?;
            return Ok(None);
        }
    };
    let aside = home.join(&plan.aside);
    fs::create_dir_all(&aside).map_err(wrong)?;
    let set_aside = |name: &str| match fs::rename(home.join(name), aside.join(name)) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        moved => moved.and_then(|()| sync_folder(&aside.join(name))).and_then(|()| sync_folder(&aside)),
    };
    // A database without its log is merely older, a log that meets a new database would be replayed.
    for name in &plan.also {
        set_aside(name).map_err(wrong)?;
        steps("side file set aside")?;
    }
    // The database last.
    let entries = fs::read_dir(&ready).map_err(wrong)?.flatten().map(|entry| name(&entry.path()));
    let mut names: Vec<String> = entries.filter(|name| name != PLAN).collect();
    names.sort_by_key(|entry| *entry == name(db));
    for name in names {
        set_aside(&name).map_err(wrong)?;
        steps("set aside")?;
        let (from, to) = (ready.join(&name), home.join(&name));
        fs::rename(from, &to).and_then(|()| sync_folder(&to)).map_err(wrong)?;
        steps("in place")?;
    }
    fs::remove_file(ready.join(PLAN)).and_then(|()| sync_folder(&ready.join(PLAN))).map_err(wrong)?;
    steps("plan removed")?;
    fs::remove_dir(&ready).and_then(|()| sync_folder(&ready)).map_err(wrong)?;
    // Of a history that was not there before nothing is left.
    let _ = fs::remove_dir(&aside);
    Ok(Some(aside))
}

/// [`HistoryError::Refused`] for a history that is being restored: who only reads cannot finish that.
pub(super) fn refuse_unfinished(db: &Path) -> Result<(), HistoryError> {
    match ready(db).exists() {
        false => Ok(()),
        true => Err(HistoryError::Refused(format!(
            "{}: a restore was interrupted; repeat `sightglass history restore`, or start the station, to finish it",
            db.display()
        ))),
    }
}

/// The folder of a restore that only has to be put in place.
fn ready(db: &Path) -> PathBuf {
    db.with_extension("restoring")
}

/// Where the history before goes.
fn aside(db: &Path, now: Timestamp) -> PathBuf {
    let stamp = now.to_zoned(TimeZone::UTC).strftime("%Y%m%dT%H%M%SZ").to_string();
    let numbered = |number: u32| match number {
        1 => db.with_extension(format!("replaced-{stamp}")),
        number => db.with_extension(format!("replaced-{stamp}-{number}")),
    };
    (1..).map(numbered).find(|path| !path.exists()).expect("some number is free")
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
