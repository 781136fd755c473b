//! Serial ports of this machine: which there are, who has one, who may have one.

use std::{
    fs, io,
    os::unix::fs::MetadataExt,
    path::{Path, PathBuf},
};

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

/// Why a port could not be opened, in words that say what to do.
pub fn why_not(path: &str, error: &tokio_serial::Error) -> String {
    use tokio_serial::ErrorKind;
    let words = error.to_string();
    match error.kind {
        ErrorKind::Io(io::ErrorKind::NotFound) => format!("{path}: no such port ({})", known_words()),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => format!("{path}: no permission{}", group_words(path)),
        _ if ["busy", "exclusive lock"].iter().any(|word| words.to_lowercase().contains(word)) => {
            format!("{path}: in use by {}", holder(path).unwrap_or_else(|| "another program".into()))
        }
        // Older kernels and pseudo-terminals say the same of a path that is no port at all.
        ErrorKind::NoDevice if !Path::new(path).exists() => format!("{path}: no such port ({})", known_words()),
        ErrorKind::Unknown | ErrorKind::Io(io::ErrorKind::Other) if words.contains("Not a typewriter") => {
            format!("{path}: not a serial port")
        }
        ErrorKind::NoDevice | ErrorKind::InvalidInput | ErrorKind::Unknown | ErrorKind::Io(_) => {
            format!("{path}: {words}")
        }
    }
}

fn known_words() -> String {
    match list().as_slice() {
        [] => "this machine has no serial port".into(),
        ports => format!("there are: {}", ports.join(", ")),
    }
}

/// Which group a user must be in.
fn group_words(path: &str) -> String {
    let Ok(gid) = fs::metadata(path).map(|port| port.gid()) else { return String::new() };
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let is_this = |line: &&str| line.split(':').nth(2) == Some(&gid.to_string());
    match groups.lines().find(is_this).and_then(|line| line.split(':').next()) {
        // No task joins this one.
        Some("root") => ": it belongs to root; ask the administrator for access (a udev rule)".to_owned(),
        Some(name) => format!(": it belongs to the group {name} (usermod -aG {name} USER, then log in again)"),
        None => format!(": it belongs to the group {gid}"),
    }
}

/// The program that has a port open, as far as we may see: `minicom (process 1234)`.
pub(super) fn holder(path: &str) -> Option<String> {
    let port = fs::canonicalize(path).ok()?;
    let processes = fs::read_dir("/proc").ok()?.flatten();
    let own = std::process::id().to_string();
    let holds = |folder: &Path| {
        let handles = fs::read_dir(folder.join("fd")).into_iter().flatten().flatten();
        handles.into_iter().any(|handle| fs::read_link(handle.path()).is_ok_and(|target| target == port))
    };
    let is_process = |folder: &Path| {
        folder.file_name().is_some_and(|name| name.to_string_lossy().bytes().all(|digit| digit.is_ascii_digit()))
    };
    let found = processes.map(|process| process.path()).find(|folder| is_process(folder) && holds(folder))?;
    let id = found.file_name()?.to_string_lossy().into_owned();
    if id == own {
        return Some("this program, on another line".into());
    }
    let name = fs::read_to_string(found.join("comm")).ok()?;
    Some(format!("{} (process {id})", name.trim()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn the_holder_of_a_port_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().display().to_string();
        assert_eq!(holder(&path).as_deref(), Some("this program, on another line"));
        assert_eq!(holder("/dev/no-such-port"), None);
    }

    #[test]
    fn the_group_that_may_use_a_port_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let words = group_words(&file.path().display().to_string());
        assert!(words.contains("it belongs to"), "{words}");
        assert_eq!(group_words("/dev/no-such-port"), "");
    }
}
