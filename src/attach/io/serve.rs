//! The listener: one socket a station, so many terminals and no more, and no patience with whoever does not say hello.

use std::{
    collections::VecDeque,
    fs::{File, OpenOptions, Permissions},
    io,
    os::unix::fs::{OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
    time::Duration,
};

use jiff::Timestamp;
use rustix::fs::{FlockOperation, flock};
use tokio::{
    net::{
        UnixListener, UnixStream,
        unix::{OwnedReadHalf, OwnedWriteHalf},
    },
    task::{AbortHandle, JoinSet},
    time::timeout,
};

use super::{
    seat,
    wire::{self, WireError},
};
use crate::{
    access::Peer,
    attach::protocol::{self, Greeting, HELLO_BYTES_MAX, Place, ProtocolError},
    station::Entrance,
};

/// Terminals at once.
pub const TERMINALS_MAX: usize = 64;
/// Connections that have not said hello; one more, and the oldest of them is dropped.
pub const STRANGERS_MAX: usize = 8;
/// A connection says hello within this time.
pub const HELLO_MAX: Duration = Duration::from_secs(2);
/// Pause after the system had no connection to give.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Why a station cannot listen.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// Another station of this plant is there.
    #[error("the station is already running{}", .process.map(|n| format!(", process {n}")).unwrap_or_default())]
    Running {
        /// Its process, if the system tells.
        process: Option<i32>,
    },
    /// The system says no.
    #[error("{}: {error}", .path.display())]
    Io {
        /// Of what.
        path: PathBuf,
        /// In its words.
        error: io::Error,
    },
}

/// A socket that terminals find. It goes when this is dropped.
#[derive(Debug)]
pub struct Listener {
    socket: UnixListener,
    path: PathBuf,
    /// Held for as long as this station lives; the system lets go of it however the station ends.
    _lock: File,
}

/// Listens at this path, whose folder is there. What a dead station has left is replaced.
pub fn listen(path: &Path) -> Result<Listener, ListenError> {
    let told = |path: &Path| {
        let path = path.to_owned();
        move |error| ListenError::Io { path, error }
    };
    let beside = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        PathBuf::from(name)
    };
    let lock = beside(".lock");
    let file =
        OpenOptions::new().create(true).truncate(false).write(true).mode(0o600).open(&lock).map_err(told(&lock))?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => {}
        Err(rustix::io::Errno::WOULDBLOCK) => return Err(ListenError::Running { process: process_at(path) }),
        Err(error) => return Err(told(&lock)(error.into())),
    }
    // Under another name until its rights are set, then in place of whatever was there: never too open, never absent.
    let new = beside(".new");
    match std::fs::remove_file(&new) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(told(&new)(error)),
        Ok(()) | Err(_) => {}
    }
    let socket = UnixListener::bind(&new).map_err(told(&new))?;
    std::fs::set_permissions(&new, Permissions::from_mode(0o660)).map_err(told(&new))?;
    std::fs::rename(&new, path).map_err(told(path))?;
    Ok(Listener { socket, path: path.to_owned(), _lock: file })
}

/// The process that listens there.
fn process_at(path: &Path) -> Option<i32> {
    let stream = std::os::unix::net::UnixStream::connect(path).ok()?;
    let credentials = rustix::net::sockopt::socket_peercred(&stream).ok()?;
    Some(credentials.pid.as_raw_nonzero().get())
}

impl Drop for Listener {
    fn drop(&mut self) {
        // The lock is still held, so this is no other station's socket.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A connection that has said hello.
struct Guest {
    read: OwnedReadHalf,
    write: OwnedWriteHalf,
    peer: Peer,
}

impl Listener {
    /// Where it listens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Lets terminals in until the station behind this entrance has ended. Can be called again with another station.
    pub async fn serve(&self, entrance: &Entrance) {
        // A number that another run does not have: terminals are counted anew in each.
        let run = Timestamp::now().as_microsecond() as u64;
        let mut snapshots = entrance.snapshots.clone();
        let mut strangers: JoinSet<Option<Guest>> = JoinSet::new();
        let mut oldest: VecDeque<AbortHandle> = VecDeque::new();
        let mut seats: JoinSet<()> = JoinSet::new();
        loop {
            tokio::select! {
                biased;
                ended = snapshots.changed() => if ended.is_err() { break },
                Some(guest) = strangers.join_next() => {
                    if let Ok(Some(guest)) = guest {
                        seat_guest(&mut seats, guest, entrance, run);
                    }
                }
                Some(_) = seats.join_next() => {}
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, _)) => {
                        oldest.retain(|stranger| !stranger.is_finished());
                        if STRANGERS_MAX <= oldest.len() && let Some(stranger) = oldest.pop_front() {
                            tracing::debug!("too many connections without a hello: the oldest is dropped");
                            stranger.abort();
                        }
                        oldest.push_back(strangers.spawn(greet(stream)));
                    }
                    Err(error) => {
                        tracing::error!(%error, "no connection could be taken");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                },
            }
        }
    }
}

fn seat_guest(seats: &mut JoinSet<()>, guest: Guest, entrance: &Entrance, run: u64) {
    let Guest { read, write, peer } = guest;
    if TERMINALS_MAX <= seats.len() {
        tracing::warn!(from = %peer.from, "too many terminals, one was sent away");
        let why = format!("the station has {TERMINALS_MAX} terminals, no more can attach");
        // It has been told nothing yet, so the system has room for one line.
        let _ = write.try_write(&sorry(why));
        return;
    }
    let from = peer.from.clone();
    let session = entrance.attach(peer);
    let terminal = session.terminal;
    tracing::info!(terminal, %from, "a terminal has attached");
    seats.spawn(async move {
        let ended = seat::serve(read, write, session, run).await;
        tracing::info!(terminal, %from, why = %ended, "a terminal has gone");
    });
}

/// Waits for the hello of a connection; `None` if it has none that will do.
async fn greet(stream: UnixStream) -> Option<Guest> {
    let credentials = stream.peer_cred().ok()?;
    let (mut read, write) = stream.into_split();
    let place = match timeout(HELLO_MAX, hello(&mut read)).await {
        Ok(Ok(place)) => place,
        Ok(Err(WireError::Closed)) => return None,
        Ok(Err(error)) => {
            tracing::warn!(%error, process = ?credentials.pid(), "a connection without a right hello");
            if let WireError::Protocol(ProtocolError::OtherVersion(why)) = error {
                // It has been told nothing yet, so the system has room for one line.
                let _ = write.try_write(&sorry(why));
            }
            return None;
        }
        Err(_) => return None,
    };
    let uid = credentials.uid();
    // The list of users may be on another machine.
    let user = tokio::task::spawn_blocking(move || uzers::get_user_by_uid(uid)).await.ok().flatten();
    let user = user.map(|user| user.name().to_string_lossy().into_owned());
    let process = credentials.pid().and_then(|process| u32::try_from(process).ok());
    let from = place.words(user.as_deref(), process).into();
    Some(Guest { read, write, peer: Peer { from, unix_user: user.map(Into::into), own: false } })
}

async fn hello(read: &mut OwnedReadHalf) -> Result<Place, WireError> {
    Ok(protocol::hello(&wire::read(read, HELLO_BYTES_MAX).await?)?)
}

fn sorry(why: String) -> Vec<u8> {
    protocol::encode_first(&Greeting::sorry(why), None::<&()>, HELLO_BYTES_MAX).expect("one line is short")
}
