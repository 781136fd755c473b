//! Opening a store: guarded, so that damage never keeps a station from starting, and never goes unsaid.

use std::{collections::HashMap, path::Path, sync::Arc};

use duckdb::{AccessMode, Config, Connection, params};
use jiff::Timestamp;

use super::{
    alarm_metrics::Recent,
    chain::StoredEntries,
    compact, disk,
    files::{self, Failure, Opening},
    last::{self, Noted},
    mend::{end_cut, mend, missing, said_of},
    probe, restore, room, sql,
    store::{Store, engine},
    stored::Stored,
};
use crate::{
    history::{HistoryError, words::joined},
    plant::{
        batch::BatchRecord,
        control_run::ControlRun,
        def::PlantDef,
        number::to_u32,
        record::{ActionRecord, AlarmRecord},
    },
    profile::io::atomic::with_suffix,
};

/// What the name of a history that is being built ends in.
const NEW: &str = ".new";

/// A store as it was opened, and what the operator should know about that.
pub struct Opened<T = ()> {
    /// The store.
    pub store: Store,
    /// `the history is damaged (…) and set aside as …`, or what is missing of it.
    pub trouble: Option<String>,
    /// What was read of it while damage could still be met.
    pub read: T,
}

/// What a station restores from its history when it starts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Restored {
    /// The events of alarms that the plant restores.
    pub events: Vec<AlarmRecord>,
    /// What the alarm monitor must know of the last day.
    pub recent: Recent,
    /// What the store holds of the audit log; `None` where that cannot be read.
    pub entries: Option<StoredEntries>,
    /// The last record of the batches of each name.
    pub batches: Vec<BatchRecord>,
    /// The latest control run of each controller.
    pub runs: Vec<ControlRun>,
    /// The last start or end of a procedure.
    pub procedure: Option<ActionRecord>,
    /// The last values of the tags that are totals, by their names.
    pub totals: Vec<(String, f64)>,
    /// When the station before this one ended.
    pub off: Option<Timestamp>,
}

impl Store {
    /// Opens or creates the store of a station that starts: ends the curves that the station before it left behind, and
    /// reads what the new one restores. Errors and damage as in [`Store::open`].
    pub fn open_at_start(path: &Path, def: &Arc<PlantDef>, now: Timestamp) -> Result<Opened<Restored>, HistoryError> {
        Store::open_and(path, def, now, |store| {
            store.end_curves_left_behind(now)?;
            store.read_at_start(now)
        })
    }

    fn read_at_start(&self, now: Timestamp) -> Result<Restored, HistoryError> {
        let events = self.restore()?;
        let recent = match self.recent(now) {
            // A plant must start even if its journal is too long to be measured.
            Err(error @ HistoryError::TooManyRows { .. }) => {
                tracing::warn!(%error, "the alarm figures of the last day begin at zero");
                Recent::default()
            }
            recent => recent?,
        };
        let entries =
            self.stored_entries().inspect_err(|error| tracing::warn!(%error, "not compared with the audit log")).ok();
        let procedure = self.list(&sql::latest_procedure(), &[], ActionRecord::read)?.pop();
        Ok(Restored { events, recent, entries, procedure, ..self.restore_followed()? })
    }

    /// Does to the files what may end the process at a start: replays the log, writes it into the file, reads, adds a row.
    pub(super) fn try_out(path: &Path, now: Timestamp) -> Result<(), HistoryError> {
        let store = Store::around(connect(path, AccessMode::ReadWrite).map_err(engine)?, path, &Arc::default());
        store.migrate()?;
        store.checkpoint()?;
        store.adopt_tags(now)?;
        store.adopt_files()?;
        store.read_last_commit().map_err(engine)?;
        store.db.execute_batch(sql::TRY_A_TAG).map_err(engine)?;
        store.read_at_start(now).map(drop)
    }

    /// What a plant goes on from in what it follows: batches, control runs and totals.
    pub(super) fn restore_followed(&self) -> Result<Restored, HistoryError> {
        let (batches, runs) = (self.latest_batches()?, self.latest_runs()?);
        let off = self.last_written();
        Ok(Restored { batches, runs, totals: self.last_totals()?, off, ..Restored::default() })
    }

    /// Goes on with another definition of the plant.
    pub(super) fn redefine(&mut self, def: &Arc<PlantDef>) -> Result<(), HistoryError> {
        self.def = Arc::clone(def);
        self.register_tags().map_err(engine)?;
        self.check_tags()
    }

    /// Opens or creates the store.
    ///
    /// A damaged log is set aside: the file is then as old as its last checkpoint, some minutes. A damaged file is set
    /// aside with its log and a new store is begun. Files whose opening never ended are examined by a [`probe`] first, and
    /// what the engine says of damage must be found there too.
    /// [`HistoryError::Locked`] if another process has it, [`HistoryError::Engine`] for any other obstacle.
    pub fn open(path: &Path, def: &Arc<PlantDef>, now: Timestamp) -> Result<Opened, HistoryError> {
        Store::open_and(path, def, now, |_| Ok(()))
    }

    /// The same, where `read` meets damage while the files can still be set aside.
    fn open_and<T>(
        path: &Path,
        def: &Arc<PlantDef>,
        now: Timestamp,
        read: impl Fn(&Store) -> Result<T, HistoryError>,
    ) -> Result<Opened<T>, HistoryError> {
        files::refuse_foreign(path)?;
        files::refuse_special(path)?;
        room::check()?;
        let mut opening = Opening::begin(path)?;
        if let Some(before) = restore::finish(path)? {
            tracing::warn!(before = %before.display(), "a restore that was interrupted is finished");
        }
        files::remove(&with_suffix(path, compact::UNFINISHED));
        let noted = last::read(path);
        // What is left of a creation that failed has nothing in it, and is not damaged.
        let fresh = files::size(path) == 0 || (noted == Noted::Nothing && files::is_unfinished(path));
        if fresh {
            files::remove(path);
            Store::create(path)?;
        }
        let mut trouble = None;
        let mut report = |proven| trouble = Some(said_of(proven));
        if 0 < opening.failed && !fresh {
            let examined = probe::examine(path, now, &probe::in_child);
            examined.inspect_err(|_| opening.keep_suspicion())?.into_iter().for_each(&mut report);
        }
        let try_open = || {
            let unclean = files::has_log(path);
            let (store, archive) = Store::open_file(path, def, now)?;
            if unclean {
                // A block that a checkpoint needs and cannot read would end every later one.
                store.checkpoint().map_err(|error| failure(path, error))?;
            }
            // Before anything is stored: the end of the curves is a commit too.
            let found = store.last_commit();
            let read = read(&store).map_err(|error| failure(path, error))?;
            Ok((store, archive, (read, found)))
        };
        let (opened, repaired) = mend(path, now, &try_open, &mut report)?;
        let (store, archive, (read, found)) = opened.map_err(|failure| {
            if fresh {
                files::remove(path);
            }
            match failure {
                Failure::Obstacle(error) => error,
                Failure::Damaged(why) => HistoryError::Engine(why),
            }
        })?;
        let missing = missing(&noted, &found, trouble.is_some());
        let kept = end_cut(path, now, missing.is_some());
        let trouble = joined([&trouble.or(repaired), &missing, &kept, &archive]);
        store.note_last_commit();
        drop(opening);
        Ok(Opened { store, trouble, read })
    }

    /// Opens the store of a station that is not running, to report from it. Never creates or changes a file.
    /// [`HistoryError::Missing`] if there is none, [`HistoryError::Locked`] if a station has it.
    pub fn open_read_only(path: &Path, def: &Arc<PlantDef>) -> Result<Store, HistoryError> {
        restore::refuse_unfinished(path)?;
        let read = |file: &Path| {
            connect(file, AccessMode::ReadOnly).map_err(|error| match files::diagnose(path, &error.to_string()) {
                Failure::Obstacle(error) => error,
                Failure::Damaged(why) => HistoryError::Engine(why),
            })
        };
        if !path.is_file() {
            // A station may be building it.
            let built = Some(with_suffix(path, NEW)).filter(|new| new.is_file()).and_then(|new| read(&new).err());
            let locked = built.filter(|error| matches!(error, HistoryError::Locked { .. }));
            return Err(locked.unwrap_or_else(|| HistoryError::Missing { path: path.display().to_string() }));
        }
        files::refuse_foreign(path)?;
        files::refuse_special(path)?;
        let db = read(path)?;
        let mut store = Store::around(db, path, def);
        let version = store.version().map_err(|_| HistoryError::Engine("the file is not a history".into()))?;
        if version as usize != sql::MIGRATIONS.len() {
            return Err(other_schema(path, version));
        }
        store.ids = ids(def, &store.dictionary().map_err(engine)?);
        store.read_last_commit().map_err(engine)?;
        store.read_recording().map_err(engine)?;
        store.ended = store.ended().map_err(engine)?;
        Ok(store)
    }

    /// Opens a database that no station writes, whatever its plant is, to see what is in it.
    pub(super) fn peek(path: &Path) -> Result<Store, HistoryError> {
        files::refuse_special(path)?;
        let db = connect(path, AccessMode::ReadOnly).map_err(engine)?;
        let store = Store::around(db, path, &Arc::default());
        let version = store.version().map_err(engine)?;
        if sql::MIGRATIONS.len() < version as usize {
            return Err(other_schema(path, version));
        }
        store.read_last_commit().map_err(engine)?;
        Ok(store)
    }

    /// Creates an empty store, complete under its name or not there at all.
    fn create(path: &Path) -> Result<(), HistoryError> {
        let new = with_suffix(path, NEW);
        let created = || {
            files::remove(&new);
            let store = Store::around(connect(&new, AccessMode::ReadWrite).map_err(engine)?, &new, &Arc::default());
            store.migrate()?;
            drop(store);
            disk::rename(&new, path).map_err(|error| HistoryError::Engine(format!("{}: {error}", path.display())))
        };
        created().inspect_err(|_| files::remove(&new))
    }

    /// Opens the file and compares it with its archive; with what is wrong with that, in words.
    fn open_file(path: &Path, def: &Arc<PlantDef>, now: Timestamp) -> Result<(Store, Option<String>), Failure> {
        let failed = |error: duckdb::Error| files::diagnose(path, &error.to_string());
        let db = connect(path, AccessMode::ReadWrite).map_err(failed)?;
        // The engine makes none by itself: each is prepared for, see `blocks`.
        db.execute_batch("SET checkpoint_threshold = '1TB'").map_err(failed)?;
        let mut store = Store::around(db, path, def);
        store.migrate().map_err(|error| failure(path, error))?;
        let version = store.version().map_err(failed)?;
        if sql::MIGRATIONS.len() < version as usize {
            return Err(Failure::Obstacle(other_schema(path, version)));
        }
        let other = store.adopt_tags(now).map_err(|error| failure(path, error))?;
        store.register_tags().map_err(failed)?;
        store.check_tags().map_err(Failure::Obstacle)?;
        let missing = store.adopt_files().map_err(|error| failure(path, error))?;
        store.read_last_commit().map_err(failed)?;
        store.read_recording().map_err(failed)?;
        Ok((store, joined([&other, &missing])))
    }

    /// Has every tag a number?
    fn check_tags(&self) -> Result<(), HistoryError> {
        let words = "the file has 65536 tags, no more are possible: start a new one";
        if self.ids.contains(&None) { Err(HistoryError::Engine(words.into())) } else { Ok(()) }
    }

    fn migrate(&self) -> Result<(), HistoryError> {
        self.db.execute_batch(sql::CREATE_VERSION).map_err(engine)?;
        let done = self.version().map_err(engine)? as usize;
        // Of a file that is being created nothing is kept.
        let bare = || self.db.execute_batch("CHECKPOINT").map_err(engine);
        let checkpoint = || if done == 0 { bare() } else { self.checkpoint() };
        for (number, migration) in sql::MIGRATIONS.iter().enumerate().skip(done) {
            // What a station left in the log goes into the file first, see `sql::MIGRATIONS`.
            checkpoint()?;
            self.db.execute_batch("BEGIN").map_err(engine)?;
            self.db.execute_batch(migration).map_err(engine)?;
            self.db.execute(sql::SET_VERSION, params![to_u32(number) + 1]).map_err(engine)?;
            self.db.execute_batch("COMMIT").map_err(engine)?;
            checkpoint()?;
        }
        Ok(())
    }

    fn version(&self) -> duckdb::Result<u32> {
        self.db.query_row(sql::VERSION, [], |row| row.get(0))
    }

    /// Stored numbers by (name, unit). A tag whose unit was changed is another tag: its old numbers would be misread.
    pub(super) fn dictionary(&self) -> duckdb::Result<HashMap<(String, String), u16>> {
        let mut statement = self.db.prepare(sql::TAGS)?;
        let rows = statement.query_map([], |row| Ok(((row.get(1)?, row.get(2)?), row.get(0)?)))?;
        rows.collect()
    }

    /// Numbers the tags that the file does not know yet. All at once: one statement a tag took a millisecond each.
    fn register_tags(&mut self) -> duckdb::Result<()> {
        let mut known = self.dictionary()?;
        let mut next = known.values().max().map_or(0, |max| u32::from(*max) + 1);
        let mut appender = self.db.appender("tag")?;
        for tag in &self.def.tags {
            let key = (tag.name.clone(), tag.unit.clone());
            if !known.contains_key(&key)
                && let Ok(id) = u16::try_from(next)
            {
                appender.append_row(params![id, tag.name, tag.unit])?;
                known.insert(key, id);
                next += 1;
            }
        }
        appender.flush()?;
        drop(appender);
        self.ids = ids(&self.def, &known);
        Ok(())
    }
}

fn other_schema(path: &Path, found: u32) -> HistoryError {
    let expected = to_u32(sql::MIGRATIONS.len());
    HistoryError::OtherSchema { path: path.display().to_string(), found, expected }
}

/// The stored number of each tag, by `TagId`.
fn ids(def: &PlantDef, known: &HashMap<(String, String), u16>) -> Vec<Option<u16>> {
    def.tags.iter().map(|tag| known.get(&(tag.name.clone(), tag.unit.clone())).copied()).collect()
}

/// What an error of a read at the start means.
fn failure(path: &Path, error: HistoryError) -> Failure {
    match error {
        HistoryError::Engine(words) => files::diagnose(path, &words),
        other => Failure::Obstacle(other),
    }
}

/// Memory of the engine: the longest lists that are answered need 40 MB, and curves and reports are not faster with more,
/// because what they read is far larger (measured with 96).
const MEMORY: &str = "64MB";

/// One thread, little memory, nothing from the network; and no bit packing, with which some data make a checkpoint fail
/// (duckdb/duckdb#22823).
pub(super) fn connect(path: &Path, mode: AccessMode) -> duckdb::Result<Connection> {
    let temporary = with_suffix(path, ".tmp");
    let config = Config::default()
        .access_mode(mode)?
        .threads(1)?
        .max_memory(MEMORY)?
        .with("temp_directory", temporary.to_string_lossy())?
        .with("max_temp_directory_size", "512MB")?
        .with("checkpoint_threshold", "4MB")?
        .with("autoinstall_known_extensions", "false")?
        .with("autoload_known_extensions", "false")?;
    let db = Connection::open_with_flags(path, config)?;
    // As an option at the open it is taken without a word and has no effect (measured).
    db.execute_batch("SET disabled_compression_methods = 'bitpacking'")?;
    Ok(db)
}
