//! Serves the rig over Modbus TCP to several clients at once.

use std::io;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::RigHandle;

/// Clients at once; one more is turned away by closing its connection.
const CLIENTS_MAX: usize = 16;
/// A client that asks nothing for this long is taken for dead.
const IDLE_MAX: Duration = Duration::from_secs(600);
/// Unit and PDU, as the header counts them (Modbus messaging on TCP/IP V1.0b, 3.1.3).
const LENGTHS: std::ops::RangeInclusive<u16> = 2..=254;

/// Serves until the listener fails. Clients are cut off when this future is dropped.
pub async fn serve_tcp(listener: TcpListener, rig: RigHandle) -> io::Result<()> {
    let mut clients = JoinSet::new();
    loop {
        tokio::select! {
            accepted = listener.accept() => match accepted {
                Ok((stream, _)) if clients.len() < CLIENTS_MAX => {
                    // Without this small answers wait for the client's acknowledgement; if it fails they are just slower.
                    stream.set_nodelay(true).ok();
                    clients.spawn(serve_client(stream, rig.clone()));
                }
                Ok(_turned_away) => {}
                Err(error) if error.kind() == io::ErrorKind::ConnectionAborted => {}
                Err(error) => return Err(error),
            },
            Some(_ended) = clients.join_next() => {}
        }
    }
}

/// Serves one client in the order of its requests until it leaves, falls silent or breaks the protocol.
async fn serve_client<S: AsyncRead + AsyncWrite + Unpin>(mut stream: S, rig: RigHandle) -> io::Result<()> {
    while let Some((transaction, unit, pdu)) = timeout(IDLE_MAX, receive(&mut stream)).await?? {
        if let Some(answer) = rig.ask(unit, &pdu).await {
            rig.clock().sleep(answer.delay).await;
            timeout(IDLE_MAX, stream.write_all(&answer.tcp(transaction))).await??;
        }
    }
    Ok(())
}

/// One request as transaction, unit and PDU; `None` when the header is not Modbus, as the place in the stream is lost.
async fn receive<S: AsyncRead + Unpin>(stream: &mut S) -> io::Result<Option<(u16, u8, Vec<u8>)>> {
    let mut header = [0; 7];
    stream.read_exact(&mut header).await?;
    let [t0, t1, p0, p1, l0, l1, unit] = header;
    let length = u16::from_be_bytes([l0, l1]);
    if (p0, p1) != (0, 0) || !LENGTHS.contains(&length) {
        return Ok(None);
    }
    let mut pdu = vec![0; usize::from(length) - 1];
    stream.read_exact(&mut pdu).await?;
    Ok(Some((u16::from_be_bytes([t0, t1]), unit, pdu)))
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;
    use tokio::net::TcpStream;

    use super::*;
    use crate::bus::io::clock::Clock;
    use crate::sim::rig::Rig;

    async fn exchange(client: &mut TcpStream, request: &[u8], expect: &[u8]) {
        client.write_all(request).await.expect("the server takes requests");
        let mut reply = vec![0; expect.len()];
        let read = timeout(Duration::from_secs(5), client.read_exact(&mut reply)).await;
        read.expect("an answer within five seconds").expect("the connection holds");
        assert_eq!(reply, expect);
    }

    #[tokio::test]
    async fn several_clients_share_one_rig() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port is free");
        let address = listener.local_addr().expect("a bound listener has an address");
        let rig = RigHandle::spawn(Rig::new(), Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0));
        tokio::spawn(serve_tcp(listener, rig));
        let connect = || async { TcpStream::connect(address).await.expect("the server accepts") };
        let (mut one, mut two) = (connect().await, connect().await);
        let write = [0, 7, 0, 0, 0, 6, 1, 6, 0x03, 0xEA, 0x01, 0xF4];
        exchange(&mut one, &write, &write).await;
        let read = [0, 8, 0, 0, 0, 6, 1, 3, 0x03, 0xEA, 0, 1];
        exchange(&mut two, &read, &[0, 8, 0, 0, 0, 5, 1, 3, 2, 0x01, 0xF4]).await;
        // A request that is not Modbus ends its own connection and no other.
        one.write_all(b"GET / HTTP/1.1\r\n").await.expect("the server takes bytes");
        let ended = timeout(Duration::from_secs(5), one.read(&mut [0; 1])).await.expect("the connection ends");
        assert!(matches!(ended, Ok(0) | Err(_)));
        exchange(&mut two, &read, &[0, 8, 0, 0, 0, 5, 1, 3, 2, 0x01, 0xF4]).await;
    }
}
