//! A closed day or month in one file instead of many.
//!
//! Samples stay hour by hour, each hour by tag: an instant of all tags lies close together. Minutes and hours lie by tag, so
//! that a trend reads few blocks of a day.

use std::ops::Range;

use super::{NewFile, any_rests, table};
use crate::history::{
    ArchiveFile, HistoryError,
    io::{
        sql,
        store::{Store, engine},
    },
    tiers::{HOUR, Tier, floor},
};

/// Rows that are sorted at once.
const SORTED_AT_ONCE: u64 = 250_000;

impl Store {
    /// Merges the files of a tier in a span. Samples follow each other as they are, so that nothing must be sorted that is
    /// larger than an hour; an hour of which there are two files is sorted again.
    pub(super) fn merge_files(&self, tier: Tier, span: Range<i64>) -> Result<(), HistoryError> {
        let mut old = self.files(Some((tier, span.clone())))?;
        old.retain(|file| span.start <= file.from && file.to <= span.end);
        let rests = any_rests(&old);
        let apart = old.windows(2).all(|pair| pair[0].to <= pair[1].from);
        let rows = match tier {
            Tier::Minute | Tier::Hour => self.sorted((tier, rests), &self.one_after_the_other((tier, rests), &old))?,
            Tier::Raw if apart => self.one_after_the_other((tier, rests), &old),
            Tier::Raw => self.hour_by_hour(&old, &span, rests),
        };
        let new = self.write_file((tier, rests), span, &rows, "")?;
        let new: Vec<ArchiveFile> = new.map(NewFile::rename).transpose()?.into_iter().collect();
        self.enter(&new, &old, || Ok(()))?;
        self.remove_files(&old);
        Ok(())
    }

    fn one_after_the_other(&self, (tier, rests): (Tier, bool), files: &[ArchiveFile]) -> String {
        format!("SELECT {} FROM {}", sql::columns(tier, rests), self.parquet(files, rests))
    }

    fn hour_by_hour(&self, files: &[ArchiveFile], span: &Range<i64>, rests: bool) -> String {
        let first = files.iter().map(|file| file.from).min().map_or(span.start, |from| floor(from, HOUR));
        let hours =
            (first..span.end).step_by(usize::try_from(HOUR).unwrap_or(usize::MAX)).map(|hour| hour..hour + HOUR);
        let of = |hour: Range<i64>| {
            let files: Vec<ArchiveFile> =
                files.iter().filter(|file| file.from < hour.end && hour.start < file.to).cloned().collect();
            (!files.is_empty()).then(|| sql::hour_of(&self.parquet(&files, rests), &hour, rests))
        };
        hours.filter_map(of).collect::<Vec<_>>().join(" UNION ALL ")
    }

    /// Rows of aggregates by tag and time, as a query: sorted part by part, because the engine has not the memory for all.
    pub(super) fn sorted(&self, (tier, rests): (Tier, bool), rows: &str) -> Result<String, HistoryError> {
        let columns = sql::columns(tier, rests);
        let count = format!("SELECT count(*), min(tag), max(tag) FROM ({rows})");
        let row = |row: &duckdb::Row| {
            Ok((row.get::<_, u64>(0)?, row.get::<_, Option<u64>>(1)?, row.get::<_, Option<u64>>(2)?))
        };
        let (count, first, last) = self.db.query_row(&count, [], row).map_err(engine)?;
        let (first, last) = (first.unwrap_or(0), last.unwrap_or(0));
        let step = ((last - first + 1) / count.div_ceil(SORTED_AT_ONCE).max(1)).max(1);
        self.db
            .execute_batch(&format!("CREATE OR REPLACE TEMP TABLE sorted AS SELECT {columns} FROM ({rows}) LIMIT 0"))
            .map_err(engine)?;
        let mut from = first;
        while from <= last {
            let to = from + step;
            let part = format!(
                "INSERT INTO sorted SELECT {columns} FROM ({rows}) WHERE tag >= {from} AND tag < {to} ORDER BY tag, utc"
            );
            self.db.execute_batch(&part).map_err(engine)?;
            from = to;
        }
        Ok(format!("SELECT {columns} FROM sorted"))
    }

    /// Files as a table in SQL, see [`table`].
    pub(in crate::history::io) fn parquet(&self, files: &[ArchiveFile], rests: bool) -> String {
        table(&self.archive_folder(), files, rests)
    }
}
