//! The archive: closed hours of samples as Parquet files beside the database, with their minutes and hours as aggregates;
//! closed days and months merged into one file each. Any engine reads them.
//!
//! ```text
//!   tank.duckdb                                    the last hours, the journals, and the manifest: `archive`
//!   tank.archive/tag.parquet                       names and units of the numbers in `tag`
//!               /raw/date=2026-11-23/13.parquet    samples of an hour; of a closed day: day.parquet
//!               /m1/date=2026-11-23/13.parquet     minutes; likewise
//!               /h1/date=2026-11-23/13.parquet     hours; of a closed month: h1/month=2026-11/month.parquet
//! ```
//!
//! A file is written under another name, read back and compared, synced and renamed; then one transaction enters it in the
//! manifest and deletes what it replaces. Only files of the manifest are read. Whatever kills the program in between: at the
//! next start a file that the manifest does not know is either whole and covers what it lacks, or is removed.

mod adopt;
mod delete;
mod hour;
mod merge;

use std::{
    fs,
    ops::Range,
    path::{Path, PathBuf},
    time::Duration,
};

use duckdb::{Row, params};
use jiff::{Timestamp, tz::TimeZone};
use sha2::{Digest, Sha256};

use super::{
    disk, files, sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::{
        ArchiveFile, HistoryError, Overview,
        retention::Deletion,
        tiers::{HOUR, Tier, floor},
    },
    profile::io::{atomic::with_suffix, regular},
};

/// An hour is archived so long after its end: what a line sends late is in it by then.
const GRACE: Duration = Duration::from_secs(5 * 60);

/// What the name of a file ends with until it is whole.
const UNFINISHED: &str = ".new";
/// The dictionary of tags.
pub(super) const TAGS: &str = "tag.parquet";

/// What is to be done next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Job {
    /// Delete a file, by the rules of the plant.
    Delete(Box<Deletion>),
    /// Archive the samples of the hour that begins then.
    Hour(i64),
    /// Merge the files of a tier in a closed day or month into one.
    Merge(Tier, Range<i64>),
}

/// What could not be archived, and is left as it is for now: later jobs do not wait for it.
#[derive(Debug, Clone, Default)]
pub struct LeftOut {
    /// Hours before it.
    pub before: Option<Timestamp>,
    /// Merges.
    pub merges: Vec<(Tier, Range<i64>)>,
}

/// A step of a job, for tests that end the program there.
pub type Steps<'a> = &'a mut dyn FnMut(&'static str) -> Result<(), HistoryError>;

impl Store {
    /// Does a job.
    pub fn archive(&self, job: &Job) -> Result<(), HistoryError> {
        match job {
            Job::Delete(deletion) => self.delete(deletion),
            Job::Hour(hour) => self.archive_hour(*hour),
            Job::Merge(tier, span) => self.merge_files(*tier, span.clone()),
        }
    }

    /// What is due in the archive, the oldest first; without what is left out. Room is made before it is needed.
    pub fn archive_due(&self, now: Timestamp, left: &LeftOut) -> Result<Option<Job>, HistoryError> {
        let files = self.files(None)?;
        if let Some(deletion) = self.next_deletion(&files, now).filter(|next| next.at <= now.as_microsecond()) {
            return Ok(Some(Job::Delete(Box::new(deletion))));
        }
        let closed = now.checked_sub(GRACE).unwrap_or(now).as_microsecond();
        let after = left.before.unwrap_or(Timestamp::MIN);
        let oldest: Option<i64> =
            self.db.query_row(sql::OLDEST_SAMPLE, params![utc(after)], |row| row.get(0)).map_err(engine)?;
        let oldest = oldest.map_or(i64::MAX, |oldest| floor(oldest, HOUR));
        // An hour that is not over yet never has older ones behind it that are.
        if oldest.saturating_add(HOUR) <= closed {
            return Ok(Some(Job::Hour(oldest)));
        }
        Ok(next_merge(&files, closed.min(oldest), &left.merges))
    }

    /// The files of the archive that touch a span, or all of them; oldest first.
    pub fn files(&self, span: Option<(Tier, Range<i64>)>) -> Result<Vec<ArchiveFile>, HistoryError> {
        let all = self.list(sql::FILES, &[], file)?;
        Ok(match span {
            None => all,
            Some((tier, span)) => overlapping(&all, &span).into_iter().filter(|file| file.tier == tier).collect(),
        })
    }

    /// Whether the manifest names a file: what it does not name any more was replaced by another.
    pub(super) fn is_known(&self, file: &ArchiveFile) -> Result<bool, HistoryError> {
        Ok(self.files(None)?.contains(file))
    }

    /// What is stored, and where.
    pub(super) fn overview(&self, now: Timestamp) -> Result<Overview, HistoryError> {
        // Of a connection that was cloned before the last commit.
        self.read_last_commit().map_err(engine)?;
        let files = self.files(None)?;
        Ok(Overview {
            database: self.path.clone(),
            database_bytes: self.file_bytes(),
            samples: self.db.query_row(sql::COUNT_SAMPLES, [], |row| row.get(0)).map_err(engine)?,
            oldest: self.oldest_in_table()?.and_then(instant),
            extent: self.extent(),
            pauses: self.pauses_in_all(now)?,
            folder: self.archive_folder(),
            disk: files::disk(&self.path),
            rule: self.def.history,
            deleted_until: self.deleted_until(Tier::Raw)?,
            next_deletion: self.next_deletion(&files, now),
            imports: self.imports()?,
            files,
        })
    }

    /// Where the archive lies.
    pub fn archive_folder(&self) -> PathBuf {
        folder(&self.path)
    }

    /// Enters new files in the manifest, and removes others from it, in one transaction with `work`.
    fn enter(
        &self,
        new: &[ArchiveFile],
        old: &[ArchiveFile],
        work: impl FnOnce() -> duckdb::Result<()>,
    ) -> Result<(), HistoryError> {
        let entered = self.transaction(|| {
            for file in old {
                self.db.execute(sql::REMOVE_FILE, params![file.path])?;
            }
            new.iter().try_for_each(|file| self.enter_file(file))?;
            work()
        });
        if entered.is_err() {
            self.remove_files(new);
        }
        entered
    }

    fn enter_file(&self, file: &ArchiveFile) -> duckdb::Result<()> {
        let ArchiveFile { tier, path, from, to, rows, bytes, sha256, rests } = file;
        let [from, to] = [*from, *to].map(|at| instant(at).map(utc));
        self.db.execute(sql::ENTER_FILE, params![tier.word(), path, from, to, rows, bytes, sha256, rests]).map(drop)
    }

    /// Writes rows as a new file of the archive, in this order, with or without what their numbers lack; it is not in the
    /// manifest yet. `None` if there are none.
    fn write_file(
        &self,
        (tier, rests): (Tier, bool),
        span: Range<i64>,
        rows: &str,
        order: &str,
    ) -> Result<Option<NewFile>, HistoryError> {
        let folder = self.archive_folder();
        let path = free_path(&folder, tier, &span);
        let (last, new) = (folder.join(&path), folder.join(format!("{path}{UNFINISHED}")));
        disk::step("make the folder")
            .and_then(|()| fs::create_dir_all(last.parent().unwrap_or(&folder)))
            .and_then(|()| disk::step("write the file"))
            .map_err(|error| wrong(&new, &error))?;
        let to = quoted(&new);
        let copy = sql::copy_to(tier, self.def.history.parquet, &format!("{rows} {order}"), &to);
        self.db.execute_batch(&copy).map_err(engine)?;
        let sum = |from: &str| {
            let sql = format!("SELECT count(*), sum(hash({}))::VARCHAR FROM {from}", sql::columns(tier, rests));
            self.db.query_row(&sql, [], |row| Ok((row.get::<_, u64>(0)?, row.get::<_, Option<String>>(1)?)))
        };
        let meant = sum(&format!("({rows})")).map_err(engine)?;
        let written = sum(&format!("read_parquet({to})")).map_err(engine)?;
        if written != meant {
            return Err(HistoryError::Engine(format!("{path} does not hold what was written to it")));
        }
        if written.0 == 0 {
            disk::remove(&new).map_err(|error| wrong(&new, &error))?;
            return Ok(None);
        }
        let (bytes, sha256) = sync_and_hash(&new).map_err(|error| wrong(&new, &error))?;
        let Range { start: from, end: to } = span;
        Ok(Some(NewFile {
            file: ArchiveFile { tier, path, from, to, rows: written.0, bytes, sha256, rests },
            new,
            last,
        }))
    }

    /// Removes files that the manifest does not name any more. One that stays is removed at the next start.
    fn remove_files(&self, files: &[ArchiveFile]) {
        for file in files {
            if let Err(error) = disk::remove(&self.archive_folder().join(&file.path)) {
                tracing::warn!(%error, path = file.path, "a file of the archive that was replaced is not removed");
            }
            self.archive_folder().join(&file.path).parent().map(disk::remove_empty);
        }
    }

    /// Writes the names and units of tags beside the files that have only their numbers.
    fn write_tags(&self) -> Result<(), HistoryError> {
        let path = self.archive_folder().join(TAGS);
        let new = with_suffix(&path, UNFINISHED);
        let copy = format!(
            "COPY (FROM tag ORDER BY id) TO {} ({})",
            quoted(&new),
            sql::parquet(Tier::Raw, self.def.history.parquet)
        );
        disk::step("write the tags").map_err(|error| wrong(&new, &error))?;
        self.db.execute_batch(&copy).map_err(engine)?;
        sync_and_hash(&new).and_then(|_| disk::rename(&new, &path)).map_err(|error| wrong(&path, &error))
    }
}

/// A file that is whole, under the name that it has until it is renamed.
struct NewFile {
    file: ArchiveFile,
    new: PathBuf,
    last: PathBuf,
}

impl NewFile {
    fn rename(self) -> Result<ArchiveFile, HistoryError> {
        disk::rename(&self.new, &self.last).map_err(|error| wrong(&self.last, &error))?;
        Ok(self.file)
    }
}

/// The day or month of a tier that is over and lies in more than one file; the oldest that is not left out.
fn next_merge(files: &[ArchiveFile], closed: i64, left: &[(Tier, Range<i64>)]) -> Option<Job> {
    let of = |tier: Tier, period: fn(i64) -> Range<i64>| {
        let within =
            |file: &ArchiveFile| Some(period(file.from)).filter(|span| file.to <= span.end && span.end <= closed);
        let spans: Vec<Range<i64>> = files.iter().filter(|file| file.tier == tier).filter_map(within).collect();
        // Sorted by their beginning, as the files are.
        let several = spans.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| (tier, pair[0].clone()));
        several.into_iter().find(|merge| !left.contains(merge)).map(|(tier, span)| Job::Merge(tier, span))
    };
    let days = Tier::ALL.into_iter().find_map(|tier| of(tier, day));
    days.or_else(|| of(Tier::Hour, month))
}

/// The day in UTC that holds an instant.
fn day(at: i64) -> Range<i64> {
    let start = floor(at, 24 * HOUR);
    start..start + 24 * HOUR
}

/// The month in UTC that holds an instant.
fn month(at: i64) -> Range<i64> {
    let month = || {
        let first = instant(at)?.to_zoned(TimeZone::UTC).first_of_month().ok()?.start_of_day().ok()?;
        let next = first.checked_add(jiff::Span::new().months(1)).ok()?;
        Some(first.timestamp().as_microsecond()..next.timestamp().as_microsecond())
    };
    month().unwrap_or_else(|| day(at))
}

/// A path below the folder that no file has: `raw/date=2026-11-23/13.parquet`, for a second one `13-2.parquet`.
fn free_path(folder: &Path, tier: Tier, span: &Range<i64>) -> String {
    let start = instant(span.start).unwrap_or(Timestamp::MIN).to_zoned(TimeZone::UTC);
    let (parent, name) = match span.end - span.start {
        HOUR => ("date=%Y-%m-%d", start.strftime("%H").to_string()),
        length if length == 24 * HOUR => ("date=%Y-%m-%d", "day".to_owned()),
        _ => ("month=%Y-%m", "month".to_owned()),
    };
    let parent = format!("{}/{}", tier.word(), start.strftime(parent));
    let path = |number: u32| match number {
        1 => format!("{parent}/{name}.parquet"),
        number => format!("{parent}/{name}-{number}.parquet"),
    };
    (1..).map(path).find(|path| !folder.join(path).exists()).expect("some number is free")
}

fn file(row: &Row) -> duckdb::Result<ArchiveFile> {
    let word: String = row.get(0)?;
    let tier = Tier::from_word(&word).ok_or(duckdb::Error::InvalidQuery)?;
    let (path, from, to, rests) = (row.get(1)?, row.get(2)?, row.get(3)?, row.get(7)?);
    Ok(ArchiveFile { tier, path, from, to, rows: row.get(4)?, bytes: row.get(5)?, sha256: row.get(6)?, rests })
}

/// The files that touch a span.
pub(super) fn overlapping(files: &[ArchiveFile], span: &Range<i64>) -> Vec<ArchiveFile> {
    files.iter().filter(|file| file.from < span.end && span.start < file.to).cloned().collect()
}

/// The folder of the archive of a database.
pub(super) fn folder(db: &Path) -> PathBuf {
    db.with_extension("archive")
}

/// Files of a tier as a table in SQL, with or without what their numbers lack: NULL for a file that has no such columns.
pub(super) fn table(folder: &Path, files: &[ArchiveFile], rests: bool) -> String {
    let list = |files: &[ArchiveFile]| format!("read_parquet([{}], hive_partitioning = false)", paths(folder, files));
    if files.iter().all(|file| file.rests == rests) {
        return list(files);
    }
    let alike = |alike: &[ArchiveFile]| match (rests, alike[0].rests) {
        (true, false) => format!("SELECT {} FROM {}", sql::columns_without_rests(alike[0].tier), list(alike)),
        _ => format!("SELECT {} FROM {}", sql::columns(alike[0].tier, rests), list(alike)),
    };
    // One after the other, as they follow each other in time.
    let parts: Vec<String> = files.chunk_by(|one, next| one.rests == next.rests).map(alike).collect();
    format!("({})", parts.join(" UNION ALL "))
}

/// The paths of files as a list in SQL.
pub(super) fn paths(folder: &Path, files: &[ArchiveFile]) -> String {
    files.iter().map(|file| quoted(&folder.join(&file.path))).collect::<Vec<_>>().join(", ")
}

/// Has any of these files what its numbers lack?
pub(super) fn any_rests(files: &[ArchiveFile]) -> bool {
    files.iter().any(|file| file.rests)
}

/// A path in SQL.
pub(super) fn quoted(path: &Path) -> String {
    format!("'{}'", path.to_string_lossy().replace('\'', "''"))
}

/// Bytes and SHA-256 of a file, which is on disk when this returns.
pub fn sync_and_hash(path: &Path) -> std::io::Result<(u64, String)> {
    let mut file = regular::open(path)?;
    disk::step("sync of the file")?;
    file.sync_all()?;
    let mut hash = Sha256::new();
    let bytes = std::io::copy(&mut file, &mut hash)?;
    Ok((bytes, format!("{:x}", hash.finalize())))
}

fn wrong(path: &Path, error: &std::io::Error) -> HistoryError {
    HistoryError::Engine(format!("{}: {error}", path.display()))
}
