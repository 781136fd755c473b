//! The lines of a simulated plant without ports: streams in memory, for drills in virtual time.

use tokio::{io::duplex, sync::mpsc};

use super::{
    LineHandle, SimulatorHandle, serve_line,
    serving::{FOR_EVER, Service},
    tcp::{TcpFraming, serve_stream},
};
use crate::{bus::io::transport::Connector, plant::PlantDef};

/// A line may be opened so often: an operator closes and opens it, a master gives a silent connection up.
const OPENINGS: usize = 16;
/// Bytes under way in one direction: more than any frame.
const BYTES: usize = 4096;

/// Serves every line of a plant as it speaks; gives what a station opens its lines with, by
/// [`LineId`](crate::plant::def::LineId).
pub fn in_memory(def: &PlantDef, simulator: &SimulatorHandle) -> Vec<Connector> {
    let line = |line: &crate::plant::def::LineDef| {
        let (streams, opened) = mpsc::channel(OPENINGS);
        for _ in 0..OPENINGS {
            let (master, slave) = duplex(BYTES);
            tokio::spawn(serve(slave, simulator.line(line.id), Service::new(line)));
            // The channel has room for all of them.
            let _ = streams.try_send(master);
        }
        Connector::Memory(opened)
    };
    def.lines.iter().map(line).collect()
}

async fn serve(stream: tokio::io::DuplexStream, units: LineHandle, service: Service) {
    let ended = match service.tcp_framing() {
        TcpFraming::Mbap => serve_stream(stream, units, TcpFraming::Mbap).await,
        TcpFraming::Line(wire) => serve_line(stream, units, wire, FOR_EVER).await,
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a line in memory has ended");
    }
}
