//! Alarms: one condition each, checked against its tag; and "not answering" for every device.

use std::time::Duration;

use super::{
    diagnostic::Problems,
    names::{Defs, Unique, number_of},
    reader::{At, text},
    schema::AlarmTable,
    tag::range_of,
};
use crate::plant::{
    def::{AlarmDef, AlarmId, Condition, DeviceDef, DeviceId, Guidance, Level, Priority, Subject},
    tag::{Bound, TagDef},
};

/// The alarms of a plant file, and one for each device that does not have its own "not answering".
pub(super) fn alarms(tables: &[At<AlarmTable>], defs: &Defs, problems: &mut Problems) -> Vec<AlarmDef> {
    let mut alarms = Vec::new();
    for table in tables.iter().map(|table| &table.value) {
        let id = AlarmId(alarms.len() as u16);
        let found = if table.sound { subject(table, defs, problems) } else { None };
        let Some((subject, condition)) = found else { continue };
        alarms.push(AlarmDef {
            id,
            subject,
            condition,
            priority: table.priority.map_or(Priority::High, |priority| priority.value),
            on_delay: table.on_delay.map_or(Duration::ZERO, |delay| delay.value),
            off_delay: table.off_delay.map_or(Duration::ZERO, |delay| delay.value),
            text: text(&table.text),
            guidance: Guidance {
                cause: text(&table.cause),
                effect: text(&table.effect),
                action: text(&table.action),
                respond: table.respond.map(|respond| respond.value),
            },
        });
    }
    check_names(tables, problems);
    check_order(tables, problems);
    for device in defs.devices {
        let own = |alarm: &AlarmDef| alarm.subject == Subject::Device(device.id);
        if !alarms.iter().any(own) {
            alarms.push(not_answering(AlarmId(alarms.len() as u16), device));
        }
    }
    alarms
}

/// Two alarms of one name would be one in the journal, and each would take up the other's state after a restart.
fn check_names(tables: &[At<AlarmTable>], problems: &mut Problems) {
    let mut seen = Unique::default();
    for table in tables.iter().map(|table| &table.value) {
        let (Some(subject), Some(text)) = (table.tag.as_ref().or(table.device.as_ref()), &table.text) else { continue };
        let message = format!("duplicate alarm `{}` of {}", text.value, subject.value);
        seen.insert(&format!("{}\n{}", subject.value, text.value), text.at, message, problems);
    }
}

/// Limits of one tag that stand in the wrong order, such as a high above the high-high.
fn check_order(tables: &[At<AlarmTable>], problems: &mut Problems) {
    let limit_of = |table: &AlarmTable| {
        let levels =
            [(table.low_low, "low_low"), (table.low, "low"), (table.high, "high"), (table.high_high, "high_high")];
        let rank = levels.iter().position(|(limit, _)| limit.is_some())?;
        Some((table.tag.as_ref()?.value.clone(), rank, levels[rank].0?, levels[rank].1))
    };
    let limits: Vec<_> = tables.iter().filter_map(|table| limit_of(&table.value)).collect();
    for (tag, rank, limit, word) in &limits {
        let lower = limits.iter().filter(|(other, below, ..)| other == tag && below < rank);
        for (_, _, wrong, below) in lower.filter(|(_, _, lower, _)| lower.value >= limit.value) {
            let problem =
                problems.add(wrong.at, format!("{below} {} is not below {word} {} of {tag}", wrong.value, limit.value));
            problem.label("out of order").also(limit.at, *word);
        }
    }
}

fn not_answering(id: AlarmId, device: &DeviceDef) -> AlarmDef {
    AlarmDef {
        id,
        subject: Subject::Device(device.id),
        condition: Condition::NotAnswering,
        priority: Priority::High,
        // The link has already asked more than once; the delay keeps a single lost frame quiet.
        on_delay: Duration::from_secs(3),
        off_delay: Duration::ZERO,
        text: "gives no values".to_owned(),
        guidance: Guidance {
            cause: format!(
                "{} has no power, its cable is open, or its unit address or serial parameters differ",
                device.name
            ),
            effect: "its values are unknown and it cannot be operated from here".to_owned(),
            action: "look at the device itself; then at supply, cable, terminator and the Bus tab".to_owned(),
            respond: Some(Duration::from_secs(600)),
        },
    }
}

fn subject(table: &AlarmTable, defs: &Defs, problems: &mut Problems) -> Option<(Subject, Condition)> {
    match (&table.tag, &table.device) {
        (Some(tag), None) => {
            let tag = defs.tag(tag, problems)?;
            Some((Subject::Tag(tag.id), condition(table, tag, defs, problems)?))
        }
        (None, Some(device)) => {
            let id: DeviceId = defs.device(device, problems)?;
            let conditions = conditions_of(table);
            if let Some((at, word)) = conditions.first() {
                problems
                    .add(*at, format!("a device has no `{word}`"))
                    .label("expected a tag")
                    .help("the alarm of a device means: not answering");
            }
            Some((Subject::Device(id), Condition::NotAnswering))
        }
        (tag, _) => {
            let message = if tag.is_some() {
                "an alarm watches a tag or a device, not both"
            } else {
                "an alarm needs `tag` or `device`"
            };
            problems.add(table.at, message).label("here");
            None
        }
    }
}

/// The conditions that an alarm table has; exactly one is right.
pub(super) fn conditions_of(table: &AlarmTable) -> Vec<(super::diagnostic::Span, &'static str)> {
    let numbers = [
        (table.high_high, "high_high"),
        (table.high, "high"),
        (table.low, "low"),
        (table.low_low, "low_low"),
        (table.deviation, "deviation"),
    ];
    let numbers = numbers.into_iter().filter_map(|(value, word)| Some((value?.at, word)));
    numbers.chain(table.is.as_ref().map(|is| (is.at, "is"))).collect()
}

fn condition(table: &AlarmTable, tag: &TagDef, defs: &Defs, problems: &mut Problems) -> Option<Condition> {
    let found = conditions_of(table);
    let [(at, _)] = found.as_slice() else {
        let words = "`high`, `high_high`, `low`, `low_low`, `deviation` or `is`";
        match found.get(1) {
            Some((second, word)) => problems
                .add(*second, "an alarm has one condition")
                .label(format!("`{word}` needs an [[alarm]] of its own")),
            None => problems.add(table.at, "an alarm needs a condition").label(format!("expected {words}")),
        };
        return None;
    };
    if let Some(is) = &table.is {
        return number_of(is, tag, problems).map(|is| Condition::State { is });
    }
    let deadband = deadband(table, *at, problems);
    if let Some(deviation) = table.deviation {
        let Some(from) = &table.from else {
            problems.add(table.at, "a deviation needs `from`").label("missing here").help("from = \"TIC-1.SV\"");
            return None;
        };
        let from = defs.tag(from, problems)?.id;
        if deviation.value <= 0.0 {
            problems.add(deviation.at, "a deviation is a distance").label("expected more than 0");
        }
        return Some(Condition::Deviation { from, limit: deviation.value, deadband: deadband? });
    }
    let levels = [
        (table.high_high, Level::HighHigh),
        (table.high, Level::High),
        (table.low, Level::Low),
        (table.low_low, Level::LowLow),
    ];
    let (limit, level) = levels.into_iter().find_map(|(limit, level)| Some((limit?, level)))?;
    check_limit(limit, tag, problems);
    Some(Condition::Limit { level, limit: limit.value, deadband: deadband? })
}

fn deadband(table: &AlarmTable, condition: super::diagnostic::Span, problems: &mut Problems) -> Option<f64> {
    let Some(deadband) = table.deadband else {
        let problem = problems.add(condition, "a limit needs a `deadband`").label("without it the alarm would chatter");
        problem.help("usual: temperature 1 %, pressure 2 %, level and flow 5 % of the range");
        return None;
    };
    if deadband.value <= 0.0 {
        problems.add(deadband.at, "a deadband of 0 or less lets the alarm chatter").label("expected more than 0");
    }
    Some(deadband.value)
}

/// A limit that the value can never reach would be an alarm that never comes.
fn check_limit(limit: At<f64>, tag: &TagDef, problems: &mut Problems) {
    let fixed = |bound: Option<Bound>| match bound {
        Some(Bound::Fixed(value)) => Some(value),
        Some(Bound::From(_)) | None => None,
    };
    let (low, high) = range_of(tag).unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let (low, high) = (fixed(tag.min).unwrap_or(low), fixed(tag.max).unwrap_or(high));
    if limit.value < low || limit.value > high {
        let problem = problems.add(limit.at, format!("the limit {} is outside the range of {}", limit.value, tag.name));
        problem.label(format!("it goes from {low} to {high}"));
    }
}
