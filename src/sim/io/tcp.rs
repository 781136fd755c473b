//! Serves the units of a line over TCP to several clients at once: Modbus TCP, or the frames of a serial line.

use std::io;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::{LineHandle, Wire, serve_line};
use crate::bus::frame::{self, Mbap};

/// Clients at once; one more is turned away by closing its connection.
const CLIENTS_MAX: usize = 16;
/// A client that asks nothing for this long is taken for dead.
const IDLE_MAX: Duration = Duration::from_secs(600);

/// What is spoken over TCP.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TcpFraming {
    /// Modbus TCP.
    Mbap,
    /// The frames of a serial line, as a serial server passes them on.
    Line(Wire),
}

/// Serves until the listener fails. Clients are cut off when this future is dropped.
pub async fn serve_tcp(listener: TcpListener, units: LineHandle, framing: TcpFraming) -> io::Result<()> {
    let mut clients = JoinSet::new();
    loop {
        tokio::select! {
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) if clients.len() < CLIENTS_MAX => {
                    // Without this small answers wait for the client's acknowledgement; if it fails they are just slower.
                    stream.set_nodelay(true).ok();
                    let units = units.clone();
                    clients.spawn(serve_stream(stream, units, framing));
                }
                Ok(_turned_away) => {}
                Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
                Err(error) => return Err(error),
            },
            Some(_ended) = clients.join_next() => {}
        }
    }
}

/// Serves one client, over any stream of bytes.
pub async fn serve_stream<S>(stream: S, units: LineHandle, framing: TcpFraming) -> io::Result<()>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    match framing {
        TcpFraming::Mbap => serve_client(stream, units).await,
        TcpFraming::Line(wire) => serve_line(stream, units, wire, IDLE_MAX).await,
    }
}

/// Serves one client in the order of its requests until it leaves, falls silent or breaks the protocol. TCP knows no
/// broadcast: a request to a unit that does not exist, 0 included, has no response.
async fn serve_client<S: AsyncRead + AsyncWrite + Unpin>(mut stream: S, units: LineHandle) -> io::Result<()> {
    let mut received = Vec::new();
    while let Some((transaction, message)) = timeout(IDLE_MAX, receive(&mut stream, &mut received)).await?? {
        let Some((unit, pdu)) = message.split_first().filter(|(unit, _)| units.has(**unit)) else { continue };
        if let Some(answer) = units.ask(*unit, pdu).await {
            units.clock().sleep(answer.delay).await;
            timeout(IDLE_MAX, stream.write_all(&answer.tcp(transaction))).await??;
        }
    }
    Ok(())
}

/// One request as transaction and message; `None` when the header is not Modbus, as the place in the stream is lost.
/// `received` keeps what has come of the next one.
async fn receive<S: AsyncRead + Unpin>(stream: &mut S, received: &mut Vec<u8>) -> io::Result<Option<(u16, Vec<u8>)>> {
    loop {
        match frame::mbap(received) {
            Mbap::Whole { transaction, end } => {
                return Ok(Some((transaction, received.drain(..end).skip(6).collect())));
            }
            Mbap::Broken => return Ok(None),
            Mbap::Incomplete => {}
        }
        if stream.read_buf(received).await? == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use jiff::Timestamp;
    use tokio::net::TcpStream;

    use super::*;
    use crate::bus::frame::with_crc;
    use crate::bus::io::clock::Clock;
    use crate::plant::def::{LineId, Serial};
    use crate::sim::{io::SimulatorHandle, rig::Rig, simulator::Simulator};

    async fn assert_reply(client: &mut TcpStream, request: &[u8], expect: &[u8]) {
        client.write_all(request).await.expect("the server takes requests");
        let mut reply = vec![0; expect.len()];
        let read = timeout(Duration::from_secs(5), client.read_exact(&mut reply)).await;
        read.expect("an answer within five seconds").expect("the connection holds");
        assert_eq!(reply, expect);
    }

    /// Ten times as fast as life.
    async fn serve(framing: TcpFraming) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port is free");
        let address = listener.local_addr().expect("a bound listener has an address");
        let simulator =
            SimulatorHandle::spawn(Simulator::tank(Rig::new()), Clock::starting_at(Timestamp::UNIX_EPOCH, 10.0));
        tokio::spawn(serve_tcp(listener, simulator.line(LineId(0)), framing));
        address
    }

    async fn ends(client: &mut TcpStream) -> bool {
        let ended = timeout(Duration::from_secs(5), client.read(&mut [0; 1])).await.expect("the connection ends");
        matches!(ended, Ok(0) | Err(_))
    }

    #[tokio::test]
    async fn several_clients_share_one_simulator() {
        let address = serve(TcpFraming::Mbap).await;
        let connect = || async { TcpStream::connect(address).await.expect("the server accepts") };
        let (mut one, mut two) = (connect().await, connect().await);
        let write = [0, 7, 0, 0, 0, 6, 1, 6, 0x03, 0xEA, 0x01, 0xF4];
        assert_reply(&mut one, &write, &write).await;
        let read = [0, 8, 0, 0, 0, 6, 1, 3, 0x03, 0xEA, 0, 1];
        assert_reply(&mut two, &read, &[0, 8, 0, 0, 0, 5, 1, 3, 2, 0x01, 0xF4]).await;
        // A request that is not Modbus ends its own connection and no other.
        one.write_all(b"GET / HTTP/1.1\r\n").await.expect("the server takes bytes");
        assert!(ends(&mut one).await);
        assert_reply(&mut two, &read, &[0, 8, 0, 0, 0, 5, 1, 3, 2, 0x01, 0xF4]).await;
    }

    #[tokio::test]
    async fn requests_in_one_segment_are_answered_in_order() {
        let mut client = TcpStream::connect(serve(TcpFraming::Mbap).await).await.expect("the server accepts");
        let read = |transaction: u8, function: u8| [0, transaction, 0, 0, 0, 6, 1, function, 0x03, 0xEA, 0, 1];
        let segment =
            [&read(1, 3)[..], &[0, 2, 0, 0, 0, 6, 0, 6, 0x03, 0xEA, 0, 9], &read(3, 1), &read(4, 3)[..7]].concat();
        let answered = [&[0, 1, 0, 0, 0, 5, 1, 3, 2, 0x02, 0xBC][..], &[0, 3, 0, 0, 0, 3, 1, 0x81, 1]].concat();
        assert_reply(&mut client, &segment, &answered).await;
        assert_reply(&mut client, &read(4, 3)[7..], &[0, 4, 0, 0, 0, 5, 1, 3, 2, 0x02, 0xBC]).await;
        // A length that no frame has.
        client.write_all(&[0, 5, 0, 0, 1, 0, 1]).await.expect("the server takes bytes");
        assert!(ends(&mut client).await);
    }

    #[tokio::test]
    async fn a_client_too_many_is_turned_away() {
        let address = serve(TcpFraming::Mbap).await;
        let mut clients = Vec::new();
        for transaction in 0..CLIENTS_MAX as u8 {
            let mut client = TcpStream::connect(address).await.expect("the server accepts");
            let read = [0, transaction, 0, 0, 0, 6, 1, 3, 0x03, 0xEA, 0, 1];
            assert_reply(&mut client, &read, &[0, transaction, 0, 0, 0, 5, 1, 3, 2, 0x02, 0xBC]).await;
            clients.push(client);
        }
        assert!(ends(&mut TcpStream::connect(address).await.expect("the system accepts")).await);
    }

    #[tokio::test]
    async fn the_frames_of_a_serial_line_pass_over_tcp() {
        let rtu = TcpFraming::Line(Wire { serial: Serial::USUAL, ascii: false });
        let mut client = TcpStream::connect(serve(rtu).await).await.expect("the server accepts");
        assert_reply(&mut client, &with_crc(&[1, 6, 0x03, 0xEA, 0, 50]), &with_crc(&[1, 6, 0x03, 0xEA, 0, 50])).await;
        assert_reply(&mut client, &with_crc(&[1, 3, 0x03, 0xEA, 0, 1]), &with_crc(&[1, 3, 2, 0, 50])).await;
        assert_reply(&mut client, &with_crc(&[2, 6, 0x03, 0xEA, 0, 9, 9]), &with_crc(&[2, 0x86, 3])).await;
    }
}
