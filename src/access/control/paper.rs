//! What access control puts on record, in which words, and how much of it: nobody fills the book by asking for what he may not.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    AccessControl, Effect, passed,
    session::{Refusals, SessionState},
};
use crate::{
    access::{Wish, user},
    plant::{record::ActionRecord, visible::acts},
};

/// Most characters of what somebody may put on record in his own words.
const WORDS_MAX: usize = 500;
/// Users of the operating system whose refusals are counted apart; what more there are share one count.
const ORIGINS_MAX: usize = 512;
/// What was refused too often to be told each time is told so often.
const TOLD_EVERY: Duration = Duration::from_secs(60);

impl AccessControl {
    /// Is a request of this terminal listened to?
    pub(super) fn heard(&mut self, terminal: u32, at: Timestamp) -> bool {
        let Some(session) = self.sessions.get_mut(&terminal) else { return false };
        // The station's own process shares its fate anyway.
        if session.peer.own || session.requests.take(at) {
            return true;
        }
        let origin = session.origin.clone();
        self.refusals_of(&origin, at).untold += 1;
        false
    }

    /// May one more refusal, or coming and going, of this place be on record by itself?
    pub(super) fn may_record(&mut self, origin: &Arc<str>, at: Timestamp) -> bool {
        self.refusals_of(origin, at).one(at)
    }

    fn refusals_of(&mut self, origin: &Arc<str>, at: Timestamp) -> &mut Refusals {
        if ORIGINS_MAX <= self.refusals.len() && !self.refusals.contains_key(origin) {
            self.refusals.retain(|_, refusals| refusals.untold > 0 || passed(refusals.told, at) < TOLD_EVERY);
        }
        let full = ORIGINS_MAX <= self.refusals.len() && !self.refusals.contains_key(origin);
        let origin = if full { "of many users".into() } else { origin.clone() };
        self.refusals.entry(origin).or_insert_with(|| Refusals::new(at))
    }

    /// The record of a refusal, unless there are too many of them.
    pub(super) fn refused(
        &mut self,
        session: &SessionState,
        action: &str,
        target: &str,
        why: &str,
        at: Timestamp,
    ) -> Vec<Effect> {
        let told = self.may_record(&session.origin, at);
        told.then(|| deed(session, action, target, &format!("refused: {why}"), at)).into_iter().collect()
    }

    /// What was refused too often to be told each time, a line a minute for each place.
    pub(super) fn told_late(&mut self, at: Timestamp) -> Vec<Effect> {
        let mut effects = Vec::new();
        for (origin, refusals) in &mut self.refusals {
            if refusals.untold > 0 && passed(refusals.told, at) >= TOLD_EVERY {
                let outcome = format!("refused: {} requests", refusals.untold);
                effects.push(Effect::Record(ActionRecord {
                    at,
                    by: "not logged in".into(),
                    from: format!("user {origin}").into(),
                    action: "too many requests".into(),
                    target: "".into(),
                    old: None,
                    new: None,
                    outcome: outcome.into(),
                    note: None,
                    seal: None,
                }));
                (refusals.untold, refusals.told) = (0, at);
            }
        }
        effects
    }
}

/// What a wish is called on record, and whom or what it is about.
pub(super) fn words(wish: &Wish) -> (&'static str, Arc<str>) {
    // What is typed in the wrong field may be a password.
    let name = |user: &str| if user::check_name(user).is_ok() { user.into() } else { "unknown user".into() };
    match wish {
        Wish::Login { .. } => ("login", "unknown user".into()),
        Wish::Logout => ("logout", "".into()),
        Wish::Lock => ("lock terminal", "".into()),
        Wish::Unlock(_) => ("unlock terminal", "".into()),
        Wish::Active => ("active", "".into()),
        Wish::FirstSupervisor { user, .. } => ("add user", name(user)),
        Wish::ChangePassword { .. } => ("change password", "".into()),
        Wish::AddUser { user, .. } => ("add user", name(user)),
        Wish::SetRole { user, .. } => ("set role", name(user)),
        Wish::Disable { user, disabled: true } => ("disable user", name(user)),
        Wish::Disable { user, disabled: false } => ("enable user", name(user)),
        Wish::DeleteUser { user } => ("delete user", name(user)),
        Wish::ResetPassword { user, .. } => ("reset password", name(user)),
        Wish::Exported { file, .. } => ("export", clean(file).into()),
        Wish::Stop => ("stop station", "".into()),
        Wish::Reload => ("reload", "".into()),
    }
}

pub(super) fn actor_name(session: &SessionState) -> Arc<str> {
    match (&session.who, &session.peer.unix_user) {
        (Some(who), _) => who.user.clone(),
        (None, Some(user)) => format!("not logged in ({user})").into(),
        (None, None) => "not logged in".into(),
    }
}

pub(super) fn record(session: &SessionState, action: &str, target: &str, outcome: &str, at: Timestamp) -> ActionRecord {
    ActionRecord {
        at,
        by: actor_name(session),
        from: session.peer.from.clone(),
        action: action.into(),
        target: target.into(),
        old: None,
        new: None,
        outcome: outcome.into(),
        note: None,
        seal: None,
    }
}

pub(super) fn deed(session: &SessionState, action: &str, target: &str, outcome: &str, at: Timestamp) -> Effect {
    Effect::Record(record(session, action, target, outcome, at))
}

/// Words of a terminal as they may stand on record: not endless, and nothing that moves a cursor or hides in the text.
pub(super) fn clean(words: &str) -> String {
    words.chars().take(WORDS_MAX).map(|letter| if acts(letter) { ' ' } else { letter }).collect()
}
