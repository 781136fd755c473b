//! The edge of the history: DuckDB, its files, the thread that writes and the one that answers questions.

use tokio::sync::oneshot;

use super::{Answer, HistoryError, Question};

/// A question on its way to the history, with the place for its answer.
/// A dropped answer means: the store has gone.
#[derive(Debug)]
pub struct Query {
    /// What is asked.
    pub question: Question,
    /// Where the answer goes.
    pub reply: oneshot::Sender<Result<Answer, HistoryError>>,
}

pub mod alarm_file;
pub mod sql;
pub mod files;
pub mod last;
pub mod store;
pub mod open;
pub mod read;
pub mod samples;
pub mod report;
pub mod quality;
pub mod seals;
pub mod writer;
pub mod reader;
pub mod thread;
#[cfg(test)]
mod tests;
