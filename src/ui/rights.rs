//! Rights in the terminal: a missing right is shown before a command is tried. The station decides.

use super::ViewContext;
use crate::{
    access::right,
    plant::{command::CommandKind, role::Role},
};

/// `Technician`.
pub fn title(role: Role) -> &'static str {
    match role {
        Role::Viewer => "Viewer",
        Role::Technician => "Technician",
        Role::Supervisor => "Supervisor",
    }
}

/// What a role may, in words.
pub fn words(role: Role) -> &'static str {
    match role {
        Role::Viewer => "view everything: process, curves, alarms, reports",
        Role::Technician => "view everything, control the process, acknowledge alarms, write reports",
        Role::Supervisor => "do everything: also users, the audit list, line settings, tests, stopping the station",
    }
}

/// Why the user may not give this command: `needs Technician, tom is Viewer`.
pub fn missing(cx: &ViewContext, kind: &CommandKind) -> Option<String> {
    lacks(cx, right::needs(kind))
}

/// The same for a role.
pub fn lacks(cx: &ViewContext, role: Role) -> Option<String> {
    match &cx.session.who {
        None => Some(format!("needs {}; no user is logged in", title(role))),
        Some(who) if who.role < role => Some(format!("needs {}; {} is {}", title(role), who.user, title(who.role))),
        Some(_) => None,
    }
}
