//! Why a terminal has lost its session.

use serde::{Deserialize, Serialize};

use crate::t;

/// Why a session ended although its terminal is there. English in the log and on record, translated where a terminal shows it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum SessionEnd {
    /// It has the plant as it was.
    #[error("{}", t!("the plant file was reloaded"))]
    PlantReloaded,
    /// Its user may be another one now.
    #[error("{}", t!("the users file was reloaded"))]
    UsersReloaded,
    /// As many as may be are attached.
    #[error("{}", too_many(*count, user.as_deref()))]
    TooMany {
        /// How many there are.
        count: usize,
        /// Of this user of the operating system; `None`: of all.
        user: Option<String>,
    },
    /// It was idle for longest.
    #[error("{}", t!("closed: no login for a long time, and another terminal needed the session"))]
    Idle,
    /// The way to the station, in the words of the system or of a station of another version.
    #[error("{0}")]
    Connection(String),
}

fn too_many(count: usize, user: Option<&str>) -> String {
    match user {
        Some(user) => t!("{user} has {count} terminals, no more can attach", count, user),
        None => t!("{count} terminals are attached, no more can attach", count),
    }
}
