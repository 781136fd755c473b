//! `sightglass history backup PLANT DIR`: through the station while it runs, else from the file.

use std::{
    path::{Path, PathBuf},
    sync::atomic::Ordering,
};

use jiff::Timestamp;

use super::StoredPlant;
use crate::{
    access::SessionRequest,
    cli::{
        CliError, client, in_runtime, paths,
        progress::{Progress, cancelled_by_ctrl_c, wait_for},
        say,
    },
    history::{
        HistoryError,
        backup::{Backup, BackupSource},
        io::{backup::read_manifest, store::Store},
    },
    station::companions::companions,
};

/// Arguments of `history backup`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
    /// A folder that is new or empty, or has an earlier backup of this history: then only what is new is copied
    #[arg(value_name = "DIR")]
    to: PathBuf,
}

/// Writes the backup and says what it has; a failure where files of the archive are missing of it.
pub fn main(args: &Args) -> Result<(), CliError> {
    let (def, station) = (args.plant.load()?, &args.plant.station);
    let to = std::path::absolute(&args.to).map_err(CliError::io(args.to.display().to_string()))?;
    let path = paths::history_file(&def, station);
    let written = in_runtime(async {
        match station.history.is_none() && client::find_station(Some(&def.name)).await.is_ok() {
            false => {
                let store = Store::open_read_only(&path, &def)?;
                from_file(&store, &to, &companions(&path, &def.name)).map(Some)
            }
            true => {
                let session = client::attach(Some(&def.name), &args.plant.login).await?;
                let request = SessionRequest::Backup { folder: to.display().to_string() };
                let durability = wait_for(session.request(request)).await?;
                client::warn_not_recorded("backed up", durability);
                // The station may write where its terminal may not read.
                Ok(read_manifest(&to).ok().flatten())
            }
        }
    })?;
    said(&to, written.as_ref())
}

/// Ctrl-C ends it at its next step, and nothing new is left of it.
fn from_file(store: &Store, to: &Path, companions: &[BackupSource]) -> Result<Backup, CliError> {
    let files: Vec<u64> = store.files(None)?.iter().map(|file| file.bytes).collect();
    let (mut done, mut files_done) = (0, files.iter());
    let mut progress = Progress::new(store.file_bytes() + files.iter().sum::<u64>());
    let interrupt = store.interrupt_handle();
    let cancelled = cancelled_by_ctrl_c(move || interrupt.interrupt());
    let is_cancelled = || cancelled.load(Ordering::Relaxed);
    let written = store.back_up(to, companions, Timestamp::now(), &mut |step| {
        done += match step {
            "database copied" => store.file_bytes(),
            "file copied" => files_done.next().copied().unwrap_or(0),
            _ => 0,
        };
        progress.show(done);
        if is_cancelled() { Err(HistoryError::NotOpen) } else { Ok(()) }
    });
    drop(progress);
    match written {
        Err(_) if is_cancelled() => Err(CliError::Failed("cancelled: nothing new is left in the folder".to_owned())),
        written => Ok(written?),
    }
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
