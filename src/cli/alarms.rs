//! `sightglass alarms`: how good the alarm system was in a shift or period.

use std::sync::Arc;

use crate::{
    history::{Answer, HistoryError, Query},
    plant::PlantDef,
    report::alarm_metrics,
};

use super::{CliError, StationArgs, client, in_runtime, load, say, source::Source};

/// Arguments of `alarms`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file, or the name of a shipped plant
    plant: String,
    /// How good the alarm system was: rates, floods, chattering and stale alarms, priorities, against their targets
    #[arg(long)]
    stats: bool,
    /// Which shift: last, current, NAME or NAME@YYYY-MM-DD [default: last]
    #[arg(long, value_name = "SHIFT")]
    shift: Option<String>,
    /// From this local time (2026-11-21T06:00) or instant with offset
    #[arg(long, value_name = "TIME")]
    from: Option<String>,
    /// To this local time or instant [default: now]
    #[arg(long, value_name = "TIME")]
    to: Option<String>,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

/// Asks for the figures and prints them.
pub fn main(args: Args) -> Result<(), CliError> {
    if !args.stats {
        return Err(CliError::Usage("found nothing to tell: expected --stats".into()));
    }
    let def = Arc::new(load(&args.plant, &args.station)?);
    in_runtime(tell(def, args))
}

async fn tell(def: Arc<PlantDef>, args: Args) -> Result<(), CliError> {
    let source = Source::open(&def, &args.station, &args.login).await?;
    let period = source.period(&def, args.shift.as_deref(), args.from.as_deref(), args.to.as_deref())?;
    let query = Query::AlarmMetrics { from: period.from, to: period.to };
    let Answer::AlarmMetrics(figures) = source.ask(query).await? else {
        return Err(CliError::History(HistoryError::Engine("answered another query".into())));
    };
    if args.json {
        let metrics = alarm_metrics::metrics(&figures, &def, &period);
        let json = serde_json::to_string_pretty(&metrics).expect("its keys are words and its numbers are finite");
        say(&json);
    } else {
        say(&alarm_metrics::metrics_text(&figures, &def, &period));
    }
    Ok(())
}
