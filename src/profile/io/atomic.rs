//! Files that are whole or not there: written beside, synced, then renamed.

use std::{
    ffi::OsString,
    fs::{self, File, OpenOptions},
    io::{self, Write},
    os::unix::fs::OpenOptionsExt,
    path::{Path, PathBuf},
};

use rustix::{io::Errno, process};

use super::regular;

/// Writes a file with these rights: a loss of power now leaves the old one or the new one. Blocks while the disk works.
///
/// A link stays a link, and what is no file, such as `/dev/null`, is written as it is.
pub fn write_atomic(path: &Path, bytes: &[u8], mode: u32) -> io::Result<()> {
    let path = &followed(path);
    if is_no_file(path) {
        return fs::write(path, bytes);
    }
    write_placed(path, bytes, mode, |_, new| fs::rename(new, path)).map(drop)
}

/// The file that a link leads to.
fn followed(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// Is there something that is neither a file nor a folder, such as `/dev/null` or a pipe?
fn is_no_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// Writes and syncs a new file beside `path`, has `place` put it there by a rename or a link, and syncs the folder. On an
/// error nothing is left of the new file.
pub fn write_placed(
    path: &Path,
    bytes: &[u8],
    mode: u32,
    place: impl FnOnce(&File, &Path) -> io::Result<()>,
) -> io::Result<File> {
    let new = beside(path);
    let written = write_beside(&new, bytes, mode).and_then(|file| place(&file, &new).map(|()| file));
    // After a rename there is nothing left to remove.
    let _ = fs::remove_file(&new);
    let file = written?;
    sync_folder(path)?;
    Ok(file)
}

/// `path` with `suffix` appended to its name: `tank.duckdb.wal` beside `tank.duckdb`.
pub fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// The same for a file of the user; its folder is made if it is not there.
pub fn write_for_user(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder(path))?;
    write_atomic(path, bytes, 0o640)
}

/// The same with the bytes of another file.
pub fn copy_for_user(from: &Path, path: &Path) -> io::Result<()> {
    fs::create_dir_all(folder(path))?;
    let path = &followed(path);
    if is_no_file(path) {
        return io::copy(&mut regular::open(from)?, &mut OpenOptions::new().write(true).open(path)?).map(drop);
    }
    let new = beside(path);
    let copied =
        regular::copy(from, &new).and_then(|_| File::open(&new)?.sync_all()).and_then(|()| fs::rename(&new, path));
    // After a rename there is nothing left to remove.
    let _ = fs::remove_file(&new);
    copied?;
    sync_folder(path)
}

/// A file that was not there before, whole or not at all; an error where one of its name is there.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    fs::create_dir_all(folder(path))?;
    write_placed(path, bytes, 0o640, |_, new| fs::hard_link(new, path)).map(drop)
}

/// Files that were not there before, all or none; an error names the one that could not be written.
pub fn write_all_new(files: &[(PathBuf, Vec<u8>)]) -> Result<(), (PathBuf, io::Error)> {
    for (n, (path, bytes)) in files.iter().enumerate() {
        if let Err(error) = write_new(path, bytes) {
            // Each of those before was made here.
            files[..n].iter().for_each(|(path, _)| drop(fs::remove_file(path)));
            return Err((path.clone(), error));
        }
    }
    Ok(())
}

/// Where a file is written before it takes the place of `path`. What killed processes have left there is removed.
pub fn beside(path: &Path) -> PathBuf {
    remove_left_over(path);
    path.with_file_name(format!("{}{}", start_of(path), std::process::id()))
}

/// What the name of a file begins with that is written before it takes the place of `path`; then comes the process.
fn start_of(path: &Path) -> String {
    let mut start = path.file_name().map(OsString::from).unwrap_or_default();
    start.push(".new-");
    start.to_string_lossy().into_owned()
}

/// Removes what killed processes have left beside a file.
pub fn remove_left_over(path: &Path) {
    let (start, own) = (start_of(path), std::process::id());
    for entry in fs::read_dir(folder(path)).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let process = name.to_str().and_then(|name| name.strip_prefix(&start)?.parse::<i32>().ok());
        if process.is_some_and(|process| process != own as i32 && is_gone(process)) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether no process has this number.
pub fn is_gone(process: i32) -> bool {
    let process = process::Pid::from_raw(process.max(0));
    process.is_none_or(|process| process::test_kill_process(process) == Err(Errno::SRCH))
}

/// Writes and syncs a new file, never through a link.
pub fn write_beside(path: &Path, bytes: &[u8], mode: u32) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        Ok(()) | Err(_) => {}
    }
    let mut file = OpenOptions::new().write(true).create_new(true).mode(mode).open(path)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    Ok(file)
}

/// Makes the rename in its folder lasting.
pub fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder(path))?.sync_all()
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use rustix::fs::{CWD, FileType, Mode, mknodat};

    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_leftovers_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shift.csv");
        let names = || {
            let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
            let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
            names.sort();
            names
        };
        // No process has the highest number there is; the first one lives as long as the machine.
        for name in ["shift.csv.new-2147483647", "shift.csv.new-1", "shift.csv.new-x", "other.csv.new-2147483647"] {
            fs::write(folder.path().join(name), "left").unwrap();
        }
        for text in ["one", "another"] {
            write_atomic(&path, text.as_bytes(), 0o640).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(names(), ["other.csv.new-2147483647", "shift.csv", "shift.csv.new-1", "shift.csv.new-x"]);
        std::os::unix::fs::symlink(&path, folder.path().join("link")).unwrap();
        write_atomic(&folder.path().join("link"), b"by the link", 0o640).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "by the link");
        write_atomic(Path::new("/dev/null"), b"nothing", 0o640).unwrap();
        // A copy follows the same rules: a link stays a link, and what is no file is written as it is.
        copy_for_user(&path, &folder.path().join("link")).unwrap();
        assert!(fs::symlink_metadata(folder.path().join("link")).unwrap().is_symlink());
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::from_raw_mode(0o600), 0).unwrap();
        let reader = {
            let pipe = pipe.clone();
            std::thread::spawn(move || fs::read_to_string(pipe).unwrap())
        };
        copy_for_user(&path, &pipe).unwrap();
        assert_eq!(reader.join().unwrap(), "by the link");
        assert!(!fs::metadata(&pipe).unwrap().is_file());
        fs::remove_file(&pipe).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file(), "a device stays one");
        fs::create_dir(folder.path().join("taken")).unwrap();
        write_atomic(&folder.path().join("taken"), b"x", 0o640).unwrap_err();
        assert!(names().iter().all(|name| !name.starts_with("taken.new-")), "nothing is left of a try in vain");
    }

    #[test]
    fn several_new_files_are_written_all_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["profile", "plant"].map(|name| (folder.path().join(name), name.into()));
        fs::write(&files[1].0, "another").unwrap();
        let (path, error) = write_all_new(&files).unwrap_err();
        assert_eq!((&path, error.kind()), (&files[1].0, io::ErrorKind::AlreadyExists));
        assert!(!files[0].0.exists(), "a profile without its plant is of no use");
        assert_eq!(fs::read_to_string(&path).unwrap(), "another");
        fs::remove_file(&path).unwrap();
        write_all_new(&files).unwrap();
        assert!(files.iter().all(|(path, _)| path.exists()));
    }
}
