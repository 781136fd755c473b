//! Names of commands that are none: their new name, or the one that was probably meant.

use std::path::Path;

use super::CliError;
use crate::profile;

/// The answer to a command name of an earlier version.
pub(super) fn renamed(word: &str) -> Option<String> {
    const RENAMED: [(&str, &str); 3] = [("unit", "systemd-unit"), ("frame", "decode"), ("raw", "send")];
    let (old, new) = RENAMED.iter().find(|(old, _)| *old == word)?;
    Some(format!("`{old}` is now `{new}`"))
}

/// Says which command was probably meant where there is no plant of this name.
pub(super) fn meant(word: &str, error: CliError) -> CliError {
    let command = <super::Args as clap::CommandFactory>::command();
    let names: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
    match (error, profile::diagnostic::nearest(word, &names)) {
        (CliError::Profile(why), Some(meant)) if !Path::new(word).exists() => {
            let why = why.to_string();
            CliError::Usage(format!("{}\ndid you mean the command `sightglass {meant}`?", why.trim_end()))
        }
        (error, _) => error,
    }
}
