//! `sightglass report`: the report of a shift or period from the history, through the station while it runs.

use std::path::PathBuf;

use crate::{
    history::{Answer, Query},
    report::{self, ReportFormat},
};

use super::{
    CliError, in_runtime, say_error,
    source::{CsvArgs, HistoryArgs, unexpected},
};

/// Arguments of `report`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    history: HistoryArgs,
    /// File to write, `-` for standard output [default: the plant's report folder]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[arg(long, value_name = "FORMAT", help = report::formats_help(), value_parser = report::format,
          default_value = report::FORMATS[0].name())]
    format: &'static dyn ReportFormat,
    #[command(flatten)]
    csv: CsvArgs,
}

/// Writes the report.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = args.history.load()?;
    if let Some(out) = &args.out {
        args.history.refuse_own_file(&def, out)?;
    }
    in_runtime(async {
        let (source, period) = args.history.open(&def).await?;
        let Answer::Report(report) = source.query(Query::Report { period }).await? else { return Err(unexpected()) };
        for gap in &report.unreadable {
            let [from, to] = [gap.from, gap.to].map(|at| at.to_zoned(def.time_zone.clone()).strftime("%F %T"));
            say_error(&format!(
                "the history cannot be read from {from} to {to}, nothing is counted there: {}",
                gap.why
            ));
        }
        let bytes = args.format.render(&report, &def, args.csv.dialect(&def));
        let file = || def.report.folder.join(args.format.file_name(&def, &report.period, report.until));
        source.export(&args.out.clone().unwrap_or_else(file), &bytes).await
    })
}
