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

use crate::plant::def::Framing;

/// More than the longest frame, an ASCII one.
const DATAGRAM_MAX: usize = 1_024;
/// Bytes of an MBAP header before what its length counts.
const MBAP_HEAD: usize = 6;

/// A host that takes datagrams. Others that send some are not heard.
#[derive(Debug)]
pub struct Datagrams {
    socket: UdpSocket,
    framing: Framing,
    /// What has come and was not read yet.
    left: Vec<u8>,
}

impl Datagrams {
    /// A socket for a host; the error is in words for an operator. Whether anyone is there shows with the first request.
    pub async fn open(host: &str, port: u16, framing: Framing) -> Result<Datagrams, String> {
        let socket = async {
            let address = lookup_host((host, port)).await?.next().ok_or(io::ErrorKind::NotFound)?;
            let any: IpAddr =
                if address.is_ipv4() { Ipv4Addr::UNSPECIFIED.into() } else { Ipv6Addr::UNSPECIFIED.into() };
            let socket = UdpSocket::bind((any, 0)).await?;
            socket.connect(address).await?;
            Ok::<UdpSocket, io::Error>(socket)
        };
        let socket = socket.await.map_err(|error| format!("{host}:{port}: {error}"))?;
        Ok(Datagrams { socket, framing, left: Vec::new() })
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

impl AsyncRead for Datagrams {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context, buffer: &mut ReadBuf) -> Poll<io::Result<()>> {
        // An empty one is no end.
        while self.left.is_empty() {
            let mut bytes = [0; DATAGRAM_MAX];
            let mut datagram = ReadBuf::new(&mut bytes);
            ready!(self.socket.poll_recv(cx, &mut datagram))?;
            self.left.extend(datagram.filled());
        }
        let count = self.left.len().min(buffer.remaining());
        buffer.put_slice(&self.left[..count]);
        self.left.drain(..count);
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Datagrams {
    fn poll_write(self: Pin<&mut Self>, cx: &mut Context, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.socket.poll_send(cx, &bytes[..self.first(bytes)])
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}
