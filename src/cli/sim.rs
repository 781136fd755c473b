//! `sightglass sim`: serves the simulated devices of a plant to other masters.

use std::{net::SocketAddr, path::PathBuf};

use crate::{
    bus::io::clock::Clock,
    plant::{PlantDef, def::LineId},
    sim::io::{Endpoint, Mode, Service, SimError, serve},
};

use super::{CliError, StationArgs, load, log, run, runtime, say, speed};

impl From<SimError> for CliError {
    fn from(error: SimError) -> CliError {
        match error {
            SimError::Unknown(error) => CliError::Usage(error.to_string()),
            SimError::Io(error) => CliError::Io { what: "cannot serve the simulated plant".into(), error },
        }
    }
}

/// Arguments of `sim`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The plant to simulate; every line is served, and the options below are for its first one
    #[arg(default_value = "tank")]
    plant: String,
    /// How to serve it [default: as the plant file says; Modbus TCP if only an address is given]
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
    /// Run the plant and its line this many times faster
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
    /// ASCII frames over TCP
    AsciiOverTcp,
}

impl From<ModeArg> for Mode {
    fn from(mode: ModeArg) -> Mode {
        match mode {
            ModeArg::Rtu => Mode::Rtu,
            ModeArg::Ascii => Mode::Ascii,
            ModeArg::Tcp => Mode::Tcp,
            ModeArg::RtuOverTcp => Mode::RtuOverTcp,
            ModeArg::AsciiOverTcp => Mode::AsciiOverTcp,
        }
    }
}

/// Serves until a stop signal.
pub fn main(args: Args) -> Result<(), CliError> {
    let def = load(&args.plant, &StationArgs::default())?;
    let services = services(&def, &args)?;
    let _log = log::start(args.log.as_deref(), None)?;
    runtime()?.block_on(async {
        let clock = Clock::starting_at(jiff::Timestamp::now(), args.speed);
        let serving = serve(&def, clock, &services).await?;
        let port = serving.endpoints().first().and_then(Endpoint::path);
        let link = args.link.zip(port).map(|(link, port)| Link::make(link, port)).transpose()?;
        for ((line, service), place) in def.lines.iter().zip(&services).zip(serving.endpoints()) {
            let linked = link.as_ref().filter(|_| line.id == LineId(0)).map(|link| link.0.display().to_string());
            let which = if def.lines.len() == 1 { String::new() } else { format!(", line {},", line.name) };
            let place = linked.unwrap_or_else(|| place.to_string());
            say(&format!("{}{which} serves {} on {place}", def.title, service.mode));
        }
        run::signalled().await;
        Ok(())
    })
}

/// Every line as the plant says, the first one as the arguments say.
fn services(def: &PlantDef, args: &Args) -> Result<Vec<Service>, CliError> {
    let mut services: Vec<Service> = def.lines.iter().map(Service::new).collect();
    if let Some(first) = services.first_mut() {
        first.mode = args.mode.map(Mode::from).or(args.tcp.map(|_| Mode::Tcp)).unwrap_or(first.mode);
        first.serial.data_bits = args.data_bits.unwrap_or(first.serial.data_bits);
        first.address = args.tcp.unwrap_or(first.address);
        check(*first, args)?;
    }
    Ok(services)
}

/// Refuses what does not go together.
fn check(service: Service, args: &Args) -> Result<(), CliError> {
    let refuse = |why: &str| Err(CliError::Usage(why.to_owned()));
    match service.mode {
        Mode::Rtu if service.serial.data_bits == 7 => refuse("Modbus RTU needs 8 data bits"),
        Mode::Rtu | Mode::Ascii if args.tcp.is_some() => refuse("`--tcp` is for the modes over TCP"),
        mode if mode.is_tcp() && args.link.is_some() => refuse("`--link` is for the modes rtu and ascii"),
        mode if mode.is_tcp() && args.data_bits.is_some() => refuse("`--data-bits` is for the modes rtu and ascii"),
        Mode::Rtu | Mode::Ascii | Mode::Tcp | Mode::RtuOverTcp | Mode::AsciiOverTcp => Ok(()),
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
        std::os::unix::fs::symlink(target, &link).map_err(CliError::io(format!("cannot link {}", link.display())))?;
        Ok(Link(link))
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
