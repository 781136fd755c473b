//! Samples from a CSV file of another program: what is accepted, line by line, and which of them fill a gap.
//!
//! A row is one sample: `tag`, `time` (with offset, or a local time of the plant), `value`, and if there is such a column
//! `quality`, in any order. A time whose column has `utc` in its name is UTC. Where there is a column `exact`, as SQL gives it,
//! what it holds is the value. Cells stand between commas, semicolons or tabs; the decimal mark is the [first](DecimalMark).

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
        step_series::HOLD_MAX,
    },
};

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
    tag: usize,
    time: usize,
    is_utc: bool,
    value: usize,
    exact: Option<usize>,
    quality: Option<usize>,
    unit: Option<usize>,
    mark: DecimalMark,
}

/// A row of a file with the line on which it begins; or why it is none.
pub type Record = (u64, Result<csv::StringRecord, String>);

/// Reads the rows behind a header with this mark between its cells. `Err`: every problem with its line; nothing of the file is
/// used then. Times lie from `oldest` up to `now`. Rows of one instant keep their order.
pub fn parse(
    def: &PlantDef,
    header: &csv::StringRecord,
    separator: u8,
    records: impl Iterator<Item = Record>,
    [oldest, now]: [Timestamp; 2],
) -> Result<Rows, Vec<String>> {
    let mut columns = columns(header, separator).map_err(|why| vec![format!("line 1: {why}")])?;
    let (mut rows, mut problems, mut wrong, mut count) = (Rows::new(), Vec::new(), 0, 0);
    for (line, record) in records {
        match record.and_then(|record| columns.row(def, line, &record, [oldest, now])) {
            Ok((tag, sample)) => rows.entry(tag).or_default().push(sample),
            Err(why) => {
                wrong += 1;
                problems.extend((problems.len() < PROBLEMS_MAX).then(|| format!("line {line}: {why}")));
            }
        }
        count += 1;
        if ROWS_MAX < count {
            return Err(vec![format!("found more than {ROWS_MAX} rows: split the file")]);
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

fn columns(header: &csv::StringRecord, separator: u8) -> Result<Columns, String> {
    let named = |name: &str| header.iter().position(|column| column.eq_ignore_ascii_case(name));
    let known = || TIMES.into_iter().chain(OTHERS);
    let is_utc = |column: &str| column.to_ascii_lowercase().contains("utc");
    let is_known = |column: &str| is_utc(column) || known().any(|known| column.eq_ignore_ascii_case(known));
    if let Some(other) = header.iter().position(|column| !is_known(column)) {
        let known: Vec<&str> = known().collect();
        // Not in its own words: until its columns are known, a file may be any file, even one of passwords.
        return Err(format!("column {} is none of samples, expected {}", other + 1, known.join(", ")));
    }
    let needed = |what: &str| named(what).ok_or_else(|| format!("found no column `{what}`"));
    let utc = header.iter().position(is_utc);
    let time = utc.or_else(|| TIMES.into_iter().find_map(named));
    Ok(Columns {
        count: header.len(),
        tag: needed("tag")?,
        time: time.ok_or_else(|| format!("found no column {}", TIMES.join(" or ")))?,
        is_utc: utc.is_some(),
        value: needed("value")?,
        exact: named("exact"),
        quality: named("quality"),
        unit: named("unit"),
        mark: DecimalMark::of(separator),
    })
}

impl Columns {
    fn row(
        &mut self,
        def: &PlantDef,
        line: u64,
        record: &csv::StringRecord,
        [oldest, now]: [Timestamp; 2],
    ) -> Result<(TagId, Sample), String> {
        if record.len() != self.count {
            return Err(format!("found {} cells, expected {}", record.len(), self.count));
        }
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let name = cell(self.tag);
        let tag = def.tag_named(name).ok_or_else(|| format!("found the tag `{name}`, which {} has not", def.name))?;
        let tag_def = def.tag(tag);
        if tag_def.is_text() || !tag_def.is_stored() {
            return Err(format!("{name}: this tag is not stored"));
        }
        let unit =
            self.unit.map(cell).filter(|unit| tag_def.unit_from.is_none() && !["", &tag_def.unit].contains(unit));
        if let Some(unit) = unit {
            return Err(format!("{name}: found the unit `{unit}`, expected `{}`", tag_def.unit));
        }
        let at = in_milliseconds(time(def, cell(self.time), self.is_utc)?);
        if at < oldest || now < at {
            return Err(format!("found the time {at}, expected one from {oldest:.0} to {now:.0}"));
        }
        let quality = self.quality.map(cell).unwrap_or_default();
        let quality = quality_of(quality).ok_or_else(|| {
            format!("found the quality `{quality}`, expected good, or uncertain or bad with its cause: `bad: stale`")
        })?;
        // What SQL has left out of a value that is a DOUBLE.
        let exact = self.exact.map(cell).filter(|exact| !exact.is_empty());
        let value = match (quality, exact.unwrap_or(cell(self.value))) {
            (Quality::Bad(_), "") => None,
            (Quality::Bad(_), found) => {
                return Err(format!("{name}: found the value `{found}`, which is bad: expected none"));
            }
            (Quality::Good | Quality::Uncertain(_), found) => Some(value(tag_def, found, line, &mut self.mark)?),
        };
        Ok((tag, Sample::new(value, quality, at)))
    }
}

fn value(tag: &TagDef, found: &str, line: u64, mark: &mut DecimalMark) -> Result<Exact, String> {
    if let Some((value, _)) = tag.enum_labels.iter().find(|(_, label)| label.eq_ignore_ascii_case(found)) {
        return Ok(Exact::whole(*value));
    }
    let is_bit = |value: Exact| value == 0.0 || value == 1.0;
    let fits = |value: &Exact| match (tag.enum_labels.is_empty(), tag.point.table.is_bits()) {
        (false, _) => tag.label_of(*value).is_some(),
        (true, true) => is_bit(*value),
        // With decimals that the device announces its range is smaller still.
        (true, false) => scale::to_raw(tag, *value, 0).is_some(),
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
fn quality_of(found: &str) -> Option<Quality> {
    match found {
        "" => Some(Quality::Good),
        "uncertain" => Some(Quality::Uncertain(Cause::Stale)),
        "bad" => Some(Quality::Bad(Cause::Stale)),
        word => Quality::from_word(word).filter(|quality| quality.cause().is_none_or(Cause::is_stored)),
    }
}

/// Decides which rows of a tag fill a gap: those at which no stored value is in force. What a station recorded itself is
/// never changed by a file. The last sample of an earlier file is in force up to the next stored one, and without such a
/// one not at all: a file that was split gives the same as the whole.
#[derive(Debug, Default)]
pub struct Filler {
    rows: Vec<Sample>,
    next: usize,
    last: Option<Stored>,
    accepted: Vec<Sample>,
}

/// A stored sample of the tag.
#[derive(Debug, Clone, Copy)]
pub struct Stored {
    /// The sample.
    pub sample: Sample,
    /// It came from a file.
    pub imported: bool,
}

impl Filler {
    /// For the rows of a tag, in order of time.
    pub fn new(rows: Vec<Sample>) -> Filler {
        Filler { rows, ..Filler::default() }
    }

    /// The next stored sample of the tag.
    pub fn stored(&mut self, stored: Stored) {
        let at = stored.sample.at;
        self.decide(|row| row.at < at, Some(at));
        // There is one of this instant already.
        self.next += usize::from(self.rows.get(self.next).is_some_and(|row| row.at == at));
        self.last = Some(stored);
    }

    /// The rows that fill a gap; the others are of no use.
    pub fn end(mut self) -> Vec<Sample> {
        self.decide(|_| true, None);
        self.accepted
    }

    /// Decides on the rows between the last stored sample and the next one.
    fn decide(&mut self, is_due: impl Fn(&Sample) -> bool, next: Option<Timestamp>) {
        let held = |last: Timestamp, at: Timestamp| elapsed(last, at) < HOLD_MAX;
        let last = self.last.filter(|last| {
            let at = last.sample.at;
            last.sample.value.is_some() && (!last.imported || next.is_some_and(|next| held(at, next)))
        });
        while let Some(row) = self.rows.get(self.next).filter(|row| is_due(row)) {
            let in_force = last.is_some_and(|last| held(last.sample.at, row.at));
            self.accepted.extend((!in_force).then_some(*row));
            self.next += 1;
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
