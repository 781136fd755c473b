//! The terminal's end of the socket: a session like that of the same process, which outlives its station.

use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use tokio::{
    net::{
        UnixStream,
        unix::{OwnedReadHalf, OwnedWriteHalf},
    },
    sync::{mpsc, watch},
    time::timeout,
};

use super::{
    client_task::ClientTask,
    wire::{self, WireError},
};
use crate::{
    access::SessionStatus,
    attach::{
        assembly::{Assembly, OtherPlant},
        command_id_map::CommandIdMap,
        protocol::{
            self, HANDSHAKE_BYTES_MAX, Handshake, HandshakeReply, SERVER_MESSAGE_BYTES_MAX, ServerMessage,
            TerminalOrigin,
        },
    },
    station::Session,
};

/// The station answers a handshake within this time, or is taken for stuck.
pub const HANDSHAKE_REPLY_MAX: Duration = Duration::from_secs(5);
/// Requests that may wait for the socket; more are refused.
pub const REQUESTS: usize = 32;

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// No process listens there.
    #[error("no station at {}: {error}", .path.display())]
    NoStation {
        /// Where.
        path: PathBuf,
        /// In the words of the system.
        error: io::Error,
    },
    /// The station sends this terminal away.
    #[error("{0}")]
    Refused(String),
    /// It listens, but says nothing.
    #[error("no reply from the station for {} s", HANDSHAKE_REPLY_MAX.as_secs())]
    Silent,
    /// Its first message is no handshake reply, or it has closed.
    #[error("malformed message from the station: {0}")]
    Wire(#[from] WireError),
    /// What it says first does not fit together.
    #[error("malformed message from the station: {0}")]
    OtherPlant(#[from] OtherPlant),
}

/// A connection that the station has accepted.
pub(super) struct Connection {
    pub read: OwnedReadHalf,
    pub write: OwnedWriteHalf,
    pub reply: HandshakeReply,
}

/// Attaches to the station that listens at this path. The session feeds itself from now on: when the station goes, the
/// status says so at once, and it is sought again for as long as a handle of the session exists.
pub async fn connect(path: &Path) -> Result<Session, AttachError> {
    let origin = here();
    let begun = match begin(path, &origin).await {
        // A station that reloads its plant file closes what has begun with the plant as it was.
        Err(AttachError::Wire(WireError::Closed)) => begin(path, &origin).await,
        begun => begun,
    };
    let (connection, status, assembly) = begun?;
    let HandshakeReply { run, terminal, .. } = connection.reply;
    let (publish, snapshots) = watch::channel(assembly.latest().clone());
    let (status_sender, status) = watch::channel(Arc::new(status));
    let (requests, requested) = mpsc::channel(REQUESTS);
    let id_map = CommandIdMap::new(run, terminal);
    tokio::spawn(
        ClientTask::new(path.to_owned(), origin, id_map, assembly, publish, status_sender).run(connection, requested),
    );
    Ok(Session { snapshots, status, requests, terminal })
}

/// Opens a connection and waits for what it begins with.
async fn begin(path: &Path, origin: &TerminalOrigin) -> Result<(Connection, SessionStatus, Assembly), AttachError> {
    let mut connection = open(path, origin).await?;
    let (status, assembly) =
        timeout(HANDSHAKE_REPLY_MAX, first(&mut connection)).await.unwrap_or(Err(AttachError::Silent))?;
    Ok((connection, status, assembly))
}

/// Sends the handshake and waits for the reply.
pub(super) async fn open(path: &Path, origin: &TerminalOrigin) -> Result<Connection, AttachError> {
    let no_station = |error| AttachError::NoStation { path: path.to_owned(), error };
    let opened = async {
        let (mut read, mut write) = UnixStream::connect(path).await.map_err(no_station)?.into_split();
        let handshake = protocol::encode(&(Handshake::current(), origin), HANDSHAKE_BYTES_MAX);
        wire::write(&mut write, &handshake.map_err(WireError::from)?).await?;
        let bytes = wire::read(&mut read, SERVER_MESSAGE_BYTES_MAX).await?;
        let reply = protocol::handshake_reply(&bytes).map_err(WireError::from)?.map_err(AttachError::Refused)?;
        Ok(Connection { read, write, reply })
    };
    timeout(HANDSHAKE_REPLY_MAX, opened).await.unwrap_or(Err(AttachError::Silent))
}

/// The session status and the snapshot with which a session begins.
async fn first(connection: &mut Connection) -> Result<(SessionStatus, Assembly), AttachError> {
    let (mut status, mut assembly) = (SessionStatus::default(), Assembly::new(connection.reply.def.clone()));
    loop {
        match next(&mut connection.read).await? {
            ServerMessage::SessionStatus(latest) => status = *latest,
            ServerMessage::LineReport(line, report) => assembly.on_report(line, report)?,
            ServerMessage::Snapshot(snapshot) => {
                assembly.on_snapshot(Arc::unwrap_or_clone(snapshot))?;
                return Ok((status, assembly));
            }
            // Nothing was asked yet.
            ServerMessage::Answer { .. } | ServerMessage::RequestDone { .. } | ServerMessage::Undelivered { .. } => {}
        }
    }
}

/// The next message of the station.
pub(super) async fn next(read: &mut OwnedReadHalf) -> Result<ServerMessage, WireError> {
    let bytes = wire::read(read, SERVER_MESSAGE_BYTES_MAX).await?;
    Ok(protocol::decode(&bytes, "message of a station")?)
}

/// Where this terminal is.
fn here() -> TerminalOrigin {
    let tty = rustix::termios::ttyname(io::stdin(), Vec::new()).ok();
    let tty = tty.map(|name| name.to_string_lossy().trim_start_matches("/dev/").to_owned());
    let variable = |name: &str| std::env::var(name).ok();
    let ssh = variable("SSH_CONNECTION").and_then(|words| words.split(' ').next().map(str::to_owned));
    TerminalOrigin { tty, ssh, term: variable("TERM") }.short()
}
