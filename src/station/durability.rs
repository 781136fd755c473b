//! When an outcome may be shown as recorded: which write groups of actions and alarm events the disk has. Pure: the state of the
//! disk and the time since the start are arguments.

use std::{
    collections::{HashMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use crate::plant::{
    Snapshot,
    alarm::manager::subject_name,
    command::{CommandId, CommandStatus},
    def::AlarmId,
    record::{ActionRecord, AlarmRecord},
};

/// A snapshot that shows an outcome, and the reply to a request, wait this long for the disk. After that both say that it is
/// not recorded.
pub(super) const WAIT_MAX: Duration = Duration::from_secs(1);
/// Ended commands whose write group is remembered: twice what a snapshot shows.
const COMMANDS_MAX: usize = 64;

/// What the recorder has reported.
#[derive(Debug, Clone, Copy)]
pub(super) struct RecorderProgress {
    /// Write groups on disk.
    pub groups: u64,
    /// The recorder still runs.
    pub alive: bool,
}

/// A wait for a write group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wait {
    group: u64,
    since: Duration,
}

impl Wait {
    pub fn is_recorded(self, disk: RecorderProgress) -> bool {
        self.group <= disk.groups
    }

    /// When it ends by itself; `None` if it is over already.
    pub fn ends_at(self, disk: RecorderProgress) -> Option<Duration> {
        (disk.alive && !self.is_recorded(disk)).then(|| self.since + WAIT_MAX)
    }

    pub fn is_over(self, disk: RecorderProgress, now: Duration) -> bool {
        self.ends_at(disk).is_none_or(|end| end <= now)
    }
}

/// Write groups on their way to the disk, and what each of them records.
#[derive(Debug)]
pub(super) struct CommitBarrier {
    sent: u64,
    /// The last write group with an action of an operator.
    needed: Wait,
    /// Ended commands, each with the write group of its action.
    ended: VecDeque<(CommandId, u64)>,
    /// Alarms, by subject and message, with the write group of the last event of an operator that is not on disk.
    events: HashMap<(Arc<str>, Arc<str>), u64>,
}

impl CommitBarrier {
    pub fn new(now: Duration) -> CommitBarrier {
        let needed = Wait { group: 0, since: now };
        CommitBarrier { sent: 0, needed, ended: VecDeque::new(), events: HashMap::new() }
    }

    /// Actions and events join the next write group.
    pub fn put(&mut self, actions: &[ActionRecord], events: &[AlarmRecord], disk: RecorderProgress, now: Duration) {
        let by_operators = || events.iter().filter(|event| event.by.is_some());
        if !actions.is_empty() || by_operators().next().is_some() {
            // The wait of an earlier write group goes on.
            let since = if self.needed.is_recorded(disk) { now } else { self.needed.since };
            self.needed = Wait { group: self.sent + 1, since };
        }
        let group = self.needed.group;
        self.events.extend(by_operators().map(|event| ((event.subject.clone(), event.message.clone()), group)));
    }

    /// The next write group has been sent.
    pub fn sent(&mut self) {
        self.sent += 1;
    }

    /// The wait for everything that was put so far.
    pub fn wait(&self, now: Duration) -> Wait {
        Wait { since: now, ..self.needed }
    }

    /// Until when a snapshot must wait; `None` if it can be published now.
    pub fn wait_until(&self, disk: RecorderProgress) -> Option<Duration> {
        self.needed.ends_at(disk)
    }

    /// Whether the disk has taken longer than [`WAIT_MAX`].
    pub fn is_late(&self, disk: RecorderProgress, now: Duration) -> bool {
        !self.needed.is_recorded(disk) && self.needed.since + WAIT_MAX <= now
    }

    /// Marks in a snapshot what is not on disk: ended commands, and operator notes of alarms.
    pub fn mark(&mut self, snapshot: &mut Snapshot, disk: RecorderProgress) {
        let needed = self.needed.group;
        let has_ended = |status: &&mut CommandStatus| !status.is_pending();
        for status in snapshot.commands.iter_mut().rev().filter(has_ended) {
            let known = self.ended.iter().find(|(id, _)| *id == status.command.id).map(|(_, group)| *group);
            let group = known.unwrap_or_else(|| {
                self.ended.push_back((status.command.id, needed));
                needed
            });
            status.recorded = group <= disk.groups;
        }
        let excess = self.ended.len().saturating_sub(COMMANDS_MAX);
        self.ended.drain(..excess);
        self.events.retain(|_, group| disk.groups < *group);
        if self.events.is_empty() {
            return;
        }
        let is_recorded = |id: AlarmId| {
            let alarm = snapshot.def.alarm(id);
            let name = (subject_name(&snapshot.def, alarm.subject).into(), alarm.message.as_str().into());
            !self.events.contains_key(&name)
        };
        for alarm in Arc::make_mut(&mut snapshot.alarms) {
            alarm
                .acknowledged
                .iter_mut()
                .chain(&mut alarm.steps)
                .for_each(|note| note.recorded = is_recorded(alarm.id));
        }
        for alarm in Arc::make_mut(&mut snapshot.suppressed) {
            alarm.note.recorded = is_recorded(alarm.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station::entries::stopped;

    #[test]
    fn a_wait_ends_with_the_disk_or_after_its_time() {
        let (second, half) = (Duration::from_secs(1), Duration::from_millis(500));
        let disk = |groups| RecorderProgress { groups, alive: true };
        let action = [stopped("tank", jiff::Timestamp::UNIX_EPOCH)];
        let mut barrier = CommitBarrier::new(Duration::ZERO);
        assert_eq!(barrier.wait_until(disk(0)), None, "nothing to record");
        barrier.put(&action, &[], disk(0), second);
        barrier.sent();
        let reply = barrier.wait(second + half);
        assert_eq!(barrier.wait_until(disk(0)), Some(2 * second));
        assert_eq!(
            (barrier.wait_until(disk(1)), barrier.wait_until(RecorderProgress { groups: 0, alive: false })),
            (None, None)
        );
        barrier.put(&action, &[], disk(0), 2 * second);
        assert_eq!(barrier.wait_until(disk(1)), Some(2 * second), "the wait of the first group goes on");
        assert!(!barrier.is_late(disk(1), second + half) && barrier.is_late(disk(1), 2 * second));
        assert!(!reply.is_over(disk(0), 2 * second) && reply.is_over(disk(0), 2 * second + half));
        assert!(reply.is_over(disk(1), second) && reply.is_recorded(disk(1)) && !reply.is_recorded(disk(0)));
    }

    #[test]
    fn an_action_after_alarms_of_the_process_has_its_own_wait() {
        let (second, action) = (Duration::from_secs(1), [stopped("tank", jiff::Timestamp::UNIX_EPOCH)]);
        let disk = RecorderProgress { groups: 1, alive: true };
        let mut barrier = CommitBarrier::new(Duration::ZERO);
        // A write group of alarms that the process has raised: no snapshot waits for it.
        barrier.sent();
        barrier.put(&action, &[], disk, 10 * second);
        assert_eq!(barrier.wait_until(disk), Some(11 * second));
        assert!(!barrier.is_late(disk, 10 * second) && barrier.is_late(disk, 11 * second));
    }
}
