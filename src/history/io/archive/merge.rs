//! A closed day or month in one file instead of many.

use std::ops::Range;

use super::{Steps, Written};
use crate::history::{
    ArchiveFile, HistoryError,
    io::{sql, store::Store},
    tiers::{HOUR, Tier, floor},
};

impl Store {
    /// Merges the files of a tier in a span. They follow each other as they are, so that nothing must be sorted that is
    /// larger than an hour; an hour of which there are two files is sorted again.
    pub(super) fn merge_files(&self, tier: Tier, span: Range<i64>, steps: Steps) -> Result<(), HistoryError> {
        let mut old = self.files(Some((tier, span.clone())))?;
        old.retain(|file| span.start <= file.from && file.to <= span.end);
        let apart = old.windows(2).all(|pair| pair[0].to <= pair[1].from);
        let rows = if apart { self.one_after_the_other(tier, &old) } else { self.hour_by_hour(tier, &old, &span) };
        let new = self.write_file(tier, span, &rows, "")?;
        steps("merged file written")?;
        let new: Vec<ArchiveFile> = new.map(Written::rename).transpose()?.into_iter().collect();
        steps("merged file renamed")?;
        self.enter(&new, &old, || Ok(()))?;
        steps("merged file entered")?;
        self.remove_files(&old);
        Ok(())
    }

    fn one_after_the_other(&self, tier: Tier, files: &[ArchiveFile]) -> String {
        format!("SELECT {} FROM {}", sql::columns(tier), self.parquet(files))
    }

    fn hour_by_hour(&self, tier: Tier, files: &[ArchiveFile], span: &Range<i64>) -> String {
        let first = files.iter().map(|file| file.from).min().map_or(span.start, |from| floor(from, HOUR));
        let hours =
            (first..span.end).step_by(usize::try_from(HOUR).unwrap_or(usize::MAX)).map(|hour| hour..hour + HOUR);
        let of = |hour: Range<i64>| {
            let files: Vec<ArchiveFile> =
                files.iter().filter(|file| file.from < hour.end && hour.start < file.to).cloned().collect();
            (!files.is_empty()).then(|| sql::hour_of(tier, &self.parquet(&files), &hour))
        };
        hours.filter_map(of).collect::<Vec<_>>().join(" UNION ALL ")
    }

    /// Files as a table in SQL.
    pub(in crate::history::io) fn parquet(&self, files: &[ArchiveFile]) -> String {
        let folder = self.archive_folder();
        let paths: Vec<String> = files.iter().map(|file| super::quoted(&folder.join(&file.path))).collect();
        format!("read_parquet([{}])", paths.join(", "))
    }
}
