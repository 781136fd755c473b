//! What a schedule knows of a device: whether it answers, how fast, and when it may be asked.
//!
//! ```text
//!             no answer               3 in a row (2 if it has never answered), or no time for a third try
//!   answering ─────────> failing ───────────────────────────────────────────────────────────> down
//!             <─────────         second try at once, third after 1 s: only its first block
//!               an answer                                                                   probed with that
//! ```

use std::time::Duration;

use jiff::Timestamp;

use crate::{
    bus::backoff::Backoff,
    plant::def::{DeviceId, LineDef},
};

/// Failures in a row after which a device that has answered before is given up and only probed.
pub const FAILURES_MAX: u32 = 3;
/// The same for one that has never answered: it may have lost its first frame, and has no values to lose.
const FIRST_FAILURES_MAX: u32 = 2;
/// After so many answers it is known how fast a device answers.
const ANSWERS_MIN: u32 = 32;
/// A device that has always answered faster is waited for so many times its slowest answer …
const SLOWER_MAX: u32 = 4;
/// … but not less than this: systems and adapters pause now and then …
const RESPONSE_TIMEOUT_MIN: Duration = Duration::from_millis(100);
/// … and what is lost on a network is sent again after 200 to 300 ms.
const NETWORK_RESPONSE_TIMEOUT_MIN: Duration = Duration::from_millis(500);
/// Every so many-th try in a row waits for the whole timeout: the device may have become slow.
const WHOLE_TIMEOUT_EVERY: u32 = 4;

/// A device without any result, not even a failure, is asked again after this time.
const TRIED_AGAIN: Duration = Duration::from_secs(1);

#[derive(Debug, Clone)]
pub(super) struct Health {
    pub device: DeviceId,
    failures: u32,
    down: bool,
    /// When the last failure was noticed.
    failed_at: Timestamp,
    backoff: Backoff,
    /// While it does not answer: when it is asked next.
    pub probe_at: Option<Timestamp>,
    /// The next try does not wait for its share of the line's time.
    pub prompt: bool,
    /// The next try waits for the whole timeout.
    thorough: bool,
    /// The poll that it is asked with while it does not answer: its first.
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
            prompt: false,
            thorough: false,
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
        (self.failures, self.probe_at, self.thorough) = (0, None, false);
        self.backoff.reset();
        std::mem::take(&mut self.down)
    }

    /// An answer came after it had been given up: from now on the device has the whole timeout.
    pub fn answered_late(&mut self) {
        self.slowest = Duration::MAX;
    }

    /// It was asked; the outcome follows, or never comes if nothing could be sent: then it is asked again after a while.
    pub fn tried(&mut self, now: Timestamp) {
        if let Some(probe_at) = &mut self.probe_at {
            (*probe_at, self.prompt) = (now + TRIED_AGAIN, false);
        }
    }

    /// It did not answer a request that was sent at `sent`; `affordable`: the line has time for another try. `true` if it is
    /// given up with this.
    pub fn failed(&mut self, sent: Timestamp, now: Timestamp, affordable: bool) -> bool {
        // What was under way when the last failure was noticed says nothing new.
        if 0 < self.failures && sent < self.failed_at {
            return false;
        }
        (self.failed_at, self.failures) = (now, self.failures.saturating_add(1));
        // One frame may have been lost.
        self.prompt = self.failures == 1;
        self.thorough = false;
        let tries = if self.answers == 0 { FIRST_FAILURES_MAX } else { FAILURES_MAX };
        let goes_down = !self.down && (tries <= self.failures || !(affordable || self.prompt));
        self.down |= goes_down;
        self.probe_at = Some(if self.prompt { now } else { now + self.backoff.fail() });
        goes_down
    }

    /// It is asked again at once, and the waits between tries start from the shortest.
    pub fn retry(&mut self, now: Timestamp) {
        if self.probe_at.is_some() {
            self.backoff.reset();
            (self.probe_at, self.prompt, self.thorough) = (Some(now), true, true);
        }
    }

    /// The slowest answer so far; `None` before the first.
    pub fn slowest(&self) -> Option<Duration> {
        (0 < self.answers).then_some(self.slowest)
    }

    /// How long an answer is waited for (real time), at most the timeout of the line. One that has never answered is waited
    /// for so long once; then as if it were as slow as the slowest `neighbour` that answers, if there is one.
    pub fn response_timeout(&self, line: &LineDef, neighbour: impl FnOnce() -> Option<Duration>) -> Duration {
        let timeout = line.timeout;
        let least = if line.transport.serial().is_some() { RESPONSE_TIMEOUT_MIN } else { NETWORK_RESPONSE_TIMEOUT_MIN };
        let whole = self.thorough || self.failures % WHOLE_TIMEOUT_EVERY == WHOLE_TIMEOUT_EVERY - 1;
        let slowest = match self.answers {
            0 if 0 < self.failures => neighbour().map(|neighbour| neighbour.max(self.slowest)),
            ANSWERS_MIN.. => Some(self.slowest),
            _ => None,
        };
        match slowest {
            Some(slowest) if !whole => slowest.saturating_mul(SLOWER_MAX).max(least).min(timeout),
            _ => timeout,
        }
    }
}
