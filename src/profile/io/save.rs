//! Writes settings into the plant file: the whole file beside it, then renamed over it.

use std::{
    fs::{self, File},
    io::Write,
    os::unix::fs::{MetadataExt, fchown},
    path::{Path, PathBuf},
};

use super::{atomic, read, regular};
use crate::{plant::def::LineDef, profile::edit};

/// The plant file as it was when the plant was loaded or last saved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlantFile {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl PlantFile {
    pub(super) fn new(path: &Path, bytes: &[u8]) -> PlantFile {
        // A link stays a link: what it points to is written.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        PlantFile { path, bytes: bytes.to_vec() }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is in it: as it was loaded or last saved.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Puts the settings of a line into the file; everything else in it stays as it is, comments included. `Err` says in
    /// words for the operator why nothing was written: the file has changed since, cannot be written, or the settings
    /// cannot be written in it. Blocks while the disk works.
    pub fn save(&mut self, settings: &LineDef) -> Result<(), String> {
        let file = self.path.display();
        let now = read(&self.path).map_err(|why| format!("{file} cannot be read: {why}"))?;
        if now != self.bytes {
            return Err(format!("{file} was changed since this station has started; restart it first"));
        }
        let text = std::str::from_utf8(&now).map_err(|_| format!("{file} is not UTF-8"))?;
        let text = edit::with_line(text, settings)?;
        self.replace(text.as_bytes()).map_err(|error| format!("{file} cannot be written: {error}"))?;
        self.bytes = text.into_bytes();
        Ok(())
    }

    /// Whoever loses power now finds the old file or the new one, never half of one. Owner, group and mode stay.
    fn replace(&self, bytes: &[u8]) -> std::io::Result<()> {
        // A file that may not be written is not to be replaced either, although its folder would allow it.
        let metadata = regular::open_with(File::options().append(true), &self.path)?.metadata()?;
        if metadata.permissions().readonly() {
            return Err(std::io::Error::new(std::io::ErrorKind::PermissionDenied, "it is read-only"));
        }
        let beside = atomic::beside(&self.path);
        let written = match write_whole(&beside, bytes, &metadata) {
            // Only root may give a file away: that of another owner is written in place. Should that fail half-way, the
            // copy beside it stays.
            Ok(false) => return overwrite(&self.path, bytes).and_then(|()| fs::remove_file(&beside)),
            Ok(true) => fs::rename(&beside, &self.path),
            Err(error) => Err(error),
        };
        if written.is_err() {
            // What was begun is of no use to anybody.
            let _ = fs::remove_file(&beside);
        }
        written?;
        // The new file is there; only a loss of power right now could still bring the old one back.
        if let Err(error) = atomic::sync_folder(&self.path) {
            tracing::warn!(%error, file = %self.path.display(), "its folder could not be synced");
        }
        Ok(())
    }
}

/// Writes a new file with the mode of `old`, and its owner and group where that is permitted: `false` if it is not.
fn write_whole(path: &Path, bytes: &[u8], old: &fs::Metadata) -> std::io::Result<bool> {
    let file = atomic::write_beside(path, bytes, 0o600)?;
    let new = file.metadata()?;
    let (other_user, other_group) = (new.uid() != old.uid(), new.gid() != old.gid());
    let given = fchown(&file, other_user.then(|| old.uid()), other_group.then(|| old.gid()));
    file.set_permissions(old.permissions())?;
    file.sync_all()?;
    Ok(given.is_ok())
}

fn overwrite(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = regular::open_with(File::options().write(true).truncate(true), path)?;
    file.write_all(bytes)?;
    file.sync_all()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;
    use crate::{
        plant::def::{Serial, Transport},
        profile::{Search, load, load_with_file},
    };

    const TEXT: &str = "\
title = \"Small\" # one line, one device
time_zone = \"UTC\"

[[line]]
name = \"L1\"
mode = \"rtu\"
port = \"/dev/ttyUSB0\" # the blue adapter
baud = 9600
parity = \"N\"

[[device]]
name = \"TIC-1\"
profile = \"fuji_pxr\"
line = \"L1\"
unit = 1
";

    struct Plant {
        _folder: tempfile::TempDir,
        path: PathBuf,
        file: PlantFile,
        line: LineDef,
    }

    fn plant() -> Plant {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.toml");
        fs::write(&path, TEXT).unwrap();
        let (def, file) = load_with_file(&path, &Search::shipped()).unwrap();
        let serial = Serial { baud: 19_200, ..Serial::USUAL };
        let line = LineDef { transport: Transport::rtu("/dev/ttyUSB0", serial), ..def.lines[0].clone() };
        Plant { _folder: folder, path, file: file.unwrap(), line }
    }

    #[test]
    fn what_is_saved_is_what_is_loaded_next_time() {
        let mut plant = plant();
        fs::set_permissions(&plant.path, fs::Permissions::from_mode(0o640)).unwrap();
        assert_eq!(plant.file.save(&plant.line), Ok(()));
        assert_eq!(load(&plant.path, &Search::shipped()).unwrap().lines, [plant.line.clone()]);
        assert_eq!(fs::read_to_string(&plant.path).unwrap(), TEXT.replace("9600", "19200"));
        assert_eq!(fs::metadata(&plant.path).unwrap().permissions().mode() & 0o777, 0o640);
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let names: Vec<_> = fs::read_dir(plant.path.parent().unwrap()).unwrap().map(name).collect();
        assert_eq!(names, ["small.toml"], "nothing is left beside it");
        // And again, on what was just written.
        plant.line.timeout = std::time::Duration::from_millis(700);
        assert_eq!(plant.file.save(&plant.line), Ok(()));
        assert_eq!(load(&plant.path, &Search::shipped()).unwrap().lines, [plant.line]);
    }

    /// A file that only root may give away is given away by root alone, so for others this is about the mode.
    #[test]
    fn a_saved_plant_file_keeps_its_owner() {
        let mut plant = plant();
        let root = rustix::process::geteuid().is_root();
        let (user, group) = if root { (Some(4_711), Some(4_712)) } else { (None, None) };
        std::os::unix::fs::chown(&plant.path, user, group).unwrap();
        fs::set_permissions(&plant.path, fs::Permissions::from_mode(0o664)).unwrap();
        let owner =
            |path: &Path| fs::metadata(path).map(|file| (file.uid(), file.gid(), file.mode() & 0o7777)).unwrap();
        let before = owner(&plant.path);
        assert_eq!(plant.file.save(&plant.line), Ok(()));
        assert_eq!(owner(&plant.path), before);
        overwrite(&plant.path, TEXT.as_bytes()).unwrap();
        assert_eq!((owner(&plant.path), fs::read_to_string(&plant.path).unwrap()), (before, TEXT.to_owned()));
    }

    #[test]
    fn changes_by_others_are_not_overwritten() {
        let mut plant = plant();
        let other = TEXT.replace("Small", "Large");
        fs::write(&plant.path, &other).unwrap();
        let refused = plant.file.save(&plant.line);
        assert!(refused.as_ref().is_err_and(|why| why.contains("was changed since")), "{refused:?}");
        assert_eq!(fs::read_to_string(&plant.path).unwrap(), other);
    }

    #[test]
    fn a_read_only_file_stays_as_it_is() {
        let mut plant = plant();
        fs::set_permissions(&plant.path, fs::Permissions::from_mode(0o444)).unwrap();
        let refused = plant.file.save(&plant.line);
        assert!(refused.as_ref().is_err_and(|why| why.contains("cannot be written")), "{refused:?}");
        assert_eq!(fs::read_to_string(&plant.path).unwrap(), TEXT);
    }

    #[test]
    fn a_link_stays_a_link() {
        let plant = plant();
        let link = plant.path.with_file_name("link.toml");
        symlink(&plant.path, &link).unwrap();
        let (_, file) = load_with_file(&link, &Search::shipped()).unwrap();
        assert_eq!(file.unwrap().save(&plant.line), Ok(()));
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::read_to_string(&plant.path).unwrap().contains("19200"));
    }

    #[test]
    fn a_plant_of_the_program_has_no_file() {
        let (_, file) = load_with_file(Path::new("tank"), &Search::shipped()).unwrap();
        assert_eq!(file, None);
    }
}
