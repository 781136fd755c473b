//! `sightglass` and `sightglass attach`: a terminal at a running station. Leaving it stops nothing.

use crate::{
    attach::io::{connect::connect, find::FoundStation},
    ui,
};

use super::{CliError, TerminalArgs, client, in_runtime};

/// Arguments of `attach`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant, if stations of more than one run here
    pub plant: Option<String>,
    #[command(flatten)]
    pub terminal: TerminalArgs,
}

/// Attaches this terminal until its operator leaves.
pub fn main(args: Args) -> Result<(), CliError> {
    ui::io::require_terminal()?;
    in_runtime(async { attach_to(&client::find_station(args.plant.as_deref()).await?, &args.terminal).await })
}

/// The same, where the station is known.
pub async fn attach_to(station: &FoundStation, terminal: &TerminalArgs) -> Result<(), CliError> {
    let session = connect(&station.path).await.map_err(|error| CliError::Failed(error.to_string()))?;
    Ok(ui::io::run(session, terminal.options(ui::Leaving::Terminal)).await?)
}
