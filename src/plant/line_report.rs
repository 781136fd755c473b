//! What a line says of itself, about once a second: settings, counters, polls, frames.

use std::{sync::Arc, time::Duration};

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{
    admission::Admission,
    device_time::DeviceTime,
    id::{DeviceId, LineId, TagId},
    line::LineDef,
    line_finding::{LineFinding, OtherMasterHeard},
    line_state::LineCounters,
    redefinition::Renamed,
    request_stats::{RequestStats, Spread},
    tag::{Poll, PollClass, Table},
    traffic::Frames,
};

/// One line, as its task sees it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineReport {
    /// Settings in use; they differ from the plant file's while a technician tries others.
    pub settings: LineDef,
    /// Totals since the start.
    pub counters: LineCounters,
    /// The read plan, block by block.
    pub polls: Vec<PollReport>,
    /// Tags that their devices have refused: they are asked for once a minute at most.
    pub refused: Vec<TagId>,
    /// The devices that do not answer, and when each is asked next.
    pub retries: Vec<(DeviceId, Timestamp)>,
    /// How the schedule copes with too much to do, in words; `None` while every poll has its period.
    pub strain: Option<String>,
    /// Another master asks on this line.
    pub other_master: Option<OtherMasterHeard>,
    /// What was found of devices and connections.
    pub findings: Vec<LineFinding>,
    /// Whether all polls can meet their periods.
    pub admission: Admission,
    /// What each device of the line has answered.
    pub devices: Vec<(DeviceId, RequestStats)>,
    /// What each of them takes itself for a response, as the worst case of its polls counts it.
    pub device_times: Vec<(DeviceId, DeviceTime)>,
    /// How late the line task was where it waited for the next poll: what the program and its computer add.
    pub dispatch: Spread,
    /// Busy share of each of the last seconds, newest last, at most 60.
    pub busy: Vec<f32>,
    /// The latest frames.
    pub frames: Frames,
}

impl LineReport {
    /// Was none of the latest answers of a device a value, as `super::ne107::Reason::NoValues` has it?
    pub fn gives_no_values(&self, device: DeviceId) -> bool {
        self.devices.iter().any(|(id, stats)| *id == device && stats.fails_since(super::ne107::NO_VALUES_AFTER))
    }

    /// Nothing has gone over the line yet.
    pub fn new(settings: LineDef) -> LineReport {
        LineReport {
            counters: LineCounters::default(),
            polls: Vec::new(),
            refused: Vec::new(),
            retries: Vec::new(),
            strain: None,
            other_master: None,
            findings: Vec::new(),
            admission: Admission::of_nothing(settings.id),
            devices: Vec::new(),
            device_times: Vec::new(),
            dispatch: Spread::default(),
            busy: Vec::new(),
            frames: Frames::default(),
            settings,
        }
    }

    /// The same under other ids, without what has none any more, until the line reports again.
    pub fn renamed(&self, line: LineId, renamed: &Renamed) -> LineReport {
        let admission = Admission { line, dead: Vec::new(), warnings: Vec::new(), ..self.admission.clone() };
        let mut report = LineReport { admission, findings: Vec::new(), ..self.clone() };
        report.settings.id = line;
        report.polls.retain_mut(|poll| renamed.rename(&mut poll.device, &mut poll.tags));
        report.refused = self.refused.iter().filter_map(|tag| renamed.tag(*tag)).collect();
        let rename = |device: &mut DeviceId| renamed.device(*device).map(|now| *device = now).is_some();
        report.retries.retain_mut(|(device, _)| rename(device));
        report.devices.retain_mut(|(device, _)| rename(device));
        report.device_times.retain_mut(|(device, _)| rename(device));
        report
    }

    /// What the periodic reads take.
    pub fn scan(&self) -> Scan {
        let mut scan = Scan { blocks: 0, worst: Duration::ZERO, measured: Some(Duration::ZERO), load: 0.0 };
        for poll in &self.polls {
            let Poll::Every(period) = poll.poll else { continue };
            scan.blocks += 1;
            scan.worst += poll.cost;
            scan.measured = scan.measured.zip(poll.stats.read_time.last()).map(|(sum, one)| sum + one);
            scan.load += poll.cost.as_secs_f64() / period.as_secs_f64();
        }
        scan
    }

    /// The poll that reads a tag.
    pub fn poll_of(&self, tag: TagId) -> Option<&PollReport> {
        self.polls.iter().find(|poll| poll.tags.contains(&tag))
    }

    /// When a device that does not answer is asked next.
    pub fn retry_at(&self, id: DeviceId) -> Option<Timestamp> {
        self.retries.iter().find(|(device, _)| *device == id).map(|(_, at)| *at)
    }

    /// What a device takes itself for a response.
    pub fn device_time(&self, id: DeviceId) -> Option<DeviceTime> {
        self.device_times.iter().find(|(device, _)| *device == id).map(|(_, time)| *time)
    }

    /// What a device has answered.
    pub fn device(&self, id: DeviceId) -> Option<&RequestStats> {
        self.devices.iter().find(|(device, _)| *device == id).map(|(_, stats)| stats)
    }
}

/// All periodic reads of a line, once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan {
    /// How many they are.
    pub blocks: usize,
    /// All of them at worst.
    pub worst: Duration,
    /// What the last read of each has taken; `None` until each was read.
    pub measured: Option<Duration>,
    /// Share of the line's time at worst.
    pub load: f64,
}

/// One block of the read plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PollReport {
    /// Who is asked.
    pub device: DeviceId,
    /// Which table.
    pub table: Table,
    /// First address, 0-based.
    pub address: u16,
    /// Registers or bits.
    pub count: u16,
    /// The tags in it.
    pub tags: Arc<[TagId]>,
    /// How often.
    pub poll: Poll,
    /// Worst time of a good read: on the wire, with the device's own time and the silences.
    pub cost: Duration,
    /// What happens to it when the line has too much to do.
    pub class: PollClass,
    /// Its period is stretched to this many now; 1 is not at all.
    pub factor: f32,
    /// It is left out now, because the line has too much to do.
    pub shed: bool,
    /// When it is read next, if that is known.
    pub next: Option<Timestamp>,
    /// Counters.
    pub stats: RequestStats,
}

impl PollReport {
    /// What was left of the period at the worst that was seen: the longest delay and the longest read. `None` before the first
    /// read, and for a block that has no period; zero if nothing was left.
    pub fn margin(&self) -> Option<Duration> {
        let Poll::Every(period) = self.poll else { return None };
        let used = self.stats.read_time.max()? + self.stats.jitter.max().unwrap_or_default();
        Some(period.saturating_sub(used))
    }
}
