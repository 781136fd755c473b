//! The last command of this terminal, from the key to its outcome.

use std::sync::Arc;

use super::{Effect, Model, chrome, modal::Modal};
use crate::{
    access::{CommandRequest, Credentials},
    plant::command::{CommandId, CommandKind, CommandStatus, Outcome, Refusal},
};

/// An outcome that is no worry is shown for so many ticks: a minute of real time.
const OUTCOME_TICKS: u32 = 120;

/// A command as its operator confirmed it.
#[derive(Debug, Clone, PartialEq)]
pub struct Confirmed {
    /// What.
    pub kind: CommandKind,
    /// The displayed value of the tag to be written; `None` where it was not known.
    pub expected: Option<f64>,
    /// What a tag asks for again.
    pub credentials: Option<Credentials>,
    /// Why, in his words.
    pub note: Option<Arc<str>>,
}

impl From<CommandKind> for Confirmed {
    /// A command that nothing was asked about.
    fn from(kind: CommandKind) -> Confirmed {
        Confirmed { kind, expected: None, credentials: None, note: None }
    }
}

/// A command of this terminal on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct PendingCommand {
    /// Which.
    pub id: CommandId,
    /// What was requested.
    pub kind: CommandKind,
    /// As last seen in a snapshot.
    pub status: Option<CommandStatus>,
    /// Tick at which it was given, and at which its outcome last changed.
    pub changed_at: u32,
    /// Why it never left the terminal.
    pub undelivered: Option<&'static str>,
}

impl PendingCommand {
    /// Has it ended in a way that its operator must read?
    pub fn is_trouble(&self) -> bool {
        let outcome = self.status.as_ref().map(|status| &status.outcome);
        self.undelivered.is_some() || outcome.is_some_and(|outcome| chrome::outcome_words(outcome).1)
    }

    /// Has it ended well? Such an outcome leaves the screen by itself; trouble stays, with its time, until it is
    /// dismissed.
    fn is_done(&self) -> bool {
        let outcome = self.status.as_ref().map(|status| &status.outcome);
        outcome.is_some_and(|outcome| *outcome != Outcome::Pending && !chrome::outcome_words(outcome).1)
    }

    /// Has its outcome been on the screen for long enough?
    pub fn is_over(&self, phase: u32) -> bool {
        self.is_done() && phase.wrapping_sub(self.changed_at) >= OUTCOME_TICKS
    }
}

impl Model {
    /// Gives a command and watches it. A station that has gone takes none: that is said at once.
    pub(super) fn send_command(&mut self, confirmed: Confirmed) -> Option<Effect> {
        let Confirmed { kind, expected, credentials, note } = confirmed;
        self.commands_sent = self.commands_sent.wrapping_add(1);
        let id = CommandId { terminal: self.terminal, number: self.commands_sent };
        let undelivered = self.session.gone.as_ref().map(|_| "the station has gone");
        let changed_at = self.clock.phase;
        self.pending_command = Some(PendingCommand { id, kind: kind.clone(), status: None, changed_at, undelivered });
        let request = CommandRequest::on(&self.snapshot, id, kind);
        let request = CommandRequest { seen: expected.or(request.seen), credentials, note, ..request };
        undelivered.is_none().then_some(Effect::Command(request))
    }

    /// Takes the outcome of the watched command from the snapshot that has come.
    pub(super) fn follow(&mut self) {
        if let Some(pending) = &mut self.pending_command
            && let Some(status) = self.snapshot.commands.iter().find(|status| status.id == pending.id)
        {
            if pending.status.as_ref() != Some(status) {
                pending.changed_at = self.clock.phase;
            }
            pending.status = Some(status.clone());
        }
    }

    /// Ends the wait of a window for the check of its credentials; refused ones are asked for again.
    pub(super) fn settle(&mut self) {
        let Some(pending) = &self.pending_command else { return };
        let refused = match (pending.undelivered, pending.status.as_ref().map(|status| &status.outcome)) {
            (Some(why), _) => Some(format!("not sent: {why}")),
            (None, Some(Outcome::Refused(Refusal::NotReauthenticated(why)))) => Some(why.clone()),
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
