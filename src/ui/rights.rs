//! Rights in the terminal: a missing right is shown before a command is tried. The station decides.

use super::ViewContext;
use crate::t;
use crate::{
    access::{SessionStatus, right},
    plant::{command::CommandKind, def::TagId, heard, interlock, role::Role},
};

/// `Technician`.
pub fn title(role: Role) -> &'static str {
    match role {
        Role::Viewer => t!("Viewer"),
        Role::Technician => t!("Technician"),
        Role::Supervisor => t!("Supervisor"),
    }
}

pub fn words(role: Role) -> &'static str {
    match role {
        Role::Viewer => t!("view everything: process, curves, alarms, reports"),
        Role::Technician => t!("view everything, control the process, acknowledge alarms, write reports"),
        Role::Supervisor => t!("do everything: also users, audit log, line settings, tests, stopping the station"),
    }
}

/// Why the user may not give this command: `needs Technician; tom is Viewer`, or that its line only listens.
pub fn missing(cx: &ViewContext, kind: &CommandKind) -> Option<String> {
    lacks(cx, right::needs(cx.def(), kind))
        .or_else(|| heard::refusal(cx.def(), kind).map(|refusal| refusal.to_string()))
}

/// The least role that may write anything to a tag, or the least of all.
pub fn to_write(cx: &ViewContext, tags: impl IntoIterator<Item = TagId>) -> Role {
    let roles = tags.into_iter().map(|tag| interlock::least_role_to_write(cx.def(), tag));
    roles.min().unwrap_or(Role::Technician)
}

/// The same for a role.
pub fn lacks(cx: &ViewContext, role: Role) -> Option<String> {
    match &cx.session.who {
        None => Some(t!("needs {title}; no user is logged in", title = title(role))),
        Some(who) if who.role < role => Some(t!(
            "needs {title}; {user} is {title2}",
            title = title(role),
            user = who.user,
            title2 = title(who.role)
        )),
        Some(_) => None,
    }
}

/// Is everything but the login page closed?
pub fn is_closed(session: &SessionStatus) -> bool {
    session.who.as_ref().map_or(!session.may_view, |who| who.must_change)
}
