//! A plant file or a users file that was changed while the station runs.

use std::sync::Arc;

use jiff::Timestamp;

use super::{AccessControl, Effect, session::SessionState};
use crate::{
    access::{SessionEnd, Users},
    plant::PlantDef,
};

impl AccessControl {
    /// The plant has another definition, in another run. What terminals still ask would mean what it meant before: they go, and
    /// come back to the new one. Requests from outside go with them, unless they `keep` what they know of the plant.
    pub fn redefine(&mut self, def: Arc<PlantDef>, run: u64, keep: bool, at: Timestamp) -> Vec<Effect> {
        let effects = self.hang_up(&SessionEnd::PlantReloaded, |session| session.acts_as.is_none() || !keep, at);
        (self.def, self.run) = (def, run);
        effects
    }

    /// Takes the users of a file that was replaced by hand, unless they are those of here, or were changed here since they had
    /// the digest `before`. `None`: they were not taken.
    pub fn take_users(&mut self, before: Option<&str>, users: Users, at: Timestamp) -> Option<Vec<Effect>> {
        let own = self.users_digest();
        let changed_here = own.as_deref() != before || self.saving.is_some();
        if self.users.is_none() || changed_here || own == Some(users.digest()) {
            return None;
        }
        let mut effects = self.hang_up(&SessionEnd::UsersReloaded, |session| session.acts_as.is_none(), at);
        (self.users, self.closed) = (Some(users), None);
        effects.extend(self.follow_delegates());
        Some(effects)
    }

    /// Closes the sessions that are meant.
    fn hang_up(&mut self, why: &SessionEnd, is_meant: impl Fn(&SessionState) -> bool, at: Timestamp) -> Vec<Effect> {
        let meant = self.sessions.iter().filter(|(_, session)| is_meant(session)).map(|(terminal, _)| *terminal);
        let meant: Vec<u32> = meant.collect();
        let gone = |terminal| [self.close(terminal, at), vec![Effect::HangUp(terminal, why.clone())]].concat();
        meant.into_iter().flat_map(gone).collect()
    }
}
