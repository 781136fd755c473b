//! Brings back histories that were set aside and are sound, with everything that was recorded since: the rows of each follow
//! those of the one before it, in a new file that takes the place of the history as a restore does.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use duckdb::AccessMode;
use jiff::Timestamp;

use super::{
    archive::{quoted, sync_and_hash},
    backup::failed,
    files::{self, Failure},
    open::connect,
    probe::{self, Probe},
    restore, sql,
    store::{Store, engine},
};
use crate::{
    history::HistoryError,
    plant::number::to_u32,
    profile::io::{atomic::with_suffix, regular},
};

/// What was brought back.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Reunited {
    /// The histories, oldest first.
    pub sound: Vec<PathBuf>,
    /// Those that stay where they are, with what is wrong with each.
    pub damaged: Vec<(PathBuf, String)>,
    /// Rows of all tables that were set aside.
    pub rows: u64,
    /// Where the history before goes.
    pub aside: PathBuf,
}

/// The histories that were set aside beside this one, oldest first.
pub fn set_aside_of(db: &Path) -> Vec<PathBuf> {
    let start = format!("{}.damaged-", db.file_name().unwrap_or_default().to_string_lossy());
    let is_history = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(&start) && !files::LOGS.iter().any(|log| name.ends_with(log))
    };
    let folder = db.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<PathBuf> = entries.filter(is_history).filter(|path| path.is_file()).collect();
    // Of one second, the second one ends in `Z-2`, the tenth in `Z-10`.
    found.sort_by_key(|path| {
        let name = path.to_string_lossy().into_owned();
        let (stamp, number) = name.rsplit_once("Z-").unwrap_or((name.trim_end_matches('Z'), "1"));
        (stamp.to_owned(), number.parse::<u32>().unwrap_or(u32::MAX))
    });
    found
}

/// Puts the histories together beside the present one; nothing has changed until [`restore::commit`], which is for
/// where any of them is sound. No other process may open the history.
pub fn prepare(db: &Path, now: Timestamp) -> Result<Reunited, HistoryError> {
    let found = set_aside_of(db);
    let needed = 2 * found.iter().map(|path| files::size(path)).sum::<u64>() + files::size(db);
    if files::disk(db).is_some_and(|disk| disk.free < needed) {
        let needed = (needed >> 20) + 1;
        return Err(HistoryError::Refused(format!("{}: expected {needed} MiB free on its disk", db.display())));
    }
    let new = restore::begin(db)?;
    let whole = new.join(db.file_name().unwrap_or_default());
    let mut reunited = Reunited::default();
    let prepared = gather(db, &found, &whole, now, &mut reunited).and_then(|()| {
        if reunited.sound.is_empty() {
            return Ok(PathBuf::new());
        }
        sync_and_hash(&whole).map_err(|error| failed(&whole, &error))?;
        let also: Vec<PathBuf> = reunited.sound.iter().flat_map(|path| with_logs(path)).collect();
        restore::plan(&new, db, &also, now)
    });
    if !matches!(&prepared, Ok(aside) if !aside.as_os_str().is_empty()) {
        // A leftover is removed by the next one.
        let _ = fs::remove_dir_all(&new);
    }
    Ok(Reunited { aside: prepared?, ..reunited })
}

/// Those that are sound, and the present one after them, in one file.
fn gather(
    db: &Path,
    found: &[PathBuf],
    whole: &Path,
    now: Timestamp,
    reunited: &mut Reunited,
) -> Result<(), HistoryError> {
    let copy = whole.with_extension("copy");
    for path in found {
        let to = if reunited.sound.is_empty() { whole } else { &copy };
        files::remove(to);
        regular::copy(path, to).map_err(|error| failed(path, &error))?;
        files::copy_logs(path, to)?;
        match probe::in_child(to) {
            Probe::Sound => {}
            Probe::Damaged(why) => {
                files::remove(to);
                reunited.damaged.push((path.clone(), why));
                continue;
            }
            Probe::Obstacle(error) => return Err(error),
            Probe::Untried(why) => return Err(HistoryError::Engine(why)),
        }
        reunited.rows += Store::peek(to)?.count_rows()?;
        if to == copy {
            append(whole, &copy, now)?;
        }
        reunited.sound.push(path.clone());
    }
    files::remove(&copy);
    match reunited.sound.is_empty() || files::size(db) == 0 {
        true => Ok(()),
        false => append(whole, db, now),
    }
}

/// Appends the rows of a later history, which is only read.
fn append(whole: &Path, later: &Path, now: Timestamp) -> Result<(), HistoryError> {
    let db = connect(whole, AccessMode::ReadWrite).map_err(engine)?;
    let store = Store::around(db, whole, &Arc::default());
    store.read_last_commit().map_err(engine)?;
    store.read_recording().map_err(engine)?;
    // It ended where it was set aside.
    store.end_curves_left_behind(now)?;
    let attached = store.db.execute_batch(&format!("ATTACH {} AS later (READ_ONLY)", quoted(later)));
    attached.map_err(|error| match files::diagnose(later, &error.to_string()) {
        Failure::Obstacle(error) => error,
        Failure::Damaged(why) => HistoryError::Engine(why),
    })?;
    let version: u32 =
        store.db.query_row("SELECT max(version) FROM later.schema_version", [], |row| row.get(0)).map_err(engine)?;
    if version != to_u32(sql::MIGRATIONS.len()) {
        let why = format!("{}: start the station once, so that it is of this version", later.display());
        return Err(HistoryError::Refused(why));
    }
    let clashes: u64 = store.db.query_row(CLASHES, [], |row| row.get(0)).map_err(engine)?;
    if clashes > 0 {
        let why = "its tags have other numbers, and files of the archive have these";
        return Err(HistoryError::Refused(format!("{}: {why}", later.display())));
    }
    store.transaction(|| store.db.execute_batch(APPEND))?;
    store.db.execute_batch("DETACH later").map_err(engine)?;
    store.read_last_commit().map_err(engine)?;
    store.note_last_commit();
    store.checkpoint()
}

/// Tags whose numbers differ, where the later history has archived any.
const CLASHES: &str = "SELECT count(*) FROM later.tag l JOIN tag t ON l.id = t.id
    WHERE (l.name <> t.name OR l.unit <> t.unit) AND EXISTS (FROM later.archive)";
/// Numbers of batches and control runs begin again in a new history. What the audit log had completed there is here already.
const APPEND: &str = "
CREATE TEMP TABLE shift AS SELECT l.epoch::INTEGER AS own, o.epoch + (l.first_utc < o.last_utc)::INTEGER AS epoch
    FROM last_commit o, later.last_commit l;
INSERT INTO tag SELECT id, name, unit FROM later.tag l
    WHERE NOT EXISTS (FROM tag t WHERE t.id = l.id OR t.name = l.name AND t.unit = l.unit);
INSERT INTO tag SELECT (SELECT max(id) FROM tag) + row_number() OVER (), name, unit FROM later.tag l
    WHERE NOT EXISTS (FROM tag t WHERE t.name = l.name AND t.unit = l.unit);
INSERT INTO sample SELECT s.utc, t.id, s.value, s.quality,
        CASE s.epoch WHEN 65535 THEN s.epoch ELSE least(s.epoch + shift.epoch, 65534) END, s.rest
    FROM later.sample s JOIN later.tag l ON l.id = s.tag JOIN tag t ON t.name = l.name AND t.unit = l.unit, shift
    ORDER BY s.rowid;
INSERT INTO alarm_journal SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch)
    FROM later.alarm_journal l, shift ORDER BY l.rowid;
INSERT INTO operator_action SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch)
    FROM later.operator_action l, shift
    WHERE number IS NULL OR number NOT IN (SELECT number FROM operator_action WHERE number IS NOT NULL)
    ORDER BY l.rowid;
INSERT INTO line_minute SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch)
    FROM later.line_minute l, shift ORDER BY l.rowid;
INSERT INTO report SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch)
    FROM later.report l, shift ORDER BY l.rowid;
INSERT INTO batch SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch,
        l.number + coalesce((SELECT max(b.number) FROM batch b WHERE b.name = l.name), 0) AS number)
    FROM later.batch l, shift ORDER BY l.rowid;
INSERT INTO control_run SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch,
        l.number + coalesce((SELECT max(r.number) FROM control_run r WHERE r.controller = l.controller), 0) AS number)
    FROM later.control_run l, shift ORDER BY l.rowid;
INSERT INTO import FROM later.import;
INSERT INTO recorded SELECT l.* REPLACE (least(l.epoch + shift.epoch, 65534) AS epoch)
    FROM later.recorded l, shift ORDER BY l.rowid;
INSERT INTO deleted SELECT * FROM later.deleted EXCEPT SELECT * FROM deleted;
DELETE FROM archive;
INSERT INTO archive FROM later.archive;
UPDATE last_commit SET number = last_commit.number + l.number,
    first_utc = least(coalesce(last_commit.first_utc, l.first_utc), coalesce(l.first_utc, last_commit.first_utc)),
    last_utc = greatest(coalesce(last_commit.last_utc, l.last_utc), coalesce(l.last_utc, last_commit.last_utc)),
    epoch = least(shift.own + shift.epoch, 65534) FROM later.last_commit l, shift;
DROP TABLE shift;
";

/// A history and its logs, as they lie beside it.
fn with_logs(path: &Path) -> Vec<PathBuf> {
    let logs = files::LOGS.map(|log| with_suffix(path, log)).into_iter().filter(|log| log.exists());
    logs.chain([path.to_owned()]).collect()
}
