//! The record of automatic reports.

use duckdb::params;

use super::{
    read::ROWS_MAX,
    store::{Store, engine},
    stored::Stored,
};
use crate::{
    history::{HistoryError, MadeReports},
    plant::report::ReportRecord,
};

/// The last event of each report, the newest period first. With a window by `rowid` and a small limit, DuckDB 1.5 fails by an
/// internal error, after which the file must be opened again.
fn reports() -> String {
    format!(
        "SELECT {} FROM report WHERE rowid IN (SELECT max(rowid) FROM report GROUP BY period, from_utc, format)
         ORDER BY to_utc DESC, from_utc, format LIMIT ?",
        ReportRecord::columns()
    )
}

impl Store {
    /// The automatic reports on record, up to a limit.
    pub fn made_reports(&self, limit: usize) -> Result<MadeReports, HistoryError> {
        let reports = self.list(&reports(), params![(limit as u64).min(ROWS_MAX)], ReportRecord::read)?;
        // A clone of the store does not follow what others commit.
        self.read_last_commit().map_err(engine)?;
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned();
        Ok(MadeReports { reports, extent: self.extent(), host })
    }
}
