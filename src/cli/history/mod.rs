//! `sightglass history`: what is stored, and what can be done with it as a whole.

mod backup;
mod compact;
mod import;
mod overview;
mod restore;
mod verify;

use std::{io::ErrorKind, path::Path, sync::Arc};

use jiff::Timestamp;

use super::{CliError, StationArgs, client, load, source::Source};
use crate::{
    access::io::{audit_log::AuditLog, own_user},
    plant::{PlantDef, record::ActionRecord, recorded_action::RecordedAction},
};

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
    /// Archive what is due now and shrink the database file; not while the station runs
    Compact(compact::Args),
    /// Fill gaps with the samples of a CSV or Parquet file, marked as imported, while the station runs or without it
    Import(import::Args),
    /// Write a backup of database, archive, audit log, users and parameter sets, while the station runs or without it
    Backup(backup::Args),
    /// Put a backup in the place of the history, which is set aside; not while the station runs
    Restore(restore::Args),
}

/// Which history.
#[derive(Debug, clap::Args)]
struct StoredPlant {
    /// A plant file, or the name of a shipped plant
    plant: String,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    station: StationArgs,
}

impl StoredPlant {
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
        Some(Command::Compact(args)) => compact::main(&args),
        Some(Command::Import(args)) => import::main(&args),
        Some(Command::Backup(args)) => backup::main(&args),
        Some(Command::Restore(args)) => restore::main(&args),
        None => overview::main(&StoredPlant { plant: plant.unwrap_or_default(), login, station }, json),
    }
}

/// The audit log, which a running station holds as well.
fn open_log(log: &Path) -> Result<AuditLog, CliError> {
    match AuditLog::open(log) {
        Ok((log, _)) => Ok(log),
        Err(error) if error.kind() == ErrorKind::WouldBlock => {
            Err(CliError::Failed(format!("{error}: stop its station first")))
        }
        Err(error) => Err(CliError::Io { what: log.display().to_string(), error }),
    }
}

/// Puts what was done to a history without its station on record.
fn record(
    log: &mut AuditLog,
    action: RecordedAction,
    target: &str,
    outcome: &str,
    at: Timestamp,
) -> Result<(), CliError> {
    let entry = ActionRecord::new(at, own_user(), action, target, outcome);
    let entry = ActionRecord { from: "command line".into(), ..entry };
    log.append(&mut [entry]).map_err(CliError::io("the audit log cannot be written"))
}

/// `12.3 MiB`.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1_024.0),
        1_048_576..1_073_741_824 => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
        _ => format!("{:.1} GiB", bytes as f64 / 1_073_741_824.0),
    }
}
