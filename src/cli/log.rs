//! The log: a file, never the screen that the interface draws on.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use tracing_appender::{non_blocking::WorkerGuard, rolling};
use tracing_subscriber::{EnvFilter, fmt};

use super::{CliError, paths};
use crate::plant::visible::visible;

/// Days of logs that are kept.
const DAYS: usize = 7;

/// Starts logging; the guard writes what is left when it is dropped. `SIGHTGLASS_LOG` sets the level (`debug`);
/// the file `-` is standard error, for an init system that keeps it.
pub fn start(file: Option<&Path>) -> Result<WorkerGuard, CliError> {
    let failed = |folder: &Path, error: std::io::Error| CliError::Io {
        what: format!("cannot write a log in {}", folder.display()),
        error,
    };
    if file.is_some_and(|file| file.as_os_str() == "-") {
        let (writer, guard) = tracing_appender::non_blocking(Visible(std::io::stderr()));
        init(writer);
        return Ok(guard);
    }
    let writer = match file {
        Some(file) => {
            let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf);
            let name = file.file_name().ok_or_else(|| CliError::Usage("--log: expected a file name".into()))?;
            if !folder.is_dir() {
                return Err(CliError::Usage(format!("--log: no folder {}", folder.display())));
            }
            rolling::Builder::new()
                .filename_prefix(name.to_string_lossy())
                .build(&folder)
                .map_err(|error| failed(&folder, std::io::Error::other(error)))?
        }
        None => {
            let folder = paths::state_folder();
            std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, error))?;
            rolling::Builder::new()
                .rotation(rolling::Rotation::DAILY)
                .filename_prefix("sightglass")
                .filename_suffix("log")
                .max_log_files(DAYS)
                .build(&folder)
                .map_err(|error| failed(&folder, std::io::Error::other(error)))?
        }
    };
    let (writer, guard) = tracing_appender::non_blocking(Visible(writer));
    init(writer);
    Ok(guard)
}

/// Whoever reads the log in a terminal must not be played tricks by what stands in it. A line is written at a time.
struct Visible<W>(W);

impl<W: Write> Write for Visible<W> {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.0.write_all(visible(&String::from_utf8_lossy(line)).as_bytes())?;
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

fn init(writer: tracing_appender::non_blocking::NonBlocking) {
    let level = EnvFilter::try_from_env("SIGHTGLASS_LOG").unwrap_or_else(|_| EnvFilter::new("info"));
    // A second start in one process (tests) keeps the first log.
    let _ = fmt().with_writer(writer).with_ansi(false).with_env_filter(level).try_init();
}
