//! Where sockets live, and which of them have a station behind them.

use std::{
    fs, io,
    os::unix::fs::{DirBuilderExt, MetadataExt},
    path::{Path, PathBuf},
    time::Duration,
};

use tokio::{net::UnixStream, time::timeout};

/// The folder of a station that runs as a service.
const SERVICE: &str = "/run/sightglass";
/// Sockets that are tried, of one folder.
const SOCKETS_MAX: usize = 64;
/// A living station takes a connection within this time.
const TRY_MAX: Duration = Duration::from_millis(500);

/// The folders that may hold sockets, from the environment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SocketFolders {
    /// `$RUNTIME_DIRECTORY`: the service manager has made it for this very process.
    pub given: Option<PathBuf>,
    /// `/run/sightglass`.
    pub service: PathBuf,
    /// `$XDG_RUNTIME_DIR/sightglass`.
    pub login: Option<PathBuf>,
    /// `/tmp/sightglass-UID`.
    pub last: PathBuf,
}

/// A station that takes connections.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundStation {
    /// The plant.
    pub name: String,
    /// Its socket.
    pub path: PathBuf,
}

impl SocketFolders {
    /// Of this process.
    pub fn here() -> SocketFolders {
        let folder = |name: &str| {
            // A service manager may name several folders.
            let first = std::env::var(name).ok()?.split(':').next()?.to_owned();
            (!first.is_empty()).then(|| PathBuf::from(first))
        };
        let uid = rustix::process::getuid().as_raw();
        SocketFolders {
            given: folder("RUNTIME_DIRECTORY"),
            service: SERVICE.into(),
            login: folder("XDG_RUNTIME_DIR").map(|folder| folder.join("sightglass")),
            last: std::env::temp_dir().join(format!("sightglass-{uid}")),
        }
    }

    /// Where a station of this process puts the socket of this plant. The folder is there afterwards.
    pub fn socket(&self, plant: &str) -> io::Result<PathBuf> {
        let name = format!("{plant}.sock");
        if let Some(folder) = &self.given {
            return Ok(folder.join(name));
        }
        if rustix::fs::access(&self.service, rustix::fs::Access::WRITE_OK).is_ok() {
            return Ok(self.service.join(name));
        }
        let folder = self.login.as_ref().unwrap_or(&self.last);
        match fs::DirBuilder::new().mode(0o700).create(folder) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(named(folder, error)),
            Ok(()) | Err(_) => {}
        }
        require_own(folder)?;
        Ok(folder.join(name))
    }

    /// A folder of sockets that this user may not read.
    pub fn closed(&self) -> Option<PathBuf> {
        let folders = self.given.iter().chain([&self.service]).chain(&self.login).chain([&self.last]);
        let closed = |folder: &&PathBuf| {
            fs::read_dir(folder).is_err_and(|error| error.kind() == io::ErrorKind::PermissionDenied)
        };
        folders.into_iter().find(closed).cloned()
    }

    /// The stations that live, by name. One that is stuck is not among them.
    pub async fn living(&self) -> Vec<FoundStation> {
        let own =
            [self.login.as_ref(), Some(&self.last)].into_iter().flatten().filter(|path| require_own(path).is_ok());
        let mut found: Vec<FoundStation> = Vec::new();
        for folder in self.given.iter().chain([&self.service]).chain(own) {
            for path in sockets(folder) {
                let Some(name) = path.file_stem().and_then(|name| name.to_str()) else { continue };
                let is_new = found.iter().all(|other| other.path != path);
                // One with a full queue of connections lives.
                let lives = match timeout(TRY_MAX, UnixStream::connect(&path)).await {
                    Ok(Ok(_)) => true,
                    Ok(Err(error)) => error.kind() == io::ErrorKind::WouldBlock,
                    Err(_) => false,
                };
                if is_new && lives {
                    found.push(FoundStation { name: name.to_owned(), path });
                }
            }
        }
        found.sort_by(|one, other| (&one.name, &one.path).cmp(&(&other.name, &other.path)));
        found
    }
}

/// Another user who could write there could impersonate the station and receive passwords.
fn require_own(folder: &Path) -> io::Result<()> {
    let about = fs::symlink_metadata(folder).map_err(|error| named(folder, error))?;
    let is_own = about.is_dir() && about.uid() == rustix::process::getuid().as_raw() && about.mode() & 0o022 == 0;
    if is_own {
        return Ok(());
    }
    let why = "not a folder owned by this user alone; remove it";
    Err(named(folder, io::Error::new(io::ErrorKind::PermissionDenied, why)))
}

fn sockets(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut paths: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|ending| ending == "sock")).collect();
    paths.sort();
    paths.truncate(SOCKETS_MAX);
    paths
}

fn named(path: &Path, error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}
