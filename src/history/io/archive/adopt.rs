//! The archive as a start finds it: what a killed program left behind is finished or removed, and a database that was lost
//! or replaced takes up the files that are there.

use std::{
    collections::HashSet,
    fs,
    ops::Range,
    path::{Path, PathBuf},
};

use duckdb::params;
use jiff::{Timestamp, civil::Date, tz::TimeZone};

use super::{TAGS, UNFINISHED, day, month, quoted, sync_and_hash, wrong};
use crate::{
    history::{
        ArchiveFile, HistoryError,
        io::{
            disk, sql,
            store::{Store, engine, instant, utc},
        },
        tiers::{HOUR, Tier},
    },
    profile::io::atomic::with_suffix,
};

/// Missing files that are named.
const NAMED_MAX: usize = 3;
/// Whether the rules of the plant have deleted the files of a tier up to an instant; not where only a start found none.
const IS_DELETED: &str = "SELECT count(*) > 0 FROM deleted WHERE tier = ? AND path <> '' AND ? <= until_utc";

impl Store {
    /// Gives the tags of the archive their numbers back, where the database does not know them. An archive whose numbers
    /// mean other tags is not that of this database: it is set aside, and its new name returned.
    pub(in crate::history::io) fn adopt_tags(&self, now: Timestamp) -> Result<Option<String>, HistoryError> {
        let folder = self.archive_folder();
        let tags = folder.join(TAGS);
        if !tags.is_file() {
            return Ok(None);
        }
        let from = format!("read_parquet({})", quoted(&tags));
        let others: u64 = self.db.query_row(&other_tags(&from), [], |row| row.get(0)).map_err(engine)?;
        if others == 0 {
            self.db.execute_batch(&missing_tags(&from)).map_err(engine)?;
            return Ok(None);
        }
        let aside = with_suffix(&folder, &format!(".other-{}", now.strftime("%Y%m%dT%H%M%SZ")));
        disk::rename(&folder, &aside).map_err(|error| wrong(&folder, &error))?;
        Ok(Some(format!("its archive is that of another history and is set aside as {}", aside.display())))
    }

    /// Compares the files of the archive with the manifest. Returns in words what is missing.
    pub(in crate::history::io) fn adopt_files(&self) -> Result<Option<String>, HistoryError> {
        let folder = self.archive_folder();
        let missing = self.missing_files()?;
        let known = self.files(None)?;
        let names: HashSet<&str> = known.iter().map(|file| file.path.as_str()).collect();
        let mut unknown = Vec::new();
        let tags = with_suffix(&folder.join(TAGS), UNFINISHED);
        if tags.exists() {
            remove(&tags);
        }
        for path in parquet_files(&folder) {
            match described(&path) {
                Some((tier, span)) if !names.contains(path.as_str()) => unknown.push((tier, span, path)),
                Some(_) => {}
                None if path.ends_with(UNFINISHED) => remove(&folder.join(&path)),
                None => {}
            }
        }
        // Samples before what was formed of them, a day before its hours.
        unknown.sort_by_key(|(tier, span, _)| (*tier, span.start - span.end, span.start));
        for (tier, span, path) in unknown {
            self.adopt_file(tier, span, path)?;
        }
        for folder in folders(&folder).filter(|folder| entries(folder).next().is_none()) {
            disk::remove_empty(&folder);
        }
        self.adopt_deletions()?;
        Ok(missing)
    }

    /// Which files of the manifest are not there, in words.
    pub(in crate::history::io) fn missing_files(&self) -> Result<Option<String>, HistoryError> {
        let (folder, known) = (self.archive_folder(), self.files(None)?);
        let missing = known.iter().filter(|file| !folder.join(&file.path).is_file());
        let missing: Vec<&str> = missing.map(|file| file.path.as_str()).collect();
        let (named, others) = missing.split_at(missing.len().min(NAMED_MAX));
        let others = if others.is_empty() { String::new() } else { format!(" and {} more files", others.len()) };
        Ok((!named.is_empty()).then(|| format!("missing of its archive: {}{others}", named.join(", "))))
    }

    /// What was deleted of an archive whose database was lost: what only the next wider tier has rows of. The first month of
    /// hours begins before anything was recorded.
    fn adopt_deletions(&self) -> Result<(), HistoryError> {
        let files = self.files(None)?;
        let first = |tier: Tier| files.iter().filter(|file| file.tier == tier).min_by_key(|file| file.from);
        let end = |tier: Tier| files.iter().filter(|file| file.tier == tier).map(|file| file.to).max();
        for (tier, wider) in [(Tier::Raw, Tier::Minute), (Tier::Minute, Tier::Hour)] {
            let Some(begin) = first(wider) else { continue };
            let until = first(tier).map(|file| file.from).or_else(|| end(wider)).filter(|until| begin.from < *until);
            let Some(until) = until else { continue };
            if self.deleted_until(tier)?.is_none() {
                let first = format!("SELECT min(utc) FROM {}", self.parquet(std::slice::from_ref(begin), false));
                // One that cannot be read tells nothing of what was deleted.
                let first: Option<i64> = self.db.query_row(&first, [], |row| row.get(0)).unwrap_or_default();
                if first.is_some_and(|first| first < until) {
                    disk::step("enter a deletion").map_err(|error| wrong(&self.path, &error))?;
                    self.enter_deleted(tier, "", until).map_err(engine)?;
                }
            }
        }
        Ok(())
    }

    /// Takes up a file that the manifest does not know, or removes it where its rows are known otherwise: a program ended
    /// before it entered the file, or before it removed what it had replaced or deleted.
    fn adopt_file(&self, tier: Tier, span: Range<i64>, path: String) -> Result<(), HistoryError> {
        let file = self.archive_folder().join(&path);
        let until = instant(span.end).map(utc);
        if self.db.query_row(IS_DELETED, params![tier.word(), until], |row| row.get(0)).map_err(engine)? {
            remove(&file);
            return Ok(());
        }
        let count = |sql: &str| self.db.query_row(sql, [], |row| row.get::<_, u64>(0)).map_err(engine);
        let Ok(rows) = count(&format!("SELECT count(*) FROM read_parquet({})", quoted(&file))) else {
            tracing::error!(path, "a file of the archive cannot be read and is not taken up");
            return Ok(());
        };
        // What was formed begins with values of the hour before.
        let since = if tier == Tier::Raw { span.start } else { span.start - HOUR };
        let hot = count(&sql::count_samples(&(since..span.end)))?;
        let others = self.files(Some((tier, span.clone())))?;
        let superfluous = match (tier, others.as_slice()) {
            (Tier::Raw, []) => hot >= rows,
            (Tier::Raw, others) => hot + count(&sql::count_rows_of(&self.parquet(others, false), &span))? >= rows,
            // Formed again with the samples, or another file has the time.
            (Tier::Minute | Tier::Hour, others) => hot > 0 || !others.is_empty(),
        };
        if superfluous {
            remove(&file);
            return Ok(());
        }
        tracing::warn!(path, rows, "a file of the archive that the database did not know is taken up");
        let (bytes, sha256) = sync_and_hash(&file).map_err(|error| wrong(&file, &error))?;
        let within = [span.start, span.end].map(|at| instant(at).map(utc));
        let rests = self.db.query_row(&sql::has_rests(&quoted(&file)), [], |row| row.get(0)).map_err(engine)?;
        let new = ArchiveFile { tier, path, from: span.start, to: span.end, rows, bytes, sha256, rests };
        self.transaction(|| {
            self.enter_file(&new)?;
            if tier == Tier::Raw {
                self.db.execute(sql::DELETE_SAMPLES, params![within[0], within[1]])?;
                self.db.execute(sql::WIDEN, params![within[0], within[1]])?;
            }
            Ok(())
        })
    }
}

/// The files of an archive, by their path from there.
fn parquet_files(archive: &Path) -> Vec<String> {
    // The engine would wait for a pipe.
    let files = folders(archive).flat_map(|folder| entries(&folder)).filter(|path| path.is_file());
    files.filter_map(|path| Some(path.strip_prefix(archive).ok()?.to_str()?.to_owned())).collect()
}

/// The folders of its days and months.
fn folders(archive: &Path) -> impl Iterator<Item = PathBuf> {
    Tier::ALL.into_iter().flat_map(|tier| entries(&archive.join(tier.word())))
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

/// Tier and span of a file, by its path; see [`super::free_path`].
fn described(path: &str) -> Option<(Tier, Range<i64>)> {
    let mut parts = path.split('/');
    let (tier, folder, name) = (Tier::from_word(parts.next()?)?, parts.next()?, parts.next()?);
    let name = name.strip_suffix(".parquet")?;
    let name = name.split_once('-').map_or(name, |(name, _)| name);
    let start = |date: &str| {
        let date: Date = date.parse().ok()?;
        Some(date.to_zoned(TimeZone::UTC).ok()?.timestamp().as_microsecond())
    };
    let span = match (folder.split_once('=')?, name) {
        (("date", date), "day") => day(start(date)?),
        (("month", date), "month") => month(start(&format!("{date}-01"))?),
        (("date", date), hour) => {
            let hour: i64 = hour.parse().ok().filter(|hour| (0..24).contains(hour))?;
            let from = start(date)? + hour * HOUR;
            from..from + HOUR
        }
        _ => return None,
    };
    Some((tier, span))
}

fn remove(path: &Path) {
    if let Err(error) = disk::remove(path) {
        tracing::warn!(%error, path = %path.display(), "a leftover of the archive is not removed");
    }
}

/// Tags of a dictionary whose numbers mean other tags here.
fn other_tags(dictionary: &str) -> String {
    format!("SELECT count(*) FROM {dictionary} d JOIN tag USING (id) WHERE d.name <> tag.name OR d.unit <> tag.unit")
}

/// Takes over the tags of a dictionary that are not known here.
fn missing_tags(dictionary: &str) -> String {
    format!("INSERT INTO tag SELECT id, name, unit FROM {dictionary} WHERE id NOT IN (SELECT id FROM tag)")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::io::archive::free_path;

    #[test]
    fn a_path_tells_tier_and_span() {
        let none = Path::new("/nonexistent");
        let hour = 1_700_000 * 1_000_000_000 / HOUR * HOUR;
        for (tier, span, expect) in [
            (Tier::Raw, hour..hour + HOUR, "raw/date=2023-11-14/22.parquet"),
            (Tier::Minute, day(hour), "m1/date=2023-11-14/day.parquet"),
            (Tier::Hour, month(hour), "h1/month=2023-11/month.parquet"),
        ] {
            assert_eq!(free_path(none, tier, &span), expect);
            assert_eq!(described(expect), Some((tier, span.clone())));
            assert_eq!(described(&expect.replace(".parquet", "-2.parquet")), Some((tier, span)));
        }
        for path in
            ["raw/date=2023-11-14/24.parquet", "raw/x/22.parquet", "m2/date=2023-11-14/22.parquet", "tag.parquet"]
        {
            assert_eq!(described(path), None, "{path}");
        }
    }
}
