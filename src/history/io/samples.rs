//! Stored samples of many tags, read once, piece by piece in order of time: the memory that a query needs does not
//! grow with its period.

use duckdb::{
    arrow::{
        array::{Array, AsArray, StructArray},
        datatypes::{Float64Type, TimestampMicrosecondType, UInt8Type, UInt16Type},
    },
    params,
};
use jiff::Timestamp;

use super::{
    archive::{any_rests, overlapping},
    read::{check_span, within},
    sql,
    store::{Store, engine, instant, utc},
    walk::Read,
};
use crate::{
    history::{ArchiveFile, HistoryError, Unarchived, tiers::Tier},
    plant::{
        def::TagId,
        exact::Exact,
        number::{to_i64, to_u32, to_u64},
        sample::{Cause, Quality, Sample},
    },
    report::{Gap, step_series::HOLD_MAX},
};

/// Rows of a piece that are aimed at; twice as many are held at most.
pub(super) const PIECE: usize = 1 << 17;
/// Rows that one statement reads, about, however few of them are asked for: a checkpoint waits for it.
const SCANNED_ROWS: f64 = 3e6;
/// Of a period with unreadable blocks at most this share, in parts, is given up with each of them; and this long at the
/// least, in microseconds.
const GAP_PARTS: i64 = 500;
const GAP_MIN: i64 = 60_000_000;
/// Samples that are handed out at once.
pub const UNARCHIVED_MAX: u64 = 50_000;
/// How a tag is asked for that the file does not know, and one that was not asked for.
const NONE: u32 = u32::MAX;

/// A stored sample, as small as it can be.
struct Row {
    micros: i64,
    value: f64,
    rest: f64,
    /// Where its tag stands among those asked for.
    place: u32,
    quality: u8,
    /// Whether it has a value, and a rest.
    has: (bool, bool),
}

/// Where the samples of a span lie.
struct Sources {
    /// In the table.
    table: bool,
    /// In these files.
    files: Vec<ArchiveFile>,
}

impl Sources {
    fn are_damaged(&self, error: &HistoryError) -> bool {
        error.is_damage() || !self.files.is_empty() && error.is_damage_of_file()
    }
}

/// What became of reading a piece.
enum Piece {
    Whole,
    /// It has more rows than are held.
    TooLong,
}

/// Which stored numbers of tags are read, and where each stands among them.
pub(super) struct Wanted {
    places: Vec<u32>,
    /// The condition in SQL, of these tags or of other columns.
    pub(super) tags: String,
}

impl Wanted {
    /// All tags, each with its stored number as its place.
    pub(super) fn all(condition: String) -> Wanted {
        Wanted { places: (0..=u32::from(u16::MAX)).collect(), tags: condition }
    }

    pub(super) fn place(&self, number: u16) -> Option<usize> {
        Some(self.places[usize::from(number)]).filter(|place| *place != NONE).map(|place| place as usize)
    }
}

impl Store {
    /// The rows of some epochs, in order of time.
    pub(super) fn each_row_of(
        &self,
        wanted: &Wanted,
        epochs: &str,
        (from, to): (Timestamp, Timestamp),
        each: &mut impl FnMut(Read),
    ) -> Result<Vec<Gap>, HistoryError> {
        let begin = from.as_microsecond();
        let (mut next, end) = (begin, to.as_microsecond());
        let gap_min = ((end - next) / GAP_PARTS).max(GAP_MIN);
        let (mut span, mut span_max) = (end - next, end - next);
        let (mut rows, mut gaps) = (Vec::new(), Vec::<Gap>::new());
        // The table first: what leaves it from now on is seen at the end.
        let hot = self.oldest_in_table()?.unwrap_or(i64::MAX);
        let files = self.files(Some((Tier::Raw, next..end)))?;
        if let Some((stored, micros)) = self.spread(to)? {
            // Few rows need one piece, however close together they are: those of a start have one time.
            let of = |rows: f64| if rows < stored { to_i64(rows / stored * micros).max(1) } else { i64::MAX };
            (span, span_max) = (span.min(of(self.piece as f64)), of(SCANNED_ROWS));
        }
        while next < end {
            let to = next.saturating_add(span).min(end);
            // What happened at one instant is never cut.
            let max = if to - next > 1 { 2 * self.piece } else { usize::MAX };
            let sources = Sources { table: hot < to, files: overlapping(&files, &(next..to)) };
            match self.read((wanted, epochs), &sources, (next, to), max, &mut rows) {
                Ok(Piece::TooLong) => span = ((to - next) / 8).max(1),
                Ok(Piece::Whole) => {
                    // Rows of one instant keep the order in which they were written.
                    if !rows.is_sorted_by_key(|row: &Row| row.micros) {
                        rows.sort_by_key(|row| row.micros);
                    }
                    rows.iter().filter_map(Row::sample).for_each(|(place, sample)| each(Read::Sample(place, sample)));
                    next = to;
                    let longest = if sources.table { span_max } else { i64::MAX };
                    span = if rows.len() < self.piece / 8 { span.saturating_mul(8).min(longest) } else { span };
                }
                Err(error) if sources.are_damaged(&error) && self.are_replaced(&sources.files)? => return Err(error),
                Err(error) if sources.are_damaged(&error) && to - next > gap_min => {
                    span = ((to - next) / 8).max(gap_min)
                }
                Err(error) if sources.are_damaged(&error) => {
                    tracing::error!(?error, "a part of the history cannot be read");
                    let (Some(from), Some(until)) = (instant(next), instant(to)) else { return Err(error) };
                    // Each is in force no longer than any other sample.
                    let bad = std::iter::successors(Some(from), |at| at.checked_add(HOLD_MAX).ok());
                    bad.take_while(|at| *at < until).for_each(|at| each(Read::Nothing(Cause::Unreadable, at)));
                    self.unreadable.replace(Some(format!("{from:.0} to {until:.0} cannot be read: {}", error.words())));
                    match gaps.last_mut().filter(|last| last.to == from) {
                        Some(last) => last.to = until,
                        None => gaps.push(Gap { from, to: until, why: error.words() }),
                    }
                    next = to;
                }
                Err(error) => return Err(error),
            }
        }
        // An hour that was archived meanwhile was read neither here nor there.
        if hot < end && self.files(Some((Tier::Raw, begin..end)))? != files {
            self.changed.set(true);
        }
        Ok(gaps)
    }

    /// The samples that are not archived, in a span: also those of tags that the plant has no longer, or with another unit.
    pub(super) fn unarchived(&self, from: Timestamp, to: Timestamp) -> Result<Unarchived, HistoryError> {
        check_span(from, to)?;
        let row = |row: &duckdb::Row| {
            let (micros, value, rest): (_, Option<f64>, Option<f64>) = (row.get(0)?, row.get(2)?, row.get(4)?);
            Ok((row.get(1)?, Row::new(micros, 0, row.get(3)?, value, rest)))
        };
        let params = params![utc(from), utc(to), UNARCHIVED_MAX + 1];
        let rows: Vec<(u16, Row)> = self.list(sql::UNARCHIVED, params, row)?;
        within(rows.len() as u64, UNARCHIVED_MAX)?;
        let (mut numbers, mut tags) = (vec![u16::MAX; usize::from(u16::MAX) + 1], Vec::new());
        for (place, (tag, number)) in (0..).zip(self.dictionary().map_err(engine)?) {
            numbers[usize::from(number)] = place;
            tags.push(tag);
        }
        let is_known = |place: &u16| usize::from(*place) < tags.len();
        let sample =
            |(tag, row): (u16, Row)| Some((Some(numbers[usize::from(tag)]).filter(is_known)?, row.sample()?.1));
        Ok(Unarchived { samples: rows.into_iter().filter_map(sample).collect(), tags })
    }

    /// Whether one of these files was replaced by another while it was read.
    fn are_replaced(&self, files: &[ArchiveFile]) -> Result<bool, HistoryError> {
        let known = self.files(None)?;
        self.changed.set(!files.iter().all(|file| known.contains(file)));
        Ok(self.changed.get())
    }

    /// A list of numbers is worth its cost where it leaves most rows out.
    pub(super) fn wanted(&self, tags: &[TagId]) -> Wanted {
        let numbers: Vec<Option<u16>> = tags.iter().map(|tag| self.id(*tag)).collect();
        let mut places = vec![NONE; usize::from(u16::MAX) + 1];
        for (place, number) in numbers.iter().enumerate() {
            if let Some(number) = number {
                places[usize::from(*number)] = to_u32(place);
            }
        }
        let list: Vec<String> = numbers.iter().flatten().map(u16::to_string).collect();
        let some = (2 * list.len() < self.ids.len()).then_some(list.as_slice());
        Wanted { places, tags: sql::of_tags(some) }
    }

    fn read(
        &self,
        (wanted, epochs): (&Wanted, &str),
        sources: &Sources,
        (from, to): (i64, i64),
        max: usize,
        rows: &mut Vec<Row>,
    ) -> Result<Piece, HistoryError> {
        rows.clear();
        let (Some(from), Some(to)) = (instant(from), instant(to)) else { return Ok(Piece::Whole) };
        if !sources.table && sources.files.is_empty() {
            return Ok(Piece::Whole);
        }
        let rests = sources.table || any_rests(&sources.files);
        let files = (!sources.files.is_empty()).then(|| self.parquet(&sources.files, rests));
        let sql = sql::samples(&format!("{}{epochs}", wanted.tags), sources.table, files.as_deref(), rests);
        // Not from the cache: a statement that is left before its end must go.
        let mut statement = self.db.prepare(&sql).map_err(engine)?;
        // The rows are fetched by `step`, because the stream itself panics where it meets an error.
        let _ = statement.stream_arrow(params![utc(from), utc(to)]).map_err(engine)?;
        while let Some(batch) = statement.step().map_err(engine)? {
            let read = push(&batch, wanted, rows);
            read.ok_or_else(|| HistoryError::Engine("unexpected columns of samples".into()))?;
            if rows.len() > max {
                return Ok(Piece::TooLong);
            }
        }
        Ok(Piece::Whole)
    }

    /// Refuses a query behind which more rows lie than can be answered in time, without counting them: as if the rows
    /// of the history lay evenly over its period and its tags.
    pub(super) fn bounded(
        &self,
        tags: usize,
        from: Timestamp,
        to: Timestamp,
        now: Timestamp,
        max: u64,
    ) -> Result<(), HistoryError> {
        let Some((first, last)) = self.period(now)? else { return Ok(()) };
        let (from, to) = (from.as_microsecond().max(first), to.as_microsecond().min(last));
        let share = (to - from).max(0) as f64 / (last - first).max(1) as f64;
        let tags = tags as f64 / self.ids.len().max(1) as f64;
        let rows = to_u64((self.rows_about()? as f64 * share * tags.min(1.0)).ceil());
        let asked = to_u64(((to - from).max(0) as f64 / 1e6).floor());
        if rows <= max { Ok(()) } else { Err(HistoryError::TooManyRows { rows, max, asked: Some(asked) }) }
    }

    /// The rows up to an instant and the microseconds that they lie in, about; `None` if that is not known.
    fn spread(&self, to: Timestamp) -> Result<Option<(f64, f64)>, HistoryError> {
        let Some((first, last)) = self.period(to)? else { return Ok(None) };
        Ok(Some((self.rows_about()? as f64, (last - first).max(1) as f64)))
    }

    /// Rows of samples, as the engine estimates, and as the manifest knows.
    fn rows_about(&self) -> Result<u64, HistoryError> {
        self.db.query_row(sql::ROWS_ABOUT, [], |row| row.get(0)).map_err(engine)
    }

    /// When the oldest sample was stored that is not archived; microseconds.
    pub(super) fn oldest_in_table(&self) -> Result<Option<i64>, HistoryError> {
        self.db.query_row(sql::OLDEST_IN_TABLE, [], |row| row.get(0)).map_err(engine)
    }

    /// About when the first sample was stored, and the last or `now`, in microseconds.
    fn period(&self, now: Timestamp) -> Result<Option<(i64, i64)>, HistoryError> {
        let known = self.extent();
        let first = match known {
            Some((first, _)) => Some(first.as_microsecond()),
            None => self.list(sql::FIRST_STORED, &[], |row| row.get(0))?.first().copied(),
        };
        let last = known.map_or(i64::MIN, |(_, last)| last.as_microsecond() + 1);
        Ok(first.map(|first| (first, last.max(now.as_microsecond()).max(first + 1))))
    }
}

impl Row {
    fn new(micros: i64, place: u32, quality: u8, value: Option<f64>, rest: Option<f64>) -> Row {
        let has = (value.is_some(), rest.is_some());
        Row { micros, value: value.unwrap_or_default(), rest: rest.unwrap_or_default(), place, quality, has }
    }

    fn sample(&self) -> Option<(u32, Sample)> {
        let at = instant(self.micros)?;
        // A number that no version wrote is no value.
        let quality = Quality::from_code(self.quality).unwrap_or(Quality::Bad(Cause::Corrupt));
        let rest = self.has.1.then_some(self.rest);
        let sample = match (self.has.0.then(|| Exact::of_parts(self.value, rest)), quality) {
            (value @ Some(_), Quality::Good | Quality::Uncertain(_)) => Sample::new(value, quality, at),
            (None, Quality::Good) => Sample::bad(Cause::Corrupt, at),
            (None, Quality::Uncertain(cause)) | (_, Quality::Bad(cause)) => Sample::bad(cause, at),
        };
        Some((self.place, sample))
    }
}

/// Adds the rows of a batch that are asked for; `None` if its columns are not those of samples.
fn push(batch: &StructArray, wanted: &Wanted, rows: &mut Vec<Row>) -> Option<()> {
    let [utc, tags, values, qualities, rests @ ..] = batch.columns() else { return None };
    let micros = utc.as_primitive_opt::<TimestampMicrosecondType>()?.values();
    let tags = tags.as_primitive_opt::<UInt16Type>()?.values();
    let values = values.as_primitive_opt::<Float64Type>()?;
    let qualities = qualities.as_primitive_opt::<UInt8Type>()?.values();
    let rests = rests.first().and_then(|rests| rests.as_primitive_opt::<Float64Type>());
    let rests = rests.filter(|rests| rests.null_count() < rests.len());
    for (index, tag) in tags.iter().enumerate() {
        if let Some(place) = wanted.place(*tag) {
            let value = values.is_valid(index).then(|| values.value(index));
            let rest = rests.filter(|rests| rests.is_valid(index)).map(|rests| rests.value(index));
            rows.push(Row::new(micros[index], to_u32(place), qualities[index], value, rest));
        }
    }
    Some(())
}
