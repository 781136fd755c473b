//! The session of requests from outside: it acts as a user whom the plant file names, without a password and with no more rights.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    AccessControl, Effect, Peer,
    audit_entries::{audit, clean},
    session::SessionState,
};
use crate::{access::LoggedInUser, plant::recorded_action::RecordedAction};

/// What its refusals are counted under.
const ORIGIN: &str = "requests from outside";

impl AccessControl {
    /// Opens the session of requests from outside, which act as `user`. It counts for no limit of terminals: there is one of it.
    pub fn open_delegate(&mut self, terminal: u32, user: &Arc<str>, from: &str, at: Timestamp) -> Vec<Effect> {
        let peer = Peer { from: clean(from).into(), unix_user: None, in_process: false };
        let mut session = SessionState::new(peer, at);
        (session.origin, session.acts_as) = (ORIGIN.into(), Some(user.clone()));
        (session.who, session.trusted) = (self.delegate(user), true);
        let outcome = if session.who.is_some() { "done: named by the plant file" } else { "refused: no such user" };
        let mut effects = vec![audit(&session, RecordedAction::Login, user, outcome, at)];
        self.sessions.insert(terminal, session);
        self.publish_status(terminal, &mut effects);
        effects
    }

    /// Records that requests from outside were refused before one became a command. The session itself limits how many entries
    /// there are.
    pub fn record_refusal(&self, terminal: u32, what: &str, outcome: &str, at: Timestamp) -> Vec<Effect> {
        let session = self.sessions.get(&terminal).filter(|session| session.acts_as.is_some());
        session
            .map(|session| audit(session, RecordedAction::OutsideRequest, &clean(what), &clean(outcome), at))
            .into_iter()
            .collect()
    }

    /// The user as whom requests act, as long as that user exists and is not disabled.
    fn delegate(&self, name: &Arc<str>) -> Option<LoggedInUser> {
        match self.users.as_ref().and_then(|users| users.get(name)) {
            Some(user) if user.disabled => None,
            Some(user) => {
                Some(LoggedInUser { user: user.name.clone(), role: user.role, must_change: user.must_change })
            }
            None => {
                let (_, role) = self.def.access.trusted.iter().find(|(trusted, _)| trusted.as_str() == &**name)?;
                Some(LoggedInUser { user: name.clone(), role: *role, must_change: false })
            }
        }
    }

    /// Whoever changes, disables or deletes the user changes what requests may do, at once.
    pub(super) fn follow_delegates(&mut self) -> Vec<Effect> {
        let named = |(id, session): (&u32, &SessionState)| Some((*id, session.acts_as.clone()?));
        let delegates: Vec<_> = self.sessions.iter().filter_map(named).collect();
        let mut effects = Vec::new();
        for (terminal, user) in delegates {
            let who = self.delegate(&user);
            if let Some(session) = self.sessions.get_mut(&terminal).filter(|session| session.who != who) {
                session.who = who;
                self.publish_status(terminal, &mut effects);
            }
        }
        effects
    }
}
