//! Records as they are stored: of each its table, and which columns hold which field of it. What writes or reads a record goes by
//! this.

use std::{sync::Arc, time::Duration};

use duckdb::{
    Row,
    types::{FromSql, Value},
};
use jiff::Timestamp;

use super::store::{instant, utc};
use crate::plant::{
    alarm_def::Priority,
    batch::{BatchEvent, BatchRecord},
    control_run::{ControlRun, Figure, RunCause, RunState},
    exact::Exact,
    keyword::Keyword,
    line_minute::LineMinute,
    record::{ActionRecord, AlarmEvent, AlarmRecord, ChainHash, FirstOut},
    report::{PeriodKind, ReportEvent, ReportRecord},
};

/// A record with a table of its own. Behind its columns each row has the epoch of the clock by which it was stored.
pub(super) trait Stored: Sized {
    const TABLE: &'static str;
    const COLUMNS: &'static [&'static str];

    /// Its columns, to be selected.
    fn columns() -> String {
        Self::COLUMNS.join(", ")
    }

    /// A row of its columns.
    fn write(&self) -> Vec<Value>;

    /// From a row that begins with its columns.
    fn read(row: &Row) -> duckdb::Result<Self>;

    /// From a row of its columns and the epoch.
    fn read_dated(row: &Row) -> duckdb::Result<(u16, Self)> {
        Ok((row.get(Self::COLUMNS.len())?, Self::read(row)?))
    }
}

macro_rules! stored {
    ($record:ident in $table:literal { $($field:ident: $($column:literal)+,)+ } $(besides $other:ident: $value:expr)?) => {
        impl Stored for $record {
            const TABLE: &'static str = $table;
            const COLUMNS: &'static [&'static str] = &[$($($column),+),+];

            fn write(&self) -> Vec<Value> {
                let mut row = Vec::with_capacity(Self::COLUMNS.len() + 1);
                $(self.$field.put(&mut row);)+
                row
            }

            fn read(row: &Row) -> duckdb::Result<$record> {
                let mut cells = Cells { row, next: 0 };
                Ok($record { $($field: Field::fetch(&mut cells)?,)+ $($other: $value)? })
            }
        }
    };
}

stored! { AlarmRecord in "alarm_journal" {
    at: "utc",
    subject: "subject",
    message: "message",
    priority: "priority",
    event: "event",
    value: "value" "value_rest",
    limit: "limit_value",
    by: "by_whom",
    reason: "reason",
    until: "until_utc",
    first_out: "first_out_utc" "first_out_rank",
} besides identity: None }

stored! { ActionRecord in "operator_action" {
    at: "utc",
    by: "by_whom",
    action: "action",
    target: "target",
    old: "old_value",
    new: "new_value",
    outcome: "outcome",
    from: "from_where",
    note: "note",
    chain_hash: "number" "hash",
} }

stored! { LineMinute in "line_minute" {
    at: "utc",
    line: "line",
    requests: "requests",
    ok: "ok",
    timeouts: "timeouts",
    corrupt: "corrupt",
    exceptions: "exceptions",
    retries: "retries",
    late: "late",
    missed: "missed",
    sent_bytes: "sent_bytes",
    received_bytes: "received_bytes",
    utilisation: "utilisation",
    reply_p99_ms: "reply_p99_ms",
    reply_max_ms: "reply_max_ms",
} }

stored! { BatchRecord in "batch" {
    at: "utc",
    batch: "name",
    number: "number",
    place: "place",
    event: "event",
    phase: "phase",
} }

stored! { ControlRun in "control_run" {
    from: "utc",
    controller: "controller",
    number: "number",
    place: "place",
    state: "state",
    cause: "cause",
    detail: "detail",
    seen: "begin_seen",
    until: "until_utc",
    sv_before: "sv_before",
    sv: "sv",
    pv: "pv",
    unit: "unit",
    decimals: "decimals",
    band: "band",
    settings: "settings",
    settings_changed: "settings_changed",
    at_sv: "at_sv",
    steady: "steady",
    rise: "rise",
    overshoot: "overshoot",
    offset: "final_offset",
    iae: "iae",
    energy: "kwh" "kwh_good",
    good: "good",
} }

stored! { ReportRecord in "report" {
    at: "utc",
    period: "period",
    name: "name",
    from: "from_utc",
    to: "to_utc",
    format: "format",
    file: "file",
    sha256: "sha256",
    event: "event",
    attempts: "attempts",
    error: "error",
} }

/// The cells of a row, one after the other.
struct Cells<'row> {
    row: &'row Row<'row>,
    next: usize,
}

impl Cells<'_> {
    fn next<T: FromSql>(&mut self) -> duckdb::Result<T> {
        self.next += 1;
        self.row.get(self.next - 1)
    }
}

/// What one or some columns hold.
trait Field: Sized {
    fn put(&self, row: &mut Vec<Value>);
    fn fetch(cells: &mut Cells) -> duckdb::Result<Self>;
}

/// Of what the engine knows by itself.
macro_rules! plain {
    ($($kind:ty)+) => {$(
        impl Field for $kind {
            fn put(&self, row: &mut Vec<Value>) {
                row.push((*self).into());
            }
            fn fetch(cells: &mut Cells) -> duckdb::Result<$kind> {
                cells.next()
            }
        }
        impl Field for Option<$kind> {
            fn put(&self, row: &mut Vec<Value>) {
                row.push(self.map_or(Value::Null, Value::from));
            }
            fn fetch(cells: &mut Cells) -> duckdb::Result<Option<$kind>> {
                cells.next()
            }
        }
    )+};
}

plain!(bool u8 u32 f32 f64);

/// Of what has a word.
macro_rules! words {
    ($($kind:ty)+) => {$(
        impl Field for $kind {
            fn put(&self, row: &mut Vec<Value>) {
                row.push(self.word().to_owned().into());
            }
            fn fetch(cells: &mut Cells) -> duckdb::Result<$kind> {
                <$kind>::from_word(&cells.next::<String>()?).ok_or(duckdb::Error::InvalidQuery)
            }
        }
    )+};
}

words!(AlarmEvent BatchEvent PeriodKind ReportEvent RunCause RunState);

impl Field for Option<Arc<str>> {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(self.as_deref().map_or(Value::Null, |text| text.to_owned().into()));
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<Arc<str>>> {
        cells.next::<Option<String>>().map(|text| text.map(Arc::from))
    }
}

/// Where an earlier version stored nothing it is empty.
impl Field for Arc<str> {
    fn put(&self, row: &mut Vec<Value>) {
        row.push((**self).to_owned().into());
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Arc<str>> {
        Option::fetch(cells).map(Option::unwrap_or_default)
    }
}

impl Field for Option<Timestamp> {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(self.map_or(Value::Null, utc));
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<Timestamp>> {
        cells.next::<Option<i64>>().map(|micros| micros.and_then(instant))
    }
}

impl Field for Timestamp {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(utc(*self));
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Timestamp> {
        Option::fetch(cells)?.ok_or(duckdb::Error::InvalidQuery)
    }
}

/// A count of a minute; more than four thousand million is none.
impl Field for u64 {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(u32::try_from(*self).unwrap_or(u32::MAX).into());
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<u64> {
        cells.next::<u32>().map(u64::from)
    }
}

impl Field for Priority {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(self.number().into());
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Priority> {
        let number: u8 = cells.next()?;
        Priority::ALL.into_iter().find(|priority| priority.number() == number).ok_or(duckdb::Error::InvalidQuery)
    }
}

/// The nearest DOUBLE, and what it lacks.
impl Field for Option<Exact> {
    fn put(&self, row: &mut Vec<Value>) {
        self.map(Exact::near).put(row);
        self.and_then(Exact::rest).put(row);
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<Exact>> {
        let (near, rest) = (Option::fetch(cells)?, Option::fetch(cells)?);
        Ok(near.map(|near| Exact::of_parts(near, rest)))
    }
}

/// Two numbers that are known together.
impl Field for Option<(f64, f64)> {
    fn put(&self, row: &mut Vec<Value>) {
        let (one, other) = self.unzip();
        one.put(row);
        other.put(row);
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<(f64, f64)>> {
        let (one, other): (Option<f64>, Option<f64>) = (Option::fetch(cells)?, Option::fetch(cells)?);
        Ok(one.zip(other))
    }
}

impl Field for Option<FirstOut> {
    fn put(&self, row: &mut Vec<Value>) {
        self.map(|first_out| first_out.began).put(row);
        self.map(|first_out| first_out.rank).put(row);
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<FirstOut>> {
        let (began, rank): (Option<Timestamp>, Option<u32>) = (Option::fetch(cells)?, Option::fetch(cells)?);
        Ok(began.zip(rank).map(|(began, rank)| FirstOut { began, rank }))
    }
}

/// Number and hash of an entry; of an action that the audit log does not have, neither.
impl Field for Option<ChainHash> {
    fn put(&self, row: &mut Vec<Value>) {
        row.push(self.as_ref().map_or(Value::Null, |entry| entry.number.into()));
        row.push(self.as_ref().map_or(Value::Null, |entry| entry.hash.to_vec().into()));
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Option<ChainHash>> {
        let (number, hash): (Option<u64>, Option<Vec<u8>>) = (cells.next()?, cells.next()?);
        Ok(chain_hash(number, hash))
    }
}

/// `None` where a part is missing, or is none.
pub(super) fn chain_hash(number: Option<u64>, hash: Option<Vec<u8>>) -> Option<ChainHash> {
    Some(ChainHash { number: number?, hash: hash?.try_into().ok()? })
}

/// What a [`Figure`] is that is not known; not yet reached is NULL.
const UNKNOWN: f64 = -1.0;

/// Seconds of a figure as they are stored.
pub(super) fn seconds(figure: Figure) -> Option<f64> {
    match figure {
        Figure::NotYet => None,
        Figure::After(time) => Some(time.as_secs_f64()),
        Figure::Unknown => Some(UNKNOWN),
    }
}

impl Field for Figure {
    fn put(&self, row: &mut Vec<Value>) {
        seconds(*self).put(row);
    }
    fn fetch(cells: &mut Cells) -> duckdb::Result<Figure> {
        let seconds: Option<f64> = cells.next()?;
        let after = |seconds| Duration::try_from_secs_f64(seconds).map_or(Figure::Unknown, Figure::After);
        Ok(seconds.map_or(Figure::NotYet, after))
    }
}
