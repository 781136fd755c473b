//! The access-control state machine: takes the requests of terminals and returns what is permitted. Rights are decided here only.

mod history_jobs;
mod commands;
mod delegate;
mod login;
mod audit_entries;
mod redefine;
mod user_admin;
mod session_limit;
mod session;
pub mod reauthentication;
mod session_status;
#[cfg(test)]
mod tests;
mod jobs;

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
};

use jiff::{SignedDuration, Timestamp};

use self::{
    audit_entries::{audit, clean, record, words},
    jobs::PendingJob,
    session::{Refusals, SessionState},
    user_admin::Saving,
};
use super::{
    LoggedInUser, Secret, SessionEnd, SessionRequest,
    lockout::LoginAttempts,
    right,
    user::{UserChange, Users},
};
use crate::{
    history::Query,
    plant::{
        PlantDef,
        command::{CommandStatus, Refusal},
        record::ActionRecord,
        recorded_action::RecordedAction,
        request_refusal::RequestRefusal,
        role::Role,
    },
};

pub use jobs::{JobId, JobOutcome, PasswordJob};

/// Where a terminal is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Peer {
    /// `pts/3 from 10.0.0.5, user panel`.
    pub from: Arc<str>,
    /// The user of the operating system, as the system says.
    pub unix_user: Option<Arc<str>>,
    /// It belongs to the process of the station.
    pub in_process: bool,
}

/// Of what is begun: what becomes of a stop or a reload has an entry of the station behind it.
const PERMITTED: (Option<Arc<str>>, &str) = (None, "permitted");

/// Who waits for the reply to a request.
#[derive(Debug, Clone, Copy)]
struct Requester {
    terminal: u32,
    ticket: u64,
}

impl Requester {
    fn done(self) -> Effect {
        Effect::Reply(self.ticket, Ok(()))
    }

    fn refused(self, why: RequestRefusal) -> Vec<Effect> {
        vec![Effect::Reply(self.ticket, Err(why))]
    }
}

/// What must happen because of what was asked.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Hand this command to the plant, permitted or refused.
    Command(CommandStatus),
    /// Put this into the audit log.
    Record(ActionRecord),
    /// Answer a request.
    Reply(u64, Result<(), RequestRefusal>),
    /// The session status of this terminal has changed.
    SessionStatus(u32),
    /// Run this job, then call [`AccessControl::on_job_done`]. At most `JOBS_MAX` are under way or wait.
    Job(JobId, PasswordJob),
    /// Save the users, then call [`AccessControl::on_saved`]. Never two at a time.
    Save(Users),
    /// End the station.
    Stop,
    /// Reload the plant file, and a users file of another digest; the reply is sent once they are checked.
    Reload(u64, Option<String>),
    /// Write a backup into this folder, then call [`AccessControl::on_history_job_done`].
    Backup(u64, String),
    /// Import this file into the history, then the same.
    Import(u64, String),
    /// This terminal may not stay.
    HangUp(u32, SessionEnd),
}

/// The state of users, sessions and pending requests.
#[derive(Debug, Default)]
pub struct AccessControl {
    def: Arc<PlantDef>,
    /// The run of the station: commands made in another one are refused.
    run: u64,
    /// What its times lack of UTC.
    behind_utc: SignedDuration,
    /// `None` where login is not required: in a demonstration.
    users: Option<Users>,
    /// Why login is disabled: the users file could not be read.
    closed: Option<Arc<str>>,
    /// The user of the operating system that the station runs as.
    service_account: Option<Arc<str>>,
    sessions: BTreeMap<u32, SessionState>,
    attempts: LoginAttempts,
    refusals: BTreeMap<Arc<str>, Refusals>,
    jobs: BTreeMap<JobId, PendingJob>,
    /// Passwords that wait for the one before them of the same origin, or for their time.
    waiting: VecDeque<(PendingJob, Secret)>,
    last_job: JobId,
    saving: Option<Saving>,
    /// A change that waits until last logins are written.
    next: Option<(Requester, UserChange)>,
    /// A last login is not saved yet.
    unsaved: bool,
    /// The entries of backups and imports that are under way.
    history_jobs: BTreeMap<u64, ActionRecord>,
}

impl AccessControl {
    /// Access control without login: root, the user of the station and its own process may do everything. `service_account` is the user of the operating
    /// system that the station runs as.
    pub fn new(def: Arc<PlantDef>, service_account: Option<Arc<str>>) -> AccessControl {
        AccessControl { def, service_account, ..AccessControl::default() }
    }

    /// Access control with these users. `service_account` is the user of the operating system that the station runs as.
    pub fn with_users(def: Arc<PlantDef>, users: Users, service_account: Option<Arc<str>>) -> AccessControl {
        AccessControl { users: Some(users), ..AccessControl::new(def, service_account) }
    }

    /// Login is closed because the users file is damaged; `why` is the reply to each attempt.
    pub fn closed(def: Arc<PlantDef>, why: &str, service_account: Option<Arc<str>>) -> AccessControl {
        AccessControl { closed: Some(why.into()), ..AccessControl::with_users(def, Users::default(), service_account) }
    }

    /// The same, in this run of the station.
    pub fn in_run(self, run: u64) -> AccessControl {
        AccessControl { run, ..self }
    }

    /// The [`Users::digest`] of its users; `None` in a demonstration, or while login is disabled.
    pub fn users_digest(&self) -> Option<String> {
        self.users.as_ref().filter(|_| self.closed.is_none()).map(Users::digest)
    }

    /// Why login is disabled, if it is.
    pub fn is_closed(&self) -> Option<RequestRefusal> {
        self.closed.as_ref().map(|why| RequestRefusal::LoginDisabled(why.to_string()))
    }

    /// A terminal has attached.
    pub fn open(&mut self, terminal: u32, peer: Peer, at: Timestamp) -> Vec<Effect> {
        let peer = Peer { from: clean(&peer.from).into(), ..peer };
        let (in_process, mut session) = (peer.in_process, SessionState::new(peer, at));
        let mut effects = match self.admit(&session, at) {
            Ok(effects) => effects,
            Err(why) => {
                let entry = audit(&session, RecordedAction::Attach, "", &format!("refused: {why}"), at);
                let recorded = self.may_record(&session.origin, at).then_some(entry);
                return recorded.into_iter().chain([Effect::HangUp(terminal, why)]).collect();
            }
        };
        session.who = self.known(&session.peer);
        session.trusted = session.who.is_some();
        if !in_process && self.may_record(&session.origin.clone(), at) {
            effects.push(audit(&session, RecordedAction::Attach, "", "done", at));
        }
        if let Some(who) = &session.who
            && self.users.is_some()
        {
            effects.push(audit(&session, RecordedAction::Login, &who.user, "done: known to the operating system", at));
        }
        self.sessions.insert(terminal, session);
        self.publish_status(terminal, &mut effects);
        effects
    }

    /// Who is known without a password.
    fn known(&self, peer: &Peer) -> Option<LoggedInUser> {
        let user = peer.unix_user.clone();
        let role = match (&self.users, &user) {
            (None, _) if self.is_station_owner(peer) => Some(Role::Supervisor),
            (_, Some(name)) => {
                self.def.access.trusted.iter().find(|(trusted, _)| trusted.as_str() == &**name).map(|(_, role)| *role)
            }
            (_, None) => None,
        };
        let user = user.unwrap_or_else(|| "operator".into());
        role.map(|role| LoggedInUser { user, role, must_change: false })
    }

    /// A terminal has gone.
    pub fn close(&mut self, terminal: u32, at: Timestamp) -> Vec<Effect> {
        let mut effects = self.log_out(terminal, "done: terminal disconnected", at);
        let Some(session) = self.sessions.remove(&terminal) else { return effects };
        if !session.peer.in_process && self.may_record(&session.origin, at) {
            effects.push(audit(&session, RecordedAction::Detach, "", "done", at));
        }
        self.publish_status(terminal, &mut effects);
        effects
    }

    /// May this terminal ask this of the history? `Err` says why not, and what must happen because of it.
    pub fn may_ask(&mut self, terminal: u32, query: &Query, at: Timestamp) -> Result<(), (String, Vec<Effect>)> {
        if !self.within_rate(terminal, at) {
            return Err((RequestRefusal::TooManyRequests.to_string(), Vec::new()));
        }
        let needed = right::needs_for_query(query);
        let may =
            if needed == Role::Viewer { self.may_look(terminal) } else { self.may(terminal, Some(needed)).map(drop) };
        let Err(why) = may else {
            return match query {
                Query::Registers(read) if self.def.listens_on(read.line) => {
                    Err((Refusal::OnlyListens.to_string(), Vec::new()))
                }
                _ => Ok(()),
            };
        };
        // Only a refused read of the audit log is recorded.
        let is_audit = matches!(query, Query::Audit { .. });
        let entry = if is_audit { self.refused(terminal, RecordedAction::ReadAuditLog, "", &why, at) } else { None };
        Err((why.to_string(), entry.into_iter().collect()))
    }

    fn session(&self, terminal: u32) -> Result<&SessionState, RequestRefusal> {
        self.sessions.get(&terminal).ok_or(RequestRefusal::NotAttached)
    }

    fn may_look(&self, terminal: u32) -> Result<(), RequestRefusal> {
        match &self.session(terminal)?.who {
            // Locked or not: the snapshot stays, and so does what lies behind it.
            Some(who) if who.must_change => Err(RequestRefusal::ChoosePasswordFirst),
            Some(_) => Ok(()),
            None if self.def.access.anonymous_view => Ok(()),
            None => Err(RequestRefusal::LogInFirst),
        }
    }

    /// Handles a request; the reply goes to the ticket.
    pub fn on_request(&mut self, terminal: u32, ticket: u64, request: SessionRequest, at: Timestamp) -> Vec<Effect> {
        let requester = Requester { terminal, ticket };
        if !self.within_rate(terminal, at) {
            return requester.refused(RequestRefusal::TooManyRequests);
        }
        let needed = right::needs_for_request(&request);
        if let (Some(_), Err(why)) = (needed, self.may(terminal, needed))
            && !self.could_anyway(terminal, &request)
        {
            let (action, target) = words(&request);
            return self.refuse(requester, action, &target, why, at);
        }
        if let Some(session) = self.sessions.get_mut(&terminal).filter(|session| !session.locked) {
            session.active = at;
        }
        match request {
            SessionRequest::Login { user, password } => self.login(requester, &user, password, at),
            SessionRequest::Logout => self.logout(requester, at),
            SessionRequest::Lock => self.lock(requester, at),
            SessionRequest::Unlock(password) => self.unlock(requester, password, at),
            SessionRequest::Active => vec![requester.done(), Effect::SessionStatus(terminal)],
            SessionRequest::Exported { file, sha256 } => {
                let file: Arc<str> = clean(&file).into();
                let (new, outcome) = match sha256 {
                    Ok(sha256) => (Some(clean(&sha256).into()), "done".to_owned()),
                    Err(why) => (None, format!("failed: {}", clean(&why))),
                };
                self.record_and_reply(requester, RecordedAction::Export, &file, (new, &outcome), at)
            }
            SessionRequest::Backup { folder } => self.begin_backup(requester, folder, at),
            SessionRequest::Import { file } => self.begin_import(requester, file, at),
            SessionRequest::Stop => {
                let mut effects =
                    self.record_and_reply(requester, RecordedAction::StopStation, &self.plant_name(), PERMITTED, at);
                effects.push(Effect::Stop);
                effects
            }
            SessionRequest::Reload => {
                let mut effects =
                    self.record_and_reply(requester, RecordedAction::Reload, &self.plant_name(), PERMITTED, at);
                effects.retain(|effect| !matches!(effect, Effect::Reply(..)));
                effects.push(Effect::Reload(ticket, self.users_digest()));
                effects
            }
            request @ (SessionRequest::FirstSupervisor { .. }
            | SessionRequest::ChangePassword { .. }
            | SessionRequest::AddUser { .. }
            | SessionRequest::SetRole { .. }
            | SessionRequest::Disable { .. }
            | SessionRequest::DeleteUser { .. }
            | SessionRequest::ResetPassword { .. }) => self.user_admin_request(requester, request, at),
        }
    }

    /// Stopping the station, reloading its plant file, a backup or an import need no login of those who can do so with the means of the
    /// operating system (its init system, for one), whatever role they have here without a password. Who logged in acts as that user.
    fn could_anyway(&self, terminal: u32, request: &SessionRequest) -> bool {
        let without_login =
            |session: &&SessionState| (session.who.is_none() || session.trusted) && !session.peer.in_process;
        let session = self.sessions.get(&terminal).filter(without_login);
        let of_station = matches!(
            request,
            SessionRequest::Stop
                | SessionRequest::Reload
                | SessionRequest::Backup { .. }
                | SessionRequest::Import { .. }
        );
        of_station && session.is_some_and(|session| self.is_station_owner(&session.peer))
    }

    fn plant_name(&self) -> Arc<str> {
        self.def.name.as_str().into()
    }

    /// Records the action with its new value and outcome, and replies once it is durable.
    fn record_and_reply(
        &self,
        requester: Requester,
        action: RecordedAction,
        target: &str,
        (new, outcome): (Option<Arc<str>>, &str),
        at: Timestamp,
    ) -> Vec<Effect> {
        let Some(session) = self.sessions.get(&requester.terminal) else { return Vec::new() };
        let record = ActionRecord { new, ..record(session, action, target, outcome, at) };
        vec![Effect::Record(record), requester.done()]
    }

    /// Time passes.
    pub fn tick(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = self.lock_idle(at);
        effects.extend(self.follow_delegates());
        effects.extend(self.summarise_refusals(at));
        effects.extend(self.start_waiting_jobs(at));
        if self.unsaved && self.saving.is_none() {
            effects.extend(self.save_logins());
        }
        effects
    }

    /// The system clock was set, or not: effects carry UTC, internal times are monotonic.
    pub fn follow_clock(&mut self, behind_utc: SignedDuration) -> Vec<Effect> {
        if self.behind_utc == behind_utc {
            return Vec::new();
        }
        self.behind_utc = behind_utc;
        self.sessions.keys().copied().map(Effect::SessionStatus).collect()
    }

    fn utc(&self, at: Timestamp) -> Timestamp {
        at.checked_add(self.behind_utc).unwrap_or(at)
    }

    /// The user, if the role is sufficient. `Err` is the reply to the user.
    fn may(&self, terminal: u32, needed: Option<Role>) -> Result<&LoggedInUser, RequestRefusal> {
        let session = self.session(terminal)?;
        let unknown = || match &session.acts_as {
            Some(user) => RequestRefusal::NoSuchDelegate(user.to_string()),
            None => RequestRefusal::LogInFirst,
        };
        let who = session.who.as_ref().ok_or_else(unknown)?;
        if session.locked {
            return Err(RequestRefusal::Locked);
        }
        if who.must_change {
            return Err(RequestRefusal::ChoosePasswordFirst);
        }
        enough(who.role, needed.unwrap_or(Role::Viewer))?;
        Ok(who)
    }
}

fn enough(role: Role, needed: Role) -> Result<(), RequestRefusal> {
    if needed <= role { Ok(()) } else { Err(RequestRefusal::Role { needed, role }) }
}
