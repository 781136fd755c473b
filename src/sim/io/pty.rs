//! A pseudo-terminal, one end of which serves as a serial port.

use std::io;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_serial::{SerialPort, SerialStream};

/// The end that the simulated devices speak through.
#[derive(Debug)]
pub struct Pty {
    master: SerialStream,
    /// Held open so that the master survives a client that closes the port.
    _slave: SerialStream,
}

/// Opens a pseudo-terminal in raw mode: nothing is echoed or translated. The path is the port for a client to open.
///
/// Needs a running tokio reactor. The library's pair is not exclusive; asking it to give up exclusivity would take a
/// shared lock instead, which keeps clients out, so it is left alone.
pub fn open_pty() -> io::Result<(Pty, PathBuf)> {
    let (master, slave) = SerialStream::pair()?;
    let path = slave.name().ok_or_else(|| io::Error::other("the pseudo-terminal has no name"))?;
    Ok((Pty { master, _slave: slave }, Path::new(&path).to_path_buf()))
}

impl AsyncRead for Pty {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context, buffer: &mut ReadBuf) -> Poll<io::Result<()>> {
        Pin::new(&mut self.master).poll_read(context, buffer)
    }
}

impl AsyncWrite for Pty {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.master).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        Pin::new(&mut self.master).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context) -> Poll<io::Result<()>> {
        Pin::new(&mut self.master).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::time::timeout;
    use tokio_serial::SerialPortBuilderExt;

    use super::*;
    use crate::bus::frame::with_crc;
    use crate::bus::io::clock::Clock;
    use crate::plant::def::LineId;
    use crate::plant::def::Serial;
    use crate::sim::io::{SimulatorHandle, Wire, serve_line};
    use crate::sim::rig::Rig;
    use crate::sim::simulator::Simulator;

    #[tokio::test]
    async fn a_client_can_close_the_port_and_come_back() {
        let (pty, path) = open_pty().expect("a pseudo-terminal is free");
        let serial = Serial::USUAL;
        let simulator =
            SimulatorHandle::spawn(Simulator::tank(Rig::demo()), Clock::starting_at(jiff::Timestamp::UNIX_EPOCH, 20.0));
        tokio::spawn(serve_line(
            pty,
            simulator.line(LineId(0)),
            Wire { serial, ascii: false },
            Duration::from_secs(60),
        ));
        for _ in 0..3 {
            let name = path.to_str().expect("the path is ASCII");
            // A process that another test starts keeps the lock of before until it is its program.
            let opened = async {
                loop {
                    match tokio_serial::new(name, 9600).open_native_async() {
                        Ok(port) => break port,
                        Err(_) => tokio::task::yield_now().await,
                    }
                }
            };
            let mut port = timeout(Duration::from_secs(5), opened).await.expect("the port opens");
            // Bytes that a terminal would translate: 0x0A and 0x0D as register values.
            for value in [0x0A, 0x0D, 0x11, 0x13] {
                let request = with_crc(&[2, 6, 4, 0x40, 0x03, value]);
                port.write_all(&request).await.expect("the port takes bytes");
                let mut reply = [0; 8];
                let read = timeout(Duration::from_secs(5), port.read_exact(&mut reply)).await;
                read.expect("an answer within five seconds").expect("the port gives bytes");
                assert_eq!(reply[..], request[..]);
            }
        }
    }
}
