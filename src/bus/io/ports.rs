//! Serial ports of this machine: which there are, who has one, who may have one.

use std::{
    fs, io,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

use crate::plant::line_trouble::{LineTrouble, PortHolder, PortOwner};

/// Serial ports, by the names that stay the same when an adapter is plugged in elsewhere, where there are such.
pub fn list() -> Vec<String> {
    let stable = names_in(Path::new("/dev/serial/by-id"), |_| true);
    let covered: Vec<PathBuf> = stable.iter().filter_map(|path| fs::canonicalize(path).ok()).collect();
    let is_port = |name: &str| ["ttyUSB", "ttyACM", "ttyAMA", "ttyS"].iter().any(|stem| name.starts_with(stem));
    let others = names_in(Path::new("/dev"), is_port).into_iter().filter(|path| !covered.contains(&path.into()));
    stable.iter().cloned().chain(others.filter(|path| is_real(path))).collect()
}

/// `, driver ch341` for a port whose driver is known, else nothing.
pub fn driver_words(path: &str) -> String {
    let device = fs::canonicalize(path).ok();
    let name = device.as_deref().and_then(Path::file_name);
    let driver =
        name.and_then(|name| fs::canonicalize(Path::new("/sys/class/tty").join(name).join("device/driver")).ok());
    let words =
        driver.as_deref().and_then(Path::file_name).map(|driver| format!(", driver {}", driver.to_string_lossy()));
    words.unwrap_or_default()
}

/// Linux makes /dev/ttyS0 to ttyS31 whether they exist or not; those that do have a driver.
fn is_real(path: &str) -> bool {
    let name = path.trim_start_matches("/dev/");
    !name.starts_with("ttyS") || Path::new("/sys/class/tty").join(name).join("device/driver").exists()
}

fn names_in(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter(|entry| wanted(&entry.file_name().to_string_lossy()));
    let mut names: Vec<String> = names.map(|entry| entry.path().display().to_string()).collect();
    names.sort();
    names
}

/// Why a port could not be opened.
pub fn why_not(path: &str, error: &tokio_serial::Error) -> LineTrouble {
    use tokio_serial::ErrorKind;
    let words = error.to_string();
    let no_such = || LineTrouble::NoSuchPort { path: path.to_owned(), known: list() };
    match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => no_such(),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
            LineTrouble::NoPermission { path: path.to_owned(), owner: owner(path) }
        }
        _ if ["busy", "exclusive lock"].iter().any(|word| words.to_lowercase().contains(word)) => {
            LineTrouble::InUse { path: path.to_owned(), holder: holder(path) }
        }
        // Older kernels and pseudo-terminals say the same of a path that is no port at all.
        ErrorKind::NoDevice if !Path::new(path).exists() => no_such(),
        ErrorKind::Unknown | ErrorKind::Io(io::ErrorKind::Other) if words.contains("Not a typewriter") => {
            LineTrouble::NotSerial(path.to_owned())
        }
        ErrorKind::NoDevice | ErrorKind::InvalidInput | ErrorKind::Unknown | ErrorKind::Io(_) => {
            LineTrouble::System(format!("{path}: {words}"))
        }
    }
}

/// Which group a user must be in.
fn owner(path: &str) -> PortOwner {
    let Ok(gid) = fs::metadata(path).map(|port| port.gid()) else { return PortOwner::Unknown };
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let is_this = |line: &&str| line.split(':').nth(2) == Some(&gid.to_string());
    match groups.lines().find(is_this).and_then(|line| line.split(':').next()) {
        Some("root") => PortOwner::Root,
        Some(name) => PortOwner::Group(name.to_owned()),
        None => PortOwner::Gid(gid),
    }
}

/// A program that has a port open.
struct Holder {
    process: u32,
    /// It serves the port too: the other end of a pseudo-terminal.
    is_other_end: bool,
}

impl Holder {
    /// `mbpoll -m rtu /dev/ttyUSB0 (process 1234)`.
    fn words(&self) -> String {
        let read = |name: &str| fs::read(format!("/proc/{}/{name}", self.process)).unwrap_or_default();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace('\0', " ").trim().to_owned();
        let command =
            Some(text(&read("cmdline"))).filter(|line| !line.is_empty()).unwrap_or_else(|| text(&read("comm")));
        // A control character of another program's arguments is no business of this terminal.
        let shown: String = command.chars().filter(|letter| !letter.is_control()).take(COMMAND_MAX).collect();
        format!("{shown} (process {})", self.process)
    }
}

/// Most characters of a command that are shown.
const COMMAND_MAX: usize = 80;

/// The programs that have a port open, as far as we may see.
fn holders(path: &str) -> Vec<Holder> {
    let Ok(port) = fs::metadata(path) else { return Vec::new() };
    let index = fs::canonicalize(path)
        .ok()
        .and_then(|path| path.strip_prefix("/dev/pts").ok().and_then(|name| name.to_str()?.parse::<u32>().ok()));
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_port =
        |handle: &Path| fs::metadata(handle).is_ok_and(|open| (open.dev(), open.ino()) == (port.dev(), port.ino()));
    // The kernel says which pseudo-terminal a master belongs to.
    let is_master = |handle: &Path, folder: &Path| {
        let info = handle.file_name().map(|name| folder.join("fdinfo").join(name));
        let info = info.and_then(|info| fs::read_to_string(info).ok()).unwrap_or_default();
        let of = info.lines().find_map(|line| line.strip_prefix("tty-index:")?.trim().parse().ok());
        of.is_some() && of == index
    };
    let of_process = |folder: PathBuf| {
        let process = folder.file_name()?.to_str()?.parse().ok()?;
        let handles: Vec<PathBuf> = entries(&folder.join("fd")).collect();
        let holds = handles.iter().any(|handle| is_port(handle));
        let is_other_end = || index.is_some() && handles.iter().any(|handle| is_master(handle, &folder));
        holds.then(|| Holder { process, is_other_end: is_other_end() })
    };
    entries(Path::new("/proc")).filter_map(of_process).collect()
}

/// The programs that have a port open: `minicom -D /dev/ttyUSB0 (process 1234)`.
pub(super) fn holder(path: &str) -> PortHolder {
    let other_end = || words_of(holders(path).iter()).map(PortHolder::Programs);
    user(path).or_else(other_end).unwrap_or(PortHolder::Unknown)
}

/// The same without what only serves a pseudo-terminal.
pub(super) fn user(path: &str) -> Option<PortHolder> {
    let own = std::process::id();
    match holders(path).iter().any(|holder| holder.process == own) {
        true => Some(PortHolder::OtherLine),
        false => also_open(path).map(PortHolder::Programs),
    }
}

/// The programs that have a port open beside this one, and take bytes from it.
pub fn also_open(path: &str) -> Option<String> {
    let own = std::process::id();
    words_of(holders(path).iter().filter(|holder| holder.process != own && !holder.is_other_end))
}

fn words_of<'a>(holders: impl Iterator<Item = &'a Holder>) -> Option<String> {
    let words: Vec<String> = holders.map(Holder::words).collect();
    (!words.is_empty()).then(|| words.join(", "))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_holder_of_a_port_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().display().to_string();
        assert_eq!(holder(&path), PortHolder::OtherLine);
        assert_eq!(holder("/dev/no-such-port"), PortHolder::Unknown);
    }

    #[test]
    fn the_group_that_may_use_a_port_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert_ne!(owner(&file.path().display().to_string()), PortOwner::Unknown);
        assert_eq!(owner("/dev/no-such-port"), PortOwner::Unknown);
    }
}
