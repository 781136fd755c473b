//! Stores samples of a file, marked as such.

mod parquet;

use std::{
    collections::{HashMap, HashSet},
    ffi::OsString,
    fs::{self, File},
    io::{BufRead, BufReader, Read},
    os::unix::fs::{DirBuilderExt, MetadataExt, fchown},
    path::{Path, PathBuf},
};

use duckdb::params;
use jiff::Timestamp;
use rustix::fs::{AtFlags, CWD, Mode, OFlags, openat, unlinkat};

use super::{
    sql,
    store::{Store, engine, instant, utc},
};
use crate::{
    history::{
        HistoryError,
        import::{self, Filler, Header, Import, Rows, Stored},
        tiers::Tier,
    },
    plant::{def::PlantDef, sample::Sample},
    profile::io::regular,
    report::step_series::HOLD_MAX,
};

/// The folder beside a history that a station imports files from, and no other: `tank.import` beside `tank.duckdb`. Whoever
/// asks for an import must be able to put the file there.
pub fn folder(history: &Path) -> PathBuf {
    history.with_extension("import")
}

/// A file in the import folder; a copy that was made for one import is removed with this.
#[derive(Debug)]
pub struct Placed {
    folder: File,
    name: OsString,
    is_copy: bool,
}

impl Placed {
    /// Its name there.
    pub fn name(&self) -> String {
        self.name.to_string_lossy().into_owned()
    }
}

impl Drop for Placed {
    fn drop(&mut self) {
        if self.is_copy {
            // A copy that stays takes room and does no harm.
            let _ = unlinkat(&self.folder, &self.name, AtFlags::empty());
        }
    }
}

/// Puts a file where the station of a history reads it; one that is there already stays. Everything is done in the folder as it
/// was opened, and through no link: the user of the station must not lead root elsewhere.
pub fn place(file: &Path, history: &Path) -> std::io::Result<Placed> {
    let path = folder(history);
    let own = fs::metadata(history).or_else(|_| fs::metadata(history.parent().unwrap_or(history)))?;
    let made = match fs::DirBuilder::new().mode(0o750).create(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => false,
        made => made.map(|()| true)?,
    };
    let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder = File::from(openat(CWD, &path, flags, Mode::empty())?);
    if made {
        give(&folder, &own)?;
    }
    let name = file.file_name().unwrap_or_default().to_owned();
    if fs::canonicalize(file)?.parent() == fs::canonicalize(&path).ok().as_deref() {
        return Ok(Placed { folder, name, is_copy: false });
    }
    let mut from = regular::open(file)?;
    let new = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let mut to = File::from(openat(&folder, &name, new, Mode::from_raw_mode(0o640))?);
    let placed = Placed { folder, name, is_copy: true };
    std::io::copy(&mut from, &mut to)?;
    give(&to, &own)?;
    Ok(placed)
}

/// What root makes belongs to the user of the station.
fn give(made: &File, own: &fs::Metadata) -> std::io::Result<()> {
    let is_other = made.metadata()?.uid() != own.uid();
    if is_other { fchown(made, Some(own.uid()), Some(own.gid())) } else { Ok(()) }
}

/// Longest file.
const BYTES_MAX: u64 = 512 << 20;
const HEADER_BYTES_MAX: u64 = 4 << 10;
/// Rows of an import that are stored with one commit: a station records meanwhile.
const IMPORT_PIECE: usize = 10_000;

/// An import that is being stored.
#[derive(Debug)]
pub struct Importing {
    /// What it will be.
    pub import: Import,
    /// Rows of the file.
    pub in_file: u64,
    /// The rows that are not stored yet, in order of time.
    rows: Vec<(u16, Sample)>,
}

impl Importing {
    /// How many rows are stored.
    pub fn done(&self) -> u64 {
        self.import.rows - self.rows.len() as u64
    }

    /// One sentence for the operator and the audit log.
    pub fn summary(&self, def: &PlantDef) -> String {
        self.import.summary(self.in_file, &def.time_zone)
    }
}

/// Reads a file of samples with times from `oldest` to `now`. `Err`: every problem, with file and line.
pub fn read_rows(path: &Path, def: &PlantDef, oldest: Timestamp, now: Timestamp) -> Result<Rows, Vec<String>> {
    rows_of(path, regular::open(path), def, [oldest, now])
}

/// The same of a file that others have put into the import folder: a link could lead out of it.
pub fn read_placed_rows(path: &Path, def: &PlantDef, oldest: Timestamp, now: Timestamp) -> Result<Rows, Vec<String>> {
    rows_of(path, regular::open_no_link(File::options().read(true), path), def, [oldest, now])
}

fn rows_of(
    path: &Path,
    opened: std::io::Result<File>,
    def: &PlantDef,
    [oldest, now]: [Timestamp; 2],
) -> Result<Rows, Vec<String>> {
    let named = |problem: String| format!("{}: {problem}", path.display());
    let failed = |error: std::io::Error| vec![named(error.to_string())];
    let mut file = opened.map_err(failed)?;
    if BYTES_MAX < file.metadata().map_err(failed)?.len() {
        return Err(vec![named(format!("expected at most {} MiB: split the file", BYTES_MAX >> 20))]);
    }
    let read = if parquet::is_one(&mut file).map_err(failed)? {
        parquet::read(&file, def, [oldest, now])
    } else {
        parse(def, BufReader::new(file.take(BYTES_MAX)), oldest, now)
    };
    read.map_err(|problems| problems.into_iter().map(named).collect())
}

/// The same of what is in a file, row by row.
pub fn parse(def: &PlantDef, mut text: impl BufRead, oldest: Timestamp, now: Timestamp) -> Result<Rows, Vec<String>> {
    let mut first = Vec::new();
    let first_line = |why: String| vec![format!("line 1: {why}")];
    // A header has some columns: what is no file of samples may have no line at all.
    (&mut text).take(HEADER_BYTES_MAX).read_until(b'\n', &mut first).map_err(|error| first_line(error.to_string()))?;
    let first = first.strip_prefix("\u{feff}".as_bytes()).unwrap_or(&first);
    let separator = [b';', b'\t'].into_iter().find(|mark| first.contains(mark)).unwrap_or(b',');
    let text = LineEnds { text: first.chain(text), before: b'\n', written: b'\n' };
    let mut reader = csv::ReaderBuilder::new().delimiter(separator).flexible(true).from_reader(text);
    let mut columns = reader.headers().map_err(|error| first_line(error.to_string()))?.clone();
    columns.trim();
    let header = Header { columns, separator, counted_in: "line" };
    import::parse(def, &header, records(reader), [oldest, now])
}

/// The rows of a file, each with the line on which it begins: what ends a line is counted behind it, and may stand in cells.
fn records(mut reader: csv::Reader<impl Read>) -> impl Iterator<Item = import::Record> {
    let mut row = csv::ByteRecord::new();
    std::iter::from_fn(move || match reader.read_byte_record(&mut row) {
        Ok(false) => None,
        Ok(true) => {
            let within = row.as_slice().iter().filter(|byte| **byte == b'\n').count() as u64;
            let line = reader.position().line().saturating_sub(1 + within);
            let text = csv::StringRecord::from_byte_record(row.clone()).map_err(|error| error.to_string());
            Some((
                line,
                text.map(|mut text| {
                    text.trim();
                    text
                }),
            ))
        }
        Err(error) => Some((reader.position().line(), Err(error.to_string()))),
    })
}

/// A text of which each line ends with one line feed, the last one too, whatever ends them in the file.
struct LineEnds<R> {
    text: R,
    /// The byte of the file before.
    before: u8,
    /// The last byte that was handed over.
    written: u8,
}

impl<R: BufRead> Read for LineEnds<R> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let mut count = 0;
        while count == 0 && !to.is_empty() {
            let text = self.text.fill_buf()?;
            if text.is_empty() {
                // What has no end gets one.
                let is_open = std::mem::replace(&mut self.written, b'\n') != b'\n';
                to[0] = b'\n';
                return Ok(usize::from(is_open));
            }
            let taken = text.len().min(to.len());
            for byte in &text[..taken] {
                let is_second = std::mem::replace(&mut self.before, *byte) == b'\r' && *byte == b'\n';
                if !is_second {
                    self.written = if *byte == b'\r' { b'\n' } else { *byte };
                    to[count] = self.written;
                    count += 1;
                }
            }
            self.text.consume(taken);
        }
        Ok(count)
    }
}

impl Store {
    /// The first instant of which samples can be imported: what was deleted before it would be deleted again, and the
    /// aggregates that remain of it are not formed again.
    pub fn importable_from(&self) -> Result<Timestamp, HistoryError> {
        Ok(self.deleted_until(Tier::Raw)?.unwrap_or_default().max(Timestamp::UNIX_EPOCH))
    }

    /// Decides which samples of a file fill a gap; `None` for none of them.
    pub fn importing(&self, rows: Rows, file: &str, now: Timestamp) -> Result<Option<Importing>, HistoryError> {
        let times = || rows.values().flatten().map(|sample| sample.at);
        let (Some(from), Some(to)) = (times().min(), times().max()) else { return Ok(None) };
        let in_file = times().count() as u64;
        let mut fillers: HashMap<u16, Filler> = HashMap::new();
        for (tag, rows) in rows {
            fillers.extend(self.id(tag).map(|id| (id, Filler::new(rows))));
        }
        let end = to.checked_add(jiff::Span::new().microseconds(1)).unwrap_or(to);
        // Up to the next stored sample after the last row: where that of an earlier file ends depends on it.
        let end = end.checked_add(HOLD_MAX).unwrap_or(end);
        let mut earlier = HashSet::new();
        self.each_imported(from, end, |tag, sample| _ = earlier.insert((tag, sample.at)))?;
        let gaps = self.each_stored(from, end, |tag: u16, sample: Sample| {
            if let Some(filler) = fillers.get_mut(&tag) {
                filler.stored(Stored { sample, imported: earlier.contains(&(tag, sample.at)) });
            }
        })?;
        if let Some(gap) = gaps.first() {
            let why = format!("{:.0} to {:.0} cannot be read, so what to import there is unknown", gap.from, gap.to);
            return Err(HistoryError::Refused(why));
        }
        let of_tag = |(id, filler): (u16, Filler)| filler.end().into_iter().map(move |sample| (id, sample));
        let mut rows: Vec<(u16, Sample)> = fillers.into_iter().flat_map(of_tag).collect();
        rows.sort_by_key(|(id, sample)| (sample.at, *id));
        let (Some((_, first)), Some((_, last))) = (rows.first(), rows.last()) else { return Ok(None) };
        let import = Import { at: now, file: file.to_owned(), from: first.at, to: last.at, rows: rows.len() as u64 };
        Ok(Some(Importing { import, in_file, rows }))
    }

    /// Stores the next piece of an import, in one commit; `false` after the last one. The latest rows go first: whether a
    /// row fills a gap depends on what is stored before it, so an import that was interrupted is completed by the next one
    /// of the same file. Rows are archived with the hours that they belong to.
    pub fn import_piece(&self, importing: &mut Importing) -> Result<bool, HistoryError> {
        let mut left = importing.rows.len().saturating_sub(IMPORT_PIECE);
        // What happened at one instant is never cut.
        while 0 < left && importing.rows[left - 1].1.at == importing.rows[left].1.at {
            left -= 1;
        }
        let piece = &importing.rows[left..];
        self.commit(piece.iter().map(|(_, sample)| sample.at), self.epoch(), || {
            let mut appender = self.db.appender("sample")?;
            for (id, Sample { at, value, rest, quality }) in piece {
                appender.append_row((utc(*at), *id, *value, quality.code(), sql::IMPORTED, *rest))?;
            }
            appender.flush()?;
            drop(appender);
            if left == 0 {
                let Import { at, file, from, to, rows } = &importing.import;
                self.db.execute(sql::ENTER_IMPORT, params![utc(*at), file, utc(*from), utc(*to), rows])?;
            }
            Ok(true)
        })?;
        importing.rows.truncate(left);
        Ok(left > 0)
    }

    /// What was imported, the oldest import first.
    pub(super) fn imports(&self) -> Result<Vec<Import>, HistoryError> {
        let mut statement = self.db.prepare(sql::IMPORTS).map_err(engine)?;
        let row = |row: &duckdb::Row| {
            let time = |column| Ok::<_, duckdb::Error>(instant(row.get(column)?).unwrap_or_default());
            Ok(Import { at: time(0)?, file: row.get(1)?, from: time(2)?, to: time(3)?, rows: row.get(4)? })
        };
        let rows = statement.query_map([], row).map_err(engine)?;
        rows.collect::<duckdb::Result<Vec<_>>>().map_err(engine)
    }
}
