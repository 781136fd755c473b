//! `sightglass sim`: serves the simulated devices of a plant to other masters.

use std::{
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
};

use crate::{
    bus::io::clock::Clock,
    plant::def::Serial,
    sim::io::{Mode, serial_of, start_pty, start_tcp},
};

use super::{CliError, StationArgs, demo::simulation_error, load, log, run, runtime, say, speed};

/// Arguments of `sim`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A plant with a simulation
    #[arg(default_value = "tank")]
    plant: String,
    /// How to serve it; as the first line of the plant says if this is not given, Modbus TCP if only an address is
    #[arg(long, value_enum)]
    mode: Option<ModeArg>,
    /// Data bits of the serial line instead of those in the plant file: 7 for ASCII as the standard has it, or 8
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(7..=8))]
    data_bits: Option<u8>,
    /// Where to serve TCP; port 0 picks a free one [default: 127.0.0.1:0]
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

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum ModeArg {
    /// RTU on a pseudo-terminal
    Rtu,
    /// ASCII on a pseudo-terminal
    Ascii,
    /// Modbus TCP
    Tcp,
    /// RTU frames over TCP, as a serial server passes them on
    RtuOverTcp,
}

impl From<ModeArg> for Mode {
    fn from(mode: ModeArg) -> Mode {
        match mode {
            ModeArg::Rtu => Mode::Rtu,
            ModeArg::Ascii => Mode::Ascii,
            ModeArg::Tcp => Mode::Tcp,
            ModeArg::RtuOverTcp => Mode::RtuOverTcp,
        }
    }
}

/// Serves until it is told to stop.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = load(&args.plant, &StationArgs::default())?;
    let given = args.mode.map(Mode::from).or(args.tcp.map(|_| Mode::Tcp));
    let mode = given.unwrap_or_else(|| Mode::of(&def));
    let mut serial = serial_of(&def);
    serial.data_bits = args.data_bits.unwrap_or(serial.data_bits);
    check(mode, serial, &args)?;
    let _log = log::start(args.log.as_deref())?;
    runtime()?.block_on(async {
        let clock = Clock::starting_at(jiff::Timestamp::now(), args.speed);
        let failed = |error| simulation_error(&args.plant, error);
        if mode.is_tcp() {
            let address = args.tcp.unwrap_or_else(|| (Ipv4Addr::LOCALHOST, 0).into());
            let serving = start_tcp(&def, clock, address, mode).await.map_err(failed)?;
            say(&format!("{} serves {mode} on {}", def.title, serving.address()));
            run::signalled().await;
            return Ok(());
        }
        let serving = start_pty(&def, clock, mode, serial).map_err(failed)?;
        let link = args.link.map(|link| Link::make(link, serving.path())).transpose()?;
        let path = link.as_ref().map_or(serving.path(), |link| link.0.as_path());
        say(&format!("{} serves {mode} on {}", def.title, path.display()));
        run::signalled().await;
        Ok(())
    })
}

/// Refuses what does not go together.
fn check(mode: Mode, serial: Serial, args: &Args) -> Result<(), CliError> {
    let refuse = |why: &str| Err(CliError::Usage(why.to_owned()));
    match mode {
        Mode::Rtu if serial.data_bits == 7 => refuse("Modbus RTU needs 8 data bits"),
        Mode::Rtu | Mode::Ascii if args.tcp.is_some() => refuse("`--tcp` is for the modes tcp and rtu-over-tcp"),
        Mode::Tcp | Mode::RtuOverTcp if args.link.is_some() => refuse("`--link` is for the modes rtu and ascii"),
        Mode::Tcp | Mode::RtuOverTcp if args.data_bits.is_some() => {
            refuse("`--data-bits` is for the modes rtu and ascii")
        }
        Mode::Rtu | Mode::Ascii | Mode::Tcp | Mode::RtuOverTcp => Ok(()),
    }
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
