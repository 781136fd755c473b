//! Each command, and who may give it.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use sightglass::api::plant::{
    AlarmCommand, AlarmId, CommandKind, DeviceId, Diagnostic, LineId, OutputSignal, PlantDef, ProcedureId,
    RestoreRequest, Scan, Serial, SignalTest, Sweep, Table, parameter_set::ParameterSet,
};

use super::{Row, look, row};

/// What a Technician may write, and what only a Supervisor may: tuning, control method, alarm limits, programs, saving.
const OPERATED: [&str; 3] = ["TIC-1.SV", "TIC-1.PROG", "PLC-1.AUTO"];
const SET_UP: [&str; 9] = ["P", "I", "D", "CTRL", "AT", "SV-H", "SV-1", "MOD", "FIX"];

/// A new command does not compile until it has a row here; put it into [`commands`] as well.
pub fn of_command(def: &PlantDef, kind: &CommandKind) -> Row {
    match kind {
        CommandKind::Write { tag, .. } if OPERATED.contains(&&*def.tag(*tag).name) => row("write", "--TS--"),
        CommandKind::Write { .. } => row("write", "---S--"),
        CommandKind::WriteText { tag, .. } if OPERATED.contains(&&*def.tag(*tag).name) => row("write", "--TS--"),
        CommandKind::WriteText { .. } => row("write", "---S--"),
        CommandKind::Alarm(AlarmCommand::Acknowledge { .. }) => row("acknowledge", "--TS--"),
        CommandKind::Alarm(AlarmCommand::AcknowledgeAll { .. }) => row("acknowledge", "--TS--"),
        CommandKind::Alarm(AlarmCommand::Silence) => row("silence", "--TS--"),
        CommandKind::Alarm(AlarmCommand::Reset(_)) => row("reset", "--TS--"),
        CommandKind::Alarm(AlarmCommand::Shelve { .. }) => row("shelve", "--TS--"),
        CommandKind::Alarm(AlarmCommand::Unshelve(_)) => row("unshelve", "--TS--"),
        CommandKind::Alarm(AlarmCommand::Tick { .. }) => row("step done", "--TS--"),
        CommandKind::Alarm(AlarmCommand::OutOfService(_)) => row("out of service", "---S--"),
        CommandKind::Alarm(AlarmCommand::InService(_)) => row("in service", "---S--"),
        CommandKind::Refresh(_) => look("refresh", "--TS--"),
        CommandKind::Connect(_, false) => row("disconnect", "--TS--"),
        CommandKind::Connect(_, true) => row("connect", "--TS--"),
        CommandKind::Configure(_) => row("configure", "---S--"),
        CommandKind::SaveSettings(_) => row("save settings", "---S--"),
        CommandKind::CorrectCounter { .. } => row("correct counter", "---S--"),
        CommandKind::Test(_, diagnostic) => match diagnostic {
            Diagnostic::Scan(Scan { serials, .. }) if serials.is_empty() => row("test", "--TS--"),
            Diagnostic::Send(_)
            | Diagnostic::Write(_)
            | Diagnostic::Scan(_)
            | Diagnostic::Signal(_)
            | Diagnostic::Pattern { .. } => row("test", "---S--"),
            Diagnostic::Sweep(_)
            | Diagnostic::Loopback { .. }
            | Diagnostic::Identify { .. }
            | Diagnostic::Read { .. } => row("test", "--TS--"),
        },
        CommandKind::StopTest(_) => row("stop test", "--TS--"),
        CommandKind::ReadSets => look("read sets", "--TS--"),
        CommandKind::SaveSet { .. } => row("save set", "--TS--"),
        CommandKind::Restore(_) => row("restore set", "--TS--"),
        CommandKind::StopRestore(_) => row("stop restore", "--TS--"),
        // The shipped ones tune the controller, which is for a Supervisor.
        CommandKind::StartProcedure(_) => row("start procedure", "---S--"),
        CommandKind::AbortProcedure(_) => row("abort procedure", "--TS--"),
        CommandKind::HandOver => row("hand over", "--TS--"),
        CommandKind::TakeOver => row("take over", "--TS--"),
    }
}

/// Each command once, and writes to what is operated and what is set up.
pub fn commands(def: &PlantDef, person: usize) -> Vec<CommandKind> {
    let (alarm, device, line, at) = (AlarmId(0), DeviceId(0), LineId(0), Timestamp::UNIX_EPOCH);
    let scan = |serials| Diagnostic::Scan(Scan { first: 40, last: 40, serials, timeout: Duration::from_millis(50) });
    let set = ParameterSet {
        name: "none".into(),
        device: "another".into(),
        profile: "another".into(),
        saved: at,
        by: "tom".into(),
        given: Vec::new(),
        values: Vec::new(),
        missing: Vec::new(),
        units: Default::default(),
    };
    let (from, changes, table) = ("none".into(), Vec::new(), Table::Holding);
    let tag = |name: &str| def.tag_named(name).unwrap_or_else(|| panic!("no tag {name}"));
    let settings = SET_UP.map(|name| CommandKind::Write { tag: tag(&format!("TIC-1.{name}")), value: 1.0.into() });
    let operated = OPERATED[1..].iter().map(|name| CommandKind::Write { tag: tag(name), value: 0.0.into() });
    let mut commands = vec![CommandKind::Write { tag: tag(OPERATED[0]), value: (60.0 + person as f64).into() }];
    commands.extend(operated.chain(settings));
    let text = |name: &str| CommandKind::WriteText { tag: tag(name), text: "none".into(), seen: None };
    commands.extend([text(OPERATED[0]), text("TIC-1.P")]);
    commands.extend([
        CommandKind::Alarm(AlarmCommand::Acknowledge { alarm, annunciated_at: at }),
        CommandKind::Alarm(AlarmCommand::AcknowledgeAll { alarms: Some([alarm].into()), seen: u64::MAX }),
        CommandKind::Alarm(AlarmCommand::Silence),
        CommandKind::Alarm(AlarmCommand::Reset(alarm)),
        CommandKind::Alarm(AlarmCommand::Shelve { alarms: [alarm].into(), lasts: Duration::from_secs(60) }),
        CommandKind::Alarm(AlarmCommand::Unshelve(alarm)),
        CommandKind::Alarm(AlarmCommand::Tick { alarm, raised_at: at, step: 0, done: true }),
        CommandKind::Alarm(AlarmCommand::OutOfService(alarm)),
        CommandKind::Alarm(AlarmCommand::InService(alarm)),
        CommandKind::Refresh(device),
        CommandKind::CorrectCounter { tag: tag(OPERATED[0]), amount: 1.0.into() },
        CommandKind::HandOver,
        CommandKind::TakeOver,
        CommandKind::Test(line, Diagnostic::Loopback { unit: 1, data: 7, count: 1 }),
        CommandKind::Test(line, Diagnostic::Pattern { bits: 8, count: 1 }),
        CommandKind::Test(line, Diagnostic::Signal(SignalTest { signal: OutputSignal::Rts, on: true, seconds: 1 })),
        CommandKind::Test(line, Diagnostic::Identify { unit: 1 }),
        CommandKind::Test(line, Diagnostic::Sweep(Sweep { unit: 1, table, first: 0, last: 9, every: 8 })),
        CommandKind::Test(line, Diagnostic::Read { unit: 1, table: Table::Holding, address: 0, count: 1 }),
        CommandKind::Test(line, scan(Vec::new())),
        CommandKind::Test(line, scan(vec![Serial::USUAL])),
        CommandKind::Test(line, Diagnostic::Send(vec![1, 3, 0, 0, 0, 1])),
        CommandKind::StopTest(line),
        CommandKind::ReadSets,
        CommandKind::SaveSet { device, name: format!("of {person}").into(), replace: false },
        CommandKind::Restore(Box::new(RestoreRequest { device, from, set: Arc::new(set), changes })),
        CommandKind::StopRestore(device),
        CommandKind::StartProcedure(ProcedureId(0)),
        CommandKind::AbortProcedure(ProcedureId(0)),
        CommandKind::Connect(line, false),
        CommandKind::Connect(line, true),
        CommandKind::Configure(Box::new(def.lines[0].clone())),
        CommandKind::SaveSettings(line),
    ]);
    commands
}
