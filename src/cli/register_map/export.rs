//! `sightglass profile export`.

use std::path::PathBuf;

use crate::{
    cli::{CliError, put_out, say_error},
    profile::{self, Search, io::atomic},
    register_map::export::{self, Target},
};

/// Arguments of `profile export`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A device profile: its file, or its name
    profile: PathBuf,
    /// homeassistant, telegraf, or csv (which `profile import` reads again)
    #[arg(long, value_parser = super::words::<Target>)]
    format: Target,
    /// File to write; an existing one is never overwritten [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the text; what is not in it goes to standard error.
pub fn main(args: &Args) -> Result<(), CliError> {
    let checked =
        profile::check(&args.profile, &Search::usual()).map_err(|errors| CliError::Profile(Box::new(errors)))?;
    let exported = export::export(&checked.plant, args.format);
    let all = checked.plant.tags.len();
    for line in &exported.left_out {
        say_error(&format!("left out: {line}"));
    }
    for line in &exported.lost {
        say_error(&format!("not kept: {line}"));
    }
    say_error(&format!("{} of {all} tags as {}", exported.count, args.format.word()));
    if exported.count == 0 {
        return Err(CliError::Failed("this format cannot express any of it".to_owned()));
    }
    match &args.out {
        Some(path) => {
            atomic::write_new(path, exported.text.as_bytes()).map_err(CliError::io(path.display().to_string()))
        }
        None => put_out(exported.text.as_bytes()).map_err(CliError::io("standard output")),
    }
}
