//! User administration: changes are checked, saved, and only then take effect.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Peer,
    audit_entries::{audit, record, words},
    enough,
    jobs::{JobError, JobPurpose},
    login::reply,
    right,
};
use crate::{
    access::{
        Secret, SessionRequest, Users, Who,
        audit_log::USERS_FILE,
        password,
        user::{self, Change},
    },
    plant::{record::ActionRecord, role::Role},
};

/// Whose new password is being hashed.
#[derive(Debug)]
pub(super) enum Hashing {
    First(Arc<str>),
    Add(Arc<str>, Role),
    Own(Arc<str>),
    Reset(Arc<str>),
}

/// A change that is being saved.
#[derive(Debug)]
pub(super) struct Saving {
    terminal: u32,
    /// `None` where only last logins are written.
    request: Option<(u64, Change, Box<ActionRecord>)>,
}

impl AccessControl {
    pub(super) fn user_admin_request(
        &mut self,
        terminal: u32,
        ticket: u64,
        request: SessionRequest,
        at: Timestamp,
    ) -> Vec<Effect> {
        if self.users.is_none() {
            return reply(ticket, "this station has no users");
        }
        let (action, target) = words(&request);
        if let Some(why) = self.closed.clone() {
            // The damaged file is not overwritten.
            return self.not_changed(terminal, ticket, action, &target, &why, at);
        }
        let result = match request {
            SessionRequest::FirstSupervisor { user, password } => self.first(terminal, ticket, user.into(), password),
            SessionRequest::ChangePassword { old, new } => self.change_own(terminal, ticket, old, new, at),
            SessionRequest::AddUser { user, role, password } => {
                let user: Arc<str> = user.into();
                self.new_password(terminal, ticket, password, Hashing::Add(user, role))
            }
            SessionRequest::ResetPassword { user, password } => {
                let user: Arc<str> = user.into();
                self.new_password(terminal, ticket, password, Hashing::Reset(user))
            }
            SessionRequest::SetRole { user, role } => {
                self.change(terminal, ticket, Change::Role(user.into(), role), at)
            }
            SessionRequest::Disable { user, disabled } => {
                self.change(terminal, ticket, Change::Disable(user.into(), disabled), at)
            }
            SessionRequest::DeleteUser { user } => self.change(terminal, ticket, Change::Delete(user.into()), at),
            SessionRequest::Login { .. }
            | SessionRequest::Logout
            | SessionRequest::Lock
            | SessionRequest::Unlock(_)
            | SessionRequest::Active
            | SessionRequest::Exported { .. }
            | SessionRequest::Stop
            | SessionRequest::Reload => return Vec::new(),
        };
        result.unwrap_or_else(|why| self.not_changed(terminal, ticket, action, &target, &why, at))
    }

    fn not_changed(
        &mut self,
        terminal: u32,
        ticket: u64,
        action: &str,
        target: &str,
        why: &str,
        at: Timestamp,
    ) -> Vec<Effect> {
        let mut effects = reply(ticket, why);
        let Some(session) = self.sessions.get(&terminal) else { return effects };
        let record = audit(session, action, target, &format!("refused: {why}"), at);
        let origin = session.origin.clone();
        if self.may_record(&origin, at) {
            effects.push(record);
        }
        effects
    }

    /// Whether this is root, the user of the station, or its own process.
    pub(super) fn is_host(&self, peer: &Peer) -> bool {
        let user = peer.unix_user.as_deref();
        peer.own || user == Some("root") || (user.is_some() && user == self.host.as_deref())
    }

    fn first(&mut self, terminal: u32, ticket: u64, user: Arc<str>, password: Secret) -> Result<Vec<Effect>, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        if !self.is_host(&session.peer) {
            return Err("only the user who started the station creates the first Supervisor".to_owned());
        }
        if self.users.as_ref().is_none_or(|users| !users.is_empty()) {
            return Err("users exist already".to_owned());
        }
        self.new_password(terminal, ticket, password, Hashing::First(user))
    }

    fn change_own(
        &mut self,
        terminal: u32,
        ticket: u64,
        old: Secret,
        new: Secret,
        at: Timestamp,
    ) -> Result<Vec<Effect>, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        if session.trusted {
            return Err("the operating system says who you are here, there is no password to change".to_owned());
        }
        let user = session.acting().ok_or("log in, or unlock this terminal, first")?.user.clone();
        password::check(&new.0, &user, self.def.access.password_chars_min)?;
        if password::one_form(&new.0) == password::one_form(&old.0) {
            return Err("this is the present password, choose another one".to_owned());
        }
        self.verify_password(terminal, &user.clone(), old, JobPurpose::Change { ticket, user, new }, at)
    }

    pub(super) fn old_password_done(
        &mut self,
        terminal: u32,
        ticket: u64,
        user: Arc<str>,
        new: Secret,
        wrong: Option<JobError>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(wrong) = wrong {
            return self.failed(terminal, ticket, "change password", Some(&user), wrong, at);
        }
        self.new_password(terminal, ticket, new, Hashing::Own(user)).unwrap_or_else(|why| reply(ticket, &why))
    }

    /// Checks a new password and has it hashed.
    fn new_password(
        &mut self,
        terminal: u32,
        ticket: u64,
        password: Secret,
        hashing: Hashing,
    ) -> Result<Vec<Effect>, String> {
        // Checked before the hash and again after it.
        self.check_change(&hashing.change("".into()))?;
        password::check(&password.0, hashing.user(), self.def.access.password_chars_min)?;
        self.hash(terminal, ticket, password, hashing)
    }

    fn check_change(&self, change: &Change) -> Result<crate::access::Users, String> {
        let users = self.users.as_ref().ok_or("this station has no users")?;
        let name = user::key(change.user());
        if let Change::Add { .. } | Change::First { .. } = change
            && self.def.access.trusted.iter().any(|(trusted, _)| user::key(trusted) == name)
        {
            return Err(format!("{} is a user of the operating system who needs no password here", change.user()));
        }
        users.with(change)
    }

    pub(super) fn set_password(
        &mut self,
        terminal: u32,
        ticket: u64,
        hashing: Hashing,
        hash: Result<String, String>,
        at: Timestamp,
    ) -> Vec<Effect> {
        let name = hashing.user().clone();
        let result = hash.and_then(|hash| self.change(terminal, ticket, hashing.change(hash.into()), at));
        result.unwrap_or_else(|why| self.not_changed(terminal, ticket, hashing.action(), &name, &why, at))
    }

    /// Starts a change, which takes effect when it is on disk. Checks the rights again, because hashing takes time.
    fn change(&mut self, terminal: u32, ticket: u64, change: Change, at: Timestamp) -> Result<Vec<Effect>, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        match &change {
            Change::First { .. } | Change::Password { must_change: false, .. } => {}
            Change::Add { .. }
            | Change::Role(..)
            | Change::Disable(..)
            | Change::Delete(_)
            | Change::Password { must_change: true, .. } => {
                let who = session.acting().ok_or(super::LOG_IN_FIRST)?;
                enough(who.role, right::Right::ManageUsers.role())?;
            }
        }
        match &self.saving {
            Some(Saving { request: None, .. }) if self.next.is_none() => {
                self.next = Some((terminal, ticket, change));
                return Ok(Vec::new());
            }
            Some(_) => return Err("another change is being saved, try again".to_owned()),
            None => {}
        }
        let after = self.check_change(&change)?;
        let (action, old, new) = self.audit_texts(&change);
        let name = self.users.as_ref().and_then(|users| users.get(change.user())).map(|user| user.name.clone());
        let target = name.unwrap_or_else(|| change.user().clone());
        let record = ActionRecord { old, new, ..record(session, action, &target, "done", at) };
        self.saving = Some(Saving { terminal, request: Some((ticket, change, Box::new(record))) });
        Ok(vec![Effect::Save(after)])
    }

    /// Action, old value and new value of the entry of a change.
    fn audit_texts(&self, change: &Change) -> (&'static str, Option<Arc<str>>, Option<Arc<str>>) {
        let before = self.users.as_ref().and_then(|users| users.get(change.user()));
        let role = before.map(|user| user.role.word().into());
        let can = |disabled| if disabled { "disabled" } else { "enabled" };
        match change {
            Change::First { .. } => ("add user", None, Some(Role::Supervisor.word().into())),
            Change::Add { role: new, .. } => ("add user", None, Some(new.word().into())),
            Change::Role(_, new) => ("set role", role, Some(new.word().into())),
            Change::Disable(_, disabled) => {
                let action = if *disabled { "disable user" } else { "enable user" };
                (action, before.map(|user| can(user.disabled).into()), Some(can(*disabled).into()))
            }
            Change::Delete(_) => ("delete user", role, None),
            Change::Password { must_change: true, .. } => ("reset password", None, None),
            Change::Password { must_change: false, .. } => ("change password", None, None),
        }
    }

    /// Saves the last logins.
    pub(super) fn save_logins(&mut self) -> Option<Effect> {
        self.unsaved = false;
        let users = self.users.clone()?;
        self.saving = Some(Saving { terminal: 0, request: None });
        Some(Effect::Save(users))
    }

    /// The users were saved, or not: `Err` says why.
    pub fn on_saved(&mut self, result: Result<(), String>, at: Timestamp) -> Vec<Effect> {
        let Some(Saving { terminal, request: Some((ticket, change, record)) }) = self.saving.take() else {
            return self.start_next(at);
        };
        let after = result.and_then(|()| self.check_change(&change));
        let users = match after {
            Ok(users) => users,
            Err(why) => {
                let outcome = format!("refused: {why}").into();
                return vec![Effect::Record(ActionRecord { outcome, ..*record }), Effect::Reply(ticket, Err(why))];
            }
        };
        let before = self.users.replace(users);
        let digest = |users: Option<&Users>| users.map(|users| users.digest().into());
        let by_station =
            ActionRecord { by: "station".into(), from: "".into(), old: None, new: None, ..(*record).clone() };
        let file = ActionRecord {
            action: USERS_FILE.into(),
            target: "users".into(),
            old: digest(before.as_ref()),
            new: digest(self.users.as_ref()),
            ..by_station
        };
        let mut effects = vec![Effect::Record(*record), Effect::Record(file), Effect::Reply(ticket, Ok(()))];
        effects.extend(self.apply_to_sessions(terminal, &change, at));
        self.publish_status(terminal, &mut effects);
        effects
    }

    /// Starts the change that waited while last logins were saved.
    fn start_next(&mut self, at: Timestamp) -> Vec<Effect> {
        let Some((terminal, ticket, change)) = self.next.take() else { return Vec::new() };
        let (action, _, _) = self.audit_texts(&change);
        let target = change.user().clone();
        let begun = self.change(terminal, ticket, change, at);
        begun.unwrap_or_else(|why| self.not_changed(terminal, ticket, action, &target, &why, at))
    }

    /// Applies a change to the sessions.
    fn apply_to_sessions(&mut self, terminal: u32, change: &Change, at: Timestamp) -> Vec<Effect> {
        let name = change.user().clone();
        let mut out = |why: &str, except| self.log_out_everywhere(&name, except, why, at);
        match change {
            Change::First { user, .. } => {
                let who = Who { user: user.clone(), role: Role::Supervisor, must_change: false };
                self.log_in(terminal, who, at)
            }
            Change::Add { .. } => Vec::new(),
            Change::Role(..) => out("done: has another role now", None),
            Change::Disable(_, true) => out("done: was disabled", None),
            Change::Delete(_) => {
                let effects = out("done: was deleted", None);
                self.attempts.clear(&user::key(&name));
                effects
            }
            Change::Disable(_, false) => {
                self.attempts.clear(&user::key(&name));
                Vec::new()
            }
            Change::Password { must_change: true, .. } => {
                let effects = out("done: has another password now", None);
                self.attempts.clear(&user::key(&name));
                effects
            }
            Change::Password { must_change: false, .. } => {
                let effects = out("done: has another password now", Some(terminal));
                if let Some(who) = self.sessions.get_mut(&terminal).and_then(|session| session.who.as_mut()) {
                    who.must_change = false;
                }
                effects
            }
        }
    }
}

impl Hashing {
    pub(super) fn user(&self) -> &Arc<str> {
        match self {
            Hashing::First(user) | Hashing::Add(user, _) | Hashing::Own(user) | Hashing::Reset(user) => user,
        }
    }

    fn action(&self) -> &'static str {
        match self {
            Hashing::First(_) | Hashing::Add(..) => "add user",
            Hashing::Own(_) => "change password",
            Hashing::Reset(_) => "reset password",
        }
    }

    fn change(&self, hash: Arc<str>) -> Change {
        match self {
            Hashing::First(user) => Change::First { user: user.clone(), hash },
            Hashing::Add(user, role) => Change::Add { user: user.clone(), role: *role, hash },
            Hashing::Own(user) => Change::Password { user: user.clone(), hash, must_change: false },
            Hashing::Reset(user) => Change::Password { user: user.clone(), hash, must_change: true },
        }
    }
}
