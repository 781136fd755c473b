//! What a terminal can ask about users and the station, and its session status.

use std::{fmt, sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::SessionEnd;
use crate::plant::{command::CommandId, request_refusal::RequestRefusal, role::Role};

/// A password on its way: never shown, not even in a log.
#[derive(Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Secret(pub String);

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

impl From<&str> for Secret {
    fn from(text: &str) -> Secret {
        Secret(text.to_owned())
    }
}

/// What a user asks beside commands and queries: of the session, users, the history or the station itself. Each gets a reply:
/// done, or the reason for the operator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum SessionRequest {
    /// Log in.
    Login {
        /// The user name.
        user: String,
        /// The password.
        password: Secret,
    },
    /// Log out.
    Logout,
    /// Lock the terminal; alarms stay visible.
    Lock,
    /// Unlock the terminal.
    Unlock(Secret),
    /// A key was pressed: the terminal is not idle. Sent twice a minute at most.
    Active,
    /// Create the first Supervisor while no users exist.
    FirstSupervisor {
        /// The user name.
        user: String,
        /// The password.
        password: Secret,
    },
    /// Change the own password.
    ChangePassword {
        /// The present one.
        old: Secret,
        /// The new one.
        new: Secret,
    },
    /// Add a user, who must change the password at the first login.
    AddUser {
        /// The user name.
        user: String,
        /// The role.
        role: Role,
        /// The first password.
        password: Secret,
    },
    /// Change the role of a user.
    SetRole {
        /// Whose.
        user: String,
        /// Which.
        role: Role,
    },
    /// Disable a user, or enable one, which also clears a lockout.
    Disable {
        /// Whom.
        user: String,
        /// Out or in.
        disabled: bool,
    },
    /// Delete a user. Past actions stay in the audit log.
    DeleteUser {
        /// Whom.
        user: String,
    },
    /// Give a user a new first password.
    ResetPassword {
        /// Whose.
        user: String,
        /// The password.
        password: Secret,
    },
    /// A terminal writes a file out of what the station holds.
    Exported {
        /// Its name.
        file: String,
        /// Its SHA-256, hexadecimal; or why it could not be written, after that was on record.
        sha256: Result<String, String>,
    },
    /// Write a backup of the history.
    Backup {
        /// The folder that it goes to, absolute.
        folder: String,
    },
    /// Fill gaps of the history with the samples of a CSV file.
    Import {
        /// Its name in the import folder beside the history.
        file: String,
    },
    /// End the station.
    Stop,
    /// Reload the plant file; on error keep the running configuration.
    Reload,
}

/// Whether the audit entry of a granted request is on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Durability {
    /// It is, or nothing had to be recorded.
    Recorded,
    /// It was done, and the disk has not taken the record yet: a loss of power loses it.
    NotRecorded,
}

/// What became of a granted request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Completion {
    /// Whether that is on record.
    pub durability: Durability,
    /// What was done, where the request does not say it all.
    pub summary: Option<Arc<str>>,
}

impl Completion {
    /// So far on record, with a summary if there is one.
    pub fn new(durability: Durability, summary: Option<String>) -> Completion {
        Completion { durability, summary: summary.map(Into::into) }
    }
}

/// Credentials for a tag that requires reauthentication.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Credentials {
    /// The second user; `None` for the user who writes.
    pub user: Option<String>,
    /// The password of that person.
    pub password: Secret,
}

/// A logged-in user.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoggedInUser {
    /// The user name.
    pub user: Arc<str>,
    /// The role.
    pub role: Role,
    /// A new password must be chosen before anything else.
    pub must_change: bool,
}

/// The session of a terminal as the station publishes it: all that the login and users pages draw.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SessionStatus {
    /// The logged-in user; `None` before a login.
    pub who: Option<LoggedInUser>,
    /// Locked: only looking, until the password is given.
    pub locked: bool,
    /// The process may be seen.
    pub may_view: bool,
    /// There are no users yet: the first Supervisor is asked for.
    pub needs_first_supervisor: bool,
    /// Shown before a login.
    pub banner: Option<Arc<str>>,
    /// Fewest characters of a password.
    pub password_chars_min: u16,
    /// After so long without a key the terminal is locked; `None` for never.
    pub idle_lock: Option<Duration>,
    /// When it will be, if that is near; plant time is not real time, so this is what is left.
    pub locks_in: Option<Duration>,
    /// All users; only for a Supervisor.
    pub users: Arc<Vec<UserRow>>,
    /// Who is attached; only for a Supervisor.
    pub sessions: Arc<Vec<SessionRow>>,
    /// The latest commands that did not reach the plant, and why; the latest last.
    pub undelivered: Vec<(CommandId, RequestRefusal)>,
    /// The station has gone, and why; set by the terminal's own end of the socket.
    pub gone: Option<SessionEnd>,
}

/// A row of the list of users.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UserRow {
    /// The user name.
    pub user: Arc<str>,
    /// The role.
    pub role: Role,
    /// Disabled by a Supervisor.
    pub disabled: bool,
    /// Locked out after failed logins until then.
    pub locked_until: Option<Timestamp>,
    /// The password must be changed.
    pub must_change: bool,
    /// The last login.
    pub last_login: Option<Timestamp>,
}

/// A row of the list of terminals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionRow {
    /// Its number.
    pub terminal: u32,
    /// The logged-in user.
    pub user: Option<Arc<str>>,
    /// `pts/3 from 10.0.0.5, user panel`.
    pub from: Arc<str>,
    /// Since when.
    pub since: Timestamp,
    /// It is locked.
    pub locked: bool,
}
