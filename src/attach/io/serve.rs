//! The listener: one socket a station, made again when it is removed. Connections without a handshake are dropped.

use std::{
    fs::{DirBuilder, File, OpenOptions, Permissions},
    io,
    os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
    time::Duration,
};

use rustix::fs::{FlockOperation, flock};
use tokio::{
    net::{
        UnixListener, UnixStream,
        unix::{OwnedReadHalf, OwnedWriteHalf, UCred},
    },
    task::{AbortHandle, JoinSet},
    time::{Instant, MissedTickBehavior, interval, timeout},
};

use super::{
    connection,
    shared::{SnapshotReceiver, SnapshotSender},
    wire::{self, WireError},
};
use crate::{
    access::Peer,
    attach::{
        callers::{Callers, makes_room},
        protocol::{self, HANDSHAKE_BYTES_MAX, Handshake, ProtocolError, TRY_AGAIN, TerminalOrigin},
    },
    bus::io::worker::spawn_blocking,
    profile::io::atomic::with_suffix,
    station::SessionAcceptor,
};

/// A connection completes its handshake within this time.
pub const HANDSHAKE_MAX: Duration = Duration::from_secs(2);
/// Pause after the system had no connection to give.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// How often the listener checks that its socket is still there.
const CHECK_EVERY: Duration = Duration::from_secs(2);

/// Why a station cannot listen.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// Another station of this plant is there.
    #[error("the station is already running{}", .process.map(|n| format!(", process {n}")).unwrap_or_default())]
    Running {
        /// Its process, if known.
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
    lock: File,
    /// Identifies the file of the socket: another one may be at its place.
    file: Option<(u64, u64)>,
    folder: Folder,
    /// It could not be made again, and that is logged.
    troubled: bool,
}

/// The folder of a socket: its owner, and its rights.
#[derive(Debug, Clone, Copy)]
struct Folder {
    owner: u32,
    mode: u32,
}

impl Folder {
    fn of(socket: &Path) -> Result<Folder, ListenError> {
        let folder = parent(socket);
        let about = std::fs::metadata(folder).map_err(failed(folder))?;
        Ok(Folder { owner: about.uid(), mode: about.mode() & 0o7777 })
    }

    /// Makes it again if it was removed. A folder of another user at its place is not used.
    fn restore(self, socket: &Path) -> Result<(), ListenError> {
        let folder = parent(socket);
        match DirBuilder::new().mode(0o700).create(folder) {
            // Set afterwards: the umask takes rights from what `create` is given.
            Ok(()) => std::fs::set_permissions(folder, Permissions::from_mode(self.mode)).map_err(failed(folder))?,
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(failed(folder)(error)),
        }
        match Folder::of(socket)? {
            found if found.owner == self.owner => Ok(()),
            _ => Err(failed(folder)(io::Error::new(io::ErrorKind::PermissionDenied, "now belongs to another user"))),
        }
    }
}

fn parent(socket: &Path) -> &Path {
    socket.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Listens at this path, whose folder is there. What a dead station has left is replaced.
pub fn listen(path: &Path) -> Result<Listener, ListenError> {
    let folder = Folder::of(path)?;
    let lock = lock(path)?;
    let socket = bind(path)?;
    Ok(Listener { socket, path: path.to_owned(), lock, file: file_at(path), folder, troubled: false })
}

fn lock(path: &Path) -> Result<File, ListenError> {
    let lock = with_suffix(path, ".lock");
    let file =
        OpenOptions::new().create(true).truncate(false).write(true).mode(0o600).open(&lock).map_err(failed(&lock))?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(file),
        Err(rustix::io::Errno::WOULDBLOCK) => Err(ListenError::Running { process: process_at(path) }),
        Err(error) => Err(failed(&lock)(error.into())),
    }
}

/// Under another name until its rights are set, then in place of whatever was there: never too open, never absent.
fn bind(path: &Path) -> Result<UnixListener, ListenError> {
    let new = with_suffix(path, ".new");
    match std::fs::remove_file(&new) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(&new)(error)),
        Ok(()) | Err(_) => {}
    }
    let socket = UnixListener::bind(&new).map_err(failed(&new))?;
    std::fs::set_permissions(&new, Permissions::from_mode(0o660)).map_err(failed(&new))?;
    std::fs::rename(&new, path).map_err(failed(path))?;
    Ok(socket)
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> ListenError + use<> {
    let path = path.to_owned();
    move |error| ListenError::Io { path, error }
}

fn is_at(file: &File, path: &Path) -> bool {
    file.metadata().is_ok_and(|about| file_at(path) == Some((about.dev(), about.ino())))
}

/// Device and number of the file there.
fn file_at(path: &Path) -> Option<(u64, u64)> {
    let about = std::fs::symlink_metadata(path).ok()?;
    Some((about.dev(), about.ino()))
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

/// A connection that has completed the handshake.
struct Handshaken {
    read: OwnedReadHalf,
    write: OwnedWriteHalf,
    peer: Peer,
}

/// How the handshake of a connection ended.
struct HandshakeEnd {
    user: u32,
    /// `Err` for one that said something else; `None` for one that has said nothing.
    handshaken: Option<Result<Handshaken, WireError>>,
}

/// A terminal that has gone.
struct Left {
    user: u32,
    counted_as: u32,
    terminal: u32,
    from: std::sync::Arc<str>,
    why: connection::ConnectionEnd,
}

/// All connections to one run of the station.
struct Connections<'a> {
    acceptor: &'a SessionAcceptor,
    snapshots: SnapshotReceiver,
    began: Instant,
    callers: Callers,
    handshaking: JoinSet<HandshakeEnd>,
    /// Those that have not completed the handshake, the oldest first.
    waiting: Vec<(u32, AbortHandle)>,
    serving: JoinSet<Left>,
}

impl Listener {
    /// Lets terminals in until the station behind this acceptor has ended. Can be called again with another station.
    pub async fn serve(&mut self, acceptor: &SessionAcceptor) {
        let mut snapshots = acceptor.snapshots.clone();
        let (sender, receiver) = SnapshotSender::new(snapshots.borrow_and_update().clone());
        let mut check = interval(CHECK_EVERY);
        check.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut connections = Connections {
            acceptor,
            snapshots: receiver,
            began: Instant::now(),
            callers: Callers::new(rustix::process::getuid().as_raw()),
            handshaking: JoinSet::new(),
            waiting: Vec::new(),
            serving: JoinSet::new(),
        };
        loop {
            tokio::select! {
                biased;
                changed = snapshots.changed() => match changed {
                    Ok(()) => sender.publish(snapshots.borrow_and_update().clone()),
                    Err(_) => break,
                },
                Some(ended) = connections.handshaking.join_next() => if let Ok(ended) = ended { connections.on_handshake_end(ended) },
                Some(left) = connections.serving.join_next() => if let Ok(left) = left { connections.on_left(left) },
                _ = check.tick() => {
                    self.repair_socket();
                    connections.log_left_out();
                }
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, _)) => connections.on_connection(stream),
                    Err(error) => {
                        tracing::error!(%error, "a connection could not be accepted");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                },
            }
        }
    }

    /// Makes the socket, its lock and their folder again if they were removed. Attached terminals stay attached.
    fn repair_socket(&mut self) {
        let locked = is_at(&self.lock, &with_suffix(&self.path, ".lock"));
        if locked && self.file.is_some() && file_at(&self.path) == self.file {
            return;
        }
        match self.recreate(locked) {
            Ok(()) => {
                tracing::warn!(path = %self.path.display(), "the socket or its lock was removed: created again");
                self.troubled = false;
            }
            Err(error) if !self.troubled => {
                tracing::error!(%error, "the socket or its lock was removed and cannot be created again yet");
                self.troubled = true;
            }
            Err(_) => {}
        }
    }

    fn recreate(&mut self, locked: bool) -> Result<(), ListenError> {
        self.folder.restore(&self.path)?;
        // Without it a second station could start.
        if !locked {
            self.lock = lock(&self.path)?;
        }
        self.socket = bind(&self.path)?;
        self.file = file_at(&self.path);
        Ok(())
    }
}

impl Connections<'_> {
    fn now(&self) -> Duration {
        self.began.elapsed()
    }

    /// A connection that has said nothing yet.
    fn on_connection(&mut self, stream: UnixStream) {
        let Ok(credentials) = stream.peer_cred() else { return };
        self.waiting.retain(|(_, stranger)| !stranger.is_finished());
        let users: Vec<u32> = self.waiting.iter().map(|(user, _)| *user).collect();
        if let Some(place) = makes_room(&users, credentials.uid()) {
            tracing::debug!("too many connections without a handshake: the oldest is dropped");
            self.waiting.remove(place).1.abort();
        }
        self.waiting.push((credentials.uid(), self.handshaking.spawn(receive_handshake(stream, credentials))));
    }

    fn on_handshake_end(&mut self, HandshakeEnd { user, handshaken }: HandshakeEnd) {
        let now = self.now();
        let Handshaken { read, write, peer } = match handshaken {
            Some(Ok(handshaken)) => handshaken,
            Some(Err(error)) if self.callers.may_log(user, now) => {
                return tracing::warn!(%error, user, "a connection without a valid handshake");
            }
            Some(Err(_)) | None => return,
        };
        let from = peer.from.clone();
        let trusted = peer.unix_user.as_deref().is_some_and(|name| self.trusts(name));
        let has_room = self.acceptor.has_room(trusted || self.callers.is_host(user));
        let attached = has_room.then(|| self.callers.attach(user, trusted, now));
        let counted_as = match attached.unwrap_or_else(|| Err(format!("too many terminals attach at once{TRY_AGAIN}")))
        {
            Ok(counted_as) => counted_as,
            Err(why) => {
                if self.callers.may_log(user, now) {
                    tracing::warn!(%from, why, "a terminal was disconnected");
                }
                // Nothing was sent before, so the socket has room for one line.
                let _ = write.try_write(&rejection(why));
                return;
            }
        };
        let session = self.acceptor.attach(peer);
        let (terminal, snapshots) = (session.terminal, self.snapshots.clone());
        if self.callers.may_log(user, now) {
            tracing::info!(terminal, %from, "terminal attached");
        }
        self.serving.spawn(async move {
            let why = connection::serve(read, write, session, snapshots).await;
            Left { user, counted_as, terminal, from, why }
        });
    }

    /// Does the plant file let this user of the operating system in without a password?
    fn trusts(&self, name: &str) -> bool {
        let snapshot = self.acceptor.snapshots.borrow();
        snapshot.def.access.trusted.iter().any(|(trusted, _)| trusted == name)
    }

    fn on_left(&mut self, Left { user, counted_as, terminal, from, why }: Left) {
        self.callers.detach(counted_as);
        if self.callers.may_log(user, self.now()) {
            tracing::info!(terminal, %from, %why, "terminal detached");
        }
    }

    fn log_left_out(&mut self) {
        for (user, lines) in self.callers.unlogged(self.now()) {
            tracing::warn!(user, lines, "connections of this user: log lines omitted");
        }
    }
}

/// Waits for the handshake of a connection.
async fn receive_handshake(stream: UnixStream, credentials: UCred) -> HandshakeEnd {
    let user = credentials.uid();
    let (mut read, write) = stream.into_split();
    let place = match timeout(HANDSHAKE_MAX, read_handshake(&mut read)).await {
        Ok(Ok(place)) => place,
        Ok(Err(WireError::Closed)) | Err(_) => return HandshakeEnd { user, handshaken: None },
        Ok(Err(error)) => {
            if let WireError::Protocol(ProtocolError::OtherVersion(why)) = &error {
                // Nothing was sent before, so the socket has room for one line.
                let _ = write.try_write(&rejection(why.clone()));
            }
            return HandshakeEnd { user, handshaken: Some(Err(error)) };
        }
    };
    // The list of users may be on another machine.
    let name = spawn_blocking(move || uzers::get_user_by_uid(user)).await.ok().flatten();
    let name = name.map(|name| name.name().to_string_lossy().into_owned());
    let process = credentials.pid().and_then(|process| u32::try_from(process).ok());
    let from = place.words(name.as_deref(), process).into();
    let peer = Peer { from, unix_user: name.map(Into::into), in_process: false };
    HandshakeEnd { user, handshaken: Some(Ok(Handshaken { read, write, peer })) }
}

async fn read_handshake(read: &mut OwnedReadHalf) -> Result<TerminalOrigin, WireError> {
    Ok(protocol::client_handshake(&wire::read(read, HANDSHAKE_BYTES_MAX).await?)?)
}

fn rejection(why: String) -> Vec<u8> {
    protocol::encode(&Handshake::rejected(why), HANDSHAKE_BYTES_MAX).expect("one line is short")
}
