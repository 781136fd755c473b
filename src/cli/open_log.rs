//! What `sightglass open` watches and logs from the start.

use std::{
    fs,
    path::{Path, PathBuf},
};

use jiff::SignedDuration;

use super::{CliError, say, span};
use crate::{
    report::value_log::reader,
    ui::{msg::Start, tabs::registers::parse_watched},
};

/// The largest log that is read: days of values.
const LOG_MAX: u64 = 256 << 20;

/// What is watched and logged.
#[derive(Debug, clap::Args)]
pub struct WatchArgs {
    /// Watch a register from the start: NAME=ADDRESS[:COUNT] [TYPE] [ORDER] [SCALE] [UNIT], such as
    /// 'SV=41003 int16 0.1 °C'; again for more
    #[arg(long, value_name = "REGISTER")]
    watch: Vec<String>,
    /// Log what is watched to a new CSV file, a row for each read
    #[arg(long, value_name = "FILE", requires = "watch")]
    log: Option<PathBuf>,
    /// Time between two reads [default: 1s]
    #[arg(long, value_name = "TIME", value_parser = period)]
    every: Option<SignedDuration>,
}

impl WatchArgs {
    /// What the registers begin with.
    pub fn start(&self) -> Result<Start, CliError> {
        let watch = parse_watched(&self.watch).map_err(|why| CliError::Usage(format!("--watch: {why}")))?;
        if let Some(log) = self.log.as_ref().filter(|log| log.exists()) {
            let why = "a file of this name already exists and is not changed";
            return Err(CliError::Usage(format!("--log: {}: {why}", log.display())));
        }
        Ok(Start { watch, log: self.log.clone(), every: self.every, shown: None })
    }

    /// Says what the file of the log holds when all is over.
    pub fn say_written(&self) {
        self.log.iter().for_each(|log| say(&written(log)));
    }
}

/// Reads a log to show.
pub fn read(path: &Path) -> Result<Start, CliError> {
    let failed = |why: String| CliError::Failed(format!("{}: {why}", path.display()));
    let size = fs::metadata(path).map_err(|error| failed(error.to_string()))?.len();
    if LOG_MAX < size {
        return Err(failed(format!("found {} MiB, expected a log of at most {} MiB", size >> 20, LOG_MAX >> 20)));
    }
    let bytes = fs::read(path).map_err(|error| failed(error.to_string()))?;
    let log = reader::parse(&bytes).map_err(failed)?;
    if log.rows == 0 {
        let problems = log.problems.into_iter().next().unwrap_or_else(|| "it has no rows".to_owned());
        return Err(failed(problems));
    }
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    Ok(Start { shown: Some((file, log)), ..Start::default() })
}

/// What the file of a log holds when all is over.
fn written(log: &Path) -> String {
    match fs::read(log) {
        Ok(bytes) => {
            let rows = bytes.iter().filter(|byte| **byte == b'\n').count().saturating_sub(1);
            format!("{}: rows written: {rows}", log.display())
        }
        Err(error) => format!("{}: nothing was written: {error}", log.display()),
    }
}

/// A time that the registers can be read at.
fn period(text: &str) -> Result<SignedDuration, String> {
    let (least, most) = (SignedDuration::from_millis(200), SignedDuration::from_secs(60));
    let period = span(text).ok().and_then(|span| SignedDuration::try_from(span).ok());
    let wrong = || format!("found `{text}`, expected 200ms to 60s");
    period.filter(|period| (least..=most).contains(period)).ok_or_else(wrong)
}
