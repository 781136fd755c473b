//! `sightglass report`: the report of a shift or period from the history as CSV, through the station while it runs.

use std::{path::PathBuf, sync::Arc};

use crate::{
    history::{Answer, HistoryError, Query},
    plant::{PlantDef, def::CsvDialect},
    report::csv,
};

use super::{CliError, StationArgs, client, in_runtime, load, own_files, run::history_file, say_error, source::Source};

/// Arguments of `report`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// Which shift: last, current, NAME or NAME@YYYY-MM-DD [default: last]
    #[arg(long, value_name = "SHIFT")]
    shift: Option<String>,
    /// From this local time (2026-11-21T06:00) or instant with offset
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// To this local time or instant [default: now]
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
    /// File to write, `-` for standard output [default: the plant's report folder]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Separator of cells: `,` or `;` (then the decimal mark is a comma)
    #[arg(long, value_name = "MARK", value_parser = [",", ";"])]
    separator: Option<String>,
    /// Begin with a byte order mark, for spreadsheets
    #[arg(long)]
    bom: bool,
    /// Only the record of date, time, SV, PV and ER
    #[arg(long)]
    record: bool,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Asks for the report and writes it.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = Arc::new(load(&args.plant, &args.station)?);
    in_runtime(write(def, args))
}

async fn write(def: Arc<PlantDef>, args: Args) -> Result<(), CliError> {
    if let Some(out) = &args.out {
        own_files::refuse(out, &history_file(&def, &args.station))?;
    }
    let source = Source::open(&def, &args.station, &args.login).await?;
    let period = source.period(&def, args.shift.as_deref(), args.from.as_deref(), args.to.as_deref())?;
    let Answer::Report(report) = source.ask(Query::Report { period }).await? else {
        return Err(CliError::History(HistoryError::Engine("answered another query".into())));
    };
    for gap in &report.unreadable {
        let [from, to] = [gap.from, gap.to].map(|at| at.to_zoned(def.time_zone.clone()).strftime("%F %T"));
        say_error(&format!("the history cannot be read from {from} to {to}, nothing is counted there: {}", gap.why));
    }
    let dialect = dialect(def.report.csv, args.separator.as_deref(), args.bom);
    let bytes = match args.record {
        true => csv::record_csv(&report, &def, dialect),
        false => csv::shift_csv(&report, &def, dialect),
    };
    let path = args.out.unwrap_or_else(|| def.report.folder.join(csv::file_name(&def, &report.period, report.until)));
    source.export(&path, &bytes).await
}

pub(super) fn dialect(plant: CsvDialect, separator: Option<&str>, bom: bool) -> CsvDialect {
    let (separator, decimal) = match separator {
        Some(";") => (';', ','),
        Some(_) => (',', '.'),
        None => (plant.separator, plant.decimal),
    };
    CsvDialect { separator, decimal, bom: bom || plant.bom }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decimal_mark_follows_the_separator() {
        let german = CsvDialect { separator: ';', decimal: ',', bom: false };
        assert_eq!(dialect(CsvDialect::default(), Some(";"), false), german);
        assert_eq!(dialect(german, Some(","), true), CsvDialect { bom: true, ..CsvDialect::default() });
        assert_eq!(dialect(german, None, false), german);
    }
}
