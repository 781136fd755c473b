//! Removes from a snapshot what an anonymous terminal may not see: it keeps the station and its alarms.

use std::sync::Arc;

use crate::plant::{
    Snapshot,
    interlock::ActuatorTracker,
    sample::{Cause, Sample},
    snapshot::{ActiveAlarm, DeviceStatus, LineStatus},
};

/// Alarms, clock, trouble of the history, and which lines and devices are reached; no value of the process, no text, no
/// bytes, no command. What is left out is absent, not hidden: it does not leave the station.
pub fn redact(snapshot: &Snapshot) -> Snapshot {
    let Snapshot {
        at,
        run,
        stepped,
        def,
        decimals,
        lines,
        devices,
        alarms,
        suppressed,
        sound,
        alarm_metrics,
        history,
        station,
        speed,
        ..
    } = snapshot;
    let reached = |line: &LineStatus| LineStatus {
        state: line.state.clone(),
        since: line.since,
        lost_since: line.lost_since,
        ..LineStatus::default()
    };
    let answering = |device: &DeviceStatus| DeviceStatus {
        state: device.state,
        diagnosis: device.diagnosis,
        ..DeviceStatus::default()
    };
    Snapshot {
        at: *at,
        run: *run,
        stepped: *stepped,
        samples: vec![Sample::bad(Cause::NotAuthorised, *at); def.tags.len()],
        texts: Arc::new(vec![None; def.tags.len()]),
        decimals: decimals.clone(),
        source_frames: Arc::new(vec![None; def.tags.len()]),
        lines: lines.iter().map(reached).collect(),
        devices: devices.iter().map(answering).collect(),
        alarms: Arc::new(alarms.iter().map(|alarm| ActiveAlarm { value: None, ..alarm.clone() }).collect()),
        suppressed: suppressed.clone(),
        sound: *sound,
        alarm_metrics: alarm_metrics.clone(),
        commands: Vec::new(),
        watch: ActuatorTracker::default(),
        history: history.clone(),
        station: station.clone(),
        sets: Arc::default(),
        restores: Vec::new(),
        tunings: vec![None; def.devices.len()],
        programs: vec![None; def.devices.len()],
        speed: *speed,
        def: def.clone(),
    }
}
