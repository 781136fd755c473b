//! The queries in SQL. Times are UTC; local time is Rust's business.

mod migrations;
mod standing;

use std::ops::Range;

use super::stored::Stored;
use crate::{
    history::tiers::Tier,
    plant::{
        command::{CommandKind, Outcome},
        def::{ParquetVersion, ProcedureId, TagId},
        exact::Exact,
        line_minute::LineMinute,
        record::{ActionRecord, AlarmRecord},
        recorded_action::RecordedAction,
    },
};

pub use migrations::MIGRATIONS;
pub use standing::{active_at, named_since, standing_at, suppressing_at};

/// The epoch of samples that no station recorded.
pub const IMPORTED: u16 = u16::MAX;
/// Enters an import.
pub const ENTER_IMPORT: &str = "INSERT INTO import VALUES (?, ?, ?, ?, ?)";
/// What was imported.
pub const IMPORTS: &str = "SELECT utc, file, from_utc, to_utc, rows FROM import ORDER BY rowid";

/// Holds the number of migrations done.
pub const CREATE_VERSION: &str = "CREATE TABLE IF NOT EXISTS schema_version (version UINTEGER NOT NULL)";
/// 0 before the first.
pub const VERSION: &str = "SELECT coalesce(max(version), 0) FROM schema_version";
/// One more is done.
pub const SET_VERSION: &str = "INSERT INTO schema_version VALUES (?)";

/// Adds a tag, and does not.
pub const TRY_A_TAG: &str = "BEGIN; INSERT INTO tag VALUES (65535, '', ''); ROLLBACK";
/// The dictionary of tags.
pub const TAGS: &str = "SELECT id, name, unit FROM tag";

/// The last commit.
pub const LAST_COMMIT: &str = "SELECT identity, number, first_utc, last_utc, epoch FROM last_commit";
/// The next one.
pub const SET_LAST_COMMIT: &str = "UPDATE last_commit SET number = ?, first_utc = ?, last_utc = ?, epoch = ?";

/// Rows of all tables.
pub const COUNT_ROWS: &str = "SELECT (SELECT count(*) FROM sample) + (SELECT count(*) FROM alarm_journal)
    + (SELECT count(*) FROM operator_action) + (SELECT count(*) FROM line_minute) + (SELECT count(*) FROM batch)
    + (SELECT count(*) FROM report) + (SELECT count(*) FROM control_run)";

/// Ends every curve: a row (time, no value, quality, epoch, no rest) for each tag whose last row since an instant has another quality.
pub const END_CURVES: &str = "INSERT INTO sample
    SELECT $1, tag, NULL, $2, $3, NULL FROM (SELECT tag, arg_max(quality, rowid) AS last FROM sample WHERE utc >= $4 GROUP BY tag)
    WHERE last <> $2";

/// Samples in a span, of some stored numbers of tags or of all, from the table or from files as well, each in the order in
/// which they were written; with what their values lack, where the files have that.
pub fn samples(tags: &str, table: bool, files: Option<&str>, rests: bool) -> String {
    let rest = if rests { ", rest" } else { "" };
    let from = |source: &str| {
        format!("SELECT utc, tag, value, quality{rest} FROM {source} WHERE utc >= $1 AND utc < $2{tags}")
    };
    let sources = files.into_iter().chain(table.then_some("sample"));
    sources.map(from).collect::<Vec<_>>().join(" UNION ALL ")
}

/// The last instant of which a value was stored in an epoch, of what is not archived.
pub const LAST_OF_EPOCH: &str = "SELECT epoch_us(max(utc)) FROM sample WHERE epoch = ? AND value IS NOT NULL";

/// The value of each of these tags that a station stored last, whatever the clock showed then; since an instant.
pub fn last_written(files: Option<&str>, tags: impl Iterator<Item = u16>) -> String {
    let tags = tags.map(|tag| tag.to_string()).collect::<Vec<_>>().join(", ");
    let from = |source: &str| {
        format!(
            "SELECT tag, epoch, utc, value FROM {source} WHERE epoch_us(utc) >= $1 AND tag IN ({tags}) AND value IS NOT NULL
                AND epoch IS DISTINCT FROM {IMPORTED}"
        )
    };
    let sources = files.into_iter().chain(["sample"]).map(from).collect::<Vec<_>>().join(" UNION ALL ");
    format!("SELECT tag, last(value ORDER BY epoch NULLS FIRST, utc) FROM ({sources}) GROUP BY tag")
}

/// The condition for some stored numbers of tags; for all of them without a list.
pub fn of_tags(list: Option<&[String]>) -> String {
    match list {
        None => String::new(),
        Some([]) => " AND false".into(),
        Some(list) => format!(" AND tag IN ({})", list.join(", ")),
    }
}
/// Rows of the table of samples, from what the engine keeps of it: nothing is read.
pub const ROWS_ABOUT: &str =
    "SELECT estimated_size + (SELECT coalesce(sum(rows), 0) FROM archive WHERE tier = 'raw')::BIGINT
    FROM duckdb_tables() WHERE table_name = 'sample'";
/// Samples of the table in a span.
pub const UNARCHIVED: &str = "SELECT epoch_us(utc), tag, value, quality, rest FROM sample WHERE utc >= $1 AND utc < $2
    ORDER BY utc, rowid LIMIT $3";
/// When the oldest sample of the table was stored.
pub const OLDEST_IN_TABLE: &str = "SELECT min(utc) FROM sample";
/// The hours of a span that have samples that are not archived, counted from 1970.
pub const HOURS_IN_TABLE: &str =
    "SELECT DISTINCT epoch_us(utc) // 3_600_000_000 FROM sample WHERE utc >= ? AND utc < ? ORDER BY 1";
/// When the first sample in the file was stored.
pub const FIRST_STORED: &str = "SELECT epoch_us(utc) FROM sample LIMIT 1";
/// The first and the last instant of the journal.
pub const JOURNALED: &str = "SELECT min(utc), max(utc) FROM alarm_journal";

/// When stations recorded.
pub const RECORDED: &str = "SELECT epoch, epoch_us(from_utc), epoch_us(to_utc) FROM recorded";
/// The last of these.
pub const LAST_RECORDED: &str = "SELECT epoch, epoch_us(from_utc), epoch_us(to_utc) FROM recorded
    WHERE epoch IS NOT NULL ORDER BY epoch DESC, to_utc DESC LIMIT 1";
/// Another one.
pub const ENTER_RECORDED: &str = "INSERT INTO recorded VALUES (?, ?, ?)";
/// It goes on.
pub const WIDEN_RECORDED: &str = "UPDATE recorded SET from_utc = ?, to_utc = ? WHERE epoch = ? AND from_utc = ?";
/// Whether a station that ended in order wrote so at an instant.
pub const IS_MARKED_OFF: &str = "SELECT count(*) > 0 FROM sample WHERE utc = ? AND quality = ?";

/// The order of a list, and its limit.
pub const NEWEST: &str = "ORDER BY utc DESC, rowid DESC LIMIT ?";
/// The other one, in which it was written.
pub const OLDEST: &str = "ORDER BY coalesce(epoch, 0), utc, rowid LIMIT ?";

/// Alarm events in a span, of the epochs of a condition.
pub fn journal(epochs: &str, order: &str) -> String {
    format!("SELECT {} FROM alarm_journal WHERE utc >= ? AND utc < ?{epochs} {order}", AlarmRecord::columns())
}

/// Of each alarm the last event of every kind (and step) before an instant, as written: all that its state depends on.
pub fn restore() -> String {
    let columns = AlarmRecord::columns();
    format!(
        "SELECT {columns} FROM alarm_journal
         WHERE rowid IN (SELECT max(rowid) FROM alarm_journal WHERE utc < $2
            GROUP BY subject, message, event, CASE WHEN event IN ('step done', 'step undone') THEN reason END)
         ORDER BY rowid LIMIT $1"
    )
}

/// Actions on the plant in a span, without those on users and terminals.
pub fn actions(order: &str) -> String {
    let others = RecordedAction::words_beside_process().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(", ");
    format!(
        "SELECT {} FROM operator_action WHERE utc >= ? AND utc < ? AND action NOT IN ({others}) {order}",
        ActionRecord::columns()
    )
}

/// The corrections of counters in a span that were accepted, oldest first.
pub fn corrections(epochs: &str) -> String {
    let done = CommandKind::CorrectCounter { tag: TagId(0), amount: Exact::default() }.label();
    // `verified` is what it was called before.
    format!(
        "SELECT {} FROM operator_action
         WHERE action = ? AND outcome IN ('{done}', 'verified') AND utc >= ? AND utc < ?{epochs} ORDER BY utc, rowid",
        ActionRecord::columns()
    )
}

/// Actions in a span, newest first, with a part of who, of the action, and of the words of all columns; large and small
/// letters are the same. An empty part is in everything.
pub fn audit() -> String {
    format!(
        "SELECT {} FROM operator_action WHERE utc >= $1 AND utc < $2
            AND contains(lower(by_whom), lower($4)) AND contains(lower(action), lower($5)) AND contains(lower(concat_ws(' ', by_whom, from_where, action, target, old_value, new_value, outcome, note)),
                lower($6))
         ORDER BY utc DESC, rowid DESC LIMIT $3",
        ActionRecord::columns()
    )
}

/// The latest actions without a chain hash, newest first.
pub fn unchained(limit: usize) -> String {
    format!(
        "SELECT {} FROM operator_action WHERE number IS NULL ORDER BY rowid DESC LIMIT {limit}",
        ActionRecord::columns()
    )
}

/// The last record of a procedure: its start, what is written before its end, or its end; a refused start is none.
pub fn latest_procedure() -> String {
    format!(
        "SELECT {} FROM operator_action WHERE (action = '{}' AND outcome IN ('{}', '{}')) OR action IN ('{}', '{}')
         ORDER BY rowid DESC LIMIT 1",
        ActionRecord::columns(),
        RecordedAction::StartProcedure.word(),
        CommandKind::StartProcedure(ProcedureId(0)).label(),
        // So it was called before.
        Outcome::Verified.label(),
        RecordedAction::WriteSafeState.word(),
        RecordedAction::EndProcedure.word()
    )
}

/// Number and hash of the last entry of the audit log before an instant.
pub const LAST_ENTRY: &str = "SELECT number, hash FROM operator_action WHERE utc < ? AND number IS NOT NULL
    ORDER BY number DESC LIMIT 1";

/// Minutes of a line in a span, oldest first; of more than the limit the latest.
pub fn line_minutes() -> String {
    format!(
        "SELECT * FROM (SELECT {} FROM line_minute WHERE utc >= $1 AND utc < $2 AND line = $4
         ORDER BY utc DESC LIMIT $3) ORDER BY utc",
        LineMinute::columns()
    )
}

/// How files of the archive are written. Of aggregates, which lie by tag, a trend needs few rows: smaller groups, and with
/// snappy it takes 0.6 of the time of zstd, for minutes in 14 to 31 % more room, by their values (measured).
pub fn parquet(tier: Tier, version: ParquetVersion) -> String {
    let options = match tier {
        // A dictionary of a thousand time stamps takes more room than the stamps themselves (measured).
        Tier::Raw => "COMPRESSION zstd, ROW_GROUP_SIZE 122880, DICTIONARY_SIZE_LIMIT 1000",
        Tier::Minute | Tier::Hour => "COMPRESSION snappy, ROW_GROUP_SIZE 20480",
    };
    format!("FORMAT parquet, PARQUET_VERSION {}, {options}", version.word())
}

/// Writes rows to a file in their order. Samples have whole milliseconds: a fifth less room than with microseconds, in which
/// an earlier version wrote them (measured). As they are read there is no difference.
pub fn copy_to(tier: Tier, version: ParquetVersion, rows: &str, to: &str) -> String {
    let stamp = if tier == Tier::Raw { "TIMESTAMP_MS" } else { "TIMESTAMP" };
    format!("COPY (SELECT * REPLACE (utc::{stamp} AS utc) FROM ({rows})) TO {to} ({})", parquet(tier, version))
}

/// When the oldest sample was stored that is not archived, from an instant on.
pub const OLDEST_SAMPLE: &str = "SELECT min(utc) FROM sample WHERE utc >= ?";

/// Samples that are not archived.
pub const COUNT_SAMPLES: &str = "SELECT count(*) FROM sample";
/// The files of the archive, oldest first.
pub const FILES: &str =
    "SELECT tier, path, from_utc, to_utc, rows, bytes, sha256, rests FROM archive ORDER BY from_utc, to_utc, rowid";
/// Enters a file.
pub const ENTER_FILE: &str = "INSERT INTO archive VALUES (?, ?, ?, ?, ?, ?, ?, ?)";
/// Removes one.
pub const REMOVE_FILE: &str = "DELETE FROM archive WHERE path = ?";
/// Notes a file that is deleted.
pub const ENTER_DELETED: &str = "INSERT INTO deleted VALUES (?, ?, ?)";
/// Until when files of a tier were deleted.
pub const DELETED_UNTIL: &str = "SELECT max(until_utc) FROM deleted WHERE tier = ?";
/// Deletes the samples of a span.
pub const DELETE_SAMPLES: &str = "DELETE FROM sample WHERE utc >= ? AND utc < ?";
/// Widens what is known to be stored.
pub const WIDEN: &str = "UPDATE last_commit SET
    first_utc = least(coalesce(first_utc, $1), $1), last_utc = greatest(coalesce(last_utc, $2), $2)";

/// Columns of a file of a tier; of one with `rests` those too that hold what its numbers lack.
pub fn columns(tier: Tier, rests: bool) -> &'static str {
    match (tier, rests) {
        (Tier::Raw, false) => "utc, tag, value, quality, epoch",
        (Tier::Raw, true) => "utc, tag, value, quality, epoch, rest",
        (Tier::Minute | Tier::Hour, false) => "utc, tag, min, max, mean, first, last, gain, good_ms, n",
        (Tier::Minute | Tier::Hour, true) => {
            "utc, tag, min, max, mean, first, last, gain, good_ms, n, min_rest, max_rest, first_rest, last_rest, gain_rest"
        }
    }
}

/// The same of a file without such columns.
pub fn columns_without_rests(tier: Tier) -> String {
    let columns = columns(tier, true).split(", ");
    let column = |name: &str| if name.ends_with("rest") { format!("NULL::DOUBLE AS {name}") } else { name.to_owned() };
    columns.map(column).collect::<Vec<_>>().join(", ")
}

/// Whether a file has such columns.
pub fn has_rests(file: &str) -> String {
    format!("SELECT count(*) > 0 FROM parquet_schema({file}) WHERE name LIKE '%rest'")
}

/// Whether anything in a span of the table, or of what was formed, lacks something.
pub fn any_rests(tier: Tier, span: &Range<i64>) -> String {
    let rests = columns(tier, true).split(", ").filter(|name| name.ends_with("rest"));
    let counts = rests.map(|name| format!("count({name})")).collect::<Vec<_>>().join(" + ");
    format!("SELECT {counts} > 0 FROM {} WHERE {}", table_of(tier), within(span))
}

fn table_of(tier: Tier) -> &'static str {
    match tier {
        Tier::Raw => "sample",
        Tier::Minute => FORMED[0],
        Tier::Hour => FORMED[1],
    }
}

/// The tables in which minutes and hours are formed.
pub const FORMED: [&str; 2] = ["m1_formed", "h1_formed"];

/// Makes them, of this connection alone. `gain` is how far it rose from the first value to the last, all rises added, `good_ms` for
/// how long the values were good, `n` how many samples were stored.
pub fn form_tables() -> String {
    let columns = "utc TIMESTAMP NOT NULL, tag USMALLINT NOT NULL, min DOUBLE NOT NULL, max DOUBLE NOT NULL, mean DOUBLE NOT NULL,
        first DOUBLE NOT NULL, last DOUBLE NOT NULL, gain DOUBLE NOT NULL, good_ms UINTEGER NOT NULL, n UINTEGER NOT NULL,
        min_rest DOUBLE, max_rest DOUBLE, first_rest DOUBLE, last_rest DOUBLE, gain_rest DOUBLE";
    FORMED.map(|table| format!("CREATE OR REPLACE TEMP TABLE {table} ({columns});")).concat()
}

/// Where the clock was set back, of the rows of each epoch one: what rises from one to the other is not known.
pub fn unite_epochs() -> String {
    let alone = |rest: &str| format!("CASE WHEN count(*) = 1 THEN any_value({rest}) END");
    let [min, max, first, last] = ["min_rest", "max_rest", "first_rest", "last_rest"].map(alone);
    let unite = |table: &str| {
        format!(
            "CREATE OR REPLACE TEMP TABLE united AS SELECT utc, tag, min(min) AS min, max(max) AS max,
                sum(mean * good_ms) / sum(good_ms) AS mean, first(first ORDER BY rowid) AS first, last(last ORDER BY rowid) AS last,
                sum(gain) AS gain, sum(good_ms)::UINTEGER AS good_ms, sum(n)::UINTEGER AS n, {min} AS min_rest,
                {max} AS max_rest, {first} AS first_rest, {last} AS last_rest, sum(gain_rest) AS gain_rest
            FROM {table} GROUP BY utc, tag;
            DELETE FROM {table}; INSERT INTO {table} FROM united; DROP TABLE united;"
        )
    };
    FORMED.map(unite).concat()
}

fn within(span: &Range<i64>) -> String {
    format!("utc >= make_timestamp({}) AND utc < make_timestamp({})", span.start, span.end)
}

/// The samples of a span as they are archived: in whole milliseconds.
pub fn samples_of(span: &Range<i64>, rests: bool) -> String {
    let columns = columns(Tier::Raw, rests).replacen("utc", "date_trunc('millisecond', utc) AS utc", 1);
    format!("SELECT {columns} FROM sample WHERE {}", within(span))
}

/// What was formed of a span.
pub fn formed(tier: Tier, span: &Range<i64>, rests: bool) -> String {
    format!("SELECT {} FROM {} WHERE {}", columns(tier, rests), table_of(tier), within(span))
}

/// The rows of a file with those of a span replaced by what was formed of it.
pub fn others(tier: Tier, file: &str, span: &Range<i64>, rests: bool) -> String {
    let (columns, formed) = (columns(tier, rests), formed(tier, span, rests));
    format!("SELECT * FROM (SELECT {columns} FROM {file} WHERE NOT ({}) UNION ALL {formed})", within(span))
}

/// The rows of a file, and what was formed of a span that it does not have.
pub fn added(tier: Tier, file: &str, span: &Range<i64>, rests: bool) -> String {
    let (columns, formed) = (columns(tier, rests), formed(tier, span, rests));
    format!(
        "SELECT * FROM (SELECT {columns} FROM {file} UNION ALL {formed}
            AND (tag, utc) NOT IN (SELECT (tag, utc) FROM {file} WHERE {}))",
        within(span)
    )
}

/// An hour of files of samples that overlap.
pub fn hour_of(files: &str, hour: &Range<i64>, rests: bool) -> String {
    let columns = columns(Tier::Raw, rests);
    format!("(SELECT {columns} FROM {files} WHERE {} ORDER BY tag, utc, epoch)", within(hour))
}

/// Rows of files in a span.
pub fn count_rows_of(files: &str, span: &Range<i64>) -> String {
    format!("SELECT count(*) FROM {files} WHERE {}", within(span))
}

/// Samples in a span that are not archived.
pub fn count_samples(span: &Range<i64>) -> String {
    count_rows_of("sample", span)
}

/// Rows of aggregates in a span; what they are not wanted for is not read: nothing stands in its place.
pub fn aggregates(files: &str, tags: &str, rests: bool, whole: bool) -> String {
    let columns = columns(Tier::Minute, rests);
    let nothing = if whole { "" } else { " REPLACE (0.0::DOUBLE AS first, 0.0::DOUBLE AS gain, 0::UINTEGER AS n)" };
    format!("SELECT *{nothing} FROM (SELECT {columns} FROM {files} WHERE utc >= $1 AND utc < $2{tags})")
}
