//! The audit record of a command.

use crate::plant::{
    alarm::{AlarmCommand, manager::subject_name},
    command::{CommandKind, CommandStatus},
    counter,
    def::{AlarmId, PlantDef},
    exact::{Exact, digits},
    procedure,
    process_image::ProcessImage,
    record::ActionRecord,
    tag::TagDef,
};

/// The recorded word for a plant that was handed over to the next shift.
pub const HAND_OVER: &str = "hand over";
/// The recorded word for a plant that was taken over from the shift before.
pub const TAKE_OVER: &str = "take over";

pub(super) fn record(def: &PlantDef, status: &CommandStatus, image: &ProcessImage) -> ActionRecord {
    let (action, target, new): (&str, String, Option<String>) = match &status.command.kind {
        CommandKind::Write { tag, value } => {
            let tag = def.tag(*tag);
            ("write", tag.name.clone(), Some(value_text(image, tag, *value)))
        }
        CommandKind::WriteText { tag, text, .. } => ("write", def.tag(*tag).name.clone(), Some(text.to_string())),
        CommandKind::Alarm(alarm_command) => alarm_action(def, alarm_command),
        CommandKind::Refresh(device) => ("refresh", def.device(*device).name.clone(), None),
        CommandKind::Connect(line, true) => ("connect", def.line(*line).name.clone(), None),
        CommandKind::Connect(line, false) => ("disconnect", def.line(*line).name.clone(), None),
        CommandKind::Configure(settings) => ("configure", settings.name.clone(), Some(settings.transport.to_string())),
        CommandKind::SaveSettings(line) => ("save settings", def.line(*line).name.clone(), None),
        CommandKind::Test(line, diagnostic) => ("test", def.line(*line).name.clone(), Some(diagnostic.to_string())),
        CommandKind::StopTest(line) => ("stop test", def.line(*line).name.clone(), None),
        CommandKind::ReadSets => ("read sets", "parameter sets".into(), None),
        CommandKind::SaveSet { device, name, .. } => {
            ("save set", def.device(*device).name.clone(), Some(name.to_string()))
        }
        CommandKind::Restore(request) => {
            let new = format!("{}: {} changes", request.from, request.changes.len());
            ("restore set", def.device(request.device).name.clone(), Some(new))
        }
        CommandKind::StopRestore(device) => ("stop restore", def.device(*device).name.clone(), None),
        CommandKind::StartProcedure(id) => (procedure::START, def.procedure(*id).name.to_string(), None),
        CommandKind::AbortProcedure(id) => (procedure::ABORT, def.procedure(*id).name.to_string(), None),
        CommandKind::CorrectCounter { tag, amount } => {
            let tag = def.tag(*tag);
            (counter::CORRECT, tag.name.clone(), Some(value_text(image, tag, *amount)))
        }
        CommandKind::HandOver => (HAND_OVER, def.name.clone(), None),
        CommandKind::TakeOver => (TAKE_OVER, def.name.clone(), None),
    };
    let kind = &status.command.kind;
    let old = status.old.zip(kind.written()).map(|(old, (tag, _))| value_text(image, def.tag(tag), old));
    let seen =
        if let CommandKind::WriteText { seen, .. } = kind { seen.as_ref().map(ToString::to_string) } else { None };
    ActionRecord {
        at: status.at,
        by: status.by.clone(),
        from: status.from.clone(),
        action: action.into(),
        target: target.into(),
        old: old.or(seen).map(Into::into),
        new: new.map(Into::into),
        outcome: status.outcome_text().into(),
        note: status.command.note.clone(),
        chain_hash: None,
    }
}

/// Action, target and new state of an action on alarms.
pub fn alarm_action(def: &PlantDef, alarm_command: &AlarmCommand) -> (&'static str, String, Option<String>) {
    let name = |alarm: &AlarmId| match def.alarms.get(alarm.index()) {
        Some(alarm) => format!("{} {}", subject_name(def, alarm.subject), alarm.message),
        None => format!("alarm {}", alarm.0),
    };
    let names = |alarms: &[AlarmId]| match alarms {
        [one] => name(one),
        several => format!("{} alarms", several.len()),
    };
    match alarm_command {
        AlarmCommand::Acknowledge { alarm, .. } => ("acknowledge", name(alarm), None),
        AlarmCommand::AcknowledgeAll { alarms: None, .. } => ("acknowledge", "all alarms".into(), None),
        AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. } => ("acknowledge", names(alarms), None),
        AlarmCommand::Silence => ("silence", "alarms".into(), None),
        AlarmCommand::Reset(alarm) => ("reset", name(alarm), None),
        AlarmCommand::Shelve { alarms, lasts } => {
            ("shelve", names(alarms), Some(format!("for {} min", lasts.as_secs().div_ceil(60))))
        }
        AlarmCommand::Unshelve(alarm) => ("unshelve", name(alarm), None),
        AlarmCommand::OutOfService(alarm) => ("out of service", name(alarm), None),
        AlarmCommand::InService(alarm) => ("in service", name(alarm), None),
        AlarmCommand::Tick { alarm, step, done, .. } => {
            let guidance = def.alarms.get(alarm.index()).map(|alarm| &alarm.guidance);
            let step = guidance.and_then(|guidance| guidance.steps().nth(usize::from(*step)));
            (if *done { "step done" } else { "step undone" }, name(alarm), step.map(str::to_owned))
        }
    }
}

/// A value as text with label or unit.
pub fn value_text(image: &ProcessImage, tag: &TagDef, value: impl Into<Exact>) -> String {
    let value = value.into();
    match tag.label_of(value) {
        Some(label) => label.to_owned(),
        None => {
            let unit = tag.unit_now(|tag| image.sample(tag));
            format!("{} {unit}", digits(value, Some(image.shown_decimals(tag)))).trim_end().to_owned()
        }
    }
}
