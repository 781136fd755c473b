//! What a report is made of where samples are not kept any more.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// A time of which samples are not kept any more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coarse {
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub to: Timestamp,
    /// What its figures are made of: minutes, hours, nothing.
    pub kept: Kept,
}

/// What is kept of a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kept {
    /// A row for each minute.
    Minutes,
    /// A row for each hour.
    Hours,
    /// None of it.
    Nothing,
}
