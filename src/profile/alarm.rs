//! Alarms: one condition each, on a tag, device or line; "not responding" for every device, "slower than its profile states"
//! where that states a time, "line overloaded" for every line that is polled (without transaction ids also "another master polls this
//! line"), "no traffic heard" for one that is listened to; the faults of the station.

use std::{collections::HashMap, time::Duration};

use super::{
    condition,
    diagnostic::Problems,
    expr,
    names::{Defs, Unique},
    reader::{At, OptionalKey, text},
    schema::{AlarmTable, PlantFile, Requirement},
};
use crate::plant::{
    def::{
        AlarmClass, AlarmDef, AlarmId, AlarmRules, Condition, DeviceDef, Framing, Guidance, LineDef, Priority, Subject,
    },
    expr::Expr,
    number::to_u16,
    station_fault::StationFault,
    tag::TagDef,
};

/// The longest that alarms may be shelved for, whatever a plant file says.
const SHELVE_MAX: Duration = Duration::from_secs(7 * 86_400);
/// A time on the shelf that is too short to be of use.
const SHELVE_MIN: Duration = Duration::from_secs(60);

/// The alarms of a plant file, those of its profiles and those that every device and line has unless the file has its own of
/// that kind, and those of the station.
pub(super) fn alarms(
    own: &[At<AlarmTable>],
    of_profiles: &[At<AlarmTable>],
    defs: &Defs,
    problems: &mut Problems,
) -> Vec<AlarmDef> {
    let tables = &[own, of_profiles].concat();
    let mut alarms: Vec<AlarmDef> = Vec::new();
    for (place, table) in tables.iter().map(|table| &table.value).enumerate() {
        let found = if table.valid { condition::subject(table, defs, problems) } else { None };
        let Some((subject, condition)) = found else { continue };
        let is_same = |alarm: &AlarmDef| alarm.subject == subject && is_same_kind(alarm.condition, condition);
        if own.len() <= place && alarms.iter().any(is_same) {
            continue;
        }
        let alarm = alarm(table, AlarmId(to_u16(alarms.len())), subject, condition, defs, problems);
        alarms.push(alarm);
    }
    check_names(tables, problems);
    check_keys(tables, problems);
    check_order(tables, problems);
    let of_devices = defs.devices.iter().map(|device| (&device.name, not_responding(device)));
    // What another master polls has no worst case here.
    let is_polled = |device: &DeviceDef| defs.lines.get(device.line.index()).is_none_or(|line| !line.listens);
    let timed = defs.devices.iter().filter(|device| device.response_time.is_some() && is_polled(device));
    let of_timed = timed.map(|device| (&device.name, slower_than_stated(device)));
    let of_lines =
        defs.lines.iter().map(|line| (&line.name, if line.listens { no_traffic(line) } else { overloaded(line) }));
    let of_stated = defs.tags.iter().filter_map(|tag| Some((&tag.name, other_than_stated(tag)?)));
    // Modbus TCP has connections, on which others do no harm.
    let is_shared = |line: &&LineDef| !line.listens && line.transport.framing() != Framing::Mbap;
    let of_shared = defs.lines.iter().filter(is_shared).map(|line| (&line.name, other_master(line)));
    for (name, alarm) in of_devices.chain(of_timed).chain(of_lines).chain(of_shared).chain(of_stated) {
        if !alarms.iter().any(|own| (own.subject, own.condition) == (alarm.subject, alarm.condition)) {
            check_generated(tables, name, &alarm.message, problems);
            alarms.push(AlarmDef { id: AlarmId(to_u16(alarms.len())), ..alarm });
        }
    }
    for fault in StationFault::ALL {
        alarms.push(fault.alarm(AlarmId(to_u16(alarms.len()))));
    }
    alarms
}

/// Do both watch for the same, be it at another limit?
fn is_same_kind(one: Condition, other: Condition) -> bool {
    match (one, other) {
        (Condition::Limit { level: one, .. }, Condition::Limit { level: other, .. }) => one == other,
        _ => one == other,
    }
}

/// Two alarms of one name would be one in the journal, and each would take up the other's state after a restart.
fn check_names(tables: &[At<AlarmTable>], problems: &mut Problems) {
    let mut seen = Unique::default();
    for table in tables.iter().map(|table| &table.value) {
        let (Some(subject), Some(text)) = (table.subject(), &table.message) else {
            continue;
        };
        let message = format!("duplicate alarm `{}` of {}", text.value, subject.value);
        seen.insert(&format!("{}\n{}", subject.value, text.value), text.at, message, problems);
    }
}

/// An `id` is one word, and that of one alarm: it stands for the alarm when all else of it has changed.
fn check_keys(tables: &[At<AlarmTable>], problems: &mut Problems) {
    let mut seen = Unique::default();
    for key in tables.iter().filter_map(|table| table.value.id.as_ref()) {
        // Subject and condition of an alarm without `id` are two words.
        if key.value.is_empty() || key.value.contains(char::is_whitespace) {
            problems.add(key.at, "not a valid `id`").label("expected one word, such as \"tank-hot\"");
        }
        seen.insert(&key.value, key.at, format!("duplicate alarm `id` {}", key.value), problems);
    }
}

/// The same where the other one is not in the file: the alarm that every device or line has.
fn check_generated(tables: &[At<AlarmTable>], name: &str, generated: &str, problems: &mut Problems) {
    for table in tables.iter().map(|table| &table.value) {
        let subject = table.subject();
        let same = subject.is_some_and(|subject| subject.value == name);
        if let Some(text) = table.message.as_ref().filter(|text| same && text.value == generated) {
            let problem = problems.add(text.at, format!("duplicate alarm `{generated}` of {name}"));
            problem.label("the station adds an alarm of this name: expected another message");
        }
    }
}

/// What holds for all alarms.
pub(super) fn rules(file: &PlantFile, problems: &mut Problems) -> AlarmRules {
    let usual = AlarmRules::default();
    let Some(table) = file.alarm_rules.as_ref().map(|table| &table.value) else { return usual };
    if let Some(max) = table.shelve_max.filter(|max| !(SHELVE_MIN..=SHELVE_MAX).contains(&max.value)) {
        problems.add(max.at, "not a valid shelving time").label("expected \"1min\" to \"7 days\"");
    }
    AlarmRules {
        shelve_max: table.shelve_max.value_or(usual.shelve_max),
        first_out_window: table.first_out_window.value_or(usual.first_out_window),
    }
}

fn alarm(
    table: &AlarmTable,
    id: AlarmId,
    subject: Subject,
    condition: Condition,
    defs: &Defs,
    problems: &mut Problems,
) -> AlarmDef {
    let time = |time: Option<At<Duration>>| time.value_or(Duration::ZERO);
    let flag = |flag: Option<At<bool>>| flag.value_or(false);
    if let Some(re_alarm) = table.re_alarm.filter(|re_alarm| re_alarm.value < Duration::from_secs(60)) {
        let problem = problems.add(re_alarm.at, "too short: re-alarming so soon is a nuisance");
        problem.label("expected at least \"1min\"");
    }
    AlarmDef {
        key: table.id.as_ref().map(|key| key.value.as_str().into()),
        priority: table.priority.value_or(Priority::High),
        class: table.class.map_or_else(|| class_of(subject, condition), |class| class.value),
        area: text(&table.area),
        on_delay: time(table.on_delay),
        off_delay: time(table.off_delay),
        re_alarm: table.re_alarm.map(|re_alarm| re_alarm.value),
        latch: flag(table.latch),
        ack_comment: table.ack_comment.is_some_and(|note| note.value == Requirement::Required),
        enabled_when: enabled_when(table, subject, defs, problems),
        guidance: Guidance {
            cause: text(&table.cause),
            effect: text(&table.effect),
            action: text(&table.action),
            response_time: table.response_time.map(|time| time.value),
        },
        ..AlarmDef::new(id, subject, condition, text(&table.message))
    }
}

/// The condition of the file, and that of a tag which its device may not have: what is not there raises no alarm.
fn enabled_when(table: &AlarmTable, subject: Subject, defs: &Defs, problems: &mut Problems) -> Option<Expr> {
    let written = table.enabled_when.as_ref().and_then(|words| expr::expr(words, defs, problems));
    let tag = if let Subject::Tag(tag) = subject { defs.tags.get(tag.index()) } else { None };
    let present = tag.and_then(|tag| tag.when.as_deref()).cloned();
    match (present, written) {
        (Some(present), Some(written)) => Some(Expr::All(vec![present, written])),
        (present, written) => present.or(written),
    }
}

/// Whose trouble it is, unless the file says: values that do not come are trouble of the system.
fn class_of(subject: Subject, condition: Condition) -> AlarmClass {
    match (subject, condition) {
        (Subject::Device(_) | Subject::Line(_) | Subject::Station, _)
        | (Subject::Tag(_), Condition::NoUpdate { .. }) => AlarmClass::System,
        (Subject::Tag(_), _) => AlarmClass::Process,
    }
}

/// The levels of a limit, from the lowest.
const LEVELS: [&str; 4] = ["low_low", "low", "high", "high_high"];

/// Limits of a tag that are not below the lowest of a higher level, such as a high above the high-high.
fn check_order(tables: &[At<AlarmTable>], problems: &mut Problems) {
    let limit_of = |table: &'_ AlarmTable| {
        let limits = [table.low_low, table.low, table.high, table.high_high];
        let (rank, limit) = limits.into_iter().enumerate().find_map(|(rank, limit)| Some((rank, limit?)))?;
        Some((table.tag.as_ref()?.value.clone(), rank, limit))
    };
    let limits: Vec<_> = tables.iter().filter_map(|table| limit_of(&table.value)).collect();
    let mut lowest: HashMap<&str, [Option<At<f64>>; LEVELS.len()]> = HashMap::new();
    for (tag, rank, limit) in &limits {
        let known = &mut lowest.entry(tag).or_default()[*rank];
        if known.is_none_or(|known| limit.value < known.value) {
            *known = Some(*limit);
        }
    }
    for (tag, rank, limit) in &limits {
        for (higher, word) in lowest[tag.as_str()].iter().zip(LEVELS).skip(rank + 1) {
            let Some(higher) = higher.filter(|higher| higher.value <= limit.value) else { continue };
            let level = LEVELS[*rank];
            let message = format!("{level} {} is not below {word} {} of {tag}", limit.value, higher.value);
            problems.add(limit.at, message).label("out of order").also(higher.at, word);
        }
    }
}

/// The alarms that devices and lines have by themselves.
#[derive(Clone, Copy)]
enum Own {
    NotResponding,
    SlowerThanStated,
    OtherThanStated,
    NoTraffic,
    Overloaded,
    OtherMaster,
}

impl Own {
    fn message(self) -> &'static str {
        match self {
            Own::NotResponding => "not responding",
            Own::SlowerThanStated => "slower than its profile states",
            Own::OtherThanStated => "other than the plant file states",
            Own::NoTraffic => "no traffic heard",
            Own::Overloaded => "line overloaded",
            Own::OtherMaster => "another master polls this line",
        }
    }

    /// Likely cause, effect, action.
    fn guidance(self) -> [&'static str; 3] {
        match self {
            Own::NotResponding => [
                "the device has no power, its cable is open, or its unit address or serial parameters differ",
                "its values are unknown and it cannot be operated",
                "check the device; then supply, cable and terminator; look at the counters of the device in the Bus tab",
            ],
            Own::SlowerThanStated => [
                "the device takes longer than `response_time_ms` of its profile, or adapter, gateway or computer delay it",
                "its values are right; the worst case of its polls was too low, so polls of its line may be late",
                "raise `response_time_ms` of the device ([device.limits] in the plant file), or poll it less often",
            ],
            Own::OtherThanStated => [
                "the device is set up differently, or `[device.stated]` of the plant file is wrong",
                "values so far were wrong; from now on the value of the device counts",
                "correct `[device.stated]` in the plant file, and inform those who use the values stored before",
            ],
            Own::NoTraffic => [
                "the other master has stopped or is off, or the wire to this port is broken",
                "none of the values of this line is known",
                "check whether the other master runs; then the wires and the settings of the port; look at RX and the frames in the Bus tab",
            ],
            Own::Overloaded => [
                "the line is polled more often than it can carry, or its devices answer more slowly",
                "alarm inputs are polled on time, other values less often; no device is faulty",
                "see the Bus tab; poll less often, increase the baud rate, or split the line",
            ],
            Own::OtherMaster => [
                "a PLC, a panel or a laptop is connected to the same line and sends requests of its own",
                "requests collide, and what is read is not reliable: values become uncertain, then bad",
                "find and stop the other master, or only listen to it (mode `listen` of the line)",
            ],
        }
    }

    fn alarm(self, subject: Subject, condition: Condition, response_time: Option<Duration>) -> AlarmDef {
        AlarmDef {
            class: AlarmClass::System,
            guidance: Guidance::new(self.guidance(), response_time),
            ..AlarmDef::new(AlarmId(0), subject, condition, self.message())
        }
    }
}

/// How soon to respond where values are unknown.
const UNKNOWN_RESPONSE: Option<Duration> = Some(Duration::from_secs(600));

fn not_responding(device: &DeviceDef) -> AlarmDef {
    let subject = Subject::Device(device.id);
    // The link has already asked more than once; the delay keeps a single lost frame quiet.
    let on_delay = Duration::from_secs(3);
    AlarmDef { on_delay, ..Own::NotResponding.alarm(subject, Condition::NotResponding, UNKNOWN_RESPONSE) }
}

fn slower_than_stated(device: &DeviceDef) -> AlarmDef {
    let subject = Subject::Device(device.id);
    AlarmDef { priority: Priority::Low, ..Own::SlowerThanStated.alarm(subject, Condition::SlowerThanStated, None) }
}

fn other_than_stated(tag: &TagDef) -> Option<AlarmDef> {
    let condition = Condition::OtherThanStated { stated: tag.stated? };
    Some(Own::OtherThanStated.alarm(Subject::Tag(tag.id), condition, None))
}

/// The line of another master: nothing is known of its devices while it is silent.
fn no_traffic(line: &LineDef) -> AlarmDef {
    Own::NoTraffic.alarm(Subject::Line(line.id), Condition::NotConnected, UNKNOWN_RESPONSE)
}

fn overloaded(line: &LineDef) -> AlarmDef {
    AlarmDef {
        priority: Priority::Low,
        // The schedule has already seen more than a short peak.
        on_delay: Duration::from_secs(10),
        ..Own::Overloaded.alarm(Subject::Line(line.id), Condition::Overloaded, None)
    }
}

/// A line without transaction ids has one master.
fn other_master(line: &LineDef) -> AlarmDef {
    Own::OtherMaster.alarm(Subject::Line(line.id), Condition::OtherMaster, UNKNOWN_RESPONSE)
}
