//! Serves the simulation that a plant names, on a pseudo-terminal or over TCP.

use std::{
    io,
    net::SocketAddr,
    path::{Path, PathBuf},
};

use tokio::{net::TcpListener, task::JoinHandle};

use super::{RigHandle, open_pty, serve_rtu, serve_tcp};
use crate::{
    bus::io::clock::Clock,
    plant::{PlantDef, def::Serial},
    sim::rig::Rig,
};

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

/// Serves Modbus RTU on a new pseudo-terminal, at the pace of the plant's first serial line.
pub fn start_pty(def: &PlantDef, clock: Clock) -> Result<Serving<PathBuf>, SimError> {
    let rig = RigHandle::spawn(rig_of(def)?, clock);
    let (pty, place) = open_pty()?;
    let task = tokio::spawn(serve_rtu(pty, rig.clone(), serial_of(def)));
    Ok(Serving { place, rig, task })
}

/// Serves Modbus TCP; port 0 picks a free one.
pub async fn start_tcp(def: &PlantDef, clock: Clock, address: SocketAddr) -> Result<Serving<SocketAddr>, SimError> {
    let rig = RigHandle::spawn(rig_of(def)?, clock);
    let listener = TcpListener::bind(address).await?;
    let place = listener.local_addr()?;
    let task = tokio::spawn(serve_tcp(listener, rig.clone()));
    Ok(Serving { place, rig, task })
}

fn rig_of(def: &PlantDef) -> Result<Rig, SimError> {
    match def.simulation.as_deref() {
        Some("tank") => Ok(Rig::demo()),
        Some(_) | None => Err(SimError::NoSimulation),
    }
}

fn serial_of(def: &PlantDef) -> Serial {
    def.lines.iter().find_map(|line| line.transport.serial()).unwrap_or(Serial::USUAL)
}
