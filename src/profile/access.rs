//! The rules for logging in: the table `[access]` of a plant file.

use super::{diagnostic::Problems, reader::At, schema::AccessTable};
use crate::plant::role::AccessDef;

/// Passwords shorter than this are nobody's business to permit (NIST SP 800-63B rev 4, 8 with a second factor).
const CHARS_LEAST: u16 = 8;
/// Wrong tries that may be permitted at the most (the same, 3.2.2).
const TRIES_MOST: u16 = 100;

/// The rules; without the table the usual ones.
pub(super) fn access(table: Option<&AccessTable>, problems: &mut Problems) -> AccessDef {
    let usual = AccessDef::default();
    let Some(table) = table else { return usual };
    let chars = number(table.password_chars_min, CHARS_LEAST, 64, usual.password_chars_min, problems);
    let trusted = table.trusted.iter().filter_map(|table| {
        let table = &table.value;
        Some((table.user.as_ref()?.value.clone(), table.role?.value))
    });
    AccessDef {
        notice: table.notice.as_ref().map(|notice| notice.value.clone()),
        view: table.view.map_or(usual.view, |view| view.value),
        password_chars_min: chars,
        tries_max: number(table.tries_max, 1, TRIES_MOST, usual.tries_max, problems),
        lock_out: table.lock_out.map_or(usual.lock_out, |span| span.value),
        idle_lock: table.idle_lock.map_or(usual.idle_lock, |span| span.value),
        sessions_max: number(table.sessions_max, 1, 256, usual.sessions_max, problems),
        trusted: trusted.collect(),
    }
}

fn number(given: Option<At<u16>>, least: u16, most: u16, usual: u16, problems: &mut Problems) -> u16 {
    let Some(given) = given else { return usual };
    if !(least..=most).contains(&given.value) {
        problems
            .add(given.at, format!("{} cannot be used here", given.value))
            .label(format!("expected {least} … {most}"));
        return usual;
    }
    given.value
}
