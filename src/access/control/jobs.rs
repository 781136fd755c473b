//! Password jobs: checks and hashes that run outside the loop because each takes some ten milliseconds.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{AccessControl, Effect, Requester, audit_entries::audit};
use crate::access::{Secret, lockout::Key, password, user, user::UserChange};
use crate::plant::{command::Command, recorded_action::RecordedAction, request_refusal::RequestRefusal};

/// Passwords of all users of the operating system that may be checked or wait; more are refused.
pub(super) const JOBS_MAX: usize = 64;
/// This many of one user: the others still have room.
pub(super) const JOBS_OF_USER_MAX: usize = 24;
/// This many places are kept for root and the station's own user.
const JOBS_KEPT: usize = 8;

/// Number of a password job.
pub type JobId = u64;

/// A computation of some ten milliseconds.
#[derive(Debug, Clone, PartialEq)]
pub enum PasswordJob {
    /// Checks a password against a hash.
    Verify {
        /// What was typed.
        password: Secret,
        /// What is kept.
        hash: Arc<str>,
    },
    /// Hashes a password with a fresh salt.
    Hash(Secret),
}

impl PasswordJob {
    /// Runs the job. `salt` must be fresh and random.
    pub fn run(self, salt: [u8; password::SALT_BYTES]) -> JobOutcome {
        match self {
            PasswordJob::Verify { password, hash } => JobOutcome::Verified(password::is(&password.0, &hash)),
            PasswordJob::Hash(password) => JobOutcome::Hashed(password::hash(&password.0, salt)),
        }
    }
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum JobOutcome {
    /// Right or wrong.
    Verified(bool),
    /// The hash.
    Hashed(Result<String, String>),
    /// It was not done.
    Failed(String),
}

/// A job and its purpose. Its result counts only in the same login and for the same stored hash.
#[derive(Debug)]
pub(super) struct PendingJob {
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
    what: JobPurpose,
}

#[derive(Debug)]
pub(super) enum JobPurpose {
    /// The password of `user`; `None` for an unknown name.
    Login { requester: Requester, user: Option<Arc<str>> },
    /// The password of the logged-in user.
    Unlock { requester: Requester, user: Arc<str> },
    /// The present password of the user, before it is changed.
    UserChange { requester: Requester, user: Arc<str>, new: Secret },
    /// The password of the approver.
    Reauthenticate { by: Arc<str>, approver: Option<Arc<str>>, command: Box<Command> },
    /// A new one is hashed.
    Hash { requester: Requester, change: UserChange },
}

/// Why an attempt failed.
#[derive(Debug)]
pub(super) struct JobError {
    /// For the audit log.
    pub why: &'static str,
    /// For the operator: the same for every reason, and how long to wait.
    pub message: RequestRefusal,
}

impl AccessControl {
    /// Has the password for this name checked. The time that takes must not tell whether the name exists.
    /// `Err` says why it is not checked.
    pub(super) fn verify_password(
        &mut self,
        terminal: u32,
        name: &str,
        password: Secret,
        what: JobPurpose,
        at: Timestamp,
    ) -> Result<Vec<Effect>, RequestRefusal> {
        let session = self.session(terminal)?;
        let inside = || format!("{} at terminal {terminal}", session.origin).into();
        let key = Key {
            origin: if what.comes_from_outside() { session.origin.clone() } else { inside() },
            account: user::check_name(name).is_ok().then(|| user::key(name)),
            never_locked: self.is_station_owner(&session.peer),
        };
        let job = self.pending_job(terminal, key, what)?;
        if let Some(wait) = self.attempts.wait(&job.key, &self.def.access, at)
            && !job.key.never_locked
        {
            return Err(RequestRefusal::NotChecked { wait: seconds(wait) });
        }
        self.waiting.push_back((job, password));
        Ok(self.start_waiting_jobs(at))
    }

    /// Has a new password hashed.
    pub(super) fn hash(
        &mut self,
        requester: Requester,
        password: Secret,
        change: UserChange,
    ) -> Result<Vec<Effect>, RequestRefusal> {
        let session = self.session(requester.terminal)?;
        let origin = format!("hash for terminal {}", requester.terminal).into();
        let key = Key { origin, account: None, never_locked: self.is_station_owner(&session.peer) };
        let job = self.pending_job(requester.terminal, key, JobPurpose::Hash { requester, change })?;
        Ok(self.start_job(job, PasswordJob::Hash(password)))
    }

    /// `Err` where too many are under way.
    fn pending_job(&self, terminal: u32, key: Key, what: JobPurpose) -> Result<PendingJob, RequestRefusal> {
        let session = self.session(terminal)?;
        let users = || self.jobs.values().chain(self.waiting.iter().map(|(job, _)| job)).map(|job| &job.user);
        let most = if key.never_locked { JOBS_MAX } else { JOBS_MAX - JOBS_KEPT };
        if most <= users().count() || JOBS_OF_USER_MAX <= users().filter(|user| **user == session.origin).count() {
            return Err(RequestRefusal::BusyWithLogins);
        }
        Ok(PendingJob {
            terminal,
            login_number: session.login_number,
            user: session.origin.clone(),
            key,
            stored: None,
            what,
        })
    }

    /// Begins the checks that have waited for the one before them, or for their time.
    pub(super) fn start_waiting_jobs(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = Vec::new();
        for (job, password) in std::mem::take(&mut self.waiting) {
            let busy = self.jobs.values().any(|other| other.key.origin == job.key.origin);
            match self.attempts.wait(&job.key, &self.def.access, at) {
                _ if !self.sessions.contains_key(&job.terminal) => {}
                None if !busy => {
                    let hash = self.stored(&job.what).unwrap_or_else(|| password::DUMMY.into());
                    effects.extend(self.start_job(job, PasswordJob::Verify { password, hash }));
                }
                Some(wait) if !job.key.never_locked => {
                    effects.extend(self.refuse_job(
                        job.terminal,
                        job.what,
                        RequestRefusal::NotChecked { wait: seconds(wait) },
                        at,
                    ));
                }
                None | Some(_) => self.waiting.push_back((job, password)),
            }
        }
        effects
    }

    fn start_job(&mut self, job: PendingJob, work: PasswordJob) -> Vec<Effect> {
        self.last_job += 1;
        let stored = self.stored(&job.what);
        self.jobs.insert(self.last_job, PendingJob { stored, ..job });
        vec![Effect::Job(self.last_job, work)]
    }

    /// The stored hash of the user that this is about.
    fn stored(&self, what: &JobPurpose) -> Option<Arc<str>> {
        Some(self.users.as_ref()?.get(what.whose()?)?.hash.clone())
    }

    fn is_stale(&self, job: &PendingJob) -> bool {
        let login_number = self.sessions.get(&job.terminal).map(|session| session.login_number);
        login_number != Some(job.login_number) || self.stored(&job.what) != job.stored
    }

    /// A piece of work is done.
    pub fn on_job_done(&mut self, job: JobId, outcome: JobOutcome, at: Timestamp) -> Vec<Effect> {
        let Some(job) = self.jobs.remove(&job) else { return Vec::new() };
        let mut effects = match outcome {
            JobOutcome::Verified(right) => self.on_verified(job, right, at),
            JobOutcome::Hashed(_) if self.is_stale(&job) => self.on_hashed(job, Err(RequestRefusal::LoginChanged), at),
            JobOutcome::Hashed(hash) => self.on_hashed(job, hash.map_err(RequestRefusal::Failed), at),
            JobOutcome::Failed(why) => self.refuse_job(job.terminal, job.what, RequestRefusal::Failed(why), at),
        };
        effects.extend(self.start_waiting_jobs(at));
        effects
    }

    fn on_hashed(&mut self, job: PendingJob, hash: Result<String, RequestRefusal>, at: Timestamp) -> Vec<Effect> {
        match job.what {
            JobPurpose::Hash { requester, change } => self.set_password(requester, change, hash, at),
            other => self.refuse_job(job.terminal, other, RequestRefusal::Failed("internal error".to_owned()), at),
        }
    }

    fn on_verified(&mut self, job: PendingJob, right: bool, at: Timestamp) -> Vec<Effect> {
        let stale = self.is_stale(&job);
        let PendingJob { terminal, key, what, .. } = job;
        let mut effects = Vec::new();
        let wrong = match self.failure_reason(&what, right) {
            // Right when it was checked: it does not count as a wrong attempt.
            None if stale => Some(JobError { why: "changed meanwhile", message: RequestRefusal::LoginChanged }),
            None => {
                self.attempts.on_success(&key);
                None
            }
            Some(why) => {
                effects = self.count_failure(terminal, &key, what.whose().cloned(), at);
                Some(JobError { why, message: self.failure_reply(&key, at) })
            }
        };
        effects.extend(match what {
            JobPurpose::Login { requester, user } => self.login_done(requester, user, wrong, at),
            JobPurpose::Unlock { requester, user } => self.unlock_done(requester, user, wrong, at),
            JobPurpose::UserChange { requester, user, new } => self.old_password_done(requester, user, new, wrong, at),
            JobPurpose::Reauthenticate { by, approver, command } => {
                self.on_reauthenticated(terminal, by, approver, *command, wrong, at)
            }
            JobPurpose::Hash { .. } => Vec::new(),
        });
        effects
    }

    /// Why this attempt fails, for the audit log; the operator gets less.
    fn failure_reason(&self, what: &JobPurpose, right: bool) -> Option<&'static str> {
        let user = what.whose().and_then(|user| self.users.as_ref()?.get(user));
        match (user, right) {
            (None, _) => Some("unknown user"),
            (Some(user), _) if user.disabled => Some("disabled"),
            (Some(_), false) => Some("wrong password"),
            (Some(_), true) => None,
        }
    }

    fn count_failure(&mut self, terminal: u32, key: &Key, user: Option<Arc<str>>, at: Timestamp) -> Vec<Effect> {
        let locked = self.attempts.on_failure(key, &self.def.access, at);
        let (seconds, origin) = (self.def.access.lockout.as_secs(), &key.origin);
        let Some(session) = self.sessions.get(&terminal) else { return Vec::new() };
        let mut effects = Vec::new();
        if let (true, Some(user)) = (locked.account, user) {
            let outcome = format!("done: for {seconds} s, system user {origin}");
            effects.push(audit(session, RecordedAction::Lockout, &user, &outcome, at));
            self.publish_status(terminal, &mut effects);
        }
        if locked.origin {
            let outcome = format!("done: for up to {seconds} s");
            effects.push(audit(session, RecordedAction::Lockout, &format!("system user {origin}"), &outcome, at));
        }
        effects
    }

    fn refuse_job(&mut self, terminal: u32, what: JobPurpose, why: RequestRefusal, at: Timestamp) -> Vec<Effect> {
        match what {
            JobPurpose::Login { requester, .. }
            | JobPurpose::Unlock { requester, .. }
            | JobPurpose::UserChange { requester, .. }
            | JobPurpose::Hash { requester, .. } => requester.refused(why),
            JobPurpose::Reauthenticate { command, .. } => self.refuse_reauthentication(terminal, *command, why, at),
        }
    }

    /// The reply to a wrong attempt: the same whatever was wrong, and how long the next one must wait.
    fn failure_reply(&self, key: &Key, at: Timestamp) -> RequestRefusal {
        let wait = self.attempts.wait(key, &self.def.access, at).map_or(0, seconds);
        RequestRefusal::WrongPassword { wait }
    }
}

/// Whole seconds after which a wait is certainly over.
fn seconds(wait: Duration) -> u64 {
    wait.as_secs() + u64::from(wait.subsec_nanos() > 0)
}

impl JobPurpose {
    /// Whose password it is, or will be; `None` for an unknown name.
    fn whose(&self) -> Option<&Arc<str>> {
        match self {
            JobPurpose::Login { user, .. } => user.as_ref(),
            JobPurpose::Reauthenticate { approver, .. } => approver.as_ref(),
            JobPurpose::Unlock { user, .. } | JobPurpose::UserChange { user, .. } => Some(user),
            JobPurpose::Hash { change, .. } => Some(change.user()),
        }
    }

    /// Whether the attempt comes from a user without a session. A logged-in user has attempts of their own, so that others at
    /// the same place cannot block them.
    fn comes_from_outside(&self) -> bool {
        match self {
            JobPurpose::Login { .. } => true,
            JobPurpose::Reauthenticate { by, approver, .. } => approver.as_ref() != Some(by),
            JobPurpose::Unlock { .. } | JobPurpose::UserChange { .. } | JobPurpose::Hash { .. } => false,
        }
    }
}
