//! The one thread that writes actions and alarm state to disk before they are reported as recorded: the audit log first.

mod completion;
mod start;

use std::{
    collections::VecDeque,
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, watch},
    time::{Instant, timeout},
};

#[cfg(test)]
pub use self::start::start;
pub use self::start::start_within;
use super::{
    audit_log::{self, AuditLog, IN_USE, Opened},
    sealing,
};
use crate::{
    access::{audit_log::fit, sealing::is_due},
    bus::io::{clock::Clock, worker::Worker},
    history::{
        io::{
            alarm_file::{self, AlarmFile, RestoredAlarms},
            chain::StoredEntries,
            thread::{HistoryInput, offer},
        },
        words::plain,
    },
    plant::{
        record::{ActionRecord, AlarmRecord, ChainHash, Record},
        recorded_action::RecordedAction,
    },
};

/// Write groups on their way to the thread; the sender handles a full queue.
const WRITE_GROUPS_MAX: usize = 256;
/// Write groups that are written with one sync.
const GROUP_MAX: usize = 64;
/// Actions that wait for a log that cannot be written; one more, and the oldest is in the history only.
const PENDING_MAX: usize = 10_000;
/// Pause before a failed write is retried.
const AGAIN: Duration = Duration::from_secs(1);
/// How often the thread checks whether a seal is due.
const CHECK_EVERY: Duration = Duration::from_secs(60);
/// Pause before a failed open is retried: it reads the whole log.
const REOPEN: Duration = Duration::from_secs(10);

/// What belongs together: actions, and the alarm events that they caused.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WriteGroup {
    /// For the audit log.
    pub actions: Vec<ActionRecord>,
    /// For the alarm-state file.
    pub events: Vec<AlarmRecord>,
}

/// What the thread is sent.
#[derive(Debug)]
pub enum Message {
    /// To be written.
    WriteGroup(WriteGroup),
    /// The history is open, and holds these entries: what it lacks of the log is sent to it, and what the log lacks is
    /// appended.
    Stored(StoredEntries),
}

/// How it stands.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recorded {
    /// Number of write groups, from the first, that are completely on disk.
    pub groups: u64,
    /// Write groups taken, not yet on disk.
    pub waiting: u64,
    /// Actions that the history had no room for.
    pub lost: u64,
    /// The last entry of the log.
    pub last: Option<ChainHash>,
    /// What is wrong with the log, in words for the operator.
    pub log: Option<String>,
    /// What is wrong with the alarm-state file.
    pub alarms: Option<String>,
}

/// The station's end of the thread.
#[derive(Debug)]
pub struct Handle {
    /// What is to be written. When the last sender is dropped the thread writes what it has and ends.
    pub groups: mpsc::Sender<Message>,
    /// How it stands, after every sync.
    pub recorded: watch::Receiver<Recorded>,
    /// What was found when the log was opened.
    pub opened: Opened,
    /// What was found when the alarm-state file was opened.
    pub alarms: RestoredAlarms,
    /// The thread; ends with the last entry of the log. `None` where the system gave none: then nothing is written.
    pub join: Option<Worker<Option<ChainHash>>>,
}

/// An action that waits for the log.
struct Pending {
    action: ActionRecord,
    /// The history has it already, without a chain hash.
    stored: bool,
}

/// The thread.
struct Recorder {
    path: PathBuf,
    clock: Clock,
    history: mpsc::Sender<HistoryInput>,
    audit_log: Option<AuditLog>,
    alarms: AlarmFile,
    pending: Vec<Pending>,
    /// The latest entries of the log when it was first opened, and what the history held when it was; compared once both
    /// are known, whichever comes first.
    tail: Option<VecDeque<ActionRecord>>,
    entries: Option<StoredEntries>,
    is_compared: bool,
    /// What was found wrong in the log and in the alarm-state file: true until the next start.
    found: Vec<String>,
    alarms_found: Option<String>,
    /// Why the log and the alarm-state file cannot be written now.
    log_fault: Option<String>,
    alarm_fault: Option<String>,
    /// Why the log cannot be sealed, and when that was tried last, with or without success.
    seal_fault: Option<String>,
    seal_tried: Option<(Timestamp, bool)>,
    /// Another process writes both files.
    in_use: bool,
    opened_at: Instant,
    /// Actions that are in the history without a chain hash, since the last fault.
    unchained: u64,
    taken: u64,
    recorded: u64,
    lost: u64,
}

impl Recorder {
    fn new(history_file: &Path, clock: Clock, history: mpsc::Sender<HistoryInput>) -> (Recorder, RestoredAlarms) {
        let (alarms, found) = AlarmFile::open(&alarm_file::beside(history_file), clock.utc());
        let recorder = Recorder {
            path: audit_log::beside(history_file),
            clock,
            history,
            audit_log: None,
            alarms,
            pending: Vec::new(),
            tail: None,
            entries: None,
            is_compared: false,
            found: Vec::new(),
            alarms_found: found.trouble.clone(),
            log_fault: None,
            alarm_fault: None,
            seal_fault: None,
            seal_tried: None,
            in_use: false,
            opened_at: Instant::now(),
            unchained: 0,
            taken: 0,
            recorded: 0,
            lost: 0,
        };
        (recorder, found)
    }

    /// A recorder with both files opened, and what was found. Blocks while the disk works.
    fn opened(
        history_file: &Path,
        clock: Clock,
        history: mpsc::Sender<HistoryInput>,
    ) -> (Recorder, (Opened, RestoredAlarms)) {
        let (mut recorder, alarms) = Recorder::new(history_file, clock, history);
        let opened = recorder.open();
        (recorder, (opened, alarms))
    }

    async fn run(mut self, mut queue: mpsc::Receiver<Message>, status: watch::Sender<Recorded>) -> Option<ChainHash> {
        let mut messages = Vec::with_capacity(GROUP_MAX);
        loop {
            let wait = if self.is_written() { CHECK_EVERY } else { AGAIN };
            if timeout(wait, queue.recv_many(&mut messages, GROUP_MAX)).await == Ok(0) {
                break;
            }
            messages.drain(..).for_each(|message| match message {
                Message::WriteGroup(group) => self.on_group(group),
                Message::Stored(entries) => self.on_stored(entries),
            });
            self.write();
            status.send_replace(self.status());
            let now = self.clock.utc();
            if is_due(self.seal_tried, now) {
                self.seal(now);
                status.send_replace(self.status());
            }
        }
        // The last chance of what could not be written until now.
        self.write();
        if !self.pending.is_empty() {
            tracing::error!(
                actions = self.pending.len(),
                "the station stops, and these entries are not in the audit log"
            );
        }
        self.seal(self.clock.utc());
        status.send_replace(self.status());
        self.status().last
    }

    fn on_group(&mut self, WriteGroup { actions, events }: WriteGroup) {
        self.taken += 1;
        // The history says the same as the log.
        self.pending.extend(actions.into_iter().map(|action| Pending { action: fit(action), stored: false }));
        self.alarms.on_events(events);
    }

    /// The log first: a loss of power between the two leaves no acknowledged alarm without a trace of who did it.
    fn write(&mut self) {
        if self.audit_log.is_none() && REOPEN <= self.opened_at.elapsed() {
            self.open();
        }
        self.write_log();
        let written = if self.in_use { Err(io::Error::other(IN_USE)) } else { self.alarms.write() };
        self.alarm_fault = written.err().map(|error| error.to_string());
        if self.is_written() {
            self.recorded = self.taken;
        }
    }

    /// Everything that was taken, and what is said of the log itself, is on disk.
    fn is_written(&self) -> bool {
        self.pending.is_empty() && self.alarm_fault.is_none()
    }

    /// Opens the log; what is found is put on record in it.
    fn open(&mut self) -> Opened {
        self.opened_at = Instant::now();
        match AuditLog::open(&self.path) {
            Ok((audit_log, mut opened)) => {
                (self.audit_log, self.in_use) = (Some(audit_log), false);
                let broken: Vec<_> = opened.wrong.iter().filter(|wrong| wrong.contains("broken")).cloned().collect();
                if !broken.is_empty() {
                    self.found.push(format!("the audit log was tampered with: {}", broken.join("; ")));
                }
                self.drop_written(&opened);
                let notes: Vec<_> = opened.wrong.iter().map(|wrong| self.note(wrong)).collect();
                // In front of what waits.
                self.pending.splice(0..0, notes.into_iter().map(|action| Pending { action, stored: false }));
                self.write_log();
                self.on_opened(std::mem::take(&mut opened.tail));
                opened
            }
            Err(error) => {
                self.in_use = error.kind() == io::ErrorKind::WouldBlock;
                self.fail(&error);
                Opened::default()
            }
        }
    }

    /// Of what waits, drops what the log has: the disk took it although it reported a failure. The history gets it from there.
    fn drop_written(&mut self, opened: &Opened) {
        let (mut pending, mut written) = (std::mem::take(&mut self.pending), Vec::new());
        pending.retain(|Pending { action, .. }| {
            let found = opened.tail.iter().rev().find(|entry| is_same(entry, action));
            written.extend(found.cloned());
            found.is_none()
        });
        self.pending = pending;
        self.store(written);
    }

    /// Into the log, and on to the history; without a chain hash while the log cannot be written.
    fn write_log(&mut self) {
        let lacks = format!("{} actions before this one are not in it", self.unchained);
        let lacks = (self.unchained > 0).then(|| self.note(&lacks));
        let waiting = self.pending.iter().map(|pending| pending.action.clone());
        let mut actions: Vec<ActionRecord> = lacks.into_iter().chain(waiting).collect();
        if actions.is_empty() {
            return;
        }
        match self.audit_log.as_mut().map(|audit_log| audit_log.append(&mut actions)) {
            Some(Ok(())) => {
                self.pending.clear();
                (self.unchained, self.log_fault) = (0, None);
                return self.store(actions);
            }
            Some(Err(error)) => self.fail(&error),
            None => {}
        }
        let fresh = self.pending.iter_mut().filter(|pending| !pending.stored);
        let fresh = fresh.map(|pending| {
            pending.stored = true;
            pending.action.clone()
        });
        let fresh = fresh.collect();
        self.store(fresh);
        let excess = self.pending.len().saturating_sub(PENDING_MAX);
        self.pending.drain(..excess);
        self.unchained += excess as u64;
    }

    /// Seals what the log holds, if it has a key.
    fn seal(&mut self, now: Timestamp) {
        let Some(audit_log) = &mut self.audit_log else { return };
        let (entry, sealed) = sealing::seal(audit_log, &self.path, now);
        self.seal_tried = Some((now, sealed.is_ok()));
        let fault = sealed.err();
        if let Some(why) = fault.as_ref().filter(|_| fault != self.seal_fault) {
            tracing::error!("{why}");
        }
        self.seal_fault = fault;
        self.store(entry.into_iter().collect());
    }

    fn store(&mut self, actions: Vec<ActionRecord>) {
        self.lost += offer(&self.history, actions.into_iter().map(Record::Action).collect());
    }

    fn fail(&mut self, error: &io::Error) {
        let why = error.to_string();
        if self.log_fault.as_ref() != Some(&why) {
            tracing::error!(%error, path = %self.path.display(), "the audit log cannot be written");
        }
        // One that is as it was left is tried again at once, another one must be read first.
        self.audit_log = self.audit_log.take().filter(AuditLog::is_intact);
        self.log_fault = Some(why);
    }

    /// Something about the log itself.
    fn note(&self, outcome: &str) -> ActionRecord {
        ActionRecord::new(
            self.clock.utc(),
            "station",
            RecordedAction::AuditLog,
            self.path.display().to_string(),
            outcome,
        )
    }

    fn status(&self) -> Recorded {
        let waiting = self.pending.len() as u64 + self.unchained;
        let log = self
            .log_fault
            .as_ref()
            .map(|why| format!("the audit log cannot be written: {}; {waiting} actions are not in it", plain(why)));
        let alarms =
            self.alarm_fault.as_ref().map(|why| format!("the state of the alarms cannot be written: {}", plain(why)));
        let all = |fault: Option<String>, found: &[String]| {
            let parts: Vec<String> = fault.into_iter().chain(found.iter().cloned()).collect();
            (!parts.is_empty()).then(|| parts.join("; "))
        };
        Recorded {
            groups: self.recorded,
            waiting: self.taken - self.recorded,
            lost: self.lost,
            last: self.audit_log.as_ref().map(AuditLog::last),
            log: all(log.or_else(|| self.seal_fault.clone()), &self.found),
            alarms: all(alarms, self.alarms_found.as_slice()),
        }
    }
}

/// Whether an entry of the log is this action. The time first: there may be thousands of both.
fn is_same(entry: &ActionRecord, action: &ActionRecord) -> bool {
    entry.at == action.at && ActionRecord { chain_hash: None, ..entry.clone() } == *action
}

#[cfg(test)]
mod tests;
