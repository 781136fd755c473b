//! Rights as courtesy: what the one who sits here may not do is said before it is tried. The station decides.

use super::{ViewContext, keys::Hint, tabs::Tab};
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
        Role::Viewer => "look at everything: process, curves, alarms, reports",
        Role::Technician => "look at everything, control the process, acknowledge alarms, write reports",
        Role::Supervisor => "do everything: also users, the audit list, line settings, tests, stopping the station",
    }
}

/// Why whoever sits here may not give this command: `needs Technician, tom is Viewer`.
pub fn missing(cx: &ViewContext, kind: &CommandKind) -> Option<String> {
    lacks(cx, right::needs(kind))
}

/// The same for a role.
pub fn lacks(cx: &ViewContext, role: Role) -> Option<String> {
    match &cx.session.who {
        None => Some(format!("needs {}; nobody is logged in", title(role))),
        Some(who) if who.role < role => Some(format!("needs {}; {} is {}", title(role), who.user, title(who.role))),
        Some(_) => None,
    }
}

/// The role that a key of a tab needs, where whoever sits here has a lesser one.
pub fn of_key(cx: &ViewContext, tab: Tab, hint: &Hint) -> Option<Role> {
    let plants = |hint: &Hint| cx.def().mimic.commands.iter().any(|command| hint.key == command.key.to_string());
    let acts = match tab {
        Tab::Mimic => plants(hint),
        Tab::Alarms if hint.label == "out of service" => {
            let lesser = cx.session.who.as_ref().is_none_or(|who| who.role < Role::Supervisor);
            return lesser.then_some(Role::Supervisor);
        }
        Tab::Alarms => {
            let actions = ["note", "shelve", "page", "reset", "put back", "hand over", "take over"];
            matches!(hint.key.as_str(), "a" | "A") || actions.contains(&hint.label.as_str())
        }
        Tab::Controllers => matches!(hint.label.as_str(), "edit" | "tune" | "actions" | "refresh" | "line"),
        Tab::Bus => ["start", "retry"].contains(&hint.label.as_str()),
        Tab::Reports => hint.label == "export",
        Tab::Login | Tab::Users | Tab::Trends | Tab::Faults => false,
    };
    let role = cx.session.who.as_ref().map(|who| who.role);
    (acts && role.is_none_or(|role| role < Role::Technician)).then_some(Role::Technician)
}
