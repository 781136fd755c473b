//! Which block is read next: earliest deadline first on an absolute grid, with dead devices probed now and then.
//!
//! A transaction cannot be pre-empted, so this is non-preemptive EDF: whatever is released and has the nearest deadline
//! (release + period) goes first. A release that is missed is counted and skipped, never piled up. On a line with too much
//! to do (see [`overload`]) background polls are shed, critical polls go before normal ones, and normal ones share what is left. A device
//! that does not answer (`device`) is asked with one block at a time, in turn; a block that fails alone waits alone. All of them together
//! take a small share of the time that the others want, and all of the time that is left.

pub mod budget;
pub mod overload;
mod device;
mod failures;
mod poll;
mod queue;
mod status;
#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;

pub use budget::{Budget, LIVE_SHARE, WRITE_SHARE};
pub use device::{Failure, Patience};
pub use overload::{Demand, FACTOR_MAX, Load};
pub use poll::{PollInfo, Served};

use std::time::Duration;

use jiff::Timestamp;

use self::{
    budget::PROBE_SHARE,
    device::Health,
    overload::Overload,
    poll::{ONCE_WITHIN, Pace, ScheduledPoll},
    queue::{Queue, Spot},
};
use super::plan::Block;
use crate::plant::{def::DeviceId, fault::ExceptionCode, tag::PollClass};

/// On an overloaded line even what is shed or always comes last is read once it has waited so long. Only a line that its
/// critical polls alone fill to the brim gets that far.
const STARVED_AFTER: Duration = Duration::from_secs(60);

/// Tier of what has waited so long.
const STARVED: u8 = 0;
/// The demand is evaluated this often.
const EVALUATE_EVERY: Duration = Duration::from_secs(1);

/// What to do now.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// Read this block.
    Run(usize),
    /// Nothing is due before this moment.
    WaitUntil(Timestamp),
    /// Nothing will be due at all.
    Idle,
}

/// The polls of one line.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// A point of every grid.
    origin: Timestamp,
    polls: Vec<ScheduledPoll>,
    /// Those of devices that answer, as they come.
    queue: Queue,
    /// What the places of many polls depend on has changed: the queue is rebuilt before it is looked at.
    stale: bool,
    devices: Vec<Health>,
    overload: Overload,
    /// The time for devices and blocks that do not answer.
    probes: Budget,
    patience: Patience,
    /// A critical poll was late since the demand was last looked at, and when that was.
    late: bool,
    judged_at: Timestamp,
    /// The last poll served had starved: two in a row would starve the others.
    last_was_aged: bool,
}

impl Schedule {
    /// Everything is due at `now`, which is also the origin of the grid.
    pub fn new(blocks: &[Block], now: Timestamp) -> Schedule {
        let (polls, devices, overload) = (Vec::new(), Vec::new(), Overload::default());
        let probes = Budget::new(PROBE_SHARE, now);
        let (queue, stale, late, judged_at, last_was_aged) = (Queue::default(), true, false, now, false);
        let patience = Patience::default();
        let origin = now;
        let mut schedule = Schedule {
            origin,
            polls,
            queue,
            stale,
            devices,
            overload,
            probes,
            patience,
            late,
            judged_at,
            last_was_aged,
        };
        schedule.replan(blocks, now);
        schedule
    }

    /// How long the answers of the line are waited for.
    pub fn set_patience(&mut self, patience: Patience) {
        self.patience = patience;
    }

    /// Devices have other ids; those without one are asked no more. A plan follows.
    pub fn rename(&mut self, renamed: impl Fn(DeviceId) -> Option<DeviceId>) {
        let rename = |device: &mut DeviceId| renamed(*device).map(|now| *device = now).is_some();
        self.devices.retain_mut(|health| rename(&mut health.device));
        self.polls.retain_mut(|poll| rename(poll.device_mut()));
    }

    /// The plan has changed: blocks that stay keep their grid and counts, devices their health; new blocks are due now.
    pub fn replan(&mut self, blocks: &[Block], now: Timestamp) {
        let mut old: Vec<Option<ScheduledPoll>> = std::mem::take(&mut self.polls).into_iter().map(Some).collect();
        self.stale = true;
        for block in blocks {
            let place = self.devices.iter().position(|health| health.device == block.device);
            let place = place.unwrap_or_else(|| {
                self.devices.push(Health::new(block.device, now));
                self.devices.len() - 1
            });
            let kept =
                old.iter_mut().find(|old| old.as_ref().is_some_and(|old| old.is_of(block))).and_then(Option::take);
            self.polls
                .push(kept.unwrap_or_else(|| ScheduledPoll::new(block, place, self.origin, now)).at(place, block));
        }
        (0..self.devices.len()).for_each(|place| self.choose_probe(place));
    }

    /// The block whose deadline is nearest among those that may be read now.
    pub fn next(&mut self, now: Timestamp) -> Next {
        if std::mem::take(&mut self.stale) {
            let spots: Vec<Option<Spot>> = (0..self.polls.len()).map(|index| self.queued(index)).collect();
            self.queue.fill(spots.into_iter());
        }
        self.queue.advance(now);
        let mut wake = self.queue.wakes_at();
        let mut best: Option<((u8, Timestamp), usize)> = None;
        let starved =
            self.queue.starved().filter(|_| !self.last_was_aged).map(|(deadline, index)| ((STARVED, deadline), index));
        for (rank, index) in starved.chain(self.queue.ready()) {
            let free_at = self.devices[self.polls[index].place].free_at;
            if free_at <= now {
                best = Some((rank, index));
                break;
            }
            wake = Some(wake.map_or(free_at, |wake| wake.min(free_at)));
        }
        let (is_idle, free_until) = (best.is_none(), wake);
        let mut idle: Option<(Timestamp, usize)> = None;
        for health in self.devices.iter().filter(|health| health.probe_at.is_some()) {
            let Some((index, spot)) = health.probe.and_then(|index| Some((index, self.spot(index)?))) else { continue };
            let from = spot.from.max(health.free_at);
            if from <= now {
                if best.is_none_or(|best| (self.rank(spot, now), index) < best) {
                    best = Some((self.rank(spot, now), index));
                }
                continue;
            }
            // Where nothing else is due before its timeout, it may be asked at no cost.
            let idle_from = health.idle_at.max(health.rests_until).max(health.free_at);
            let wait = self.patience.plant_span(self.idle_timeout(index));
            if now < idle_from {
                wake = Some(wake.map_or(idle_from, |wake| wake.min(idle_from)));
            } else if is_idle && free_until.is_none_or(|until| now + wait <= until) {
                idle = Some(idle.map_or((idle_from, index), |idle| idle.min((idle_from, index))));
            } else {
                wake = Some(wake.map_or(from, |wake| wake.min(from)));
            }
        }
        self.devices.iter_mut().for_each(|health| health.short = false);
        if let Some((at, index)) = idle.filter(|_| best.is_none()) {
            self.devices[self.polls[index].place].short = true;
            best = Some(((STARVED, at), index));
        }
        match (best, wake) {
            (Some((_, index)), _) => Next::Run(index),
            (None, Some(at)) => Next::WaitUntil(at),
            (None, None) => Next::Idle,
        }
    }

    /// When a poll may be read, its device's gap aside; `None`: not at all, or not before its answer has come.
    fn spot(&self, index: usize) -> Option<Spot> {
        let poll = &self.polls[index];
        if poll.under_way {
            return None;
        }
        let health = &self.devices[poll.place];
        let (from, deadline) = if let Some(probe_at) = health.probe_at {
            // A device that does not answer is asked with one block; who has waited longest goes first.
            let from = self.probe_from(health)?;
            (health.probe == Some(index)).then_some((from, probe_at + ONCE_WITHIN))?
        } else {
            let from = poll.wanted()?.max(health.rests_until).max(poll.not_before);
            (from, poll.deadline(self.pace_of(poll))?)
        };
        let starves_at = Some(from + STARVED_AFTER);
        Some(match (self.overload.load(), poll.class) {
            (Load::Normal, _) | (Load::Overload { .. }, PollClass::Critical) => {
                Spot { from, tier: 1, deadline, starves_at: None }
            }
            (Load::Overload { .. }, PollClass::Normal) => Spot { from, tier: 2, deadline, starves_at },
            (Load::Overload { .. }, PollClass::Background) => {
                Spot { from: from + STARVED_AFTER, tier: 3, deadline, starves_at }
            }
        })
    }

    /// The place in the queue, where polls of devices that do not answer have none.
    fn queued(&self, index: usize) -> Option<Spot> {
        let answers = self.devices[self.polls[index].place].probe_at.is_none();
        if answers { self.spot(index) } else { None }
    }

    fn requeue(&mut self, index: usize) {
        if !self.stale {
            let spot = self.queued(index);
            self.queue.put(index, spot);
        }
    }

    fn rank(&self, spot: Spot, now: Timestamp) -> (u8, Timestamp) {
        let starves = !self.last_was_aged && spot.starves_at.is_some_and(|starves_at| starves_at <= now);
        (if starves { STARVED } else { spot.tier }, spot.deadline)
    }

    fn pace_of(&self, poll: &ScheduledPoll) -> Pace {
        match (self.overload.load(), poll.class, poll.period) {
            (Load::Overload { factor }, PollClass::Normal, Some(period)) => Pace::Stretched(period.mul_f64(factor)),
            (Load::Overload { .. }, PollClass::Background, _) => Pace::Shed,
            (Load::Overload { .. }, PollClass::Critical | PollClass::Normal, _) | (Load::Normal, _, _) => Pace::Normal,
        }
    }

    /// The request for this block is sent; it is not due again before [`Schedule::done`]. Needed only where others are sent
    /// before its answer comes.
    pub fn begin(&mut self, index: usize, now: Timestamp) {
        self.last_was_aged = self.has_starved(index, now);
        self.polls[index].under_way = true;
        self.requeue(index);
    }

    fn has_starved(&self, index: usize, now: Timestamp) -> bool {
        self.spot(index).is_some_and(|spot| self.rank(spot, now).0 == STARVED)
    }

    /// The block has been read, well or not, from `started` to `now`: that served its releases up to `started`. What was
    /// released and is over by now is missed; the next release is the first point of its grid that is not. Says how late
    /// the read began and what was missed, for the counters.
    pub fn done(&mut self, index: usize, started: Timestamp, now: Timestamp) -> Served {
        let pace = self.pace_of(&self.polls[index]);
        if !std::mem::take(&mut self.polls[index].under_way) {
            self.last_was_aged = self.has_starved(index, started);
        }
        let device = &self.devices[self.polls[index].place];
        let (rests_until, probed) = (device.rests_until, device.probe_at.is_some());
        let poll = &mut self.polls[index];
        // A probe begins late because its device does not answer, not because the line has no time.
        let free = if probed { started } else { rests_until.max(poll.not_before) };
        let served = poll.serve(pace, free, started, now);
        self.late |= poll.class == PollClass::Critical && poll.is_late();
        self.devices[self.polls[index].place].tried(now);
        self.requeue(index);
        let urgent = self.late && self.overload.load() == Load::Normal;
        if urgent || self.judged_at + EVALUATE_EVERY <= now {
            self.evaluate_load(now);
        }
        served
    }

    /// Looks at every poll, so not at every read.
    fn evaluate_load(&mut self, now: Timestamp) {
        let mut demand = Demand::default();
        for poll in self.polls.iter().filter(|poll| self.devices[poll.place].probe_at.is_none()) {
            let share = match poll.class {
                PollClass::Critical => &mut demand.critical,
                PollClass::Normal => &mut demand.normal,
                PollClass::Background => &mut demand.background,
            };
            *share += poll.demand();
        }
        self.judged_at = now;
        if !self.overload.evaluate(demand, std::mem::take(&mut self.late), now) {
            return;
        }
        self.stale = true;
        if self.overload.load() == Load::Normal {
            let normal = self.polls.iter_mut().filter(|poll| poll.class == PollClass::Normal);
            normal.for_each(|poll| poll.back_on_grid(self.origin, now));
        }
    }

    /// The block was answered, and that has taken so long.
    pub fn spent(&mut self, index: usize, time: Duration) {
        self.polls[index].spent(time);
    }

    /// A block that is read once could not be: it is due again soon, later each time; one that is read on request is not.
    pub fn reschedule(&mut self, index: usize, now: Timestamp) {
        self.polls[index].reschedule(now);
        self.requeue(index);
    }

    /// The block is due now; its grid stays.
    pub fn due(&mut self, index: usize, now: Timestamp) {
        self.polls[index].due(now);
        self.requeue(index);
    }

    /// The block is read again at `until`, and not before; its grid stays.
    pub fn later(&mut self, index: usize, until: Timestamp) {
        self.polls[index].later(until);
        self.requeue(index);
    }

    /// The block was answered with an exception; call it after [`Schedule::done`]. 05: it is read again in a second; 06: after
    /// 0.1 s, twice as long each time, 5 s at most; 08: once at once. Returns when; `None` for the next period.
    pub fn on_exception(&mut self, index: usize, code: ExceptionCode, now: Timestamp) -> Option<Timestamp> {
        let until = now + self.polls[index].retry_after(code)?;
        self.later(index, until);
        Some(until)
    }

    /// The device is not to be asked before `until`.
    pub fn hold_off(&mut self, device: DeviceId, until: Timestamp) {
        let Some(place) = self.place_of(device) else { return };
        let health = &mut self.devices[place];
        health.rests_until = health.rests_until.max(until);
        self.stale = true;
    }

    /// The gap that the device wants between two requests ends at `until`: the others need not wait for it.
    pub fn keep_gap(&mut self, device: DeviceId, until: Timestamp) {
        if let Some(place) = self.place_of(device) {
            self.devices[place].free_at = until;
        }
    }

    /// Everything of a device is due now; its grid stays. A device that does not answer is asked at once.
    pub fn refresh(&mut self, device: DeviceId, now: Timestamp) {
        let Some(place) = self.place_of(device) else { return };
        self.devices[place].retry(now);
        self.stale = true;
        self.polls.iter_mut().filter(|poll| poll.place == place).for_each(|poll| poll.retry(now));
    }

    /// When a device that does not answer is asked next.
    fn probe_from(&self, health: &Health) -> Option<Timestamp> {
        let probe_at = health.probe_at?;
        let is_free = health.prompt || health.is_trusted();
        let affordable = if is_free { probe_at } else { probe_at.max(self.probes.allows_from()) };
        Some(affordable.max(health.rests_until))
    }

    /// `None` for a device of which nothing is read.
    fn health(&self, device: DeviceId) -> Option<&Health> {
        self.place_of(device).map(|place| &self.devices[place])
    }

    fn place_of(&self, device: DeviceId) -> Option<usize> {
        self.devices.iter().position(|health| health.device == device)
    }
}
