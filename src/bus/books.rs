//! The books of a line: what every poll and every device has given, how busy the line was, which frames went over it.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use jiff::Timestamp;

use super::plan::{self, Block};
use crate::plant::{
    PlantDef,
    def::{DeviceId, LineDef, LineId},
    event::{Fault, LineCounters},
    line_report::{LineReport, PollReport},
    tally::Tally,
    traffic::{Frame, Frames},
};

/// Seconds of busyness that are remembered.
const BUSY_OVER: usize = 60;
/// The last of them that `utilisation` is the mean of.
const BUSY_NOW: usize = 10;

/// The books of one line. They outlive its openings.
#[derive(Debug, Clone)]
pub struct Books {
    /// By block of the plan.
    polls: Vec<Tally>,
    devices: Vec<(DeviceId, Tally)>,
    busy: VecDeque<f32>,
    frames: Frames,
}

impl Books {
    /// Empty books for a plan.
    pub fn new(def: &PlantDef, line: LineId, blocks: &[Block]) -> Books {
        let devices = def.devices.iter().filter(|device| device.line == line);
        Books {
            polls: vec![Tally::default(); blocks.len()],
            devices: devices.map(|device| (device.id, Tally::default())).collect(),
            busy: VecDeque::new(),
            frames: Frames::default(),
        }
    }

    /// The block at `index` was replaced by `count` others, which start with empty books.
    pub fn split(&mut self, index: usize, count: usize) {
        self.polls.splice(index..=index, std::iter::repeat_n(Tally::default(), count));
    }

    /// The tally of a poll.
    pub fn poll(&mut self, index: usize) -> &mut Tally {
        &mut self.polls[index]
    }

    /// The tally of a device.
    pub fn device(&mut self, device: DeviceId) -> Option<&mut Tally> {
        self.devices.iter_mut().find(|(id, _)| *id == device).map(|(_, tally)| tally)
    }

    /// A request for a poll has ended.
    pub fn polled(&mut self, index: usize, device: DeviceId, outcome: Result<(), Fault>, reply: Option<Duration>) {
        self.polls[index].count(outcome, reply);
        self.asked(device, outcome, reply);
    }

    /// Any other request to a device has ended.
    pub fn asked(&mut self, device: DeviceId, outcome: Result<(), Fault>, reply: Option<Duration>) {
        if let Some(tally) = self.device(device) {
            tally.count(outcome, reply);
        }
    }

    /// A second is over in which the line was busy for this share of it.
    pub fn second(&mut self, busy: f32, frames: Vec<Frame>, counters: &mut LineCounters) {
        if self.busy.len() == BUSY_OVER {
            self.busy.pop_front();
        }
        self.busy.push_back(busy.min(1.0));
        let mean = |over: usize| {
            let latest = self.busy.iter().rev().take(over);
            latest.sum::<f32>() / self.busy.len().min(over) as f32
        };
        (counters.utilisation, counters.utilisation_minute) = (mean(BUSY_NOW), mean(BUSY_OVER));
        counters.missed = self.polls.iter().map(|tally| tally.missed).sum();
        self.frames.extend(frames);
    }

    /// All of it, for a snapshot. `next` gives the next release of a block.
    pub fn report(
        &self,
        def: &PlantDef,
        settings: &LineDef,
        blocks: &[Block],
        counters: LineCounters,
        next: impl Fn(usize) -> Option<Timestamp>,
    ) -> Arc<LineReport> {
        let poll = |(index, (block, tally)): (usize, (&Block, &Tally))| PollReport {
            device: block.device,
            table: block.table,
            address: block.address,
            count: block.count,
            tags: block.tags.as_slice().into(),
            poll: block.poll,
            cost: plan::cost(block, settings, def.device(block.device)),
            next: next(index),
            tally: tally.clone(),
        };
        Arc::new(LineReport {
            settings: settings.clone(),
            counters,
            polls: blocks.iter().zip(&self.polls).enumerate().map(poll).collect(),
            devices: self.devices.clone(),
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
    fn the_load_of_the_last_ten_seconds_and_of_the_last_minute_are_told_apart() {
        let def = fixture::plant();
        let blocks = plan::blocks(&def, LineId(0));
        let mut books = Books::new(&def, LineId(0), &blocks);
        let mut counters = LineCounters::default();
        for second in 0..100 {
            books.second(if second < 90 { 0.2 } else { 0.8 }, Vec::new(), &mut counters);
        }
        assert!((counters.utilisation - 0.8).abs() < 1e-5, "{}", counters.utilisation);
        assert!((counters.utilisation_minute - 0.3).abs() < 1e-5, "{}", counters.utilisation_minute);
        books.polled(0, blocks[0].device, Err(Fault::Timeout), None);
        books.split(0, 3);
        let report = books.report(&def, &def.lines[0], &blocks[..2], counters, |_| None);
        assert_eq!(report.polls[0].tally.requests, 0, "the parts of a block begin anew");
        assert_eq!(report.device(blocks[0].device).map(|tally| tally.timeouts), Some(1));
    }
}
