//! What access control has others do, because it takes as long as a hash: which password is looked at for what, and what then.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{AccessControl, Effect, user_admin::Hashing};
use crate::access::{CommandRequest, Secret, lockout::Key, password, user};

/// Passwords of all users of the operating system that may be checked or wait; more are refused as [`BUSY`].
pub(super) const JOBS_MAX: usize = 64;
/// So many of one user: the others still have room.
pub(super) const JOBS_OF_USER_MAX: usize = 24;
/// So many places are kept for root and the station's own user.
const JOBS_KEPT: usize = 8;
/// The reply when there are more.
pub(super) const BUSY: &str = "the station is busy with other logins, try again";
/// The reply when a password was right, but the session or the stored hash has changed since.
const CHANGED: &str = "the login here or the password was changed meanwhile, try again";

/// Number of a piece of work.
pub type Job = u64;

/// A piece of work that takes some ten milliseconds: not for a loop that must stay quick.
#[derive(Debug, Clone, PartialEq)]
pub enum Work {
    /// Is this the password of this hash?
    Verify {
        /// What was typed.
        password: Secret,
        /// What is kept.
        hash: Arc<str>,
    },
    /// Make a hash of it, with a fresh salt.
    Hash(Secret),
}

impl Work {
    /// Does it. `salt` must be fresh and random.
    pub fn done(self, salt: [u8; password::SALT_BYTES]) -> Outcome {
        match self {
            Work::Verify { password, hash } => Outcome::Verified(password::is(&password.0, &hash)),
            Work::Hash(password) => Outcome::Hashed(password::hash(&password.0, salt)),
        }
    }
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// Right or wrong.
    Verified(bool),
    /// The hash.
    Hashed(Result<String, String>),
    /// It was not done.
    Failed(String),
}

/// What a piece of work is for. Its result counts only in the same session and for the same stored hash.
#[derive(Debug)]
pub(super) struct Errand {
    pub terminal: u32,
    /// Of the terminal, when it was asked for.
    login_number: u64,
    /// The user of the operating system whose jobs it belongs to.
    user: Arc<str>,
    /// What a wrong password counts for, even when the terminal has gone. One of each origin is checked at a time, so that
    /// parallel attempts are counted too.
    key: Key,
    /// The stored hash of that user when the work began.
    stored: Option<Arc<str>>,
    what: What,
}

#[derive(Debug)]
pub(super) enum What {
    /// The password of `user`, `None` for a name that nobody has.
    Login { ticket: u64, user: Option<Arc<str>> },
    /// Of who sits there.
    Unlock { ticket: u64, user: Arc<str> },
    /// Of who sits there, before he may have a new one.
    Change { ticket: u64, user: Arc<str>, new: Secret },
    /// Of who signs a command.
    Reauthenticate { by: Arc<str>, approver: Option<Arc<str>>, request: Box<CommandRequest> },
    /// A new one is hashed.
    Hash { ticket: u64, hashing: Hashing },
}

/// What was wrong with an attempt.
#[derive(Debug)]
pub(super) struct Wrong {
    /// For the book.
    pub why: &'static str,
    /// For the operator: the same whatever it was, and how long he must wait.
    pub told: String,
}

impl AccessControl {
    /// Has the password for this name checked. The time that takes must not publish_status whether the name exists.
    /// `Err` says in words for the operator why it is not checked.
    pub(super) fn look_at(
        &mut self,
        terminal: u32,
        name: &str,
        password: Secret,
        what: What,
        at: Timestamp,
    ) -> Result<Vec<Effect>, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        let inside = || format!("{} at terminal {terminal}", session.origin).into();
        let key = Key {
            origin: if what.comes_from_outside() { session.origin.clone() } else { inside() },
            account: user::check_name(name).is_ok().then(|| user::key(name)),
            never_locked: self.is_host(&session.peer),
        };
        let errand = self.errand(terminal, key, what)?;
        if let Some(wait) = self.attempts.wait(&errand.key, &self.def.access, at)
            && !errand.key.never_locked
        {
            return Err(not_checked(wait));
        }
        self.waiting.push_back((errand, password));
        Ok(self.begin_waiting(at))
    }

    /// Has a new password hashed.
    pub(super) fn hash(
        &mut self,
        terminal: u32,
        ticket: u64,
        password: Secret,
        hashing: Hashing,
    ) -> Result<Vec<Effect>, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        let origin = format!("hash for terminal {terminal}").into();
        let key = Key { origin, account: None, never_locked: self.is_host(&session.peer) };
        let errand = self.errand(terminal, key, What::Hash { ticket, hashing })?;
        Ok(self.send_off(errand, Work::Hash(password)))
    }

    /// `Err` where too many are under way.
    fn errand(&self, terminal: u32, key: Key, what: What) -> Result<Errand, String> {
        let session = self.sessions.get(&terminal).ok_or("this terminal is not attached")?;
        let users = || self.errands.values().chain(self.waiting.iter().map(|(errand, _)| errand)).map(|job| &job.user);
        let most = if key.never_locked { JOBS_MAX } else { JOBS_MAX - JOBS_KEPT };
        if most <= users().count() || JOBS_OF_USER_MAX <= users().filter(|user| **user == session.origin).count() {
            return Err(BUSY.to_owned());
        }
        Ok(Errand {
            terminal,
            login_number: session.login_number,
            user: session.origin.clone(),
            key,
            stored: None,
            what,
        })
    }

    /// Begins the checks that have waited for the one before them, or for their time.
    pub(super) fn begin_waiting(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = Vec::new();
        for (errand, password) in std::mem::take(&mut self.waiting) {
            let busy = self.errands.values().any(|other| other.key.origin == errand.key.origin);
            match self.attempts.wait(&errand.key, &self.def.access, at) {
                _ if !self.sessions.contains_key(&errand.terminal) => {}
                None if !busy => {
                    let hash = self.stored(&errand.what).unwrap_or_else(|| password::DUMMY.into());
                    effects.extend(self.send_off(errand, Work::Verify { password, hash }));
                }
                Some(wait) if !errand.key.never_locked => {
                    effects.extend(self.not_looked_at(errand.terminal, errand.what, not_checked(wait), at));
                }
                None | Some(_) => self.waiting.push_back((errand, password)),
            }
        }
        effects
    }

    fn send_off(&mut self, errand: Errand, work: Work) -> Vec<Effect> {
        self.last_job += 1;
        let stored = self.stored(&errand.what);
        self.errands.insert(self.last_job, Errand { stored, ..errand });
        vec![Effect::Work(self.last_job, work)]
    }

    /// The stored hash of the user that this is about.
    fn stored(&self, what: &What) -> Option<Arc<str>> {
        Some(self.users.as_ref()?.get(what.whose()?)?.hash.clone())
    }

    fn is_stale(&self, errand: &Errand) -> bool {
        let login_number = self.sessions.get(&errand.terminal).map(|session| session.login_number);
        login_number != Some(errand.login_number) || self.stored(&errand.what) != errand.stored
    }

    /// A piece of work is done.
    pub fn done(&mut self, job: Job, outcome: Outcome, at: Timestamp) -> Vec<Effect> {
        let Some(errand) = self.errands.remove(&job) else { return Vec::new() };
        let mut effects = match outcome {
            Outcome::Verified(right) => self.judge(errand, right, at),
            Outcome::Hashed(_) if self.is_stale(&errand) => self.hashed(errand, Err(CHANGED.to_owned()), at),
            Outcome::Hashed(hash) => self.hashed(errand, hash, at),
            Outcome::Failed(why) => self.not_looked_at(errand.terminal, errand.what, why, at),
        };
        effects.extend(self.begin_waiting(at));
        effects
    }

    fn hashed(&mut self, errand: Errand, hash: Result<String, String>, at: Timestamp) -> Vec<Effect> {
        match errand.what {
            What::Hash { ticket, hashing } => self.set_password(errand.terminal, ticket, hashing, hash, at),
            other => self.not_looked_at(errand.terminal, other, "internal error".to_owned(), at),
        }
    }

    fn judge(&mut self, errand: Errand, right: bool, at: Timestamp) -> Vec<Effect> {
        let stale = self.is_stale(&errand);
        let Errand { terminal, key, what, .. } = errand;
        let mut effects = Vec::new();
        let wrong = match self.why_not(&what, right) {
            // Right when it was checked: it does not count as a wrong attempt.
            None if stale => Some(Wrong { why: "changed meanwhile", told: CHANGED.to_owned() }),
            None => {
                self.attempts.on_success(&key);
                None
            }
            Some(why) => {
                effects = self.count_wrong(terminal, &key, what.whose().cloned(), at);
                Some(Wrong { why, told: self.wrong(&key, at) })
            }
        };
        effects.extend(match what {
            What::Login { ticket, user } => self.login_done(terminal, ticket, user, wrong, at),
            What::Unlock { ticket, user } => self.unlock_done(terminal, ticket, user, wrong, at),
            What::Change { ticket, user, new } => self.old_password_done(terminal, ticket, user, new, wrong, at),
            What::Reauthenticate { by, approver, request } => {
                self.on_reauthenticated(terminal, by, approver, *request, wrong, at)
            }
            What::Hash { .. } => Vec::new(),
        });
        effects
    }

    /// What speaks against this attempt, in words for the book; the operator is told less.
    fn why_not(&self, what: &What, right: bool) -> Option<&'static str> {
        let user = what.whose().and_then(|user| self.users.as_ref()?.get(user));
        match (user, right) {
            (None, _) => Some("unknown user"),
            (Some(user), _) if user.disabled => Some("disabled"),
            (Some(_), false) => Some("wrong password"),
            (Some(_), true) => None,
        }
    }

    fn count_wrong(&mut self, terminal: u32, key: &Key, user: Option<Arc<str>>, at: Timestamp) -> Vec<Effect> {
        let locked = self.attempts.on_failure(key, &self.def.access, at);
        let (seconds, origin) = (self.def.access.lockout.as_secs(), &key.origin);
        let Some(session) = self.sessions.get(&terminal) else { return Vec::new() };
        let mut effects = Vec::new();
        if let (true, Some(user)) = (locked.account, user) {
            let outcome = format!("done: for {seconds} s, system user {origin}");
            effects.push(super::audit_entries::audit(session, "lockout", &user, &outcome, at));
            self.publish_status(terminal, &mut effects);
        }
        if locked.origin {
            let outcome = format!("done: for up to {seconds} s");
            effects.push(super::audit_entries::audit(
                session,
                "lockout",
                &format!("system user {origin}"),
                &outcome,
                at,
            ));
        }
        effects
    }

    fn not_looked_at(&mut self, terminal: u32, what: What, why: String, at: Timestamp) -> Vec<Effect> {
        match what {
            What::Login { ticket, .. }
            | What::Unlock { ticket, .. }
            | What::Change { ticket, .. }
            | What::Hash { ticket, .. } => vec![Effect::Reply(ticket, Err(why))],
            What::Reauthenticate { request, .. } => self.refuse_reauthentication(terminal, *request, why, at),
        }
    }

    /// The reply to a wrong attempt: the same whatever was wrong, and how long the next one must wait.
    fn wrong(&self, key: &Key, at: Timestamp) -> String {
        match self.attempts.wait(key, &self.def.access, at) {
            Some(wait) => format!("{WRONG}; wait {} s", wait.as_secs_f64().ceil()),
            None => WRONG.to_owned(),
        }
    }
}

fn not_checked(wait: Duration) -> String {
    format!("password not checked after wrong ones; wait {} s", wait.as_secs_f64().ceil())
}

impl What {
    /// Whose password it is, or will be; `None` for an unknown name.
    fn whose(&self) -> Option<&Arc<str>> {
        match self {
            What::Login { user, .. } => user.as_ref(),
            What::Reauthenticate { approver, .. } => approver.as_ref(),
            What::Unlock { user, .. } | What::Change { user, .. } => Some(user),
            What::Hash { hashing, .. } => Some(hashing.user()),
        }
    }

    /// Does somebody who is not in yet want to be? A logged-in user has attempts of their own, so that others at
    /// the same place cannot block them.
    fn comes_from_outside(&self) -> bool {
        match self {
            What::Login { .. } => true,
            What::Reauthenticate { by, approver, .. } => approver.as_ref() != Some(by),
            What::Unlock { .. } | What::Change { .. } | What::Hash { .. } => false,
        }
    }
}

/// The one message for a wrong name, a wrong password and a disabled user.
pub(super) const WRONG: &str = "wrong name or password";
