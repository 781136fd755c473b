//! Roles, and the rules for logging in of the plant file.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::keyword::keyword_enum;

keyword_enum! {
    /// The level of a person. Each may do what those before it may.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Role: "role" {
        /// Looks.
        Viewer => "viewer",
        /// Controls the process and acknowledges alarms.
        Technician => "technician",
        /// Everything.
        Supervisor => "supervisor",
    }
}

keyword_enum! {
    /// What must be entered again to write a tag; the stricter one is the greater.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    pub enum Reauthentication: "reauthenticate" {
        /// The password of the user who writes.
        Password => "password",
        /// Name and password of a second user with the right to write.
        SecondUser => "second user",
    }
}

/// The rules for logging in: the table `[access]` of a plant file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AccessDef {
    /// Shown before anybody logs in (IEC 62443-4-2 CR 1.12).
    pub banner: Option<String>,
    /// The process may be seen without logging in; alarms always can.
    pub anonymous_view: bool,
    /// Fewest characters of a password (NIST SP 800-63B rev 4: 15 where it stands alone).
    pub password_chars_min: u16,
    /// Failed logins in a row that lock an account out.
    pub login_attempts_max: u16,
    /// For how long.
    pub lockout: Duration,
    /// A terminal whose keys rest for so long is locked; zero for never.
    pub idle_lock: Duration,
    /// Terminals that may be attached at once.
    pub sessions_max: u16,
    /// Users of the operating system who need no password here, and what they may: the socket tells who they are.
    pub trusted: Vec<(String, Role)>,
}

impl Default for AccessDef {
    fn default() -> AccessDef {
        AccessDef {
            banner: None,
            anonymous_view: false,
            password_chars_min: 15,
            login_attempts_max: 5,
            lockout: Duration::from_secs(300),
            idle_lock: Duration::from_secs(900),
            sessions_max: 32,
            trusted: Vec::new(),
        }
    }
}
