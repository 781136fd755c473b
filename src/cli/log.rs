//! The log: a file, never the screen that the interface draws on.

use std::{
    io::{self, Write},
    os::unix::fs::FileTypeExt,
    path::{Path, PathBuf},
    sync::mpsc::Receiver,
};

use tracing_appender::{
    non_blocking::WorkerGuard,
    rolling::{self, RollingFileAppender},
};
use tracing_subscriber::{
    filter::{LevelFilter, Targets},
    fmt,
    layer::SubscriberExt,
    util::SubscriberInitExt,
};

use super::{CliError, own_files, paths};
use crate::{
    bus::io::worker::{HANG_MAX, within},
    plant::visible::visible,
};

/// Days of logs that are kept.
const DAYS: usize = 7;

/// Starts logging; the guard writes what is left when it is dropped. `SIGHTGLASS_LOG` sets the level (`debug`);
/// the file `-` is standard error, for an init system that keeps it. A disk that does not take the log is no error: a
/// station must poll all the same. Refuses the files of the station with this history.
pub fn start(file: Option<&Path>, history: Option<&Path>) -> Result<WorkerGuard, CliError> {
    let (writer, guard) = match file {
        Some(file) if file.as_os_str() == "-" => tracing_appender::non_blocking(Visible(io::stderr())),
        _ => tracing_appender::non_blocking(Visible(LogFile::open(file, history)?)),
    };
    init(writer);
    Ok(guard)
}

/// The file of the log, or none while it cannot be opened: lines are dropped then, and each tries again.
struct LogFile {
    path: Option<PathBuf>,
    file: Option<RollingFileAppender>,
    /// Where it comes from once its disk responds.
    late: Option<Receiver<Result<LogFile, CliError>>>,
}

impl LogFile {
    /// Opens it; a disk that hangs is not waited for.
    fn open(path: Option<&Path>, history: Option<&Path>) -> Result<LogFile, CliError> {
        let (own, history) = (path.map(Path::to_path_buf), history.map(Path::to_path_buf));
        within(HANG_MAX, move || LogFile::open_now(own.as_deref(), history.as_deref())).unwrap_or_else(|late| {
            let _ = writeln!(io::stderr(), "sightglass: the disk of the log does not respond; no log until it does");
            Ok(LogFile { path: None, file: None, late: Some(late) })
        })
    }

    fn open_now(path: Option<&Path>, history: Option<&Path>) -> Result<LogFile, CliError> {
        if let (Some(file), Some(history)) = (path, history) {
            own_files::refuse(file, history)?;
        }
        let file = match appender(path) {
            Err(error @ CliError::Io { .. }) => {
                // Without standard error there is no place to say it.
                let _ = writeln!(io::stderr(), "sightglass: {error}; no log until this is corrected");
                None
            }
            opened => Some(opened?),
        };
        Ok(LogFile { path: path.map(Path::to_path_buf), file, late: None })
    }
}

impl Write for LogFile {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if let Some(late) = &self.late {
            // One that is refused stays without lines.
            let Ok(Ok(opened)) = late.try_recv() else { return Ok(line.len()) };
            *self = opened;
        }
        if self.file.is_none() {
            self.file = appender(self.path.as_deref()).ok();
        }
        self.file.as_mut().map_or(Ok(line.len()), |file| file.write(line))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), Write::flush)
    }
}

/// Opens the file: this one, or one a day in the folder of the state.
fn appender(path: Option<&Path>) -> Result<RollingFileAppender, CliError> {
    let failed = |folder: &Path, error: io::Error| CliError::Io {
        what: format!("cannot write a log in {}", folder.display()),
        error,
    };
    let (folder, builder) = match path {
        Some(path) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf);
            let name = path.file_name().ok_or_else(|| CliError::Usage("--log: expected a file name".into()))?;
            if !folder.is_dir() {
                return Err(CliError::Usage(format!("--log: no folder {}", folder.display())));
            }
            (folder, rolling::Builder::new().filename_prefix(name.to_string_lossy()))
        }
        None => {
            let folder = paths::state_folder();
            std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, error))?;
            let builder = rolling::Builder::new().rotation(rolling::Rotation::DAILY).filename_prefix("sightglass");
            (folder, builder.filename_suffix("log").max_log_files(DAYS))
        }
    };
    // The appender would wait for whoever reads a pipe.
    let today = jiff::Timestamp::now().strftime("sightglass.%Y-%m-%d.log").to_string();
    let name = path.map_or_else(|| folder.join(today), Path::to_path_buf);
    if std::fs::metadata(&name).is_ok_and(|there| there.file_type().is_fifo() || there.file_type().is_socket()) {
        return Err(failed(&name, io::Error::other("not a regular file")));
    }
    builder.build(&folder).map_err(|error| failed(&folder, io::Error::other(error)))
}

/// Writes a line at a time; nothing in it acts on the terminal in which the log is read.
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
    let level = std::env::var("SIGHTGLASS_LOG").ok().and_then(|level| level.parse::<Targets>().ok());
    let level = level.unwrap_or_else(|| Targets::new().with_default(LevelFilter::INFO));
    let log = fmt().with_writer(writer).with_ansi(false).with_max_level(LevelFilter::TRACE).finish();
    // A second start in one process (tests) keeps the first log.
    let _ = log.with(level).try_init();
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_log_is_written_once_its_disk_responds() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("x.log");
        let (sender, late) = channel();
        let mut log = LogFile { path: None, file: None, late: Some(late) };
        assert_eq!(log.write(b"early\n").expect("dropped"), 6);
        sender.send(LogFile::open_now(Some(&path), None)).expect("awaited");
        log.write_all(b"late\n").and_then(|()| log.flush()).expect("written");
        assert_eq!(std::fs::read_to_string(&path).expect("a log"), "late\n");
    }
}
