//! The history as tables for SQL of others: an engine of its own in this process, that reads the files of the archive and a
//! copy of what is not archived yet. It cannot reach any other file, and what it is asked cannot reach the station.
//!
//! | view | columns |
//! |---|---|
//! | `sample` | `utc`, `tag`, `value`, `unit`, `quality` (`good`, `uncertain: …`, `bad: …`), `exact` |
//! | `m1`, `h1` | `utc` (begin), `tag`, `min`, `max`, `mean` (over good time), `first`, `last`, `gain` (all rises), `good_ms`, `n` (samples), `unit`: of what is archived; `min_exact`, `max_exact`, `first_exact`, `last_exact`, `gain_exact` |
//! | `alarm` | `utc`, `subject`, `message`, `priority` (1–4), `event`, `value`, `limit_value`, `by_whom`, `reason`, `value_exact` |
//! | `batch` | `utc` (begin), `until` (NULL while it runs), `batch`, `number`, `minutes`, `begin_seen`, `end_seen` |
//! | `phase` | `utc` (begin of the batch), `batch`, `number`, `phase` (`unknown` as well), `minutes` |
//! | `run` | control runs: `utc` (begin), `until`, `controller`, `number`, `state`, `cause`, `detail`, `sv_before`, `sv`, `pv`, `unit`, `band`, `settings`, `at_sv_s`, `steady_s`, `rise_s` (NULL not come to, -1 unknown), `overshoot`, `final_offset`, `iae`, `kwh`, `kwh_good`, `good` |
//! | `report` | automatic reports: `utc` (of `event`, its last one), `period`, `name`, `begin`, `until`, `format`, `file`, `sha256`, `event`, `attempts`, `error` |
//! | `action` | `utc`, `by_whom`, `from_where`, `action`, `target`, `old_value`, `new_value`, `outcome`, `note` |
//!
//! Of a number of more than 15 digits, as of a 64-bit counter, all of them stand in `exact`; where a DOUBLE would round it, the
//! column that is one is NULL.
//!
//! A TIMESTAMP is UTC, and a file says so, unless its name has `local` in it; `local_time(utc)` is the local time of the plant with
//! its offset.

use std::{path::Path, sync::Arc, time::Duration};

use duckdb::{Connection, params};

use super::{
    archive::{any_rests, paths, quoted, table},
    interrupt::{Interrupt, Open},
    store::{engine, utc},
    stored::seconds,
};
use crate::{
    history::{ArchiveFile, HistoryError, Overview, Unarchived, tiers::Tier},
    plant::{
        PlantDef,
        batch::Batch,
        control_run::ControlRun,
        def::CsvDialect,
        exact::Exact,
        record::{ActionRecord, AlarmRecord},
        report::ReportRecord,
        sample::{Cause, Quality, Sample},
    },
};

/// Of the engine; what does not fit is kept in its folder.
const MEMORY: &str = "256MB";

/// Letters of a value in a table for a screen.
const CELL_MAX: usize = 2_000;

/// The view of that name.
const SAMPLE: &str = "SELECT utc, tag, value, unit, quality, exact FROM stored";
/// By time and tag; what is of one instant and tag as it was stored.
pub const IN_ORDER: &str = "utc, tag, place, n";

/// An engine with the tables.
pub struct Tables {
    open: Open,
    db: Connection,
}

/// A row as texts; `None` where it is NULL.
pub type Row = Vec<Option<String>>;

/// How a result is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// With a header.
    Csv(CsvDialect),
    /// One array of objects.
    Json,
    /// Version 1.
    Parquet,
}

impl Tables {
    /// Empty tables. `folder` is for what does not fit into memory, and for results.
    pub fn new(def: &PlantDef, overview: &Overview, folder: &Path) -> Result<Tables, HistoryError> {
        let db = Connection::open_in_memory().map_err(engine)?;
        let tables = Tables { open: Open::default(), db };
        let archive = format!("{}/", overview.folder.display());
        tables.run(&format!(
            "SET memory_limit = '{MEMORY}'; SET threads = 2; SET temp_directory = {folder};
             SET autoinstall_known_extensions = false; SET autoload_known_extensions = false;
             SET allowed_directories = [{archive}, {folder}]; SET enable_external_access = false;
             SET lock_configuration = true;
             CREATE TABLE tags (id USMALLINT, name VARCHAR, unit VARCHAR);
             CREATE TABLE qualities (code UTINYINT, quality VARCHAR);
             CREATE TABLE unarchived (utc TIMESTAMP, tag VARCHAR, unit VARCHAR, value DOUBLE, rest DOUBLE, quality UTINYINT);
             CREATE MACRO local_clock(t) AS timezone({zone}, timezone('UTC', t));
             CREATE MACRO local_offset(t) AS (epoch_ms(local_clock(t)) - epoch_ms(t)) // 60000;
             CREATE MACRO local_time(t) AS replace(local_clock(t)::VARCHAR, ' ', 'T') || printf('%s%02d:%02d',
                CASE WHEN local_offset(t) < 0 THEN '-' ELSE '+' END, abs(local_offset(t)) // 60, abs(local_offset(t)) % 60);
             CREATE TABLE alarm (utc TIMESTAMP, subject VARCHAR, message VARCHAR, priority UTINYINT, event VARCHAR,
                value DOUBLE, limit_value DOUBLE, by_whom VARCHAR, reason VARCHAR, value_exact DECIMAL(38, 6));
             CREATE TABLE action (utc TIMESTAMP, by_whom VARCHAR, from_where VARCHAR, action VARCHAR, target VARCHAR,
                old_value VARCHAR, new_value VARCHAR, outcome VARCHAR, note VARCHAR);
             CREATE TABLE batch (utc TIMESTAMP, until TIMESTAMP, batch VARCHAR, number UINTEGER, minutes DOUBLE,
                begin_seen BOOLEAN, end_seen BOOLEAN);
             CREATE TABLE phase (utc TIMESTAMP, batch VARCHAR, number UINTEGER, phase VARCHAR, minutes DOUBLE);
             CREATE TABLE run (utc TIMESTAMP, until TIMESTAMP, controller VARCHAR, number UINTEGER, state VARCHAR,
                cause VARCHAR, detail VARCHAR, sv_before DOUBLE, sv DOUBLE, pv DOUBLE, unit VARCHAR, band DOUBLE,
                settings VARCHAR, at_sv_s DOUBLE, steady_s DOUBLE, rise_s DOUBLE, overshoot DOUBLE, final_offset DOUBLE,
                iae DOUBLE, kwh DOUBLE, kwh_good DOUBLE, good DOUBLE);
             CREATE TABLE report (utc TIMESTAMP, period VARCHAR, name VARCHAR, begin TIMESTAMP, until TIMESTAMP,
                format VARCHAR, file VARCHAR, sha256 VARCHAR, event VARCHAR, attempts UINTEGER, error VARCHAR);",
            folder = quoted(&folder.join("")),
            archive = quoted(Path::new(&archive)),
            zone = quoted(Path::new(def.time_zone.iana_name().unwrap_or("UTC"))),
        ))?;
        tables.fill(
            "qualities",
            // A number that no version wrote is no value.
            (0..=u8::MAX).map(|code| (code, Quality::from_code(code).unwrap_or(Quality::Bad(Cause::Corrupt)))),
            |to, (code, quality)| to.append_row(params![code, quality.word()]),
        )?;
        let dictionary = overview.folder.join("tag.parquet");
        if dictionary.is_file() {
            tables
                .run(&format!("INSERT INTO tags SELECT id, name, unit FROM read_parquet({})", quoted(&dictionary)))?;
        }
        tables.run(&views(overview))?;
        Ok(tables)
    }

    /// Adds samples that are not archived.
    pub fn add_samples(&self, Unarchived { tags, samples }: Unarchived) -> Result<(), HistoryError> {
        self.fill("unarchived", samples.into_iter(), |to, (tag, Sample { at, value, rest, quality })| {
            let (name, unit) = &tags[usize::from(tag)];
            to.append_row(params![utc(at), name, unit, value, rest, quality.code()])
        })
    }

    /// Adds events of alarms.
    pub fn add_alarms(&self, events: Vec<AlarmRecord>) -> Result<(), HistoryError> {
        self.fill("alarm", events.into_iter(), |to, event| {
            let AlarmRecord { at, subject, message, priority, event, value, limit, by, reason, .. } = event;
            let (priority, event) = (priority.number(), event.word());
            let exact = value.filter(|value| value.rest().is_some()).map(|value| value.to_string());
            let value = value.and_then(Exact::as_f64);
            to.append_row(params![utc(at), subject, message, priority, event, value, limit, by, reason, exact])
        })
    }

    /// Adds operator actions.
    pub fn add_actions(&self, actions: Vec<ActionRecord>) -> Result<(), HistoryError> {
        self.fill("action", actions.into_iter(), |to, action| {
            let ActionRecord { at, by, from, action, target, old, new, outcome, note, .. } = action;
            to.append_row(params![utc(at), by, from, action, target, old, new, outcome, note])
        })
    }

    /// Adds batches, and their phases.
    pub fn add_batches(&self, batches: Vec<Batch>) -> Result<(), HistoryError> {
        let minutes = |time: Duration| time.as_secs_f64() / 60.0;
        let phases = batches.iter().flat_map(|batch| {
            let unknown = (!batch.unknown.is_zero()).then(|| (Arc::from("unknown"), batch.unknown));
            batch.phases.iter().cloned().chain(unknown).map(move |phase| (batch, phase))
        });
        self.fill("phase", phases, |to, (batch, (phase, time))| {
            to.append_row(params![utc(batch.from), batch.name, batch.number, phase, minutes(time)])
        })?;
        self.fill("batch", batches.iter(), |to, Batch { name, number, from, to: end, seen, lasted, .. }| {
            to.append_row(params![utc(*from), end.map(utc), name, number, minutes(*lasted), seen.0, seen.1])
        })
    }

    /// Adds control runs.
    pub fn add_runs(&self, runs: &[ControlRun]) -> Result<(), HistoryError> {
        self.fill("run", runs.iter(), |to, run| {
            let (kwh, kwh_good) = run.energy.unzip();
            let (begin, until, state, cause) = (utc(run.from), utc(run.until), run.state.word(), run.cause.word());
            let [at_sv, steady, rise] = [run.at_sv, run.steady, run.rise].map(seconds);
            to.append_row(params![
                begin,
                until,
                run.controller,
                run.number,
                state,
                cause,
                run.detail,
                run.sv_before,
                run.sv,
                run.pv,
                run.unit,
                run.band,
                run.settings,
                at_sv,
                steady,
                rise,
                run.overshoot,
                run.offset,
                run.iae,
                kwh,
                kwh_good,
                run.good
            ])
        })
    }

    /// Adds automatic reports, each with its last event.
    pub fn add_reports(&self, reports: Vec<ReportRecord>) -> Result<(), HistoryError> {
        self.fill("report", reports.into_iter(), |to, report| {
            let ReportRecord { at, period, name, from, to: end, format, file, sha256, event, attempts, error } = report;
            let (period, event, begin, until) = (period.word(), event.word(), utc(from), utc(end));
            to.append_row(params![utc(at), period, name, begin, until, format, file, sha256, event, attempts, error])
        })
    }

    /// Ends what is running, from any thread.
    pub fn interrupt_handle(&self) -> Interrupt {
        self.open.interrupt(&self.db)
    }

    /// Refuses what is not one SELECT. The message is that of the engine, with the place.
    pub fn check(&self, sql: &str) -> Result<(), HistoryError> {
        let parsed = self.parse(sql)?;
        let statements = parsed["statements"].as_array().map_or(0, Vec::len);
        match (parsed["error"].as_bool(), statements) {
            // Names and types are checked, nothing is read.
            (Some(false), 1) => self.db.prepare(sql).map(drop).map_err(wrong),
            (Some(true), _) if parsed["error_type"] == "not implemented" => {
                Err(HistoryError::Sql("the history is read only: expected one SELECT".to_owned()))
            }
            (Some(false), count) => Err(HistoryError::Sql(format!("found {count} statements, expected one SELECT"))),
            (Some(true) | None, _) => {
                let why = parsed["error_message"].as_str().unwrap_or("cannot be read");
                let at = parsed["position"].as_str().map_or_else(String::new, |at| format!(" (at character {at})"));
                Err(HistoryError::Sql(format!("{why}{at}")))
            }
        }
    }

    fn parse(&self, sql: &str) -> Result<serde_json::Value, HistoryError> {
        let text = "SELECT json_serialize_sql(?::VARCHAR)::VARCHAR";
        let parsed: String = self.db.query_row(text, params![sql], |row| row.get(0)).map_err(wrong)?;
        Ok(serde_json::from_str(&parsed).unwrap_or_default())
    }

    /// A SELECT as a part of another. Where it lists samples and names no order, they come in that of time and tag.
    fn select(&self, sql: &str) -> Result<String, HistoryError> {
        let parsed = self.parse(sql)?;
        let node = &parsed["statements"][0]["node"];
        let of = |name: &str| node[name].as_array().map(Vec::as_slice).unwrap_or_default();
        let is_plain = |column: &serde_json::Value| column["class"] == "STAR" || column["class"] == "COLUMN_REF";
        let is_list = node["from_table"]["table_name"] == "sample"
            && of("select_list").iter().all(is_plain)
            && of("group_expressions").is_empty()
            && of("modifiers").iter().all(|modifier| modifier["type"] == "LIMIT_MODIFIER");
        if is_list {
            self.run(&format!("CREATE OR REPLACE VIEW sample AS {SAMPLE} ORDER BY {IN_ORDER}"))?;
        }
        Ok(sql.trim_end_matches(|end: char| end == ';' || end.is_whitespace()).to_owned())
    }

    /// Writes the result of a SELECT into a file of the engine's folder. Returns its rows.
    pub fn write(&self, sql: &str, file: &Path, format: Format) -> Result<u64, HistoryError> {
        let options = match format {
            Format::Csv(csv) => {
                format!("FORMAT csv, HEADER true, DELIMITER '{}', NEW_LINE '\\r\\n'", csv.separator)
            }
            Format::Json => "FORMAT json, ARRAY true".to_owned(),
            Format::Parquet => "FORMAT parquet, PARQUET_VERSION v1, COMPRESSION zstd".to_owned(),
        };
        let copy = format!("COPY (FROM ({}\n)) TO {} ({options})", self.in_utc(sql, format)?, quoted(file));
        let rows = self.db.execute(&copy, []).map_err(wrong)?;
        Ok(rows as u64)
    }

    /// The SELECT, with times that say that they are UTC, and the byte order mark before the first heading.
    fn in_utc(&self, sql: &str, format: Format) -> Result<String, HistoryError> {
        let select = self.select(sql)?;
        let describe = format!("SELECT column_name, column_type FROM (DESCRIBE SELECT * FROM ({select}\n))");
        let mut statement = self.db.prepare(&describe).map_err(wrong)?;
        let columns = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?))).map_err(wrong)?;
        let columns: Vec<(String, String)> = columns.collect::<duckdb::Result<_>>().map_err(wrong)?;
        let column = |(n, (name, kind)): (usize, &(String, String))| {
            let is_utc = kind.starts_with("TIMESTAMP") && !kind.ends_with("TIME ZONE") && !name.contains("local");
            let value = match (is_utc, format) {
                (false, _) => format!("c{n}"),
                (true, Format::Parquet) => format!("timezone('UTC', c{n})"),
                (true, Format::Csv(_) | Format::Json) => format!("replace(c{n}::VARCHAR, ' ', 'T') || 'Z'"),
            };
            let bom = if n == 0 && matches!(format, Format::Csv(csv) if csv.bom) { "\u{feff}" } else { "" };
            format!("{value} AS \"{bom}{}\"", name.replace('"', "\"\""))
        };
        let values: Vec<String> = columns.iter().enumerate().map(column).collect();
        let names: Vec<String> = (0..columns.len()).map(|n| format!("c{n}")).collect();
        Ok(format!("SELECT {} FROM ({select}\n) AS r({})", values.join(", "), names.join(", ")))
    }

    /// The names of the columns and at most this many rows of a SELECT.
    pub fn rows(&self, sql: &str, limit: usize) -> Result<(Vec<String>, Vec<Row>), HistoryError> {
        // A screen shows no more of a value.
        let select = self.select(sql)?;
        let texts = format!("SELECT left(COLUMNS(*)::VARCHAR, {CELL_MAX}) FROM ({select}\n) LIMIT {limit}");
        let mut statement = self.db.prepare(&texts).map_err(wrong)?;
        let mut rows = statement.query([]).map_err(wrong)?;
        let mut all = Vec::new();
        let names = rows.as_ref().map(|statement| statement.column_names()).unwrap_or_default();
        while let Some(row) = rows.next().map_err(wrong)? {
            all.push((0..names.len()).map(|column| row.get(column)).collect::<duckdb::Result<_>>().map_err(wrong)?);
        }
        Ok((names, all))
    }

    fn run(&self, sql: &str) -> Result<(), HistoryError> {
        self.db.execute_batch(sql).map_err(engine)
    }

    fn fill<T>(
        &self,
        table: &str,
        rows: impl Iterator<Item = T>,
        mut append: impl FnMut(&mut duckdb::Appender, T) -> duckdb::Result<()>,
    ) -> Result<(), HistoryError> {
        let mut appender = self.db.appender(table).map_err(engine)?;
        for row in rows {
            append(&mut appender, row).map_err(engine)?;
        }
        appender.flush().map_err(engine)
    }
}

fn wrong(error: duckdb::Error) -> HistoryError {
    HistoryError::Sql(error.to_string())
}

fn views(overview: &Overview) -> String {
    let of = |tier: Tier| overview.files.iter().filter(move |file| file.tier == tier);
    let read = |tier: Tier| {
        let files: Vec<ArchiveFile> = of(tier).cloned().collect();
        let rests = any_rests(&files);
        (!files.is_empty()).then(|| (table(&overview.folder, &files, rests), rests))
    };
    let raw: Vec<ArchiveFile> = of(Tier::Raw).cloned().collect();
    let archived = raw.chunk_by(|one, next| one.rests == next.rests).map(|files| {
        let rest = if files[0].rests { "f.rest" } else { "NULL::DOUBLE" };
        format!(
            "SELECT f.utc, t.name AS tag, t.unit, f.value, {rest} AS rest, f.quality, 0 AS place, f.file_row_number AS n
             FROM read_parquet([{}], hive_partitioning = false, file_row_number = true) f JOIN tags t ON t.id = f.tag",
            paths(&overview.folder, files)
        )
    });
    let unarchived = "SELECT utc, tag, unit, value, rest, quality, 1 AS place, rowid AS n FROM unarchived".to_owned();
    let mut sql = format!(
        "CREATE VIEW stored AS SELECT s.utc, s.tag, {} AS value, s.unit, q.quality, {} AS exact, s.place, s.n
         FROM ({}) s JOIN qualities q ON q.code = s.quality; CREATE VIEW sample AS {SAMPLE};",
        held("s.value", "s.rest"),
        exact("s.value", "s.rest"),
        archived.chain([unarchived]).collect::<Vec<_>>().join(" UNION ALL ")
    );
    for tier in [Tier::Minute, Tier::Hour] {
        let word = tier.word();
        sql += &match read(tier) {
            Some((files, rests)) => {
                let columns = aggregate_columns(rests);
                format!("CREATE VIEW {word} AS SELECT {columns} FROM {files} f JOIN tags t ON t.id = f.tag;")
            }
            None => format!(
                "CREATE TABLE {word} (utc TIMESTAMP, tag VARCHAR, min DOUBLE, max DOUBLE, mean DOUBLE, first DOUBLE,
                    last DOUBLE, gain DOUBLE, good_ms UINTEGER, n UINTEGER, unit VARCHAR, min_exact DECIMAL(38, 6),
                    max_exact DECIMAL(38, 6), first_exact DECIMAL(38, 6), last_exact DECIMAL(38, 6),
                    gain_exact DECIMAL(38, 6));"
            ),
        };
    }
    sql
}

/// A number of which a DOUBLE does not print all digits is not given as one: NULL, and all of it stands in `exact`.
fn held(value: &str, rest: &str) -> String {
    format!("CASE WHEN {rest} IS NULL OR ({rest} = 0 AND abs({value}) <= 9007199254740992) THEN {value} END")
}

/// The number whose nearest DOUBLE is `value`, which a cast alone would round; NULL where `value` is all of it.
fn exact(value: &str, rest: &str) -> String {
    format!(
        "CASE WHEN {rest} IS NOT NULL THEN trunc({value})::HUGEINT::DECIMAL(38, 6)
            + ({value} - trunc({value}) + {rest})::DECIMAL(38, 6) END"
    )
}

fn aggregate_columns(rests: bool) -> String {
    let rest = |name: &str| if rests { format!("f.{name}_rest") } else { "NULL::DOUBLE".to_owned() };
    let held = |name: &str| format!("{} AS {name}", held(&format!("f.{name}"), &rest(name)));
    let exact = |name: &str| format!("{} AS {name}_exact", exact(&format!("f.{name}"), &rest(name)));
    let [min, max, first, last, gain] = ["min", "max", "first", "last", "gain"].map(held);
    let exacts = ["min", "max", "first", "last", "gain"].map(exact).join(", ");
    format!("f.utc, t.name AS tag, {min}, {max}, f.mean, {first}, {last}, {gain}, f.good_ms, f.n, t.unit, {exacts}")
}
