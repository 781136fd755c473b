//! Maps the command ids of a terminal over reconnects: the station may give it another number, its operator sees one.

use std::{collections::VecDeque, sync::Arc};

use jiff::Timestamp;

use crate::plant::{
    Snapshot,
    command::{Command, CommandId, CommandStatus, NotConfirmed, Outcome},
    diagnostics::DiagnosticRun,
    request_refusal::RequestRefusal,
};

/// Numbers of earlier connections that are still known as one's own.
const NUMBERS_MAX: usize = 64;
/// Own commands that are remembered; a snapshot has no more.
const COMMANDS_MAX: usize = 32;

/// The ids of a terminal and its commands without a final status.
#[derive(Debug)]
pub struct CommandIdMap {
    /// The number that its operator's commands have here, for as long as the terminal lives.
    terminal: u32,
    /// Which run of the station gave the numbers below.
    run: u64,
    /// The numbers that the station has given it, the present one last.
    numbers: VecDeque<u32>,
    /// Sent, and their end not seen in a snapshot yet.
    sent: VecDeque<CommandStatus>,
    /// Commands without a final status in any snapshot.
    lost: VecDeque<CommandStatus>,
    /// Commands that did not reach the plant, and why; the latest last.
    undelivered: VecDeque<(CommandId, RequestRefusal)>,
    /// The station is there: what its snapshots say of a command under way is still true.
    connected: bool,
}

impl CommandIdMap {
    /// First connection: the number that the station gives is the one to keep.
    pub fn new(run: u64, terminal: u32) -> CommandIdMap {
        CommandIdMap {
            terminal,
            run,
            numbers: [terminal].into(),
            sent: VecDeque::new(),
            lost: VecDeque::new(),
            undelivered: VecDeque::new(),
            connected: true,
        }
    }

    /// A later connection.
    pub fn on_connected(&mut self, run: u64, terminal: u32) {
        if self.run != run {
            self.run = run;
            self.numbers.clear();
        }
        push(&mut self.numbers, terminal, NUMBERS_MAX);
        self.connected = true;
    }

    /// A command on its way out: with the number that the station knows.
    pub fn send(&mut self, mut command: Command, by: Arc<str>, at: Timestamp) -> Command {
        push(&mut self.sent, status(&command, by, at, Outcome::Pending), COMMANDS_MAX);
        command.id.terminal = *self.numbers.back().expect("a connection has a number");
        command
    }

    /// A command did not leave this terminal.
    pub fn refuse(&mut self, id: CommandId, why: RequestRefusal) {
        push(&mut self.undelivered, (id, why), COMMANDS_MAX);
    }

    /// A command that was sent did not reach the plant.
    pub fn on_undelivered(&mut self, id: CommandId, why: RequestRefusal) {
        if let Some(place) = self.sent.iter().position(|status| status.command.id.number == id.number) {
            self.sent.remove(place);
            let own = self.renumbered(id);
            push(&mut self.undelivered, (own, why), COMMANDS_MAX);
        }
    }

    /// The commands that did not reach the plant, and why; the latest last.
    pub fn undelivered(&self) -> Vec<(CommandId, RequestRefusal)> {
        self.undelivered.iter().cloned().collect()
    }

    /// The connection has ended: what was sent and not seen may or may not have been done.
    pub fn on_disconnected(&mut self) {
        self.connected = false;
        while let Some(status) = self.sent.pop_front() {
            let outcome = Outcome::NotConfirmed(NotConfirmed::ConnectionLost);
            push(&mut self.lost, CommandStatus { outcome, ..status }, COMMANDS_MAX);
        }
    }

    /// A snapshot of the station as this terminal is to see it: own commands under the own number, lost ones among them.
    pub fn apply(&mut self, snapshot: &Arc<Snapshot>) -> Arc<Snapshot> {
        let has_ended = |number: u32| {
            let own = |status: &&CommandStatus| {
                status.command.id.number == number && self.numbers.contains(&status.command.id.terminal)
            };
            snapshot.commands.iter().find(own).map(|status| !status.is_pending())
        };
        self.sent.retain(|status| has_ended(status.command.id.number) != Some(true));
        if self.connected {
            // The station remembers it after all: what it says counts again.
            let (known, lost) = self.lost.drain(..).partition(|status| has_ended(status.command.id.number).is_some());
            let known: VecDeque<CommandStatus> = known;
            let under_way = known.into_iter().filter(|status| has_ended(status.command.id.number) == Some(false));
            self.sent.extend(under_way.map(|status| CommandStatus { outcome: Outcome::Pending, ..status }));
            self.lost = lost;
        }
        if self.lost.is_empty() && self.numbers.iter().all(|number| *number == self.terminal) {
            return snapshot.clone();
        }
        let mut seen = Snapshot::clone(snapshot);
        for status in &mut seen.commands {
            status.command.id = self.renumbered(status.command.id);
        }
        for restore in &mut seen.restores {
            let restore = Arc::make_mut(restore);
            restore.id = self.renumbered(restore.id);
            for step in &mut restore.steps {
                step.command = step.command.map(|id| self.renumbered(id));
            }
        }
        for line in &mut seen.lines {
            if let Some(test) = &line.test {
                line.test =
                    Some(Arc::new(DiagnosticRun { id: self.renumbered(test.id), ..DiagnosticRun::clone(test) }));
            }
        }
        // The last snapshot before a disconnect shows lost commands as pending.
        let is_lost = |id: CommandId| {
            id.terminal == self.terminal && self.lost.iter().any(|lost| lost.command.id.number == id.number)
        };
        seen.commands.retain(|status| !is_lost(status.command.id));
        seen.commands.splice(0..0, self.lost.iter().rev().cloned());
        seen.commands.truncate(COMMANDS_MAX);
        Arc::new(seen)
    }

    /// Maps all own terminal numbers to one; another terminal with that number gets an unused one.
    fn renumbered(&self, id: CommandId) -> CommandId {
        let terminal = if self.numbers.contains(&id.terminal) {
            self.terminal
        } else if id.terminal == self.terminal {
            *self.numbers.back().expect("a connection has a number")
        } else {
            id.terminal
        };
        CommandId { terminal, ..id }
    }
}

fn status(command: &Command, by: Arc<str>, at: Timestamp, outcome: Outcome) -> CommandStatus {
    CommandStatus { old: command.expected_value, outcome, ..CommandStatus::new(command.clone(), by, at) }
}

fn push<T>(list: &mut VecDeque<T>, element: T, max: usize) {
    list.push_back(element);
    if max < list.len() {
        list.pop_front();
    }
}

#[cfg(test)]
mod tests;
