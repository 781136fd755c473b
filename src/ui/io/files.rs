//! Reads and writes the files of the terminal's user.

use std::{
    io,
    path::{Path, PathBuf},
};

use super::Loop;
use crate::{
    profile::io::{
        atomic::{write_all_new, write_for_user, write_new},
        regular,
    },
    register_map,
    station::io::report_files::write_checksum,
    t,
    ui::{Msg, tabs::Tab},
};

/// Most bytes of a file that is loaded.
const LOAD_MAX: u64 = register_map::BYTES_MAX;

/// The file that could not be written, and why.
type Failed = (PathBuf, io::Error);

impl Loop {
    pub(super) fn save(&self, tab: Option<Tab>, path: PathBuf, bytes: Vec<u8>, new: bool) {
        self.write(tab, true, move || {
            let checksum = |saved| {
                let wanted = tab == Some(Tab::Reports);
                if wanted { write_checksum(&path, &bytes) } else { Ok(()) }.map(|()| saved)
            };
            save(&path, &bytes, new).and_then(checksum).map_err(|error| (path, error))
        });
    }

    /// Files that are not there yet, all or none.
    pub(super) fn save_new(&self, tab: Tab, files: Vec<(PathBuf, Vec<u8>)>) {
        self.write(Some(tab), false, move || {
            write_all_new(&files)?;
            let last = files.last().map(|(path, _)| path.clone()).unwrap_or_default();
            std::path::absolute(&last).map_err(|error| (last, error))
        });
    }

    /// Writes beside the screen, and answers what came of it. An export is on record before.
    fn write(
        &self,
        tab: Option<Tab>,
        is_export: bool,
        write: impl FnOnce() -> Result<PathBuf, Failed> + Send + 'static,
    ) {
        let (outbox, plants) = (self.outbox.clone(), self.model.plants);
        let exists = self.model.locale().within(|| t!("a file of this name already exists"));
        tokio::task::spawn_blocking(move || {
            let why = |error: io::Error| match error.kind() {
                io::ErrorKind::AlreadyExists => exists.to_owned(),
                _ => error.to_string(),
            };
            let saved = write().map_err(|(path, error)| (path.display().to_string(), why(error)));
            if let (true, Err((file, why))) = (is_export, &saved) {
                let _ = outbox.blocking_send((plants, Msg::ExportFailed(file.clone(), why.clone())));
            }
            let saved = saved.map_err(|(file, why)| format!("{file}: {why}"));
            let _ = outbox.blocking_send((plants, Msg::Saved(tab, saved)));
        });
    }
}

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
