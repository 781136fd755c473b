//! The record of automatic reports.

use duckdb::{Appender, Row, params};

use super::{
    read::{ROWS_MAX, maybe_shared, maybe_time, shared, time},
    store::{Store, utc},
};
use crate::{
    history::{HistoryError, MadeReports},
    plant::{
        keyword::Keyword,
        report::{PeriodKind, ReportEvent, ReportRecord},
    },
};

/// The last event of each report, the newest period first. With a window by `rowid` and a small limit, DuckDB 1.5 fails by an
/// internal error, after which the file must be opened again.
const REPORTS: &str =
    "SELECT utc, period, name, from_utc, to_utc, format, file, sha256, event, attempts, error FROM report
    WHERE rowid IN (SELECT max(rowid) FROM report GROUP BY period, from_utc, format)
    ORDER BY to_utc DESC, from_utc, format LIMIT ?";

impl Store {
    /// The automatic reports on record, at most so many.
    pub fn made_reports(&self, limit: usize) -> Result<MadeReports, HistoryError> {
        let reports = self.list(REPORTS, params![(limit as u64).min(ROWS_MAX)], report)?;
        // A clone of the store does not follow what others commit.
        self.read_last_commit().map_err(super::store::engine)?;
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default().trim().to_owned();
        Ok(MadeReports { reports, extent: self.extent(), host })
    }
}

pub(super) fn append_report(to: &mut Appender, report: &ReportRecord, epoch: u16) -> duckdb::Result<()> {
    let ReportRecord { at, period, name, from, to: end, format, file, sha256, event, attempts, error } = report;
    let [at, from, end] = [at, from, end].map(|at| utc(*at));
    let (period, event) = (period.word(), event.word());
    to.append_row(params![at, period, name, from, end, format, file, sha256, event, attempts, error, epoch])
}

fn report(row: &Row) -> duckdb::Result<ReportRecord> {
    let instant = |column| maybe_time(row, column)?.ok_or(duckdb::Error::InvalidQuery);
    Ok(ReportRecord {
        at: time(row)?,
        period: PeriodKind::from_word(&row.get::<_, String>(1)?).ok_or(duckdb::Error::InvalidQuery)?,
        name: shared(row, 2)?,
        from: instant(3)?,
        to: instant(4)?,
        format: shared(row, 5)?,
        file: shared(row, 6)?,
        sha256: shared(row, 7)?,
        event: ReportEvent::from_word(&row.get::<_, String>(8)?).ok_or(duckdb::Error::InvalidQuery)?,
        attempts: row.get(9)?,
        error: maybe_shared(row, 10)?,
    })
}
