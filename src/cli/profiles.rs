//! `sightglass profiles`: lists the known profiles, or prints one.

use crate::profile;

use super::{CliError, say};

/// Arguments of `profiles`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print this profile instead of the list
    name: Option<String>,
}

/// Lists or prints.
pub fn main(args: Args) -> Result<(), CliError> {
    match args.name {
        Some(name) => say(profile::text_of(&name).map_err(|error| CliError::Profile(error.to_string()))?.trim_end()),
        None => {
            for profile in profile::list() {
                say(&format!("{:8} {:18} {:34} {}", profile.kind, profile.name, profile.title, profile.origin));
            }
        }
    }
    Ok(())
}
