//! The file of users, beside the history: written whole or not at all, and never taken for empty when it is damaged.

use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use crate::{
    access::{
        password,
        user::{self, User, Users},
    },
    plant::role::Role,
    profile::io::{atomic::write_atomic, regular},
};

/// Some hundred users are some ten kilobytes; whatever is larger than this is something else.
const BYTES_MAX: u64 = 256 << 10;
/// The first words of the file.
const HEAD: &str = "# The users of this plant. Written by the station: change it there, in the tab Users.\n";

/// Why the users file cannot be read. Login is closed then: a damaged file must not be read as no users.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UsersError {
    /// It is there, and cannot be read.
    #[error("the users in {path} cannot be read: {why}")]
    Unreadable {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// It says something that cannot be.
    #[error("{path}:{line}:{column}: {why}; login is disabled until the file is repaired or restored from a backup")]
    Wrong {
        /// The file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What was found and what was expected.
        why: String,
    },
}

/// Reads the users; a missing file means no users.
pub fn read(path: &Path) -> Result<Users, UsersError> {
    let unreadable = |why: String| UsersError::Unreadable { path: path.display().to_string(), why };
    let text = match regular::read_text(path, BYTES_MAX) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Users::default()),
        text => text.map_err(|error| unreadable(error.to_string()))?,
    };
    parse(&text).map_err(|(offset, why)| {
        let before = text.get(..offset).unwrap_or(&text);
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|letter| *letter != '\n').count() + 1;
        UsersError::Wrong { path: path.display().to_string(), line, column, why }
    })
}

/// Writes the users: who loses power now finds the old file or the new one. `Err` says why, in words for the operator.
/// Blocks while the disk works.
pub fn write(path: &Path, users: &Users) -> Result<(), String> {
    let failed = |error: std::io::Error| format!("{} cannot be written: {error}", path.display());
    write_atomic(path, text(users).as_bytes(), 0o600).map_err(failed)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    #[serde(default)]
    user: Vec<Spanned<Row>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    name: Spanned<String>,
    role: Role,
    password: Spanned<String>,
    #[serde(default)]
    disabled: bool,
    #[serde(default)]
    must_change: bool,
    last_login: Option<Spanned<String>>,
}

/// The users of a text, or where it is wrong (as an offset in bytes) and why.
fn parse(text: &str) -> Result<Users, (usize, String)> {
    let table: Table = toml::from_str(text).map_err(|error| {
        // Never the line itself: it may hold a hash.
        (error.span().map_or(0, |span| span.start), error.message().to_owned())
    })?;
    if table.user.is_empty() {
        return Err((0, "no user found, expected [[user]]".to_owned()));
    }
    let places: Vec<usize> = table.user.iter().map(|row| row.span().start).collect();
    let mut users = Vec::new();
    for row in table.user {
        let row = row.into_inner();
        user::check_name(row.name.get_ref()).map_err(|why| (row.name.span().start, why.to_string()))?;
        let checked = password::check_hash(row.password.get_ref());
        checked.map_err(|expected| (row.password.span().start, format!("not a hash, {expected}")))?;
        let last_login = row.last_login.map(|time| {
            let wrong = (time.span().start, "not a time, expected for example 2026-05-01T12:00:00Z".to_owned());
            time.get_ref().parse().map_err(|_| wrong)
        });
        users.push(User {
            name: row.name.into_inner().into(),
            role: row.role,
            hash: row.password.into_inner().into(),
            disabled: row.disabled,
            must_change: row.must_change,
            last_login: last_login.transpose()?,
        });
    }
    Users::new(users).map_err(|(place, why)| (places[place], why.to_string()))
}

fn text(users: &Users) -> String {
    let mut text = HEAD.to_owned();
    for User { name, role, hash, disabled, must_change, last_login } in users.iter() {
        // Names and hashes hold nothing that a quoted text would have to escape.
        text += &format!("\n[[user]]\nname = \"{name}\"\nrole = \"{}\"\npassword = \"{hash}\"\n", role.word());
        text += if *disabled { "disabled = true\n" } else { "" };
        text += if *must_change { "must_change = true\n" } else { "" };
        if let Some(at) = last_login {
            text += &format!("last_login = \"{at}\"\n");
        }
    }
    text
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::{fs, os::unix::fs::PermissionsExt, sync::Arc};

    use super::*;
    use crate::access::user::UserChange;

    fn two() -> Users {
        let hash: Arc<str> = password::DUMMY.into();
        let users = Users::default().with(&UserChange::First { user: "anna".into(), hash: hash.clone() }).unwrap();
        let mut users = users.with(&UserChange::Add { user: "สมชาย".into(), role: Role::Viewer, hash }).unwrap();
        users.logged_in("anna", "2026-05-01T12:00:00.25Z".parse().unwrap());
        users
    }

    #[test]
    fn users_are_read_back_and_the_file_is_private() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tank.users.toml");
        assert!(read(&path).unwrap().is_empty(), "no users yet");
        write(&path, &two()).unwrap();
        write(&path, &two()).unwrap();
        assert_eq!(read(&path).unwrap(), two());
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside");
        assert!(write(&folder.path().join("gone/x.toml"), &two()).unwrap_err().contains("cannot be written"));
    }

    #[test]
    fn a_damaged_file_is_never_read_as_no_users() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tank.users.toml");
        let good = text(&two());
        let damaged = [
            (String::new(), (1, 1), "no user found"),
            (HEAD.to_owned(), (1, 1), "no user found"),
            (good[..good.len() / 2].to_owned(), (6, 101), "expected"),
            (good.replace("\"supervisor\"", "\"boss\""), (5, 8), "boss"),
            (good.replace("\"supervisor\"", "\"viewer\""), (3, 1), "at least one enabled supervisor"),
            (good.replace("สมชาย", "ANNA"), (9, 1), "user ANNA already exists"),
            (good.replacen("argon2id", "md5", 1), (6, 12), "not a hash"),
            (good.replacen("must_change", "must_chance", 1), (13, 1), "must_chance"),
        ];
        for (text, place, expected) in damaged {
            fs::write(&path, &text).unwrap();
            let UsersError::Wrong { line, column, why, .. } = read(&path).unwrap_err() else { panic!("{text}") };
            assert!(why.contains(expected), "{why}");
            assert_eq!((line, column), place, "{why}\n{text}");
            assert!(!why.contains("argon2id$"), "{why}");
        }
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(matches!(read(&path), Err(UsersError::Unreadable { .. })));
    }
}
