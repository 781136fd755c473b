//! One log line for each change between two snapshots, for a station without a terminal.

use std::{collections::HashMap, sync::Arc};

use crate::plant::{
    Snapshot,
    alarm::{AlarmState, manager::subject_name},
    def::AlarmId,
    line_state::{DeviceState, LineState},
    snapshot::HistoryStatus,
};

/// One line a change: lines, devices, alarms, commands, troubles of the store. Without time stamps.
pub fn changes(before: &Snapshot, after: &Snapshot) -> Vec<String> {
    let mut lines = Vec::new();
    lines.extend(line_changes(before, after));
    lines.extend(device_changes(before, after));
    lines.extend(alarm_changes(before, after));
    lines.extend(command_changes(before, after));
    if before.history.trouble != after.history.trouble {
        lines.push(match &after.history.trouble {
            Some(trouble) => format!("history: {trouble}"),
            None => "history: recovered".into(),
        });
    }
    if before.history.lost != after.history.lost {
        lines.push(format!("history: {} records lost so far", after.history.lost));
    }
    lines
}

/// What is wrong with the history in the first snapshot that the log sees: the plant may have been faster than the log.
pub fn first(snapshot: &Snapshot) -> Vec<String> {
    let history = HistoryStatus { trouble: None, lost: 0, ..snapshot.history.clone() };
    changes(&Snapshot { history, ..snapshot.clone() }, snapshot)
}

fn line_changes(before: &Snapshot, after: &Snapshot) -> Vec<String> {
    let changed = |index: usize| {
        let (old, new) = (&before.lines[index].state, &after.lines[index].state);
        let words = match new {
            LineState::Connecting => return None,
            LineState::Connected if after.def.lines[index].listens => "listening".into(),
            LineState::Connected => "connected".into(),
            LineState::NoTraffic => "no traffic heard".into(),
            LineState::Disconnected => "disconnected by an operator".into(),
            LineState::Testing => "not polled: used by a test".into(),
            // Every failed try would be a line; the first says it all.
            LineState::Waiting { .. } if before.lines[index].lost_since.is_some() => return None,
            LineState::Waiting { why, .. } => format!("not connected: {why}"),
        };
        (old != new).then(|| format!("line {}: {words}", after.def.lines[index].name))
    };
    (0..after.lines.len()).filter_map(changed).collect()
}

fn device_changes(before: &Snapshot, after: &Snapshot) -> Vec<String> {
    let mut lines = Vec::new();
    for device in &after.def.devices {
        let (old, new) = (before.device(device.id).state, after.device(device.id).state);
        let was_down = matches!(old, DeviceState::Down { .. } | DeviceState::Unknown);
        match new {
            // A lost line has been logged; its devices go with it.
            DeviceState::Down { .. } if after.line(device.line).state != LineState::Connected => {}
            DeviceState::Down { .. } if !matches!(old, DeviceState::Down { .. }) => {
                let why = after.device(device.id).last_fault.map(|(_, fault)| format!(": {fault}")).unwrap_or_default();
                lines.push(format!("device {} (unit {}): not responding{why}", device.name, device.unit));
            }
            DeviceState::Responding if was_down => {
                lines.push(format!("device {} (unit {}): responding", device.name, device.unit));
            }
            DeviceState::Down { .. } | DeviceState::Responding | DeviceState::Failing(_) | DeviceState::Unknown => {}
        }
    }
    lines
}

fn alarm_changes(before: &Snapshot, after: &Snapshot) -> Vec<String> {
    if Arc::ptr_eq(&before.alarms, &after.alarms) && Arc::ptr_eq(&before.suppressed, &after.suppressed) {
        return Vec::new();
    }
    let (before, states) = (states_in(before), states_in(after));
    let mut lines = Vec::new();
    for alarm in &after.def.alarms {
        let state = |states: &HashMap<AlarmId, AlarmState>| states.get(&alarm.id).copied().unwrap_or_default();
        let (old, new) = (state(&before), state(&states));
        if old == new {
            continue;
        }
        let subject = subject_name(&after.def, alarm.subject);
        let word = alarm_word(old, new);
        lines.push(format!("alarm {} {word}: {subject} {}", alarm.priority.number(), alarm.message));
    }
    lines
}

fn states_in(snapshot: &Snapshot) -> HashMap<AlarmId, AlarmState> {
    let active = snapshot.alarms.iter().map(|alarm| (alarm.id, alarm.state));
    active.chain(snapshot.suppressed.iter().map(|alarm| (alarm.id, alarm.state))).collect()
}

/// What has happened to an alarm between two states.
fn alarm_word(old: AlarmState, new: AlarmState) -> &'static str {
    match new {
        AlarmState::Unacknowledged => "RAISED",
        AlarmState::Acknowledged => "acknowledged",
        AlarmState::LatchedAcknowledged
            if matches!(old, AlarmState::LatchedUnacknowledged | AlarmState::ReturnedToNormal) =>
        {
            "acknowledged"
        }
        AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged => "returned to normal, reset required",
        AlarmState::Shelved => "shelved",
        AlarmState::SuppressedByDesign => "suppressed by design",
        AlarmState::OutOfService => "out of service",
        AlarmState::Normal | AlarmState::ReturnedToNormal => match old {
            AlarmState::ReturnedToNormal => "acknowledged",
            AlarmState::LatchedUnacknowledged | AlarmState::LatchedAcknowledged => "reset",
            AlarmState::Shelved | AlarmState::SuppressedByDesign | AlarmState::OutOfService
                if new == AlarmState::Normal =>
            {
                "no longer suppressed"
            }
            AlarmState::Normal
            | AlarmState::Unacknowledged
            | AlarmState::Acknowledged
            | AlarmState::Shelved
            | AlarmState::SuppressedByDesign
            | AlarmState::OutOfService => "returned to normal",
        },
    }
}

fn command_changes(before: &Snapshot, after: &Snapshot) -> Vec<String> {
    use crate::plant::command::CommandStatus;
    let news = after.commands.iter().rev().filter(|status| {
        let same = |old: &&CommandStatus| old.command.id == status.command.id;
        !status.is_pending() && before.commands.iter().find(same).is_none_or(|old| old.outcome != status.outcome)
    });
    news.filter_map(|status| {
        let (tag, value) = after.written(&status.command.kind)?;
        Some(format!("{}: {} := {value} {}", status.by, after.def.tag(tag).name, status.outcome))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use jiff::Timestamp;

    use super::*;
    use crate::plant::{
        Plant,
        def::LineId,
        event::Event,
        fault::Fault,
        fixture::{self, PV, TIC},
    };

    #[test]
    fn what_is_wrong_from_the_start_is_logged() {
        let at = Timestamp::UNIX_EPOCH;
        let mut plant = Plant::new(fixture::shared(), at, 1.0);
        assert_eq!(first(&plant.snapshot()), [""; 0]);
        let trouble = Some("audit log: the sealing key is missing".into());
        plant.on_history(HistoryStatus { trouble, ..HistoryStatus::default() });
        assert_eq!(first(&plant.snapshot()), ["history: audit log: the sealing key is missing"]);
    }

    #[test]
    fn each_change_is_logged_once() {
        let at = |second| Timestamp::from_second(second).expect("a small number");
        let mut plant = Plant::new(fixture::shared(), at(0), 1.0);
        let mut before = plant.snapshot();
        let mut log = |plant: &Plant| {
            let after = plant.snapshot();
            let lines = changes(&before, &after);
            before = after;
            lines
        };
        plant.on_event(Event::Line { at: at(0), line: LineId(0), state: LineState::Connected });
        assert_eq!(log(&plant), ["line L1: connected"]);
        assert!(log(&plant).is_empty());
        plant.on_event(Event::Failed { at: at(1), device: TIC, tags: vec![PV], fault: Fault::Timeout, exchange: None });
        plant.on_event(Event::Failed {
            at: at(3),
            device: TIC,
            tags: vec![PV],
            fault: Fault::BackedOff,
            exchange: None,
        });
        assert_eq!(
            log(&plant),
            ["device TIC-1 (unit 1): not responding: response timeout", "alarm 2 RAISED: TIC-1 alarm 1"]
        );
        for (second, why) in [(4, "gone"), (6, "still gone")] {
            let state = LineState::Waiting { why: why.into(), retry_at: at(second + 1) };
            plant.on_event(Event::Line { at: at(second), line: LineId(0), state });
        }
        assert_eq!(log(&plant), ["line L1: not connected: still gone"]);
    }
}
