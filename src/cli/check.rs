//! `sightglass check`: every error of a file at once, or the read plan of each line.

use std::io::IsTerminal;

use crate::{bus::plan, profile};

use super::{CliError, say};

/// Arguments of `check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant or device file, or the name of a shipped one
    file: String,
}

/// Checks; on success prints what would be read, and how busy each line would be.
pub fn main(args: Args) -> Result<(), CliError> {
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let checked = profile::check(&args.file).map_err(|errors| CliError::Profile(errors.render(color)))?;
    match checked {
        profile::Checked::Plant(def) => {
            say(&format!("{}: {} is good", args.file, def.title));
            for line in plan::describe(&def) {
                say(&line);
            }
        }
        profile::Checked::Device { title, tags } => say(&format!("{}: {title} is good, {tags} tags", args.file)),
    }
    Ok(())
}
