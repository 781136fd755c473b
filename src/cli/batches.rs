//! `sightglass batches`: the batches of a period with their phases, energy and figures.

use std::path::PathBuf;

use jiff::SignedDuration;

use crate::{
    history::{Answer, Query},
    report::batch,
};

use super::{
    CliError, in_runtime, say,
    source::{CsvArgs, HistoryArgs, unexpected},
};

/// What is shown where no period is asked for.
const SPAN: SignedDuration = SignedDuration::from_hours(7 * 24);

/// Arguments of `batches`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Without --shift and --from: the last 7 days.")]
pub struct Args {
    #[command(flatten)]
    history: HistoryArgs,
    /// The latest so many; more than 100 at once have no figures
    #[arg(long, value_name = "NUMBER", default_value_t = 20)]
    limit: usize,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    /// Write CSV to this file instead, `-` for standard output: a row for each batch
    #[arg(long, value_name = "FILE", conflicts_with = "json")]
    out: Option<PathBuf>,
    #[command(flatten)]
    csv: CsvArgs,
}

/// Prints or writes the batches.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = args.history.load()?;
    if def.batches.is_empty() {
        return Err(CliError::Usage(format!("the plant file of {} has no [[batch]]", def.title)));
    }
    if let Some(out) = &args.out {
        args.history.refuse_own_file(&def, out)?;
    }
    in_runtime(async {
        let (source, period) = args.history.open_latest(&def, SPAN).await?;
        let query = Query::Batches { from: period.from, to: period.to, limit: args.limit };
        let Answer::Batches(batches) = source.query(query).await? else { return Err(unexpected()) };
        match &args.out {
            Some(out) => source.export(out, &batch::csv(&batches, &def, args.csv.dialect(&def))).await?,
            None if args.json => {
                say(&serde_json::to_string_pretty(&batches).expect("its keys are words and its numbers are finite"));
            }
            None => say(&batch::text(&batches, &def)),
        }
        Ok(())
    })
}
