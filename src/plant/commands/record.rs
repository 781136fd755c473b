//! The audit record of a command.

use crate::plant::{
    alarm::{AlarmCommand, manager::subject_name},
    command::{CommandKind, CommandStatus},
    def::{AlarmId, PlantDef},
    exact::{Exact, digits},
    process_image::ProcessImage,
    record::ActionRecord,
    recorded_action::RecordedAction,
    tag::TagDef,
};

pub(super) fn record(def: &PlantDef, status: &CommandStatus, image: &ProcessImage) -> ActionRecord {
    let (action, target, new): (RecordedAction, String, Option<String>) = match &status.command.kind {
        CommandKind::Write { tag, value } => {
            let tag = def.tag(*tag);
            (RecordedAction::Write, tag.name.clone(), Some(value_text(image, tag, *value)))
        }
        CommandKind::WriteText { tag, text, .. } => {
            (RecordedAction::Write, def.tag(*tag).name.clone(), Some(text.to_string()))
        }
        CommandKind::Alarm(alarm_command) => alarm_action(def, alarm_command),
        CommandKind::Refresh(device) => (RecordedAction::Refresh, def.device(*device).name.clone(), None),
        CommandKind::Connect(line, true) => (RecordedAction::Connect, def.line(*line).name.clone(), None),
        CommandKind::Connect(line, false) => (RecordedAction::Disconnect, def.line(*line).name.clone(), None),
        CommandKind::Configure(settings) => {
            (RecordedAction::Configure, settings.name.clone(), Some(settings.transport.to_string()))
        }
        CommandKind::SaveSettings(line) => (RecordedAction::SaveSettings, def.line(*line).name.clone(), None),
        CommandKind::Test(line, diagnostic) => {
            (RecordedAction::Test, def.line(*line).name.clone(), Some(diagnostic.to_string()))
        }
        CommandKind::StopTest(line) => (RecordedAction::StopTest, def.line(*line).name.clone(), None),
        CommandKind::ReadSets => (RecordedAction::ReadSets, "parameter sets".into(), None),
        CommandKind::SaveSet { device, name, .. } => {
            (RecordedAction::SaveSet, def.device(*device).name.clone(), Some(name.to_string()))
        }
        CommandKind::Restore(request) => {
            let new = format!("{}: {} changes", request.from, request.changes.len());
            (RecordedAction::RestoreSet, def.device(request.device).name.clone(), Some(new))
        }
        CommandKind::StopRestore(device) => (RecordedAction::StopRestore, def.device(*device).name.clone(), None),
        CommandKind::StartProcedure(id) => (RecordedAction::StartProcedure, def.procedure(*id).name.to_string(), None),
        CommandKind::AbortProcedure(id) => (RecordedAction::AbortProcedure, def.procedure(*id).name.to_string(), None),
        CommandKind::CorrectCounter { tag, amount } => {
            let tag = def.tag(*tag);
            // With all of its digits: it is counted as it stands here.
            let unit = tag.unit_now(|tag| image.sample(tag));
            let new = format!("{} {unit}", digits(*amount, None)).trim_end().to_owned();
            (RecordedAction::CorrectCounter, tag.name.clone(), Some(new))
        }
        CommandKind::HandOver => (RecordedAction::HandOver, def.name.clone(), None),
        CommandKind::TakeOver => (RecordedAction::TakeOver, def.name.clone(), None),
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
pub fn alarm_action(def: &PlantDef, alarm_command: &AlarmCommand) -> (RecordedAction, String, Option<String>) {
    let name = |alarm: &AlarmId| match def.alarms.get(alarm.index()) {
        Some(alarm) => format!("{} {}", subject_name(def, alarm.subject), alarm.message),
        None => format!("alarm {}", alarm.0),
    };
    let names = |alarms: &[AlarmId]| match alarms {
        [one] => name(one),
        several => format!("{} alarms", several.len()),
    };
    match alarm_command {
        AlarmCommand::Acknowledge { alarm, .. } => (RecordedAction::Acknowledge, name(alarm), None),
        AlarmCommand::AcknowledgeAll { alarms: None, .. } => (RecordedAction::Acknowledge, "all alarms".into(), None),
        AlarmCommand::AcknowledgeAll { alarms: Some(alarms), .. } => (RecordedAction::Acknowledge, names(alarms), None),
        AlarmCommand::Silence => (RecordedAction::Silence, "alarms".into(), None),
        AlarmCommand::Reset(alarm) => (RecordedAction::Reset, name(alarm), None),
        AlarmCommand::Shelve { alarms, lasts } => {
            (RecordedAction::Shelve, names(alarms), Some(format!("for {} min", lasts.as_secs().div_ceil(60))))
        }
        AlarmCommand::Unshelve(alarm) => (RecordedAction::Unshelve, name(alarm), None),
        AlarmCommand::OutOfService(alarm) => (RecordedAction::OutOfService, name(alarm), None),
        AlarmCommand::InService(alarm) => (RecordedAction::InService, name(alarm), None),
        AlarmCommand::Tick { alarm, step, done, .. } => {
            let guidance = def.alarms.get(alarm.index()).map(|alarm| &alarm.guidance);
            let step = guidance.and_then(|guidance| guidance.steps().nth(usize::from(*step)));
            (
                if *done { RecordedAction::StepDone } else { RecordedAction::StepUndone },
                name(alarm),
                step.map(str::to_owned),
            )
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
