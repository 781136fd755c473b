//! `sightglass export`: stored values of chosen tags at a fixed interval as CSV.

use std::{io::Write, path::PathBuf, sync::Arc, time::Duration};

use jiff::Timestamp;

use crate::{
    attach::check::{BUCKETS_MAX, COLUMNS_MAX},
    history::{Answer, HistoryError, Question, Series},
    plant::{
        PlantDef,
        def::TagId,
        tag::{Decimals, TagDef},
    },
    report::{DECIMALS_UNKNOWN, ask, export},
};

use super::{CliError, StationArgs, client, in_runtime, load, report::dialect, say, source::Source, span};

/// Rows of one file.
const ROWS_MAX: u128 = 2_000_000;

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// Tags, separated by commas [default: all that are stored]
    #[arg(long, value_name = "TAGS", value_delimiter = ',')]
    tags: Vec<String>,
    /// Which shift: last, current, NAME or NAME@YYYY-MM-DD [default: last]
    #[arg(long, value_name = "SHIFT")]
    shift: Option<String>,
    /// From this local time (2026-11-21T06:00) or instant with offset
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// To this local time or instant [default: now]
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
    /// Time between two rows
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    every: Duration,
    /// File to write, `-` for standard output
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
    /// Separator of cells: `,` or `;` (then the decimal mark is a comma)
    #[arg(long, value_name = "MARK", value_parser = [",", ";"])]
    separator: Option<String>,
    /// Begin with a byte order mark, for spreadsheets
    #[arg(long)]
    bom: bool,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Asks for the curves, piece by piece, and writes the table.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = Arc::new(load(&args.plant, &args.station)?);
    let tags = tags(&def, &args.tags)?;
    let period = ask::period(&def, args.shift.as_deref(), args.from.as_deref(), args.to.as_deref(), Timestamp::now())
        .map_err(|error| CliError::Usage(error.to_string()))?;
    let rows = rows(period.from, period.to, args.every)?;
    in_runtime(async {
        let source = Source::open(&def, &args.station, &args.login).await?;
        let mut columns: Vec<export::Column> = tags.iter().map(|tag| column(def.tag(*tag))).collect();
        let piece = (COLUMNS_MAX / tags.len().max(1)).clamp(1, BUCKETS_MAX);
        for begin in (0..rows).step_by(piece) {
            let count = piece.min(rows - begin);
            let (from, to) = (instant(period.from, args.every, begin), instant(period.from, args.every, begin + count));
            let question = Question::Series { tags: tags.clone(), from, to, buckets: count };
            for (column, series) in columns.iter_mut().zip(series(source.ask(question).await?)?) {
                column.values.extend(series.buckets.iter().map(|bucket| bucket.map(|bucket| bucket.last)));
            }
        }
        let dialect = dialect(def.report.csv, args.separator.as_deref(), args.bom);
        let bytes = export::export_csv(&def, period.from, args.every, &columns, dialect);
        source.exported(&args.out.display().to_string(), &bytes).await?;
        let failed = |error| CliError::Io { what: format!("cannot write {}", args.out.display()), error };
        if args.out.as_os_str() == "-" {
            return std::io::stdout().write_all(&bytes).map_err(failed);
        }
        std::fs::write(&args.out, bytes).map_err(failed)?;
        say(&args.out.display().to_string());
        Ok(())
    })
}

/// The tags that were named, or all that are stored.
fn tags(def: &PlantDef, names: &[String]) -> Result<Vec<TagId>, CliError> {
    if names.is_empty() {
        return Ok(def.tags.iter().filter(|tag| tag.store).map(|tag| tag.id).collect());
    }
    let find = |name: &String| {
        def.tag_named(name)
            .ok_or_else(|| CliError::Usage(format!("no tag `{name}`: `sightglass check {}` lists them", def.name)))
    };
    names.iter().map(find).collect()
}

fn rows(from: Timestamp, to: Timestamp, every: Duration) -> Result<usize, CliError> {
    if every < Duration::from_millis(1) {
        return Err(CliError::Usage("--every: expected 1ms or more".to_owned()));
    }
    let span = Duration::try_from(to.duration_since(from)).unwrap_or_default();
    let rows = span.as_nanos() / every.as_nanos();
    if rows == 0 || ROWS_MAX < rows {
        return Err(CliError::Usage(format!(
            "found {rows} rows, expected 1 … {ROWS_MAX}: change --every or the period"
        )));
    }
    Ok(rows as usize)
}

fn instant(from: Timestamp, every: Duration, count: usize) -> Timestamp {
    let ahead = i128::try_from(every.as_nanos()).unwrap_or(i128::MAX).saturating_mul(count as i128);
    from.checked_add(jiff::SignedDuration::from_nanos_i128(ahead)).unwrap_or(Timestamp::MAX)
}

fn column(tag: &TagDef) -> export::Column {
    let decimals = match tag.decimals {
        Decimals::Fixed(decimals) => decimals,
        Decimals::From(_) => DECIMALS_UNKNOWN,
    };
    export::Column { tag: tag.name.clone(), unit: tag.unit.clone(), decimals, values: Vec::new() }
}

fn series(answer: Answer) -> Result<Vec<Series>, CliError> {
    match answer {
        Answer::Series(series) => Ok(series),
        _ => Err(CliError::History(HistoryError::Engine("answered another question".into()))),
    }
}
