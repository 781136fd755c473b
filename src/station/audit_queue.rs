//! The plant-side end of the audit writer, and the entries of the station itself: start, stop, plant file, clock steps.

use std::{
    collections::{HashMap, VecDeque},
    sync::{Arc, mpsc as queue},
    time::Duration,
};

use jiff::Timestamp;
use tokio::{
    sync::{oneshot, watch},
    time::Instant,
};

use crate::{
    access::{
        Durability,
        audit_log::{PLANT_FILE, USERS_FILE, sha256},
        io::recorder::{Batch, Handle, Message, Recorded},
    },
    history::alarm_state::LatestSteps,
    plant::{
        Snapshot,
        alarm::manager::subject_name,
        command::{CommandId, CommandStatus},
        def::AlarmId,
        record::{ActionRecord, AlarmRecord, ChainHash},
    },
    profile::PlantFile,
};

/// A snapshot that shows an outcome, and the answer to a request of a terminal, wait so long for the disk; after that both
/// say that it is not recorded.
const WAIT_MAX: Duration = Duration::from_secs(1);
/// Actions that wait for a place in the queue; the oldest of more go to the history alone.
const BACKLOG_MAX: usize = 1_000;
/// Ended commands whose place on disk is remembered: twice what a snapshot shows.
const COMMANDS_MAX: usize = 64;
/// Answers that wait for the audit log; one more, and the oldest waits no longer.
const ANSWERS_MAX: usize = 64;

/// A message of the session server; order matters.
#[derive(Debug)]
pub enum AuditMessage {
    /// Put this into the audit log.
    Entry(ActionRecord),
    /// Send this once the log has what came before it, or say that it has not: what is reported as recorded survives a loss
    /// of power.
    Reply(oneshot::Sender<Result<Durability, String>>, Result<(), String>),
    /// So many actions found no room on this way.
    Lost(u64),
}

/// An answer that waits until so many batches are on disk.
#[derive(Debug)]
struct Answer {
    batches: u64,
    since: Instant,
    reply: oneshot::Sender<Result<Durability, String>>,
    answer: Result<(), String>,
}

impl Answer {
    /// Sends it, while the disk has so many batches. A terminal that has left needs none.
    fn send(self, recorded: u64) {
        let durability = if self.batches <= recorded { Durability::Recorded } else { Durability::NotRecorded };
        let _ = self.reply.send(self.answer.map(|()| durability));
    }
}

/// The plant-side end of the audit writer.
#[derive(Debug)]
pub struct AuditQueue {
    queue: queue::SyncSender<Message>,
    recorded: watch::Receiver<Recorded>,
    /// What the queue had no room for: the next batch. Its steps are bounded by the alarms of the plant.
    backlog: Vec<ActionRecord>,
    backlog_steps: LatestSteps,
    /// Batches that were sent, the last one that an operator waits for, and since when the disk is behind it.
    sent: u64,
    needed: u64,
    behind: Instant,
    /// Commands that have ended, and the batch with the action of each.
    ended: VecDeque<(CommandId, u64)>,
    /// Alarms, by subject and text, with the batch of the last step of an operator that is not on disk.
    steps: HashMap<(Arc<str>, Arc<str>), u64>,
    /// Actions that the queue had no room for: they are in the history only.
    left_out: u64,
    /// Actions that did not even come here.
    lost: u64,
    answers: VecDeque<Answer>,
    /// The hash of the plant file that was recorded last.
    plant_file: Option<Arc<str>>,
    /// The hash of the users that was recorded last.
    users_file: Option<Arc<str>>,
}

impl AuditQueue {
    /// The end of a recorder that has just been started.
    pub fn new(recorder: &Handle) -> AuditQueue {
        let (plant_file, users_file) = (recorder.opened.plant_file.clone(), recorder.opened.users_file.clone());
        AuditQueue {
            queue: recorder.batches.clone(),
            recorded: recorder.recorded.clone(),
            backlog: Vec::new(),
            backlog_steps: LatestSteps::default(),
            sent: 0,
            needed: 0,
            behind: Instant::now(),
            ended: VecDeque::new(),
            steps: HashMap::new(),
            left_out: 0,
            lost: 0,
            answers: VecDeque::new(),
            plant_file,
            users_file,
        }
    }

    /// The first actions of a station: that it has started, and the plant file and the users if they are others than the last
    /// time. `users` is their [`crate::access::Users::digest`], `None` where nobody is asked who he is.
    pub fn started(&mut self, plant: &str, file: Option<&PlantFile>, users: Option<String>, at: Timestamp) {
        let version = concat!("sightglass ", env!("CARGO_PKG_VERSION"));
        let start = ActionRecord { new: Some(version.into()), ..own(at, "start station", plant, "done") };
        let changed = file.and_then(|file| self.plant_file(file, at));
        let users_file =
            users.map(Arc::from).filter(|users| self.users_file.as_ref() != Some(users)).map(|users| ActionRecord {
                old: self.users_file.take(),
                new: Some(users),
                ..own(at, USERS_FILE, "users", "done: found")
            });
        // Nothing else waits in this queue yet, so nothing comes back.
        let _ = self.put([start].into_iter().chain(changed).chain(users_file).collect(), Vec::new());
    }

    /// The record of a plant file, unless it is still the last one that was recorded.
    pub fn plant_file(&mut self, file: &PlantFile, at: Timestamp) -> Option<ActionRecord> {
        let new: Arc<str> = sha256(file.bytes()).into();
        if self.plant_file.as_ref() == Some(&new) {
            return None;
        }
        let old = self.plant_file.replace(new.clone());
        Some(ActionRecord { old, new: Some(new), ..own(at, PLANT_FILE, &file.path().display().to_string(), "done") })
    }

    /// Has actions and steps of alarms brought to disk; the actions go on to the history from there. Gives back actions that
    /// there is no room for.
    pub fn put(&mut self, actions: Vec<ActionRecord>, steps: Vec<AlarmRecord>) -> Vec<ActionRecord> {
        if !actions.is_empty() || steps.iter().any(|step| step.by.is_some()) {
            if self.recorded.borrow().batches == self.needed {
                self.behind = Instant::now();
            }
            self.needed = self.sent + 1;
        }
        let by_operators = steps.iter().filter(|step| step.by.is_some());
        self.steps.extend(by_operators.map(|step| ((step.subject.clone(), step.message.clone()), self.needed)));
        self.backlog.extend(actions);
        steps.into_iter().for_each(|step| self.backlog_steps.take(step));
        self.send()
    }

    /// Sends what waits, as one batch. Gives back actions that have waited in vain.
    fn send(&mut self) -> Vec<ActionRecord> {
        if self.backlog.is_empty() && self.backlog_steps.is_empty() {
            return Vec::new();
        }
        let steps = self.backlog_steps.iter().cloned().collect();
        let batch = Batch { actions: std::mem::take(&mut self.backlog), steps };
        let excess = match self.queue.try_send(Message::Batch(batch)) {
            Ok(()) => {
                self.sent += 1;
                self.backlog_steps = LatestSteps::default();
                return Vec::new();
            }
            Err(refused) => {
                let (message, most) = match refused {
                    queue::TrySendError::Full(message) => (message, BACKLOG_MAX),
                    queue::TrySendError::Disconnected(message) => (message, 0),
                };
                if let Message::Batch(batch) = message {
                    self.backlog = batch.actions;
                }
                self.backlog.len().saturating_sub(most)
            }
        };
        self.left_out += excess as u64;
        self.backlog.drain(..excess).collect()
    }

    /// So many actions never came here: they are nowhere.
    pub fn lost(&mut self, count: u64) {
        self.lost += count;
    }

    /// Sends an answer once all that was put here before it is on disk; see [`AuditQueue::tell`].
    pub fn answer(&mut self, reply: oneshot::Sender<Result<Durability, String>>, answer: Result<(), String>) {
        self.answers.push_back(Answer { batches: self.needed, since: Instant::now(), reply, answer });
        let _ = self.tell();
    }

    /// Sends the answers whose actions are on disk, and those that have waited too long as not recorded. Gives back actions
    /// as [`AuditQueue::put`].
    pub fn tell(&mut self) -> Vec<ActionRecord> {
        let (recorded, alive) = (self.recorded.borrow().batches, self.recorded.has_changed().is_ok());
        let is_due = |answer: &Answer| !alive || answer.batches <= recorded || WAIT_MAX <= answer.since.elapsed();
        while let Some(answer) = self.answers.pop_front_if(|answer| is_due(answer)) {
            answer.send(recorded);
        }
        while ANSWERS_MAX < self.answers.len() {
            self.answers.pop_front().into_iter().for_each(|answer| answer.send(recorded));
        }
        self.send()
    }

    /// The station ends: no answer waits any longer.
    pub fn tell_all(&mut self) {
        let recorded = self.recorded.borrow().batches;
        self.answers.drain(..).for_each(|answer| answer.send(recorded));
    }

    /// When a snapshot may go out that could have gone at `next`: not before the disk has what it shows. After [`WAIT_MAX`]
    /// it goes out with what is not recorded marked as such.
    pub fn due(&self, next: Instant) -> Instant {
        // A thread that has ended will never write anything any more.
        let alive = self.recorded.has_changed().is_ok();
        if alive && self.recorded.borrow().batches < self.needed { next.max(self.behind + WAIT_MAX) } else { next }
    }

    /// Marks in a snapshot what is not on disk: ended commands, and what operators did with alarms.
    pub fn mark(&mut self, snapshot: &mut Snapshot) {
        let (recorded, needed) = (self.recorded.borrow().batches, self.needed);
        let has_ended = |status: &&mut CommandStatus| !status.is_pending();
        for status in snapshot.commands.iter_mut().rev().filter(has_ended) {
            let known = self.ended.iter().find(|(id, _)| *id == status.command.id).map(|(_, batch)| *batch);
            let batch = known.unwrap_or_else(|| {
                self.ended.push_back((status.command.id, needed));
                needed
            });
            status.recorded = batch <= recorded;
        }
        let excess = self.ended.len().saturating_sub(COMMANDS_MAX);
        self.ended.drain(..excess);
        self.steps.retain(|_, batch| recorded < *batch);
        if self.steps.is_empty() {
            return;
        }
        let is_recorded = |id: AlarmId| {
            let alarm = snapshot.def.alarm(id);
            let name = (subject_name(&snapshot.def, alarm.subject).into(), alarm.message.as_str().into());
            !self.steps.contains_key(&name)
        };
        for alarm in Arc::make_mut(&mut snapshot.alarms) {
            alarm.acknowledged.iter_mut().for_each(|note| note.recorded = is_recorded(alarm.id));
        }
        for alarm in Arc::make_mut(&mut snapshot.suppressed) {
            alarm.note.recorded = is_recorded(alarm.id);
        }
    }

    /// Waits until the disk has taken something.
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
    pub fn stored(&self, chain_hashes: Vec<ChainHash>) {
        if self.queue.try_send(Message::Stored(chain_hashes)).is_err() {
            tracing::warn!("the audit log is too busy to be compared with the history before the next start");
        }
    }

    /// The last entry of the audit log that is on disk.
    pub fn last(&self) -> Option<ChainHash> {
        self.recorded.borrow().last
    }

    /// Actions that are lost, and what is wrong with the audit log and with the alarm-state file, in words for the operator.
    pub fn trouble(&mut self) -> (u64, Option<String>, Option<String>) {
        let ended = self.recorded.has_changed().is_err();
        let status = self.recorded.borrow_and_update().clone();
        let late = status.batches < self.needed && WAIT_MAX <= self.behind.elapsed();
        let log = if ended {
            Some("the audit log has ended by itself, see the log".to_owned())
        } else if status.log.is_some() {
            status.log
        } else if self.left_out + self.lost > 0 {
            Some(format!("{} actions are not in the audit log: the disk is too slow", self.left_out + self.lost))
        } else {
            let slow = late && status.alarms.is_none();
            slow.then(|| "the disk is slow: what was done last is not recorded yet".to_owned())
        };
        (status.lost + self.lost, log, status.alarms)
    }
}

/// The system clock was set, from `old` to `new`.
pub fn clock_step(old: Timestamp, new: Timestamp) -> ActionRecord {
    let words = |at: Timestamp| Some(at.strftime("%Y-%m-%dT%H:%M:%SZ").to_string().into());
    ActionRecord {
        old: words(old),
        new: words(new),
        ..own(new, "clock step", "system clock", "done: followed at once")
    }
}

/// The last action of a station.
pub fn stopped(plant: &str, at: Timestamp) -> ActionRecord {
    own(at, "stop station", plant, "done")
}

fn own(at: Timestamp, action: &str, target: &str, outcome: &str) -> ActionRecord {
    ActionRecord {
        at,
        by: "station".into(),
        from: "".into(),
        action: action.into(),
        target: target.into(),
        old: None,
        new: None,
        outcome: outcome.into(),
        note: None,
        chain_hash: None,
    }
}
