//! Signatures: what a tag asks for again before it is written.

use std::sync::Arc;

use jiff::Timestamp;

use super::{
    AccessControl, Effect, right,
    work::{What, Wrong},
};
use crate::{
    access::{CommandRequest, Signature, user},
    plant::{
        PlantDef,
        command::{CommandKind, Refusal},
        def::{Sign, TagId},
        interlock,
    },
};

impl AccessControl {
    /// Lets a command through whose role is enough, once it is signed as its tag asks.
    pub(super) fn signed(&mut self, terminal: u32, mut request: CommandRequest, at: Timestamp) -> Vec<Effect> {
        let needed = needed(&self.def, &request.kind).filter(|_| self.users.is_some());
        let sign = request.sign.take();
        let (Some(needed), Some(session)) = (needed, self.sessions.get(&terminal)) else {
            return self.let_through(terminal, request, None);
        };
        let Some(by) = session.who.as_ref().map(|who| who.user.clone()) else { return Vec::new() };
        let own = |name: &str| user::key(name) == user::key(&by);
        let why = match (needed, &sign) {
            (Sign::Password, None) => Some("this tag asks for your password again"),
            (Sign::Password, Some(Signature { user: Some(user), .. })) if !own(user) => {
                Some("this tag asks for your own password")
            }
            (Sign::Password, Some(_)) if session.trusted => {
                Some("this tag asks for a password, and you have none here")
            }
            (Sign::SecondPerson, None | Some(Signature { user: None, .. })) => {
                Some("this tag asks for a second person")
            }
            (Sign::SecondPerson, Some(Signature { user: Some(user), .. })) if own(user) => {
                Some("the second person must be another one")
            }
            (Sign::Password | Sign::SecondPerson, Some(_)) => None,
        };
        let (None, Some(Signature { user, password })) = (why, sign) else {
            return self.not_signed(terminal, request, why.unwrap_or_default().to_owned(), at);
        };
        let name = user.as_deref().unwrap_or(&by).to_owned();
        let signer = self.users.as_ref().and_then(|users| users.get(&name)).map(|user| user.name.clone());
        let (copy, request) = (request.clone(), Box::new(request));
        match self.look_at(terminal, &name, password, What::Sign { by, signer, request }, at) {
            Ok(effects) => effects,
            Err(why) => self.not_signed(terminal, copy, why, at),
        }
    }

    pub(super) fn sign_done(
        &mut self,
        terminal: u32,
        by: Arc<str>,
        signer: Option<Arc<str>>,
        request: CommandRequest,
        wrong: Option<Wrong>,
        at: Timestamp,
    ) -> Vec<Effect> {
        if let Some(Wrong { why, told }) = wrong {
            let mut effects = Vec::new();
            if let Some(session) = self.sessions.get(&terminal) {
                let signer = signer.as_deref().unwrap_or("unknown user");
                effects.push(super::audit_entries::audit(
                    session,
                    "signature failed",
                    signer,
                    &format!("refused: {why}"),
                    at,
                ));
            }
            effects.extend(self.not_signed(terminal, request, told, at));
            return effects;
        }
        let needed = right::needs(&request.kind);
        // Meanwhile the terminal may have been locked.
        if let Err(why) = self.may(terminal, Some(needed)) {
            return self.refuse_command(terminal, request, Refusal::NotPermitted(why), at);
        }
        let other = signer.as_ref().filter(|signer| **signer != by);
        let other = other.and_then(|signer| self.users.as_ref()?.get(signer));
        match other {
            Some(other) if other.must_change => {
                let why = format!("{} must first choose a password of his own", other.name);
                self.not_signed(terminal, request, why, at)
            }
            Some(other) if other.role < needed => {
                let why = format!("{} may not sign this: it is for a {}", other.name, needed.word());
                self.not_signed(terminal, request, why, at)
            }
            Some(_) | None => self.let_through(terminal, request, signer.as_deref()),
        }
    }

    pub(super) fn not_signed(
        &mut self,
        terminal: u32,
        request: CommandRequest,
        why: String,
        at: Timestamp,
    ) -> Vec<Effect> {
        self.refuse_command(terminal, request, Refusal::NotSigned(why), at)
    }
}

/// What a command must be signed with. A stop never waits for a signature.
pub fn needed(def: &PlantDef, kind: &CommandKind) -> Option<Sign> {
    let asks = |tag: TagId, value: f64| {
        let sign = def.tags.get(tag.index())?.sign?;
        (!interlock::is_stop(def, tag, value)).then_some(sign)
    };
    let strictest = |one: Option<Sign>, other: Option<Sign>| match (one, other) {
        (Some(Sign::SecondPerson), _) | (_, Some(Sign::SecondPerson)) => Some(Sign::SecondPerson),
        (Some(Sign::Password), _) | (_, Some(Sign::Password)) => Some(Sign::Password),
        (None, None) => None,
    };
    match kind {
        CommandKind::Write { tag, value } => asks(*tag, *value),
        CommandKind::Restore(request) => {
            request.changes.iter().map(|change| asks(change.tag, change.new)).fold(None, strictest)
        }
        CommandKind::Alarm(_)
        | CommandKind::Refresh(_)
        | CommandKind::Connect(..)
        | CommandKind::Configure(_)
        | CommandKind::SaveSettings(_)
        | CommandKind::Test(..)
        | CommandKind::StopTest(_)
        | CommandKind::ReadSets
        | CommandKind::SaveSet { .. }
        | CommandKind::StopRestore(_)
        | CommandKind::HandOver
        | CommandKind::TakeOver => None,
    }
}
