//! The edge of the history: DuckDB, its files, the thread that writes and the one that answers queries.

use std::path::PathBuf;

use tokio::sync::oneshot;

use super::{Answer, HistoryError, Query, backup::BackupSource};

/// A query on its way to the history, with the place for its answer.
/// A dropped answer means: the store has gone.
#[derive(Debug)]
pub struct QueryRequest {
    /// What is asked.
    pub query: Query,
    /// Where the answer goes.
    pub reply: oneshot::Sender<Result<Answer, HistoryError>>,
}

/// What a running station is asked to do with its history as a whole.
#[derive(Debug)]
pub enum HistoryJob {
    /// Write a backup.
    Backup {
        /// The folder that it goes to.
        to: PathBuf,
        /// The other files that are part of it.
        companions: Vec<BackupSource>,
    },
    /// Fill gaps with the samples of a CSV file.
    Import {
        /// The file.
        file: PathBuf,
    },
}

/// A job on its way to the history, with the place for its outcome: what was done, in a sentence.
/// A dropped outcome means: the store has gone.
#[derive(Debug)]
pub struct JobRequest {
    /// The job.
    pub job: HistoryJob,
    /// Where the outcome goes.
    pub reply: oneshot::Sender<Result<String, HistoryError>>,
}

pub mod alarm_file;
pub mod disk;
pub mod sql;
pub mod files;
pub mod last;
pub mod interrupt;
pub mod store;
mod stored;
pub mod open;
mod blocks;
mod mend;
pub mod probe;
mod room;
pub mod read;
pub mod past;
pub mod samples;
mod recorded;
mod walk;
pub mod tables;
pub mod archive;
pub mod archiver;
pub mod aggregates;
mod counts;
mod copy;
pub mod backup;
pub mod restore;
pub mod reunite;
pub mod import;
pub mod compact;
mod gather;
pub mod report;
mod reports;
pub mod alarm_metrics;
pub mod batches;
mod runs;
pub mod chain;
pub mod writer;
pub mod reader;
pub mod thread;
#[cfg(test)]
mod tests;
