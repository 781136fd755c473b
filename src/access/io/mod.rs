//! The edge of access: the file of users, the audit log on disk, and who the operating system says is here.

use std::path::{Path, PathBuf};

pub mod audit_log;
pub mod recorder;
pub mod sealing;
pub mod users;

/// The file of users beside a history: `tank.users.toml` beside `tank.duckdb`.
pub fn users_beside(history: &Path) -> PathBuf {
    history.with_extension("users.toml")
}

/// Random bytes of the system, for a salt or a key.
pub fn random<const BYTES: usize>() -> Result<[u8; BYTES], String> {
    let mut random = [0; BYTES];
    let filled = rustix::rand::getrandom(&mut random, rustix::rand::GetRandomFlags::empty());
    match filled {
        Ok(bytes) if bytes == BYTES => Ok(random),
        Ok(_) => Err("the system gives no random numbers".to_owned()),
        Err(error) => Err(format!("the system gives no random numbers: {error}")),
    }
}

/// The user of the operating system that this process runs as, or the uid without a name. May query another machine.
pub fn own_user() -> String {
    let name = uzers::get_effective_username().map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| uzers::get_effective_uid().to_string())
}
