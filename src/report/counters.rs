//! What counters did beside counting, as it stands in a report.

use serde::{Deserialize, Serialize};

use crate::plant::counter::CounterStep;

/// A step of a counter that is not plain counting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CounterRow {
    /// `PM-1.E`.
    pub tag: String,
    /// `kWh`.
    pub unit: String,
    /// Decimals to print.
    pub decimals: u8,
    /// The step.
    pub step: CounterStep,
    /// Of a correction: who made it, and why.
    pub note: String,
}
