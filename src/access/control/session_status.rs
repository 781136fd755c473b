//! The session status of each terminal, and which terminals get it when it changes.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{AccessControl, Effect, session::SessionState};
use crate::{
    access::{SessionRow, SessionStatus, UserRow, Users, user},
    plant::{role::Role, time::elapsed},
};

/// A lock for want of keys is announced so long before.
pub(super) const LOCK_NEAR: Duration = Duration::from_secs(60);

impl AccessControl {
    /// The status of the session of a terminal.
    pub fn session_status(&self, terminal: u32, at: Timestamp) -> SessionStatus {
        let rules = &self.def.access;
        let banner = rules.banner.as_deref().map(Arc::from);
        let Some(session) = self.sessions.get(&terminal) else {
            return SessionStatus { banner, ..SessionStatus::default() };
        };
        let supervisor = session.acting().is_some_and(|who| who.role == Role::Supervisor && !who.must_change);
        let idle_lock = self.idle_lock(session);
        let left = idle_lock.map(|span| span.saturating_sub(elapsed(session.active, at)));
        SessionStatus {
            who: session.who.clone(),
            locked: session.locked,
            may_view: rules.anonymous_view || session.who.is_some(),
            needs_first_supervisor: self.closed.is_none()
                && self.users.as_ref().is_some_and(Users::is_empty)
                && self.is_station_owner(&session.peer),
            banner,
            password_chars_min: rules.password_chars_min,
            idle_lock,
            locks_in: left.filter(|left| *left <= LOCK_NEAR && session.acting().is_some()),
            users: Arc::new(if supervisor { self.user_rows(at) } else { Vec::new() }),
            sessions: Arc::new(if supervisor { self.session_rows() } else { Vec::new() }),
            undelivered: session.undelivered.iter().cloned().collect(),
            gone: None,
        }
    }

    fn user_rows(&self, at: Timestamp) -> Vec<UserRow> {
        let rows = self.users.iter().flat_map(Users::iter).map(|user| UserRow {
            user: user.name.clone(),
            role: user.role,
            disabled: user.disabled,
            locked_until: self
                .attempts
                .locked_until(&user::key(&user.name), &self.def.access, at)
                .map(|at| self.utc(at)),
            must_change: user.must_change,
            last_login: user.last_login,
        });
        rows.collect()
    }

    fn session_rows(&self) -> Vec<SessionRow> {
        let rows = self.sessions.iter().map(|(terminal, session)| SessionRow {
            terminal: *terminal,
            user: session.who.as_ref().map(|who| who.user.clone()),
            from: session.peer.from.clone(),
            since: self.utc(session.since),
            locked: session.locked,
        });
        rows.collect()
    }

    /// Publishes the status to this terminal and to all that see the lists.
    pub(super) fn publish_status(&self, terminal: u32, effects: &mut Vec<Effect>) {
        let sees = |session: &SessionState| session.acting().is_some_and(|who| who.role == Role::Supervisor);
        let others = self.sessions.iter().filter(|(id, session)| **id != terminal && sees(session)).map(|(id, _)| *id);
        let own = self.sessions.contains_key(&terminal).then_some(terminal);
        effects.extend(own.into_iter().chain(others).map(Effect::SessionStatus));
    }
}
