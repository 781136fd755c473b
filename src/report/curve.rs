//! A curve reduced to columns: of the trends, and of the charts of a report.

use std::time::Duration;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use crate::plant::{def::TagId, exact::Exact};

/// A curve reduced to columns of equal width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Which tag.
    pub tag: TagId,
    /// Start of the first column.
    pub from: Timestamp,
    /// Width of a column.
    pub step: Duration,
    /// The columns; `None` where there was no good value: a gap is a gap.
    pub buckets: Vec<Option<Bucket>>,
    /// Of the whole span: (min, time-weighted mean, max) of good values.
    pub summary: Option<(Exact, Exact, Exact)>,
    /// What a counter counted from the value at the begin of the span to that at its end, where only one column was asked.
    pub counted: Option<Exact>,
    /// Share of the span with a good value, 0–1.
    pub good: f64,
}

/// One column of a curve: good values only.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bucket {
    /// Least.
    pub min: f64,
    /// Greatest.
    pub max: f64,
    /// Time-weighted mean.
    pub mean: f64,
    /// The value at the end of the column.
    pub last: Exact,
}
