//! The edge of access: the file of users, the audit log on disk, and who the operating system says is here.

use std::{
    io::{self, Read},
    path::{Path, PathBuf},
};

pub mod audit_log;
pub mod recorder;
pub mod sealing;
pub mod users;

use crate::profile::io::regular;

/// No more of a file is read whose text is one line.
const LINE_BYTES_MAX: u64 = 1_000;

/// The file of users beside a history: `tank.users.toml` beside `tank.duckdb`.
pub fn users_beside(history: &Path) -> PathBuf {
    history.with_extension("users.toml")
}

/// Reads a text of one line; `None` where there is no such file.
fn read_line_of(path: &Path) -> io::Result<Option<String>> {
    let file = match regular::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        file => file?,
    };
    let mut text = String::new();
    file.take(LINE_BYTES_MAX).read_to_string(&mut text)?;
    Ok(Some(text))
}

/// Random bytes of the system, for a salt or a key.
pub fn random<const BYTES: usize>() -> Result<[u8; BYTES], String> {
    let mut random = [0; BYTES];
    let filled = rustix::rand::getrandom(&mut random, rustix::rand::GetRandomFlags::empty());
    match filled {
        Ok(bytes) if bytes == BYTES => Ok(random),
        Ok(_) => Err("the system provides no random numbers".to_owned()),
        Err(error) => Err(format!("the system provides no random numbers: {error}")),
    }
}

/// The user of the operating system that this process runs as, or the uid without a name. May query another machine.
pub fn own_user() -> String {
    let name = uzers::get_effective_username().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| uzers::get_effective_uid().to_string())
}
