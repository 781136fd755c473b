//! Samples from a CSV file of another program: what is accepted, line by line, and which of them fill a gap.
//!
//! A row is one sample: `tag`, `time` (with offset, or a local time of the plant), `value`, and if there is such a column
//! `quality`, in any order. Where there is a column `exact`, as SQL gives it, what it holds is the value. Cells stand
//! between commas, or between semicolons; then the decimal mark is a comma.

use std::collections::BTreeMap;

use jiff::{Timestamp, civil::DateTime, tz::TimeZone};
use serde::{Deserialize, Serialize};

use crate::{
    history::tiers::in_milliseconds,
    plant::{
        PlantDef,
        def::TagId,
        exact::Exact,
        keyword::Keyword,
        sample::{Cause, Quality, Sample},
        scale,
        tag::TagDef,
        time::elapsed,
    },
    report::step_series::HOLD_MAX,
};

/// Samples of one file: they are all in memory.
const ROWS_MAX: usize = 2_000_000;
/// Problems that are kept in words; all are counted.
const PROBLEMS_MAX: usize = 10;
/// The names of columns, by what they are; of the times the first that is there counts.
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
    tag: usize,
    time: usize,
    value: usize,
    exact: Option<usize>,
    quality: Option<usize>,
    unit: Option<usize>,
    decimal_comma: bool,
}

/// Reads the rows behind a header, whose cells stand between semicolons where the decimal mark is a comma. `Err`: every
/// problem with its line; nothing of the file is used then. Times lie from `oldest` up to `now`.
pub fn parse(
    def: &PlantDef,
    header: &csv::StringRecord,
    decimal_comma: bool,
    records: impl Iterator<Item = csv::Result<csv::StringRecord>>,
    [oldest, now]: [Timestamp; 2],
) -> Result<Rows, Vec<String>> {
    let columns = columns(header, decimal_comma).map_err(|why| vec![format!("line 1: {why}")])?;
    let (mut rows, mut problems, mut wrong, mut count) = (Rows::new(), Vec::new(), 0, 0);
    for record in records {
        let line = |record: &csv::StringRecord| record.position().map_or(0, csv::Position::line);
        let row = match &record {
            Ok(record) => columns.row(def, record, oldest, now).map_err(|why| format!("line {}: {why}", line(record))),
            Err(error) => Err(error.to_string()),
        };
        match row {
            Ok((tag, sample)) => rows.entry(tag).or_default().push(sample),
            Err(why) => {
                wrong += 1;
                problems.extend((problems.len() < PROBLEMS_MAX).then_some(why));
            }
        }
        count += 1;
        if ROWS_MAX < count {
            return Err(vec![format!("found more than {ROWS_MAX} rows: split the file")]);
        }
    }
    for (tag, rows) in &mut rows {
        rows.sort_by_key(|sample| sample.at);
        let doubles = rows.windows(2).filter(|pair| pair[0].at == pair[1].at);
        for pair in doubles {
            wrong += 1;
            let why = format!("{}: found two rows of {}, expected one", def.tag(*tag).name, pair[0].at);
            problems.extend((problems.len() < PROBLEMS_MAX).then_some(why));
        }
    }
    match wrong {
        0 if rows.is_empty() => Err(vec!["found no row behind the header".to_owned()]),
        0 => Ok(rows),
        _ => {
            problems.extend((problems.len() < wrong).then(|| format!("and {} more", wrong - problems.len())));
            Err(problems)
        }
    }
}

fn columns(header: &csv::StringRecord, decimal_comma: bool) -> Result<Columns, String> {
    let named = |name: &str| header.iter().position(|column| column.eq_ignore_ascii_case(name));
    let known = || TIMES.into_iter().chain(OTHERS);
    if let Some(other) = header.iter().position(|column| !known().any(|known| column.eq_ignore_ascii_case(known))) {
        let known: Vec<&str> = known().collect();
        // Not in its own words: until its columns are known, a file may be any file, even one of passwords.
        return Err(format!("column {} is none of samples, expected {}", other + 1, known.join(", ")));
    }
    let needed = |what: &str| named(what).ok_or_else(|| format!("found no column `{what}`"));
    Ok(Columns {
        tag: needed("tag")?,
        time: TIMES.into_iter().find_map(named).ok_or_else(|| format!("found no column {}", TIMES.join(" or ")))?,
        value: needed("value")?,
        exact: named("exact"),
        quality: named("quality"),
        unit: named("unit"),
        decimal_comma,
    })
}

impl Columns {
    fn row(
        &self,
        def: &PlantDef,
        record: &csv::StringRecord,
        oldest: Timestamp,
        now: Timestamp,
    ) -> Result<(TagId, Sample), String> {
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
        let at = in_milliseconds(time(def, cell(self.time))?);
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
            (Quality::Good | Quality::Uncertain(_), found) => Some(self.value(tag_def, found)?),
        };
        Ok((tag, Sample::new(value, quality, at)))
    }

    fn value(&self, tag: &TagDef, found: &str) -> Result<Exact, String> {
        if let Some((value, _)) = tag.enum_labels.iter().find(|(_, label)| label.eq_ignore_ascii_case(found)) {
            return Ok(Exact::whole(*value));
        }
        let number = if self.decimal_comma { found.replace(',', ".") } else { found.to_owned() };
        let number = number.parse::<Exact>().ok().filter(|number| number.is_finite());
        let is_bit = |value: Exact| value == 0.0 || value == 1.0;
        let fits = |value: &Exact| match (tag.enum_labels.is_empty(), tag.point.table.is_bits()) {
            (false, _) => tag.label_of(*value).is_some(),
            (true, true) => is_bit(*value),
            // With decimals that the device announces its range is smaller still.
            (true, false) => scale::to_raw(tag, *value, 0).is_some(),
        };
        let labels: Vec<&str> = tag.enum_labels.iter().map(|(_, label)| label.as_str()).collect();
        let expected = if labels.is_empty() { "a number that its type can hold".into() } else { labels.join(", ") };
        number.filter(fits).ok_or_else(|| format!("{}: found `{found}`, expected {expected}", tag.name))
    }
}

/// An instant with its offset, or a local time of the plant that was there once.
fn time(def: &PlantDef, found: &str) -> Result<Timestamp, String> {
    if let Ok(at) = found.parse::<Timestamp>() {
        return Ok(at);
    }
    let has_offset = found.contains(['+', 'Z', 'z', '[']);
    let local: Option<DateTime> = found.parse().ok().filter(|_| !has_offset);
    let local =
        local.ok_or_else(|| format!("found the time `{found}`, expected 2026-11-21T06:00:00 or with an offset"))?;
    let unambiguous = def.time_zone.to_ambiguous_timestamp(local).unambiguous();
    unambiguous.map_err(|_| format!("found the local time `{found}`, which was twice or never: expected an offset"))
}

fn quality_of(found: &str) -> Option<Quality> {
    let cause = |words: &str| match words.trim_start_matches(':').trim() {
        "" => Some(Cause::Stale),
        words => Cause::from_word(words)
            .filter(|cause| Quality::Bad(*cause).code() <= Quality::Bad(Cause::StationOff).code()),
    };
    match found {
        "" | "good" => Some(Quality::Good),
        _ => match (found.strip_prefix("uncertain"), found.strip_prefix("bad")) {
            (Some(words), _) => cause(words).map(Quality::Uncertain),
            (None, Some(words)) => cause(words).map(Quality::Bad),
            (None, None) => None,
        },
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
