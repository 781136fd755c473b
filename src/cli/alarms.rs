//! `sightglass alarms`: the performance of the alarm system in a shift or period.

use crate::{
    history::{Answer, Query},
    report::alarm_metrics,
};

use super::{
    CliError, in_runtime, say,
    source::{HistoryArgs, unexpected},
};

/// Arguments of `alarms`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    history: HistoryArgs,
    /// Alarm performance: rates, floods, chattering and stale alarms, priorities, against their targets
    #[arg(long)]
    stats: bool,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
}

/// Prints the alarm performance.
pub fn main(args: Args) -> Result<(), CliError> {
    if !args.stats {
        return Err(CliError::Usage("nothing to print: expected --stats".into()));
    }
    let def = args.history.load()?;
    in_runtime(async {
        let (source, period) = args.history.open(&def).await?;
        let query = Query::AlarmMetrics { from: period.from, to: period.to };
        let Answer::AlarmMetrics(figures) = source.query(query).await? else { return Err(unexpected()) };
        if args.json {
            let metrics = alarm_metrics::metrics(&figures, &def, &period);
            say(&serde_json::to_string_pretty(&metrics).expect("its keys are words and its numbers are finite"));
        } else {
            say(&alarm_metrics::metrics_text(&figures, &def, &period));
        }
        Ok(())
    })
}
