//! Which alarm of one plant file is which of another, and what becomes of those that have no successor.
//!
//! An alarm is the same where its `id` is, else where subject and condition are, else where it is called the same, else where
//! what it watches is the same line, unit and register under another name and nothing else is there. What stands of it goes
//! on, whatever it is called now: under its old name it ends, under the new one it is carried over. What has no successor
//! ends too: no alarm leaves without an event.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use jiff::Timestamp;

use super::{
    AlarmManager,
    manager::{name_of, subject_name},
    state::{AlarmState, AlarmStateMachine, OperatorNote},
};
use crate::plant::{
    condition::{Condition, Level},
    def::{AlarmDef, AlarmId, PlantDef, Subject},
    place,
    record::{AlarmEvent, AlarmIdentity, AlarmRecord},
};

/// What follows for the records where a plant file calls alarms otherwise than the one before it, or has them no more.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Succession {
    /// The ends under the old names; each is of the last event that is known of its alarm.
    pub ended: Vec<AlarmRecord>,
    /// What stands under the new names, with the times at which it began.
    pub carried: Vec<AlarmRecord>,
    /// What stands of alarms that are called as before, but are known by something else now.
    pub identified: Vec<AlarmRecord>,
}

impl Succession {
    /// What the journal has of it. What went on does so from `at` on; what has ended did so at `changed`, the last change of
    /// the plant file, unless something was heard of it after that.
    pub fn journal(&self, at: Timestamp, changed: Option<Timestamp>) -> Vec<AlarmRecord> {
        let end = |event: &AlarmRecord| {
            let changed = changed.filter(|changed| event.reason.is_none() && event.at < *changed);
            AlarmRecord { at: changed.unwrap_or(at), ..event.clone() }
        };
        let ends = self.ended.iter().map(end);
        let carried = self.carried.iter().filter(|event| !event.event.is_of_step()).map(|event| {
            // It was not done again.
            let again = event.by.is_some().then(|| match &event.reason {
                Some(reason) => format!("carried over: {reason}").into(),
                None => "carried over".into(),
            });
            AlarmRecord { at, reason: again.or_else(|| event.reason.clone()), ..event.clone() }
        });
        ends.chain(carried).collect()
    }

    /// What the state file has beside that of the journal: it knows since when it stands.
    pub fn state(self) -> Vec<AlarmRecord> {
        self.carried.into_iter().chain(self.identified).collect()
    }
}

/// What is remembered of an alarm by its name in the journal.
struct Remembered<'a> {
    machine: AlarmStateMachine,
    identity: Option<&'a AlarmIdentity>,
    last: &'a AlarmRecord,
}

/// The names of an alarm in the journal.
type Names<'a> = (&'a str, &'a str);

impl AlarmManager {
    /// Restores the alarms from the journal or the state file after a restart: of each alarm at least the last event of every
    /// kind, oldest first.
    pub fn restore(&mut self, events: &[AlarmRecord]) -> Succession {
        let def = self.def.clone();
        let mut known: HashMap<Names, Remembered> = HashMap::new();
        let mut order: Vec<Names> = Vec::new();
        let by_name: HashMap<Names, AlarmId> =
            def.alarms.iter().map(|alarm| (name_of(&def, alarm), alarm.id)).collect();
        for event in events {
            let name = (&*event.subject, &*event.message);
            let was = known.entry(name).or_insert_with(|| {
                order.push(name);
                Remembered { machine: AlarmStateMachine::default(), identity: None, last: event }
            });
            (was.identity, was.last) = (event.identity.as_ref().or(was.identity), event);
            let of_def = || by_name.get(&name).is_some_and(|id| def.alarm(*id).latch);
            was.machine.apply(event, was.identity.map_or_else(of_def, |identity| identity.latches));
        }
        let successors = self.successors(&order, &known, &by_name);
        for event in events {
            if let Some(id) = successors.get(&(&*event.subject, &*event.message)) {
                self.apply(*id, event);
            }
        }
        let mut succession = Succession::default();
        for name in order.iter().filter(|name| known[*name].machine.stands()) {
            let was = &known[name];
            let successor = successors.get(name).map(|id| def.alarm(*id));
            match successor.filter(|alarm| name_of(&def, alarm) == *name) {
                None => self.succeed(was.last, successor, &mut succession),
                Some(alarm) if was.identity == self.identities.get(alarm.id.index()) => {}
                Some(alarm) => succession.identified.extend(self.standing(alarm, was.last)),
            }
        }
        succession
    }

    /// The alarm that each name of the journal goes on as, at most one name for each.
    fn successors<'a>(
        &self,
        order: &[Names<'a>],
        known: &HashMap<Names<'a>, Remembered>,
        by_name: &HashMap<Names, AlarmId>,
    ) -> HashMap<Names<'a>, AlarmId> {
        let by_identity: HashMap<&str, AlarmId> =
            self.identities.iter().zip(&self.def.alarms).map(|(identity, alarm)| (&*identity.name, alarm.id)).collect();
        let by_place: HashMap<&str, AlarmId> = by_place(&self.identities);
        let identified = |name: &Names| by_identity.get(&*known[name].identity?.name).copied();
        let placed = |name: &Names| by_place.get(&**known[name].identity?.place.as_ref()?).copied();
        let named = |name: &Names| by_name.get(name).copied();
        let standing = || order.iter().filter(|name| known[*name].machine.stands());
        let (mut successors, mut taken) = (HashMap::new(), HashSet::new());
        let mut take = |name: &Names<'a>, id: Option<AlarmId>| {
            if let Some(id) = id.filter(|id| !successors.contains_key(name) && taken.insert(*id)) {
                successors.insert(*name, id);
            }
        };
        standing().for_each(|name| take(name, identified(name).filter(|id| named(name) == Some(*id))));
        standing().for_each(|name| take(name, identified(name)));
        standing().for_each(|name| take(name, named(name)));
        standing().for_each(|name| take(name, placed(name)));
        order.iter().for_each(|name| take(name, named(name)));
        successors
    }

    /// Goes on under another definition: each alarm stands as it did. Where its condition is another, its delay and what it
    /// looks back on begin again.
    pub fn redefine(&mut self, def: &Arc<PlantDef>, at: Timestamp) -> Succession {
        let mut begun = AlarmManager::new(def.clone());
        (begun.ran, begun.evaluated_at) = (self.ran, self.evaluated_at);
        (begun.edges, begun.silenced) = (self.edges, self.silenced);
        let mut before = std::mem::replace(self, begun);
        let successors = successors(&before.def, def);
        let reference =
            |def: &PlantDef, alarm: &AlarmDef| alarm.condition.reference().map(|tag| def.tag(tag).name.clone());
        let mut succession = Succession::default();
        for (place, successor) in successors.into_iter().enumerate() {
            let (was, successor) = (&before.def.alarms[place], successor.map(|id| def.alarm(id)));
            let is_renamed = successor.is_none_or(|alarm| name_of(def, alarm) != name_of(&before.def, was));
            let stands = before.machines[place].stands();
            let last = stands.then(|| before.record(was, AlarmEvent::Removed, at, None));
            if let Some(alarm) = successor {
                let to = alarm.id.index();
                self.machines[to] = std::mem::take(&mut before.machines[place]);
                if alarm.condition == was.condition && reference(def, alarm) == reference(&before.def, was) {
                    self.memories[to] = std::mem::take(&mut before.memories[place]);
                    self.unknown[to] = before.unknown[place];
                } else {
                    self.machines[to].pending_since = None;
                }
            }
            if let Some(last) = last.as_ref().filter(|_| is_renamed) {
                self.succeed(last, successor, &mut succession);
            }
            let is_known =
                |alarm: &&AlarmDef| self.identities[alarm.id.index()] == before.identities[place] || is_renamed;
            if let (Some(last), Some(alarm)) = (last, successor.filter(|alarm| !is_known(alarm))) {
                succession.identified.extend(self.standing(alarm, &last));
            }
        }
        succession
    }

    /// An alarm ends under the name of its last event; what stands of it goes on under that of its successor.
    fn succeed(&self, last: &AlarmRecord, successor: Option<&AlarmDef>, succession: &mut Succession) {
        let reason = successor.map(|alarm| {
            let (subject, message) = name_of(&self.def, alarm);
            format!("goes on as {subject} {message}").into()
        });
        let end = AlarmRecord::new(last.at, &last.subject, &last.message, last.priority, AlarmEvent::Removed);
        succession.ended.push(AlarmRecord { reason, identity: last.identity.clone(), ..end });
        succession.carried.extend(successor.into_iter().flat_map(|alarm| self.standing(alarm, last)));
    }

    /// The events that bring an alarm to where it stands, after one that was called as in `last`.
    fn standing(&self, alarm: &AlarmDef, last: &AlarmRecord) -> Vec<AlarmRecord> {
        let machine = self.machine(alarm.id);
        let raised_at = super::lists::raised_at_of(machine);
        // It latches as it did when it was raised.
        let identity = self.identities.get(alarm.id.index());
        let identity = identity.map(|identity| AlarmIdentity { latches: machine.latched, ..identity.clone() });
        let event = |event, at| AlarmRecord { identity: identity.clone(), ..self.record(alarm, event, at, None) };
        let by = |kind, note: &OperatorNote| {
            let record = event(kind, note.at);
            AlarmRecord { by: note.by.clone(), reason: note.reason.clone(), ..record }
        };
        let state = machine.state();
        let is_raised = machine.active || machine.latched || !state.is_suppressed();
        let raised = is_raised.then(|| {
            let reason = Some(format!("was {} {}", last.subject, last.message).into());
            let (value, first_out) = (machine.value, machine.first_out);
            AlarmRecord { value, first_out, reason, ..event(AlarmEvent::CarriedOver, raised_at) }
        });
        let acknowledged = machine.acknowledged.as_ref().map(|note| by(AlarmEvent::Acknowledged, note));
        let again = machine.annunciated_at.filter(|at| is_raised && machine.unacknowledged && raised_at < *at);
        let returned = (is_raised && !machine.active)
            .then(|| event(AlarmEvent::ReturnedToNormal, machine.returned_at.unwrap_or(raised_at)));
        let shelved = machine
            .shelved
            .as_ref()
            .map(|shelving| AlarmRecord { until: Some(shelving.until), ..by(AlarmEvent::Shelved, &shelving.note) });
        let steps = machine.steps.iter().map(|note| by(AlarmEvent::StepDone, note));
        let events = [
            raised,
            acknowledged.filter(|_| is_raised),
            again.map(|at| event(AlarmEvent::ReAlarmed, at)),
            returned,
            machine.suppressed.map(|at| event(AlarmEvent::SuppressedByDesign, at)),
            shelved,
            machine.out_of_service.as_ref().map(|note| by(AlarmEvent::OutOfService, note)),
        ];
        events.into_iter().flatten().chain(steps).collect()
    }
}

impl AlarmStateMachine {
    /// Is there anything of it that must not be lost?
    pub(super) fn stands(&self) -> bool {
        self.active || self.state() != AlarmState::Normal
    }
}

/// The alarm of another definition that each goes on as, by its place.
pub fn successors(before: &PlantDef, def: &PlantDef) -> Vec<Option<AlarmId>> {
    let identities = identities(def);
    let by_identity: HashMap<&str, AlarmId> =
        identities.iter().zip(&def.alarms).map(|(identity, alarm)| (&*identity.name, alarm.id)).collect();
    let by_name: HashMap<Names, AlarmId> = def.alarms.iter().map(|alarm| (name_of(def, alarm), alarm.id)).collect();
    let mut taken = HashSet::new();
    let mut take = |id: Option<&AlarmId>| id.copied().filter(|id| taken.insert(*id));
    let was = self::identities(before);
    let mut successors: Vec<Option<AlarmId>> =
        was.iter().map(|identity| take(by_identity.get(&*identity.name))).collect();
    for (alarm, successor) in before.alarms.iter().zip(&mut successors).filter(|(_, successor)| successor.is_none()) {
        *successor = take(by_name.get(&name_of(before, alarm)));
    }
    let by_place = by_place(&identities);
    for (identity, successor) in was.iter().zip(&mut successors).filter(|(_, successor)| successor.is_none()) {
        *successor = take(identity.place.as_ref().and_then(|place| by_place.get(&**place)));
    }
    successors
}

/// What each alarm of a plant is, by its place.
pub(super) fn identities(def: &PlantDef) -> Vec<AlarmIdentity> {
    let names = distinct(def, |subject| subject_name(def, subject).to_owned());
    let places = distinct(def, |subject| place::of_subject(def, subject));
    let often = counted(&places);
    let place = |place: &String| (often[place.as_str()] == 1).then(|| place.as_str().into());
    let identity = |((alarm, name), of): ((&AlarmDef, &String), &String)| {
        let name = alarm.key.clone().unwrap_or_else(|| name.as_str().into());
        AlarmIdentity { name, place: place(of), latches: alarm.latch }
    };
    def.alarms.iter().zip(&names).zip(&places).map(identity).collect()
}

/// Subject and kind of the condition of each alarm, with its limit and its message where others have the same.
fn distinct(def: &PlantDef, subject: impl Fn(Subject) -> String) -> Vec<String> {
    let kind = |alarm: &AlarmDef| format!("{} {}", subject(alarm.subject), kind(alarm.condition));
    let kinds: Vec<String> = def.alarms.iter().map(kind).collect();
    let with_limit = |(alarm, kind): (&AlarmDef, &String)| match alarm.condition.limit() {
        Some(limit) => format!("{kind} {limit}"),
        None => kind.clone(),
    };
    let limits: Vec<String> = def.alarms.iter().zip(&kinds).map(with_limit).collect();
    let (often, as_often) = (counted(&kinds), counted(&limits));
    let words = |((alarm, kind), limit): ((&AlarmDef, &String), &String)| match (
        often[kind.as_str()],
        as_often[limit.as_str()],
    ) {
        (1, _) => kind.clone(),
        (_, 1) => limit.clone(),
        _ => format!("{limit} {}", alarm.message),
    };
    def.alarms.iter().zip(&kinds).zip(&limits).map(words).collect()
}

fn by_place(identities: &[AlarmIdentity]) -> HashMap<&str, AlarmId> {
    let ids = (0..).map(AlarmId);
    identities.iter().zip(ids).filter_map(|(identity, id)| Some((identity.place.as_deref()?, id))).collect()
}

fn counted(names: &[String]) -> HashMap<&str, u32> {
    let mut counts = HashMap::new();
    names.iter().for_each(|name| *counts.entry(name.as_str()).or_default() += 1);
    counts
}

/// A condition without what is tuned: limits, times.
fn kind(condition: Condition) -> String {
    let word = match condition {
        Condition::Limit { level: Level::HighHigh, .. } => "high_high",
        Condition::Limit { level: Level::High, .. } => "high",
        Condition::Limit { level: Level::Low, .. } => "low",
        Condition::Limit { level: Level::LowLow, .. } => "low_low",
        Condition::Deviation { .. } => "deviation",
        Condition::State { is } => return format!("is {is}"),
        Condition::OtherThanStated { .. } => "other than stated",
        Condition::Bit { bit } => return format!("bit {bit}"),
        Condition::Rate { limit, .. } if limit < 0.0 => "fall",
        Condition::Rate { .. } => "rise",
        Condition::NoChange { .. } => "no_change",
        Condition::NoUpdate { .. } => "no_update",
        Condition::Changes { .. } => "changes",
        Condition::NotResponding => "not responding",
        Condition::Health { signal } => return format!("ne107 {signal:?}"),
        Condition::SlowerThanStated => "slower_than_stated",
        Condition::NotConnected => "not connected",
        Condition::Overloaded => "overloaded",
        Condition::OtherMaster => "other master",
        Condition::Station(fault) => fault.word(),
    };
    word.to_owned()
}
