//! One poll of a schedule: its grid, what it costs, and what it waits for.

use std::time::Duration;

use jiff::Timestamp;

use super::device::Failure;
use crate::{
    bus::{backoff::Backoff, plan::Block},
    plant::{
        def::DeviceId,
        fault::ExceptionCode,
        tag::{Poll, PollClass, Table},
        time::elapsed,
    },
};

/// A block that is read once should be read within this time.
pub(super) const ONCE_WITHIN: Duration = Duration::from_secs(5);
/// Waits between its tries grow to this many doublings of that.
const ONCE_DOUBLINGS: u32 = 4;
/// A critical poll that was late so often in a row means overload, whatever the costs say.
const LATE_MAX: u32 = 3;
/// A device that has acknowledged (05) wants to be left alone for a while.
const ACKNOWLEDGED: Duration = Duration::from_secs(1);
/// Failures in a row that cost a block nothing which has been answered before, and the wait after each but the first.
const FREE_FAILURES: u32 = 4;
const FREE_WAIT: Duration = Duration::from_secs(1);
/// The same of one that has never been answered.
const FREE_AT_FIRST: u32 = 2;
/// A block whose answers are corrupt so often in a row is asked for less often.
const CORRUPT_MAX: u32 = 3;
/// A block that was silent so often in a row is tried in part, once.
const SILENT_MAX: u32 = 3;
/// The first wait for a device that is busy (06); it doubles up to [`BUSY_MAX`].
const BUSY: Duration = Duration::from_millis(100);
const BUSY_MAX: Duration = Duration::from_secs(5);

/// How a read came off, for the counters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Served {
    /// How late it began after the point of its grid that it served; `None` for one out of turn.
    pub jitter: Option<Duration>,
    /// Releases that it came too late for.
    pub missed: u32,
}

/// How a poll stands, for screens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PollInfo {
    /// What happens to it under overload.
    pub class: PollClass,
    /// Its period, unstretched; `None` for a block that is read once.
    pub period: Option<Duration>,
    /// By how much its period is stretched now; 1 is not at all.
    pub factor: f32,
    /// It is left out now.
    pub shed: bool,
    /// When it is due next; `None` for a block that is read once and has been.
    pub next: Option<Timestamp>,
    /// Releases that were skipped because the line had no time.
    pub missed: u64,
}

/// How a poll is treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pace {
    /// On its grid.
    Normal,
    /// Its period has grown to this, because the line is overloaded.
    Stretched(Duration),
    /// Left out, because the line is overloaded.
    Shed,
}

#[derive(Debug, Clone)]
pub(super) struct ScheduledPoll {
    block: (DeviceId, Table, u16, u16),
    /// Place of its device among those of the schedule.
    pub place: usize,
    pub class: PollClass,
    pub period: Option<Duration>,
    /// It is read once, as opposed to only on request.
    once: bool,
    /// Refusals of a block that is read once.
    refusals: u32,
    /// Next point of its grid; `None` for a block that is read once and has been.
    pub release: Option<Timestamp>,
    /// Asked for out of turn (device came back, refresh command, retry) at this time.
    pub urgent: Option<Timestamp>,
    /// Put off until then.
    pub not_before: Timestamp,
    /// Sent, and not yet answered or given up.
    pub under_way: bool,
    pub missed: u64,
    /// Measured time of an answered read in seconds, smoothed.
    cost: Option<f64>,
    /// Times in a row that it began a whole period late although its device was free.
    late: u32,
    /// Times in a row that the device put it off; and whether the last read was put off.
    excuses: u32,
    excused: bool,
    /// Failures in a row, and the wait after the next.
    failures: u32,
    backoff: Backoff,
    /// When it was last tried.
    pub tried_at: Timestamp,
    /// It has been answered since the start.
    answered: bool,
}

impl ScheduledPoll {
    /// Due at once, and then on the grid that has a point at `origin`.
    pub fn new(block: &Block, place: usize, origin: Timestamp, now: Timestamp) -> ScheduledPoll {
        let period = period_of(block);
        let release = period.map_or(now, |period| origin + period * periods_in(origin, now, period));
        ScheduledPoll {
            block: key(block),
            place,
            class: block.class,
            period,
            once: block.poll == Poll::Once,
            refusals: 0,
            release: Some(release),
            urgent: None,
            not_before: now,
            under_way: false,
            missed: 0,
            cost: None,
            late: 0,
            excuses: 0,
            excused: false,
            failures: 0,
            backoff: Backoff::default(),
            tried_at: Timestamp::MIN,
            answered: false,
        }
    }

    /// Failures in a row.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// Has it been answered before, and lastly?
    pub fn lives(&self) -> bool {
        self.answered && self.failures == 0
    }

    /// Has it failed so often that its next failure is paid for?
    pub fn pays(&self) -> bool {
        let free = if self.answered { FREE_FAILURES } else { FREE_AT_FIRST };
        free <= self.failures
    }

    /// Silent so often in a row, and never answered since the start: it may be too long for a device that then says nothing.
    pub fn may_be_too_long(&self) -> bool {
        !self.answered && self.failures == SILENT_MAX
    }

    /// It was answered.
    pub fn answered(&mut self) {
        (self.failures, self.answered) = (0, true);
        self.backoff.reset();
    }

    /// It failed: silence is asked for once more at once, then after a wait that grows, and not before the line has time for it
    /// (`affordable_from`). One that has been answered before waits for a second at first, and stays on its grid where the
    /// answer was corrupt.
    pub fn failed(&mut self, failure: Failure, now: Timestamp, affordable_from: Timestamp) {
        if failure == Failure::Doubt {
            return;
        }
        self.failures = self.failures.saturating_add(1);
        match (failure, self.failures) {
            (Failure::Silence | Failure::OfGateway, 1) => self.later(now),
            (Failure::Corrupt, ..CORRUPT_MAX) if self.answered => {}
            (Failure::Silence | Failure::OfGateway, ..=FREE_FAILURES) if self.answered => self.later(now + FREE_WAIT),
            _ => {
                let until = now + self.backoff.fail();
                self.later(until.max(affordable_from));
            }
        }
    }

    /// Its device is back after it was given up: what failed meanwhile says nothing of the block.
    pub fn forgive(&mut self, now: Timestamp) {
        (self.failures, self.not_before) = (0, self.not_before.min(now));
        self.backoff.reset();
        self.due(now);
    }

    /// It is due out of turn; what was asked for earlier keeps its place.
    pub fn due(&mut self, now: Timestamp) {
        self.urgent = Some(self.urgent.map_or(now, |urgent| urgent.min(now)));
    }

    /// It may be read again at once although it failed.
    pub fn retry(&mut self, now: Timestamp) {
        self.not_before = self.not_before.min(now);
        self.urgent = Some(now);
    }

    /// Does it read this very block, as often?
    pub fn is_of(&self, block: &Block) -> bool {
        (self.block, self.period) == (key(block), period_of(block))
    }

    pub fn at(self, place: usize, block: &Block) -> ScheduledPoll {
        ScheduledPoll { place, class: block.class, once: block.poll == Poll::Once, ..self }
    }

    pub fn device_mut(&mut self) -> &mut DeviceId {
        &mut self.block.0
    }

    /// When it wants to be read next.
    pub fn wanted(&self) -> Option<Timestamp> {
        match (self.urgent, self.release) {
            (Some(urgent), Some(release)) => Some(urgent.min(release)),
            (urgent, release) => urgent.or(release),
        }
    }

    /// When it should have been read.
    pub fn deadline(&self, pace: Pace) -> Option<Timestamp> {
        let slack = match pace {
            Pace::Stretched(stretched) => stretched,
            Pace::Normal | Pace::Shed => self.period.unwrap_or(ONCE_WITHIN),
        };
        Some(self.wanted()? + slack)
    }

    /// See [`super::Schedule::done`]. `free`: since when its device could be asked at all.
    pub fn serve(&mut self, pace: Pace, free: Timestamp, started: Timestamp, now: Timestamp) -> Served {
        self.tried_at = started;
        // What was asked for while it was under way is still to be done.
        self.urgent = self.urgent.filter(|urgent| started < *urgent);
        if !std::mem::take(&mut self.excused) {
            self.excuses = 0;
        }
        let mut served_poll = Served { jitter: None, missed: 0 };
        self.release = match (self.period, self.release) {
            (Some(period), Some(release)) if release <= now => {
                let period = if let Pace::Stretched(stretched) = pace { stretched } else { period };
                let served = if release <= started { periods_in(release, started, period) + 1 } else { 0 };
                let over = periods_in(release, now, period).max(served);
                if served > 0 {
                    served_poll.jitter = Some(elapsed(release + period * (served - 1), started));
                    let waited = elapsed(release.max(free), started);
                    self.late = if period <= waited { self.late.saturating_add(1) } else { 0 };
                }
                // Of the releases served together only the last was in time. What was shed or waits was not to be read at all.
                let waits = pace == Pace::Shed || 0 < self.failures;
                served_poll.missed = if waits { 0 } else { over - served.min(1) };
                Some(release + period * over)
            }
            (Some(_), release) => release,
            (None, _) => None,
        };
        self.missed += u64::from(served_poll.missed);
        served_poll
    }

    /// An answered read has taken so long. An eighth of the news: one slow answer does not make a line overloaded.
    pub fn spent(&mut self, time: Duration) {
        let spent = time.as_secs_f64();
        self.cost = Some(self.cost.map_or(spent, |cost| cost + (spent - cost) / 8.0));
    }

    /// Does it come too late again and again?
    pub fn is_late(&self) -> bool {
        LATE_MAX <= self.late
    }

    /// Share of the line's time that it wants at its full rate, as measured.
    pub fn demand(&self) -> f64 {
        self.cost.zip(self.period).map_or(0.0, |(cost, period)| cost / period.as_secs_f64())
    }

    /// Its next release is on the grid that has a point at `origin`; none before `now` counts as missed.
    pub fn back_on_grid(&mut self, origin: Timestamp, now: Timestamp) {
        if let (Some(period), Some(release)) = (self.period, &mut self.release) {
            *release = origin + period * periods_in(origin, now.max(*release), period);
        }
    }

    /// A block that is read once could not be: it is due again soon, later each time; one that is read on request is not.
    pub fn reschedule(&mut self, now: Timestamp) {
        if self.once {
            self.release = Some(now + ONCE_WITHIN * 2u32.saturating_pow(self.refusals.min(ONCE_DOUBLINGS)));
            self.refusals = self.refusals.saturating_add(1);
        }
    }

    pub fn later(&mut self, until: Timestamp) {
        self.not_before = self.not_before.max(until);
        self.urgent = Some(until);
    }

    /// When to read again after an exception: 05 in a second; 06 after 0.1 s, twice as long each time, 5 s at most; 08 once
    /// at once. `None`: with the next period (Modbus application protocol V1.1b3, section 7).
    pub fn retry_after(&mut self, code: ExceptionCode) -> Option<Duration> {
        let before = self.excuses;
        let delay = match code.0 {
            0x05 => ACKNOWLEDGED,
            0x06 => (BUSY * 2u32.saturating_pow(before.min(16))).min(BUSY_MAX),
            0x08 if before == 0 => Duration::ZERO,
            _ => return None,
        };
        (self.excuses, self.excused) = (before.saturating_add(1), true);
        Some(delay)
    }
}

fn period_of(block: &Block) -> Option<Duration> {
    match block.poll {
        Poll::Every(period) => Some(period),
        Poll::Once | Poll::Never => None,
    }
}

fn key(block: &Block) -> (DeviceId, Table, u16, u16) {
    (block.device, block.table, block.address, block.count)
}

/// Whole periods between two moments.
fn periods_in(from: Timestamp, to: Timestamp, period: Duration) -> u32 {
    // 64 bits hold centuries, and divide ten times as fast as the 128 that the library gives.
    let nanos = |span: Duration| u64::try_from(span.as_nanos()).unwrap_or(u64::MAX);
    u32::try_from(nanos(elapsed(from, to)) / nanos(period).max(1)).unwrap_or(u32::MAX)
}
