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
    time::{Instant, sleep, timeout},
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
            self, HANDSHAKE_BYTES_MAX, Handshake, HandshakeReply, SERVER_MESSAGE_BYTES_MAX, ServerMessage, TRY_AGAIN,
            TerminalOrigin,
        },
    },
    station::Session,
};

/// The station answers a handshake within this time, or is taken for stuck.
pub const HANDSHAKE_REPLY_MAX: Duration = Duration::from_secs(5);
/// A station that takes no more connections at the moment is tried again for so long.
const BUSY_MAX: Duration = Duration::from_secs(8);
/// First pause before that; doubled each time.
const AGAIN_MIN: Duration = Duration::from_millis(20);
/// Longest pause.
const AGAIN_MAX: Duration = Duration::from_millis(500);
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
    /// Too many connect at once: the system or the station takes no more.
    #[error("the station at {} takes no more connections at the moment, too many are made at once{}", .0.display(), TRY_AGAIN)]
    Busy(PathBuf),
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

impl AttachError {
    /// May the next try find it otherwise? A station that reloads its plant file closes what has begun with the plant as it was.
    fn is_passing(&self) -> bool {
        match self {
            AttachError::Busy(_) | AttachError::Wire(WireError::Closed) => true,
            AttachError::Refused(why) => why.ends_with(TRY_AGAIN),
            AttachError::NoStation { .. } | AttachError::Silent | AttachError::Wire(_) | AttachError::OtherPlant(_) => {
                false
            }
        }
    }
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
    let (connection, status, assembly) = patiently(path, async || begin(path, &origin).await).await?;
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

/// Tries until the station does not turn this terminal away for the moment only.
async fn patiently<T>(path: &Path, mut begin: impl AsyncFnMut() -> Result<T, AttachError>) -> Result<T, AttachError> {
    let (until, mut pause) = (Instant::now() + BUSY_MAX, AGAIN_MIN);
    loop {
        match begin().await {
            Err(why) if why.is_passing() && Instant::now() + pause < until => sleep(pause).await,
            Err(AttachError::Wire(WireError::Closed)) => return Err(AttachError::Busy(path.to_owned())),
            begun => return begun,
        }
        pause = (2 * pause).min(AGAIN_MAX);
    }
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
    let no_station = |error: io::Error| match error.kind() {
        // Its queue of connections is full.
        io::ErrorKind::WouldBlock => AttachError::Busy(path.to_owned()),
        _ => AttachError::NoStation { path: path.to_owned(), error },
    };
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

#[cfg(test)]
mod tests {
    use super::*;

    /// How often it is tried, and what comes of it, if each try ends so and the one after them succeeds.
    async fn tried(ends: usize, end: fn() -> AttachError) -> (usize, Result<(), String>) {
        let mut tries = 0;
        let begin = async || {
            tries += 1;
            if ends < tries { Ok(()) } else { Err(end()) }
        };
        let begun = patiently(Path::new("/run/tank.sock"), begin).await;
        (tries, begun.map_err(|error| error.to_string()))
    }

    #[tokio::test(start_paused = true)]
    async fn a_terminal_turned_away_for_a_moment_tries_again() {
        let busy = || AttachError::Busy("/run/tank.sock".into());
        let closed = || AttachError::Wire(WireError::Closed);
        let crowd = || AttachError::Refused(format!("too many terminals attach at once{TRY_AGAIN}"));
        for end in [busy, closed, crowd] as [fn() -> AttachError; 3] {
            assert_eq!(tried(5, end).await, (6, Ok(())));
            let (tries, why) = tried(1_000, end).await;
            assert!((10..40).contains(&tries), "{tries}");
            let why = why.expect_err("it is busy for too long");
            assert!(why.contains("too many") && why.ends_with(TRY_AGAIN), "{why}");
        }
        let limit = || AttachError::Refused("this user has 32 terminals, no more can attach".into());
        assert_eq!(tried(9, limit).await.0, 1, "it would be the same");
        assert_eq!(tried(9, || AttachError::Silent).await.0, 1);
    }
}
