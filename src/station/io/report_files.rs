//! The files of automatic reports: whole or not there, never in the place of another, and each with its checksum beside it.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use crate::{
    access::audit_log::sha256,
    history::io::disk::step,
    profile::io::{
        atomic::{remove_left_over, sync_folder, with_suffix, write_for_user, write_new},
        regular,
    },
};

/// Names that are tried where one is taken: `NAME.csv`, `NAME-2.csv`, …
const NAMES_MAX: usize = 99;
/// Is appended to the name of a file for that of its checksum.
pub const CHECKSUM: &str = ".sha256";

/// The checksum of a file as `sha256sum` writes and checks it.
pub fn checksum_line(path: &Path, sha256: &str) -> String {
    format!("{sha256}  {}\n", path.file_name().unwrap_or_default().to_string_lossy())
}

/// Writes the checksum of a file that a person has had written, in the place of an older one.
pub fn write_checksum(path: &Path, bytes: &[u8]) -> io::Result<()> {
    write_for_user(&with_suffix(path, CHECKSUM), checksum_line(path, &sha256(bytes)).as_bytes())
}

/// Many times the longest report.
const BYTES_MAX: u64 = 256 << 20;

/// What is larger than any report, a folder or a pipe belongs to someone else.
const NONE_OF_OURS: [io::ErrorKind; 3] =
    [io::ErrorKind::FileTooLarge, io::ErrorKind::InvalidInput, io::ErrorKind::IsADirectory];

/// What lies at a path.
#[derive(PartialEq)]
enum There {
    Nothing,
    Same,
    Other,
}

fn there(path: &Path, bytes: &[u8]) -> io::Result<There> {
    match regular::read(path, BYTES_MAX) {
        Ok(found) if found == bytes => Ok(There::Same),
        Ok(_) => Ok(There::Other),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(There::Nothing),
        Err(error) if NONE_OF_OURS.contains(&error.kind()) => Ok(There::Other),
        Err(error) => Err(error),
    }
}

/// Writes a report and its checksum into a folder. A file that is there already with the same bytes is the report itself: a
/// station was killed before it was on record. One with other bytes belongs to someone else and stays: the next name is taken.
/// Gives its path, and whether it is new. Blocks while the disk works.
pub fn place(folder: &Path, stem: &str, ending: &str, bytes: &[u8]) -> io::Result<(PathBuf, bool)> {
    step("folder of reports")?;
    fs::create_dir_all(folder)?;
    let sha256 = sha256(bytes);
    for number in 1..=NAMES_MAX {
        let more = if number == 1 { String::new() } else { format!("-{number}") };
        let path = folder.join(format!("{stem}{more}{ending}"));
        let (checksum, line) = (with_suffix(&path, CHECKSUM), checksum_line(&path, &sha256));
        let found = (there(&path, bytes)?, there(&checksum, line.as_bytes())?);
        if found.0 == There::Other || found.1 == There::Other {
            continue;
        }
        if found.0 == There::Nothing && !put(&path, bytes)? {
            continue;
        }
        if found.1 == There::Nothing && !put(&checksum, line.as_bytes())? {
            continue;
        }
        // A station that was killed just after it had put them there has left them beside it, too.
        [&path, &checksum].into_iter().for_each(|path| remove_left_over(path));
        return Ok((path, found.0 == There::Nothing));
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, format!("{stem}{ending} and {NAMES_MAX} more names are taken")))
}

/// `false` where another file has just come.
fn put(path: &Path, bytes: &[u8]) -> io::Result<bool> {
    step("report file")?;
    match write_new(path, bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(error),
    }
}

/// Deletes a report with its checksum; `false` leaves alone what is not as the station wrote it. A file that is gone is deleted.
pub fn delete(path: &Path, sha: &str) -> io::Result<bool> {
    step("delete report")?;
    match regular::read(path, BYTES_MAX) {
        Ok(bytes) if sha256(&bytes) != sha => return Ok(false),
        Ok(_) => fs::remove_file(path)?,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) if NONE_OF_OURS.contains(&error.kind()) => {
            return Ok(false);
        }
        Err(error) => return Err(error),
    }
    step("delete checksum")?;
    let checksum = with_suffix(path, CHECKSUM);
    if regular::read(&checksum, BYTES_MAX).is_ok_and(|line| line == checksum_line(path, sha).as_bytes()) {
        fs::remove_file(&checksum)?;
    }
    // Where the folder is gone too, nothing is left to sync.
    if path.parent().is_some_and(Path::exists) { sync_folder(path) } else { Ok(()) }.map(|()| true)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::{cell::Cell, rc::Rc};

    use super::*;
    use crate::history::io::disk::testing::seen;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().file_name());
        let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn what_a_killed_station_left_beside_a_whole_report_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let placed = || place(folder.path(), "day", ".csv", b"1").unwrap().1;
        assert!(placed());
        // No process has this number.
        for name in ["day.csv.new-2147483647", "day.csv.sha256.new-2147483647"] {
            fs::write(folder.path().join(name), b"1").unwrap();
        }
        assert!(!placed(), "it is there already");
        assert_eq!(names(folder.path()), ["day.csv", "day.csv.sha256"]);
    }

    /// Fails at the step of this number, from 0; gives the result.
    fn stopped_at<T>(number: usize, work: impl FnOnce() -> T) -> T {
        let steps = Rc::new(Cell::new(0));
        let hook = move |_: &'static str| {
            steps.set(steps.get() + 1);
            if steps.get() == number + 1 { Err(io::Error::from(io::ErrorKind::StorageFull)) } else { Ok(()) }
        };
        seen(hook, work)
    }

    #[test]
    fn a_report_that_was_interrupted_at_any_step_is_there_once() {
        for number in 0..4 {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("reports");
            let write = || place(&path, "2026-11-21-morning", ".csv", b"figures");
            let first = stopped_at(number, write);
            assert_eq!(first.is_err(), number < 3, "the fourth step does not exist");
            let (file, is_new) = write().unwrap();
            assert_eq!((file, is_new), (path.join("2026-11-21-morning.csv"), number < 2), "killed at {number}");
            let again = (path.join("2026-11-21-morning.csv"), false);
            assert_eq!(write().unwrap(), again, "once more changes nothing");
            assert_eq!(names(&path), ["2026-11-21-morning.csv", "2026-11-21-morning.csv.sha256"]);
            let line = fs::read_to_string(path.join("2026-11-21-morning.csv.sha256")).unwrap();
            assert_eq!(line, format!("{}  2026-11-21-morning.csv\n", sha256(b"figures")));
        }
    }

    #[test]
    fn a_file_of_the_same_name_is_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("day.csv"), "mine").unwrap();
        fs::write(at("day-2.csv.sha256"), "mine, too").unwrap();
        fs::create_dir(at("day-3.csv")).unwrap();
        let made = || place(folder.path(), "day", ".csv", b"figures").unwrap().0;
        assert_eq!((made(), made()), (at("day-4.csv"), at("day-4.csv")));
        assert_eq!(fs::read_to_string(at("day.csv")).unwrap(), "mine");
        assert_eq!(fs::read_to_string(at("day-2.csv.sha256")).unwrap(), "mine, too");
    }

    #[test]
    fn only_an_unchanged_report_is_deleted() {
        let folder = tempfile::tempdir().unwrap();
        let sha = sha256(b"figures");
        for number in 0..3 {
            let (path, _) = place(folder.path(), "day", ".csv", b"figures").unwrap();
            let first = stopped_at(number, || delete(&path, &sha));
            assert_eq!(first.is_err(), number < 2);
            assert!(delete(&path, &sha).unwrap());
            assert_eq!(names(folder.path()), [""; 0]);
        }
        let (path, _) = place(folder.path(), "day", ".csv", b"figures").unwrap();
        fs::write(&path, "changed").unwrap();
        assert!(!delete(&path, &sha).unwrap());
        assert_eq!(names(folder.path()), ["day.csv", "day.csv.sha256"]);
    }
}
