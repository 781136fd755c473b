//! The store: one DuckDB file, opened, guarded, appended to. Plain and synchronous; one thread owns it.

use std::{cell::Cell, collections::HashMap, path::Path, path::PathBuf, sync::Arc, time::Duration};

use duckdb::{
    AccessMode, Config, Connection, params,
    types::{TimeUnit, Value},
};
use jiff::Timestamp;

use super::{
    files::{self, Failure, Opening, Part},
    sql,
};
use crate::{
    history::HistoryError,
    plant::{
        def::PlantDef,
        line_minute::LineMinute,
        record::{ActionRecord, AlarmRecord, Record},
        sample::{Cause, Quality, Sample},
    },
    report::hold::HOLD_MAX,
};

/// An open store.
pub struct Store {
    pub(super) db: Connection,
    pub(super) def: Arc<PlantDef>,
    path: PathBuf,
    /// The first and last instant stored, kept because reading them scans the whole file.
    extent: Cell<Option<(Timestamp, Timestamp)>>,
    /// The stored number of each tag, by `TagId`; `None` for a tag that the file does not know (only when read-only).
    pub(super) ids: Vec<Option<u16>>,
    /// Where the records end, if nobody is writing any more.
    pub(super) ended: Option<Timestamp>,
}

/// A store as it was opened, and what the operator should know about that.
pub struct Opened {
    /// The store.
    pub store: Store,
    /// `history damaged, set aside as …`.
    pub trouble: Option<String>,
}

impl Store {
    /// Opens or creates the store.
    ///
    /// A damaged log is set aside: the file is then as old as its last checkpoint, some minutes. A damaged file is set
    /// aside with its log and a new store is begun. So it is with files whose opening never ended twice before.
    /// [`HistoryError::Locked`] if another process has it, [`HistoryError::Engine`] for any other obstacle.
    pub fn open(path: &Path, def: &Arc<PlantDef>, now: Timestamp) -> Result<Opened, HistoryError> {
        files::refuse_foreign(path)?;
        let opening = Opening::begin(path)?;
        let mut trouble = None;
        let mut set_aside = |part: Part, why: &str| -> Result<(), HistoryError> {
            let target = files::set_aside(path, part, now)?;
            let what = match part {
                Part::Log => "the last minutes of the history are",
                Part::Everything => "the history is",
            };
            trouble = Some(format!("{what} damaged ({why}) and set aside as {}", target.display()));
            Ok(())
        };
        match opening.failed {
            0..files::FAILED_OPENS_MAX => {}
            files::FAILED_OPENS_MAX if files::has_log(path) => set_aside(Part::Log, "opening it never ended")?,
            _ => set_aside(Part::Everything, "opening it never ended")?,
        }
        let mut opened = Store::open_file(path, def);
        for part in [Part::Log, Part::Everything] {
            let Err(Failure::Damaged(why)) = &opened else { break };
            if part == Part::Everything || files::has_log(path) {
                set_aside(part, why)?;
                opened = Store::open_file(path, def);
            }
        }
        let store = opened.map_err(|failure| match failure {
            Failure::Obstacle(error) => error,
            Failure::Damaged(why) => HistoryError::Engine(why),
        })?;
        drop(opening);
        Ok(Opened { store, trouble })
    }

    /// Opens the store of a station that is not running, to report from it. Never creates or changes a file.
    /// [`HistoryError::Missing`] if there is none, [`HistoryError::Locked`] if a station has it.
    pub fn open_read_only(path: &Path, def: &Arc<PlantDef>) -> Result<Store, HistoryError> {
        if !path.is_file() {
            return Err(HistoryError::Missing { path: path.display().to_string() });
        }
        files::refuse_foreign(path)?;
        let failed = |message: String| match files::diagnose(path, &message) {
            Failure::Obstacle(error) => error,
            Failure::Damaged(why) => HistoryError::Engine(why),
        };
        let db = connect(path, AccessMode::ReadOnly).map_err(|error| failed(error.to_string()))?;
        let mut store = Store::around(db, path, def);
        let version = store.version().map_err(|_| HistoryError::Engine("the file is not a history".into()))?;
        if version as usize != sql::MIGRATIONS.len() {
            let words = format!("schema version {version}, this program reads {}", sql::MIGRATIONS.len());
            return Err(HistoryError::Engine(words));
        }
        let known = store.dictionary().map_err(engine)?;
        let id = |name: &str, unit: &str| known.get(&(name.to_owned(), unit.to_owned())).copied();
        store.ids = def.tags.iter().map(|tag| id(&tag.name, &tag.unit)).collect();
        store.read_extent().map_err(engine)?;
        store.ended = store.extent().and_then(|(_, last)| after(last));
        Ok(store)
    }

    /// Appends records in one transaction: all of them or none.
    pub fn append(&self, records: &[Record]) -> Result<(), HistoryError> {
        self.transaction(|| {
            self.append_samples(records)?;
            self.append_alarms(records)?;
            self.append_actions(records)?;
            self.append_lines(records)
        })?;
        records.iter().for_each(|record| match record {
            Record::Sample(_, sample) => self.extend(sample.at),
            Record::Alarm(alarm) => self.extend(alarm.at),
            Record::Action(_) | Record::Line(_) => {}
        });
        Ok(())
    }

    /// Ends every curve at an instant: from here on the station is off.
    pub fn end_curves(&self, at: Timestamp) -> Result<(), HistoryError> {
        let Some((_, last)) = self.extent() else { return Ok(()) };
        // A tag without a row for so long has no value any more anyway.
        let since = last.checked_sub(HOLD_MAX).unwrap_or(Timestamp::MIN);
        let off = Quality::Bad(Cause::StationOff).code();
        self.db.execute(sql::END_CURVES, params![utc(at), off, utc(since)]).map_err(engine)?;
        self.extend(at);
        Ok(())
    }

    /// Ends the curves that a station left behind when it died, one second after the last row of all. To be called
    /// before the first append of a new station, so that no curve or mean runs through the time in between.
    pub fn end_curves_left_behind(&self, now: Timestamp) -> Result<(), HistoryError> {
        let Some((_, last)) = self.extent() else { return Ok(()) };
        let Some(end) = after(last) else { return Ok(()) };
        // Not after the first rows to come; if the clock went back, those rows lie elsewhere anyway.
        self.end_curves(if now > last { end.min(now) } else { end })
    }

    /// Writes the log into the file.
    pub fn checkpoint(&self) -> Result<(), HistoryError> {
        self.db.execute_batch("CHECKPOINT").map_err(engine)
    }

    /// Bytes on disk.
    pub fn file_bytes(&self) -> u64 {
        files::size(&self.path)
    }

    /// Rows of all tables: samples, steps of alarms, deeds of operators, minutes of lines.
    pub fn count_rows(&self) -> Result<u64, HistoryError> {
        self.db.query_row(sql::COUNT_ROWS, [], |row| row.get(0)).map_err(engine)
    }

    /// The first and last instant stored.
    pub fn extent(&self) -> Option<(Timestamp, Timestamp)> {
        self.extent.get()
    }

    fn around(db: Connection, path: &Path, def: &Arc<PlantDef>) -> Store {
        let (def, path) = (Arc::clone(def), path.to_owned());
        Store { db, def, path, extent: Cell::new(None), ids: Vec::new(), ended: None }
    }

    fn read_extent(&self) -> duckdb::Result<()> {
        let row = |row: &duckdb::Row| Ok((row.get::<_, Option<i64>>(0)?, row.get::<_, Option<i64>>(1)?));
        let (first, last) = self.db.query_row(sql::EXTENT, [], row)?;
        self.extent.set(first.zip(last).and_then(|(first, last)| Some((instant(first)?, instant(last)?))));
        Ok(())
    }

    fn extend(&self, at: Timestamp) {
        let (first, last) = self.extent.get().unwrap_or((at, at));
        self.extent.set(Some((first.min(at), last.max(at))));
    }

    fn open_file(path: &Path, def: &Arc<PlantDef>) -> Result<Store, Failure> {
        let failed = |error: duckdb::Error| files::diagnose(path, &error.to_string());
        let db = connect(path, AccessMode::ReadWrite).map_err(failed)?;
        let mut store = Store::around(db, path, def);
        store.migrate().map_err(failed)?;
        let newest = sql::MIGRATIONS.len() as u32;
        let version = store.version().map_err(failed)?;
        if version > newest {
            let words = format!("schema version {version} is of a newer sightglass, this one writes {newest}");
            return Err(Failure::Obstacle(HistoryError::Engine(words)));
        }
        store.register_tags().map_err(failed)?;
        if store.ids.contains(&None) {
            let words = "the file has known 65536 tags, more cannot be numbered: begin a new one";
            return Err(Failure::Obstacle(HistoryError::Engine(words.into())));
        }
        // Read what every start reads, so that damage shows while the files can still be set aside.
        store.read_extent().map_err(failed)?;
        Ok(store)
    }

    fn migrate(&self) -> duckdb::Result<()> {
        self.db.execute_batch(sql::CREATE_VERSION)?;
        let done = self.version()? as usize;
        for (number, migration) in sql::MIGRATIONS.iter().enumerate().skip(done) {
            // What a station left in the log goes into the file first, see `sql::MIGRATIONS`.
            self.db.execute_batch("CHECKPOINT; BEGIN")?;
            self.db.execute_batch(migration)?;
            self.db.execute(sql::SET_VERSION, params![number as u32 + 1])?;
            self.db.execute_batch("COMMIT; CHECKPOINT")?;
        }
        Ok(())
    }

    fn version(&self) -> duckdb::Result<u32> {
        self.db.query_row(sql::VERSION, [], |row| row.get(0))
    }

    /// Stored numbers by (name, unit). A tag whose unit was changed is another tag: its old numbers would be misread.
    fn dictionary(&self) -> duckdb::Result<HashMap<(String, String), u16>> {
        let mut statement = self.db.prepare(sql::TAGS)?;
        let rows = statement.query_map([], |row| Ok(((row.get(1)?, row.get(2)?), row.get(0)?)))?;
        rows.collect()
    }

    fn register_tags(&mut self) -> duckdb::Result<()> {
        let mut known = self.dictionary()?;
        let mut next = known.values().max().map_or(0, |max| u32::from(*max) + 1);
        self.db.execute_batch("BEGIN")?;
        for tag in &self.def.tags {
            let key = (tag.name.clone(), tag.unit.clone());
            if !known.contains_key(&key)
                && let Ok(id) = u16::try_from(next)
            {
                self.db.execute(sql::ADD_TAG, params![id, tag.name, tag.unit])?;
                known.insert(key, id);
                next += 1;
            }
        }
        self.db.execute_batch("COMMIT")?;
        let id = |name: &str, unit: &str| known.get(&(name.to_owned(), unit.to_owned())).copied();
        self.ids = self.def.tags.iter().map(|tag| id(&tag.name, &tag.unit)).collect();
        Ok(())
    }

    fn transaction(&self, work: impl FnOnce() -> duckdb::Result<()>) -> Result<(), HistoryError> {
        let done = self.db.execute_batch("BEGIN").and_then(|()| work()).and_then(|()| self.db.execute_batch("COMMIT"));
        done.map_err(|error| {
            // A transaction that DuckDB has already given up cannot be rolled back: the first error is the one that counts.
            let _ = self.db.execute_batch("ROLLBACK");
            engine(error)
        })
    }

    fn append_samples(&self, records: &[Record]) -> duckdb::Result<()> {
        let mut rows = records.iter().filter_map(|record| match record {
            Record::Sample(tag, sample) => Some((self.ids.get(tag.index()).copied().flatten()?, sample)),
            Record::Alarm(_) | Record::Action(_) | Record::Line(_) => None,
        });
        let Some(first) = rows.next() else { return Ok(()) };
        let mut appender = self.db.appender("sample")?;
        for (id, &Sample { at, value, quality }) in std::iter::once(first).chain(rows) {
            appender.append_row((utc(at), id, value, quality.code()))?;
        }
        appender.flush()
    }

    fn append_alarms(&self, records: &[Record]) -> duckdb::Result<()> {
        let mut rows = records.iter().filter_map(|record| match record {
            Record::Alarm(alarm) => Some(alarm),
            Record::Sample(..) | Record::Action(_) | Record::Line(_) => None,
        });
        let Some(first) = rows.next() else { return Ok(()) };
        let mut appender = self.db.appender_with_columns("alarm_journal", &sql::STEP_COLUMNS)?;
        for alarm in std::iter::once(first).chain(rows) {
            let AlarmRecord { at, subject, text, priority, step, value, limit, by, reason, until, burst } = alarm;
            let (until, began) = (until.map(utc), burst.map(|burst| utc(burst.began)));
            let (priority, rank) = (priority.number(), burst.map(|burst| burst.rank));
            appender.append_row(params![
                utc(*at),
                subject,
                text,
                priority,
                step.word(),
                value,
                limit,
                by,
                reason,
                until,
                began,
                rank
            ])?;
        }
        appender.flush()
    }

    fn append_actions(&self, records: &[Record]) -> duckdb::Result<()> {
        let mut rows = records.iter().filter_map(|record| match record {
            Record::Action(action) => Some(action),
            Record::Sample(..) | Record::Alarm(_) | Record::Line(_) => None,
        });
        let Some(first) = rows.next() else { return Ok(()) };
        let mut appender = self.db.appender("operator_action")?;
        for deed in std::iter::once(first).chain(rows) {
            let ActionRecord { at, by, from, action, target, old, new, outcome, note, seal } = deed;
            let (number, hash) = (seal.map(|seal| seal.number), seal.map(|seal| seal.hash.to_vec()));
            appender.append_row(params![utc(*at), by, action, target, old, new, outcome, from, note, number, hash])?;
        }
        appender.flush()
    }

    fn append_lines(&self, records: &[Record]) -> duckdb::Result<()> {
        let mut rows = records.iter().filter_map(|record| match record {
            Record::Line(minute) => Some(minute),
            Record::Sample(..) | Record::Alarm(_) | Record::Action(_) => None,
        });
        let Some(first) = rows.next() else { return Ok(()) };
        let mut appender = self.db.appender("line_minute")?;
        for minute in std::iter::once(first).chain(rows) {
            let LineMinute { at, line, requests, ok, timeouts, corrupt, exceptions, retries, late, missed, .. } =
                minute;
            let LineMinute { sent_bytes, received_bytes, utilisation, reply_p99_ms, reply_max_ms, .. } = minute;
            let (at, utilisation) = (utc(*at), *utilisation);
            appender.append_row(params![
                at,
                line,
                small(*requests),
                small(*ok),
                small(*timeouts),
                small(*corrupt),
                small(*exceptions),
                small(*retries),
                small(*late),
                small(*missed),
                small(*sent_bytes),
                small(*received_bytes),
                utilisation,
                reply_p99_ms,
                reply_max_ms
            ])?;
        }
        appender.flush()
    }
}

/// A count as the column holds it; more than four thousand million in a minute is no count.
fn small(count: u64) -> u32 {
    count.try_into().unwrap_or(u32::MAX)
}

/// One thread, little memory, nothing from the network; and no bit packing, with which some data make a checkpoint fail
/// (duckdb/duckdb#22823).
fn connect(path: &Path, mode: AccessMode) -> duckdb::Result<Connection> {
    let temporary = files::beside(path, ".tmp");
    let config = Config::default()
        .access_mode(mode)?
        .threads(1)?
        .max_memory("128MB")?
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

/// An instant as SQL has it: microseconds UTC.
pub(super) fn utc(at: Timestamp) -> Value {
    Value::Timestamp(TimeUnit::Microsecond, at.as_microsecond())
}

/// The instant of a stored number of microseconds.
pub(super) fn instant(micros: i64) -> Option<Timestamp> {
    Timestamp::from_microsecond(micros).ok()
}

/// Any failure of the engine, in one line.
pub(super) fn engine(error: duckdb::Error) -> HistoryError {
    HistoryError::Engine(files::first_line(&error.to_string()))
}

fn after(last: Timestamp) -> Option<Timestamp> {
    last.checked_add(Duration::from_secs(1)).ok()
}
