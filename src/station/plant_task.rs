//! The loop around the reducer of facts: events, commands and ticks in; requests, records and snapshots out.

mod files;
mod reload;
mod restored;

use std::{path::PathBuf, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{
    sync::{mpsc, watch},
    task::JoinHandle,
    time::{Instant, timeout},
};

use self::files::{Saving, filed, saved};
pub(super) use self::reload::{Inputs, NewPlant, Reload, USERS_MISSING};
use super::{
    audit_queue::{AuditMessage, AuditQueue, RecorderFaults},
    entries,
    found::FoundFile,
    past::{self, Past},
    sets,
};
use crate::{
    access::{Completion, Durability},
    bus::io::clock::Clock,
    history::{
        io::thread::{HistoryInput, offer},
        words::joined,
    },
    plant::{
        Effects, Plant, SetWork, Snapshot,
        alarm::Succession,
        command::{BusRequest, CommandStatus, WriteJob},
        def::LineId,
        event::Event,
        record::{ActionRecord, AlarmRecord, Record},
        snapshot::HistoryStatus,
        station_fault::{FaultState, StationFault},
    },
    profile::PlantFile,
};

/// Places of the queue to a link that only a stop may take.
pub(super) const KEPT_FOR_STOPS: usize = 4;
/// Real time between two snapshots: what a person can follow.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(100);
/// How long a stop waits for messages of the session server: longer than the server needs to end.
const MESSAGES_WAIT_MAX: Duration = Duration::from_secs(3);
/// At the end a history that is still being opened is waited for so long.
const HISTORY_MAX: Duration = Duration::from_secs(2);
/// At the end the plant file and the folder of parameter sets are waited for so long, each.
const FILES_MAX: Duration = Duration::from_secs(2);
/// Real time between two ticks at the least; one second of plant time otherwise.
const TICK_MIN: Duration = Duration::from_millis(20);

/// A history that says nothing for so long (real time) hangs in its disk: it says how it stands every second.
const SILENT_MAX: Duration = Duration::from_secs(10);
/// Said of it.
const SILENT: &str = "its disk does not respond";

/// Gets every record of the plant, in the task of the plant: it must not block.
pub type RecordObserver = Box<dyn Fn(&[Record]) + Send>;

/// Where records, actions and parameter sets are stored.
pub(super) struct Persistence {
    pub records: Option<mpsc::Sender<HistoryInput>>,
    pub store: watch::Receiver<HistoryStatus>,
    /// What is still to come from the history; `None` once it is known.
    pub past: Option<Past>,
    /// Actions and the state of the alarms go there first.
    pub audit: Option<AuditQueue>,
    /// The folder of parameter sets.
    pub sets: Option<PathBuf>,
    /// What was found of devices.
    pub found: Option<FoundFile>,
    pub observer: Option<RecordObserver>,
    /// What was restored from the state file and is to be recorded.
    pub succession: Succession,
    /// The last change of the plant file that is on record, if it is as it was then.
    pub file_since: Option<Timestamp>,
}

/// The loop around the reducer: sole owner of the plant.
pub(super) struct PlantTask {
    plant: Plant,
    clock: Clock,
    links: Vec<mpsc::Sender<BusRequest>>,
    /// The plant file, unless it is just being written.
    file: Option<PlantFile>,
    saving: Option<Saving>,
    /// The work with the parameter sets.
    filing: Option<JoinHandle<sets::Done>>,
    persistence: Persistence,
    /// Records that the queue to the store had no room for.
    lost: u64,
    /// When the history said last how it stands.
    heard: Instant,
    publish: watch::Sender<Arc<Snapshot>>,
}

impl PlantTask {
    /// The task of a plant; `links` are by [`LineId`].
    pub fn new(
        plant: Plant,
        clock: Clock,
        links: Vec<mpsc::Sender<BusRequest>>,
        file: Option<PlantFile>,
        persistence: Persistence,
        publish: watch::Sender<Arc<Snapshot>>,
    ) -> PlantTask {
        let heard = Instant::now();
        PlantTask { plant, clock, links, file, saving: None, filing: None, persistence, lost: 0, heard, publish }
    }

    /// Runs until the links have stopped.
    pub async fn run(mut self, mut inputs: Inputs) {
        self.file_sets(SetWork::Read);
        let succession = std::mem::take(&mut self.persistence.succession);
        self.record_succession(succession);
        if self.persistence.past.is_none() {
            // There is no history that they could go on from.
            self.plant.restore_totals(&[]);
        }
        if self.persistence.past.as_ref().is_some_and(|past| past.from_journal) {
            // Events wait in their queue; the lines are polled meanwhile.
            self.await_history(past::WAIT_MAX).await;
        }
        self.follow(&mut inputs).await;
        if self.persistence.past.is_some() {
            // A station that ends as soon as it has started completes its history all the same.
            self.await_history(HISTORY_MAX).await;
        }
        self.end(inputs.messages).await;
    }

    /// Applies what comes and publishes snapshots, until the links have stopped.
    async fn follow(&mut self, inputs: &mut Inputs) {
        let mut tick = tokio::time::interval(self.clock.real_span(Duration::from_secs(1)).max(TICK_MIN));
        tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Skip);
        // Changed since the last snapshot, and when the next one may go out.
        let (mut changed, mut next) = (false, Instant::now());
        loop {
            // What a snapshot shows as done is on disk, or marked.
            let due = self.persistence.audit.as_ref().map_or(next, |audit| audit.publish_at(next));
            tokio::select! {
                biased;
                () = tokio::time::sleep_until(due), if changed => {
                    self.publish();
                    (changed, next) = (false, Instant::now() + SNAPSHOT_EVERY);
                    continue;
                }
                Some(reload) = inputs.reloads.recv() => {
                    self.reload(reload, inputs);
                    next = Instant::now();
                }
                Some(status) = inputs.commands.recv() => {
                    self.on_command(status);
                    next = Instant::now();
                }
                Some(message) = inputs.messages.recv() => {
                    self.handle_audit_message(message);
                    continue;
                }
                saved = saved(&mut self.saving) => self.on_saved(saved),
                done = filed(&mut self.filing) => self.on_filed(done),
                restored = Past::known(&mut self.persistence.past) => self.restore_history(restored),
                Ok(()) = self.persistence.store.changed() => {
                    self.heard = Instant::now();
                    self.update_history_status();
                }
                () = AuditQueue::changed(&mut self.persistence.audit) => {
                    self.send_due_replies();
                    self.update_history_status();
                }
                // Before the events: however many there are, values age and commands expire.
                _ = tick.tick() => self.on_tick(),
                event = inputs.events.recv() => {
                    // The links have stopped: nothing can become true any more.
                    let Some(event) = event else { break };
                    let effects = self.plant.on_event(event);
                    self.apply_effects(effects);
                }
            }
            changed = true;
        }
    }

    fn on_command(&mut self, mut status: CommandStatus) {
        status.command.kind.move_from_utc(self.clock.behind_utc());
        let effects = self.plant.on_command(status, self.clock.now());
        self.apply_effects(effects);
    }

    fn on_tick(&mut self) {
        let effects = self.plant.on_tick(self.clock.now());
        self.apply_effects(effects);
        self.check_clock();
        self.send_due_replies();
        // A disk that hangs says nothing by itself.
        self.update_history_status();
        self.keep_found();
    }

    /// Waits for the history, but no longer than this.
    async fn await_history(&mut self, max: Duration) {
        if let Ok(restored) = timeout(max, Past::known(&mut self.persistence.past)).await {
            self.restore_history(restored);
        }
    }

    /// Completes what was begun and records the end of the station.
    async fn end(mut self, mut messages: mpsc::Receiver<AuditMessage>) {
        // What the session server had begun is on record as well; it ends soon after the links.
        while let Ok(Some(message)) = timeout(MESSAGES_WAIT_MAX, messages.recv()).await {
            self.handle_audit_message(message);
        }
        // A disk that hangs does not keep the station from ending.
        if self.saving.is_some() {
            match timeout(FILES_MAX, saved(&mut self.saving)).await {
                Ok(saved) => self.on_saved(saved),
                Err(_) => tracing::error!("the disk of the plant file does not respond: task abandoned"),
            }
        }
        if self.filing.is_some() {
            match timeout(FILES_MAX, filed(&mut self.filing)).await {
                Ok(done) => self.on_filed(done),
                Err(_) => tracing::error!("the folder of the parameter sets does not respond: task abandoned"),
            }
        }
        self.finish_found().await;
        let ended = self.plant.on_stop();
        self.dispatch(ended.records);
        let stopped = entries::stopped(&self.plant.def().name, self.clock.utc());
        if let Some(audit) = &mut self.persistence.audit {
            audit.send_all();
            self.send_to_audit_log(vec![stopped], Vec::new());
        }
        self.publish();
    }

    fn publish(&mut self) {
        let mut snapshot = self.plant.snapshot();
        // The plant stands at its last event or tick: what else is news must not set the clock of a terminal back.
        snapshot.at = snapshot.at.max(self.clock.now());
        snapshot.move_to_utc(self.clock.behind_utc());
        if let Some(audit) = &mut self.persistence.audit {
            audit.mark(&mut snapshot);
        }
        self.publish.send_replace(Arc::new(snapshot));
    }

    fn handle_audit_message(&mut self, message: AuditMessage) {
        match (message, &mut self.persistence.audit) {
            (AuditMessage::Entry(action), _) => self.dispatch(vec![Record::Action(action)]),
            (AuditMessage::Reply(sender, result), Some(audit)) => audit.reply(sender, result),
            // A terminal that has left needs no answer.
            (AuditMessage::Reply(reply, answer), None) => {
                drop(reply.send(answer.map(|summary| Completion::new(Durability::NotRecorded, summary))));
            }
            (AuditMessage::Lost(count), Some(audit)) => audit.count_lost(count),
            (AuditMessage::Lost(_), None) => {}
        }
    }

    fn send_due_replies(&mut self) {
        let left = self.persistence.audit.as_mut().map(AuditQueue::send_due).unwrap_or_default();
        self.send_to_history(left.into_iter().map(Record::Action).collect());
    }

    /// A step of the system clock is followed at once, recorded and alarmed.
    fn check_clock(&mut self) {
        let before = self.clock.utc();
        let Some(step) = self.clock.follow() else { return };
        self.clock_stepped(before, before.checked_add(step).unwrap_or(before));
    }

    fn clock_stepped(&mut self, old: Timestamp, new: Timestamp) {
        self.send_to_history(vec![Record::ClockSet]);
        self.send_to_audit_log(vec![entries::clock_step(old, new)], Vec::new());
        let words = format!("the clock was set from {old:.0} to {new:.0}; times follow it from here on");
        tracing::warn!("{words}");
        let state = FaultState::Occurred(words.into());
        let effects = self.plant.on_event(Event::Station { at: self.clock.now(), fault: StationFault::Clock, state });
        self.apply_effects(effects);
    }

    fn apply_effects(&mut self, effects: Effects) {
        // On the way to the log before it is sent; its outcome is shown once both are on disk.
        let requested = effects.bus.iter().filter_map(|(_, request)| self.plant.write_requested_record(request));
        self.dispatch(requested.map(Record::Action).collect());
        for (line, request) in effects.bus {
            self.send(line, request);
        }
        self.dispatch(effects.records);
        if let Some((command, settings)) = effects.save {
            self.save(command, settings);
        }
        if let Some(work) = effects.sets {
            self.file_sets(work);
        }
    }

    fn send(&mut self, line: LineId, request: BusRequest) {
        let link = self.links[line.index()].clone();
        let is_stop = matches!(request, BusRequest::Write(WriteJob { urgent: true, .. }));
        let place = if is_stop || KEPT_FOR_STOPS < link.capacity() { link.try_reserve().ok() } else { None };
        let effects = match place {
            Some(place) => {
                let effects = self.plant.on_delivered(line, &request);
                place.send(request);
                effects
            }
            None => self.plant.on_undeliverable(line, &request),
        };
        self.dispatch(effects.records);
    }

    /// Records of the plant, in its own time.
    fn dispatch(&mut self, mut records: Vec<Record>) {
        if records.is_empty() {
            return;
        }
        let behind = self.clock.behind_utc();
        records.iter_mut().for_each(|record| record.move_to_utc(behind));
        if let Some(observer) = &self.persistence.observer {
            observer(&records);
        }
        let (mut actions, mut events, mut others) = (Vec::new(), Vec::new(), Vec::new());
        for record in records {
            match record {
                Record::Action(action) => actions.push(action),
                Record::Alarm(event) => {
                    self.persistence.past.iter_mut().for_each(|past| past.note(&event));
                    events.push(event.clone());
                    others.push(Record::Alarm(event));
                }
                Record::Sample(..)
                | Record::Line(_)
                | Record::Batch(_)
                | Record::Run(_)
                | Record::Report(_)
                | Record::ClockSet => others.push(record),
            }
        }
        self.send_to_audit_log(actions, events);
        self.send_to_history(others);
    }

    /// To the disk, and actions from there to the history; straight there where there is no room.
    fn send_to_audit_log(&mut self, actions: Vec<ActionRecord>, events: Vec<AlarmRecord>) {
        if actions.is_empty() && events.is_empty() {
            return;
        }
        let left = match &mut self.persistence.audit {
            Some(audit) => audit.put(actions, events),
            None => actions,
        };
        self.send_to_history(left.into_iter().map(Record::Action).collect());
    }

    fn send_to_history(&mut self, records: Vec<Record>) {
        let Some(store) = &self.persistence.records else { return };
        let lost = offer(store, records);
        if lost > 0 {
            self.lost += lost;
            self.update_history_status();
        }
    }

    fn update_history_status(&mut self) {
        let mut status = self.persistence.store.borrow_and_update().clone();
        status.lost += self.lost;
        // One whose thread has ended has said so.
        if self.persistence.store.has_changed().is_ok() && SILENT_MAX <= self.heard.elapsed() {
            status.failing = Some(SILENT.to_owned());
            status.trouble = joined([&status.failing, &status.trouble]);
        }
        let lost = (self.lost > 0).then(|| format!("{} records found the queue to the history full", self.lost));
        status.trouble = joined([&status.trouble, &lost]);
        if let Some(audit) = &mut self.persistence.audit {
            let RecorderFaults { lost, log, alarms } = audit.faults();
            status.lost += lost;
            status.audit = audit.last();
            status.trouble = joined([&status.trouble, &log, &alarms]);
            self.plant.on_fault(StationFault::AuditLog, FaultState::lasting(log));
            self.plant.on_fault(StationFault::AlarmState, FaultState::lasting(alarms));
        }
        self.plant.on_history(status);
    }
}

#[cfg(test)]
mod tests;
