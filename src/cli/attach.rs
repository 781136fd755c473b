//! `sightglass` and `sightglass attach`: a terminal at a running station, or its plain lines. Leaving it stops nothing.

use std::io::Read;

use jiff::SignedDuration;
use tokio::sync::oneshot;

use crate::{
    attach::io::{connect::connect, find::FoundStation},
    ui::{self, plain::Plain},
};

use super::{CliError, TerminalArgs, client, in_runtime, say};

/// Arguments of `attach`.
#[derive(Debug, clap::Args)]
#[command(mut_arg("user", |user| user.requires("plain")))]
pub struct Args {
    /// The plant, if stations of more than one run here
    plant: Option<String>,
    /// For screen readers and logs: plain lines instead of screens, one for each change, until the end of input or Ctrl-C
    #[arg(long)]
    plain: bool,
    /// With --plain: a value is written at most once in this many seconds; a change of its quality at once
    #[arg(long, value_name = "SECONDS", default_value_t = 10, requires = "plain", value_parser = clap::value_parser!(u16).range(1..=3600))]
    every: u16,
    #[command(flatten)]
    login: client::Login,
    #[command(flatten)]
    terminal: TerminalArgs,
}

/// Attaches this terminal until its operator leaves, or writes plain lines.
pub fn main(args: Args) -> Result<(), CliError> {
    if args.plain {
        return in_runtime(plain(&args));
    }
    terminal(args.plant.as_deref(), &args.terminal)
}

/// A terminal at the station of this plant, or of the only one that runs here.
pub fn terminal(plant: Option<&str>, terminal: &TerminalArgs) -> Result<(), CliError> {
    ui::io::require_terminal()?;
    in_runtime(async { attach_to(&client::find_station(plant).await?, terminal).await })
}

/// Writes what stands, then each change.
async fn plain(args: &Args) -> Result<(), CliError> {
    let mut session = client::attach(args.plant.as_deref(), &args.login).await?;
    let locale = args.terminal.options(ui::Leaving::Terminal).language.locale();
    let mut plain = Plain::new(SignedDuration::from_secs(args.every.into()));
    let mut ended = end_of_input();
    loop {
        let (snapshot, status) =
            (session.snapshots.borrow_and_update().clone(), session.status.borrow_and_update().clone());
        locale.within(|| plain.lines(&snapshot, &status)).iter().for_each(|line| say(line));
        tokio::select! {
            changed = session.snapshots.changed() => if changed.is_err() { return Ok(()) },
            changed = session.status.changed() => if changed.is_err() { return Ok(()) },
            _ = &mut ended => return Ok(()),
        }
    }
}

/// Resolves at the end of standard input; what stands in it is not read as keys.
fn end_of_input() -> oneshot::Receiver<()> {
    let (end, ended) = oneshot::channel();
    // A runtime would wait for a blocked read when the station ends.
    std::thread::spawn(move || {
        let mut input = std::io::stdin().lock();
        while input.read(&mut [0; 256]).is_ok_and(|read| read > 0) {}
        drop(end);
    });
    ended
}

/// The same, where the station is known.
pub async fn attach_to(station: &FoundStation, terminal: &TerminalArgs) -> Result<(), CliError> {
    let session = connect(&station.path).await.map_err(|error| CliError::Failed(error.to_string()))?;
    Ok(ui::io::run(session, terminal.options(ui::Leaving::Terminal)).await?)
}
