//! The cursor file: one line with the instant up to which the history was read for the broker.

use std::{
    io,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use crate::profile::io::{atomic::write_atomic, regular};

/// Far more than an instant takes.
const BYTES_MAX: u64 = 1 << 10;

/// The file beside a history.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("mqtt-cursor")
}

/// `None` where nothing was sent yet.
pub fn read(path: &Path) -> Result<Option<Timestamp>, String> {
    match regular::read_text(path, BYTES_MAX) {
        Ok(text) => match text.trim().parse() {
            Ok(cursor) => Ok(Some(cursor)),
            Err(_) => Err(format!("{}: expected an instant", path.display())),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(format!("{}: {error}", path.display())),
    }
}

/// Blocks while the disk works.
pub fn write(path: &Path, cursor: Timestamp) -> Result<(), String> {
    write_atomic(path, format!("{cursor}\n").as_bytes(), 0o640).map_err(|error| format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = beside(&folder.path().join("tank.duckdb"));
        assert_eq!(read(&path), Ok(None));
        let cursor = Timestamp::from_microsecond(1_700_000_000_123_456).expect("in range");
        write(&path, cursor).expect("a writable folder");
        assert_eq!(read(&path), Ok(Some(cursor)));
        std::fs::write(&path, "yesterday\n").expect("a writable file");
        assert!(read(&path).is_err_and(|why| why.ends_with("tank.mqtt-cursor: expected an instant")));
    }
}
