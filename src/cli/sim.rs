//! `sightglass sim`: serves the simulated devices of a plant to other masters.

use std::{net::SocketAddr, path::PathBuf};

use crate::{bus::io::clock::Clock, sim};

use super::{CliError, StationArgs, demo::simulation_error, load, log, run, runtime, say, speed};

/// Arguments of `sim`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant with a simulation
    #[arg(default_value = "tank")]
    plant: String,
    /// Serve Modbus TCP here instead of RTU on a pseudo-terminal; port 0 picks a free one
    #[arg(long, value_name = "ADDRESS:PORT")]
    tcp: Option<SocketAddr>,
    /// Make a symbolic link to the pseudo-terminal, so that its name stays the same
    #[arg(long, value_name = "PATH", conflicts_with = "tcp")]
    link: Option<PathBuf>,
    /// Run the plant and its line so many times faster
    #[arg(long, value_name = "N", default_value = "1", value_parser = speed)]
    speed: f64,
    /// File of the log
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

/// Serves until it is told to stop.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = load(&args.plant, &StationArgs::default())?;
    let _log = log::start(args.log.as_deref())?;
    runtime()?.block_on(async {
        let clock = Clock::starting_at(jiff::Timestamp::now(), args.speed);
        let failed = |error| simulation_error(&args.plant, error);
        if let Some(address) = args.tcp {
            let serving = sim::io::start_tcp(&def, clock, address).await.map_err(failed)?;
            say(&format!("{} serves Modbus TCP on {}", def.title, serving.address()));
            run::signalled().await;
            return Ok(());
        }
        let serving = sim::io::start_pty(&def, clock).map_err(failed)?;
        let link = args.link.map(|link| Link::make(link, serving.path())).transpose()?;
        let path = link.as_ref().map_or(serving.path(), |link| link.0.as_path());
        say(&format!("{} serves Modbus RTU on {}", def.title, path.display()));
        run::signalled().await;
        Ok(())
    })
}

/// A symbolic link that goes when the program goes.
struct Link(PathBuf);

impl Link {
    fn make(link: PathBuf, target: &std::path::Path) -> Result<Link, CliError> {
        // A link that a killed program left behind is replaced; anything else is not ours to remove.
        if std::fs::read_link(&link).is_ok_and(|old| old.starts_with("/dev/pts")) {
            let _ = std::fs::remove_file(&link);
        }
        std::os::unix::fs::symlink(target, &link)
            .map_err(|error| CliError::Io { what: format!("cannot link {}", link.display()), error })?;
        Ok(Link(link))
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
