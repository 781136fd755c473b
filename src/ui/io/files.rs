//! Reads and writes the files of the terminal's user.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::profile::io::{
    atomic::{write_for_user, write_new},
    regular,
};

/// Most bytes of a file that is loaded.
const LOAD_MAX: u64 = 4 << 20;

/// A text of the user; one of another encoding is read as well as it can be.
pub(super) fn load(path: &Path) -> io::Result<String> {
    Ok(String::from_utf8_lossy(&regular::read(path, LOAD_MAX)?).into_owned())
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
