//! `sightglass profiles`: lists the known profiles, prints one, or the page about the format.

use crate::profile::{self, Kind, Search};

use super::{CliError, say};

/// Arguments of `profiles`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print this profile instead of the list
    #[arg(conflicts_with = "format")]
    name: Option<String>,
    /// Print the page that explains every key of plant files and profiles, and the pictures of the mimic
    #[arg(long)]
    format: bool,
}

/// Lists or prints.
pub fn main(args: Args) -> Result<(), CliError> {
    if args.format {
        say(profile::FORMAT_PAGE.trim_end());
        return Ok(());
    }
    let search = Search::usual();
    let Some(name) = args.name else {
        for listed in profile::list(&search) {
            let kind = match listed.kind {
                Kind::Plant => "plant",
                Kind::Device => "device",
                Kind::Scenario => "scenario",
            };
            let from = listed.from.map_or_else(|| "shipped".into(), |path| path.display().to_string());
            say(&format!("{kind:8}  {:24}  {from}", listed.name));
        }
        return Ok(());
    };
    match profile::text_of(&name, &search) {
        Some(text) => say(text.trim_end()),
        None => {
            let names: Vec<String> = profile::list(&search).into_iter().map(|listed| listed.name).collect();
            return Err(CliError::Usage(format!("no profile `{name}`, there are {}", names.join(", "))));
        }
    }
    Ok(())
}
