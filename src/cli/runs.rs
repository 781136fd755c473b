//! `sightglass runs`: the control runs of a period with their figures.

use crate::{
    history::{Answer, Query},
    report::{Period, control_runs},
};

use super::{
    CliError,
    list::{ListArgs, Rows},
};

const DEFINITIONS: &str = "\
Without --shift and --from: the last 7 days.

A run of a controller begins when its setpoint is changed, a step of its program begins, or a batch starts; it ends with the
next one, or after 4 h. Times count from its begin. PV is at SV within a band: 2 % of the way from PV to SV, 0.5 % of the range
at least. A [[run]] of the plant file sets band, times, energy and tags.
  first at SV  when PV was first at SV or beyond it
  steady from  when PV came to SV to stay, five minutes at least
  rise         from 10 % to 90 % of the way from PV to SV
  overshoot    the most that PV was beyond SV
  offset       SV less PV at the end
  IAE          integral of the absolute error
Only good values count: what happened in a gap of more than ten seconds is unknown, sums and extremes are then a least.";

/// Arguments of `runs`.
#[derive(Debug, clap::Args)]
#[command(after_help = DEFINITIONS)]
pub struct Args {
    #[command(flatten)]
    list: ListArgs,
    /// Only the runs of this controller
    #[arg(long, value_name = "DEVICE")]
    controller: Option<String>,
    /// Only the latest N
    #[arg(long, value_name = "NUMBER", default_value_t = 100)]
    limit: usize,
}

/// Prints or writes the runs.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = args.list.load()?;
    if def.runs.is_empty() {
        return Err(CliError::Usage(format!("{} has no controller with SV and PV", def.title)));
    }
    if let Some(name) = &args.controller {
        let known: Vec<&str> = def.runs.iter().map(|run| def.device(run.controller).name.as_str()).collect();
        if !known.contains(&name.as_str()) {
            return Err(CliError::Usage(format!("no controller `{name}`: expected one of {}", known.join(", "))));
        }
    }
    let (controller, limit) = (args.controller, args.limit);
    let of = |answer| if let Answer::ControlRuns(runs) = answer { Some(runs) } else { None };
    let query = |period: Period| Query::ControlRuns { controller, from: period.from, to: period.to, limit };
    args.list.write(&def, query, &Rows { of, csv: control_runs::csv, text: control_runs::text })
}
