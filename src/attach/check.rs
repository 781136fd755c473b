//! Numbers that come from outside: whether they name things of this plant at all. Inside, ids are taken on trust.

use crate::{
    history::Question,
    plant::{
        PlantDef,
        alarm::AlarmCommand,
        command::Command,
        def::{AlarmId, DeviceId, LineId, TagId},
    },
};

/// Most columns of a curve: more than any screen has.
const BUCKETS_MAX: usize = 4_096;
/// Most curves of one question.
const SERIES_MAX: usize = 64;

/// `Err` says what a command names that this plant does not have.
pub fn command(def: &PlantDef, command: &Command) -> Result<(), String> {
    match command {
        Command::Write { tag: id, value: _ } => tag(def, *id),
        Command::Alarm(command) => of_alarms(def, command),
        Command::ReadSets | Command::HandOver | Command::TakeOver => Ok(()),
        Command::Refresh(id) | Command::StopRestore(id) | Command::SaveSet { device: id, .. } => device(def, *id),
        Command::Connect(id, _) | Command::SaveSettings(id) | Command::Test(id, _) | Command::StopTest(id) => {
            line(def, *id)
        }
        Command::Configure(settings) => line(def, settings.id),
        Command::Restore(wish) => {
            device(def, wish.device)?;
            wish.changes.iter().try_for_each(|change| tag(def, change.tag))
        }
    }
}

fn of_alarms(def: &PlantDef, command: &AlarmCommand) -> Result<(), String> {
    match command {
        AlarmCommand::AcknowledgeAll { seen } => {
            let (many, count) = (seen.len(), def.alarms.len());
            if count < many {
                return Err(format!("{many} alarms, this plant has {count}"));
            }
            seen.iter().try_for_each(|(id, _)| alarm(def, *id))
        }
        AlarmCommand::Silence => Ok(()),
        AlarmCommand::Acknowledge { alarm: id, .. }
        | AlarmCommand::Reset(id)
        | AlarmCommand::Shelve { alarm: id, .. }
        | AlarmCommand::Unshelve(id)
        | AlarmCommand::OutOfService(id)
        | AlarmCommand::InService(id) => alarm(def, *id),
    }
}

/// `Err` says what a question names that this plant does not have, or that it asks too much at once.
pub fn question(def: &PlantDef, question: &Question) -> Result<(), String> {
    match question {
        Question::Series { tags, buckets, .. } => {
            if *buckets == 0 || BUCKETS_MAX < *buckets {
                return Err(format!("{buckets} columns, expected 1 to {BUCKETS_MAX}"));
            }
            if SERIES_MAX < tags.len() {
                return Err(format!("{} curves, expected at most {SERIES_MAX}", tags.len()));
            }
            tags.iter().try_for_each(|id| tag(def, *id))
        }
        Question::LineMinutes { line: id, .. } => line(def, *id),
        Question::Journal { .. }
        | Question::Actions { .. }
        | Question::Audit { .. }
        | Question::Report { .. }
        | Question::AlarmQuality { .. } => Ok(()),
    }
}

fn tag(def: &PlantDef, TagId(id): TagId) -> Result<(), String> {
    known("tag", id, def.tags.len())
}

fn alarm(def: &PlantDef, AlarmId(id): AlarmId) -> Result<(), String> {
    known("alarm", id, def.alarms.len())
}

fn device(def: &PlantDef, DeviceId(id): DeviceId) -> Result<(), String> {
    known("device", id, def.devices.len())
}

fn line(def: &PlantDef, LineId(id): LineId) -> Result<(), String> {
    known("line", id, def.lines.len())
}

fn known(what: &str, id: u16, count: usize) -> Result<(), String> {
    if usize::from(id) < count {
        return Ok(());
    }
    Err(format!("{what} number {id}: this plant has {count}"))
}
