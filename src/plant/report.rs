//! Automatic reports: what the plant file asks for, and the record of each that was made.

use std::{path::PathBuf, sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// The kinds of periods that follow each other without a gap.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum PeriodKind: "period" {
        /// A shift of the plant.
        Shift => "shift",
        /// A local day.
        Day => "day",
        /// A week from Monday to Sunday (ISO 8601).
        Week => "week",
        /// A month of the calendar.
        Month => "month",
    }
}

/// The formats of reports, by name. A test holds that they are those of `report::FORMATS`.
pub const REPORT_FORMATS: [&str; 9] = ["csv", "record", "text", "html", "json", "xlsx", "docx", "pdf", "parquet"];

/// What stands in braces in an argument of [`AutomaticReport::after`].
pub const PLACEHOLDERS: [&str; 6] = ["file", "name", "period", "format", "sha256", "plant"];

/// A `[[report.automatic]]` of the plant file: reports that the station makes at the end of each period.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AutomaticReport {
    /// Of which periods.
    pub period: PeriodKind,
    /// In which formats, a file each.
    pub formats: Vec<String>,
    /// The folder of the files, instead of that of all reports.
    pub folder: Option<PathBuf>,
    /// Files are deleted so long after the end of their period; `None` keeps them.
    pub keep: Option<Duration>,
    /// A command that runs after each file, without a shell; empty for none.
    pub after: Vec<String>,
}

/// What identifies an automatic report: kind and start of its period, and its format.
pub type ReportKey = (PeriodKind, Timestamp, Arc<str>);

/// An event of an automatic report. The last one of a report is its state.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReportRecord {
    /// When.
    pub at: Timestamp,
    /// Of what kind its period is.
    pub period: PeriodKind,
    /// The name of the period: `morning 2026-11-21`, `2026-W47`.
    pub name: Arc<str>,
    /// From, inclusive.
    pub from: Timestamp,
    /// To, exclusive.
    pub to: Timestamp,
    /// The name of its format.
    pub format: Arc<str>,
    /// The path of its file.
    pub file: Arc<str>,
    /// SHA-256 of the file in hexadecimal; empty for a report that was not made.
    pub sha256: Arc<str>,
    /// What happened.
    pub event: ReportEvent,
    /// Runs of the command by now.
    pub attempts: u32,
    /// Why it was not made or delivered.
    pub error: Option<Arc<str>>,
}

impl ReportRecord {
    /// What identifies the report.
    pub fn key(&self) -> ReportKey {
        (self.period, self.from, self.format.clone())
    }

    /// A further event of the same report; it has no error.
    pub fn then(&self, at: Timestamp, event: ReportEvent) -> ReportRecord {
        ReportRecord { at, event, error: None, ..self.clone() }
    }
}

keyword_enum! {
    /// What happens to an automatic report. The words are what the history holds.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum ReportEvent: "report event" {
        /// Its file was written.
        Made => "made",
        /// It cannot be made, and is not tried again.
        NotMade => "not made",
        /// The command ran after it without an error.
        Delivered => "delivered",
        /// The command failed.
        DeliveryFailed => "delivery failed",
        /// Its file was kept for as long as the plant file says, then deleted.
        Deleted => "deleted",
        /// Its time is over, but the file was changed or is gone: it is left as it is.
        LeftAlone => "changed, not deleted",
    }
}
