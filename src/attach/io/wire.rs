//! Whole messages out of a stream and into it, none longer than agreed, none half for long.

use std::{io, time::Duration};

use tokio::{
    io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt},
    time::timeout,
};

use crate::attach::protocol::{self, LENGTH_BYTES, ProtocolError};

/// A message that has begun must be whole after so long.
const MESSAGE_MAX: Duration = Duration::from_secs(10);
/// Memory is taken as bytes come, not as they are announced.
const PIECE_BYTES: usize = 64 * 1024;

/// Why no more messages come or go.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// The other end has closed.
    #[error("closed by the other end")]
    Closed,
    /// A message had begun and did not end.
    #[error("incomplete message, then nothing for {} s", MESSAGE_MAX.as_secs())]
    Half,
    /// What came is no message.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The system says no.
    #[error("{0}")]
    Io(io::Error),
}

impl From<io::Error> for WireError {
    fn from(error: io::Error) -> WireError {
        match error.kind() {
            io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset | io::ErrorKind::BrokenPipe => {
                WireError::Closed
            }
            _ => WireError::Io(error),
        }
    }
}

/// The bytes of the next message, without their length. Waits for ever for its first byte.
pub async fn read(from: &mut (impl AsyncRead + Unpin), bytes_max: usize) -> Result<Vec<u8>, WireError> {
    let mut length = [0; LENGTH_BYTES];
    from.read_exact(&mut length[..1]).await?;
    timeout(MESSAGE_MAX, rest(from, length, bytes_max)).await.unwrap_or(Err(WireError::Half))
}

async fn rest(
    from: &mut (impl AsyncRead + Unpin),
    mut length: [u8; LENGTH_BYTES],
    bytes_max: usize,
) -> Result<Vec<u8>, WireError> {
    from.read_exact(&mut length[1..]).await?;
    let length = protocol::length(length, bytes_max)?;
    let mut bytes = Vec::new();
    while bytes.len() < length {
        let begun = bytes.len();
        bytes.resize(length.min(begun + PIECE_BYTES), 0);
        from.read_exact(&mut bytes[begun..]).await?;
    }
    Ok(bytes)
}

/// Sends a message that has its length before it. Waits for as long as the other end does not read.
pub async fn write(to: &mut (impl AsyncWrite + Unpin), message: &[u8]) -> Result<(), WireError> {
    to.write_all(message).await?;
    Ok(to.flush().await?)
}
