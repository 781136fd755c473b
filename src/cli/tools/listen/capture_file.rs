//! The file that what is heard is saved in for Wireshark, as it grows.

use std::{
    fs::File,
    io::Write,
    path::{Path, PathBuf},
};

use crate::{
    bus::capture::Capture,
    cli::{CliError, say, say_error},
    plant::traffic::Frame,
};

/// Such a file ends at this size; listening goes on.
const BYTES_MAX: u64 = 1 << 30;

pub(super) struct CaptureFile {
    path: PathBuf,
    file: File,
    capture: Capture,
    bytes: u64,
    frames: u64,
    /// Why no more frames are saved.
    problem: Option<String>,
}

impl CaptureFile {
    /// A new file; one that is there already stays as it is.
    pub fn create(path: &Path) -> Result<CaptureFile, CliError> {
        let file = File::create_new(path).map_err(CliError::io(format!("cannot create {}", path.display())))?;
        let (capture, head) = Capture::begin();
        let path = path.to_owned();
        let mut created = CaptureFile { path, file, capture, bytes: 0, frames: 0, problem: None };
        created.write(&head);
        Ok(created)
    }

    /// Saves one more frame, whole and at once: the file can be opened at any time.
    pub fn add(&mut self, frame: &Frame) {
        let packet = self.capture.packet(frame);
        if self.problem.is_none() {
            self.write(&packet);
            self.frames += u64::from(self.problem.is_none());
        }
    }

    fn write(&mut self, bytes: &[u8]) {
        let size = self.bytes + bytes.len() as u64;
        let problem = if BYTES_MAX < size {
            Some(format!("it is full, {} MiB", BYTES_MAX >> 20))
        } else {
            self.file.write_all(bytes).err().map(|error| error.to_string())
        };
        match &problem {
            Some(why) => say_error(&format!("{}: no more frames are saved: {why}", self.path.display())),
            None => self.bytes = size,
        }
        self.problem = problem;
    }

    /// Says what it holds; an error, if frames are missing.
    pub fn end(self) -> Result<(), CliError> {
        let words = format!("{}: {} frames saved", self.path.display(), self.frames);
        match self.problem {
            Some(why) => Err(CliError::Failed(format!("{words}, then no more: {why}"))),
            None => {
                say(&words);
                Ok(())
            }
        }
    }
}
