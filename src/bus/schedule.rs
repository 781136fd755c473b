//! Which block is read next: earliest deadline first on an absolute grid, with dead devices probed now and then.
//!
//! A transaction cannot be pre-empted, so this is non-preemptive EDF: whatever is released and has the nearest deadline
//! (release + period) goes first. A release that is missed is counted and skipped, never piled up. On a line with too much
//! to do (see [`overload`]) background polls are shed, critical polls go before normal ones, and normal ones share what is left. A device
//! that does not answer (`device`) is asked with one block only, within a small share of the line's time for all of them.

pub mod budget;
pub mod overload;
mod device;
mod poll;
mod queue;
mod status;
#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;

pub use budget::{Budget, LIVE_SHARE, WRITE_SHARE};
pub use device::FAILURES_MAX;
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
use crate::plant::{
    def::{DeviceId, LineDef},
    event::ExceptionCode,
    number::to_u32,
    tag::PollClass,
};

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
    /// The time for devices that do not answer.
    probes: Budget,
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
        let mut schedule =
            Schedule { origin: now, polls, queue, stale, devices, overload, probes, late, judged_at, last_was_aged };
        schedule.replan(blocks, now);
        schedule
    }

    /// The plan has changed: blocks that stay keep their grid and counts, devices their health; new blocks are due now.
    pub fn replan(&mut self, blocks: &[Block], now: Timestamp) {
        let mut old: Vec<Option<ScheduledPoll>> = std::mem::take(&mut self.polls).into_iter().map(Some).collect();
        self.stale = true;
        for health in &mut self.devices {
            health.probe = None;
        }
        for (index, block) in blocks.iter().enumerate() {
            let place = self.devices.iter().position(|health| health.device == block.device);
            let place = place.unwrap_or_else(|| {
                self.devices.push(Health::new(block.device, now));
                self.devices.len() - 1
            });
            self.devices[place].probe.get_or_insert(index);
            let kept =
                old.iter_mut().find(|old| old.as_ref().is_some_and(|old| old.is_of(block))).and_then(Option::take);
            self.polls.push(kept.unwrap_or_else(|| ScheduledPoll::new(block, place, self.origin, now)).at(place));
        }
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
        for health in self.devices.iter().filter(|health| health.probe_at.is_some()) {
            let Some((index, spot)) = health.probe.and_then(|index| Some((index, self.spot(index)?))) else { continue };
            let from = spot.from.max(health.free_at);
            if now < from {
                wake = Some(wake.map_or(from, |wake| wake.min(from)));
            } else if best.is_none_or(|best| (self.rank(spot, now), index) < best) {
                best = Some((self.rank(spot, now), index));
            }
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
            // A device that does not answer is asked with its first block only; who has waited longest goes first.
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

    /// A block that is read once could not be: it is due again soon.
    pub fn reschedule(&mut self, index: usize, now: Timestamp) {
        let poll = &mut self.polls[index];
        if poll.period.is_none() {
            poll.release = Some(now + ONCE_WITHIN);
            self.requeue(index);
        }
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

    /// The device answered (an exception is an answer too), `reply` after the request, where that is known. If it was down,
    /// everything of it is due. What was released while it did not answer is not missed: the line had time.
    pub fn answered(&mut self, device: DeviceId, response_time: Option<Duration>, now: Timestamp) {
        let Some(place) = self.place_of(device) else { return };
        let failing = self.devices[place].probe_at.is_some();
        let was_down = self.devices[place].answered(response_time);
        if failing {
            self.stale = true;
            let polls = self.polls.iter_mut().filter(|poll| poll.place == place);
            polls.for_each(|poll| poll.back_on_grid(self.origin, now));
        }
        if was_down {
            self.due_now(device, now);
        }
    }

    /// An answer of the device came after it had been given up.
    pub fn answered_late(&mut self, device: DeviceId) {
        if let Some(place) = self.place_of(device) {
            self.devices[place].answered_late();
        }
    }

    /// The device did not answer a request that was sent at `sent`, and that took the line for so long. `true` if it is
    /// given up with this.
    pub fn failed(&mut self, device: DeviceId, sent: Timestamp, spent: Duration, now: Timestamp) -> bool {
        let Some(place) = self.place_of(device) else { return false };
        self.probes.spent(spent, now);
        self.stale |= self.devices[place].probe_at.is_none();
        // Those that wait for their second or third try come first: none fails for long before it is given up.
        let waiting = self.devices.iter().filter(|other| other.device != device && other.is_failing()).count();
        let affordable = self.probes.affords(spent * to_u32(waiting), now);
        self.devices[place].failed(sent, now, affordable)
    }

    /// How long the answer to a block is waited for (real time), at most the timeout of its line.
    pub fn response_timeout(&self, index: usize, line: &LineDef) -> Duration {
        let neighbour = || self.devices.iter().filter_map(Health::slowest).max();
        self.devices[self.polls[index].place].response_timeout(line, neighbour)
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
        if let Some(place) = self.place_of(device) {
            self.devices[place].retry(now);
        }
        self.due_now(device, now);
    }

    fn due_now(&mut self, device: DeviceId, now: Timestamp) {
        self.stale = true;
        let place = self.place_of(device);
        for poll in self.polls.iter_mut().filter(|poll| Some(poll.place) == place) {
            poll.urgent = Some(now);
        }
    }

    /// When a device that does not answer is asked next.
    fn probe_from(&self, health: &Health) -> Option<Timestamp> {
        let probe_at = health.probe_at?;
        let affordable = if health.prompt { probe_at } else { probe_at.max(self.probes.allows_from()) };
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
