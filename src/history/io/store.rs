//! The store: one DuckDB file, appended to. Plain and synchronous; one thread writes, clones of it read.

use std::{
    cell::{Cell, RefCell},
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::{Arc, Weak},
    time::Duration,
};

use duckdb::{
    Appender, Connection, appender_params_from_iter, params,
    types::{TimeUnit, Value},
};
use jiff::Timestamp;

use super::{
    blocks::{self, Blocks},
    disk, files,
    interrupt::{Interrupt, Open},
    last::{self, LastCommit},
    recorded::{Recording, recorded_at},
    room,
    samples::PIECE,
    sql,
    stored::Stored,
};
use crate::{
    history::{HistoryError, recorded::recorded, tiers::in_milliseconds},
    plant::{
        def::PlantDef,
        record::Record,
        sample::{Cause, Quality, Sample},
    },
};

/// An open store.
pub struct Store {
    open: Open,
    pub(super) db: Connection,
    pub(super) def: Arc<PlantDef>,
    pub(super) path: PathBuf,
    /// The first and last instant stored, kept because reading them scans the whole file.
    extent: Cell<Option<(Timestamp, Timestamp)>>,
    /// The last commit, as the database itself has it, and the epoch that it ended in.
    last: Cell<LastCommit>,
    epoch: Cell<u16>,
    /// What is being recorded.
    pub(super) recording: Cell<Recording>,
    /// Device and number of the file as it was opened.
    file: Option<(u64, u64)>,
    /// The stored number of each tag, by `TagId`; `None` for a tag that the file does not know (only when read-only).
    pub(super) ids: Vec<Option<u16>>,
    /// Where the records end, if no station is writing.
    pub(super) ended: Option<Timestamp>,
    /// Rows that are read at a time.
    pub(super) piece: usize,
    /// What could not be read of the file, until it is reported.
    pub(super) unreadable: RefCell<Option<String>>,
    /// Files of the archive that could not be read: what lies beneath them answers.
    pub(super) avoided: RefCell<BTreeSet<String>>,
    /// The archive is not what it was when a query began: it is answered once more.
    pub(super) changed: Cell<bool>,
    /// Shared with every clone, and dropped after their connections: while one is left, the file is not closed.
    alive: Arc<()>,
    blocks: Arc<Blocks>,
}

impl Store {
    /// The same store through a connection of its own, to read beside the one that writes.
    pub fn try_clone(&self) -> Result<Store, HistoryError> {
        room::check()?;
        let db = self.db.try_clone().map_err(engine)?;
        Ok(Store {
            extent: self.extent.clone(),
            last: self.last.clone(),
            epoch: self.epoch.clone(),
            recording: self.recording.clone(),
            file: self.file,
            ids: self.ids.clone(),
            ended: self.ended,
            piece: self.piece,
            alive: Arc::clone(&self.alive),
            blocks: Arc::clone(&self.blocks),
            ..Store::around(db, &self.path, &self.def)
        })
    }

    /// Gone when the last connection to the file is closed.
    pub(super) fn alive(&self) -> Weak<()> {
        Arc::downgrade(&self.alive)
    }

    /// Ends what this connection is doing, from any thread.
    pub fn interrupt_handle(&self) -> Interrupt {
        self.open.interrupt(&self.db)
    }

    /// Appends records in one transaction: all of them or none.
    pub fn append(&self, records: &[Record]) -> Result<(), HistoryError> {
        let stored = records.iter().filter_map(|record| match record {
            Record::Sample(_, sample) => Some(sample.at),
            Record::Alarm(alarm) => Some(alarm.at),
            Record::Action(_)
            | Record::Line(_)
            | Record::Batch(_)
            | Record::Run(_)
            | Record::Report(_)
            | Record::ClockSet => None,
        });
        let begun = records.iter().filter(|record| is_clock_set(record)).count();
        let epoch = |passed: usize| self.epoch.get().saturating_add(u16::try_from(passed).unwrap_or(u16::MAX));
        let mut recording = self.recording.get();
        self.commit(stored, epoch(begun), || {
            let mut times = Vec::new();
            for (passed, records) in records.split(is_clock_set).enumerate() {
                self.append_epoch(records, epoch(passed))?;
                times.extend(recorded(epoch(passed), records.iter().filter_map(recorded_at)));
            }
            recording = self.enter_recorded(&times)?;
            Ok(true)
        })?;
        self.recording.set(recording);
        Ok(())
    }

    /// Ends every curve at an instant: from here on the station is off.
    pub fn mark_station_off(&self, at: Timestamp) -> Result<(), HistoryError> {
        let Some(last) = self.last_written() else { return Ok(()) };
        // Each tag has a row in every hour.
        let since = last.checked_sub(jiff::SignedDuration::from_hours(1)).unwrap_or(Timestamp::MIN);
        let (off, epoch) = (Quality::Bad(Cause::StationOff).code(), self.epoch.get());
        let mut recording = self.recording.get();
        self.commit(std::iter::once(at), epoch, || {
            let ended = self.db.execute(sql::END_CURVES, params![utc(at), off, epoch, utc(since)])? > 0;
            if ended {
                recording = self.enter_recorded(&recorded(epoch, std::iter::once(at.as_microsecond())))?;
            }
            Ok(ended)
        })?;
        // What a station stores next is of another run.
        self.recording.set(Recording { goes_on: false, ..recording });
        Ok(())
    }

    /// Ends the curves that a station left behind when it died, one second after the row that it wrote last. To be called
    /// before the first append of a new station, so that no curve or mean runs through the time in between.
    pub fn end_curves_left_behind(&self, now: Timestamp) -> Result<(), HistoryError> {
        let Some(last) = self.last_written() else { return Ok(()) };
        let Some(end) = after(last) else { return Ok(()) };
        // Not after the first rows to come; if the clock went back, those rows lie elsewhere anyway.
        self.mark_station_off(if now > last { end.min(now) } else { end })
    }

    /// Writes the log into the file.
    pub fn checkpoint(&self) -> Result<(), HistoryError> {
        room::check()?;
        if let Err(error) = self.keep_blocks() {
            // The log would grow otherwise, and power is rarely lost in the next milliseconds.
            tracing::warn!(?error, "a loss of power during this checkpoint would damage the history");
        }
        self.db.execute_batch("CHECKPOINT").map_err(engine)?;
        blocks::forget(&self.path);
        Ok(())
    }

    /// What the next checkpoint overwrites.
    pub(super) fn keep_blocks(&self) -> Result<(), HistoryError> {
        self.blocks.keep(&self.db, &self.path)
    }

    /// Bytes on disk.
    pub fn file_bytes(&self) -> u64 {
        files::size(&self.path)
    }

    /// Rows of all tables: samples, alarm events, operator actions, minutes of lines.
    pub fn count_rows(&self) -> Result<u64, HistoryError> {
        self.db.query_row(sql::COUNT_ROWS, [], |row| row.get(0)).map_err(engine)
    }

    /// The first and last instant stored.
    pub fn extent(&self) -> Option<(Timestamp, Timestamp)> {
        self.extent.get()
    }

    pub(super) fn around(db: Connection, path: &Path, def: &Arc<PlantDef>) -> Store {
        Store {
            open: Open::default(),
            db,
            def: Arc::clone(def),
            file: files::inode(path),
            path: path.to_owned(),
            extent: Cell::new(None),
            last: Cell::new(LastCommit { identity: 0, number: 0, at: None }),
            epoch: Cell::new(0),
            recording: Cell::default(),
            ids: Vec::new(),
            ended: None,
            piece: PIECE,
            unreadable: RefCell::default(),
            avoided: RefCell::default(),
            changed: Cell::default(),
            alive: Arc::default(),
            blocks: Arc::default(),
        }
    }

    /// The epoch of what was stored last: how often the clock was set while this history was written.
    pub(super) fn epoch(&self) -> u16 {
        self.epoch.get()
    }

    /// The last commit, as the database itself has it.
    pub(super) fn last_commit(&self) -> LastCommit {
        self.last.get()
    }

    /// Whether the file that was opened is still the one at its path.
    pub fn is_in_place(&self) -> bool {
        self.file == files::inode(&self.path)
    }

    /// Writes the last commit down beside the database. Without that a cut log would go unnoticed, nothing else.
    pub(super) fn note_last_commit(&self) {
        if let Err(error) = last::write(&self.path, &self.last.get()) {
            tracing::warn!(%error, "the last commit is not recorded beside the history");
        }
    }

    pub(super) fn read_last_commit(&self) -> duckdb::Result<()> {
        let row = |row: &duckdb::Row| {
            let time = |column| Ok::<_, duckdb::Error>(row.get::<_, Option<i64>>(column)?.and_then(instant));
            Ok((LastCommit { identity: row.get(0)?, number: row.get(1)?, at: time(3)? }, time(2)?, row.get(4)?))
        };
        let (last, first, epoch) = self.db.query_row(sql::LAST_COMMIT, [], row)?;
        self.last.set(last);
        self.epoch.set(epoch);
        self.extent.set(first.zip(last.at));
        Ok(())
    }

    /// Stores what `work` appends, all of it or nothing, as the next commit; `stored` are the instants in it, `epoch` is
    /// the last one. Without any row (`false`) there is no commit.
    pub(super) fn commit(
        &self,
        stored: impl Iterator<Item = Timestamp>,
        epoch: u16,
        work: impl FnOnce() -> duckdb::Result<bool>,
    ) -> Result<(), HistoryError> {
        let wider = |extent: Option<(Timestamp, Timestamp)>, at: Timestamp| {
            Some(extent.map_or((at, at), |(first, last)| (first.min(at), last.max(at))))
        };
        let extent = stored.fold(self.extent.get(), wider);
        let number = self.last.get().number + 1;
        let stored = self.transaction(|| {
            if !work()? {
                return Ok(false);
            }
            let (first, last) = extent.map_or((Value::Null, Value::Null), |(first, last)| (utc(first), utc(last)));
            self.db.prepare_cached(sql::SET_LAST_COMMIT)?.execute(params![number, first, last, epoch])?;
            Ok(true)
        })?;
        if !stored {
            return Ok(());
        }
        self.extent.set(extent);
        self.epoch.set(epoch);
        self.last.set(LastCommit { number, at: extent.map(|(_, last)| last), ..self.last.get() });
        self.note_last_commit();
        Ok(())
    }

    pub(super) fn transaction<T>(&self, work: impl FnOnce() -> duckdb::Result<T>) -> Result<T, HistoryError> {
        room::check()?;
        disk::step("transaction").map_err(|error| HistoryError::Engine(error.to_string()))?;
        let rollback = || self.db.execute_batch("ROLLBACK");
        let begin = || self.db.execute_batch("BEGIN");
        // A rollback that had no memory has left the last transaction open.
        let done = begin().or_else(|_| rollback().and_then(|()| begin())).and_then(|()| work());
        let done = done.and_then(|done| self.db.execute_batch("COMMIT").map(|()| done));
        done.map_err(|error| {
            // A transaction that DuckDB has already given up cannot be rolled back: the first error is the one that counts.
            let _ = rollback();
            engine(error)
        })
    }

    /// Appends rows to columns of a table; where there are none, nothing is done.
    fn append_rows<T>(
        &self,
        (table, columns): (&str, &[&str]),
        rows: Vec<T>,
        mut append: impl FnMut(&mut Appender, T) -> duckdb::Result<()>,
    ) -> duckdb::Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        let mut appender = self.db.appender_with_columns(table, columns)?;
        rows.into_iter().try_for_each(|row| append(&mut appender, row))?;
        appender.flush()
    }

    fn append_records<T: Stored>(&self, records: Vec<&T>, epoch: u16) -> duckdb::Result<()> {
        let columns = [T::COLUMNS, &["epoch"]].concat();
        self.append_rows((T::TABLE, &columns), records, |to, record| {
            to.append_row(appender_params_from_iter(record.write().into_iter().chain([epoch.into()])))
        })
    }

    /// Appends records of one epoch.
    fn append_epoch(&self, records: &[Record], epoch: u16) -> duckdb::Result<()> {
        let (mut samples, mut alarms, mut actions) = (Vec::new(), Vec::new(), Vec::new());
        let (mut lines, mut batches, mut runs, mut reports) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for record in records {
            match record {
                Record::Sample(tag, sample) => samples.extend(self.id(*tag).map(|id| (id, sample))),
                Record::Alarm(alarm) => alarms.push(alarm),
                Record::Action(action) => actions.push(action),
                Record::Line(minute) => lines.push(minute),
                Record::Batch(batch) => batches.push(batch),
                Record::Run(run) => runs.push(&**run),
                Record::Report(report) => reports.push(report),
                Record::ClockSet => {}
            }
        }
        let columns = ["utc", "tag", "value", "quality", "epoch", "rest"];
        self.append_rows(("sample", &columns), samples, |to, (id, &Sample { at, value, rest, quality })| {
            to.append_row((utc(in_milliseconds(at)), id, value, quality.code(), epoch, rest))
        })?;
        self.append_records(alarms, epoch)?;
        self.remove_unsealed(&mut actions)?;
        self.append_records(actions, epoch)?;
        self.append_records(lines, epoch)?;
        self.append_records(batches, epoch)?;
        self.append_records(runs, epoch)?;
        self.append_records(reports, epoch)
    }
}

fn is_clock_set(record: &Record) -> bool {
    matches!(record, Record::ClockSet)
}

/// An instant as SQL has it: microseconds UTC.
pub(super) fn utc(at: Timestamp) -> Value {
    Value::Timestamp(TimeUnit::Microsecond, at.as_microsecond())
}

/// The instant of a stored number of microseconds.
pub(super) fn instant(micros: i64) -> Option<Timestamp> {
    Timestamp::from_microsecond(micros).ok()
}

/// Any failure of the engine, in its own words, one line.
pub(super) fn engine(error: duckdb::Error) -> HistoryError {
    HistoryError::Engine(files::first_line(&error.to_string()))
}

/// The instant at which curves end that end with this record.
pub(super) fn after(last: Timestamp) -> Option<Timestamp> {
    last.checked_add(Duration::from_secs(1)).ok()
}
