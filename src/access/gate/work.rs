//! What the gate has others do, because it takes as long as a hash: which password is looked at for what, and what then.

use std::sync::Arc;

use jiff::Timestamp;

use super::{Effect, Gate, people::Hashing};
use crate::access::{
    OrderRequest, Secret, password,
    tries::{Account, Origin},
    user,
};

/// Passwords that may be under way at once; more are told to come back.
pub const JOBS_MAX: usize = 16;
/// Said when there are more.
pub const BUSY: &str = "the station is busy with other logins, try again";

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

/// What a piece of work is for.
#[derive(Debug)]
pub(super) struct Errand {
    pub terminal: u32,
    /// Where the password came from; it counts even when the terminal has gone.
    pub origin: Origin,
    pub what: What,
}

#[derive(Debug)]
pub(super) enum What {
    /// The password of `user`, `None` for a name that nobody has.
    Login { ticket: u64, user: Option<Arc<str>> },
    /// Of who sits there.
    Unlock { ticket: u64, user: Arc<str> },
    /// Of who sits there, before he may have a new one.
    Change { ticket: u64, user: Arc<str>, new: Secret },
    /// Of who signs an order.
    Sign { by: Arc<str>, signer: Option<Arc<str>>, request: Box<OrderRequest> },
    /// A new one is hashed.
    Hash { ticket: u64, by: Option<Arc<str>>, hashing: Hashing },
}

/// What was wrong with an attempt.
#[derive(Debug)]
pub(super) struct Wrong {
    /// For the book.
    pub why: &'static str,
    /// For the operator: the same whatever it was, and how long he must wait.
    pub told: String,
}

impl Gate {
    /// Has a password looked at for somebody. `hash` is `None` for a name that nobody has, which must not be seen from the
    /// time it takes. `Err` says in words for the operator why it is not looked at.
    pub(super) fn look_at(
        &mut self,
        terminal: u32,
        password: Secret,
        what: What,
        at: Timestamp,
    ) -> Result<Vec<Effect>, String> {
        let seat = self.seats.get(&terminal).ok_or("this terminal is not attached")?;
        let origin = if what.comes_from_outside() { seat.origin.clone() } else { seat.origin.of_seat(terminal) };
        if JOBS_MAX <= self.errands.len() {
            return Err(BUSY.to_owned());
        }
        let wait = self.tries.begin(&origin, &self.def.access, at);
        wait.map_err(|wait| format!("{WRONG}; wait {} s at this terminal", wait.as_secs_f64().ceil()))?;
        let hash = what.whose().and_then(|user| self.people.as_ref()?.get(user)).map(|user| user.hash.clone());
        let hash = hash.unwrap_or_else(|| password::DUMMY.into());
        Ok(self.send_off(Errand { terminal, origin, what }, Work::Verify { password, hash }))
    }

    /// Has a new password hashed.
    pub(super) fn hash(
        &mut self,
        terminal: u32,
        ticket: u64,
        password: Secret,
        hashing: Hashing,
    ) -> Result<Vec<Effect>, String> {
        let seat = self.seats.get(&terminal).ok_or("this terminal is not attached")?;
        if JOBS_MAX <= self.errands.len() {
            return Err(BUSY.to_owned());
        }
        let by = seat.who.as_ref().map(|who| who.user.clone());
        let (origin, what) = (seat.origin.clone(), What::Hash { ticket, by, hashing });
        Ok(self.send_off(Errand { terminal, origin, what }, Work::Hash(password)))
    }

    fn send_off(&mut self, errand: Errand, work: Work) -> Vec<Effect> {
        self.last_job += 1;
        self.errands.insert(self.last_job, errand);
        vec![Effect::Work(self.last_job, work)]
    }

    /// A piece of work is done.
    pub fn done(&mut self, job: Job, outcome: Outcome, at: Timestamp) -> Vec<Effect> {
        let Some(Errand { terminal, origin, what }) = self.errands.remove(&job) else { return Vec::new() };
        if let What::Hash { ticket, by, hashing } = what {
            let hash = match outcome {
                Outcome::Hashed(hash) => hash,
                Outcome::Verified(_) => Err("internal error".to_owned()),
                Outcome::Failed(why) => Err(why),
            };
            return self.hashed(terminal, ticket, by, hashing, hash, at);
        }
        let right = match outcome {
            Outcome::Verified(right) => Ok(right),
            Outcome::Hashed(_) => Err("internal error".to_owned()),
            Outcome::Failed(why) => Err(why),
        };
        let right = match right {
            Ok(right) => right,
            Err(why) => {
                self.tries.end(&origin);
                return self.not_looked_at(terminal, what, why, at);
            }
        };
        self.judge(terminal, &origin, what, right, at)
    }

    fn judge(&mut self, terminal: u32, origin: &Origin, what: What, right: bool, at: Timestamp) -> Vec<Effect> {
        let account = what.whose().map(|user| user::key(user));
        let why = self.why_not(&what, right, at);
        let mut effects = match (&why, &account) {
            (None, Some(account)) => {
                self.tries.right(origin, account);
                Vec::new()
            }
            _ => self.count_wrong(terminal, origin, account.as_deref(), what.whose().cloned(), at),
        };
        let why = why.map(|why| Wrong { why, told: self.wrong(origin, at) });
        effects.extend(match what {
            What::Login { ticket, user } => self.login_done(terminal, ticket, user, why, at),
            What::Unlock { ticket, user } => self.unlock_done(terminal, ticket, user, why, at),
            What::Change { ticket, user, new } => self.old_password_done(terminal, ticket, user, new, why, at),
            What::Sign { by, signer, request } => self.sign_done(terminal, by, signer, *request, why, at),
            What::Hash { .. } => Vec::new(),
        });
        effects
    }

    /// What speaks against this attempt, in words for the book; the operator is told less.
    fn why_not(&self, what: &What, right: bool, at: Timestamp) -> Option<&'static str> {
        let user = match (what.whose(), &self.people) {
            (Some(user), Some(people)) => people.get(user),
            _ => None,
        };
        let Some(user) = user else { return Some("unknown user") };
        // Who is in already is not to be shut out by what somebody else tries from elsewhere.
        let locked = what.comes_from_outside() && self.tries.locked_until(&user::key(&user.name), at).is_some();
        match (right, user.disabled, locked) {
            (_, _, true) => Some("locked out"),
            (_, true, _) => Some("disabled"),
            (false, ..) => Some("wrong password"),
            (true, false, false) => None,
        }
    }

    fn count_wrong(
        &mut self,
        terminal: u32,
        origin: &Origin,
        account: Account,
        user: Option<Arc<str>>,
        at: Timestamp,
    ) -> Vec<Effect> {
        let locked = self.tries.wrong(origin, account, &self.def.access, at);
        let outcome = format!("done: for {} s", self.def.access.lock_out.as_secs());
        let Some(seat) = self.seats.get(&terminal) else { return Vec::new() };
        let mut effects = Vec::new();
        if let (true, Some(user)) = (locked.account, user) {
            effects.push(super::paper::deed(seat, "lock-out", &user, &outcome, at));
            self.tell(terminal, &mut effects);
        }
        if locked.origin {
            effects.push(super::paper::deed(seat, "lock-out", &format!("terminals of {origin}"), &outcome, at));
        }
        effects
    }

    fn not_looked_at(&mut self, terminal: u32, what: What, why: String, at: Timestamp) -> Vec<Effect> {
        match what {
            What::Login { ticket, .. }
            | What::Unlock { ticket, .. }
            | What::Change { ticket, .. }
            | What::Hash { ticket, .. } => vec![Effect::Reply(ticket, Err(why))],
            What::Sign { request, .. } => self.not_signed(terminal, *request, why, at),
        }
    }

    /// What an operator is told of a wrong attempt: the same whatever was wrong, and how long he must wait here.
    fn wrong(&self, origin: &Origin, at: Timestamp) -> String {
        match self.tries.wait(origin, at) {
            Some(wait) => format!("{WRONG}; wait {} s at this terminal", wait.as_secs_f64().ceil()),
            None => WRONG.to_owned(),
        }
    }
}

impl What {
    /// Whose password it is; `None` for a name that nobody has.
    fn whose(&self) -> Option<&Arc<str>> {
        match self {
            What::Login { user, .. } => user.as_ref(),
            What::Sign { signer, .. } => signer.as_ref(),
            What::Unlock { user, .. } | What::Change { user, .. } => Some(user),
            What::Hash { .. } => None,
        }
    }

    /// Does somebody who is not in yet want to be? Whoever is in already has tries of his own: others at the same place
    /// must not keep him from his work.
    fn comes_from_outside(&self) -> bool {
        match self {
            What::Login { .. } => true,
            What::Sign { by, signer, .. } => signer.as_ref() != Some(by),
            What::Unlock { .. } | What::Change { .. } | What::Hash { .. } => false,
        }
    }
}

/// The one message for a wrong name, a wrong password, somebody disabled and somebody locked out.
pub(super) const WRONG: &str = "wrong name or password, or locked out; try again later";
