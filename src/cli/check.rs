//! `sightglass check`: every error of a file at once, or the read plan of each line.

use std::path::PathBuf;

use crate::{
    bus::plan,
    profile::{self, Search},
};

use super::{CliError, render, say};

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant file or device profile, or the name of a shipped one
    file: PathBuf,
}

/// Checks; on success prints what would be read, and how busy each line would be.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = profile::check(&args.file, &Search::usual()).map_err(|errors| CliError::Profile(render(&errors)))?;
    let (tags, alarms) = (def.tags.len(), def.alarms.len());
    say(&format!("{}: {} is good: {tags} tags, {alarms} alarms", args.file.display(), def.title));
    for line in plan::describe(&def) {
        say(&line);
    }
    Ok(())
}
