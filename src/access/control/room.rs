//! Room for terminals: how many may be attached, and which one goes so that another can come.

use std::time::Duration;

use jiff::Timestamp;

use super::{AccessControl, Effect, passed, session::SessionState};

/// A terminal where nobody is logged in and nobody has asked anything for so long makes room for another.
const IDLE: Duration = Duration::from_secs(600);
/// One of so many sessions is kept for those who run the station: they must get in when all others are taken.
const KEPT: usize = 8;

impl AccessControl {
    /// Is there a seat for this one? One user of the operating system gets half of them at most. `Ok` says what must happen
    /// because of it, `Err` why there is none.
    pub(super) fn make_room(&mut self, new: &SessionState, at: Timestamp) -> Result<Vec<Effect>, String> {
        if new.peer.own {
            return Ok(Vec::new());
        }
        let most = usize::from(self.def.access.sessions_max);
        let host = self.is_host(&new.peer);
        let all = if host { most } else { most - most / KEPT };
        let mut effects = Vec::new();
        // His own first: who gets no session takes none from others.
        if !host {
            let user = &new.origin;
            let his = |session: &SessionState| session.origin == *user;
            effects.extend(self.room_among(his, most.div_ceil(2), &format!(" of {user}"), at)?);
        }
        effects.extend(self.room_among(|_| true, all, "", at)?);
        Ok(effects)
    }

    /// Less than so many of these, after the one that was idle longest has gone if need be.
    fn room_among(
        &mut self,
        counts: impl Fn(&SessionState) -> bool,
        most: usize,
        whose: &str,
        at: Timestamp,
    ) -> Result<Vec<Effect>, String> {
        let these = || self.sessions.iter().filter(|(_, session)| !session.peer.own && counts(session));
        let there = these().count();
        if there < most {
            return Ok(Vec::new());
        }
        let idle = these().filter(|(_, session)| session.who.is_none() && IDLE <= passed(session.active, at));
        let Some(longest) = idle.min_by_key(|(_, session)| session.active).map(|(terminal, _)| *terminal) else {
            return Err(format!("{there} terminals{whose} are attached, no more may be"));
        };
        let mut effects = self.close(longest, at);
        let why = "nobody was logged in here for long, and another terminal needed the room".to_owned();
        effects.push(Effect::HangUp(longest, why));
        Ok(effects)
    }
}
