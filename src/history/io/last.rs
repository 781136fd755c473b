//! The last commit in a small file beside the database: at the next start a log that was cut, or a file that was removed
//! or replaced, differs from it.

use std::{
    fs::File,
    io::ErrorKind,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use jiff::Timestamp;

use crate::profile::io::{
    atomic::{with_suffix, write_atomic},
    regular,
};

/// A commit as both the database and the file beside it know it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LastCommit {
    /// Of the database: a random number from its creation.
    pub identity: u64,
    /// Counts commits.
    pub number: u64,
    /// The latest record in it; `None` before the first commit.
    pub at: Option<Timestamp>,
}

/// What the file beside the database says.
#[derive(Debug, PartialEq, Eq)]
pub enum Noted {
    /// There is none: a new database, or one of an earlier version.
    Nothing,
    /// It cannot be read.
    Unreadable,
    /// This commit.
    Commit(LastCommit),
}

/// Far more than its one line.
const BYTES_MAX: u64 = 1 << 10;

/// Where the file lies.
pub fn path(db: &Path) -> PathBuf {
    with_suffix(db, ".last")
}

/// Writes the last commit down, on disk when it returns. It overwrites its one line, so that a full disk hinders it least; the
/// first line is there whole or not at all, because an empty file would say that commits may be missing.
pub fn write(db: &Path, last: &LastCommit) -> std::io::Result<()> {
    let (path, line) = (path(db), line(last));
    match regular::open_with(File::options().write(true), &path) {
        Ok(file) => file.write_all_at(line.as_bytes(), 0).and_then(|()| file.sync_data()),
        Err(error) if error.kind() == ErrorKind::NotFound => write_atomic(&path, line.as_bytes(), 0o640),
        Err(error) => Err(error),
    }
}

/// Reads what was written down.
pub fn read(db: &Path) -> Noted {
    match regular::read_text(&path(db), BYTES_MAX) {
        Ok(text) => parse(&text).map_or(Noted::Unreadable, Noted::Commit),
        Err(error) if error.kind() == ErrorKind::NotFound => Noted::Nothing,
        Err(_) => Noted::Unreadable,
    }
}

/// What the database lacks of what was noted beside it, in words for the operator; `None` if nothing.
pub fn missing(noted: &Noted, now_open: &LastCommit) -> Option<String> {
    let noted = match noted {
        Noted::Nothing => return None,
        Noted::Unreadable => {
            return Some("the record of the last commit cannot be read: whether records are missing is unknown".into());
        }
        Noted::Commit(noted) => noted,
    };
    let until = noted.at.map_or(String::new(), |at| format!(", the last of {at:.0}"));
    if noted.identity != now_open.identity {
        return Some(format!("the history file was removed or replaced: its records are not in this one{until}"));
    }
    let missing = noted.number.checked_sub(now_open.number).filter(|missing| *missing > 0)?;
    let since = now_open.at.map_or(String::new(), |at| format!(" from {at:.0}"));
    let until = noted.at.map_or(String::new(), |at| format!(" to {at:.0}"));
    Some(format!("the last {missing} commits of the history are missing,{since}{until}: its log was cut"))
}

/// Numbers of fixed width, and one that belongs to them: a torn line is noticed.
fn line(last: &LastCommit) -> String {
    let LastCommit { identity, number, at } = *last;
    let at = at.map_or(0, |at| at.as_microsecond().cast_unsigned());
    format!("{identity:020} {number:020} {at:020} {:020}\n", sum(identity, number, at))
}

fn parse(text: &str) -> Option<LastCommit> {
    let numbers: Vec<u64> = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    let [identity, number, at, check] = numbers[..] else { return None };
    let at_micros = Some(at as i64).filter(|at| *at != 0);
    let at_known = match at_micros {
        Some(micros) => Some(Timestamp::from_microsecond(micros).ok()?),
        None => None,
    };
    (check == sum(identity, number, at)).then_some(LastCommit { identity, number, at: at_known })
}

fn sum(identity: u64, number: u64, at: u64) -> u64 {
    identity.rotate_left(17).wrapping_add(number.rotate_left(7)).wrapping_add(at) ^ 0x5347_4C53
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::report::testing::sec;

    const LAST: LastCommit = LastCommit { identity: 7, number: 300, at: None };

    #[test]
    fn the_last_commit_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let db = folder.path().join("x.duckdb");
        assert_eq!(read(&db), Noted::Nothing);
        let last = LastCommit { at: Some(sec(-1)), ..LAST };
        for last in [LAST, last, LastCommit { number: u64::MAX, identity: u64::MAX, ..last }] {
            write(&db, &last).unwrap();
            assert_eq!(read(&db), Noted::Commit(last));
        }
        let whole = std::fs::read(path(&db)).unwrap();
        for cut in 0..whole.len() - 1 {
            std::fs::write(path(&db), &whole[..cut]).unwrap();
            assert_eq!(read(&db), Noted::Unreadable, "cut at {cut}");
        }
        for place in 0..whole.len() - 1 {
            let mut flipped = whole.clone();
            flipped[place] ^= 1;
            std::fs::write(path(&db), flipped).unwrap();
            assert_eq!(read(&db), Noted::Unreadable, "flipped at {place}");
        }
    }

    #[test]
    fn the_first_note_is_there_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let db = folder.path().join("x.duckdb");
        // As on a full disk, nothing can be written beside it.
        let beside = with_suffix(&path(&db), &format!(".new-{}", std::process::id()));
        std::fs::create_dir(&beside).unwrap();
        assert!(write(&db, &LAST).is_err());
        assert_eq!(read(&db), Noted::Nothing);
        std::fs::remove_dir(&beside).unwrap();
        write(&db, &LAST).unwrap();
        std::fs::create_dir(&beside).unwrap();
        let later = LastCommit { number: 301, ..LAST };
        write(&db, &later).unwrap();
        assert_eq!(read(&db), Noted::Commit(later), "in place");
    }

    #[test]
    fn what_is_missing_is_named_and_what_is_newer_is_no_loss() {
        let at = |number, second| LastCommit { number, at: Some(sec(second)), ..LAST };
        let words = |noted: LastCommit, open: LastCommit| missing(&Noted::Commit(noted), &open);
        assert_eq!(words(at(300, 300), at(300, 300)), None);
        // The power failed between the commit and the note of it.
        assert_eq!(words(at(300, 300), at(301, 301)), None);
        assert_eq!(
            words(at(300, 300), at(57, 57)).unwrap(),
            "the last 243 commits of the history are missing, from 1970-01-01T00:00:57Z to 1970-01-01T00:05:00Z: \
             its log was cut"
        );
        let other = LastCommit { identity: 8, ..at(400, 400) };
        assert!(words(at(300, 300), other).unwrap().contains("removed or replaced"));
        assert_eq!(missing(&Noted::Nothing, &LAST), None);
        assert!(missing(&Noted::Unreadable, &LAST).is_some());
    }
}
