//! The plant at a past instant: what the history knows of it, as a snapshot like a live one.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    def::{DeviceDef, LineId, PlantDef},
    interlock::ActuatorTracker,
    line_minute::LineMinute,
    line_state::{DeviceState, LineCounters, LineState},
    line_trouble::LineTrouble,
    record::AlarmRecord,
    reducer::Plant,
    sample::{Cause, Quality, Sample},
    snapshot::{LineStatus, Snapshot},
};

/// What the history knows of an instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Past {
    /// The instant.
    pub at: Timestamp,
    /// What was in force, by tag.
    pub samples: Vec<Sample>,
    /// Of each alarm the last event of every kind until then, oldest first.
    pub events: Vec<AlarmRecord>,
    /// The minute of each line in which the instant lies; `None` where the line was not open.
    pub minutes: Vec<Option<LineMinute>>,
}

impl Past {
    /// As a terminal draws it. What is not stored is as in a plant of which nothing is known; counters are those of a minute.
    pub fn snapshot(&self, def: Arc<PlantDef>) -> Snapshot {
        let mut plant = Plant::new(def.clone(), self.at, 1.0);
        // Nothing is recorded of it.
        let _ = plant.restore(&self.events);
        plant.set_samples(&self.samples);
        let mut snapshot = plant.snapshot();
        let samples = &snapshot.samples;
        snapshot.actuators = ActuatorTracker::from_stored(&def.logic, |tag| samples[tag.index()]);
        for device in &def.devices {
            snapshot.devices[device.id.index()].state = self.device(&def, device);
        }
        for (line, status) in def.lines.iter().zip(&mut snapshot.lines) {
            let minute = self.minutes.get(line.id.index()).and_then(Option::as_ref);
            *status = LineStatus { state: self.line(&def, line.id), ..LineStatus::default() };
            if let Some(minute) = minute {
                let LineMinute { requests, ok, timeouts, corrupt, exceptions, .. } = *minute;
                status.counters = LineCounters { requests, ok, timeouts, corrupt, exceptions, ..status.counters };
            }
        }
        snapshot
    }

    fn samples_of<'a>(&'a self, def: &'a PlantDef, device: &'a DeviceDef) -> impl Iterator<Item = Sample> + 'a {
        let own = def.tags_of(device.id).filter(|tag| tag.calculation.is_none() && tag.is_stored());
        own.filter_map(|tag| self.samples.get(tag.id.index()).copied())
    }

    /// By what its values say of it.
    fn device(&self, def: &PlantDef, device: &DeviceDef) -> DeviceState {
        let gone = |sample: &Sample| matches!(sample.quality, Quality::Bad(Cause::DeviceDown | Cause::NotConnected));
        let down = self.samples_of(def, device).filter(gone);
        if let Some(since) = down.map(|sample| sample.at).min() {
            return DeviceState::Down { since };
        }
        let answers = |sample: Sample| {
            matches!(
                sample.quality,
                Quality::Good | Quality::Bad(Cause::SensorFault | Cause::Exception | Cause::Unscaled)
            )
        };
        let fails =
            |sample: Sample| matches!(sample.quality.cause(), Some(Cause::Timeout | Cause::Corrupt | Cause::Stale));
        match (self.samples_of(def, device).any(fails), self.samples_of(def, device).any(answers)) {
            (true, _) => DeviceState::Failing(1),
            (false, true) => DeviceState::Responding,
            (false, false) => DeviceState::Unknown,
        }
    }

    /// By what its values say of it, and by whether it counted anything.
    fn line(&self, def: &PlantDef, line: LineId) -> LineState {
        let devices = def.devices.iter().filter(|device| device.line == line);
        let samples: Vec<Sample> = devices.flat_map(|device| self.samples_of(def, device)).collect();
        let counted = self.minutes.get(line.index()).is_some_and(Option::is_some);
        if samples.iter().any(|sample| sample.quality == Quality::Bad(Cause::NotConnected)) {
            LineState::Waiting { why: LineTrouble::NotConnected, retry_at: self.at }
        } else if counted || samples.iter().any(|sample| is_of_requests(sample.quality)) {
            LineState::Connected
        } else {
            LineState::Connecting
        }
    }
}

/// Whether the device was asked for a value of this quality.
fn is_of_requests(quality: Quality) -> bool {
    let unasked = [Cause::NotRead, Cause::NotConnected, Cause::StationOff, Cause::Reloaded, Cause::NotStored];
    quality != Quality::Bad(Cause::OnRequest)
        && quality.cause().is_none_or(|cause| cause != Cause::Unreadable && !unasked.contains(&cause))
}
