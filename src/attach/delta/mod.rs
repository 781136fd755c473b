//! What has changed from one snapshot to a later one: what travels to a terminal, four times a second at most.
//!
//! The first delta is from [`Snapshot::blank`], so there is no second kind of message.

mod line;
mod list;
mod readings;
#[cfg(test)]
mod tests;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};
use serde::{Deserialize, Serialize};

use crate::plant::{
    Snapshot,
    alarm::{AlarmMetrics, PeriodMetrics},
    command::CommandStatus,
    interlock::ActuatorTracker,
    number::to_u16,
    parameter_set::StoredSet,
    restore::Restore,
    snapshot::{ActiveAlarm, DeviceStatus, HistoryStatus, SuppressedAlarm},
    station::StationFault,
    tuning::Tuning,
};
use line::LineDelta;
use list::List;
use readings::{Readings, SourceFrame};

/// What has changed between two snapshots of one plant definition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Delta {
    at: Timestamp,
    run: Option<u64>,
    stepped: Option<SignedDuration>,
    samples: Vec<Readings>,
    texts: List<Option<Arc<str>>>,
    decimals: List<u8>,
    source_frames: Vec<SourceFrame>,
    /// Lines that have changed, by place.
    lines: Vec<(u16, LineDelta)>,
    devices: List<DeviceStatus>,
    alarms: List<ActiveAlarm>,
    suppressed: List<SuppressedAlarm>,
    sound: bool,
    rates: Option<AlarmRates>,
    /// The figures of the day: they change less often than the rates.
    day: Option<Arc<PeriodMetrics>>,
    commands: List<CommandStatus>,
    watch: Option<ActuatorTracker>,
    history: Option<HistoryStatus>,
    station: Option<Arc<BTreeMap<StationFault, Arc<str>>>>,
    sets: List<StoredSet>,
    restores: List<Arc<Restore>>,
    tunings: List<Option<Arc<Tuning>>>,
    programs: List<Option<(Duration, bool)>>,
    speed: Option<f64>,
}

/// How many alarms come: in 10 minutes, in an hour, and since when it is a flood.
type AlarmRates = (u32, u32, Option<Timestamp>);

/// A delta does not belong to the snapshot that it was applied to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("what came does not fit what was there before")]
pub struct DeltaMismatch;

impl Delta {
    /// What makes `new` of `old`, which has the same definition.
    pub fn between(old: &Snapshot, new: &Snapshot) -> Delta {
        // Destructured, so that a new field cannot be forgotten here.
        let Snapshot {
            at,
            run,
            stepped,
            def,
            samples,
            texts,
            decimals,
            source_frames,
            lines,
            devices,
            alarms,
            alarm_metrics,
            suppressed,
            sound,
            commands,
            watch,
            history,
            station,
            sets,
            restores,
            tunings,
            programs,
            speed,
        } = new;
        let lines = def.lines.iter().zip(old.lines.iter().zip(lines)).enumerate();
        let lines =
            lines.filter_map(|(place, (def, (old, new)))| Some((to_u16(place), LineDelta::between(def, old, new)?)));
        Delta {
            at: *at,
            run: (old.run != *run).then_some(*run),
            stepped: (old.stepped != *stepped).then_some(*stepped),
            samples: readings::between(&old.samples, samples),
            texts: shared(&old.texts, texts),
            decimals: List::between(&old.decimals, decimals),
            source_frames: readings::source_frames_between(&old.source_frames, source_frames),
            lines: lines.collect(),
            devices: List::between(&old.devices, devices),
            alarms: shared(&old.alarms, alarms),
            suppressed: shared(&old.suppressed, suppressed),
            sound: *sound,
            rates: (rates(&old.alarm_metrics) != rates(alarm_metrics)).then(|| rates(alarm_metrics)),
            day: (old.alarm_metrics.day != alarm_metrics.day).then(|| alarm_metrics.day.clone()),
            commands: List::between(&old.commands, commands),
            watch: (old.watch != *watch).then(|| watch.clone()),
            history: (old.history != *history).then(|| history.clone()),
            station: (old.station != *station).then(|| station.clone()),
            sets: shared(&old.sets, sets),
            restores: List::between(&old.restores, restores),
            tunings: List::between(&old.tunings, tunings),
            programs: List::between(&old.programs, programs),
            speed: (old.speed != *speed).then_some(*speed),
        }
    }

    /// Makes the old snapshot the new one. After an error the snapshot is good for nothing.
    pub fn apply(self, snapshot: &mut Snapshot) -> Result<(), DeltaMismatch> {
        snapshot.at = self.at;
        if let Some(run) = self.run {
            snapshot.run = run;
        }
        if let Some(stepped) = self.stepped {
            snapshot.stepped = stepped;
        }
        readings::apply(self.samples, &mut snapshot.samples)?;
        if let Some(texts) = self.texts.made_of(&snapshot.texts)? {
            snapshot.texts = Arc::new(texts);
        }
        self.decimals.apply(&mut snapshot.decimals)?;
        if !self.source_frames.is_empty() {
            let source_frames: &mut Vec<_> = Arc::make_mut(&mut snapshot.source_frames);
            readings::apply_source_frames(self.source_frames, source_frames)?;
        }
        for (place, delta) in self.lines {
            let place = usize::from(place);
            let line = snapshot.lines.get_mut(place).ok_or(DeltaMismatch)?;
            delta.apply(snapshot.def.lines.get(place).ok_or(DeltaMismatch)?, line)?;
        }
        self.devices.apply(&mut snapshot.devices)?;
        if let Some(alarms) = self.alarms.made_of(&snapshot.alarms)? {
            snapshot.alarms = Arc::new(alarms);
        }
        if let Some(suppressed) = self.suppressed.made_of(&snapshot.suppressed)? {
            snapshot.suppressed = Arc::new(suppressed);
        }
        snapshot.sound = self.sound;
        let quality = &mut snapshot.alarm_metrics;
        if let Some((last_10_min, last_hour, flood_since)) = self.rates {
            (quality.last_10_min, quality.last_hour, quality.flood_since) = (last_10_min, last_hour, flood_since);
        }
        if let Some(day) = self.day {
            quality.day = day;
        }
        self.commands.apply(&mut snapshot.commands)?;
        if let Some(watch) = self.watch {
            snapshot.watch = watch;
        }
        if let Some(history) = self.history {
            snapshot.history = history;
        }
        if let Some(station) = self.station {
            snapshot.station = station;
        }
        if let Some(sets) = self.sets.made_of(&snapshot.sets)? {
            snapshot.sets = Arc::new(sets);
        }
        self.restores.apply(&mut snapshot.restores)?;
        self.tunings.apply(&mut snapshot.tunings)?;
        self.programs.apply(&mut snapshot.programs)?;
        if let Some(speed) = self.speed {
            snapshot.speed = speed;
        }
        let def = &snapshot.def;
        let fits = snapshot.texts.len() == def.tags.len()
            && snapshot.decimals.len() == def.tags.len()
            && snapshot.devices.len() == def.devices.len();
        if fits { Ok(()) } else { Err(DeltaMismatch) }
    }
}

fn rates(quality: &AlarmMetrics) -> AlarmRates {
    let AlarmMetrics { last_10_min, last_hour, flood_since, day: _ } = quality;
    (*last_10_min, *last_hour, *flood_since)
}

/// As [`List::between`], at once where both are the same memory.
fn shared<T: Clone + PartialEq>(old: &Arc<Vec<T>>, new: &Arc<Vec<T>>) -> List<T> {
    if Arc::ptr_eq(old, new) { List::same() } else { List::between(old, new) }
}
