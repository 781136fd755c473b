//! `sightglass history compact PLANT`: archives what is due and gives room back; not while the station runs.

use jiff::Timestamp;

use super::{StoredPlant, size};
use crate::{
    cli::{CliError, paths, say},
    history::io::{compact::compact, store::Store},
};

/// Arguments of `history compact`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
}

/// Compacts, and tells the size before and after.
pub fn main(args: &Args) -> Result<(), CliError> {
    let (def, now) = (args.plant.load()?, Timestamp::now());
    let path = paths::history_file(&def, &args.plant.station);
    if !path.exists() {
        return Err(CliError::History(crate::history::HistoryError::Missing { path: path.display().to_string() }));
    }
    let opened = Store::open(&path, &def, now)?;
    if let Some(trouble) = opened.trouble {
        say(&trouble);
    }
    let done = compact(opened.store, now, &mut |_| Ok(()))?;
    say(&format!(
        "{}: {} before, {} after; {} jobs of the archive done",
        path.display(),
        size(done.before),
        size(done.after),
        done.jobs
    ));
    Ok(())
}
