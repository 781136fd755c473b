//! Which block is read next: earliest deadline first on an absolute grid, with dead devices probed now and then.
//!
//! A transaction cannot be pre-empted, so this is non-preemptive EDF: whatever is released and has the nearest deadline
//! (release + period) goes first. A release that is missed is counted and skipped, never piled up.

use std::time::Duration;

use jiff::Timestamp;

use super::{backoff::Backoff, plan::Block};
use crate::plant::{def::DeviceId, tag::Poll};

/// Failures in a row after which a device is given up and only probed.
pub const FAILURES_MAX: u32 = 3;
/// A block that is read once should be read within this time.
const ONCE_WITHIN: Duration = Duration::from_secs(5);

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
    polls: Vec<Pending>,
    devices: Vec<Health>,
    missed: u64,
}

#[derive(Debug, Clone)]
struct Pending {
    device: DeviceId,
    period: Option<Duration>,
    /// Next point of its grid; `None` for a block that is read once and has been.
    release: Option<Timestamp>,
    /// Asked for out of turn (device came back, operator's wish) at this time.
    urgent: Option<Timestamp>,
}

#[derive(Debug, Clone)]
struct Health {
    device: DeviceId,
    failures: u32,
    backoff: Backoff,
    /// While the device is down: when it is probed next.
    probe_at: Option<Timestamp>,
    /// Not to be asked before this moment.
    rests_until: Timestamp,
}

impl Schedule {
    /// Everything is due at `now`, which is also the origin of the grid.
    pub fn new(blocks: &[Block], now: Timestamp) -> Schedule {
        let mut devices: Vec<Health> = Vec::new();
        for block in blocks {
            if !devices.iter().any(|health| health.device == block.device) {
                devices.push(Health {
                    device: block.device,
                    failures: 0,
                    backoff: Backoff::default(),
                    probe_at: None,
                    rests_until: now,
                });
            }
        }
        let pending = |block: &Block| Pending {
            device: block.device,
            period: match block.poll {
                Poll::Every(period) => Some(period),
                Poll::Once | Poll::Never => None,
            },
            release: Some(now),
            urgent: None,
        };
        Schedule { polls: blocks.iter().map(pending).collect(), devices, missed: 0 }
    }

    /// The block whose deadline is nearest among those that may be read now.
    pub fn next(&self, now: Timestamp) -> Next {
        let mut best: Option<(Timestamp, usize)> = None;
        let mut wake: Option<Timestamp> = None;
        for (index, poll) in self.polls.iter().enumerate() {
            let Some((from, deadline)) = self.due(index, poll) else { continue };
            if now < from {
                wake = Some(wake.map_or(from, |wake| wake.min(from)));
            } else if best.is_none_or(|(nearest, _)| deadline < nearest) {
                best = Some((deadline, index));
            }
        }
        match (best, wake) {
            (Some((_, index)), _) => Next::Run(index),
            (None, Some(at)) => Next::WaitUntil(at),
            (None, None) => Next::Idle,
        }
    }

    /// When a block may be read, and by when it should be.
    fn due(&self, index: usize, poll: &Pending) -> Option<(Timestamp, Timestamp)> {
        let health = self.health(poll.device)?;
        if let Some(probe_at) = health.probe_at {
            // A device that is down is probed with its first block only.
            let first = self.polls.iter().position(|other| other.device == poll.device) == Some(index);
            let from = probe_at.max(health.rests_until);
            return first.then_some((from, from + ONCE_WITHIN));
        }
        let within = poll.period.unwrap_or(ONCE_WITHIN);
        let release = match (poll.urgent, poll.release) {
            (Some(urgent), Some(release)) => urgent.min(release),
            (Some(at), None) | (None, Some(at)) => at,
            (None, None) => return None,
        };
        Some((release.max(health.rests_until), release + within))
    }

    /// The block has been read, well or not, from `started` to `now`: that served its releases up to `started`. What was
    /// released and is over by now is missed; the next release is the first point of its grid that is not.
    pub fn done(&mut self, index: usize, started: Timestamp, now: Timestamp) {
        let poll = &mut self.polls[index];
        poll.urgent = None;
        poll.release = match (poll.period, poll.release) {
            (Some(period), Some(release)) if release <= now => {
                let served = if release <= started { periods_in(release, started, period) + 1 } else { 0 };
                let over = periods_in(release, now, period).max(served);
                // Of the releases served together only the last was in time.
                self.missed += u64::from(over - served.min(1));
                Some(release + period * over)
            }
            (Some(_), release) => release,
            (None, _) => None,
        };
    }

    /// A block that is read once could not be: it is due again soon.
    pub fn again(&mut self, index: usize, now: Timestamp) {
        let poll = &mut self.polls[index];
        if poll.period.is_none() {
            poll.release = Some(now + ONCE_WITHIN);
        }
    }

    /// The device answered (an exception is an answer too). If it was down, everything of it is due.
    pub fn answered(&mut self, device: DeviceId, now: Timestamp) {
        let Some(health) = self.health_mut(device) else { return };
        health.failures = 0;
        health.backoff.reset();
        if health.probe_at.take().is_some() {
            self.refresh(device, now);
        }
    }

    /// The device did not answer. `true` if it is given up with this.
    pub fn failed(&mut self, device: DeviceId, now: Timestamp) -> bool {
        let Some(health) = self.health_mut(device) else { return false };
        health.failures = health.failures.saturating_add(1);
        if health.failures < FAILURES_MAX {
            return false;
        }
        let goes_down = health.probe_at.is_none();
        health.probe_at = Some(now + health.backoff.fail());
        goes_down
    }

    /// The device is not to be asked before `until`.
    pub fn rest(&mut self, device: DeviceId, until: Timestamp) {
        let Some(health) = self.health_mut(device) else { return };
        health.rests_until = health.rests_until.max(until);
    }

    /// When a block is read next; `None` for one that is read once and has been.
    pub fn release(&self, index: usize) -> Option<Timestamp> {
        self.polls.get(index).and_then(|poll| poll.release)
    }

    /// Everything of a device is due now; its grid stays.
    pub fn refresh(&mut self, device: DeviceId, now: Timestamp) {
        for poll in self.polls.iter_mut().filter(|poll| poll.device == device) {
            poll.urgent = Some(now);
        }
    }

    /// Is the device given up?
    pub fn is_down(&self, device: DeviceId) -> bool {
        self.health(device).is_some_and(|health| health.probe_at.is_some())
    }

    /// Must the device be left alone now (it is settling, or owes answers)?
    pub fn is_resting(&self, device: DeviceId, now: Timestamp) -> bool {
        self.health(device).is_some_and(|health| now < health.rests_until)
    }

    /// Releases that were skipped because the line had no time.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// `None` for a device of which nothing is read.
    fn health(&self, device: DeviceId) -> Option<&Health> {
        self.devices.iter().find(|health| health.device == device)
    }

    fn health_mut(&mut self, device: DeviceId) -> Option<&mut Health> {
        self.devices.iter_mut().find(|health| health.device == device)
    }
}

/// Whole periods between two moments.
fn periods_in(from: Timestamp, to: Timestamp, period: Duration) -> u32 {
    let span = Duration::try_from(to.duration_since(from)).unwrap_or_default();
    u32::try_from(span.as_nanos() / period.as_nanos().max(1)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::plant::{def::TagId, tag::Table};

    fn at(ms: i64) -> Timestamp {
        Timestamp::from_millisecond(ms).expect("a small number")
    }

    fn block(device: u16, poll: Poll) -> Block {
        let unit = device as u8 + 1;
        let tags = vec![TagId(0)];
        Block { device: DeviceId(device), unit, table: Table::Input, address: 0, count: 1, tags, poll, alignment: 1 }
    }

    fn every(ms: u64) -> Poll {
        Poll::Every(Duration::from_millis(ms))
    }

    #[test]
    fn the_nearest_deadline_goes_first_and_the_grid_does_not_drift() {
        let mut schedule = Schedule::new(&[block(0, every(1000)), block(0, every(250))], at(0));
        let mut log = Vec::new();
        let mut now = 0;
        while now < 1100 {
            match schedule.next(at(now)) {
                Next::Run(index) => {
                    log.push((now, index));
                    now += 40;
                    schedule.done(index, at(now - 40), at(now));
                }
                Next::WaitUntil(until) => now = until.as_millisecond(),
                Next::Idle => panic!("periodic polls are never idle"),
            }
        }
        assert_eq!(log, [(0, 1), (40, 0), (250, 1), (500, 1), (750, 1), (1000, 1), (1040, 0)]);
        assert_eq!(schedule.missed(), 0);
    }

    #[test]
    fn what_is_missed_is_counted_and_not_piled_up() {
        let mut schedule = Schedule::new(&[block(0, every(100))], at(0));
        assert_eq!(schedule.next(at(0)), Next::Run(0));
        schedule.done(0, at(0), at(350));
        assert_eq!(schedule.missed(), 2, "the releases at 100 and 200 are lost, that of 300 is late");
        assert_eq!(schedule.next(at(350)), Next::Run(0));
        schedule.done(0, at(350), at(360));
        assert_eq!(schedule.next(at(360)), Next::WaitUntil(at(400)));
    }

    #[test]
    fn a_dead_device_is_probed_with_backoff_and_read_whole_when_it_is_back() {
        let blocks = [block(0, every(1000)), block(0, Poll::Once), block(1, every(1000))];
        let mut schedule = Schedule::new(&blocks, at(0));
        for index in [0, 1, 2] {
            schedule.done(index, at(0), at(10));
        }
        let device = DeviceId(0);
        assert!(!schedule.failed(device, at(1000)));
        assert!(!schedule.failed(device, at(2000)));
        assert!(schedule.failed(device, at(3000)), "given up with the third");
        assert!(schedule.is_down(device));
        schedule.done(0, at(3000), at(3000));
        schedule.done(2, at(3000), at(3000));
        assert_eq!(schedule.next(at(3999)), Next::WaitUntil(at(4000)), "probe and other device both at 4 s");
        assert!(!schedule.failed(device, at(4100)), "it is told once");
        schedule.done(2, at(4100), at(4100));
        assert_eq!(schedule.next(at(4500)), Next::WaitUntil(at(5000)), "the other device goes on at its rate");
        schedule.answered(device, at(6100));
        let mut due = Vec::new();
        while let Next::Run(index) = schedule.next(at(6100)) {
            schedule.done(index, at(6100), at(6100));
            due.push(index);
        }
        due.sort_unstable();
        assert_eq!(due, [0, 1, 2], "also the block that is read once");
    }

    #[test]
    fn a_device_at_rest_is_not_asked() {
        let mut schedule = Schedule::new(&[block(0, every(100))], at(0));
        schedule.rest(DeviceId(0), at(700));
        assert_eq!(schedule.next(at(0)), Next::WaitUntil(at(700)));
        assert!(schedule.is_resting(DeviceId(0), at(699)) && !schedule.is_resting(DeviceId(0), at(700)));
    }

    proptest! {
        #[test]
        fn nobody_starves(periods in proptest::collection::vec(50u64..2000, 1..12), cost in 1i64..80) {
            let blocks: Vec<Block> = periods.iter().enumerate().map(|(n, ms)| block(n as u16, every(*ms))).collect();
            let mut schedule = Schedule::new(&blocks, at(0));
            let mut last = vec![0i64; blocks.len()];
            let mut now = 0;
            while now < 60_000 {
                match schedule.next(at(now)) {
                    Next::Run(index) => {
                        now += cost;
                        schedule.done(index, at(now - cost), at(now));
                        last[index] = now;
                    }
                    Next::WaitUntil(until) => now = until.as_millisecond(),
                    Next::Idle => prop_assert!(false, "periodic polls are never idle"),
                }
                for (index, last) in last.iter().enumerate() {
                    // Even on a line with too much to do each block has its turn.
                    let bound = 2 * periods[index] as i64 + 2 * cost * blocks.len() as i64 + 2000;
                    prop_assert!(now - last <= bound, "block {} waits since {} at {}", index, last, now);
                }
            }
        }
    }
}
