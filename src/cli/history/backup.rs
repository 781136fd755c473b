//! `sightglass history backup PLANT DIR`: through the station while it runs, else from the file.

use std::path::{Path, PathBuf};

use jiff::Timestamp;

use super::Place;
use crate::{
    access::{SessionRequest, io::audit_log},
    cli::{CliError, client, in_runtime, run, say},
    history::{
        backup::Backup,
        io::{backup::read_manifest, store::Store},
    },
};

/// Arguments of `history backup`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    place: Place,
    /// A folder that is new or empty, or has an earlier backup of this history: then only what is new is copied
    #[arg(value_name = "DIR")]
    to: PathBuf,
}

/// Writes the backup and says what it has; a failure where files of the archive are missing of it.
pub fn main(args: &Args) -> Result<(), CliError> {
    let (def, station) = (args.place.load()?, &args.place.station);
    let to = std::path::absolute(&args.to).map_err(CliError::io(args.to.display().to_string()))?;
    let path = run::history_file(&def, station);
    let written = in_runtime(async {
        match station.history.is_none() && client::place(Some(&def.name)).await.is_ok() {
            false => {
                let store = Store::open_read_only(&path, &def)?;
                let audit_log = audit_log::beside(&path);
                Ok(Some(store.back_up(&to, Some(&audit_log), Timestamp::now(), &mut |_| Ok(()))?))
            }
            true => {
                let session = client::attach(Some(&def.name), &args.place.login).await?;
                let request = SessionRequest::Backup { folder: to.display().to_string() };
                let durability = session.request(request).await.map_err(CliError::Failed)?;
                client::warn_not_recorded("backed up", durability);
                // The station may write where its terminal may not read.
                Ok(read_manifest(&to).ok().flatten())
            }
        }
    })?;
    said(&to, written.as_ref())
}

fn said(to: &Path, backup: Option<&Backup>) -> Result<(), CliError> {
    let Some(backup) = backup else {
        say(&format!("backed up to {}", to.display()));
        return Ok(());
    };
    let line = format!("backed up to {}: {}", to.display(), backup.summary());
    match backup.missing.is_empty() {
        true => {
            say(&line);
            Ok(())
        }
        false => Err(CliError::Failed(line)),
    }
}
