//! Removes from a snapshot what an anonymous terminal may not see: it keeps the station and its alarms.

use std::sync::Arc;

use crate::plant::{
    Snapshot,
    alarm::ActiveAlarm,
    sample::{Cause, Sample},
    snapshot::{DeviceStatus, LineStatus},
};

/// Alarms, clock, trouble of the history, and which lines and devices are reached; no value of the process, no text, no
/// bytes, no command. What is left out is absent, not hidden: it does not leave the station.
pub fn redact(snapshot: &Snapshot) -> Snapshot {
    let reached = |line: &LineStatus| LineStatus {
        state: line.state.clone(),
        since: line.since,
        lost_since: line.lost_since,
        ..LineStatus::default()
    };
    let responding = |device: &DeviceStatus| DeviceStatus {
        state: device.state,
        diagnosis: device.diagnosis,
        ..DeviceStatus::default()
    };
    let blank = Snapshot::blank(snapshot.def.clone());
    Snapshot {
        at: snapshot.at,
        run: snapshot.run,
        stepped: snapshot.stepped,
        samples: vec![Sample::bad(Cause::NotAuthorised, snapshot.at); blank.samples.len()],
        decimals: snapshot.decimals.clone(),
        lines: snapshot.lines.iter().map(reached).collect(),
        devices: snapshot.devices.iter().map(responding).collect(),
        alarms: Arc::new(snapshot.alarms.iter().map(|alarm| ActiveAlarm { value: None, ..alarm.clone() }).collect()),
        suppressed: snapshot.suppressed.clone(),
        sound: snapshot.sound,
        annunciations: snapshot.annunciations,
        alarm_metrics: snapshot.alarm_metrics.clone(),
        history: snapshot.history.clone(),
        station: snapshot.station.clone(),
        speed: snapshot.speed,
        // Whatever a snapshot will hold some day stays in the station until it is named above.
        ..blank
    }
}
