//! What a schedule knows of a device: whether it answers, how fast, and when it may be asked.
//!
//! ```text
//!             silence                 3 in a row (of one that has never answered: all of its first blocks), or no time
//!   answering ─────────> failing ────────────────────────────────────────────────────────────────────────────────────> down
//!             <─────────         one block after another: at once, after 1 s, …                        and so on, with backoff
//!               an answer
//! ```
//!
//! Health is of a block first: a block that fails beside others that answer says nothing of its device.

use std::time::Duration;

use jiff::Timestamp;

use crate::{
    bus::backoff::Backoff,
    plant::def::{DeviceId, LineDef},
};

/// Failures in a row after which a device that has answered before is given up and only probed.
pub const FAILURES_MAX: u32 = 3;
/// One that has never answered is asked for this many of its blocks before it is given up, and at least twice: it may have lost
/// its first frame, and has no values to lose.
const FIRST_BLOCKS_MAX: u32 = 5;
const FIRST_FAILURES_MIN: u32 = 2;
/// After this many answers it is known how fast a device answers.
const ANSWERS_MIN: u32 = 32;
/// A device that has always answered faster is waited for this many times its slowest answer …
const SLOWER_MAX: u32 = 4;
/// … but not less than this: systems and adapters pause now and then …
const RESPONSE_TIMEOUT_MIN: Duration = Duration::from_millis(100);
/// … and what is lost on a network is sent again after 200 to 300 ms.
const NETWORK_RESPONSE_TIMEOUT_MIN: Duration = Duration::from_millis(500);
/// Every n-th try in a row waits for the whole timeout: the device may have become slow.
const WHOLE_TIMEOUT_EVERY: u32 = 4;

/// A device without any result, not even a failure, is asked again after this time.
const TRIED_AGAIN: Duration = Duration::from_secs(1);
/// Where the line has nothing else to do, a device that does not answer waits no longer than this: the cable may just have
/// been plugged in …
const IDLE_WAIT_MAX: Duration = Duration::from_secs(5);
/// … and no longer than this for this many failures if it has answered before: it may come back by itself.
const IDLE_WAIT: Duration = Duration::from_secs(1);
const IDLE_FAILURES: u32 = 20;
/// A gateway that says at once that the device is away may be asked again soon: after this many times what that took.
const COST_SHARE: u32 = 20;
/// Doubts in a row count once in this time: several requests may share one cause.
const DOUBTS_EVERY: Duration = Duration::from_secs(1);

/// How a request has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Failure {
    /// Nothing came.
    Silence,
    /// A gateway says that the device does not answer it.
    OfGateway,
    /// Something came that is no valid response.
    Corrupt,
    /// The other side closed the connection instead of answering.
    Hangup,
    /// Whatever came might have been the answer to something else.
    Doubt,
}

impl Failure {
    /// Nothing shows that the device is there.
    pub(super) fn is_silence(self) -> bool {
        matches!(self, Failure::Silence | Failure::OfGateway)
    }
}

/// When a request failed: sent, the line taken for so long, and noticed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Failed {
    pub sent: Timestamp,
    pub spent: Duration,
    pub now: Timestamp,
}

/// How long the answers of a line are waited for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patience {
    /// Its timeout (real time).
    timeout: Duration,
    /// No device is waited for less, however fast it has been.
    least: Duration,
    /// Plant seconds per real second.
    speed: f64,
}

impl Default for Patience {
    fn default() -> Self {
        Patience { timeout: Duration::from_secs(1), least: RESPONSE_TIMEOUT_MIN, speed: 1.0 }
    }
}

impl Patience {
    /// That of a line.
    pub fn of(line: &LineDef, speed: f64) -> Patience {
        let serial = line.transport.serial().is_some();
        let least = if serial { RESPONSE_TIMEOUT_MIN } else { NETWORK_RESPONSE_TIMEOUT_MIN };
        Patience { timeout: line.timeout, least, speed }
    }

    /// The plant time in which a span of real time passes.
    pub(super) fn plant_span(self, real: Duration) -> Duration {
        real.mul_f64(self.speed)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Health {
    pub device: DeviceId,
    failures: u32,
    down: bool,
    /// When the last failure was noticed.
    failed_at: Timestamp,
    backoff: Backoff,
    /// While it does not answer: when it is asked next, and from when on if the line has nothing else to do.
    pub probe_at: Option<Timestamp>,
    pub idle_at: Timestamp,
    /// The next try does not wait for its share of the line's time.
    pub prompt: bool,
    /// The next try waits for the whole timeout.
    thorough: bool,
    /// The next try waits no longer than the line has nothing else to do.
    pub short: bool,
    /// Tries since one has waited for the whole timeout.
    short_tries: u32,
    /// The poll that it is asked with while it does not answer.
    pub probe: Option<usize>,
    /// Not to be asked before this moment.
    pub rests_until: Timestamp,
    /// The gap after its last request ends here.
    pub free_at: Timestamp,
    answers: u32,
    /// The longest time that an answer has taken (real time).
    slowest: Duration,
}

impl Health {
    pub fn new(device: DeviceId, now: Timestamp) -> Health {
        Health {
            device,
            failures: 0,
            down: false,
            failed_at: now,
            backoff: Backoff::default(),
            probe_at: None,
            idle_at: now,
            prompt: false,
            thorough: false,
            short: false,
            short_tries: 0,
            probe: None,
            rests_until: now,
            free_at: now,
            answers: 0,
            slowest: Duration::ZERO,
        }
    }

    /// Is it given up?
    pub fn is_down(&self) -> bool {
        self.down
    }

    /// Does it not answer, without being given up yet?
    pub fn is_failing(&self) -> bool {
        0 < self.failures && !self.down
    }

    /// It has answered, `reply` after the request. `true` if it was given up before.
    pub fn answered(&mut self, response_time: Option<Duration>) -> bool {
        if let Some(response_time) = response_time {
            self.answers = self.answers.saturating_add(1);
            self.slowest = self.slowest.max(response_time);
        }
        (self.failures, self.short_tries, self.probe_at, self.thorough, self.short) = (0, 0, None, false, false);
        self.backoff.reset();
        std::mem::take(&mut self.down)
    }

    /// An answer came after it had been given up: it lives, and from now on it has the whole timeout.
    pub fn answered_late(&mut self, now: Timestamp) {
        self.slowest = Duration::MAX;
        self.retry(now);
    }

    /// It was asked; the outcome follows, or never comes if nothing could be sent: then it is asked again after a while.
    pub fn tried(&mut self, now: Timestamp) {
        if let Some(probe_at) = &mut self.probe_at {
            (*probe_at, self.idle_at, self.prompt) = (now + TRIED_AGAIN, now + TRIED_AGAIN, false);
        }
    }

    /// A request that was sent at `sent` has failed, after the line was taken for `spent`; it has this number of `blocks`.
    /// `affordable`: the line has time for another try. `true` if it is given up with this.
    pub fn failed(&mut self, failure: Failure, times: Failed, blocks: u32, affordable: bool) -> bool {
        let Failed { sent, spent, now } = times;
        // What was under way when the last failure was noticed says nothing new.
        let together = sent < self.failed_at || failure == Failure::Doubt && now < self.failed_at + DOUBTS_EVERY;
        if 0 < self.failures && together {
            return false;
        }
        (self.failed_at, self.failures) = (now, self.failures.saturating_add(1));
        self.short_tries = if self.waits_whole() { 0 } else { self.short_tries.saturating_add(1) };
        // One frame may have been lost.
        self.prompt = self.failures == 1 && failure.is_silence();
        self.thorough = false;
        let tries = if self.answers == 0 { blocks.clamp(FIRST_FAILURES_MIN, FIRST_BLOCKS_MAX) } else { FAILURES_MAX };
        let goes_down = !self.down && (tries <= self.failures || failure.is_silence() && !(affordable || self.prompt));
        self.down |= goes_down;
        if self.prompt {
            (self.probe_at, self.idle_at) = (Some(now), now);
        } else if self.down || failure.is_silence() {
            // Before it is given up, each of its blocks is asked for.
            let tried = if self.down { self.backoff.fail() } else { TRIED_AGAIN };
            let wait = match failure {
                Failure::OfGateway => tried.min((spent * COST_SHARE).max(TRIED_AGAIN)),
                Failure::Silence | Failure::Corrupt | Failure::Hangup | Failure::Doubt => tried,
            };
            let has_answered = 0 < self.answers && self.failures <= IDLE_FAILURES;
            let idle_wait = wait.min(if has_answered { IDLE_WAIT } else { IDLE_WAIT_MAX });
            (self.probe_at, self.idle_at) = (Some(now + wait), now + idle_wait);
        }
        goes_down
    }

    /// It has answered, and few requests in a row have failed: its tries do not wait for a share of the line's time.
    pub fn is_trusted(&self) -> bool {
        0 < self.answers && self.failures < FAILURES_MAX
    }

    /// Requests in a row that have failed.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// It is asked again at once, and the waits between tries start from the shortest.
    pub fn retry(&mut self, now: Timestamp) {
        if self.probe_at.is_some() {
            self.backoff.reset();
            (self.probe_at, self.idle_at, self.prompt, self.thorough) = (Some(now), now, true, true);
        }
    }

    /// The slowest answer so far; `None` before the first.
    pub fn slowest(&self) -> Option<Duration> {
        (0 < self.answers).then_some(self.slowest)
    }

    /// As it is asked where the line has nothing else to do.
    pub fn for_idle_time(self) -> Health {
        Health { short: true, ..self }
    }

    fn waits_whole(&self) -> bool {
        !self.short && (self.thorough || WHOLE_TIMEOUT_EVERY <= self.short_tries + 1)
    }

    /// How long an answer is waited for (real time), at most the timeout of the line. One that has never answered is waited
    /// for so long once; then as if it were as slow as the slowest `neighbour` that answers, if there is one.
    pub fn response_timeout(&self, patience: Patience, neighbour: impl FnOnce() -> Option<Duration>) -> Duration {
        let Patience { timeout, least, .. } = patience;
        let slowest = match self.answers {
            0 if 0 < self.failures => neighbour().map(|neighbour| neighbour.max(self.slowest)),
            ANSWERS_MIN.. => Some(self.slowest),
            _ => None,
        };
        match slowest {
            Some(slowest) if !self.waits_whole() => slowest.saturating_mul(SLOWER_MAX).max(least).min(timeout),
            _ => timeout,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quick_answers_do_not_shorten_the_wait_for_the_slowest() {
        let millis = Duration::from_millis;
        let mut health = Health::new(DeviceId(0), Timestamp::UNIX_EPOCH);
        assert_eq!(health.slowest(), None);
        for time in [40, 300, 40, 120] {
            health.answered(Some(millis(time)));
        }
        health.answered(None);
        assert_eq!(health.slowest(), Some(millis(300)));
    }

    fn at(millis: i64) -> Timestamp {
        Timestamp::UNIX_EPOCH + jiff::SignedDuration::from_millis(millis)
    }

    /// A request that was sent so long before it failed.
    fn fails(health: &mut Health, failure: Failure, millis: i64) {
        let times = Failed { sent: at(millis - 10), spent: Duration::from_millis(10), now: at(millis) };
        health.failed(failure, times, 1, true);
    }

    #[test]
    fn a_quick_device_that_fails_has_the_whole_timeout_now_and_then() {
        let mut health = Health::new(DeviceId(0), at(0));
        for _ in 0..ANSWERS_MIN {
            health.answered(Some(Duration::from_millis(10)));
        }
        let waits = (1..=8).map(|number| {
            let waits = health.response_timeout(Patience::default(), || None).as_millis();
            fails(&mut health, Failure::Silence, 1_000 * number);
            waits
        });
        assert_eq!(waits.collect::<Vec<_>>(), [100, 100, 100, 1_000, 100, 100, 100, 1_000]);
    }

    #[test]
    fn one_that_has_answered_late_is_not_taken_for_its_neighbour() {
        let mut health = Health::new(DeviceId(0), at(0));
        let waits = |health: &Health| {
            health.response_timeout(Patience::default(), || Some(Duration::from_millis(50))).as_millis()
        };
        assert_eq!(waits(&health), 1_000, "it has never been asked");
        fails(&mut health, Failure::Silence, 1_000);
        assert_eq!(waits(&health), 200);
        health.answered_late(at(1_500));
        fails(&mut health, Failure::Silence, 3_000);
        assert_eq!(waits(&health), 1_000);
    }

    #[test]
    fn doubts_of_one_cause_count_once() {
        let mut health = Health::new(DeviceId(0), at(0));
        let failures = [1_000, 1_500, 1_900, 2_000].map(|millis| {
            fails(&mut health, Failure::Doubt, millis);
            health.failures()
        });
        assert_eq!(failures, [1, 1, 1, 2]);
    }
}
