//! Reads and writes the files of the terminal's user.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::{
    profile::io::{
        atomic::{write_for_user, write_new},
        regular,
    },
    register_map,
};

/// Most bytes of a file that is loaded.
const LOAD_MAX: u64 = register_map::BYTES_MAX;

/// A file of the user.
pub(super) fn load(path: &Path) -> io::Result<Vec<u8>> {
    regular::read(path, LOAD_MAX)
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
