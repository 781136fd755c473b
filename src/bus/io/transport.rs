//! Opens what the bytes travel on: a serial port or a TCP connection, with errors that say what to do.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncRead, AsyncWrite, DuplexStream},
    net::TcpStream,
    sync::mpsc,
};
use tokio_serial::{SerialPortBuilderExt, SerialStream};

use super::{
    datagrams::Datagrams,
    pause::Pause,
    ports,
    uart::{self, PortWatch},
};
use crate::plant::{
    def::{Parity, Protocol, Rs485, Serial, Transport},
    line_trouble::LineTrouble,
};

/// A TCP connection must stand within this time.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);

/// An open port or connection.
pub trait Stream: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Stream for T {}

/// An open port or connection with what belongs to it.
pub struct Opened {
    /// The bytes.
    pub stream: Box<dyn Stream>,
    /// How silences are kept on it.
    pub pause: Pause,
    /// What its driver counts and sees, if it is a serial port.
    pub watch: Option<PortWatch>,
}

/// How a line is opened.
#[derive(Debug)]
pub enum Connector {
    /// As the plant says.
    Real(Transport),
    /// In memory: each opening takes the next stream; none left means that there is no port now.
    Memory(mpsc::Receiver<DuplexStream>),
}

impl Connector {
    /// Opens the port or connection.
    pub async fn open(&mut self) -> Result<Opened, LineTrouble> {
        match self {
            Connector::Real(transport) => open(transport).await,
            Connector::Memory(streams) => match streams.try_recv() {
                Ok(stream) => Ok(Opened { stream: Box::new(stream), pause: Pause::Coarse, watch: None }),
                Err(_) => Err(LineTrouble::System("no such port".to_owned())),
            },
        }
    }

    /// Opens it once with other settings.
    pub async fn open_as(&mut self, transport: &Transport) -> Result<Opened, LineTrouble> {
        match self {
            Connector::Real(_) => open(transport).await,
            Connector::Memory(_) => self.open().await,
        }
    }

    /// Other settings from now on.
    pub fn retarget(&mut self, transport: &Transport) {
        if let Connector::Real(real) = self {
            *real = transport.clone();
        }
    }
}

async fn open(transport: &Transport) -> Result<Opened, LineTrouble> {
    match transport {
        Transport::Serial { port, serial, rs485, .. } => open_serial(port, *serial, *rs485),
        Transport::Network { protocol: Protocol::Tcp, host, port, .. } => open_tcp(host, *port).await,
        Transport::Network { protocol: Protocol::Udp, host, port, framing } => {
            let stream = Box::new(Datagrams::open(host, *port, *framing).await?);
            Ok(Opened { stream, pause: Pause::exact(), watch: None })
        }
    }
}

fn open_serial(path: &str, serial: Serial, rs485: Rs485) -> Result<Opened, LineTrouble> {
    let stream = serial_stream(path, serial)?;
    if matches!(serial.parity, Parity::Mark | Parity::Space) {
        uart::set_fixed_parity(&stream).map_err(|error| LineTrouble::NoParity {
            path: path.to_owned(),
            parity: serial.parity.word().to_owned(),
            error: error.to_string(),
        })?;
    }
    // A driver remembers what an earlier opening has switched on; one that never could needs no call.
    let switched = uart::set_rs485(&stream, rs485);
    if rs485 != Rs485::Off {
        switched.map_err(|error| LineTrouble::NoRs485 { path: path.to_owned(), error: error.to_string() })?;
    }
    let watch = PortWatch::new(&stream);
    Ok(Opened { stream: Box::new(stream), pause: Pause::exact(), watch })
}

/// A serial port, taken exclusively: a second master on the line is refused by the system.
pub(super) fn serial_stream(path: &str, serial: Serial) -> Result<SerialStream, LineTrouble> {
    use tokio_serial::{DataBits, FlowControl, StopBits};
    let builder = tokio_serial::new(path, serial.baud)
        .data_bits(if serial.data_bits == 7 { DataBits::Seven } else { DataBits::Eight })
        .parity(match serial.parity {
            Parity::None => tokio_serial::Parity::None,
            Parity::Even | Parity::Space => tokio_serial::Parity::Even,
            Parity::Odd | Parity::Mark => tokio_serial::Parity::Odd,
        })
        .stop_bits(if serial.stop_bits == 2 { StopBits::Two } else { StopBits::One })
        .flow_control(FlowControl::None);
    builder.open_native_async().map_err(|error| ports::why_not(path, &error))
}

async fn open_tcp(host: &str, port: u16) -> Result<Opened, LineTrouble> {
    let stream = connect(host, port).await?;
    Ok(Opened { stream: Box::new(stream), pause: Pause::exact(), watch: None })
}

/// A TCP connection.
pub(super) async fn connect(host: &str, port: u16) -> Result<TcpStream, LineTrouble> {
    let place = || format!("{host}:{port}");
    let connect = TcpStream::connect((host, port));
    let stream = match tokio::time::timeout(CONNECT_TIMEOUT, connect).await {
        Err(_) => return Err(LineTrouble::NoConnection { place: place(), seconds: CONNECT_TIMEOUT.as_secs() }),
        Ok(Err(error)) => return Err(not_connected(place(), &error)),
        Ok(Ok(stream)) => stream,
    };
    // Small frames must not wait for each other.
    stream.set_nodelay(true).map_err(|error| not_connected(place(), &error))?;
    if let Err(error) = notice_silence(&stream) {
        tracing::debug!(%error, "no keepalive on {host}:{port}");
    }
    Ok(stream)
}

/// A peer that has vanished without a word is noticed within half a minute, and what was sent to it is taken back: left to
/// itself the system would go on sending for a quarter of an hour, and a write given up long ago would take effect.
fn notice_silence(stream: &TcpStream) -> Result<(), rustix::io::Errno> {
    use rustix::net::sockopt;
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, Duration::from_secs(10))?;
    sockopt::set_tcp_keepintvl(stream, Duration::from_secs(5))?;
    sockopt::set_tcp_keepcnt(stream, 3)?;
    sockopt::set_tcp_user_timeout(stream, 5_000)?;
    sockopt::set_socket_linger(stream, Some(Duration::ZERO))
}

fn not_connected(place: String, error: &io::Error) -> LineTrouble {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => LineTrouble::Refused(place),
        io::ErrorKind::HostUnreachable | io::ErrorKind::NetworkUnreachable => LineTrouble::NoRoute(place),
        _ => LineTrouble::System(format!("{place}: {error}")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn errors_say_what_to_do() {
        let missing = Transport::rtu("/dev/no-such-port", Serial::USUAL);
        let words = Connector::Real(missing).open().await.err().unwrap().to_string();
        assert!(words.starts_with("/dev/no-such-port: no such port ("), "{words}");
        // A port that was just free and is closed again refuses.
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let closed = Transport::tcp("127.0.0.1", port);
        let words = Connector::Real(closed).open().await.err().unwrap().to_string();
        assert!(words.contains("refused"), "{words}");
    }
}
