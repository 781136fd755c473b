//! Diagnostics of a line: how far a test has come, and what was found.

mod conclusion;
mod finding;
mod outcome;

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

pub use super::diagnostic_request::{Diagnostic, PATTERNS_MAX, RegisterWrite, Scan};
use super::{id::CommandId, line_trouble::LineTrouble};

pub use conclusion::{Conclusion, PatternTally, SweepEnd};
pub use finding::{DiagnosticStep, Finding, UnitReply};

/// Findings that a run keeps at most.
pub const FINDINGS_MAX: usize = 1_000;

/// A running diagnostic, or done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticRun {
    /// The command it came by.
    pub id: CommandId,
    /// Who requested it.
    pub by: Arc<str>,
    /// What.
    pub diagnostic: Diagnostic,
    /// When it began.
    pub started: Timestamp,
    /// Steps done.
    pub done: u32,
    /// Steps in all.
    pub total: u32,
    /// Requests made so far.
    pub requests: u32,
    /// Of these, those without the response that they were made for.
    pub errors: u32,
    /// What it asks now.
    pub now: Option<DiagnosticStep>,
    /// How it stands.
    pub state: DiagnosticState,
    /// What was found, in order; at most [`FINDINGS_MAX`].
    pub findings: Vec<Finding>,
}

/// How a diagnostic stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum DiagnosticState {
    /// At work.
    Running,
    /// All steps are done.
    Done,
    /// Stopped by an operator.
    Cancelled,
    /// The line went away, or would not open.
    Failed(LineTrouble),
}
