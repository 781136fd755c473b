//! Reads and writes the files of the terminal's user.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::profile::io::atomic::{write_for_user, write_new};

/// Most bytes of a file that is loaded.
const LOAD_MAX: u64 = 4 << 20;

/// A text of the user; one of another encoding is read as well as it can be.
pub(super) fn load(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    io::Read::read_to_end(&mut io::Read::take(std::fs::File::open(path)?, LOAD_MAX + 1), &mut bytes)?;
    if LOAD_MAX < bytes.len() as u64 {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "more than 4 MiB"));
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// A half-written report never has the name of a whole one.
pub(super) fn save(path: &Path, bytes: &[u8], new: bool) -> io::Result<PathBuf> {
    if new {
        write_new(path, bytes)?
    } else {
        write_for_user(path, bytes)?
    }
    std::path::absolute(path)
}
