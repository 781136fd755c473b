//! A minute of a line in figures: what it counted, so that one that goes bad slowly shows as a trend.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// What a line counted in one minute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineMinute {
    /// The end of the minute.
    pub at: Timestamp,
    /// The line by name: the history outlives the plant file.
    pub line: Arc<str>,
    pub requests: u64,
    /// Valid normal answers.
    pub ok: u64,
    pub timeouts: u64,
    pub corrupt: u64,
    pub exceptions: u64,
    pub retries: u64,
    /// Answers to requests that had been given up.
    pub late: u64,
    /// Polls that were left out.
    pub missed: u64,
    pub sent_bytes: u64,
    pub received_bytes: u64,
    /// Share of the minute in which the line was busy, 0–1.
    pub utilisation: f32,
    /// 99 of 100 answers began within this time, ms; `None` without an answer.
    pub reply_p99_ms: Option<f32>,
    /// The slowest, ms (to about a fifth).
    pub reply_max_ms: Option<f32>,
}

impl LineMinute {
    /// Share of the requests that failed, 0–1; `None` if nothing was asked.
    pub fn failed(&self) -> Option<f64> {
        let failed = self.timeouts + self.corrupt + self.exceptions;
        (0 < self.requests).then(|| failed as f64 / self.requests as f64)
    }
}
