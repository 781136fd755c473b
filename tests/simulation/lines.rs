//! Lines that misbehave: between a station and simulated devices, bytes are late, lost, flipped, cut, and connections end.

use std::time::Duration;

use sightglass::api::{
    bus::Connector,
    plant::PlantDef,
    sim::{Service, SimulatorHandle, TcpFraming, serve_line, serve_stream},
};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex},
    sync::mpsc,
    time::sleep,
};

use crate::dice::Dice;

/// More openings than a life has.
const OPENINGS: usize = 256;
/// More bytes than any frame.
const BYTES: usize = 4096;
/// No device waits so long.
const FOR_EVER: Duration = Duration::from_secs(86_400);

/// What a station opens the lines of a plant with; `trouble` is the share of answers that something happens to.
pub fn connectors(def: &PlantDef, simulator: &SimulatorHandle, trouble: f64, dice: &mut Dice) -> Vec<Connector> {
    let connector = |line: &sightglass::api::plant::LineDef| {
        let (streams, opened) = mpsc::channel(OPENINGS);
        for _ in 0..OPENINGS {
            let ((master, ours), (theirs, slave)) = (duplex(BYTES), duplex(BYTES));
            let units = simulator.line(line.id);
            match Service::new(line).tcp_framing() {
                TcpFraming::Mbap => drop(tokio::spawn(serve_stream(slave, units, TcpFraming::Mbap))),
                TcpFraming::Line(wire) => drop(tokio::spawn(serve_line(slave, units, wire, FOR_EVER))),
            }
            tokio::spawn(misbehave(ours, theirs, trouble, Dice(dice.below(1 << 31))));
            streams.try_send(master).unwrap();
        }
        Connector::Memory(opened)
    };
    def.lines.iter().map(connector).collect()
}

/// Carries bytes both ways until one end closes, or the connection breaks.
async fn misbehave(mut master: DuplexStream, mut slave: DuplexStream, trouble: f64, mut dice: Dice) {
    let (mut request, mut answer) = ([0; BYTES], [0; BYTES]);
    loop {
        tokio::select! {
            biased;
            read = master.read(&mut request) => match read {
                Ok(count @ 1..) => if slave.write_all(&request[..count]).await.is_err() { return },
                _ => return,
            },
            read = slave.read(&mut answer) => {
                let Ok(mut count @ 1..) = read else { return };
                if dice.chance(trouble) {
                    match dice.below(6) {
                        0 => continue,
                        1 => sleep(Duration::from_millis(dice.below(3_000))).await,
                        2 => answer[dice.place(count)] ^= 1 << dice.below(8),
                        3 => count = 1 + dice.place(count),
                        4 => {
                            // In pieces.
                            let cut = dice.place(count);
                            let first = master.write_all(&answer[..cut]).await;
                            sleep(Duration::from_millis(dice.below(30))).await;
                            if first.is_err() || master.write_all(&answer[cut..count]).await.is_err() { return }
                            continue;
                        }
                        _ => return,
                    }
                }
                if master.write_all(&answer[..count]).await.is_err() { return }
            }
        }
    }
}
