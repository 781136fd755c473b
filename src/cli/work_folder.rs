//! The folder that a command works in: it goes with the command, or, where that was killed, at the start of the next one.

use std::{
    fs,
    os::unix::fs::DirBuilderExt,
    path::{Path, PathBuf},
};

use super::{CliError, say_error};
use crate::profile::io::atomic::is_gone;

/// The folder of a process, with its number. No other program's is called so: it is removed unasked.
const WORK_FOLDER: &str = ".sightglass-command-";

/// Removes the folders of killed processes, of this user: others are not to be removed.
fn remove_leftovers(temporary: &Path) {
    for entry in fs::read_dir(temporary).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let process = name.to_str().and_then(|name| name.strip_prefix(WORK_FOLDER)?.parse().ok());
        if process.is_some_and(is_gone) && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// A folder that is removed with this.
pub struct WorkFolder(PathBuf);

impl WorkFolder {
    /// An empty one.
    pub fn new() -> Result<WorkFolder, CliError> {
        let path = std::env::temp_dir().join(format!("{WORK_FOLDER}{}", std::process::id()));
        remove_leftovers(&std::env::temp_dir());
        let made = fs::DirBuilder::new().mode(0o700).create(&path);
        made.map_err(CliError::io(format!("cannot create {}", path.display())))?;
        Ok(WorkFolder(path))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for WorkFolder {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_dir_all(&self.0) {
            say_error(&format!("{} is not removed: {error}", self.0.display()));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn folders_of_killed_processes_are_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let own = std::process::id().to_string();
        // No process has the highest number there is.
        for name in ["2147483647", &own, "x"] {
            fs::create_dir_all(folder.path().join(format!("{WORK_FOLDER}{name}/below"))).expect("a folder");
        }
        fs::write(folder.path().join(format!("{WORK_FOLDER}2147483646")), "a file").expect("a file");
        // The sockets of stations of user 2147483647, without a folder of the system for them.
        fs::create_dir(folder.path().join("sightglass-2147483647")).expect("a folder");
        remove_leftovers(folder.path());
        let names = fs::read_dir(folder.path()).expect("a folder").flatten().map(|entry| entry.file_name());
        let left: BTreeSet<_> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        let mut expect: BTreeSet<_> = ["2147483646", &own, "x"].map(|number| format!("{WORK_FOLDER}{number}")).into();
        expect.insert("sightglass-2147483647".into());
        assert_eq!(left, expect);
    }
}
