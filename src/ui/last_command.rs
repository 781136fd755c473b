//! The last command of this terminal, from the key to its outcome.

use super::{Effect, Model, command_text::outcome_words, modal::Modal};
use crate::t;
use crate::{
    access::Credentials,
    plant::{
        command::{Command, CommandId, CommandStatus, Outcome, Refusal},
        request_refusal::RequestRefusal,
    },
};

/// An outcome that is no worry is shown for this many ticks: a minute of real time.
const OUTCOME_TICKS: u32 = 120;

/// A command of this terminal on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct LastCommand {
    /// The command as it was sent.
    pub command: Command,
    /// As last seen in a snapshot.
    pub status: Option<CommandStatus>,
    /// Tick at which it was given, and at which its outcome last changed.
    pub changed_at: u32,
    /// Why it did not reach the plant.
    pub undelivered: Option<RequestRefusal>,
}

impl LastCommand {
    /// Has it ended in a way that its operator must read?
    pub fn is_trouble(&self) -> bool {
        let outcome = self.status.as_ref().map(|status| &status.outcome);
        self.undelivered.is_some() || outcome.is_some_and(|outcome| outcome_words(outcome).1)
    }

    /// Has it ended well? Such an outcome leaves the screen by itself; trouble stays, with its time, until it is
    /// dismissed.
    fn is_done(&self) -> bool {
        let outcome = self.status.as_ref().map(|status| &status.outcome);
        outcome.is_some_and(|outcome| *outcome != Outcome::Pending && !outcome_words(outcome).1)
    }

    /// Has its outcome been on the screen for long enough?
    pub fn is_over(&self, phase: u32) -> bool {
        self.is_done() && phase.wrapping_sub(self.changed_at) >= OUTCOME_TICKS
    }
}

impl Model {
    /// Numbers a command, sends it and follows it. Without a station it is reported as not sent.
    pub(super) fn send_command(&mut self, command: Command, credentials: Option<Credentials>) -> Option<Effect> {
        self.commands_sent = self.commands_sent.wrapping_add(1);
        let id = CommandId { terminal: self.terminal, number: self.commands_sent };
        let undelivered = self.session.gone.as_ref().map(|_| RequestRefusal::Disconnected);
        let changed_at = self.clock.phase;
        let expected_value = command.expected_value.or_else(|| self.snapshot.expected_value(&command.kind));
        let command = Command { id, run: self.snapshot.run, expected_value, ..command };
        let is_sent = undelivered.is_none();
        self.last_command = Some(LastCommand { command: command.clone(), status: None, changed_at, undelivered });
        is_sent.then_some(Effect::Command(command, credentials))
    }

    /// Notes that the last command did not reach the plant.
    pub(super) fn note_undelivered(&mut self, id: CommandId, why: RequestRefusal) {
        if let Some(last) = self.last_command.as_mut().filter(|last| last.command.id == id) {
            last.undelivered = Some(why);
        }
    }

    /// Reads the outcome of the last command from the new snapshot.
    pub(super) fn follow(&mut self) {
        if let Some(last) = &mut self.last_command
            && let Some(status) = self.snapshot.commands.iter().find(|status| status.command.id == last.command.id)
        {
            if last.status.as_ref() != Some(status) {
                last.changed_at = self.clock.phase;
            }
            last.status = Some(status.clone());
        }
    }

    /// Ends the wait of a window for the check of its credentials; refused ones are asked for again.
    pub(super) fn close_confirmation(&mut self) {
        let Some(last) = &self.last_command else { return };
        let refused = match (&last.undelivered, last.status.as_ref().map(|status| &status.outcome)) {
            (Some(why), _) => Some(t!("not sent: {why}", why)),
            (None, Some(Outcome::Refused(Refusal::NotReauthenticated(why)))) => Some(why.to_string()),
            (None, Some(_)) => None,
            (None, None) => return,
        };
        let waits = |modal: &Modal| matches!(modal, Modal::Confirm(confirm) if confirm.is_waiting());
        if let Some(Modal::Confirm(confirm)) = self.modal.take_if(|modal| waits(modal)) {
            self.modal = confirm.answered(refused);
        } else if let Some((tab, Modal::Confirm(confirm))) = self.kept.take_if(|(_, modal)| waits(modal)) {
            // A lock has taken it away.
            self.kept = confirm.answered(refused).map(|modal| (tab, modal));
        }
    }
}
