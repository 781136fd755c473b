//! The rules for logging in: the table `[access]` of a plant file.

use std::{ops::RangeInclusive, time::Duration};

use super::{
    diagnostic::Problems,
    reader::{OptionalKey, within},
    schema::AccessTable,
};
use crate::plant::role::{AccessDef, Role};

/// Shorter passwords are never permitted (NIST SP 800-63B rev 4, 8 with a second factor).
const CHARS_LEAST: u16 = 8;
/// Most failed logins that can be permitted (the same, 3.2.2).
const LOGIN_ATTEMPTS_MOST: u16 = 100;
/// How long a lockout may last.
const LOCK_OUT: RangeInclusive<Duration> = Duration::from_secs(10)..=Duration::from_secs(3600);

/// The rules; without the table the usual ones.
pub(super) fn access(table: Option<&AccessTable>, problems: &mut Problems) -> AccessDef {
    let usual = AccessDef::default();
    let Some(table) = table else { return usual };
    let chars = within(table.password_chars_min, CHARS_LEAST..=64, usual.password_chars_min, problems);
    let mut trusted: Vec<(String, Role)> = Vec::new();
    for table in &table.trusted {
        let (Some(user), Some(role)) = (&table.value.user, table.value.role) else { continue };
        if trusted.iter().any(|(other, _)| *other == user.value) {
            problems.add(user.at, format!("the user `{}` is trusted twice", user.value)).label("already above");
        } else {
            trusted.push((user.value.clone(), role.value));
        }
    }
    AccessDef {
        banner: table.banner.as_ref().map(|banner| banner.value.clone()),
        anonymous_view: table.anonymous_view.value_or(usual.anonymous_view),
        password_chars_min: chars,
        login_attempts_max: within(
            table.login_attempts_max,
            1..=LOGIN_ATTEMPTS_MOST,
            usual.login_attempts_max,
            problems,
        ),
        lockout: within(table.lockout, LOCK_OUT, usual.lockout, problems),
        idle_lock: table.idle_lock.value_or(usual.idle_lock),
        sessions_max: within(table.sessions_max, 1..=256, usual.sessions_max, problems),
        trusted,
    }
}
