//! Datagrams as a stream of bytes: each holds one frame, there and back.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, Ipv6Addr},
    pin::Pin,
    task::{Context, Poll, ready},
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{UdpSocket, lookup_host},
};

use crate::plant::{def::Framing, line_trouble::LineTrouble};

/// Bytes of an MBAP header before what its length counts.
const MBAP_HEAD: usize = 6;

/// A host that takes datagrams. Others that send some are not heard.
#[derive(Debug)]
pub struct Datagrams {
    socket: UdpSocket,
    framing: Framing,
}

impl Datagrams {
    /// A socket for a host. Whether anyone is there shows with the first request.
    pub async fn open(host: &str, port: u16, framing: Framing) -> Result<Datagrams, LineTrouble> {
        let socket = async {
            let address = lookup_host((host, port)).await?.next().ok_or(io::ErrorKind::NotFound)?;
            let any: IpAddr =
                if address.is_ipv4() { Ipv4Addr::UNSPECIFIED.into() } else { Ipv6Addr::UNSPECIFIED.into() };
            let socket = UdpSocket::bind((any, 0)).await?;
            socket.connect(address).await?;
            Ok::<UdpSocket, io::Error>(socket)
        };
        let socket = socket.await.map_err(|error| LineTrouble::System(format!("{host}:{port}: {error}")))?;
        Ok(Datagrams { socket, framing })
    }

    /// Bytes of the first frame: a datagram holds no two.
    fn first(&self, bytes: &[u8]) -> usize {
        match (self.framing, bytes) {
            (Framing::Mbap, [_, _, _, _, high, low, ..]) => {
                bytes.len().min(MBAP_HEAD + usize::from(u16::from_be_bytes([*high, *low])))
            }
            (Framing::Mbap | Framing::Rtu | Framing::Ascii, _) => bytes.len(),
        }
    }
}

/// Was an earlier datagram refused, because the device takes none now? Then it has no answer, and the next one may have.
fn is_refused<T>(ended: &io::Result<T>) -> bool {
    ended.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::ConnectionRefused)
}

impl AsyncRead for Datagrams {
    /// One datagram; of one that is longer than the room for it the rest is lost.
    fn poll_read(self: Pin<&mut Self>, cx: &mut Context, buffer: &mut ReadBuf) -> Poll<io::Result<()>> {
        // An empty one is no end.
        let before = buffer.filled().len();
        while buffer.filled().len() == before {
            let received = ready!(self.socket.poll_recv(cx, buffer));
            if !is_refused(&received) {
                received?;
            }
        }
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Datagrams {
    fn poll_write(self: Pin<&mut Self>, cx: &mut Context, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let frame = &bytes[..self.first(bytes)];
        let sent = ready!(self.socket.poll_send(cx, frame));
        // What was refused is the one before; this one was not sent.
        if is_refused(&sent) { self.socket.poll_send(cx, frame) } else { Poll::Ready(sent) }
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    const DATAGRAM_MAX: usize = 300;

    #[tokio::test]
    async fn each_frame_is_a_datagram_and_an_empty_one_no_end() {
        let device = UdpSocket::bind("127.0.0.1:0").await.unwrap();
        let mut datagrams =
            Datagrams::open("127.0.0.1", device.local_addr().unwrap().port(), Framing::Mbap).await.unwrap();
        let frame = |id: u8| [0, id, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1];
        datagrams.write_all(&[frame(1), frame(2)].concat()).await.unwrap();
        let mut bytes = [0; DATAGRAM_MAX];
        for id in [1, 2] {
            let (count, from) = device.recv_from(&mut bytes).await.unwrap();
            assert_eq!(bytes[..count], frame(id));
            device.send_to(&[], from).await.unwrap();
            device.send_to(&[id; 9], from).await.unwrap();
        }
        for id in [1, 2] {
            assert_eq!(datagrams.read(&mut bytes).await.unwrap(), 9);
            assert_eq!(bytes[..9], [id; 9]);
        }
    }

    #[tokio::test]
    async fn a_device_that_was_off_is_asked_again() {
        let device = UdpSocket::bind("127.0.0.1:0").await.unwrap();
        let address = device.local_addr().unwrap();
        drop(device);
        let mut datagrams = Datagrams::open("127.0.0.1", address.port(), Framing::Rtu).await.unwrap();
        datagrams.write_all(b"nobody").await.unwrap();
        let device = UdpSocket::bind(address).await.unwrap();
        // The refusal of the first one lies in wait for the next call.
        datagrams.write_all(b"request").await.unwrap();
        let mut bytes = [0; DATAGRAM_MAX];
        let (count, from) = device.recv_from(&mut bytes).await.unwrap();
        assert_eq!(&bytes[..count], b"request");
        device.send_to(b"answer", from).await.unwrap();
        let mut answer = [0; 6];
        datagrams.read_exact(&mut answer).await.unwrap();
        assert_eq!(&answer, b"answer");
    }
}
