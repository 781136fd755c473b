//! Commands to the plant: rate, run, role, and the reauthentication that a tag requires.

use jiff::Timestamp;

use super::{
    AccessControl, Effect,
    audit_entries::{actor_name, clean},
    right,
};
use crate::{
    access::Credentials,
    plant::{
        command::{self, Command, CommandId, CommandKind, CommandStatus, Refusal},
        interlock,
        request_refusal::RequestRefusal,
    },
};

impl AccessControl {
    /// Checks a command of a terminal and passes it on to the plant, permitted or refused.
    pub fn on_command(
        &mut self,
        terminal: u32,
        mut command: Command,
        credentials: Option<Credentials>,
        at: Timestamp,
    ) -> Vec<Effect> {
        // A terminal speaks for itself only.
        command.id.terminal = terminal;
        command.note = command.note.map(|note| clean(&note).into());
        // A stop is never one command too many.
        let stops = matches!(command.kind, CommandKind::AbortProcedure(_))
            || command.kind.written().is_some_and(|(tag, value)| interlock::is_stop(&self.def, tag, value, None));
        if !self.within_rate(terminal, at) && !stops {
            return self.undelivered(command.id, RequestRefusal::TooManyRequests);
        }
        if command.run != self.run {
            // On record it would name what the plant file of this run has in its place.
            return self.undelivered(command.id, RequestRefusal::OtherRun);
        }
        let mut effects = self.follow_delegates();
        let Some(session) = self.sessions.get_mut(&terminal) else { return Vec::new() };
        let number = command.id.number;
        if session.last_command.is_some_and(|last| number <= last) {
            // Its outcome would be taken for that of the command that had the number first.
            return self.undelivered(command.id, RequestRefusal::RepeatedNumber);
        }
        session.last_command = Some(number);
        if !session.locked {
            session.active = at;
        }
        let passed = match self.may(terminal, Some(right::needs(&self.def, &command.kind))) {
            Err(why) => self.refuse_command(terminal, command, why, Refusal::NotPermitted, at),
            Ok(_) => self.reauthenticate(terminal, command, credentials, at),
        };
        effects.extend(passed);
        effects
    }

    /// The role is enough, and so is the reauthentication.
    pub(super) fn forward_to_plant(
        &self,
        terminal: u32,
        mut command: Command,
        approver: Option<&str>,
        outcome: command::Outcome,
        at: Timestamp,
    ) -> Vec<Effect> {
        let Some(session) = self.sessions.get(&terminal) else { return Vec::new() };
        command.note = match (command.note, approver) {
            (note, None) => note,
            (None, Some(approver)) => Some(format!("approved by {approver}").into()),
            (Some(note), Some(approver)) => Some(format!("{note}; approved by {approver}").into()),
        };
        let from = session.peer.from.clone();
        let status = CommandStatus { from, outcome, ..CommandStatus::new(command, actor_name(session), at) };
        vec![Effect::Command(status)]
    }

    /// A command did not reach the plant: the session status reports it, as no snapshot will.
    pub fn undelivered(&mut self, id: CommandId, why: RequestRefusal) -> Vec<Effect> {
        let Some(session) = self.sessions.get_mut(&id.terminal) else { return Vec::new() };
        session.undelivered(id, why);
        vec![Effect::SessionStatus(id.terminal)]
    }

    /// Sends a refused command to the plant, which records and shows it. Above the rate limit only the session status reports
    /// it.
    pub(super) fn refuse_command(
        &mut self,
        terminal: u32,
        command: Command,
        why: RequestRefusal,
        as_outcome: fn(RequestRefusal) -> Refusal,
        at: Timestamp,
    ) -> Vec<Effect> {
        let Some(session) = self.sessions.get(&terminal) else { return Vec::new() };
        let (origin, in_process) = (session.origin.clone(), session.peer.in_process);
        if !in_process && !self.may_record(&origin, at) {
            return self.undelivered(command.id, why);
        }
        self.forward_to_plant(terminal, command, None, command::Outcome::Refused(as_outcome(why)), at)
    }
}
