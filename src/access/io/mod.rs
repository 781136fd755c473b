//! The edge of access: the file of users, the book on disk, and who the operating system says is here.

use std::path::{Path, PathBuf};

pub mod book;
pub mod users;

/// The file of users beside a history: `tank.users.toml` beside `tank.duckdb`.
pub fn users_beside(history: &Path) -> PathBuf {
    history.with_extension("users.toml")
}

/// Random bytes of the system, for a salt.
pub fn salt() -> Result<[u8; super::password::SALT_BYTES], String> {
    let mut salt = [0; super::password::SALT_BYTES];
    let filled = rustix::rand::getrandom(&mut salt, rustix::rand::GetRandomFlags::empty());
    match filled {
        Ok(bytes) if bytes == salt.len() => Ok(salt),
        Ok(_) => Err("the system gives no random numbers".to_owned()),
        Err(error) => Err(format!("the system gives no random numbers: {error}")),
    }
}

/// The name of a user of the operating system; his number where it has none.
pub fn user_name(uid: u32) -> String {
    let passwd = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    let named = passwd.lines().find_map(|line| {
        let mut fields = line.split(':');
        let (name, number) = (fields.next()?, fields.nth(1)?);
        (number.parse() == Ok(uid)).then(|| name.to_owned())
    });
    named.unwrap_or_else(|| uid.to_string())
}

/// The user of the operating system that this process runs as.
pub fn own_user() -> String {
    user_name(rustix::process::geteuid().as_raw())
}
