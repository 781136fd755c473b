//! Statistics of a line: counters of every poll and device, load, and the ring of frames.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::{
    admission,
    plan::{self, Block, Wire},
    schedule::{Load, PollInfo},
};
use crate::plant::{
    PlantDef,
    admission::Admission,
    def::{DeviceDef, DeviceId, LineDef, LineId, TagId},
    device_time::{DeviceTime, SeenTime},
    fault::Fault,
    line_finding::{LineFinding, OtherMasterHeard},
    line_report::{LineReport, PollReport},
    line_state::LineCounters,
    redefinition::Renamed,
    request_stats::{RequestStats, Spread},
    traffic::{Frame, Frames},
};

/// Seconds of busyness that are remembered.
const BUSY_OVER: usize = 60;
/// A second is closed when about as much time has passed.
const CLOSED_AFTER_S: f32 = 0.9;
/// The last of them that `utilisation` is the mean of.
const BUSY_NOW: usize = 10;

/// The read plan as it stands, for a report.
#[derive(Debug)]
pub struct Plan<'a> {
    /// What is read.
    pub blocks: &'a [Block],
    /// How each of them stands in the schedule; empty without a port.
    pub polls: Vec<PollInfo>,
    /// Tags that their devices have refused.
    pub refused: Vec<TagId>,
    /// The devices that do not answer, and when each is asked next; empty without a port.
    pub retries: Vec<(DeviceId, Timestamp)>,
    /// How the schedule copes; normal without a port.
    pub load: Load,
    /// Another master asks on this line.
    pub other_master: Option<OtherMasterHeard>,
    /// What was found of devices and connections.
    pub findings: Vec<LineFinding>,
}

/// Statistics of one line, kept when its port is reopened.
#[derive(Debug, Clone)]
pub struct LineStats {
    /// By block of the plan.
    polls: Vec<RequestStats>,
    devices: Vec<(DeviceId, RequestStats)>,
    /// What each of them has taken for a response since the start.
    seen: Vec<(DeviceId, SeenTime)>,
    dispatch: Spread,
    busy: VecDeque<f32>,
    /// Seconds that the line was busy, of how many, since the last was closed.
    open: (f32, f32),
    /// Releases that were skipped, of all polls there have been.
    missed: u64,
    frames: Frames,
    admission: Admission,
    /// The times of the devices that it counts with.
    admitted: Vec<(DeviceId, DeviceTime)>,
}

impl LineStats {
    /// Zero counters for a plan.
    pub fn new(def: &PlantDef, line: LineId, blocks: &[Block]) -> LineStats {
        let devices: Vec<_> = def.devices.iter().filter(|device| device.line == line).collect();
        LineStats {
            polls: vec![RequestStats::default(); blocks.len()],
            devices: devices.iter().map(|device| (device.id, RequestStats::default())).collect(),
            seen: devices.iter().map(|device| (device.id, SeenTime::new(device.response_time))).collect(),
            dispatch: Spread::default(),
            busy: VecDeque::new(),
            open: (0.0, 0.0),
            missed: 0,
            frames: Frames::default(),
            admission: admission::admit(def, line, blocks),
            admitted: devices.iter().map(|device| (device.id, admission::unseen(device))).collect(),
        }
    }

    /// The plan has changed: blocks that stay keep their stats, others start at zero.
    pub fn replan(&mut self, old: &[Block], new: &[Block]) {
        let kept = |block: &Block| {
            let place = old.iter().position(|old| old.request() == block.request() && old.poll == block.poll)?;
            self.polls.get(place).cloned()
        };
        self.polls = new.iter().map(|block| kept(block).unwrap_or_default()).collect();
    }

    /// The line goes on under another definition: what of it is as it was keeps its stats. A plan follows.
    pub fn redefine(&mut self, def: &PlantDef, line: LineId, renamed: &Renamed) {
        let LineStats { mut devices, mut seen, .. } = LineStats::new(def, line, &[]);
        for (id, stats) in &mut devices {
            let was = self.devices.iter().find(|(was, _)| renamed.device(*was) == Some(*id));
            was.into_iter().for_each(|(_, was)| *stats = was.clone());
        }
        for (id, time) in &mut seen {
            let was = self.seen.iter().find(|(was, _)| renamed.device(*was) == Some(*id));
            was.into_iter().for_each(|(_, was)| *time = was.clone());
        }
        (self.devices, self.seen) = (devices, seen);
    }

    /// A request for a poll has ended after `tries`; `index` is `None` if the plan has changed meanwhile.
    pub fn polled(
        &mut self,
        index: Option<usize>,
        device: DeviceId,
        outcome: Result<(), Fault>,
        response_time: Option<Duration>,
        tries: u8,
    ) {
        let of_device = self.devices.iter_mut().find(|(id, _)| *id == device).map(|(_, stats)| stats);
        for stats in index.and_then(|index| self.polls.get_mut(index)).into_iter().chain(of_device) {
            stats.count(outcome, response_time);
            stats.retries += u64::from(tries.saturating_sub(1));
        }
    }

    /// A good read was on the wire for so long, from the first byte of the request to the last of the answer.
    pub fn took(&mut self, index: Option<usize>, block: &Block, wire: Wire, on_wire: Duration) {
        let frames = wire.frames(block.table, block.words());
        if let Some((_, seen)) = self.seen.iter_mut().find(|(id, _)| *id == block.device) {
            seen.add(on_wire.saturating_sub(frames));
        }
        if let Some(stats) = index.and_then(|index| self.polls.get_mut(index)) {
            stats.read_time.add(on_wire + wire.silent_interval);
        }
    }

    /// The task ran so long after the moment that it waited for.
    pub fn dispatched(&mut self, late: Duration) {
        self.dispatch.add(late);
    }

    /// What a device takes for a response.
    fn time_of(&self, device: &DeviceDef) -> DeviceTime {
        let seen = self.seen.iter().find(|(id, _)| *id == device.id);
        seen.map_or_else(|| admission::unseen(device), |(_, seen)| DeviceTime::new(seen))
    }

    /// The admission test again, if a device has taken longer than it counts with.
    pub fn admit_as_seen(&mut self, def: &PlantDef, settings: &LineDef, blocks: &[Block]) {
        let counted =
            |(device, admitted): &(DeviceId, DeviceTime)| self.time_of(def.device(*device)).bound == admitted.bound;
        if !self.admitted.iter().all(counted) {
            self.admit(def, settings, blocks);
        }
    }

    /// Any other request to a device has ended.
    pub fn asked(&mut self, device: DeviceId, outcome: Result<(), Fault>, response_time: Option<Duration>) {
        self.polled(None, device, outcome, response_time, 1);
    }

    /// The line has been busy for this share of a span.
    pub fn spent(&mut self, share: f32, of: Duration) {
        let of = of.as_secs_f32();
        self.open = (self.open.0 + share * of, self.open.1 + of);
        if self.open.1 < CLOSED_AFTER_S {
            return;
        }
        if self.busy.len() == BUSY_OVER {
            self.busy.pop_front();
        }
        self.busy.push_back((self.open.0 / self.open.1).min(1.0));
        self.open = (0.0, 0.0);
    }

    /// Answers of these units came when they had been given up.
    pub fn late(&mut self, def: &PlantDef, units: &[u8]) {
        for unit in units {
            for (device, stats) in &mut self.devices {
                stats.late += u64::from(def.device(*device).unit == *unit);
            }
        }
    }

    /// The line has other settings: what reads have taken before is not measured against their worst case.
    pub fn forget_times(&mut self) {
        self.polls.iter_mut().for_each(|stats| stats.read_time = Spread::default());
        self.seen.iter_mut().for_each(|(_, seen)| seen.clear());
    }

    /// Nothing is connected: nothing is busy.
    pub fn rest(&mut self, counters: &mut LineCounters) {
        self.busy.clear();
        (self.open, counters.utilisation, counters.utilisation_minute) = ((0.0, 0.0), 0.0, 0.0);
    }

    /// A read began so long after its point of the grid, and came too late for some.
    pub fn served(&mut self, index: usize, jitter: Option<Duration>, missed: u32) {
        self.missed += u64::from(missed);
        let stats = &mut self.polls[index];
        stats.missed += u64::from(missed);
        if let Some(jitter) = jitter {
            stats.jitter.add(jitter);
        }
    }

    /// The plan or the settings have changed: can all polls still be in time?
    pub fn admit(&mut self, def: &PlantDef, settings: &LineDef, blocks: &[Block]) {
        self.admission = admission::admit_as(def, settings, blocks, &|device| self.time_of(device));
        self.admitted = self.device_times(def);
    }

    fn device_times(&self, def: &PlantDef) -> Vec<(DeviceId, DeviceTime)> {
        self.seen.iter().map(|(device, _)| (*device, self.time_of(def.device(*device)))).collect()
    }

    /// Adds the latest frames, and writes the counters that are kept here.
    pub fn add_frames(&mut self, frames: Vec<Frame>, counters: &mut LineCounters) {
        let mean = |over: usize| {
            let latest = self.busy.iter().rev().take(over);
            latest.sum::<f32>() / self.busy.len().clamp(1, over) as f32
        };
        (counters.utilisation, counters.utilisation_minute) = (mean(BUSY_NOW), mean(BUSY_OVER));
        counters.missed = self.missed;
        self.frames.extend(frames);
    }

    /// All of it, for a snapshot.
    pub fn report(&self, def: &PlantDef, settings: &LineDef, plan: Plan, counters: LineCounters) -> Arc<LineReport> {
        let Plan { blocks, polls, refused, retries, load, other_master, findings } = plan;
        let poll = |(index, (block, stats)): (usize, (&Block, &RequestStats))| PollReport {
            class: block.class,
            factor: polls.get(index).map_or(1.0, |poll| poll.factor),
            shed: polls.get(index).is_some_and(|poll| poll.shed),
            device: block.device,
            table: block.table,
            address: block.address,
            count: block.count,
            tags: block.tags.clone(),
            poll: block.poll,
            cost: {
                let device = def.device(block.device);
                plan::cost(block, settings, device, self.time_of(device))
            },
            next: polls.get(index).and_then(|poll| poll.next),
            stats: stats.clone(),
        };
        Arc::new(LineReport {
            admission: self.admission.clone(),
            refused,
            retries,
            other_master,
            findings,
            strain: (load != Load::Normal).then(|| load.to_string()),
            settings: settings.clone(),
            counters,
            polls: blocks.iter().zip(&self.polls).enumerate().map(poll).collect(),
            devices: self.devices.clone(),
            device_times: self.device_times(def),
            dispatch: self.dispatch.clone(),
            busy: self.busy.iter().copied().collect(),
            frames: self.frames.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::fixture;

    #[test]
    fn the_load_of_ten_seconds_and_of_a_minute_differ() {
        let def = fixture::plant();
        let blocks = plan::blocks(&def, LineId(0), &plan::UnreadableRanges::default());
        let mut stats = LineStats::new(&def, LineId(0), &blocks);
        let mut counters = LineCounters::default();
        for second in 0..100 {
            stats.spent(if second < 90 { 0.2 } else { 0.8 }, Duration::from_secs(1));
            stats.add_frames(Vec::new(), &mut counters);
        }
        assert!((counters.utilisation - 0.8).abs() < 1e-5, "{}", counters.utilisation);
        assert!((counters.utilisation_minute - 0.3).abs() < 1e-5, "{}", counters.utilisation_minute);
        stats.polled(Some(0), blocks[0].device, Err(Fault::Timeout), None, 1);
        stats.polled(Some(1), blocks[1].device, Ok(()), None, 1);
        stats.replan(&blocks, &blocks[1..]);
        let plan = Plan {
            blocks: &blocks[1..],
            polls: Vec::new(),
            refused: Vec::new(),
            retries: Vec::new(),
            load: Load::Normal,
            other_master: None,
            findings: Vec::new(),
        };
        let report = stats.report(&def, &def.lines[0], plan, counters);
        assert_eq!(report.polls[0].stats.requests, 1, "a block that stays keeps its stats");
        assert_eq!(report.device(blocks[0].device).map(|stats| stats.timeouts), Some(1));
    }
}
