//! How many terminals may be attached, and which idle one is closed to admit another.

use std::time::Duration;

use jiff::Timestamp;

use super::{AccessControl, Effect, session::SessionState};
use crate::{access::SessionEnd, plant::time::elapsed};

/// A terminal without login and without a request for so long is closed when another needs its place.
const IDLE: Duration = Duration::from_secs(600);
/// One of this many sessions is kept for root, the user of the station and those that the plant file trusts.
const KEPT: usize = 8;

impl AccessControl {
    /// Admits a session. One user of the operating system gets at most half of all. `Ok`: the effects; `Err`: why not.
    pub(super) fn admit(&mut self, new: &SessionState, at: Timestamp) -> Result<Vec<Effect>, SessionEnd> {
        if new.peer.in_process {
            return Ok(Vec::new());
        }
        let most = usize::from(self.def.access.sessions_max);
        let is_owner = self.is_station_owner(&new.peer);
        let all = if is_owner || self.known(&new.peer).is_some() { most } else { most - most / KEPT };
        let mut effects = Vec::new();
        // Sessions of the same user first: a user at the limit closes none of others.
        if !is_owner {
            let user = &new.origin;
            let of_user = |session: &SessionState| session.origin == *user;
            effects.extend(self.limit_among(of_user, most.div_ceil(2), Some(user), at)?);
        }
        effects.extend(self.limit_among(|_| true, all, None, at)?);
        Ok(effects)
    }

    /// Keeps these below `most`: closes the one that was idle longest if necessary.
    fn limit_among(
        &mut self,
        counts: impl Fn(&SessionState) -> bool,
        most: usize,
        user: Option<&str>,
        at: Timestamp,
    ) -> Result<Vec<Effect>, SessionEnd> {
        let is_terminal = |session: &SessionState| !session.peer.in_process && session.acts_as.is_none();
        let these = || self.sessions.iter().filter(|(_, session)| is_terminal(session) && counts(session));
        let there = these().count();
        if there < most {
            return Ok(Vec::new());
        }
        let idle = these().filter(|(_, session)| session.who.is_none() && IDLE <= elapsed(session.active, at));
        let Some(longest) = idle.min_by_key(|(_, session)| session.active).map(|(terminal, _)| *terminal) else {
            return Err(SessionEnd::TooMany { count: there, user: user.map(str::to_owned) });
        };
        let mut effects = self.close(longest, at);
        effects.push(Effect::HangUp(longest, SessionEnd::Idle));
        Ok(effects)
    }
}
