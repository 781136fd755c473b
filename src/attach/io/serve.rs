//! The listener: one socket a station, no patience with whoever does not say hello, and made again when it is removed.

use std::{
    fs::{File, OpenOptions, Permissions},
    io,
    os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt},
    path::{Path, PathBuf},
    time::Duration,
};

use jiff::Timestamp;
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
    seat,
    wire::{self, WireError},
};
use crate::{
    access::Peer,
    attach::{
        callers::{Callers, makes_room},
        protocol::{self, Greeting, HELLO_BYTES_MAX, Place, ProtocolError},
    },
    station::Entrance,
};

/// A connection says hello within this time.
pub const HELLO_MAX: Duration = Duration::from_secs(2);
/// Pause after the system had no connection to give.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// So often it is looked whether the socket is still there.
const LOOK_EVERY: Duration = Duration::from_secs(2);

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
    lock: File,
    /// Tells the file of the socket from another one at its place.
    file: Option<(u64, u64)>,
    /// It could not be made again, and that is logged.
    troubled: bool,
}

/// Listens at this path, whose folder is there. What a dead station has left is replaced.
pub fn listen(path: &Path) -> Result<Listener, ListenError> {
    let lock = lock(path)?;
    let socket = bind(path)?;
    Ok(Listener { socket, path: path.to_owned(), lock, file: file_at(path), troubled: false })
}

fn lock(path: &Path) -> Result<File, ListenError> {
    let lock = beside(path, ".lock");
    let file =
        OpenOptions::new().create(true).truncate(false).write(true).mode(0o600).open(&lock).map_err(told(&lock))?;
    match flock(&file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(file),
        Err(rustix::io::Errno::WOULDBLOCK) => Err(ListenError::Running { process: process_at(path) }),
        Err(error) => Err(told(&lock)(error.into())),
    }
}

/// Under another name until its rights are set, then in place of whatever was there: never too open, never absent.
fn bind(path: &Path) -> Result<UnixListener, ListenError> {
    let new = beside(path, ".new");
    match std::fs::remove_file(&new) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(told(&new)(error)),
        Ok(()) | Err(_) => {}
    }
    let socket = UnixListener::bind(&new).map_err(told(&new))?;
    std::fs::set_permissions(&new, Permissions::from_mode(0o660)).map_err(told(&new))?;
    std::fs::rename(&new, path).map_err(told(path))?;
    Ok(socket)
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn told(path: &Path) -> impl FnOnce(io::Error) -> ListenError + use<> {
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

/// A connection that has said hello.
struct Guest {
    read: OwnedReadHalf,
    write: OwnedWriteHalf,
    peer: Peer,
}

/// What became of a stranger.
struct Greeted {
    user: u32,
    /// `Err` for one that said something else; `None` for one that has said nothing.
    guest: Option<Result<Guest, WireError>>,
}

/// A terminal that has gone.
struct Left {
    user: u32,
    counted_as: u32,
    terminal: u32,
    from: std::sync::Arc<str>,
    why: seat::Ended,
}

/// Everybody who is there.
struct House<'a> {
    entrance: &'a Entrance,
    /// A number that another run does not have: terminals are counted anew in each.
    run: u64,
    began: Instant,
    callers: Callers,
    strangers: JoinSet<Greeted>,
    /// Those that have not said hello, the oldest first.
    waiting: Vec<(u32, AbortHandle)>,
    seats: JoinSet<Left>,
}

impl Listener {
    /// Where it listens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Lets terminals in until the station behind this entrance has ended. Can be called again with another station.
    pub async fn serve(&mut self, entrance: &Entrance) {
        let mut snapshots = entrance.snapshots.clone();
        let mut look = interval(LOOK_EVERY);
        look.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let mut house = House {
            entrance,
            run: Timestamp::now().as_microsecond() as u64,
            began: Instant::now(),
            callers: Callers::new(rustix::process::getuid().as_raw()),
            strangers: JoinSet::new(),
            waiting: Vec::new(),
            seats: JoinSet::new(),
        };
        loop {
            tokio::select! {
                biased;
                ended = snapshots.changed() => if ended.is_err() { break },
                Some(greeted) = house.strangers.join_next() => if let Ok(greeted) = greeted { house.seat(greeted) },
                Some(left) = house.seats.join_next() => if let Ok(left) = left { house.left(left) },
                _ = look.tick() => {
                    self.keep();
                    house.tell_unlogged();
                }
                accepted = self.socket.accept() => match accepted {
                    Ok((stream, _)) => house.comes(stream),
                    Err(error) => {
                        tracing::error!(%error, "no connection could be taken");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                },
            }
        }
    }

    /// Makes the socket, and its lock, again if they are not there any more. Who is attached stays attached.
    fn keep(&mut self) {
        let locked = is_at(&self.lock, &beside(&self.path, ".lock"));
        if locked && self.file.is_some() && file_at(&self.path) == self.file {
            return;
        }
        match self.again(locked) {
            Ok(()) => {
                tracing::warn!(path = %self.path.display(), "the socket or its lock was removed: made again");
                self.troubled = false;
            }
            Err(error) if !self.troubled => {
                tracing::error!(%error, "the socket or its lock was removed and cannot be made again yet");
                self.troubled = true;
            }
            Err(_) => {}
        }
    }

    fn again(&mut self, locked: bool) -> Result<(), ListenError> {
        // Without it a second station could start.
        if !locked {
            self.lock = lock(&self.path)?;
        }
        self.socket = bind(&self.path)?;
        self.file = file_at(&self.path);
        Ok(())
    }
}

impl House<'_> {
    fn now(&self) -> Duration {
        self.began.elapsed()
    }

    /// A connection that has said nothing yet.
    fn comes(&mut self, stream: UnixStream) {
        let Ok(credentials) = stream.peer_cred() else { return };
        self.waiting.retain(|(_, stranger)| !stranger.is_finished());
        let users: Vec<u32> = self.waiting.iter().map(|(user, _)| *user).collect();
        if let Some(place) = makes_room(&users, credentials.uid()) {
            tracing::debug!("too many connections without a hello: the oldest is dropped");
            self.waiting.remove(place).1.abort();
        }
        self.waiting.push((credentials.uid(), self.strangers.spawn(greet(stream, credentials))));
    }

    fn seat(&mut self, Greeted { user, guest }: Greeted) {
        let now = self.now();
        let Guest { read, write, peer } = match guest {
            Some(Ok(guest)) => guest,
            Some(Err(error)) if self.callers.may_log(user, now) => {
                return tracing::warn!(%error, user, "a connection without a right hello");
            }
            Some(Err(_)) | None => return,
        };
        let from = peer.from.clone();
        let counted_as = match self.callers.attach(user, now) {
            Ok(counted_as) => counted_as,
            Err(why) => {
                if self.callers.may_log(user, now) {
                    tracing::warn!(%from, why, "a terminal was sent away");
                }
                // It has been told nothing yet, so the system has room for one line.
                let _ = write.try_write(&sorry(why));
                return;
            }
        };
        let session = self.entrance.attach(peer);
        let (terminal, run) = (session.terminal, self.run);
        if self.callers.may_log(user, now) {
            tracing::info!(terminal, %from, "a terminal has attached");
        }
        self.seats.spawn(async move {
            let why = seat::serve(read, write, session, run).await;
            Left { user, counted_as, terminal, from, why }
        });
    }

    fn left(&mut self, Left { user, counted_as, terminal, from, why }: Left) {
        self.callers.detach(counted_as);
        if self.callers.may_log(user, self.now()) {
            tracing::info!(terminal, %from, %why, "a terminal has gone");
        }
    }

    fn tell_unlogged(&mut self) {
        for (user, lines) in self.callers.unlogged(self.now()) {
            tracing::warn!(user, lines, "connections of this user: lines were left out");
        }
    }
}

/// Waits for the hello of a connection.
async fn greet(stream: UnixStream, credentials: UCred) -> Greeted {
    let user = credentials.uid();
    let (mut read, write) = stream.into_split();
    let place = match timeout(HELLO_MAX, hello(&mut read)).await {
        Ok(Ok(place)) => place,
        Ok(Err(WireError::Closed)) | Err(_) => return Greeted { user, guest: None },
        Ok(Err(error)) => {
            if let WireError::Protocol(ProtocolError::OtherVersion(why)) = &error {
                // It has been told nothing yet, so the system has room for one line.
                let _ = write.try_write(&sorry(why.clone()));
            }
            return Greeted { user, guest: Some(Err(error)) };
        }
    };
    // The list of users may be on another machine.
    let name = tokio::task::spawn_blocking(move || uzers::get_user_by_uid(user)).await.ok().flatten();
    let name = name.map(|name| name.name().to_string_lossy().into_owned());
    let process = credentials.pid().and_then(|process| u32::try_from(process).ok());
    let from = place.words(name.as_deref(), process).into();
    let peer = Peer { from, unix_user: name.map(Into::into), own: false };
    Greeted { user, guest: Some(Ok(Guest { read, write, peer })) }
}

async fn hello(read: &mut OwnedReadHalf) -> Result<Place, WireError> {
    Ok(protocol::hello(&wire::read(read, HELLO_BYTES_MAX).await?)?)
}

fn sorry(why: String) -> Vec<u8> {
    protocol::encode_first(&Greeting::sorry(why), None::<&()>, HELLO_BYTES_MAX).expect("one line is short")
}
