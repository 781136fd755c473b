//! Serves every line of a simulated plant at a endpoint of its own: a pseudo-terminal, or a TCP port.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr},
    path::{Path, PathBuf},
    time::Duration,
};

use tokio::{net::TcpListener, task::JoinHandle};

use super::{LineHandle, SimulatorHandle, TcpFraming, Wire, open_pty, serve_line, serve_tcp};
use crate::{
    bus::io::clock::Clock,
    plant::{
        PlantDef,
        def::{Framing, LineDef, LineId, Protocol, Serial, Transport},
        number::to_u16,
    },
    sim::simulator::{Simulator, UnknownSimulation},
};

/// A pseudo-terminal waits for its client as long as it takes.
pub(super) const FOR_EVER: Duration = Duration::from_secs(86_400 * 365);

/// Why a plant cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// The plant names a process that this program does not have.
    #[error(transparent)]
    Unknown(#[from] UnknownSimulation),
    /// No pseudo-terminal, or the TCP port is taken.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// A simulated plant that is being served; it ends when this is dropped.
#[derive(Debug)]
pub struct Serving {
    /// The simulator behind it, to inject faults.
    pub simulator: SimulatorHandle,
    endpoints: Vec<Endpoint>,
    tasks: Vec<JoinHandle<io::Result<()>>>,
}

/// Where a master finds a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Endpoint {
    /// The port to open.
    Port(PathBuf),
    /// The address to connect to.
    Address(SocketAddr),
}

impl Endpoint {
    /// The port, if it is one.
    pub fn path(&self) -> Option<&Path> {
        match self {
            Endpoint::Port(path) => Some(path),
            Endpoint::Address(_) => None,
        }
    }
}

/// `/dev/pts/3` or `127.0.0.1:40001`.
impl std::fmt::Display for Endpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Endpoint::Port(path) => path.display().fmt(f),
            Endpoint::Address(address) => address.fmt(f),
        }
    }
}

impl Serving {
    /// The endpoint of each line, in the order of the plant.
    pub fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    /// Puts every line of the plant that is served onto its simulated endpoint.
    pub fn plug_into(&self, def: &mut PlantDef) {
        for (line, endpoint) in def.lines.iter_mut().zip(&self.endpoints) {
            match (&mut line.transport, endpoint) {
                (Transport::Serial { port, .. }, Endpoint::Port(path)) => *port = path.display().to_string(),
                // Simulated devices are asked over a connection.
                (Transport::Network { protocol, host, port, .. }, Endpoint::Address(address)) => {
                    (*protocol, *host, *port) = (Protocol::Tcp, address.ip().to_string(), address.port());
                }
                // Served otherwise than the plant says, which is for masters of other makers.
                (Transport::Serial { .. }, Endpoint::Address(_)) | (Transport::Network { .. }, Endpoint::Port(_)) => {}
            }
        }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.tasks.iter().for_each(JoinHandle::abort);
    }
}

/// How the simulated devices of a line can be spoken to.
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
    /// ASCII frames over TCP.
    AsciiOverTcp,
}

impl Mode {
    /// What a line speaks.
    fn new(line: &LineDef) -> Mode {
        match &line.transport {
            Transport::Serial { framing: Framing::Ascii, .. } => Mode::Ascii,
            Transport::Serial { .. } => Mode::Rtu,
            Transport::Network { framing: Framing::Mbap, .. } => Mode::Tcp,
            Transport::Network { framing: Framing::Ascii, .. } => Mode::AsciiOverTcp,
            Transport::Network { .. } => Mode::RtuOverTcp,
        }
    }

    /// Whether it runs over TCP.
    pub fn is_tcp(self) -> bool {
        matches!(self, Mode::Tcp | Mode::RtuOverTcp | Mode::AsciiOverTcp)
    }
}

/// `Modbus RTU`, `Modbus ASCII`, `Modbus TCP`, `Modbus RTU over TCP`, `Modbus ASCII over TCP`.
impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Mode::Rtu => "Modbus RTU",
            Mode::Ascii => "Modbus ASCII",
            Mode::Tcp => "Modbus TCP",
            Mode::RtuOverTcp => "Modbus RTU over TCP",
            Mode::AsciiOverTcp => "Modbus ASCII over TCP",
        })
    }
}

/// How one line is served.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Service {
    /// What is spoken.
    pub mode: Mode,
    /// The pace of the serial line; the one behind a serial server, for RTU over TCP.
    pub serial: Serial,
    /// Where TCP is served; port 0 picks a free one.
    pub address: SocketAddr,
}

impl Service {
    /// As the plant says: at the pace of the line (9600 8N1 where it names none), on a free port of this machine.
    pub fn new(line: &LineDef) -> Service {
        let serial = line.transport.serial().unwrap_or(Serial::USUAL);
        Service { mode: Mode::new(line), serial, address: (Ipv4Addr::LOCALHOST, 0).into() }
    }

    /// What is spoken on any stream of bytes that stands for the line.
    pub fn tcp_framing(&self) -> TcpFraming {
        let wire = Wire { serial: self.serial, ascii: matches!(self.mode, Mode::Ascii | Mode::AsciiOverTcp) };
        if self.mode == Mode::Tcp { TcpFraming::Mbap } else { TcpFraming::Line(wire) }
    }
}

/// Serves every line of a plant; `services` says how, by [`LineId`].
pub async fn serve(def: &PlantDef, clock: Clock, services: &[Service]) -> Result<Serving, SimError> {
    serve_simulator(def, Simulator::new(def)?, clock, services).await
}

/// The same with a simulator that has already run.
pub async fn serve_simulator(
    def: &PlantDef,
    simulator: Simulator,
    clock: Clock,
    services: &[Service],
) -> Result<Serving, SimError> {
    let simulator = SimulatorHandle::spawn_for(def, simulator, clock);
    // What has started is ended by dropping this if a later line cannot be served.
    let mut serving = Serving { simulator, endpoints: Vec::new(), tasks: Vec::new() };
    for (line, service) in services.iter().enumerate() {
        let (endpoint, task) = start(serving.simulator.line(LineId(to_u16(line))), *service).await?;
        serving.endpoints.push(endpoint);
        serving.tasks.push(task);
    }
    Ok(serving)
}

async fn start(units: LineHandle, service: Service) -> io::Result<(Endpoint, JoinHandle<io::Result<()>>)> {
    match service.tcp_framing() {
        TcpFraming::Line(wire) if !service.mode.is_tcp() => {
            let (pty, path) = open_pty()?;
            Ok((Endpoint::Port(path), tokio::spawn(serve_line(pty, units, wire, FOR_EVER))))
        }
        framing => {
            let listener = TcpListener::bind(service.address).await?;
            let endpoint = Endpoint::Address(listener.local_addr()?);
            Ok((endpoint, tokio::spawn(serve_tcp(listener, units, framing))))
        }
    }
}
