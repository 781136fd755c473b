//! A small but complete tank plant for tests of the screens, in three moods: normal, alarm, line down.

pub mod controllers;
mod plant;
mod traffic;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use jiff::{SignedDuration, Timestamp};

pub use traffic::more_frames;

use super::{QueryNumbers, ViewContext, preferences::Preferences, theme::Theme};
use crate::plant::{
    alarm::{ActiveAlarm, AlarmMetrics, AlarmState, SuppressedAlarm},
    control_run::ControlRun,
    def::*,
    fault::Fault,
    identity::Identities,
    line_state::{DeviceState, LineCounters, LineState},
    parameter_set::StoredSet,
    procedure::ProcedureRun,
    process_load::ProcessLoad,
    restore::Restore,
    sample::{Cause, Sample},
    snapshot::{DeviceStatus, HistoryStatus, LineStatus, Snapshot},
    station_fault::StationFault,
    tag::*,
    traffic::Exchange,
    tuning::Tuning,
};

/// The instant of every fixture: 2026-11-21 14:02:31 in Bangkok.
pub fn now() -> Timestamp {
    "2026-11-21T07:02:31Z".parse().expect("a valid instant")
}

/// A plant and its state, to be changed by a test before it becomes a snapshot.
#[derive(Debug, Clone)]
pub struct Fixture {
    pub def: PlantDef,
    pub samples: Vec<Sample>,
    pub alarms: Vec<ActiveAlarm>,
    pub suppressed: Vec<SuppressedAlarm>,
    /// The figures of the alarm system.
    pub alarm_metrics: AlarmMetrics,
    pub line: LineStatus,
    pub devices: Vec<DeviceStatus>,
    /// The last request for each tag.
    pub source_frames: Vec<Option<Arc<Exchange>>>,
    pub identities: Identities,
    /// Sets in the station's folder.
    pub sets: Vec<StoredSet>,
    /// Details of faults of the station.
    pub station: BTreeMap<StationFault, Arc<str>>,
    /// Restores, one a device.
    pub restores: Vec<Restore>,
    /// Auto-tunings, by device.
    pub tunings: Vec<Option<Tuning>>,
    /// Control runs, by place in [`PlantDef::runs`].
    pub runs: Vec<Option<Arc<ControlRun>>>,
    /// Procedures, by place in [`PlantDef::procedures`].
    pub procedures: Vec<Option<Arc<ProcedureRun>>>,
    /// How long every program has been where it is.
    pub into: Option<(Duration, bool)>,
}

impl Fixture {
    /// Heating at step HEAT, everything good, no alarm.
    pub fn normal() -> Fixture {
        let def = plant::plant();
        let at = now() - SignedDuration::from_millis(400);
        let samples = def.tags.iter().map(|tag| Sample::good(start(&tag.name), at)).collect();
        let counters = LineCounters {
            requests: 812,
            ok: 812,
            utilisation: 0.62,
            last_tx: Some(at),
            last_rx: Some(at),
            ..LineCounters::default()
        };
        let responding = DeviceStatus {
            state: DeviceState::Responding,
            response_time: Some(Duration::from_millis(12)),
            ok: 406,
            ..DeviceStatus::default()
        };
        let devices = vec![responding; def.devices.len()];
        Fixture {
            source_frames: vec![None; def.tags.len()],
            identities: Identities::default(),
            sets: Vec::new(),
            station: BTreeMap::new(),
            restores: Vec::new(),
            tunings: vec![None; def.devices.len()],
            runs: vec![None; def.runs.len()],
            procedures: vec![None; def.procedures.len()],
            into: None,
            def,
            samples,
            alarms: Vec::new(),
            suppressed: Vec::new(),
            alarm_metrics: AlarmMetrics::default(),
            line: LineStatus { state: LineState::Connected, counters, ..LineStatus::default() },
            devices,
        }
    }

    /// PV above its limit and unacknowledged, a late PLC acknowledged, a low level returned.
    pub fn alarm() -> Fixture {
        let mut plant = Fixture::normal();
        plant.set("TIC-1.PV", 72.4);
        let ago = |seconds| now() - SignedDuration::from_secs(seconds);
        plant.alarms = vec![
            ActiveAlarm {
                value: Some(72.1.into()),
                ..ActiveAlarm::new(AlarmId(0), AlarmState::Unacknowledged, ago(41))
            },
            ActiveAlarm::new(AlarmId(3), AlarmState::Acknowledged, ago(269)),
            ActiveAlarm {
                returned_at: Some(ago(2_400)),
                value: Some(3.9.into()),
                ..ActiveAlarm::new(AlarmId(2), AlarmState::ReturnedToNormal, ago(2_540))
            },
        ];
        plant
    }

    /// The port has gone: the controller's values are old, the PLC's are gone.
    pub fn line_down() -> Fixture {
        let mut plant = Fixture::normal();
        let retry_at = now() + SignedDuration::from_secs(4);
        plant.line.state = LineState::Waiting { why: "No such file or directory".into(), retry_at };
        let at = now() - SignedDuration::from_secs(12);
        for (tag, sample) in plant.def.tags.iter().zip(&mut plant.samples) {
            sample.at = at;
            *sample = if tag.device == DeviceId(0) {
                sample.uncertain(Cause::NotConnected)
            } else {
                Sample::bad(Cause::NotConnected, at)
            };
        }
        for device in &mut plant.devices {
            device.state = DeviceState::Down { since: at };
            device.last_fault = Some((at, Fault::NotConnected));
        }
        plant.alarms = vec![ActiveAlarm::new(AlarmId(3), AlarmState::Unacknowledged, at)];
        plant
    }

    /// The line has reported: plan, statistics, frames, all well.
    pub fn traffic() -> Fixture {
        let mut plant = Fixture::normal();
        traffic::good(&mut plant);
        plant
    }

    /// Replies near the timeout, CRC errors, a refused block, and the PLC gone.
    pub fn traffic_trouble() -> Fixture {
        let mut plant = Fixture::traffic();
        traffic::trouble(&mut plant);
        plant
    }

    /// The same line, polled by another master: only heard.
    pub fn listening() -> Fixture {
        let mut plant = Fixture::traffic();
        traffic::heard(&mut plant);
        plant
    }

    pub fn tag(&self, name: &str) -> TagId {
        self.def.tag_named(name).unwrap_or_else(|| panic!("the fixture has no tag {name}"))
    }
    /// Gives a tag a good value.
    pub fn set(&mut self, name: &str, value: f64) {
        let tag = self.tag(name);
        self.samples[tag.index()] = Sample::good(value, now() - SignedDuration::from_millis(400));
    }
    pub fn snapshot(&self) -> Arc<Snapshot> {
        let decimals = self.def.tags.iter().map(|tag| match tag.decimals {
            Decimals::Fixed(n) => n,
            Decimals::From(_) | Decimals::PowerFrom(_) => 1,
        });
        Arc::new(Snapshot {
            actuators: crate::plant::interlock::ActuatorTracker::default(),
            texts: Arc::new(vec![None; self.def.tags.len()]),
            identities: self.identities.clone(),
            source_frames: Arc::new(self.source_frames.clone()),
            at: now(),
            run: 7,
            stepped: SignedDuration::ZERO,
            samples: self.samples.clone(),
            decimals: decimals.collect(),
            lines: vec![self.line.clone()],
            devices: self.devices.clone(),
            alarms: Arc::new(self.alarms.clone()),
            suppressed: Arc::new(self.suppressed.clone()),
            sound: self.alarms.iter().any(|alarm| alarm.state == AlarmState::Unacknowledged),
            annunciations: self.alarms.len() as u64,
            alarm_metrics: self.alarm_metrics.clone(),
            commands: Vec::new(),
            sets: Arc::new(self.sets.clone()),
            restores: self.restores.iter().cloned().map(Arc::new).collect(),
            tunings: self.tunings.iter().cloned().map(|tuning| tuning.map(Arc::new)).collect(),
            programs: vec![self.into; self.def.devices.len()],
            runs: self.runs.clone(),
            procedures: self.procedures.clone(),
            history: HistoryStatus { rows: 5_000, committed_at: Some(now()), ..HistoryStatus::default() },
            station: Arc::new(self.station.clone()),
            north: None,
            load: Some(ProcessLoad { cpu: 0.021, wake_ups: 140.0, idle: 0.96, memory: 86_000_000 }),
            speed: 1.0,
            def: Arc::new(self.def.clone()),
        })
    }
}

/// Calls with a context over this snapshot, at 80x24 in full looks.
pub fn with_cx<T>(snapshot: &Snapshot, call: impl FnOnce(&ViewContext) -> T) -> T {
    let area = ratatui::layout::Rect::new(0, 4, 80, 18);
    call(&ViewContext {
        snapshot,
        theme: &Theme::FULL,
        preferences: &Preferences::default(),
        now: snapshot.at,
        present: None,
        phase: 0,
        area,
        size: super::layout::Size::Normal,
        extension: None,
        session: &session(),
        numbers: &QueryNumbers::default(),
    })
}

fn start(tag: &str) -> f64 {
    match tag {
        "TIC-1.PV" => 64.2,
        "TIC-1.SV" => 70.0,
        "TIC-1.MV" => 42.0,
        "TIC-1.P" => 5.0,
        "TIC-1.I" => 240.0,
        "TIC-1.D" => 60.0,
        "PLC-1.LT-1" => 22.1,
        "PLC-1.TK-2" => 4.6,
        "PLC-1.TK-3" => 3.2,
        "PLC-1.FLOW" => 0.8,
        "PLC-1.POWER" => 672.0,
        "PLC-1.STEP" => 2.0,
        "PLC-1.LEFT" => 192.0,
        "PLC-1.M-1" | "PLC-1.SV-1" | "PLC-1.RUN" | "PLC-1.AUTO" => 1.0,
        _ => 0.0,
    }
}

/// `tech1`, who may do everything.
pub fn session() -> Arc<crate::access::SessionStatus> {
    use crate::{
        access::{LoggedInUser, SessionStatus},
        plant::role::Role,
    };
    let who = LoggedInUser { user: "tech1".into(), role: Role::Supervisor, must_change: false };
    Arc::new(SessionStatus { who: Some(who), may_view: true, password_chars_min: 15, ..SessionStatus::default() })
}
