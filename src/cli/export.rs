//! `sightglass export`: stored values of chosen tags with their quality: at a fixed interval as CSV, or every sample as CSV or
//! Parquet.

use std::{
    collections::{BTreeSet, HashMap},
    path::PathBuf,
    sync::Arc,
    time::Duration,
};

use jiff::Timestamp;

use crate::{
    attach::check::{BUCKETS_MAX, COLUMNS_MAX, SERIES_MAX},
    history::{
        Answer, Query,
        bound::about,
        io::tables::{Format, IN_ORDER},
    },
    plant::{
        PlantDef,
        def::{CsvDialect, TagId},
        time::{elapsed, instant_of_grid},
    },
    report::{
        export,
        figures::{self, TagDescription},
        step_series::HeldValue,
    },
};

use super::{
    CliError, in_runtime,
    progress::Progress,
    source::{CsvArgs, HistoryArgs, Source, unexpected},
    span,
    sql::HistoryTables,
};

/// Rows of one file.
const ROWS_MAX: u128 = 2_000_000;
/// The longest time that samples may be written for.
const RAW_TIME_MAX: Duration = Duration::from_secs(6 * 3_600);
/// Values of one file: they are all in memory before the first is written.
const VALUES_MAX: u128 = 20_000_000;

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    history: HistoryArgs,
    /// Tags, separated by commas [default: all that are stored]
    #[arg(long, value_name = "TAGS", value_delimiter = ',')]
    tags: Vec<String>,
    /// Time between two rows
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span)]
    every: Duration,
    /// Every stored sample instead, a row each, in order of time and tag
    #[arg(long, conflicts_with = "every")]
    raw: bool,
    /// With --raw: csv or parquet
    #[arg(long, value_name = "FORMAT", default_value = "csv", value_parser = ["csv", "parquet"])]
    format: String,
    /// File to write, `-` for standard output
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    out: PathBuf,
    #[command(flatten)]
    csv: CsvArgs,
}

/// Queries the values piece by piece and writes the table.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = args.history.load()?;
    in_runtime(write(def, args))
}

async fn write(def: Arc<PlantDef>, args: Args) -> Result<(), CliError> {
    args.csv.refuse_unless(args.format == "csv")?;
    let named = tags(&def, &args.tags);
    args.history.refuse_own_file(&def, &args.out)?;
    let (source, period) = args.history.open(&def).await?;
    if args.raw {
        let csv = args.csv.dialect(&def);
        let format = if args.format == "parquet" { Format::Parquet } else { Format::Csv(csv) };
        let tables = HistoryTables::load(&def, &source).await?;
        // A tag that the plant has no longer is exported all the same.
        for tag in args.tags.iter().filter(|tag| def.tag_named(tag).is_none()) {
            if !tables.knows(tag)? {
                return Err(named.err().unwrap_or_else(unexpected));
            }
        }
        let sql = raw(&args.tags, (period.from, period.to), format);
        return tables.export(&source, &sql, format, &args.out, RAW_TIME_MAX).await;
    }
    if args.format != "csv" {
        return Err(CliError::Usage("--format parquet needs --raw: found values at an interval".to_owned()));
    }
    let (tags, to) = (named?, period.to.min(source.now()));
    let rows = rows(period.from, to, args.every, tags.len())?;
    let latest = latest(&source, &def, &tags, period.from, to).await?;
    let (mut progress, mut done) = (Progress::new((rows * tags.len()) as u64), 0);
    let mut columns = Vec::new();
    for group in tags.chunks(SERIES_MAX) {
        let label = |tag: &TagId| TagDescription::new(def.tag(*tag), &latest);
        let begin = columns.len();
        columns.extend(group.iter().map(label).map(|label| {
            let TagDescription { tag, unit, decimals, counts: _ } = label;
            export::Column { tag, unit, decimals, values: Vec::with_capacity(rows) }
        }));
        for (from, count) in pieces(period.from, args.every, rows, group.len()) {
            let query = Query::Values { tags: group.to_vec(), from, every: args.every, count };
            for (column, values) in columns[begin..].iter_mut().zip(values(source.query(query).await?)?) {
                column.values.extend(values);
            }
            done += (count * group.len()) as u64;
            progress.show(done);
        }
    }
    drop(progress);
    let bytes = export::export_csv(&def, period.from, args.every, &columns, args.csv.dialect(&def));
    source.export(&args.out, &bytes).await
}

/// The stored samples of some tags, or of all, in a span, with the local time of the plant. A text has all digits of a value;
/// a column of numbers needs another beside it for those that a DOUBLE rounds.
fn raw(tags: &[String], (from, to): (Timestamp, Timestamp), format: Format) -> String {
    let names: Vec<String> = tags.iter().map(|tag| format!("'{}'", tag.replace('\'', "''"))).collect();
    let only = if names.is_empty() { String::new() } else { format!("AND tag IN ({})", names.join(", ")) };
    let text = "coalesce(rtrim(rtrim(exact::VARCHAR, '0'), '.'), value::VARCHAR)";
    let (value, exact) = match format {
        Format::Csv(CsvDialect { decimal: ',', .. }) => (format!("replace({text}, '.', ',') AS value"), ""),
        Format::Csv(_) => (format!("{text} AS value"), ""),
        Format::Parquet | Format::Json => ("value".to_owned(), ", exact"),
    };
    format!(
        "SELECT utc, local_time(utc) AS time_local, tag, {value}, unit, quality{exact} FROM stored
         WHERE utc >= make_timestamp({}) AND utc < make_timestamp({}) {only} ORDER BY {IN_ORDER}",
        from.as_microsecond(),
        to.as_microsecond(),
    )
}

/// The latest good values of the tags that hold unit and decimals of others.
async fn latest(
    source: &Source,
    def: &PlantDef,
    tags: &[TagId],
    from: Timestamp,
    to: Timestamp,
) -> Result<HashMap<TagId, f64>, CliError> {
    let scaling_tags: BTreeSet<TagId> = tags.iter().flat_map(|tag| figures::scaling_tags(def.tag(*tag))).collect();
    let scaling_tags: Vec<TagId> = scaling_tags.into_iter().collect();
    let mut latest = HashMap::new();
    for tags in scaling_tags.chunks(SERIES_MAX) {
        let query = Query::Series { tags: tags.to_vec(), from, to, buckets: 1 };
        let Answer::Series(series) = source.query(query).await? else { return Err(unexpected()) };
        latest.extend(series.iter().filter_map(|series| Some((series.tag, (*series.buckets.last()?)?.last.near()))));
    }
    Ok(latest)
}

/// Start and number of rows of each query about this many tags.
fn pieces(from: Timestamp, every: Duration, rows: usize, tags: usize) -> impl Iterator<Item = (Timestamp, usize)> {
    let piece = (COLUMNS_MAX / tags.max(1)).clamp(1, BUCKETS_MAX);
    (0..rows)
        .step_by(piece)
        .map_while(move |begin| Some((instant_of_grid(from, every, begin)?, piece.min(rows - begin))))
}

/// The tags that were named, or all that are stored.
fn tags(def: &PlantDef, names: &[String]) -> Result<Vec<TagId>, CliError> {
    if names.is_empty() {
        return Ok(def.tags.iter().filter(|tag| tag.is_stored()).map(|tag| tag.id).collect());
    }
    let find = |name: &String| {
        def.tag_named(name)
            .ok_or_else(|| CliError::Usage(format!("no tag `{name}`: `sightglass check {}` lists them", def.name)))
    };
    names.iter().map(find).collect()
}

fn rows(from: Timestamp, to: Timestamp, every: Duration, tags: usize) -> Result<usize, CliError> {
    if every < Duration::from_millis(1) {
        return Err(CliError::Usage("--every: expected 1ms or more".to_owned()));
    }
    let period = elapsed(from, to);
    let rows = period.as_nanos() / every.as_nanos();
    let max = ROWS_MAX.min(VALUES_MAX / tags.max(1) as u128);
    let refuse = |words: String| Err(CliError::Usage(words));
    let asked = format!("found {rows} rows of {tags} tags in {}", about(period));
    match (rows, usize::try_from(rows)) {
        (0, _) => refuse(format!("{asked}, expected 1 or more: choose a shorter --every or a longer period")),
        (_, Ok(count)) if rows <= max => Ok(count),
        (_, Ok(_) | Err(_)) => {
            let fits = about(every.saturating_mul(u32::try_from(max).unwrap_or(u32::MAX)));
            let every = period.as_millis().div_ceil(max).div_ceil(1_000);
            refuse(format!(
                "{asked}, at most {max}: choose a period of at most {fits}, or --every {every}s, or fewer tags"
            ))
        }
    }
}

fn values(answer: Answer) -> Result<Vec<Vec<Option<HeldValue>>>, CliError> {
    match answer {
        Answer::Values(values) => Ok(values),
        _ => Err(unexpected()),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::{
        history::io::{import, store::Store, tables::Tables},
        plant::{
            exact::Exact,
            record::Record,
            sample::{Cause, Quality, Sample},
        },
        report::testing::{THREE, plant},
    };

    #[test]
    fn a_table_that_is_too_long_says_what_fits() {
        let rows = |days: i64, every, tags| {
            let to = Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_hours(24 * days);
            rows(Timestamp::UNIX_EPOCH, to, Duration::from_secs(every), tags).map_err(|error| error.to_string())
        };
        assert_eq!(rows(1, 10, 1_000), Ok(8_640));
        let long = "found 3153600 rows of 1000 tags in 365 days, at most 20000: choose a period of at most 2 days, \
                    or --every 1577s, or fewer tags";
        assert_eq!(rows(365, 10, 1_000), Err(long.to_owned()));
        // What it says can be done.
        assert_eq!(rows(365, 1_577, 1_000), Ok(19_997));
        assert!(rows(1, 100_000, 1).is_err_and(|error| error.contains("expected 1 or more")));
    }

    /// Every quality that is stored, samples of one instant, and the night in which a clock is set back.
    fn records() -> Vec<Record> {
        let causes = Cause::ALL.into_iter().filter(|cause| cause.is_stored());
        let qualities = causes.flat_map(|cause| [Quality::Uncertain(cause), Quality::Bad(cause), Quality::Good]);
        let begin: Timestamp = "2026-10-24T23:30:00Z".parse().expect("a time");
        let mut samples: Vec<(TagId, Sample)> = (0..)
            .zip(qualities.cycle().take(400))
            .map(|(n, quality): (i64, _)| {
                let at = begin + jiff::SignedDuration::from_millis(n / 3 * 40_123);
                let value = ((n * 7_919) % 4_001 - 2_000) as f64 / 4.0;
                let value = Some(Exact::from(value)).filter(|_| !quality.is_bad());
                (TagId(u16::from(n % 5 < 2)), Sample::new(value, quality, at))
            })
            .collect();
        samples.sort_by_key(|(_, sample)| sample.at);
        samples.into_iter().map(|(tag, sample)| Record::Sample(tag, sample)).collect()
    }

    #[test]
    fn what_is_exported_is_imported_as_it_was_stored() {
        let (from, to): (Timestamp, Timestamp) =
            ("2026-10-24T22:00:00Z".parse().expect("a time"), "2026-10-25T06:00:00Z".parse().expect("a time"));
        for (zone, separator, decimal, bom) in [
            ("Asia/Bangkok", ',', '.', false),
            ("Europe/Berlin", ';', ',', true),
            ("America/St_Johns", '\t', '.', true),
            ("Europe/Berlin", ';', '.', false),
        ] {
            let folder = tempfile::tempdir().expect("a folder");
            let def = Arc::new(plant(zone, &THREE));
            let store = Store::open(&folder.path().join("h.duckdb"), &def, from).expect("a history").store;
            store.append(&records()).expect("it stores");
            let Ok(Answer::Unarchived(unarchived)) = store.answer(&Query::Unarchived { from, to }, to) else {
                panic!()
            };
            let Ok(Answer::Overview(overview)) = store.answer(&Query::Overview, to) else { panic!() };
            let tables = Tables::new(&def, &overview, folder.path()).expect("an engine");
            tables.add_samples(unarchived).expect("room");
            let mut expect: BTreeMap<TagId, Vec<Sample>> = BTreeMap::new();
            for record in records() {
                let Record::Sample(tag, sample) = record else { panic!() };
                expect.entry(tag).or_default().push(sample);
            }
            let dialect = CsvDialect { separator, decimal, bom };
            let plain = CsvDialect::default();
            for (sql, dialect) in [
                (raw(&[], (from, to), Format::Csv(dialect)), dialect),
                ("SELECT * FROM sample;".to_owned(), plain),
                ("SELECT utc AS time, tag, value, exact, quality FROM sample".to_owned(), plain),
                ("SELECT local_time(utc) AS time_local, tag, value, quality FROM sample".to_owned(), plain),
            ] {
                let write = |name: &str| {
                    let file = folder.path().join(name);
                    let written = tables.write(&sql, &file, Format::Csv(dialect));
                    written.map(|_| std::fs::read(&file).expect("a file")).expect("it writes")
                };
                let bytes = write("one");
                assert!(bytes == write("other"), "the same bytes each time: {sql}");
                assert_eq!(bytes.starts_with("\u{feff}".as_bytes()), dialect.bom, "{sql}");
                let rows = import::parse(&def, &*bytes, Timestamp::UNIX_EPOCH, to);
                assert_eq!(rows.as_ref(), Ok(&expect), "{zone}, {dialect:?}: {sql}");
                let file = folder.path().join("parquet");
                let sql = if sql.contains("FROM stored") { raw(&[], (from, to), Format::Parquet) } else { sql };
                tables.write(&sql, &file, Format::Parquet).expect("it writes");
                let rows = import::read_rows(&file, &def, Timestamp::UNIX_EPOCH, to);
                assert_eq!(rows.as_ref(), Ok(&expect), "{zone}, as Parquet: {sql}");
            }
        }
    }
}
