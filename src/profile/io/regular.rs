//! Opens files that are files: a pipe or a device under the name of one is refused at once, and nothing waits for it.

use std::{
    fs::{self, File, OpenOptions, Permissions},
    io::{self, Read},
    os::unix::fs::{OpenOptionsExt, PermissionsExt},
    path::Path,
};

use rustix::{fs::OFlags, io::Errno};

/// Opens a file to read it.
pub fn open(path: &Path) -> io::Result<File> {
    open_with(OpenOptions::new().read(true), path)
}

/// Opens a file as the options say; through a link as well.
pub fn open_with(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    opened(options, path, OFlags::NONBLOCK)
}

/// The same, but no link.
pub fn open_no_link(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    opened(options, path, OFlags::NONBLOCK | OFlags::NOFOLLOW)
}

fn opened(options: &mut OpenOptions, path: &Path, flags: OFlags) -> io::Result<File> {
    // Some devices act as soon as they are opened: a watchdog begins to count.
    check(path)?;
    // What has come there meanwhile is not waited for either.
    let file = options.custom_flags(flags.bits().cast_signed()).open(path)?;
    refuse_special(&file.metadata()?).map(|()| file)
}

/// An error where something is there that is no file; for what others open.
pub fn check(path: &Path) -> io::Result<()> {
    fs::metadata(path).map_or(Ok(()), |there| refuse_special(&there))
}

fn refuse_special(there: &fs::Metadata) -> io::Result<()> {
    match (there.is_file(), there.is_dir()) {
        (true, _) => Ok(()),
        (_, true) => Err(Errno::ISDIR.into()),
        (false, false) => Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file")),
    }
}

/// All that is in a file; [`io::ErrorKind::FileTooLarge`] for more than `max` bytes.
pub fn read(path: &Path, max: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(max + 1).read_to_end(&mut bytes)?;
    if max < bytes.len() as u64 {
        let words = format!("larger than {} KiB", max >> 10);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, words));
    }
    Ok(bytes)
}

/// The same of a text.
pub fn read_text(path: &Path, max: u64) -> io::Result<String> {
    let not_text = |_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8");
    String::from_utf8(read(path, max)?).map_err(not_text)
}

/// Copies a file with its rights, in the place of another one. Returns its bytes.
pub fn copy(from: &Path, to: &Path) -> io::Result<u64> {
    let mut from = open(from)?;
    let mode = from.metadata()?.permissions().mode() & 0o777;
    let mut to = open_with(OpenOptions::new().write(true).create(true).truncate(true).mode(mode), to)?;
    to.set_permissions(Permissions::from_mode(mode))?;
    io::copy(&mut from, &mut to)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::os::unix::{fs::symlink, net::UnixListener};

    use rustix::fs::{CWD, FileType, Mode, mknodat};

    use super::*;

    #[test]
    fn what_is_no_file_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        mknodat(CWD, at("pipe"), FileType::Fifo, Mode::from_raw_mode(0o600), 0).unwrap();
        let _socket = UnixListener::bind(at("socket")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        symlink(at("pipe"), at("link to a pipe")).unwrap();
        assert_eq!(open(&at("folder")).unwrap_err().kind(), io::ErrorKind::IsADirectory);
        for name in ["pipe", "socket", "link to a pipe", "/dev/zero", "/dev/null"] {
            let mut writing = OpenOptions::new();
            writing.write(true).create(true).truncate(true);
            for found in [open(&at(name)), open_with(&mut writing, &at(name))] {
                assert_eq!(found.unwrap_err().kind(), io::ErrorKind::InvalidInput, "{name}");
            }
        }
        fs::write(at("file"), "four").unwrap();
        symlink(at("file"), at("link")).unwrap();
        assert_eq!(read(&at("link"), 4).unwrap(), b"four");
        assert_eq!(read(&at("link"), 3).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert!(open_no_link(OpenOptions::new().read(true), &at("link")).is_err());
        copy(&at("file"), &at("copy")).unwrap();
        assert_eq!(read_text(&at("copy"), 4).unwrap(), "four");
        assert!(copy(&at("file"), &at("pipe")).is_err() && copy(&at("pipe"), &at("copy")).is_err());
        assert_eq!(open(&at("none")).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
