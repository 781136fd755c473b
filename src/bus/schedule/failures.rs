//! What answers and failures mean for blocks and devices, and what outlives a connection.

use std::time::Duration;

use jiff::Timestamp;

use super::{
    Failure, Schedule,
    device::{Failed, Health},
    poll::ScheduledPoll,
};
use crate::plant::{def::DeviceId, number::to_u32, time::elapsed};

impl Schedule {
    /// Has the block been answered before, and lastly?
    pub fn lives(&self, index: usize) -> bool {
        self.polls[index].lives()
    }

    /// Was the block, beside others of its device that answer, silent so often in a row that it should be tried in part?
    pub fn may_be_too_long(&self, index: usize) -> bool {
        let poll = &self.polls[index];
        poll.may_be_too_long() && self.devices[poll.place].failures() == 0
    }

    /// The request for this block was cut off with its connection: it is made again at once.
    pub fn cut(&mut self, index: usize, now: Timestamp) {
        let poll = &mut self.polls[index];
        poll.under_way = false;
        poll.retry(now);
        self.requeue(index);
    }

    /// The device answered (an exception is an answer too), `reply` after the request, where that is known: to this block, if it
    /// was one of the plan. If it was down, everything of it is due. What was released while it did not answer is not missed: the
    /// line had time. `true` if it was down.
    pub fn answered(
        &mut self,
        index: Option<usize>,
        device: DeviceId,
        response_time: Option<Duration>,
        now: Timestamp,
    ) -> bool {
        let Some(place) = self.place_of(device) else { return false };
        let failing = self.devices[place].probe_at.is_some();
        let was_down = self.devices[place].answered(response_time);
        if let Some(index) = index {
            self.polls[index].answered();
        }
        self.stale |= failing || was_down;
        for (n, poll) in
            self.polls.iter_mut().enumerate().filter(|(_, poll)| (failing || was_down) && poll.place == place)
        {
            poll.back_on_grid(self.origin, now);
            if was_down && Some(n) != index {
                poll.forgive(now);
            }
        }
        was_down
    }

    /// An answer of the device came after it had been given up: it lives, and what it was asked last is asked again.
    pub fn answered_late(&mut self, device: DeviceId, now: Timestamp) {
        let Some(place) = self.place_of(device) else { return };
        self.devices[place].answered_late(now);
        self.stale = true;
        let own = self.polls.iter_mut().filter(|poll| poll.place == place);
        if let Some(last) = own.max_by_key(|poll| poll.tried_at).filter(|poll| 0 < poll.failures()) {
            last.retry(now);
        }
    }

    /// A request to the device, for this block if it was one of the plan, has failed. It was sent at `sent`, and took the line for
    /// `spent`. `true` if the device is given up with this.
    pub fn failed(
        &mut self,
        index: Option<usize>,
        device: DeviceId,
        failure: Failure,
        (sent, spent): (Timestamp, Duration),
        now: Timestamp,
    ) -> bool {
        let Some(place) = self.place_of(device) else { return false };
        let of_block = index.map_or(0, |index| self.polls[index].failures());
        let pays = index.is_some_and(|index| self.polls[index].pays());
        let blocks = || self.polls.iter().filter(|poll| poll.place == place);
        let alone = 0 < of_block && self.devices[place].failures() == 0 && blocks().any(ScheduledPoll::lives);
        let count = to_u32(blocks().count());
        // Who lives pays nothing, neither for a lost frame nor for the tries after it.
        if !self.devices[place].is_trusted() || pays {
            self.probes.spent(spent.min(self.held_up(index, now)), now);
        }
        // Those that wait for their second or third try come first: none fails for long before it is given up.
        let waiting = self.devices.iter().filter(|other| other.device != device && other.is_failing()).count();
        let affordable = self.probes.affords(spent * to_u32(waiting), now);
        if let Some(index) = index {
            self.polls[index].failed(failure, now, self.probes.allows_from());
            self.requeue(index);
        }
        if alone {
            return false;
        }
        let was_probed = self.devices[place].probe_at.is_some();
        let given_up = self.devices[place].failed(failure, Failed { sent, spent, now }, count, affordable);
        self.stale |= !was_probed && self.devices[place].probe_at.is_some();
        self.choose_probe(place);
        given_up
    }

    /// How long the answer to a block of a device that does not answer is waited for (real time) where nothing else is due.
    pub(super) fn idle_timeout(&self, index: usize) -> Duration {
        let neighbour = || self.devices.iter().filter_map(Health::slowest).max();
        let health = self.devices[self.polls[index].place].clone();
        health.for_idle_time().response_timeout(self.patience, neighbour)
    }

    /// How long another poll has waited by now.
    fn held_up(&self, index: Option<usize>, now: Timestamp) -> Duration {
        let others = (0..self.polls.len()).filter(|other| Some(*other) != index);
        let due = others.filter_map(|other| self.queued(other)).map(|spot| spot.from).min();
        due.map_or(Duration::ZERO, |due| elapsed(due, now))
    }

    /// How long the answer to a block is waited for (real time), at most the timeout of its line.
    pub fn response_timeout(&self, index: usize) -> Duration {
        let neighbour = || self.devices.iter().filter_map(Health::slowest).max();
        self.devices[self.polls[index].place].response_timeout(self.patience, neighbour)
    }

    /// Another connection: nothing is under way. If the values were `lost` with the last one, everything is due, and every device
    /// is asked at once; blocks that failed alone keep their waits.
    pub fn reopened(&mut self, lost: bool, now: Timestamp) {
        self.stale = true;
        for poll in &mut self.polls {
            poll.under_way = false;
            if lost {
                poll.back_on_grid(self.origin, now);
                poll.due(now);
            }
        }
        self.devices.iter_mut().filter(|_| lost).for_each(|health| health.retry(now));
    }

    /// What a device is asked while it does not answer: the block that has failed least, and of these the one that was tried longest ago.
    pub(super) fn choose_probe(&mut self, place: usize) {
        let own = self.polls.iter().enumerate().filter(|(_, poll)| poll.place == place);
        let next = own.min_by_key(|(_, poll)| (poll.failures(), poll.tried_at));
        self.devices[place].probe = next.map(|(index, _)| index);
    }
}
