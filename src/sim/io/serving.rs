//! Serves the simulation that a plant names, on a pseudo-terminal or over TCP.

use std::{
    io,
    net::SocketAddr,
    path::{Path, PathBuf},
    time::Duration,
};

use tokio::{net::TcpListener, task::JoinHandle};

use super::{RigHandle, Speech, Wire, open_pty, serve_line, serve_tcp};
use crate::{
    bus::io::clock::Clock,
    plant::{
        PlantDef,
        def::{Framing, Serial, Transport},
    },
    sim::rig::Rig,
};

/// A pseudo-terminal waits for its client as long as it takes.
const FOR_EVER: Duration = Duration::from_secs(86_400 * 365);

/// Why a plant cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The plant names no simulation, or one that this program does not have.
    #[error("the plant has no simulation that this program knows")]
    NoSimulation,
    /// No pseudo-terminal, or the TCP port is taken.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// A simulated line that is being served; it ends when this is dropped.
#[derive(Debug)]
pub struct Serving<Place> {
    place: Place,
    /// The rig behind it, for faults on demand.
    pub rig: RigHandle,
    task: JoinHandle<io::Result<()>>,
}

impl Serving<PathBuf> {
    /// The port for a master to open.
    pub fn path(&self) -> &Path {
        &self.place
    }
}

impl Serving<SocketAddr> {
    /// The address for a master to connect to.
    pub fn address(&self) -> SocketAddr {
        self.place
    }
}

impl<Place> Drop for Serving<Place> {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// How the simulated devices can be spoken to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// RTU on a serial line.
    Rtu,
    /// ASCII on a serial line.
    Ascii,
    /// Modbus TCP.
    Tcp,
    /// RTU frames over TCP.
    RtuOverTcp,
}

impl Mode {
    /// What the plant's first line speaks.
    pub fn of(def: &PlantDef) -> Mode {
        match def.lines.first().map(|line| &line.transport) {
            Some(Transport::Serial { framing: Framing::Ascii, .. }) => Mode::Ascii,
            Some(Transport::Serial { .. }) | None => Mode::Rtu,
            Some(Transport::Tcp { framing: Framing::Mbap, .. }) => Mode::Tcp,
            Some(Transport::Tcp { .. }) => Mode::RtuOverTcp,
        }
    }

    /// Whether it runs over TCP.
    pub fn is_tcp(self) -> bool {
        matches!(self, Mode::Tcp | Mode::RtuOverTcp)
    }
}

/// `Modbus RTU`, `Modbus ASCII`, `Modbus TCP`, `Modbus RTU over TCP`.
impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Mode::Rtu => "Modbus RTU",
            Mode::Ascii => "Modbus ASCII",
            Mode::Tcp => "Modbus TCP",
            Mode::RtuOverTcp => "Modbus RTU over TCP",
        })
    }
}

/// The plant's first serial line, for its pace; 9600 8N1 if it has none.
pub fn serial_of(def: &PlantDef) -> Serial {
    def.lines.iter().find_map(|line| line.transport.serial()).unwrap_or(Serial::USUAL)
}

/// Serves on a new pseudo-terminal at the pace of a serial line: ASCII in that mode, RTU in any other.
pub fn start_pty(def: &PlantDef, clock: Clock, mode: Mode, serial: Serial) -> Result<Serving<PathBuf>, SimError> {
    let rig = RigHandle::spawn(rig_of(def)?, clock);
    let (pty, place) = open_pty()?;
    let wire = Wire { serial, ascii: mode == Mode::Ascii };
    let task = tokio::spawn(serve_line(pty, rig.clone(), wire, FOR_EVER));
    Ok(Serving { place, rig, task })
}

/// Serves over TCP; port 0 picks a free one. RTU over TCP, in that mode, keeps the pace of the serial line behind it; any
/// other mode means Modbus TCP.
pub async fn start_tcp(
    def: &PlantDef,
    clock: Clock,
    address: SocketAddr,
    mode: Mode,
) -> Result<Serving<SocketAddr>, SimError> {
    let rig = RigHandle::spawn(rig_of(def)?, clock);
    let listener = TcpListener::bind(address).await?;
    let place = listener.local_addr()?;
    let speech = match mode {
        Mode::RtuOverTcp => Speech::Line(Wire { serial: serial_of(def), ascii: false }),
        Mode::Tcp | Mode::Rtu | Mode::Ascii => Speech::Mbap,
    };
    let task = tokio::spawn(serve_tcp(listener, rig.clone(), speech));
    Ok(Serving { place, rig, task })
}

fn rig_of(def: &PlantDef) -> Result<Rig, SimError> {
    match def.simulation.as_deref() {
        Some("tank") => Ok(Rig::demo()),
        Some(_) | None => Err(SimError::NoSimulation),
    }
}
