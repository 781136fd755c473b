//! The files of a store: the guard around opening, setting damaged files aside, who holds a lock.
//!
//! The database file itself is never opened here: closing it would drop the locks that DuckDB holds on it.

use std::{
    fs::{self, File, TryLockError},
    io::{Read, Seek, Write},
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use jiff::{Timestamp, tz::TimeZone};

use crate::{
    history::{HistoryError, engine_error, retention::Disk},
    plant::def::HistoryDef,
    profile::io::{atomic::with_suffix, regular},
};

/// Of the text of a count.
const COUNT_BYTES_MAX: u64 = 20;

/// A file beside the database that exists only while it is being opened. Replaying a damaged log can abort the whole
/// process: then the file stays behind and counts. So it does where the process was killed.
pub struct Opening {
    path: PathBuf,
    file: File,
    /// Earlier opens that never ended.
    pub failed: u32,
    /// The next one must still know of them.
    suspected: bool,
}

/// Refuses a file that is certainly no history, so that no other file is ever set aside as a damaged one. Reads it
/// only if its name is not that of a history, and before DuckDB has it.
pub fn refuse_foreign(db: &Path) -> Result<(), HistoryError> {
    if db.extension().is_some_and(|ending| ending == "duckdb") || size(db) == 0 {
        return Ok(());
    }
    // A DuckDB file has these letters behind the check sum of its first block.
    let mut head = [0; 12];
    let read = regular::open(db).and_then(|mut file| file.read_exact(&mut head));
    match read {
        Ok(()) if &head[8..] == b"DUCK" => Ok(()),
        Ok(()) | Err(_) => Err(HistoryError::Foreign { path: db.display().to_string() }),
    }
}

/// Refuses what is no file: the engine would wait for a pipe, and for whoever writes to it.
pub fn refuse_special(db: &Path) -> Result<(), HistoryError> {
    let mut paths = LOGS.into_iter().chain([""]).map(|suffix| with_suffix(db, suffix));
    paths.try_for_each(|path| {
        regular::check(&path).map_err(|error| HistoryError::Engine(format!("{}: {error}", path.display())))
    })
}

impl Opening {
    /// Marks that the store is being opened. [`HistoryError::Locked`] if another process is just opening it.
    pub fn begin(db: &Path) -> Result<Opening, HistoryError> {
        let path = with_suffix(db, ".opening");
        let wrong = |error: std::io::Error| HistoryError::Engine(format!("{}: {error}", path.display()));
        if let Some(folder) = db.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(wrong)?;
        }
        let file = regular::open_with(File::options().read(true).write(true).create(true), &path).map_err(wrong)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(locked(db, "another process, which is just starting".into())),
            Err(TryLockError::Error(error)) => return Err(wrong(error)),
        }
        let mut text = String::new();
        // What cannot be read counts as nothing: the guard must not keep a good store closed.
        let _ = (&file).take(COUNT_BYTES_MAX).read_to_string(&mut text);
        let failed = text.trim().parse().unwrap_or(0);
        let mut opening = Opening { path, file, failed, suspected: false };
        opening.count(failed.saturating_add(1));
        Ok(opening)
    }

    /// Ends without having opened the store: why the opens before it never ended is still unknown.
    pub fn keep_suspicion(&mut self) {
        self.suspected = true;
    }

    /// A full disk must not keep the store closed either: a count that cannot be written is not kept.
    fn count(&mut self, count: u32) {
        let written =
            self.file.rewind().and_then(|()| self.file.set_len(0)).and_then(|()| write!(self.file, "{count}"));
        let _ = written.and_then(|()| self.file.sync_all());
    }
}

/// A history that no other process has, and none opens while this lives: to put another one in its place.
#[derive(Debug)]
pub struct Exclusive {
    guard: PathBuf,
    _files: Vec<File>,
}

impl Exclusive {
    /// Keeps others from opening it; this process may have it open. [`HistoryError::Locked`] while another opens it.
    pub fn hold(db: &Path) -> Result<Exclusive, HistoryError> {
        let guard = with_suffix(db, ".opening");
        let wrong = |error: std::io::Error| HistoryError::Engine(format!("{}: {error}", guard.display()));
        let file = regular::open_with(File::options().write(true).create(true), &guard).map_err(wrong)?;
        match file.try_lock() {
            Ok(()) => Ok(Exclusive { guard, _files: vec![file] }),
            Err(TryLockError::WouldBlock) => Err(locked(db, "another process, which is just starting".into())),
            Err(TryLockError::Error(error)) => Err(wrong(error)),
        }
    }

    /// The same, also for a database that cannot be opened any more. This process must not have it open: its own locks
    /// would go. [`HistoryError::Locked`] while another process has it.
    pub fn acquire(db: &Path) -> Result<Exclusive, HistoryError> {
        let mut held = Exclusive::hold(db)?;
        let wrong = |error: std::io::Error| HistoryError::Engine(format!("{}: {error}", db.display()));
        match regular::open_with(File::options().read(true).write(true), db) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            Err(error) => return Err(wrong(error)),
            Ok(file) => {
                // As DuckDB locks it.
                rustix::fs::fcntl_lock(&file, rustix::fs::FlockOperation::NonBlockingLockExclusive)
                    .map_err(|_| locked(db, "another process: stop its station first".into()))?;
                held._files.push(file);
            }
        }
        Ok(held)
    }
}

impl Drop for Exclusive {
    /// A count of opens that never ended stays.
    fn drop(&mut self) {
        if fs::metadata(&self.guard).is_ok_and(|there| there.len() == 0) {
            let _ = fs::remove_file(&self.guard);
        }
    }
}

impl Drop for Opening {
    /// The open came to an orderly end, good or not.
    fn drop(&mut self) {
        if !std::thread::panicking() && !self.suspected {
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// The logs that DuckDB keeps beside a database: the ordinary one and those of a checkpoint under way.
pub const LOGS: [&str; 3] = [".wal", ".wal.checkpoint", ".wal.recovery"];

/// What is set aside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SetAside {
    /// The log alone: the file stays, as it was at its last checkpoint.
    Log,
    /// The file and its log.
    Everything,
}

/// Is there a log beside the database?
pub fn has_log(db: &Path) -> bool {
    LOGS.iter().any(|log| with_suffix(db, log).exists())
}

/// Moves a database and its log, or the log alone, aside under the time of day; returns the new path of the database
/// (the log's is the same with `.wal`). Nothing is ever deleted.
pub fn set_aside(db: &Path, part: SetAside, now: Timestamp) -> Result<PathBuf, HistoryError> {
    let stamp = now.to_zoned(TimeZone::UTC).strftime("%Y%m%dT%H%M%SZ").to_string();
    let target = (1..)
        .map(|n| match n {
            1 => with_suffix(db, &format!(".damaged-{stamp}")),
            n => with_suffix(db, &format!(".damaged-{stamp}-{n}")),
        })
        .find(|path| !path.exists() && !has_log(path))
        .expect("some number is free");
    // The logs first: a database without its log is merely older, a log that meets a new database would be replayed.
    let file = match part {
        SetAside::Log => None,
        SetAside::Everything => Some(""),
    };
    for suffix in LOGS.into_iter().chain(file) {
        let (from, to) = (with_suffix(db, suffix), with_suffix(&target, suffix));
        if from.exists() {
            fs::rename(&from, &to).map_err(|error| HistoryError::Engine(format!("{}: {error}", from.display())))?;
        }
    }
    Ok(target)
}

/// Copies the logs of `from`, synced, as those of `db`.
pub fn copy_logs(from: &Path, db: &Path) -> Result<(), HistoryError> {
    each_log(from, db, |from, to| regular::copy(from, to).and_then(|_| File::open(to)?.sync_all()))
}

/// Moves the logs of `from` back to `db`.
pub fn put_logs_back(from: &Path, db: &Path) -> Result<(), HistoryError> {
    remove_logs(db);
    each_log(from, db, |from, to| fs::rename(from, to))
}

/// Removes the logs of a database, of which there is a copy.
pub fn remove_logs(db: &Path) {
    for log in LOGS {
        // One that cannot be removed is found when the database is opened.
        let _ = fs::remove_file(with_suffix(db, log));
    }
}

fn each_log(from: &Path, to: &Path, each: impl Fn(&Path, &Path) -> std::io::Result<()>) -> Result<(), HistoryError> {
    let paths = LOGS.map(|log| (with_suffix(from, log), with_suffix(to, log)));
    paths.iter().filter(|(from, _)| from.exists()).try_for_each(|(from, to)| {
        each(from, to).map_err(|error| HistoryError::Engine(format!("{}: {error}", from.display())))
    })
}

/// Removes a database that was never more than begun, as a full disk leaves it.
pub fn remove(db: &Path) {
    for suffix in LOGS.into_iter().chain([""]) {
        // A folder of that name is none of the station's.
        let _ = fs::remove_file(with_suffix(db, suffix));
    }
}

/// Is this a file of the engine whose creation has not ended? It begins with three headers of 4096 bytes.
pub fn is_unfinished(db: &Path) -> bool {
    let mut beginning = [0; 12];
    let is_begun = regular::open(db).is_ok_and(|mut file| file.read_exact(&mut beginning).is_ok());
    is_begun && beginning.ends_with(b"DUCK") && size(db) < 3 * 4096
}

/// Bytes of the database and its log.
pub fn size(db: &Path) -> u64 {
    let bytes = |suffix| fs::metadata(with_suffix(db, suffix)).map_or(0, |meta| meta.len());
    LOGS.into_iter().chain([""]).map(bytes).sum()
}

/// Device and number of a file; `None` if it is not there. Another file at the same path differs.
pub fn inode(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().map(|meta| (meta.dev(), meta.ino()))
}

/// The disk that a history lies on; `None` where it is unknown.
pub fn disk(db: &Path) -> Option<Disk> {
    let folder = db.ancestors().skip(1).find(|folder| folder.is_dir())?;
    let disk = rustix::fs::statvfs(folder).ok()?;
    let bytes = |blocks: u64| blocks.saturating_mul(disk.f_frsize);
    Some(Disk { free: bytes(disk.f_bavail), all: bytes(disk.f_blocks) })
}

/// How little is free of a disk, where that is less than both thresholds.
pub fn disk_nearly_full(disk: Disk, rule: HistoryDef) -> Option<String> {
    let Disk { free, all } = disk;
    // In steps, so that the words do not change with every record.
    let words = || format!("{} MiB of the disk are free ({} %)", free >> 20 >> 3 << 3, free * 100 / all.max(1));
    disk.is_nearly_full(rule).then(words)
}

/// What a failure to open means.
#[derive(Debug, PartialEq, Eq)]
pub enum Failure {
    /// The file is as it should be, but something stands in the way.
    Obstacle(HistoryError),
    /// The file or its log cannot be read.
    Damaged(String),
}

/// Reads DuckDB's message. What is not known to be an obstacle is taken as damage: nothing is lost by setting files
/// aside, and recording goes on.
pub fn diagnose(db: &Path, message: &str) -> Failure {
    if engine_error::is_locked(message) {
        return Failure::Obstacle(locked(db, holder(message)));
    }
    match engine_error::is_obstacle(message) {
        true => Failure::Obstacle(HistoryError::Engine(message.to_owned())),
        false => Failure::Damaged(first_line(message)),
    }
}

/// DuckDB appends advice and stack traces; the first line says what happened.
pub fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or("").trim().to_owned()
}

fn locked(db: &Path, by: String) -> HistoryError {
    HistoryError::Locked { path: db.display().to_string(), by }
}

/// `process 1234 (sightglass)`, from `Conflicting lock is held in /usr/bin/sightglass (PID 1234)`.
fn holder(message: &str) -> String {
    let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).collect::<String>();
    let pid = message.split_once("PID ").map(|(_, rest)| digits(rest)).filter(|pid| !pid.is_empty());
    match pid {
        Some(pid) => match fs::read_to_string(format!("/proc/{pid}/comm")) {
            Ok(name) => format!("process {pid} ({})", name.trim()),
            Err(_) => format!("process {pid}"),
        },
        None => "another process".into(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::report::testing::at;

    #[test]
    fn a_disk_is_nearly_full_by_bytes_and_by_percent() {
        const GIB: u64 = 1 << 30;
        for (free, all, expect) in [
            (50 * GIB, 1000 * GIB, None),
            (GIB - 1, 1000 * GIB, Some("1016 MiB of the disk are free (0 %)")),
            (GIB / 2, 4 * GIB, None),
            (GIB / 4, 4 * GIB, Some("256 MiB of the disk are free (6 %)")),
            (0, 4 * GIB, Some("0 MiB of the disk are free (0 %)")),
            (0, 0, None),
        ] {
            let disk = Disk { free, all };
            assert_eq!(disk_nearly_full(disk, HistoryDef::default()).as_deref(), expect, "{free} of {all}");
        }
        let least = |percent, mib| HistoryDef {
            disk_free_percent_min: percent,
            disk_free_mib_min: mib,
            ..HistoryDef::default()
        };
        let small = Disk { free: GIB / 4, all: 4 * GIB };
        for (least, expect) in
            [(least(6, 512), false), (least(7, 512), true), (least(7, 256), false), (least(0, 1), false)]
        {
            assert_eq!(disk_nearly_full(small, least).is_some(), expect, "{least:?}");
        }
        assert_eq!(disk(Path::new("/proc/none/x.duckdb")), Some(Disk { free: 0, all: 0 }));
    }

    #[test]
    fn the_holder_of_a_lock_is_named() {
        let own = std::process::id();
        let comm = fs::read_to_string("/proc/self/comm").unwrap();
        let message =
            format!("IO Error: Could not set lock on file \"x\": Conflicting lock is held in /bin/x (PID {own}).");
        let expect = HistoryError::Locked { path: "x".into(), by: format!("process {own} ({})", comm.trim()) };
        assert_eq!(diagnose(Path::new("x"), &message), Failure::Obstacle(expect));
        let unknown = HistoryError::Locked { path: "x".into(), by: "another process".into() };
        assert_eq!(diagnose(Path::new("x"), "IO Error: Could not set lock on file"), Failure::Obstacle(unknown));
    }

    #[test]
    fn a_full_or_forbidden_disk_is_not_taken_for_damage() {
        for message in [
            "IO Error: Cannot open file \"x\": Permission denied",
            "IO Error: No space left on device",
            "IO Error: Could not write file \"x\": Disk quota exceeded",
        ] {
            let expect = Failure::Obstacle(HistoryError::Engine(message.into()));
            assert_eq!(diagnose(Path::new("x"), message), expect);
        }
        let message = "IO Error: The file \"x\" exists, but it is not a valid DuckDB database file!\nmore";
        assert!(matches!(diagnose(Path::new("x"), message), Failure::Damaged(why) if why.ends_with("file!")));
    }

    #[test]
    fn files_set_aside_in_one_second_are_all_kept() {
        let folder = tempfile::tempdir().unwrap();
        let db = folder.path().join("x.duckdb");
        let mut targets = Vec::new();
        for text in ["one", "two"] {
            fs::write(&db, text).unwrap();
            fs::write(with_suffix(&db, ".wal"), text).unwrap();
            targets.push(set_aside(&db, SetAside::Everything, at("2026-11-21T06:00:00Z")).unwrap());
        }
        assert!(targets[0].ends_with("x.duckdb.damaged-20261121T060000Z"));
        for (target, text) in targets.iter().zip(["one", "two"]) {
            assert_eq!(fs::read_to_string(target).unwrap(), text);
            assert_eq!(fs::read_to_string(with_suffix(target, ".wal")).unwrap(), text);
        }
        assert!(!db.exists());
    }

    #[test]
    fn only_opens_that_never_ended_are_counted() {
        let folder = tempfile::tempdir().unwrap();
        let db = folder.path().join("x.duckdb");
        assert_eq!(Opening::begin(&db).unwrap().failed, 0);
        // The first one ended in order.
        let first = Opening::begin(&db).unwrap();
        assert_eq!(first.failed, 0);
        assert!(matches!(Opening::begin(&db), Err(HistoryError::Locked { .. })));
        drop(first);
        // A process that died leaves the count behind.
        fs::write(with_suffix(&db, ".opening"), "2").unwrap();
        assert_eq!(Opening::begin(&db).unwrap().failed, 2);
        assert!(!with_suffix(&db, ".opening").exists());
    }
}
