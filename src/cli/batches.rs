//! `sightglass batches`: the batches of a period with their phases, energy and figures.

use crate::{
    history::{Answer, Query},
    report::{Period, batch},
};

use super::{
    CliError,
    list::{ListArgs, Rows},
};

/// Arguments of `batches`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Without --shift and --from: the last 7 days.")]
pub struct Args {
    #[command(flatten)]
    list: ListArgs,
    /// Only the latest N; more than 100 at once have no figures
    #[arg(long, value_name = "NUMBER", default_value_t = 20)]
    limit: usize,
}

/// Prints or writes the batches.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = args.list.load()?;
    if def.batches.is_empty() {
        return Err(CliError::Usage(format!("the plant file of {} has no [[batch]]", def.title)));
    }
    let of = |answer| if let Answer::Batches(batches) = answer { Some(batches) } else { None };
    let query = |period: Period| Query::Batches { from: period.from, to: period.to, limit: args.limit };
    args.list.write(&def, query, &Rows { of, csv: batch::csv, text: batch::text })
}
