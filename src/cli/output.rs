//! What a command says: lines to standard output, messages to standard error, and whether all of it arrived.

use std::{
    io::{IsTerminal, Write},
    path::Path,
    sync::OnceLock,
};

use super::CliError;
use crate::{plant::visible::visible, profile};

/// Why the first line that did not reach standard output did not.
static LOST: OnceLock<std::io::Error> = OnceLock::new();

/// Prints one line to standard output. What is lost makes the command fail at its end ([`all_said`]), so that no half table passes
/// for a whole one.
pub(super) fn say(line: &str) {
    if let Err(error) = writeln!(std::io::stdout(), "{}", visible(line)) {
        let _ = LOST.set(error);
    }
}

/// Whether what is said is still read.
pub(super) fn is_read() -> bool {
    LOST.get().is_none()
}

/// `Err` if a line was lost. A reader that has gone away (`| head`) has what it wanted.
pub(super) fn all_said() -> Result<(), CliError> {
    match LOST.get().filter(|error| error.kind() != std::io::ErrorKind::BrokenPipe) {
        Some(error) => Err(CliError::Failed(format!("standard output: {error}"))),
        None => Ok(()),
    }
}

/// Prints a message to standard error.
pub(super) fn say_error(message: &str) {
    let _ = writeln!(std::io::stderr(), "sightglass: {}", visible(message));
}

/// Writes the bytes of a file to standard output: as they are, made visible on a terminal.
pub(super) fn put_out(bytes: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout();
    if out.is_terminal() {
        return out.write_all(visible(&String::from_utf8_lossy(bytes)).as_bytes());
    }
    out.write_all(bytes)
}

/// Writes a file that may be large to standard output.
pub(super) fn put_out_file(path: &Path) -> std::io::Result<()> {
    std::io::copy(&mut std::fs::File::open(path)?, &mut std::io::stdout()).map(drop)
}

/// Prints problems or warnings of a profile, in colour on a terminal, unless NO_COLOR is set.
pub(super) fn say_problems(problems: &profile::Errors) {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    // The rendering holds nothing raw but its own colours.
    let text = profile::render(problems, std::io::stderr().is_terminal() && !plain);
    let _ = writeln!(std::io::stderr(), "sightglass: {text}");
}
