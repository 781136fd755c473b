//! `sightglass sql`: SELECT over the history, read only, in an engine of this process.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use jiff::Timestamp;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use super::{
    CliError, StationArgs, client, in_runtime, load, own_files, paths, say, say_error,
    source::{Source, unexpected},
    span,
    work_folder::WorkFolder,
};
use crate::{
    history::{
        Answer, HistoryError, Overview, Query, Unarchived,
        io::tables::{Format, Row, Tables},
    },
    plant::{
        PlantDef,
        batch::Batch,
        control_run::ControlRun,
        def::CsvDialect,
        record::{ActionRecord, AlarmRecord},
    },
    station::io::reports::REPORTS_MAX,
    ui::widgets::text::width as width_of,
};

/// Rows of a table on the screen.
const SHOWN_MAX: usize = 1_000;
/// Rows of a list that are asked for at a time.
const PAGE: usize = 10_000;
/// An engine that works on so long after it was interrupted computes one value, and is left behind.
const STOP_MAX: Duration = Duration::from_secs(2);
/// Of this process: its engine has 256 MiB, and libraries and stacks need as much again, of which most is never used.
const ADDRESS_SPACE_MAX: u64 = 2 << 30;
/// How long it may work without a word.
const SILENT: Duration = Duration::from_millis(500);

const VIEWS: &str = "\
Views (times are UTC, and end with Z in CSV and JSON; local_time(utc) is the local time of the plant, with its offset):
  sample   utc, tag, value, unit, quality, exact (quality: 'good', 'uncertain: …', 'bad: …')
           of tags that the plant has no longer, too, and in the unit that was stored; listed in order of time and tag
  m1, h1   minutes and hours of what is archived: utc (begin), tag, min, max, mean, first, last, gain, good_ms, n, unit,
           min_exact, max_exact, first_exact, last_exact, gain_exact
  alarm    utc, subject, message, priority, event, value, limit_value, by_whom, reason, value_exact
  action   utc, by_whom, from_where, action, target, old_value, new_value, outcome, note
  batch    utc (begin), until (NULL while it runs), batch, number, minutes, begin_seen, end_seen
  phase    utc (begin of the batch), batch, number, phase ('unknown' as well), minutes
  run      control runs: utc (begin), until, controller, number, state, cause, detail, sv_before, sv, pv, unit, band, settings,
           at_sv_s, steady_s, rise_s (NULL not come to, -1 unknown), overshoot, final_offset, iae, kwh, kwh_good, good
  report   automatic reports: utc (of event, the last one), period, name, begin, until, format, file, sha256, event,
           attempts, error

Numbers are DOUBLE, of 15 digits. One of more, as a 64-bit counter has, stands in exact, DECIMAL(38, 6), and there
alone if a DOUBLE would round it: value is NULL then, and exact is NULL where value is all of it.

Other programs read the folder beside the history as it lies, Parquet, times UTC: raw/date=…/ utc, tag, value, quality
(code: 0 good, 64 and up uncertain, 128 and up bad), epoch (how often the clock was set, 65535 imported); m1/… and h1/… as
above; tag.parquet id, name, unit. Files with numbers of more than 15 digits have columns rest, min_rest, …: value is the
nearest DOUBLE there, and the sum of both is the number. Files are replaced by larger ones; none is changed.

Example: sightglass sql tank \"SELECT tag, avg(mean) FROM h1 WHERE utc > '2026-11-01' GROUP BY tag\"";

/// Arguments of `sql`.
#[derive(Debug, clap::Args)]
#[command(after_help = VIEWS)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// One SELECT, in the SQL of DuckDB
    sql: String,
    /// Print CSV
    #[arg(long, conflicts_with_all = ["json", "parquet"])]
    csv: bool,
    /// Print JSON: an array of objects
    #[arg(long, conflicts_with = "parquet")]
    json: bool,
    /// Write a Parquet file
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// The longest time that it may take
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = span)]
    timeout: Duration,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Answers a SELECT.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = Arc::new(load(&args.plant, &args.station)?);
    if let Some(file) = &args.parquet {
        own_files::refuse(file, &paths::history_file(&def, &args.station))?;
    }
    // One value can need more than any machine has, and the engine does not count it.
    let most = Rlimit { current: Some(ADDRESS_SPACE_MAX), ..getrlimit(Resource::As) };
    let _ = setrlimit(Resource::As, most);
    in_runtime(async {
        let source = Source::open(&def, &args.station, &args.login).await?;
        let tables = HistoryTables::load(&def, &source).await?;
        tables.tables.check(&args.sql).map_err(refused)?;
        let format = match (args.csv, args.json, &args.parquet) {
            (true, _, _) => Some(Format::Csv(CsvDialect::default())),
            (_, true, _) => Some(Format::Json),
            (_, _, Some(_)) => Some(Format::Parquet),
            (false, false, None) => None,
        };
        match format {
            None => {
                let (names, rows) =
                    work(tables.tables, args.timeout, move |tables| tables.rows(&args.sql, SHOWN_MAX + 1)).await?;
                as_table(names, rows).iter().for_each(|line| say(line));
                Ok(())
            }
            Some(format) => {
                let to = args.parquet.as_deref().unwrap_or(Path::new("-"));
                tables.export(&source, &args.sql, format, to, args.timeout).await
            }
        }
    })
}

/// The tables of a history, and the folder that their engine works in, which goes with them.
pub struct HistoryTables {
    tables: Tables,
    folder: WorkFolder,
}

impl HistoryTables {
    /// Reads what is not archived; the archive is read when it is asked.
    pub async fn load(def: &PlantDef, source: &Source) -> Result<HistoryTables, CliError> {
        let folder = WorkFolder::new()?;
        loop {
            let overview = overview(source).await?;
            let tables = Tables::new(def, &overview, folder.path())?;
            tables.add_alarms(journal(source).await?)?;
            tables.add_actions(actions(source).await?)?;
            tables.add_batches(batches(source).await?)?;
            tables.add_runs(&control_runs(source).await?)?;
            let Answer::Reports(made) = source.query(Query::Reports { limit: REPORTS_MAX }).await? else {
                return Err(unexpected());
            };
            tables.add_reports(made.reports)?;
            unarchived(source, &overview, |samples| tables.add_samples(samples)).await?;
            // An hour that was archived meanwhile would be missing or double.
            if self::overview(source).await?.files == overview.files {
                return Ok(HistoryTables { tables, folder });
            }
        }
    }

    /// Have samples of such a tag ever been stored?
    pub fn knows(&self, tag: &str) -> Result<bool, CliError> {
        let sql = format!("SELECT 1 FROM stored WHERE tag = '{}'", tag.replace('\'', "''"));
        Ok(!self.tables.rows(&sql, 1)?.1.is_empty())
    }

    /// Writes the result of a SELECT to a file, `-` to standard output.
    pub async fn export(
        self,
        source: &Source,
        sql: &str,
        format: Format,
        to: &Path,
        timeout: Duration,
    ) -> Result<(), CliError> {
        let (file, sql) = (self.folder.path().join("result"), sql.to_owned());
        let written = file.clone();
        let rows = work(self.tables, timeout, move |tables| tables.write(&sql, &written, format)).await?;
        source.export_file(to, &file).await?;
        if to.as_os_str() != "-" {
            say(&format!("{}: {rows} rows", to.display()));
        }
        Ok(())
    }
}

/// Lets the engine work until it is done, its time is over, or Ctrl-C.
async fn work<T: Send + 'static>(
    tables: Tables,
    limit: Duration,
    work: impl FnOnce(&Tables) -> Result<T, HistoryError> + Send + 'static,
) -> Result<T, CliError> {
    let (interrupt, began) = (tables.interrupt_handle(), Instant::now());
    let mut working = tokio::task::spawn_blocking(move || work(&tables));
    let mut ticks = tokio::time::interval(SILENT);
    let mut ended = None;
    loop {
        tokio::select! {
            done = &mut working => {
                return match ended {
                    Some((why, _)) => Err(CliError::Failed(why)),
                    None => done.map_err(|panic| CliError::Failed(panic.to_string()))?.map_err(refused),
                };
            }
            _ = tokio::signal::ctrl_c() => ended = ended.or_else(|| Some(("cancelled".to_owned(), Instant::now()))),
            _ = ticks.tick() => {
                if limit < began.elapsed() && ended.is_none() {
                    let (most, hint) = (limit.as_secs_f64(), "ask for less, or use m1 or h1, or a longer --timeout");
                    ended = Some((format!("no result within {most} s: {hint}"), Instant::now()));
                } else if SILENT < began.elapsed() && began.elapsed().as_millis() % 5_000 < SILENT.as_millis() {
                    say_error(&format!("working for {} s, Ctrl-C cancels", began.elapsed().as_secs()));
                }
            }
        }
        if let Some((why, at)) = &ended {
            interrupt.interrupt();
            if STOP_MAX < Instant::elapsed(at) {
                return Err(CliError::Failed(why.clone()));
            }
        }
    }
}

/// Errors in the SQL are errors of the arguments.
fn refused(error: HistoryError) -> CliError {
    match error {
        HistoryError::Sql(words) => CliError::Usage(words),
        other => CliError::History(other),
    }
}

async fn overview(source: &Source) -> Result<Overview, CliError> {
    match source.query(Query::Overview).await? {
        Answer::Overview(overview) => Ok(*overview),
        _ => Err(unexpected()),
    }
}

/// Hands over the samples that are not archived, piece by piece.
async fn unarchived(
    source: &Source,
    overview: &Overview,
    mut each: impl FnMut(Unarchived) -> Result<(), HistoryError>,
) -> Result<(), CliError> {
    // What a clock that has been set back stored before is later than now.
    let last = overview.extent.map_or(source.now(), |(_, last)| last.max(source.now()));
    let end = last.checked_add(Duration::from_secs(1)).unwrap_or(Timestamp::MAX);
    let (mut from, mut span) = (overview.oldest.unwrap_or(end), Duration::from_secs(600));
    while from < end {
        let to = from.checked_add(span).unwrap_or(end).min(end);
        match source.query(Query::Unarchived { from, to }).await {
            Ok(Answer::Unarchived(samples)) => {
                // Without a bound: after a start with a wrong clock there is nothing for half a century.
                span = if samples.samples.len() < PAGE { span.saturating_mul(4) } else { span };
                each(samples)?;
                from = to;
            }
            Ok(_) => return Err(unexpected()),
            Err(CliError::History(HistoryError::TooManyRows { .. })) if Duration::from_millis(1) < span => span /= 4,
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

async fn journal(source: &Source) -> Result<Vec<AlarmRecord>, CliError> {
    let (mut all, mut to) = (Vec::new(), end(source));
    loop {
        let query = Query::Journal { from: Timestamp::UNIX_EPOCH, to, limit: PAGE };
        let Answer::Journal(page) = source.query(query).await? else { return Err(unexpected()) };
        let Some(next) = add_page(&mut all, page, |event| event.at) else { return Ok(all) };
        to = next;
    }
}

async fn actions(source: &Source) -> Result<Vec<ActionRecord>, CliError> {
    let (mut all, mut to) = (Vec::new(), end(source));
    loop {
        let query = Query::Actions { from: Timestamp::UNIX_EPOCH, to, limit: PAGE };
        let Answer::Actions(page) = source.query(query).await? else { return Err(unexpected()) };
        let Some(next) = add_page(&mut all, page, |action| action.at) else { return Ok(all) };
        to = next;
    }
}

/// All batches, newest first, page by page; those that began at the begin of the last one of a page come again.
async fn batches(source: &Source) -> Result<Vec<Batch>, CliError> {
    let (mut all, mut to) = (Vec::<Batch>::new(), end(source));
    loop {
        let query = Query::Batches { from: Timestamp::UNIX_EPOCH, to, limit: PAGE };
        let Answer::Batches(page) = source.query(query).await? else { return Err(unexpected()) };
        let (count, known) = (page.len(), all.len());
        let fresh = page.into_iter().map(|report| report.batch).filter(|batch| {
            all.iter().rev().take_while(|known| known.from <= batch.from).all(|known| known.label() != batch.label())
        });
        let fresh: Vec<Batch> = fresh.collect();
        all.extend(fresh);
        let next = all.last().and_then(|last| last.from.checked_add(Duration::from_micros(1)).ok());
        match next.filter(|_| PAGE <= count && known < all.len()) {
            Some(next) => to = next,
            None => return Ok(all),
        }
    }
}

/// All control runs, newest first, page by page; those that began at the begin of the last one of a page come again.
async fn control_runs(source: &Source) -> Result<Vec<ControlRun>, CliError> {
    let (mut all, mut to) = (Vec::new(), end(source));
    loop {
        let query = Query::ControlRuns { controller: None, from: Timestamp::UNIX_EPOCH, to, limit: PAGE };
        let Answer::ControlRuns(page) = source.query(query).await? else { return Err(unexpected()) };
        let Some(next) = add_page(&mut all, page, |run| run.from) else { return Ok(all) };
        to = next;
    }
}

/// Later than what any clock has stored.
fn end(source: &Source) -> Timestamp {
    source.now().checked_add(Duration::from_secs(100 * 365 * 86_400)).unwrap_or(Timestamp::MAX)
}

/// Adds a page of a list that comes newest first. Returns where the next one ends: what happened at the oldest instant of a
/// full page comes again, whole.
fn add_page<T>(all: &mut Vec<T>, mut page: Vec<T>, at: fn(&T) -> Timestamp) -> Option<Timestamp> {
    let oldest = page.last().map(at).filter(|_| PAGE <= page.len());
    let next = oldest.and_then(|oldest| oldest.checked_add(Duration::from_micros(1)).ok());
    if let Some(oldest) = oldest.filter(|oldest| page.first().map(at) != Some(*oldest)) {
        page.retain(|row| at(row) != oldest);
        all.extend(page);
        return next;
    }
    all.extend(page);
    None
}

/// Columns side by side.
fn as_table(names: Vec<String>, mut rows: Vec<Row>) -> Vec<String> {
    let more = SHOWN_MAX < rows.len();
    rows.truncate(SHOWN_MAX);
    let count = rows.len();
    let cells: Vec<Vec<String>> = std::iter::once(names)
        .chain(rows.into_iter().map(|row| row.into_iter().map(|cell| cell.unwrap_or_else(|| "–".into())).collect()))
        .collect();
    let columns = cells[0].len();
    let width = |column: usize| cells.iter().map(|row| width_of(&row[column])).max().unwrap_or(0);
    let widths: Vec<u16> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cell =
            |(cell, width): (&String, &u16)| format!("{cell}{}", " ".repeat(usize::from(width - width_of(cell))));
        row.iter().zip(&widths).map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let mut lines: Vec<String> = cells.iter().map(line).collect();
    lines.push(match more {
        true => format!("the first {count} rows; --csv, --json and --parquet give all"),
        false => format!("{count} rows"),
    });
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_a_list_make_the_whole_list() {
        let at = |row: &i64| Timestamp::from_second(*row).expect("in range");
        // 25,000 rows, newest first, several of one instant.
        let rows: Vec<i64> = (0..25_000).rev().map(|row| row / 7).collect();
        let (mut all, mut to) = (Vec::new(), Timestamp::MAX);
        loop {
            let page = rows.iter().copied().filter(|row| at(row) < to).take(PAGE).collect();
            let Some(next) = add_page(&mut all, page, at) else { break };
            to = next;
        }
        assert_eq!(all, rows);
    }
}
