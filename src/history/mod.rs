//! What the plant remembers: one thread writes it with DuckDB, another answers queries about it.

pub mod tiers;
pub mod recorded;
pub(crate) mod legs;
pub mod retention;
pub mod series;
pub mod alarm_state;
mod engine_error;
pub mod words;
pub mod backup;
pub mod bound;
pub mod import;
pub mod io;

use std::{path::PathBuf, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use self::recorded::{StoredSamples, Unarchived};
use self::{
    import::Import,
    retention::{Deletion, Disk},
    tiers::Tier,
};
pub use crate::report::curve::{Bucket, Series};
use crate::{
    plant::{
        alarm::PeriodMetrics,
        control_run::ControlRun,
        def::{HistoryDef, LineId, TagId},
        line_minute::LineMinute,
        live::{LiveRead, LiveReading},
        past::Past,
        record::{ActionRecord, AlarmRecord},
        report::ReportRecord,
    },
    report::{Period, ShiftReport, batch::BatchReport, step_series::HeldValue},
};

/// Batches with figures in one answer: each is as much work as a small report.
pub const BATCHES_MAX: usize = 100;

/// Real time for one query.
pub const QUERY_TIME_MAX: Duration = Duration::from_secs(20);

/// What can be asked. Spans include `from` and exclude `to`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Query {
    /// Curves of some tags, reduced to at most `buckets` columns; one series a tag, in the order asked.
    Series {
        /// Which tags.
        tags: Vec<TagId>,
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// Columns.
        buckets: usize,
    },
    /// Alarm events, newest first.
    Journal {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The most to return.
        limit: usize,
    },
    /// Operator actions, newest first.
    Actions {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The most to return.
        limit: usize,
    },
    /// All actions with a search, for Supervisors; answered by [`Answer::Actions`].
    Audit {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// Some words of any column; empty for all.
        words: String,
        /// Part of the name of who did it; empty for all.
        by: String,
        /// Part of the action; empty for all.
        action: String,
        /// The most to return.
        limit: usize,
    },
    /// What a line counted, minute by minute, oldest first.
    LineMinutes {
        /// Which line.
        line: LineId,
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The most to return, the latest.
        limit: usize,
    },
    /// The report of a period.
    Report {
        /// Which period.
        period: Period,
    },
    /// How good the alarm system was, up to now at the latest.
    AlarmMetrics {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
    },
    /// The values in force at equal intervals; one column a tag, in the order asked.
    Values {
        /// Which tags.
        tags: Vec<TagId>,
        /// The first instant is one interval later.
        from: Timestamp,
        /// The interval.
        every: Duration,
        /// Instants.
        count: usize,
    },
    /// The batches that ran in a span, with their figures, newest first.
    Batches {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The most to return.
        limit: usize,
    },
    /// The control runs in a span, newest first.
    ControlRuns {
        /// Of this controller only.
        controller: Option<String>,
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The most to return.
        limit: usize,
    },
    /// When the first value of some tags was stored in a span, or the latest.
    SampleTime {
        /// Which tags.
        tags: Vec<TagId>,
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
        /// The latest one.
        latest: bool,
    },
    /// The automatic reports on record, the newest period first.
    Reports {
        /// The most to return.
        limit: usize,
    },
    /// The plant as it was at an instant.
    Past {
        /// The instant.
        at: Timestamp,
    },
    /// What is stored, and where.
    Overview,
    /// Every stored sample of a span, archived or not, in order of time.
    Samples {
        /// Of this epoch of the clock; `None`: of all, in the order in which they were stored.
        epoch: Option<u16>,
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
    },
    /// Samples that are not archived yet.
    Unarchived {
        /// From.
        from: Timestamp,
        /// To.
        to: Timestamp,
    },
    /// Registers of a unit as they are now: the line answers it, not the history.
    Registers(LiveRead),
}

/// The answer to the query of the same name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Answer {
    /// One series a tag.
    Series(Vec<Series>),
    /// Alarm events.
    Journal(Vec<AlarmRecord>),
    /// Operator actions.
    Actions(Vec<ActionRecord>),
    /// Minutes of a line.
    LineMinutes(Vec<LineMinute>),
    /// The report.
    Report(Box<ShiftReport>),
    /// The figures of the alarm system.
    AlarmMetrics(Box<PeriodMetrics>),
    /// By tag the value in force at each instant; `None` where nothing is stored, or nothing recent enough.
    Values(Vec<Vec<Option<HeldValue>>>),
    /// The batches.
    Batches(Vec<BatchReport>),
    /// The control runs, each as it stood last.
    ControlRuns(Vec<ControlRun>),
    /// The time; `None` where nothing is stored in the span.
    SampleTime(Option<Timestamp>),
    /// The last event of each report.
    Reports(MadeReports),
    /// What is known of the instant.
    Past(Box<Past>),
    /// Samples of an epoch.
    Samples(StoredSamples),
    /// The same of those that are not archived.
    Unarchived(Unarchived),
    /// What is stored.
    Overview(Box<Overview>),
    /// What the unit holds.
    Registers(LiveReading),
}

/// The automatic reports on record.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MadeReports {
    /// The last event of each, the newest period first.
    pub reports: Vec<ReportRecord>,
    /// The first and last instant stored: reports are made from the first one on.
    pub extent: Option<(Timestamp, Timestamp)>,
    /// The machine on which their files lie.
    pub host: String,
}

/// What is stored, and where.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Overview {
    /// The database.
    pub database: PathBuf,
    /// Its bytes, with its log.
    pub database_bytes: u64,
    /// Samples in it: those that are not archived yet.
    pub samples: u64,
    /// The first of them.
    pub oldest: Option<Timestamp>,
    /// The first and last instant stored, in the database or in the archive.
    pub extent: Option<(Timestamp, Timestamp)>,
    /// When no station recorded between the first and the last record, the latest [`PAUSES_MAX`](recorded::PAUSES_MAX) of these times.
    pub pauses: Vec<(Timestamp, Timestamp)>,
    /// The folder of the archive.
    pub folder: PathBuf,
    /// The disk that it lies on; `None` where it is unknown.
    pub disk: Option<Disk>,
    /// What is kept, and for how long.
    pub rule: HistoryDef,
    /// Until when samples were deleted.
    pub deleted_until: Option<Timestamp>,
    /// What is deleted next, and when.
    pub next_deletion: Option<Deletion>,
    /// What was imported.
    pub imports: Vec<Import>,
    /// Its files, oldest first.
    pub files: Vec<ArchiveFile>,
}

/// A file of the archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArchiveFile {
    /// How finely.
    pub tier: Tier,
    /// Below the folder of the archive.
    pub path: String,
    /// From, inclusive; microseconds since 1970.
    pub from: i64,
    /// To, exclusive.
    pub to: i64,
    /// Its rows.
    pub rows: u64,
    /// Its bytes.
    pub bytes: u64,
    /// SHA-256 of them, in hexadecimal.
    pub sha256: String,
    /// It has numbers of more digits than a DOUBLE holds, and columns for what these lack.
    pub rests: bool,
}

/// What can go wrong with the store.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum HistoryError {
    /// Another process has the file.
    #[error("history {path} is in use by {by}")]
    Locked {
        /// The file.
        path: String,
        /// `process 1234 (sightglass)`.
        by: String,
    },
    /// The engine failed; in its own words, of which an operator reads only [`words::plain`].
    #[error("history: {}", words::plain(.0))]
    Engine(String),
    /// The file is something else: it is left alone.
    #[error("{path} is not a history and is not changed: use another name, preferably one that ends in .duckdb")]
    Foreign {
        /// The file.
        path: String,
    },
    /// There is nothing to read: no station has written here.
    #[error("no history at {path}: did the station of this plant ever run here?")]
    Missing {
        /// The file.
        path: String,
    },
    /// The answer would be longer than is safe to hold; a shorter period is answered.
    #[error("too much for one query: {}", bound::too_many_rows(*.rows, *.max, *.asked))]
    TooManyRows {
        /// Rows that the query means.
        rows: u64,
        /// Rows that are permitted.
        max: u64,
        /// Seconds of the period that they lie in, where they lie evenly.
        asked: Option<u64>,
    },
    /// Another version of the program wrote the file; only a station, which may change it, upgrades an older one.
    #[error(
        "the history {path} was written by {} version of sightglass (schema {found}, this one reads {expected}): {}",
        if found < expected { "an older" } else { "a newer" },
        if found < expected {
            format!("start the station once to upgrade it, `sightglass run PLANT --history {path}`")
        } else {
            "use that version".to_owned()
        }
    )]
    OtherSchema {
        /// The file.
        path: String,
        /// The version of its schema.
        found: u32,
        /// That of this program.
        expected: u32,
    },
    /// Samples of an instant were not stored, or are deleted.
    #[error("no samples of {at:.0}: those that are kept begin at {first:.0} and end at {last:.0}")]
    NotKept {
        /// The instant.
        at: Timestamp,
        /// Where they begin.
        first: Timestamp,
        /// Where they end.
        last: Timestamp,
    },
    /// SQL that cannot be answered, in the words of the engine.
    #[error("{0}")]
    Sql(String),
    /// The query makes no sense: empty or negative span.
    #[error("empty period")]
    EmptyPeriod,
    /// No store is open: not yet, not any more, or none could be opened.
    #[error("the history is not open")]
    NotOpen,
    /// What was asked cannot be done as things are, and why.
    #[error("{0}")]
    Refused(String),
    /// The answer was not ready in the time that a query may take.
    #[error("no result within {seconds} s; choose a shorter period")]
    TooLong {
        /// That time.
        seconds: u64,
    },
}

impl HistoryError {
    /// The same where it is already said that it is about the history: `in use by process 1234 (sightglass)`.
    pub fn words(&self) -> String {
        match self {
            HistoryError::Locked { by, .. } => format!("in use by {by}"),
            HistoryError::Engine(message) => words::plain(message),
            HistoryError::Foreign { .. }
            | HistoryError::Missing { .. }
            | HistoryError::TooManyRows { .. }
            | HistoryError::OtherSchema { .. }
            | HistoryError::NotKept { .. }
            | HistoryError::Sql(_)
            | HistoryError::EmptyPeriod
            | HistoryError::NotOpen
            | HistoryError::Refused(_)
            | HistoryError::TooLong { .. } => self.to_string(),
        }
    }
}
