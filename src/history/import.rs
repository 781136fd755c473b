//! Samples from a CSV or Parquet file of another program: what is accepted, line by line, and which of them fill a gap.
//!
//! A row is one sample: `tag`, `time` (with offset, or a local time of the plant), `value`, and if there is such a column
//! `quality`, in any order. Where there is a column `exact`, as SQL gives it, what it holds is the value. Or a row is one
//! instant, as `export` writes it: a time, then of each tag a column of values and perhaps one of qualities, by its name. A
//! time whose column has `utc` in its name is UTC. Cells stand between commas, semicolons or tabs; the decimal mark is the
//! [first](DecimalMark).

mod filler;

use std::collections::BTreeMap;

use jiff::{Timestamp, civil::DateTime, tz::TimeZone};
use serde::{Deserialize, Serialize};

use crate::{
    history::tiers::in_milliseconds,
    plant::{
        PlantDef,
        def::TagId,
        exact::Exact,
        sample::{Cause, Quality, Sample},
        scale,
        tag::TagDef,
        time::elapsed,
    },
    report::{
        decimal_mark::{DecimalMark, NumberError},
        export::QUALITY,
        step_series::HOLD_MAX,
    },
};

pub use filler::{Filler, Stored};

/// Samples of one file: they are all in memory.
const ROWS_MAX: usize = 2_000_000;
/// Problems that are kept in words; all are counted.
const PROBLEMS_MAX: usize = 10;
/// The names of columns, by what they are; of the times the first that is there counts, and before them any with `utc` in it.
const TIMES: [&str; 5] = ["time_utc", "utc", "time", "timestamp", "time_local"];
const OTHERS: [&str; 5] = ["tag", "value", "exact", "quality", "unit"];

/// The rows of each tag, in order of time.
pub type Rows = BTreeMap<TagId, Vec<Sample>>;

/// An import that is stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Import {
    /// When.
    pub at: Timestamp,
    /// The name of the file.
    pub file: String,
    /// Its first and last sample that was stored.
    pub from: Timestamp,
    /// The last.
    pub to: Timestamp,
    /// Samples that were stored.
    pub rows: u64,
}

impl Import {
    /// One sentence for the operator and the audit log; of `rows` in the file the others are left out.
    pub fn summary(&self, rows: u64, zone: &TimeZone) -> String {
        let local = |at: Timestamp| at.to_zoned(zone.clone()).strftime("%Y-%m-%d %H:%M:%S").to_string();
        let left_out = match rows.saturating_sub(self.rows) {
            0 => String::new(),
            count => format!("; {count} left out, where a value is stored already"),
        };
        format!("{} rows, {} to {}{left_out}", self.rows, local(self.from), local(self.to))
    }
}

/// Where the cells of a row stand.
struct Columns {
    count: usize,
    time: usize,
    is_utc: bool,
    layout: Layout,
    mark: DecimalMark,
}

enum Layout {
    /// A row a sample.
    Sample { tag: usize, value: usize, exact: Option<usize>, quality: Option<usize>, unit: Option<usize> },
    /// A row an instant.
    Instant(BTreeMap<TagId, Series>),
}

/// The columns of a tag.
struct Series {
    value: usize,
    quality: Option<usize>,
    /// When it had a value last.
    held: Option<Timestamp>,
}

/// What comes before the rows of a file.
#[derive(Debug)]
pub struct Header {
    /// The names of its columns.
    pub columns: csv::StringRecord,
    /// What stands between cells.
    pub separator: u8,
    /// What its rows are counted in: `line`, or `row` where it has no lines.
    pub counted_in: &'static str,
}

/// A row of a file with its number, that of the line on which it begins; or why it is none.
pub type Record = (u64, Result<csv::StringRecord, String>);

/// Reads the rows behind a header. `Err`: every problem with its line; nothing of the file is used then. Times lie from `oldest` up to `now`. Rows of one instant keep their order.
pub fn parse(
    def: &PlantDef,
    header: &Header,
    records: impl Iterator<Item = Record>,
    [oldest, now]: [Timestamp; 2],
) -> Result<Rows, Vec<String>> {
    let Header { columns: names, separator, counted_in } = header;
    let mut columns = columns(def, names, *separator).map_err(|why| vec![format!("line 1: {why}")])?;
    let (mut rows, mut problems, mut wrong, mut count) = (Rows::new(), Vec::new(), 0, 0);
    for (line, record) in records {
        let mut add = |tag, sample| {
            rows.entry(tag).or_default().push(sample);
            count += 1;
        };
        let read = record.and_then(|record| columns.row(def, line, &record, [oldest, now], &mut add));
        if let Err(why) = read {
            wrong += 1;
            problems.extend((problems.len() < PROBLEMS_MAX).then(|| format!("{counted_in} {line}: {why}")));
        }
        if ROWS_MAX < count {
            return Err(vec![format!("found more than {ROWS_MAX} samples: split the file")]);
        }
    }
    rows.values_mut().for_each(|rows| rows.sort_by_key(|sample| sample.at));
    match wrong {
        0 if rows.is_empty() => Err(vec!["found no row behind the header".to_owned()]),
        0 => Ok(rows),
        _ => {
            problems.extend((problems.len() < wrong).then(|| format!("and {} more", wrong - problems.len())));
            Err(problems)
        }
    }
}

fn columns(def: &PlantDef, header: &csv::StringRecord, separator: u8) -> Result<Columns, String> {
    let named = |name: &str| header.iter().position(|column| column.eq_ignore_ascii_case(name));
    let known = || TIMES.into_iter().chain(OTHERS);
    let is_utc = |column: &str| column.to_ascii_lowercase().contains("utc") && of_tag(def, column).is_none();
    let utc = header.iter().position(is_utc);
    let time = utc.or_else(|| TIMES.into_iter().find_map(named));
    let layout = match named("tag") {
        None if header.iter().any(|column| of_tag(def, column).is_some()) => instant(def, header, is_utc)?,
        tag => {
            let is_known = |column: &str| is_utc(column) || known().any(|known| column.eq_ignore_ascii_case(known));
            if let Some(other) = header.iter().position(|column| !is_known(column)) {
                let known: Vec<&str> = known().collect();
                // Not in its own words: until its columns are known, a file may be any file, even one of passwords.
                let expected = format!("expected {}, or a time and names of tags", known.join(", "));
                return Err(format!("column {} is none of samples, {expected}", other + 1));
            }
            let needed = |column: Option<usize>, what: &str| column.ok_or_else(|| format!("found no column `{what}`"));
            let [value, exact, quality, unit] = ["value", "exact", "quality", "unit"].map(named);
            Layout::Sample { tag: needed(tag, "tag")?, value: needed(value, "value")?, exact, quality, unit }
        }
    };
    let time = time.ok_or_else(|| format!("found no column {}", TIMES.join(" or ")))?;
    Ok(Columns { count: header.len(), time, is_utc: utc.is_some(), layout, mark: DecimalMark::of(separator) })
}

/// The tag of a column, and the rest of its heading: its unit, or that it is of qualities.
fn of_tag<'a>(def: &PlantDef, column: &'a str) -> Option<(TagId, &'a str)> {
    // As a formula is kept from being one.
    let column = column.strip_prefix('\'').unwrap_or(column);
    let (name, rest) = column.split_once(' ').unwrap_or((column, ""));
    Some((def.tag_named(name)?, rest))
}

/// The columns of a row that is an instant.
fn instant(def: &PlantDef, header: &csv::StringRecord, is_utc: impl Fn(&str) -> bool) -> Result<Layout, String> {
    let mut tags: BTreeMap<TagId, (Option<usize>, Option<usize>)> = BTreeMap::new();
    for (place, column) in header.iter().enumerate() {
        let Some((tag, rest)) = of_tag(def, column) else {
            let is_time = is_utc(column) || TIMES.iter().any(|time| column.eq_ignore_ascii_case(time));
            is_time
                .then_some(())
                .ok_or_else(|| format!("column {}: expected a time or the name of a tag", place + 1))?;
            continue;
        };
        let (tag_def, columns) = (def.tag(tag), tags.entry(tag).or_default());
        let is_quality = rest == QUALITY.trim_start();
        if !is_quality && !rest.is_empty() && tag_def.unit_from.is_none() && rest != tag_def.unit {
            return Err(format!("{}: found the unit `{rest}`, expected `{}`", tag_def.name, tag_def.unit));
        }
        let taken = if is_quality { columns.1.replace(place) } else { columns.0.replace(place) };
        if taken.is_some() {
            return Err(format!("column {}: found {} twice", place + 1, tag_def.name));
        }
    }
    let whole = |(tag, (value, quality)): (TagId, (Option<usize>, _))| {
        let value = value.ok_or_else(|| format!("found no column of values of {}", def.tag(tag).name))?;
        Ok((tag, Series { value, quality, held: None }))
    };
    tags.into_iter().map(whole).collect::<Result<_, String>>().map(Layout::Instant)
}

impl Columns {
    /// Reads the samples of a row.
    fn row(
        &mut self,
        def: &PlantDef,
        line: u64,
        record: &csv::StringRecord,
        [oldest, now]: [Timestamp; 2],
        add: &mut impl FnMut(TagId, Sample),
    ) -> Result<(), String> {
        if record.len() != self.count {
            return Err(format!("found {} cells, expected {}", record.len(), self.count));
        }
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let at = in_milliseconds(time(def, cell(self.time), self.is_utc)?);
        if at < oldest || now < at {
            return Err(format!("found the time {at}, expected one from {oldest:.0} to {now:.0}"));
        }
        match &mut self.layout {
            Layout::Sample { tag, value, exact, quality, unit } => {
                let name = cell(*tag);
                let tag = def.tag_named(name.strip_prefix('\'').unwrap_or(name));
                let tag = tag.ok_or_else(|| format!("found the tag `{name}`, which {} has not", def.name))?;
                let tag_def = def.tag(tag);
                let unit =
                    unit.map(cell).filter(|unit| tag_def.unit_from.is_none() && !["", &tag_def.unit].contains(unit));
                if let Some(unit) = unit {
                    return Err(format!("{name}: found the unit `{unit}`, expected `{}`", tag_def.unit));
                }
                // What SQL has left out of a value that is a DOUBLE.
                let exact = exact.map(cell).filter(|exact| !exact.is_empty());
                let quality = quality_of(quality.map(cell).unwrap_or_default())?;
                let value = exact.unwrap_or(cell(*value));
                add(tag, sample(tag_def, (quality, value), (line, &mut self.mark), at)?);
            }
            Layout::Instant(tags) => {
                for (tag, series) in tags {
                    let (value, word) = (cell(series.value), series.quality.map(cell).unwrap_or_default());
                    let quality = match (word, value) {
                        ("", "") => continue,
                        // Nothing was stored, or known of what was: there the last value is held no longer.
                        (_, "") if is_none(word) => {
                            match series.held.take().filter(|held| elapsed(*held, at) < HOLD_MAX) {
                                Some(_) => Quality::Bad(Cause::StationOff),
                                None => continue,
                            }
                        }
                        // Exports leave out what is not good.
                        (_, "") => match quality_of(word)? {
                            Quality::Uncertain(cause) => Quality::Bad(cause),
                            quality => quality,
                        },
                        _ => quality_of(word)?,
                    };
                    let sample = sample(def.tag(*tag), (quality, value), (line, &mut self.mark), at)?;
                    series.held = sample.value.map(|_| at);
                    add(*tag, sample);
                }
            }
        }
        Ok(())
    }
}

/// A sample of a tag that is stored, with a value unless it is bad.
fn sample(
    tag: &TagDef,
    (quality, found): (Quality, &str),
    (line, mark): (u64, &mut DecimalMark),
    at: Timestamp,
) -> Result<Sample, String> {
    if tag.is_text() || !tag.is_stored() {
        return Err(format!("{}: this tag is not stored", tag.name));
    }
    let value = match (quality, found) {
        (Quality::Bad(_), "") => None,
        (Quality::Bad(_), found) => {
            return Err(format!("{}: found the value `{found}`, which is bad: expected none", tag.name));
        }
        (Quality::Good | Quality::Uncertain(_), found) => Some(value(tag, found, line, mark)?),
    };
    Ok(Sample::new(value, quality, at))
}

fn value(tag: &TagDef, found: &str, line: u64, mark: &mut DecimalMark) -> Result<Exact, String> {
    if let Some((value, _)) = tag.enum_labels.iter().find(|(_, label)| label.eq_ignore_ascii_case(found)) {
        return Ok(Exact::whole(*value));
    }
    let is_bit = |value: Exact| value == 0.0 || value == 1.0;
    let fits = |value: &Exact| match (tag.enum_labels.is_empty(), tag.point.table.is_bits()) {
        (false, _) => tag.label_of(*value).is_some(),
        (true, true) => is_bit(*value),
        // With the decimals that the device announces its range is no greater.
        (true, false) => scale::to_raw(tag, *value, tag.decimals.possible().0).is_some(),
    };
    let labels: Vec<&str> = tag.enum_labels.iter().map(|(_, label)| label.as_str()).collect();
    let expected = match (mark.read(found, line), labels.is_empty()) {
        (Ok(number), _) if fits(&number) => return Ok(number),
        (_, false) => labels.join(", "),
        (Err(NumberError::NotANumber) | Ok(_), true) => "a number that its type can hold".to_owned(),
        (Err(why), true) => why.to_string(),
    };
    Err(format!("{}: found `{found}`, expected {expected}", tag.name))
}

/// An instant with its offset, or a time without: of UTC where its column says so, else a local time of the plant that was
/// there once.
fn time(def: &PlantDef, found: &str, is_utc: bool) -> Result<Timestamp, String> {
    if let Ok(at) = found.parse::<Timestamp>() {
        return Ok(at);
    }
    // A minus is one only behind the date.
    let has_offset = found.contains(['+', 'Z', 'z', '[']) || found.get(10..).is_some_and(|time| time.contains('-'));
    let civil: Option<DateTime> = found.parse().ok().filter(|_| !has_offset);
    let civil =
        civil.ok_or_else(|| format!("found the time `{found}`, expected 2026-11-21T06:00:00 or with an offset"))?;
    let zone = if is_utc { &TimeZone::UTC } else { &def.time_zone };
    let unambiguous = zone.to_ambiguous_timestamp(civil).unambiguous();
    unambiguous.map_err(|_| format!("found the local time `{found}`, which was twice or never: expected an offset"))
}

/// What the program writes; nothing is good, and no cause is that the value is old.
fn quality_of(found: &str) -> Result<Quality, String> {
    let quality = match found {
        "" => Some(Quality::Good),
        "uncertain" => Some(Quality::Uncertain(Cause::Stale)),
        "bad" => Some(Quality::Bad(Cause::Stale)),
        word => Quality::from_word(word).filter(|quality| is_stored(*quality)),
    };
    quality.ok_or_else(|| {
        format!("found the quality `{found}`, expected good, or uncertain or bad with its cause: `bad: stale`")
    })
}

/// Is it what an export says of an instant at which nothing is known?
fn is_none(word: &str) -> bool {
    word == "none" || Quality::from_word(word).is_some_and(|quality| !is_stored(quality))
}

fn is_stored(quality: Quality) -> bool {
    quality.cause().is_none_or(Cause::is_stored)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
