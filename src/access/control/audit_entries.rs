//! Builds the audit entries of access control and limits their rate, so that refused requests cannot fill the audit log.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Requester,
    session::{Refusals, SessionState},
};
use crate::{
    access::{SessionRequest, user},
    plant::{
        record::ActionRecord, recorded_action::RecordedAction, request_refusal::RequestRefusal, time::elapsed,
        visible::is_control_or_bidi,
    },
};

/// Most characters of a text that a user can put into the audit log.
const WORDS_MAX: usize = 500;
/// Users of the operating system whose refusals are counted separately; further users share one count.
const ORIGINS_MAX: usize = 512;
/// How often suppressed refusals of one user are recorded as one entry.
const SUMMARY_EVERY: Duration = Duration::from_secs(60);

impl AccessControl {
    /// Checks the request rate of this terminal.
    pub(super) fn within_rate(&mut self, terminal: u32, at: Timestamp) -> bool {
        let Some(session) = self.sessions.get_mut(&terminal) else { return false };
        // The station's own process shares its fate anyway.
        if session.peer.in_process || session.accepts_request(at) {
            return true;
        }
        let origin = session.origin.clone();
        self.refusals_of(&origin, at).unrecorded += 1;
        false
    }

    /// Whether one more refusal, attach or detach of this user gets an entry of its own.
    pub(super) fn may_record(&mut self, origin: &Arc<str>, at: Timestamp) -> bool {
        self.refusals_of(origin, at).count(at)
    }

    fn refusals_of(&mut self, origin: &Arc<str>, at: Timestamp) -> &mut Refusals {
        if ORIGINS_MAX <= self.refusals.len() && !self.refusals.contains_key(origin) {
            self.refusals
                .retain(|_, refusals| refusals.unrecorded > 0 || elapsed(refusals.recorded_at, at) < SUMMARY_EVERY);
        }
        let full = ORIGINS_MAX <= self.refusals.len() && !self.refusals.contains_key(origin);
        let origin = if full { "of many users".into() } else { origin.clone() };
        self.refusals.entry(origin).or_insert_with(|| Refusals::new(at))
    }

    /// Refuses a request and records that.
    pub(super) fn refuse(
        &mut self,
        requester: Requester,
        action: RecordedAction,
        target: &str,
        why: RequestRefusal,
        at: Timestamp,
    ) -> Vec<Effect> {
        let entry = self.refused(requester.terminal, action, target, &why, at);
        entry.into_iter().chain(requester.refused(why)).collect()
    }

    /// The entry of a refusal; none above the rate limit.
    pub(super) fn refused(
        &mut self,
        terminal: u32,
        action: RecordedAction,
        target: &str,
        why: &RequestRefusal,
        at: Timestamp,
    ) -> Option<Effect> {
        let session = self.sessions.get(&terminal)?;
        let (origin, entry) = (session.origin.clone(), audit(session, action, target, &format!("refused: {why}"), at));
        self.may_record(&origin, at).then_some(entry)
    }

    /// One entry a minute and user with the number of refusals that have no entry of their own.
    pub(super) fn summarise_refusals(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = Vec::new();
        for (origin, refusals) in &mut self.refusals {
            if refusals.unrecorded > 0 && elapsed(refusals.recorded_at, at) >= SUMMARY_EVERY {
                let outcome = format!("refused: {} requests", refusals.unrecorded);
                let entry = ActionRecord::new(at, NOT_LOGGED_IN, RecordedAction::TooManyRequests, "", outcome);
                effects.push(Effect::Record(ActionRecord { from: format!("user {origin}").into(), ..entry }));
                (refusals.unrecorded, refusals.recorded_at) = (0, at);
            }
        }
        effects
    }
}

/// What a request is called on record, and whom or what it is about.
pub(super) fn words(request: &SessionRequest) -> (RecordedAction, Arc<str>) {
    // What is typed in the wrong field may be a password.
    let name = |user: &str| if user::check_name(user).is_ok() { user.into() } else { "unknown user".into() };
    match request {
        SessionRequest::Login { .. } => (RecordedAction::Login, "unknown user".into()),
        SessionRequest::Logout => (RecordedAction::Logout, "".into()),
        SessionRequest::Lock => (RecordedAction::Lock, "".into()),
        SessionRequest::Unlock(_) => (RecordedAction::Unlocked, "".into()),
        SessionRequest::Active => (RecordedAction::Active, "".into()),
        SessionRequest::FirstSupervisor { user, .. } => (RecordedAction::AddUser, name(user)),
        SessionRequest::ChangePassword { .. } => (RecordedAction::ChangePassword, "".into()),
        SessionRequest::AddUser { user, .. } => (RecordedAction::AddUser, name(user)),
        SessionRequest::SetRole { user, .. } => (RecordedAction::SetRole, name(user)),
        SessionRequest::Disable { user, disabled: true } => (RecordedAction::DisableUser, name(user)),
        SessionRequest::Disable { user, disabled: false } => (RecordedAction::EnableUser, name(user)),
        SessionRequest::DeleteUser { user } => (RecordedAction::DeleteUser, name(user)),
        SessionRequest::ResetPassword { user, .. } => (RecordedAction::ResetPassword, name(user)),
        SessionRequest::Exported { file, .. } => (RecordedAction::Export, clean(file).into()),
        SessionRequest::Backup { folder } => (RecordedAction::BackUpHistory, clean(folder).into()),
        SessionRequest::Import { file } => (RecordedAction::ImportSamples, clean(file).into()),
        SessionRequest::Stop => (RecordedAction::StopStation, "".into()),
        SessionRequest::Reload => (RecordedAction::Reload, "".into()),
    }
}

const NOT_LOGGED_IN: &str = "not logged in";

pub(super) fn actor_name(session: &SessionState) -> Arc<str> {
    match (&session.who, &session.peer.unix_user) {
        (Some(who), _) => who.user.clone(),
        (None, Some(user)) => format!("not logged in ({user})").into(),
        (None, None) => NOT_LOGGED_IN.into(),
    }
}

pub(super) fn record(
    session: &SessionState,
    action: RecordedAction,
    target: &str,
    outcome: &str,
    at: Timestamp,
) -> ActionRecord {
    let from = session.peer.from.clone();
    ActionRecord { from, ..ActionRecord::new(at, actor_name(session), action, target, outcome) }
}

pub(super) fn audit(
    session: &SessionState,
    action: RecordedAction,
    target: &str,
    outcome: &str,
    at: Timestamp,
) -> Effect {
    Effect::Record(record(session, action, target, outcome, at))
}

/// A text of a terminal for the audit log: limited in length, without control and invisible characters.
pub(super) fn clean(words: &str) -> String {
    words.chars().take(WORDS_MAX).map(|letter| if is_control_or_bidi(letter) { ' ' } else { letter }).collect()
}
