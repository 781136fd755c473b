//! `sightglass profile`: register maps of others become device profiles, and device profiles become theirs.

mod export;
mod import;

use clap::Subcommand;

use super::CliError;

/// Arguments of `profile`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a device profile from a register map: CSV, Excel, Markdown, HTML, Home Assistant, ESPHome, Telegraf, ioBroker, NIBE,
    /// modbus_local_gateway, solarman, wb-mqtt-serial, SunSpec, ModbusScope, MTUI
    Import(import::Args),
    /// Write a device profile as the configuration of another program; what that cannot express is listed
    Export(export::Args),
}

/// Imports or exports.
pub fn main(args: Args) -> Result<(), CliError> {
    match args.command {
        Command::Import(args) => import::main(&args),
        Command::Export(args) => export::main(&args),
    }
}

/// The words of an enum as the values of an option.
fn words<T: crate::plant::keyword::Keyword>(text: &str) -> Result<T, String> {
    T::from_word(text).ok_or_else(|| {
        let known: Vec<&str> = T::WORDS.iter().map(|(word, _)| *word).collect();
        format!("expected one of: {}", known.join(", "))
    })
}
