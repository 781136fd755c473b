//! Reauthentication: the password or the second user that a tag requires before it is written.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    AccessControl, Effect,
    audit_entries::audit,
    jobs::{JobError, JobPurpose},
    right,
};
use crate::{
    access::{Credentials, user},
    plant::{
        PlantDef,
        command::{Command, CommandKind, Outcome, Refusal},
        def::{Reauthentication, TagId},
        exact::Exact,
        interlock,
        recorded_action::RecordedAction,
        request_refusal::RequestRefusal,
    },
};

impl AccessControl {
    /// Passes on a command with a sufficient role once the tag has the reauthentication it requires.
    pub(super) fn reauthenticate(
        &mut self,
        terminal: u32,
        command: Command,
        credentials: Option<Credentials>,
        at: Timestamp,
    ) -> Vec<Effect> {
        let needed = required(&self.def, &command.kind).filter(|_| self.users.is_some());
        let (Some(needed), Some(session)) = (needed, self.sessions.get(&terminal)) else {
            return self.forward_to_plant(terminal, command, None, Outcome::Pending, at);
        };
        let Some(by) = session.who.as_ref().map(|who| who.user.clone()) else { return Vec::new() };
        let own = |name: &str| user::key(name) == user::key(&by);
        let given = match (needed, credentials) {
            (Reauthentication::Password, None) => Err(RequestRefusal::PasswordAgain),
            (Reauthentication::Password, Some(Credentials { user: Some(user), .. })) if !own(&user) => {
                Err(RequestRefusal::OwnPassword)
            }
            (Reauthentication::Password, Some(_)) if session.trusted => Err(RequestRefusal::AccountWithoutPassword),
            (Reauthentication::SecondUser, None | Some(Credentials { user: None, .. })) => {
                Err(RequestRefusal::SecondUser)
            }
            (Reauthentication::SecondUser, Some(Credentials { user: Some(user), .. })) if own(&user) => {
                Err(RequestRefusal::SecondUserIsFirst)
            }
            (Reauthentication::Password | Reauthentication::SecondUser, Some(given)) => Ok(given),
        };
        let Credentials { user, password } = match given {
            Ok(given) => given,
            Err(why) => return self.refuse_reauthentication(terminal, command, why, at),
        };
        let name = user.as_deref().unwrap_or(&by).to_owned();
        let approver = self.users.as_ref().and_then(|users| users.get(&name)).map(|user| user.name.clone());
        let (copy, command) = (command.clone(), Box::new(command));
        match self.verify_password(terminal, &name, password, JobPurpose::Reauthenticate { by, approver, command }, at)
        {
            Ok(effects) => effects,
            Err(why) => self.refuse_reauthentication(terminal, copy, why, at),
        }
    }

    pub(super) fn on_reauthenticated(
        &mut self,
        terminal: u32,
        by: Arc<str>,
        approver: Option<Arc<str>>,
        command: Command,
        wrong: Option<JobError>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(JobError { why, message }) = wrong {
            let mut effects = Vec::new();
            if let Some(session) = self.sessions.get(&terminal) {
                let (approver, outcome) = (approver.as_deref().unwrap_or("unknown user"), format!("refused: {why}"));
                effects.push(audit(session, RecordedAction::ReauthenticationFailed, approver, &outcome, at));
            }
            effects.extend(self.refuse_reauthentication(terminal, command, message, at));
            return effects;
        }
        let needed = right::needs(&self.def, &command.kind);
        // Meanwhile the terminal may have been locked.
        if let Err(why) = self.may(terminal, Some(needed)) {
            return self.refuse_command(terminal, command, why, Refusal::NotPermitted, at);
        }
        let other = approver.as_ref().filter(|approver| **approver != by);
        let other = other.and_then(|approver| self.users.as_ref()?.get(approver));
        match other {
            Some(other) if other.must_change => {
                let why = RequestRefusal::ApproverMustChange(other.name.to_string());
                self.refuse_reauthentication(terminal, command, why, at)
            }
            Some(other) if other.role < needed => {
                let why = RequestRefusal::ApproverRole { name: other.name.to_string(), needed };
                self.refuse_reauthentication(terminal, command, why, at)
            }
            Some(_) | None => self.forward_to_plant(terminal, command, approver.as_deref(), Outcome::Pending, at),
        }
    }

    pub(super) fn refuse_reauthentication(
        &mut self,
        terminal: u32,
        command: Command,
        why: RequestRefusal,
        at: Timestamp,
    ) -> Vec<Effect> {
        self.refuse_command(terminal, command, why, Refusal::NotReauthenticated, at)
    }
}

/// The reauthentication that a command requires; none for a stop.
pub fn required(def: &PlantDef, kind: &CommandKind) -> Option<Reauthentication> {
    let asks = |tag: TagId, value: Option<Exact>| {
        let kind = def.tags.get(tag.index())?.reauthenticate?;
        let is_stop = value.is_some_and(|value| interlock::is_stop(def, tag, value, None));
        (!is_stop).then_some(kind)
    };
    // The strictest of all.
    kind.writes(def).filter_map(|(tag, value)| asks(tag, value)).max()
}
