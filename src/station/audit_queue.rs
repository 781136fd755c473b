//! The plant-side end of the recorder: sends actions and alarm events to disk, and replies once they are there.

use std::{collections::VecDeque, time::Duration};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, oneshot, watch},
    time::Instant,
};

use super::{
    durability::{CommitBarrier, RecorderProgress, Wait},
    entries::RecordedFiles,
};
use crate::{
    access::{
        Completion, Durability,
        io::recorder::{Handle, Message, Recorded, WriteGroup},
    },
    history::{alarm_state::LatestEvents, io::chain::StoredEntries},
    plant::{
        Snapshot,
        record::{ActionRecord, AlarmRecord, ChainHash},
        request_refusal::RequestRefusal,
    },
    profile::PlantFile,
};

/// Actions that wait for a place in the queue; the oldest of more go to the history alone.
const BACKLOG_MAX: usize = 1_000;
/// Replies that wait for the audit log; one more, and the oldest waits no longer.
const REPLIES_MAX: usize = 64;

/// Where the result of a request goes.
pub(crate) type ReplySender = oneshot::Sender<Result<Completion, RequestRefusal>>;

/// A message of the session server. Their order matters.
#[derive(Debug)]
pub(crate) enum AuditMessage {
    /// Append this entry.
    Entry(ActionRecord),
    /// Send this result, its summary if it has one, once everything before it is on disk, or say that it is not.
    Reply(ReplySender, Result<Option<String>, RequestRefusal>),
    /// This many entries did not fit into the queue.
    Lost(u64),
}

/// A result that waits for the disk.
#[derive(Debug)]
struct Reply {
    wait: Wait,
    sender: ReplySender,
    result: Result<Option<String>, RequestRefusal>,
}

impl Reply {
    fn send(self, disk: RecorderProgress) {
        let durability = if self.wait.is_recorded(disk) { Durability::Recorded } else { Durability::NotRecorded };
        // A terminal that has gone needs no reply.
        let _ = self.sender.send(self.result.map(|summary| Completion::new(durability, summary)));
    }
}

/// What is wrong with the files of the recorder, as text for the operator.
pub(super) struct RecorderFaults {
    /// Actions that neither the audit log nor the history has.
    pub lost: u64,
    pub log: Option<String>,
    pub alarms: Option<String>,
}

/// The plant-side end of the recorder.
#[derive(Debug)]
pub(super) struct AuditQueue {
    queue: mpsc::Sender<Message>,
    recorded: watch::Receiver<Recorded>,
    began: Instant,
    /// The next write group. Its events are bounded by the alarms of the plant.
    backlog: Vec<ActionRecord>,
    backlog_events: LatestEvents,
    barrier: CommitBarrier,
    /// Actions that only the history has: the queue was full.
    left_out: u64,
    /// Actions that were lost before they came here.
    lost: u64,
    replies: VecDeque<Reply>,
    files: RecordedFiles,
}

impl AuditQueue {
    /// The end of a recorder that has just started.
    pub fn new(recorder: &Handle) -> AuditQueue {
        AuditQueue {
            queue: recorder.groups.clone(),
            recorded: recorder.recorded.clone(),
            began: Instant::now(),
            backlog: Vec::new(),
            backlog_events: LatestEvents::default(),
            barrier: CommitBarrier::new(Duration::ZERO),
            left_out: 0,
            lost: 0,
            replies: VecDeque::new(),
            files: RecordedFiles::new(&recorder.opened),
        }
    }

    fn disk(&self) -> RecorderProgress {
        RecorderProgress { groups: self.recorded.borrow().groups, alive: self.recorded.has_changed().is_ok() }
    }

    /// Records the start of a station; see [`RecordedFiles::started`].
    pub fn put_start(&mut self, plant: &str, file: Option<&PlantFile>, users: Option<String>, at: Timestamp) {
        let entries = self.files.started(plant, file, users, at);
        // The queue is still empty, so all of them fit.
        let _ = self.put(entries, Vec::new());
    }

    /// What was recorded last of the files of plant and users.
    pub fn files(&mut self) -> &mut RecordedFiles {
        &mut self.files
    }

    /// Sends actions and alarm events to disk; the recorder passes the actions on to the history. Returns actions that do not
    /// fit.
    pub fn put(&mut self, actions: Vec<ActionRecord>, events: Vec<AlarmRecord>) -> Vec<ActionRecord> {
        self.barrier.put(&actions, &events, self.disk(), self.began.elapsed());
        self.backlog.extend(actions);
        events.into_iter().for_each(|event| self.backlog_events.on_event(event));
        self.send_backlog()
    }

    /// Sends the backlog as one write group. Returns the actions above [`BACKLOG_MAX`] if the queue is full.
    fn send_backlog(&mut self) -> Vec<ActionRecord> {
        if self.backlog.is_empty() && self.backlog_events.is_empty() {
            return Vec::new();
        }
        let events = self.backlog_events.iter().cloned().collect();
        let group = WriteGroup { actions: std::mem::take(&mut self.backlog), events };
        let (message, most) = match self.queue.try_send(Message::WriteGroup(group)) {
            Ok(()) => {
                self.barrier.sent();
                self.backlog_events = LatestEvents::default();
                return Vec::new();
            }
            Err(mpsc::error::TrySendError::Full(message)) => (message, BACKLOG_MAX),
            Err(mpsc::error::TrySendError::Closed(message)) => (message, 0),
        };
        if let Message::WriteGroup(group) = message {
            self.backlog = group.actions;
        }
        let excess = self.backlog.len().saturating_sub(most);
        self.left_out += excess as u64;
        self.backlog.drain(..excess).collect()
    }

    /// Counts actions that were lost before they came here.
    pub fn count_lost(&mut self, count: u64) {
        self.lost += count;
    }

    /// Sends a result once everything that was put before it is on disk; see [`AuditQueue::send_due`].
    pub fn reply(&mut self, sender: ReplySender, result: Result<Option<String>, RequestRefusal>) {
        self.replies.push_back(Reply { wait: self.barrier.wait(self.began.elapsed()), sender, result });
        let _ = self.send_due();
    }

    /// Sends the replies whose actions are on disk, those that have waited too long as not recorded, and the backlog. Returns
    /// actions that do not fit.
    pub fn send_due(&mut self) -> Vec<ActionRecord> {
        let (disk, now) = (self.disk(), self.began.elapsed());
        while let Some(reply) = self.replies.pop_front_if(|reply| reply.wait.is_over(disk, now)) {
            reply.send(disk);
        }
        let excess = self.replies.len().saturating_sub(REPLIES_MAX);
        self.replies.drain(..excess).for_each(|reply| reply.send(disk));
        self.send_backlog()
    }

    /// The station stops: sends every reply now.
    pub fn send_all(&mut self) {
        let disk = self.disk();
        self.replies.drain(..).for_each(|reply| reply.send(disk));
    }

    /// When a snapshot that is due at `next` may be published: not before the disk has what it shows, or the wait is over.
    pub fn publish_at(&self, next: Instant) -> Instant {
        self.barrier.wait_until(self.disk()).map_or(next, |end| next.max(self.began + end))
    }

    /// Marks in a snapshot what is not on disk.
    pub fn mark(&mut self, snapshot: &mut Snapshot) {
        self.barrier.mark(snapshot, self.disk());
    }

    /// Waits for news of the recorder.
    pub async fn changed(audit: &mut Option<AuditQueue>) {
        let changed = match audit {
            Some(audit) => audit.recorded.changed().await.is_ok(),
            None => false,
        };
        if !changed {
            std::future::pending().await
        }
    }

    /// The history is open and holds these entries of the audit log.
    pub fn compare(&self, entries: StoredEntries) {
        if self.queue.try_send(Message::Stored(entries)).is_err() {
            tracing::warn!("the audit log is not compared with the history until the next start: its queue is full");
        }
    }

    /// The last entry of the audit log on disk.
    pub fn last(&self) -> Option<ChainHash> {
        self.recorded.borrow().last
    }

    pub fn faults(&mut self) -> RecorderFaults {
        let (disk, now) = (self.disk(), self.began.elapsed());
        let status = self.recorded.borrow_and_update().clone();
        let missing = self.left_out + self.lost;
        let log = if !disk.alive {
            Some("the audit log writer has stopped, see the log".to_owned())
        } else if status.log.is_some() {
            status.log
        } else if missing > 0 {
            Some(format!("{missing} actions are not in the audit log: the disk is too slow"))
        } else {
            let slow = self.barrier.is_late(disk, now) && status.alarms.is_none();
            slow.then(|| "the disk is slow: the latest actions are not recorded yet".to_owned())
        };
        RecorderFaults { lost: status.lost + self.lost, log, alarms: status.alarms }
    }
}
