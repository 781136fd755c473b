//! The file of the latest requests, beside the history.

use std::{
    io,
    path::{Path, PathBuf},
};

use crate::{
    north::request_log::RequestLog,
    profile::io::{atomic::write_atomic, regular},
};

/// Many times the longest list.
const BYTES_MAX: u64 = 16 << 20;

/// The file beside a history.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("mqtt-requests")
}

/// An empty list where there was no request yet; `Err` where it cannot be read.
pub fn read(path: &Path) -> Result<RequestLog, String> {
    let bytes = match regular::read(path, BYTES_MAX) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(RequestLog::default()),
        Err(error) => return Err(format!("{}: {error}", path.display())),
    };
    serde_json::from_slice(&bytes).map_err(|error| format!("{}: {error}", path.display()))
}

/// Blocks until it is on disk.
pub fn write(path: &Path, list: &[u8]) -> Result<(), String> {
    write_atomic(path, list, 0o640).map_err(|error| format!("{}: {error}", path.display()))
}
