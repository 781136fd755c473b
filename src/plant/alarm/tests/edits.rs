//! Plant files edited under standing alarms: nothing leaves without an event, and what can go on does.

mod renames;

use std::collections::BTreeMap;

use super::*;
use crate::plant::{
    alarm::{Succession, manager::name_of, state::AlarmStateMachine},
    def::{LineId, Priority, TagId},
    fixture::{DP, FAULT, RUN, SV, TIC},
    record::AlarmIdentity,
};

/// What is done to a plant file.
#[derive(Debug, Clone, Copy)]
enum Edit {
    Message(usize),
    SwapMessages(usize, usize),
    Priority(usize),
    Limit(usize, u8),
    Level(usize),
    Key(usize),
    Move(usize, TagId),
    Latch(usize),
    Remove(usize),
    Copy(usize),
    RenameTag(TagId),
    RenameDevice,
    RenameLine,
    RemoveTag(TagId),
}

impl Edit {
    /// Everything is where it was, and only called otherwise?
    fn renames(self) -> bool {
        matches!(self, Edit::RenameTag(_) | Edit::RenameDevice | Edit::RenameLine)
    }
}

/// What happens to alarms between two edits.
#[derive(Debug, Clone, Copy)]
enum Happening {
    Values(u8),
    Acknowledge(usize),
    Shelve(usize),
    OutOfService(usize),
    Reset(usize),
    Passes(i64),
}

fn tag() -> impl Strategy<Value = TagId> {
    prop_oneof![Just(PV), Just(SV), Just(DP), Just(FAULT), Just(RUN)]
}

fn edit() -> impl Strategy<Value = Edit> {
    let place = || 0usize..12;
    prop_oneof![
        4 => place().prop_map(Edit::Message),
        1 => (place(), place()).prop_map(|(one, other)| Edit::SwapMessages(one, other)),
        1 => place().prop_map(Edit::Priority),
        2 => (place(), any::<u8>()).prop_map(|(place, limit)| Edit::Limit(place, limit)),
        2 => place().prop_map(Edit::Level),
        2 => place().prop_map(Edit::Key),
        3 => (place(), tag()).prop_map(|(place, tag)| Edit::Move(place, tag)),
        1 => place().prop_map(Edit::Latch),
        2 => place().prop_map(Edit::Remove),
        2 => place().prop_map(Edit::Copy),
        3 => tag().prop_map(Edit::RenameTag),
        2 => Just(Edit::RenameDevice),
        1 => Just(Edit::RenameLine),
        1 => tag().prop_map(Edit::RemoveTag),
    ]
}

fn happening() -> impl Strategy<Value = Happening> {
    let place = || 0usize..12;
    prop_oneof![
        3 => any::<u8>().prop_map(Happening::Values),
        2 => place().prop_map(Happening::Acknowledge),
        1 => place().prop_map(Happening::Shelve),
        1 => place().prop_map(Happening::OutOfService),
        1 => place().prop_map(Happening::Reset),
        2 => (0i64..900).prop_map(Happening::Passes),
    ]
}

/// A plant with an alarm of each manner.
fn edited() -> PlantDef {
    let mut def = fixture::plant();
    let limit = |level, limit| Condition::Limit { level, limit, deadband: 0.0 };
    let alarm = |subject, condition, message: &str| AlarmDef::new(AlarmId(0), subject, condition, message);
    def.alarms = vec![
        alarm(Subject::Tag(PV), limit(Level::High, 70.0), "hot"),
        AlarmDef { key: Some("very-hot".into()), ..alarm(Subject::Tag(PV), limit(Level::HighHigh, 90.0), "very hot") },
        AlarmDef { latch: true, ..alarm(Subject::Tag(SV), limit(Level::High, 60.0), "setpoint high") },
        alarm(Subject::Tag(SV), limit(Level::Low, 20.0), "setpoint low"),
        AlarmDef { latch: true, ..alarm(Subject::Tag(RUN), Condition::State { is: 1.0 }, "runs") },
        alarm(Subject::Tag(RUN), Condition::Bit { bit: 3 }, "bit"),
        alarm(Subject::Device(TIC), Condition::NotResponding, "silent"),
        alarm(Subject::Line(LineId(0)), Condition::NotConnected, "cut"),
    ];
    numbered(def)
}

fn numbered(mut def: PlantDef) -> PlantDef {
    // No two alarms of one name, as no plant file has them.
    let mut names = std::collections::HashSet::new();
    let subjects = def.clone();
    def.alarms.retain(|alarm| {
        let (subject, message) = name_of(&subjects, alarm);
        names.insert((subject.to_owned(), message.to_owned()))
    });
    let mut keys = std::collections::HashSet::new();
    for (place, alarm) in def.alarms.iter_mut().enumerate() {
        alarm.id = AlarmId(place as u16);
        alarm.key = alarm.key.take().filter(|key| keys.insert(key.clone()));
    }
    def
}

/// The plant file after an edit; `number` makes new names.
fn apply_edit(mut def: PlantDef, edit: Edit, number: usize) -> PlantDef {
    let count = def.alarms.len().max(1);
    let at = |place: usize| place % count;
    let of_tag = |tag: TagId| move |alarm: &AlarmDef| alarm.subject == Subject::Tag(tag);
    match edit {
        Edit::RenameTag(tag) => def.tags[tag.index()].name = format!("T-{number}"),
        Edit::RenameDevice => def.devices[TIC.index()].name = format!("D-{number}"),
        Edit::RenameLine => def.lines[0].name = format!("L-{number}"),
        Edit::RemoveTag(tag) => def.alarms.retain(|alarm| !of_tag(tag)(alarm)),
        _ if def.alarms.is_empty() => def.alarms = edited().alarms,
        Edit::Message(place) => def.alarms[at(place)].message = format!("message {number}"),
        Edit::SwapMessages(one, other) => {
            let (one, other) = (at(one), at(other));
            let message = def.alarms[one].message.clone();
            def.alarms[one].message = std::mem::replace(&mut def.alarms[other].message, message);
        }
        Edit::Priority(place) => def.alarms[at(place)].priority = Priority::Low,
        Edit::Limit(place, to) => {
            if let Condition::Limit { limit, .. } = &mut def.alarms[at(place)].condition {
                *limit = f64::from(to) / 2.5;
            }
        }
        Edit::Level(place) => {
            if let Condition::Limit { level, .. } = &mut def.alarms[at(place)].condition {
                *level = if *level == Level::High { Level::Low } else { Level::High };
            }
        }
        Edit::Key(place) => def.alarms[at(place)].key = Some(format!("key-{number}").into()),
        Edit::Move(place, tag) => {
            let alarm = &mut def.alarms[at(place)];
            if matches!(alarm.subject, Subject::Tag(_)) {
                alarm.subject = Subject::Tag(tag);
            }
        }
        Edit::Latch(place) => def.alarms[at(place)].latch ^= true,
        Edit::Remove(place) => drop(def.alarms.remove(at(place))),
        Edit::Copy(place) => {
            let copy = AlarmDef { key: None, message: format!("copy {number}"), ..def.alarms[at(place)].clone() };
            def.alarms.push(copy);
        }
    }
    numbered(def)
}

/// A station with its journal and its state file.
struct Station {
    manager: AlarmManager,
    now: i64,
    value: u8,
    journal: Vec<AlarmRecord>,
    state: Vec<AlarmRecord>,
}

/// What stands by the names of its alarms: state, and since when.
type Standing = BTreeMap<(String, String), AlarmState>;

impl Station {
    fn new(def: PlantDef) -> Station {
        let manager = AlarmManager::new(Arc::new(def));
        Station { manager, now: 1_000, value: 0, journal: Vec::new(), state: Vec::new() }
    }

    fn record(&mut self, records: impl IntoIterator<Item = AlarmRecord>) {
        for record in records {
            self.journal.push(record.clone());
            self.state.push(record);
        }
    }

    fn evaluate(&mut self) {
        self.now += 1;
        let value = f64::from(self.value) / 2.5;
        let found = self.manager.evaluate(at(self.now), |alarm| match alarm.subject {
            Subject::Tag(RUN) => Facts { value: Some(f64::from(self.value % 2).into()), ..Facts::default() },
            _ => Facts { value: Some(value.into()), ill: Some(self.value.is_multiple_of(3)), ..Facts::default() },
        });
        self.record(found);
    }

    fn happens(&mut self, happening: Happening) {
        let count = self.manager.def.alarms.len();
        let id = |place: usize| AlarmId((place % count.max(1)) as u16);
        let (now, seen) = (at(self.now), self.manager.annunciations());
        let noted = note(now, Some(&why()));
        let done = match happening {
            Happening::Passes(seconds) => {
                self.now += seconds;
                None
            }
            Happening::Values(value) => {
                self.value = value;
                None
            }
            _ if count == 0 => None,
            Happening::Acknowledge(place) => self.manager.acknowledge_seen(id(place), seen, &noted).ok(),
            Happening::Shelve(place) => self.manager.shelve(id(place), Duration::from_secs(600), &noted).ok(),
            Happening::OutOfService(place) => self.manager.out_of_service(id(place), &noted).ok(),
            Happening::Reset(place) => self.manager.reset(id(place), &noted).ok(),
        };
        self.record(done);
        self.evaluate();
    }

    fn standing(&self) -> Standing {
        let def = &self.manager.def;
        let all = def.alarms.iter().map(|alarm| (alarm, self.manager.machine(alarm.id)));
        let named = |(alarm, machine): (&AlarmDef, &AlarmStateMachine)| {
            let (subject, message) = name_of(def, alarm);
            ((subject.to_owned(), message.to_owned()), machine.state())
        };
        all.filter(|(_, machine)| machine.stands()).map(named).collect()
    }

    /// The same by place in the plant file.
    fn standing_by_id(&self) -> Vec<(AlarmId, AlarmState)> {
        let all = self.manager.def.alarms.iter().map(|alarm| (alarm.id, self.manager.machine(alarm.id)));
        all.filter(|(_, machine)| machine.stands()).map(|(id, machine)| (id, machine.state())).collect()
    }

    /// The same from the journal alone.
    fn journaled(&self) -> Standing {
        let mut machines: BTreeMap<(String, String), AlarmStateMachine> = BTreeMap::new();
        for event in &self.journal {
            let machine = machines.entry((event.subject.to_string(), event.message.to_string())).or_default();
            machine.apply(event, event.identity.as_ref().is_some_and(|AlarmIdentity { latches, .. }| *latches));
        }
        machines.into_iter().filter(|(_, machine)| machine.stands()).map(|(name, it)| (name, it.state())).collect()
    }

    fn follow(&mut self, succession: Succession) {
        let journal = succession.journal(at(self.now), None);
        self.record(journal);
        self.state.extend(succession.state());
    }

    fn reload(&mut self, def: PlantDef) {
        let succession = self.manager.redefine(&Arc::new(def), at(self.now));
        self.follow(succession);
    }

    fn restart(&mut self, def: PlantDef) {
        self.manager = AlarmManager::new(Arc::new(def));
        let succession = self.manager.restore(&kept(&self.state));
        self.follow(succession);
    }
}

/// What the state file keeps: of each name the last event of every kind.
fn kept(state: &[AlarmRecord]) -> Vec<AlarmRecord> {
    let last = |(place, record): &(usize, &AlarmRecord)| {
        let same = |later: &AlarmRecord| {
            (&later.event, &later.subject, &later.message) == (&record.event, &record.subject, &record.message)
        };
        !state[place + 1..].iter().any(same)
    };
    state.iter().enumerate().filter(last).map(|(_, record)| record.clone()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn a_plant_file_edited_fifty_times_loses_no_alarm_without_an_event(
        rounds in proptest::collection::vec((proptest::collection::vec(happening(), 1..8), edit(), any::<bool>()), 50),
    ) {
        let mut def = edited();
        let mut station = Station::new(def.clone());
        for (number, (happenings, edit, restarts)) in rounds.into_iter().enumerate() {
            happenings.into_iter().for_each(|happening| station.happens(happening));
            prop_assert_eq!(station.journaled(), station.standing(), "before {:?}", edit);
            let before = station.standing_by_id();
            def = apply_edit(def, edit, number);
            match restarts {
                true => station.restart(def.clone()),
                false => station.reload(def.clone()),
            }
            prop_assert_eq!(station.journaled(), station.standing(), "after {:?}, restarted: {}", edit, restarts);
            if edit.renames() {
                prop_assert_eq!(before, station.standing_by_id(), "{:?}, restarted: {}", edit, restarts);
            }
        }
    }
}

/// PV is too hot and acknowledged, SV shelved, the device out of service; the state file of it.
fn standing() -> Station {
    let mut station = Station::new(edited());
    station.happens(Happening::Values(240));
    for happening in [Happening::Acknowledge(0), Happening::Shelve(2), Happening::OutOfService(6)] {
        station.happens(happening);
    }
    station
}

#[test]
fn an_alarm_whose_wording_changes_stands_as_it_did() {
    for restarts in [false, true] {
        let mut station = standing();
        let before = station.manager.lists().clone();
        let mut def = edited();
        def.alarms[0].message = "too hot".into();
        // By its id it is known everywhere.
        (def.alarms[1].message, def.alarms[1].subject) = ("far too hot".into(), Subject::Tag(SV));
        def.alarms[2].message = "setpoint too high".into();
        def.devices[TIC.index()].name = "TIC-9".into();
        let journaled = station.journal.len();
        if restarts {
            station.restart(def)
        } else {
            station.reload(def)
        }
        let after = station.manager.lists();
        let times = |alarms: &[crate::plant::alarm::ActiveAlarm]| -> Vec<_> {
            let of_one = |alarm: &crate::plant::alarm::ActiveAlarm| {
                (alarm.id, alarm.state, alarm.raised_at, alarm.acknowledged.clone(), alarm.value)
            };
            alarms.iter().map(of_one).collect()
        };
        assert_eq!(times(&after.active), times(&before.active), "restarts: {restarts}");
        assert_eq!(after.suppressed, before.suppressed, "the shelving, and the device that has another name");
        let new: Vec<_> = station.journal[journaled..]
            .iter()
            .map(|event| (&*event.subject, &*event.message, event.event, event.reason.as_deref().unwrap_or("")))
            .collect();
        use AlarmEvent::{Acknowledged, CarriedOver, OutOfService, Removed, Shelved};
        assert_eq!(
            new,
            [
                ("TIC-1.PV", "hot", Removed, "goes on as TIC-1.PV too hot"),
                ("TIC-1.PV", "very hot", Removed, "goes on as TIC-1.SV far too hot"),
                ("TIC-1.SV", "setpoint high", Removed, "goes on as TIC-1.SV setpoint too high"),
                ("TIC-1", "silent", Removed, "goes on as TIC-9 silent"),
                ("TIC-1.PV", "too hot", CarriedOver, "was TIC-1.PV hot"),
                ("TIC-1.PV", "too hot", Acknowledged, "carried over: sensor is being changed"),
                ("TIC-1.SV", "far too hot", CarriedOver, "was TIC-1.PV very hot"),
                ("TIC-1.SV", "setpoint too high", CarriedOver, "was TIC-1.SV setpoint high"),
                ("TIC-1.SV", "setpoint too high", Shelved, "carried over: sensor is being changed"),
                ("TIC-9", "silent", CarriedOver, "was TIC-1 silent"),
                ("TIC-9", "silent", OutOfService, "carried over: sensor is being changed"),
            ]
        );
    }
}

#[test]
fn an_alarm_of_an_earlier_version_ends_with_its_plant_file() {
    let event = |second, kind| AlarmRecord::new(at(second), "TIC-1.PV", "gone long ago", Priority::High, kind);
    let mut manager = AlarmManager::new(Arc::new(edited()));
    let succession = manager.restore(&[event(100, AlarmEvent::Raised), event(200, AlarmEvent::Shelved)]);
    for (changed, expect) in [(Some(500), 500), (Some(150), 9_000), (None, 9_000)] {
        let ends = succession.journal(at(9_000), changed.map(at));
        assert_eq!(ends.iter().map(|end| (end.at, end.event)).collect::<Vec<_>>(), [(at(expect), AlarmEvent::Removed)]);
    }
    let quiet = [
        event(100, AlarmEvent::Raised),
        event(200, AlarmEvent::Acknowledged),
        event(300, AlarmEvent::ReturnedToNormal),
    ];
    assert_eq!(manager.restore(&quiet), Succession::default(), "nothing of it was left");
}
