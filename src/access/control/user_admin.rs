//! User administration: changes are checked, saved, and only then take effect.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Peer, Requester,
    audit_entries::{record, words},
    enough,
    jobs::{JobError, JobPurpose},
    right,
};
use crate::{
    access::{
        LoggedInUser, Secret, SessionRequest, Users, password,
        user::{self, UserChange},
    },
    plant::{record::ActionRecord, recorded_action::RecordedAction, request_refusal::RequestRefusal, role::Role},
};

/// In a change until the new password is hashed.
const NO_HASH: &str = "";

/// A change that is being saved.
#[derive(Debug)]
pub(super) struct Saving {
    /// `None` where only last logins are written.
    request: Option<(Requester, UserChange, Box<ActionRecord>)>,
}

impl AccessControl {
    pub(super) fn user_admin_request(
        &mut self,
        requester: Requester,
        request: SessionRequest,
        at: Timestamp,
    ) -> Vec<Effect> {
        if self.users.is_none() {
            return requester.refused(RequestRefusal::WithoutUsers);
        }
        let (action, target) = words(&request);
        if let Some(why) = self.is_closed() {
            // The damaged file is not overwritten.
            return self.refuse(requester, action, &target, why, at);
        }
        let result = match request {
            SessionRequest::FirstSupervisor { user, password } => self.first(requester, user.into(), password),
            SessionRequest::ChangePassword { old, new } => self.change_own(requester, old, new, at),
            SessionRequest::AddUser { user, role, password } => {
                let change = UserChange::Add { user: user.into(), role, hash: NO_HASH.into() };
                self.new_password(requester, password, change)
            }
            SessionRequest::ResetPassword { user, password } => {
                let change = UserChange::Password { user: user.into(), hash: NO_HASH.into(), must_change: true };
                self.new_password(requester, password, change)
            }
            SessionRequest::SetRole { user, role } => self.change(requester, UserChange::Role(user.into(), role), at),
            SessionRequest::Disable { user, disabled } => {
                self.change(requester, UserChange::Disable(user.into(), disabled), at)
            }
            SessionRequest::DeleteUser { user } => self.change(requester, UserChange::Delete(user.into()), at),
            SessionRequest::Login { .. }
            | SessionRequest::Logout
            | SessionRequest::Lock
            | SessionRequest::Unlock(_)
            | SessionRequest::Active
            | SessionRequest::Exported { .. }
            | SessionRequest::Backup { .. }
            | SessionRequest::Import { .. }
            | SessionRequest::Stop
            | SessionRequest::Reload => return Vec::new(),
        };
        result.unwrap_or_else(|why| self.refuse(requester, action, &target, why, at))
    }

    /// Whether this is root, the user of the station, or its own process.
    pub(super) fn is_station_owner(&self, peer: &Peer) -> bool {
        let user = peer.unix_user.as_deref();
        peer.in_process || user == Some("root") || (user.is_some() && user == self.service_account.as_deref())
    }

    fn first(&mut self, requester: Requester, user: Arc<str>, password: Secret) -> Result<Vec<Effect>, RequestRefusal> {
        let session = self.session(requester.terminal)?;
        if !self.is_station_owner(&session.peer) {
            return Err(RequestRefusal::NotStationOwner);
        }
        if self.users.as_ref().is_none_or(|users| !users.is_empty()) {
            return Err(RequestRefusal::UsersExist);
        }
        self.new_password(requester, password, UserChange::First { user, hash: NO_HASH.into() })
    }

    fn change_own(
        &mut self,
        requester: Requester,
        old: Secret,
        new: Secret,
        at: Timestamp,
    ) -> Result<Vec<Effect>, RequestRefusal> {
        let session = self.session(requester.terminal)?;
        if session.trusted {
            return Err(RequestRefusal::NoPasswordToChange);
        }
        let user = session.acting().ok_or(RequestRefusal::LogInOrUnlockFirst)?.user.clone();
        self.check_password(&new, &user)?;
        if password::one_form(&new.0) == password::one_form(&old.0) {
            return Err(RequestRefusal::SamePassword);
        }
        self.verify_password(
            requester.terminal,
            &user.clone(),
            old,
            JobPurpose::UserChange { requester, user, new },
            at,
        )
    }

    pub(super) fn old_password_done(
        &mut self,
        requester: Requester,
        user: Arc<str>,
        new: Secret,
        wrong: Option<JobError>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(wrong) = wrong {
            return self.failed(requester, RecordedAction::ChangePassword, Some(&user), wrong, at);
        }
        let change = UserChange::Password { user, hash: NO_HASH.into(), must_change: false };
        self.new_password(requester, new, change).unwrap_or_else(|why| requester.refused(why))
    }

    /// Checks a new password and has it hashed.
    fn new_password(
        &mut self,
        requester: Requester,
        password: Secret,
        change: UserChange,
    ) -> Result<Vec<Effect>, RequestRefusal> {
        // Checked before the hash and again after it.
        self.check_change(&change)?;
        self.check_password(&password, change.user())?;
        self.hash(requester, password, change)
    }

    fn check_password(&self, password: &Secret, user: &str) -> Result<(), RequestRefusal> {
        let names = [user, &self.def.name, &self.def.title];
        password::check(&password.0, &names, self.def.access.password_chars_min)
    }

    fn check_change(&self, change: &UserChange) -> Result<Users, RequestRefusal> {
        let users = self.users.as_ref().ok_or(RequestRefusal::WithoutUsers)?;
        let name = user::key(change.user());
        if let UserChange::Add { .. } | UserChange::First { .. } = change
            && self.def.access.trusted.iter().any(|(trusted, _)| user::key(trusted) == name)
        {
            return Err(RequestRefusal::TrustedUser(change.user().to_string()));
        }
        users.with(change)
    }

    pub(super) fn set_password(
        &mut self,
        requester: Requester,
        change: UserChange,
        hash: Result<String, RequestRefusal>,
        at: Timestamp,
    ) -> Vec<Effect> {
        match hash {
            Ok(hash) => self.change_or_refuse(requester, change.with_hash(hash.into()), at),
            Err(why) => self.refuse(requester, change.action(), change.user(), why, at),
        }
    }

    /// Starts a change, which takes effect when it is on disk. Checks the rights again, because hashing takes time.
    fn change(
        &mut self,
        requester: Requester,
        change: UserChange,
        at: Timestamp,
    ) -> Result<Vec<Effect>, RequestRefusal> {
        let session = self.session(requester.terminal)?;
        match &change {
            UserChange::First { .. } | UserChange::Password { must_change: false, .. } => {}
            UserChange::Add { .. }
            | UserChange::Role(..)
            | UserChange::Disable(..)
            | UserChange::Delete(_)
            | UserChange::Password { must_change: true, .. } => {
                let who = session.acting().ok_or(RequestRefusal::LogInFirst)?;
                enough(who.role, right::Right::ManageUsers.role())?;
            }
        }
        match &self.saving {
            Some(Saving { request: None, .. }) if self.next.is_none() => {
                self.next = Some((requester, change));
                return Ok(Vec::new());
            }
            Some(_) => return Err(RequestRefusal::BeingSaved),
            None => {}
        }
        let after = self.check_change(&change)?;
        let (old, new) = self.old_and_new(&change);
        let name = self.users.as_ref().and_then(|users| users.get(change.user())).map(|user| user.name.clone());
        let target = name.unwrap_or_else(|| change.user().clone());
        let record = ActionRecord { old, new, ..record(session, change.action(), &target, "done", at) };
        self.saving = Some(Saving { request: Some((requester, change, Box::new(record))) });
        Ok(vec![Effect::Save(after)])
    }

    /// Old value and new value of the entry of a change.
    fn old_and_new(&self, change: &UserChange) -> (Option<Arc<str>>, Option<Arc<str>>) {
        let before = self.users.as_ref().and_then(|users| users.get(change.user()));
        let role = before.map(|user| user.role.word().into());
        let can = |disabled| if disabled { "disabled" } else { "enabled" };
        match change {
            UserChange::First { .. } => (None, Some(Role::Supervisor.word().into())),
            UserChange::Add { role: new, .. } => (None, Some(new.word().into())),
            UserChange::Role(_, new) => (role, Some(new.word().into())),
            UserChange::Disable(_, disabled) => {
                (before.map(|user| can(user.disabled).into()), Some(can(*disabled).into()))
            }
            UserChange::Delete(_) => (role, None),
            UserChange::Password { .. } => (None, None),
        }
    }

    /// Saves the last logins.
    pub(super) fn save_logins(&mut self) -> Option<Effect> {
        self.unsaved = false;
        let users = self.users.clone()?;
        self.saving = Some(Saving { request: None });
        Some(Effect::Save(users))
    }

    /// The users were saved, or not: `Err` says why.
    pub fn on_saved(&mut self, result: Result<(), String>, at: Timestamp) -> Vec<Effect> {
        let Some(Saving { request: Some((requester, change, record)) }) = self.saving.take() else {
            let next = self.next.take();
            return next.map_or_else(Vec::new, |(requester, change)| self.change_or_refuse(requester, change, at));
        };
        let after = result.map_err(RequestRefusal::Failed).and_then(|()| self.check_change(&change));
        let users = match after {
            Ok(users) => users,
            Err(why) => {
                let outcome = format!("refused: {why}").into();
                let refused = requester.refused(why);
                return [Effect::Record(ActionRecord { outcome, ..*record })].into_iter().chain(refused).collect();
            }
        };
        let before = self.users.replace(users);
        let digest = |users: Option<&Users>| users.map(|users| users.digest().into());
        let (old, new) = (digest(before.as_ref()), digest(self.users.as_ref()));
        let file = ActionRecord::new(record.at, "station", RecordedAction::UsersFile, "users", record.outcome.clone());
        let file = ActionRecord { old, new, ..file };
        let mut effects = vec![Effect::Record(*record), Effect::Record(file), requester.done()];
        effects.extend(self.apply_to_sessions(requester.terminal, &change, at));
        self.publish_status(requester.terminal, &mut effects);
        effects
    }

    fn change_or_refuse(&mut self, requester: Requester, change: UserChange, at: Timestamp) -> Vec<Effect> {
        let (action, target) = (change.action(), change.user().clone());
        self.change(requester, change, at).unwrap_or_else(|why| self.refuse(requester, action, &target, why, at))
    }

    /// Applies a change to the sessions.
    fn apply_to_sessions(&mut self, terminal: u32, change: &UserChange, at: Timestamp) -> Vec<Effect> {
        let name = change.user();
        match change {
            UserChange::Disable(..) | UserChange::Delete(_) | UserChange::Password { must_change: true, .. } => {
                self.attempts.clear(&user::key(name));
            }
            UserChange::First { .. } | UserChange::Add { .. } | UserChange::Role(..) | UserChange::Password { .. } => {}
        }
        match change {
            UserChange::First { user, .. } => {
                let who = LoggedInUser { user: user.clone(), role: Role::Supervisor, must_change: false };
                self.log_in(terminal, who, at)
            }
            UserChange::Add { .. } | UserChange::Disable(_, false) => Vec::new(),
            UserChange::Role(..) => self.log_out_everywhere(name, None, "done: role changed", at),
            UserChange::Disable(_, true) => self.log_out_everywhere(name, None, "done: user disabled", at),
            UserChange::Delete(_) => self.log_out_everywhere(name, None, "done: user deleted", at),
            UserChange::Password { must_change, .. } => {
                let own = (!must_change).then_some(terminal);
                let effects = self.log_out_everywhere(name, own, "done: password changed", at);
                let session = own.and_then(|own| self.sessions.get_mut(&own));
                if let Some(who) = session.and_then(|session| session.who.as_mut()) {
                    who.must_change = false;
                }
                effects
            }
        }
    }
}
