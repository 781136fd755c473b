//! Login, logout and lock of a terminal. Alarms stay visible throughout.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Requester, SessionState,
    audit_entries::audit,
    jobs::{JobError, JobPurpose},
    session_status::LOCK_NEAR,
};
use crate::access::{LoggedInUser, Secret, user};
use crate::plant::{recorded_action::RecordedAction, request_refusal::RequestRefusal, time::elapsed};

impl AccessControl {
    pub(super) fn login(&mut self, requester: Requester, user: &str, password: Secret, at: Timestamp) -> Vec<Effect> {
        let Some(users) = &self.users else { return requester.refused(RequestRefusal::NoLogin) };
        if let Some(why) = self.is_closed() {
            return requester.refused(why);
        }
        if users.is_empty() {
            return requester.refused(RequestRefusal::NoUsersYet);
        }
        let (name, user) = (user.to_owned(), users.get(user).map(|user| user.name.clone()));
        let checked =
            self.verify_password(requester.terminal, &name, password, JobPurpose::Login { requester, user }, at);
        checked.unwrap_or_else(|why| requester.refused(why))
    }

    pub(super) fn login_done(
        &mut self,
        requester: Requester,
        user: Option<Arc<str>>,
        wrong: Option<JobError>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(wrong) = wrong {
            return self.failed(requester, RecordedAction::LoginFailed, user.as_deref(), wrong, at);
        }
        let Some(user) = user.and_then(|user| self.users.as_ref()?.get(&user).cloned()) else { return Vec::new() };
        if !self.sessions.contains_key(&requester.terminal) {
            return Vec::new();
        }
        let mut effects = self.log_out(requester.terminal, "done: another user logs in", at);
        let who = LoggedInUser { user: user.name.clone(), role: user.role, must_change: user.must_change };
        effects.extend(self.log_in(requester.terminal, who, at));
        effects.push(requester.done());
        effects
    }

    /// Starts a login session.
    pub(super) fn log_in(&mut self, terminal: u32, who: LoggedInUser, at: Timestamp) -> Vec<Effect> {
        let utc = self.utc(at);
        let Some(session) = self.sessions.get_mut(&terminal) else { return Vec::new() };
        let name = who.user.clone();
        session.enter(who, at);
        let mut effects = vec![audit(session, RecordedAction::Login, &name, "done", at)];
        if let Some(users) = &mut self.users {
            users.logged_in(&name, utc);
            self.unsaved = true;
        }
        self.publish_status(terminal, &mut effects);
        effects
    }

    /// Records why an attempt failed, and replies without the reason.
    pub(super) fn failed(
        &mut self,
        requester: Requester,
        action: RecordedAction,
        user: Option<&str>,
        JobError { why, message }: JobError,
        at: Timestamp,
    ) -> Vec<Effect> {
        let mut effects = Vec::new();
        if let Some(session) = self.sessions.get(&requester.terminal) {
            effects.push(audit(session, action, user.unwrap_or("unknown user"), &format!("refused: {why}"), at));
        }
        effects.extend(requester.refused(message));
        effects
    }

    pub(super) fn logout(&mut self, requester: Requester, at: Timestamp) -> Vec<Effect> {
        let mut effects = self.log_out(requester.terminal, "done", at);
        if effects.is_empty() {
            return requester.refused(RequestRefusal::NotLoggedIn);
        }
        effects.push(requester.done());
        self.publish_status(requester.terminal, &mut effects);
        effects
    }

    /// Ends the login of this terminal, if there is one.
    pub(super) fn log_out(&mut self, terminal: u32, outcome: &str, at: Timestamp) -> Vec<Effect> {
        let asked = self.users.is_some();
        let Some(session) = self.sessions.get_mut(&terminal) else { return Vec::new() };
        let Some(who) = &session.who else { return Vec::new() };
        let effects =
            if asked { vec![audit(session, RecordedAction::Logout, &who.user, outcome, at)] } else { Vec::new() };
        session.leave();
        effects
    }

    pub(super) fn lock(&mut self, requester: Requester, at: Timestamp) -> Vec<Effect> {
        match self.sessions.get_mut(&requester.terminal) {
            Some(session) if session.acting().is_some() && session.trusted => {
                requester.refused(RequestRefusal::NoPasswordNeeded)
            }
            Some(session) if session.acting().is_some() => {
                session.locked = true;
                let target = session.who.as_ref().map(|who| who.user.clone()).unwrap_or_default();
                let mut effects = vec![audit(session, RecordedAction::Lock, &target, "done", at), requester.done()];
                self.publish_status(requester.terminal, &mut effects);
                effects
            }
            Some(session) if session.locked => requester.refused(RequestRefusal::AlreadyLocked),
            Some(_) | None => requester.refused(RequestRefusal::LogInFirst),
        }
    }

    pub(super) fn unlock(&mut self, requester: Requester, password: Secret, at: Timestamp) -> Vec<Effect> {
        let session = self.sessions.get(&requester.terminal).filter(|session| session.locked);
        let Some(user) = session.and_then(|session| session.who.as_ref()).map(|who| who.user.clone()) else {
            return requester.refused(RequestRefusal::NotLocked);
        };
        let checked = self.verify_password(
            requester.terminal,
            &user.clone(),
            password,
            JobPurpose::Unlock { requester, user },
            at,
        );
        checked.unwrap_or_else(|why| requester.refused(why))
    }

    pub(super) fn unlock_done(
        &mut self,
        requester: Requester,
        user: Arc<str>,
        wrong: Option<JobError>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(wrong) = wrong {
            return self.failed(requester, RecordedAction::UnlockFailed, Some(&user), wrong, at);
        }
        let Some(session) = self.sessions.get_mut(&requester.terminal) else { return Vec::new() };
        (session.locked, session.active) = (false, at);
        let mut effects = vec![audit(session, RecordedAction::Unlocked, &user, "done", at), requester.done()];
        self.publish_status(requester.terminal, &mut effects);
        effects
    }

    /// The idle time after which this terminal is locked; `None` without a password to unlock it.
    pub(super) fn idle_lock(&self, session: &SessionState) -> Option<Duration> {
        let span = self.def.access.idle_lock;
        (!span.is_zero() && self.users.is_some() && !session.trusted).then_some(span)
    }

    /// Locks idle terminals, and publishes the status of those that will be locked soon.
    pub(super) fn lock_idle(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = Vec::new();
        let idle = |access: &AccessControl, session: &SessionState| {
            let left = access.idle_lock(session)?.saturating_sub(elapsed(session.active, at));
            (session.acting().is_some() && left <= LOCK_NEAR).then_some(left)
        };
        let near: Vec<_> = self.sessions.iter().filter_map(|(id, session)| Some((*id, idle(self, session)?))).collect();
        for (terminal, left) in near {
            if let Some(session) = self.sessions.get_mut(&terminal).filter(|_| left.is_zero()) {
                session.locked = true;
                let name = session.who.as_ref().map(|who| who.user.clone()).unwrap_or_default();
                effects.push(audit(session, RecordedAction::Lock, &name, "done: idle", at));
                self.publish_status(terminal, &mut effects);
            } else {
                effects.push(Effect::SessionStatus(terminal));
            }
        }
        effects
    }

    /// Logs a user out of all terminals but one.
    pub(super) fn log_out_everywhere(
        &mut self,
        name: &str,
        except: Option<u32>,
        why: &str,
        at: Timestamp,
    ) -> Vec<Effect> {
        let key = user::key(name);
        let here = |session: &SessionState| {
            !session.trusted && session.who.as_ref().is_some_and(|who| user::key(&who.user) == key)
        };
        let sessions: Vec<u32> = self.sessions.iter().filter(|(_, session)| here(session)).map(|(id, _)| *id).collect();
        let mut effects = Vec::new();
        for terminal in sessions.into_iter().filter(|terminal| Some(*terminal) != except) {
            effects.extend(self.log_out(terminal, why, at));
            effects.push(Effect::SessionStatus(terminal));
        }
        effects
    }
}
