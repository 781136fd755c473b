//! The cursor file: a line with the instant up to which the history was read for the broker and the epoch of its clock, and of a
//! station that has stopped one with what it sent last.

use std::{
    io,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use crate::{
    plant::sample::Sample,
    profile::io::{atomic::write_atomic, regular},
};

/// Far more than a hundred thousand samples take.
const BYTES_MAX: u64 = 64 << 20;

/// What is in the file.
#[derive(Debug, PartialEq)]
pub struct Cursor {
    /// The instant.
    pub at: Timestamp,
    /// The epoch of the clock; `None` from an earlier version.
    pub epoch: Option<u16>,
    /// What was sent last, by the names of the tags; `None` after a failure.
    pub sent: Option<Vec<(String, Sample)>>,
}

/// The file beside a history.
pub fn beside(history: &Path) -> PathBuf {
    history.with_extension("mqtt-cursor")
}

/// `None` where nothing was sent yet.
pub fn read(path: &Path) -> Result<Option<Cursor>, String> {
    match regular::read_text(path, BYTES_MAX) {
        Ok(text) => parse(&text).map(Some).ok_or_else(|| format!("{}: expected an instant", path.display())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(format!("{}: {error}", path.display())),
    }
}

/// What cannot be read behind the instant is not known.
fn parse(text: &str) -> Option<Cursor> {
    let (at, sent) = text.split_once('\n').unwrap_or((text, ""));
    let (at, epoch) = at.trim().split_once(' ').map_or((at.trim(), None), |(at, epoch)| (at, Some(epoch)));
    let epoch = epoch.map(|epoch| epoch.parse().ok());
    Some(Cursor { at: at.parse().ok()?, epoch: epoch.unwrap_or_default(), sent: serde_json::from_str(sent).ok() })
}

/// Blocks while the disk works.
pub fn write(path: &Path, Cursor { at, epoch, sent }: &Cursor) -> Result<(), String> {
    let sent = sent.as_ref().map(|sent| serde_json::to_string(sent).expect("names and finite numbers") + "\n");
    let epoch = epoch.map(|epoch| format!(" {epoch}")).unwrap_or_default();
    let text = format!("{at}{epoch}\n{}", sent.unwrap_or_default());
    write_atomic(path, text.as_bytes(), 0o640).map_err(|error| format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::sample::Cause;

    #[test]
    fn a_cursor_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = beside(&folder.path().join("tank.duckdb"));
        assert_eq!(read(&path), Ok(None));
        let at = Timestamp::from_microsecond(1_700_000_000_123_456).expect("in range");
        let sample = Sample::good(0.1 + 0.2, at).uncertain(Cause::Stale);
        for (epoch, sent) in [
            (None, None),
            (Some(0), Some(vec![])),
            (Some(7), Some(vec![("TIC-1.PV".to_owned(), sample), ("é".to_owned(), Sample::bad(Cause::Timeout, at))])),
        ] {
            let cursor = Cursor { at, epoch, sent };
            write(&path, &cursor).expect("a writable folder");
            assert_eq!(read(&path), Ok(Some(cursor)));
        }
        // What was cut off is not known.
        std::fs::write(&path, format!("{at}\n[[\"TIC-1.PV\",{{")).expect("a writable file");
        assert_eq!(read(&path), Ok(Some(Cursor { at, epoch: None, sent: None })));
        std::fs::write(&path, "yesterday\n").expect("a writable file");
        assert!(read(&path).is_err_and(|why| why.ends_with("tank.mqtt-cursor: expected an instant")));
    }
}
