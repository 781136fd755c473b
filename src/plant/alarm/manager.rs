//! The manager of all alarms: evaluates them against the plant and lists what an operator should see.

use std::{
    collections::HashMap,
    sync::{Arc, OnceLock},
    time::Duration,
};

use jiff::{SignedDuration, Timestamp};

use super::{
    lists::Lists,
    state::{AlarmDelays, AlarmState, AlarmStateMachine},
    succession,
};
use crate::plant::{
    condition::{ConditionMemory, Facts, holds},
    def::{AlarmDef, AlarmId, LineId, PlantDef, Subject},
    exact::Exact,
    record::{AlarmEvent, AlarmIdentity, AlarmRecord, FirstOut},
    station_fault::STATION,
};

/// A suppressed alarm whose enabling has been unknown for so long comes back: an unknown condition must not keep
/// an alarm away for ever, and a lost frame or a restart must not bring all of them back at once.
const UNKNOWN_MAX: Duration = Duration::from_secs(60);

/// The machines of all alarms, by [`AlarmId`].
#[derive(Debug, Clone)]
pub struct AlarmManager {
    pub(super) def: Arc<PlantDef>,
    pub(super) machines: Vec<AlarmStateMachine>,
    /// What each alarm is, whatever it is called, by [`AlarmId`].
    pub(super) identities: Arc<[AlarmIdentity]>,
    /// What conditions that look back remember, by [`AlarmId`].
    pub(super) memories: Vec<ConditionMemory>,
    /// Since when it is unknown whether an alarm is enabled, on the manager's own clock, by [`AlarmId`].
    pub(super) unknown: Vec<Option<Duration>>,
    /// The manager's own clock: what has passed while it was evaluated. It never goes back, whatever the station's clock does.
    pub(super) ran: Duration,
    pub(super) evaluated_at: Option<Timestamp>,
    /// The latest first-out group of each line, and of the station itself: its last alarm, and when its first was raised on the
    /// manager's own clock.
    first_out: HashMap<Option<LineId>, (FirstOut, Duration)>,
    /// Counts annunciations, so that silence and an acknowledgement of all end what was before them and nothing else.
    pub(super) edges: u64,
    pub(super) silenced: u64,
    /// Built on demand, dropped when something changes.
    pub(super) lists: OnceLock<Arc<Lists>>,
}

impl AlarmManager {
    /// Every alarm normal.
    pub fn new(def: Arc<PlantDef>) -> AlarmManager {
        AlarmManager {
            machines: vec![AlarmStateMachine::default(); def.alarms.len()],
            identities: succession::identities(&def).into(),
            memories: vec![ConditionMemory::default(); def.alarms.len()],
            unknown: vec![None; def.alarms.len()],
            def,
            ran: Duration::ZERO,
            evaluated_at: None,
            first_out: HashMap::new(),
            edges: 0,
            silenced: 0,
            lists: OnceLock::new(),
        }
    }

    /// Evaluates every alarm at an instant; `facts` gives what is known for an alarm.
    pub fn evaluate(&mut self, at: Timestamp, facts: impl Fn(&AlarmDef) -> Facts) -> Vec<AlarmRecord> {
        let passed = self.evaluated_at.replace(at).map(|before| at.duration_since(before));
        // A clock that was set back lets no time pass; delays go on from where they were.
        let passed = passed.and_then(|passed| Duration::try_from(passed).ok()).unwrap_or_default();
        self.ran += passed;
        let def = self.def.clone();
        let mut records = Vec::new();
        for alarm in &def.alarms {
            let facts = facts(alarm);
            self.suppress(alarm, facts, at, &mut records);
            self.evaluate_condition(alarm, facts, at, &mut records);
            self.release(alarm, facts, at, &mut records);
            self.end_shelving(alarm, facts, at, &mut records);
            self.remind(alarm, facts, passed, at, &mut records);
        }
        records
    }

    /// How an alarm stands.
    pub fn machine(&self, id: AlarmId) -> &AlarmStateMachine {
        &self.machines[id.index()]
    }

    /// The condition that enables the alarm has become false: an active alarm returns, and is suppressed once it is
    /// acknowledged. One that was annunciated, or waits for a reset, never leaves the list by itself. While the condition is
    /// unknown, nothing is suppressed.
    fn suppress(&mut self, alarm: &AlarmDef, facts: Facts, at: Timestamp, records: &mut Vec<AlarmRecord>) {
        if !is_disabled(alarm, facts) || self.machine(alarm.id).suppressed.is_some() {
            return;
        }
        if self.machine(alarm.id).active && !self.machine(alarm.id).state().is_suppressed() {
            records.push(self.event(alarm, AlarmEvent::ReturnedToNormal, at, facts.value));
        }
        let machine = self.machine(alarm.id);
        if machine.state() == AlarmState::Normal || machine.state().is_suppressed() && !machine.latched {
            records.push(self.event(alarm, AlarmEvent::SuppressedByDesign, at, facts.value));
        }
    }

    fn evaluate_condition(&mut self, alarm: &AlarmDef, facts: Facts, at: Timestamp, records: &mut Vec<AlarmRecord>) {
        let (machine, memory) = (&mut self.machines[alarm.id.index()], &mut self.memories[alarm.id.index()]);
        // What is not known to be enabled again is still not evaluated by what it remembers.
        let disabled = is_disabled(alarm, facts) || machine.suppressed.is_some() && facts.enabled != Some(true);
        let starts_over = disabled && alarm.condition.looks_back();
        let returned = is_disabled(alarm, facts) && machine.suppressed.is_none();
        let event = if starts_over {
            // What looks back starts when the alarm is enabled: a value may stand still while nothing is heated.
            memory.clear();
            machine.evaluate(Some(false), self.ran, AlarmDelays::default())
        } else {
            let holds = holds(alarm.condition, facts, machine.active, memory, self.ran);
            machine.evaluate(if returned { Some(false) } else { holds }, self.ran, delays(alarm))
        };
        if let Some(event) = event {
            records.push(self.event(alarm, event, at, facts.value));
        }
    }

    /// The suppression ends: what holds then begins its on-delay, because a pump that has just started has its time to bring
    /// the flow up. Without a delay it is raised again.
    fn release(&mut self, alarm: &AlarmDef, facts: Facts, at: Timestamp, records: &mut Vec<AlarmRecord>) {
        if self.machine(alarm.id).suppressed.is_none() || !self.is_released(alarm, facts) {
            return;
        }
        records.push(self.event(alarm, AlarmEvent::Unsuppressed, at, facts.value));
        let machine = self.machine(alarm.id);
        let holds = machine.active || machine.pending_since.is_some();
        if machine.active {
            let raised =
                if machine.state().is_suppressed() { AlarmEvent::RaisedSuppressed } else { AlarmEvent::Raised };
            let event = if alarm.on_delay.is_zero() { raised } else { AlarmEvent::ReturnedSuppressed };
            records.push(self.event(alarm, event, at, facts.value));
        }
        if holds {
            self.machines[alarm.id.index()].begin_on_delay(self.ran);
        }
    }

    /// The time on the shelf ends by itself.
    fn end_shelving(&mut self, alarm: &AlarmDef, facts: Facts, at: Timestamp, records: &mut Vec<AlarmRecord>) {
        let Some(shelving) = self.machine(alarm.id).shelved.as_ref() else { return };
        if shelving.until <= at {
            records.push(self.event(alarm, AlarmEvent::Unshelved, at, facts.value));
            records.extend(self.raise_again(alarm, at, facts.value));
        } else if let Some(until) = shelving.moved(at) {
            let (by, reason) = (shelving.note.by.clone(), shelving.note.reason.clone());
            let record = self.record(alarm, AlarmEvent::Shelved, at, facts.value);
            records.push(self.apply_event(alarm.id, AlarmRecord { by, reason, until: Some(until), ..record }));
        }
    }

    /// Is it over with the suppression? Unknown releases nothing, unless it lasts.
    fn is_released(&mut self, alarm: &AlarmDef, facts: Facts) -> bool {
        let unknown = &mut self.unknown[alarm.id.index()];
        match (&alarm.enabled_when, facts.enabled) {
            // The plant file was changed: nothing enables it any more.
            (None, _) => true,
            (Some(_), Some(enabled)) => {
                *unknown = None;
                enabled
            }
            (Some(_), None) => {
                let lasts = self.ran.saturating_sub(*unknown.get_or_insert(self.ran));
                if UNKNOWN_MAX <= lasts {
                    *unknown = None;
                }
                UNKNOWN_MAX <= lasts
            }
        }
    }

    /// An alarm that is active when its suppression ends is raised again.
    pub(super) fn raise_again(&mut self, alarm: &AlarmDef, at: Timestamp, value: Option<Exact>) -> Option<AlarmRecord> {
        let machine = self.machine(alarm.id);
        let due = machine.active && !machine.state().is_suppressed();
        due.then(|| self.event(alarm, AlarmEvent::Raised, at, value))
    }

    /// An alarm that was acknowledged long ago and is still active waits for an acknowledgement again.
    fn remind(
        &mut self,
        alarm: &AlarmDef,
        facts: Facts,
        passed: Duration,
        at: Timestamp,
        records: &mut Vec<AlarmRecord>,
    ) {
        let Some(after) = alarm.re_alarm else { return };
        let machine = &mut self.machines[alarm.id.index()];
        if machine.state() != AlarmState::Acknowledged {
            machine.acknowledged_for = None;
            return;
        }
        // After a restart the time before it counts as far as the clock can be believed.
        let before = || machine.acknowledged.as_ref().map(|note| at.duration_since(note.at));
        let before = || before().and_then(|span| Duration::try_from(span).ok()).unwrap_or_default();
        let lasts = machine.acknowledged_for.map_or_else(before, |lasts| lasts + passed);
        machine.acknowledged_for = Some(lasts);
        if after <= lasts {
            records.push(self.event(alarm, AlarmEvent::ReAlarmed, at, facts.value));
        }
    }

    /// An event without operator.
    fn event(&mut self, alarm: &AlarmDef, event: AlarmEvent, at: Timestamp, value: Option<Exact>) -> AlarmRecord {
        let first_out = (event == AlarmEvent::Raised).then(|| self.next_first_out(alarm.subject, at));
        let record = self.record(alarm, event, at, value);
        self.apply_event(alarm.id, AlarmRecord { first_out, ..record })
    }

    /// Applies an event that was just decided.
    pub(super) fn apply_event(&mut self, id: AlarmId, record: AlarmRecord) -> AlarmRecord {
        self.apply(id, &record);
        record
    }

    pub(super) fn apply(&mut self, id: AlarmId, record: &AlarmRecord) {
        let latch = record.identity.as_ref().map_or(self.def.alarm(id).latch, |identity| identity.latches);
        let machine = &mut self.machines[id.index()];
        let waited = machine.state().needs_acknowledgement();
        machine.apply(record, latch);
        // One that latches comes back from the shelf as it was.
        let comes = !waited && machine.state().needs_acknowledgement();
        if comes || matches!(record.event, AlarmEvent::Raised | AlarmEvent::ReAlarmed) {
            self.edges += 1;
            machine.edge = self.edges;
        }
        self.lists = OnceLock::new();
    }

    /// The place of an alarm among those of its line that were raised within a time of the first: what comes later is no
    /// consequence of it, however long the chain.
    fn next_first_out(&mut self, subject: Subject, at: Timestamp) -> FirstOut {
        let line = match subject {
            Subject::Tag(tag) => Some(self.def.device(self.def.tag(tag).device).line),
            Subject::Device(device) => Some(self.def.device(device).line),
            Subject::Line(line) => Some(line),
            Subject::Station => None,
        };
        let window = self.def.alarm_rules.first_out_window;
        if let Some((group, first)) = self.first_out.get_mut(&line)
            && self.ran.saturating_sub(*first) <= window
        {
            group.rank = group.rank.saturating_add(1);
            return *group;
        }
        // The instant identifies a group: those of two lines are never the same.
        let is_free = |began: &Timestamp| self.first_out.values().all(|(group, _)| group.began != *began);
        let mut instants = std::iter::successors(Some(at), |at| at.checked_add(SignedDuration::from_micros(1)).ok());
        let began = instants.find(is_free).unwrap_or(at);
        let group = FirstOut { began, rank: 1 };
        self.first_out.insert(line, (group, self.ran));
        group
    }

    pub(super) fn record(
        &self,
        alarm: &AlarmDef,
        event: AlarmEvent,
        at: Timestamp,
        value: Option<Exact>,
    ) -> AlarmRecord {
        let record =
            AlarmRecord::new(at, subject_name(&self.def, alarm.subject), &alarm.message, alarm.priority, event);
        let identity = self.identities.get(alarm.id.index()).cloned();
        AlarmRecord { value, limit: alarm.condition.limit(), identity, ..record }
    }
}

/// Subject and message of an alarm, as the journal knows it.
pub fn name_of<'a>(def: &'a PlantDef, alarm: &'a AlarmDef) -> (&'a str, &'a str) {
    (subject_name(def, alarm.subject), &alarm.message)
}

/// Is what enables it false for certain?
fn is_disabled(alarm: &AlarmDef, facts: Facts) -> bool {
    alarm.enabled_when.is_some() && facts.enabled == Some(false)
}

fn delays(alarm: &AlarmDef) -> AlarmDelays {
    AlarmDelays { on_delay: alarm.on_delay, off_delay: alarm.off_delay }
}

/// Full name of what an alarm watches: tag, device, line or station.
pub fn subject_name(def: &PlantDef, subject: Subject) -> &str {
    match subject {
        Subject::Tag(tag) => &def.tag(tag).name,
        Subject::Device(device) => &def.device(device).name,
        Subject::Line(line) => &def.line(line).name,
        Subject::Station => STATION,
    }
}
