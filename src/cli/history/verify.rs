//! `sightglass history verify PLANT`: whether the archive is sound.

use std::path::Path;

use super::{StoredPlant, overview};
use crate::{
    cli::{CliError, in_runtime, progress::Progress, say},
    history::{ArchiveFile, io::archive::sync_and_hash},
};

/// Arguments of `history verify`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    plant: StoredPlant,
}

/// Compares the files of the archive with the manifest.
pub fn main(args: &Args) -> Result<(), CliError> {
    let def = args.plant.load()?;
    let overview = in_runtime(overview::ask(&args.plant, &def))?;
    let mut progress = Progress::new(overview.files.iter().map(|file| file.bytes).sum());
    let (mut wrong, mut done) = (Vec::new(), 0);
    for file in &overview.files {
        wrong.extend(trouble(&overview.folder, file).map(|trouble| format!("{}: {trouble}", file.path)));
        done += file.bytes;
        progress.show(done);
    }
    drop(progress);
    wrong.iter().for_each(|wrong| say(wrong));
    match wrong.len() {
        0 => {
            say(&format!("verified  {} files: each is as it was written", overview.files.len()));
            Ok(())
        }
        count => {
            Err(CliError::Failed(format!("{count} of {} files of the archive are not sound", overview.files.len())))
        }
    }
}

fn trouble(folder: &Path, file: &ArchiveFile) -> Option<String> {
    match sync_and_hash(&folder.join(&file.path)) {
        Err(error) => Some(error.to_string()),
        Ok((bytes, _)) if bytes != file.bytes => Some(format!("found {bytes} bytes, expected {}", file.bytes)),
        Ok((_, sha256)) if sha256 != file.sha256 => Some("its bytes were changed: another SHA-256".to_owned()),
        Ok(_) => None,
    }
}
