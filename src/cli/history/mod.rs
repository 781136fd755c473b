//! `sightglass history`: what is stored, and what can be done with it as a whole.

mod overview;
mod verify;

use std::sync::Arc;

use super::{CliError, StationArgs, client, load, source::Source};
use crate::plant::PlantDef;

/// Arguments of `history`.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// A plant file, or the name of a shipped plant
    #[arg(required = true)]
    plant: Option<String>,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Read every file of the archive and compare it with the manifest: exit code 1 if one is missing or was changed
    Verify(verify::Args),
}

/// Which history.
#[derive(Debug, clap::Args)]
struct Place {
    /// A plant file, or the name of a shipped plant
    plant: String,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

impl Place {
    fn load(&self) -> Result<Arc<PlantDef>, CliError> {
        Ok(Arc::new(load(&self.plant, &self.station)?))
    }

    async fn source(&self, def: &Arc<PlantDef>) -> Result<Source, CliError> {
        Source::open(def, &self.station, &self.login).await
    }
}

/// Does what the subcommand says; without one it shows what is stored.
pub fn main(args: Args) -> Result<(), CliError> {
    let Args { command, plant, json, login, station } = args;
    match command {
        Some(Command::Verify(args)) => verify::main(&args),
        None => overview::main(&Place { plant: plant.unwrap_or_default(), login, station }, json),
    }
}

/// `12.3 MiB`.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1_024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
        _ => format!("{:.1} GiB", bytes as f64 / 1_073_741_824.0),
    }
}
