//! What a schedule knows of a device: whether it answers, and when it may be asked.

use jiff::Timestamp;

use crate::{bus::backoff::Backoff, plant::def::DeviceId};

/// Failures in a row after which a device is given up and only probed.
pub const FAILURES_MAX: u32 = 3;

#[derive(Debug, Clone)]
pub(super) struct Health {
    pub device: DeviceId,
    failures: u32,
    backoff: Backoff,
    /// While the device is down: when it is probed next.
    pub probe_at: Option<Timestamp>,
    /// The poll that it is probed with: its first.
    pub probe: Option<usize>,
    /// Not to be asked before this moment.
    pub rests_until: Timestamp,
}

impl Health {
    pub fn new(device: DeviceId, now: Timestamp) -> Health {
        Health { device, failures: 0, backoff: Backoff::default(), probe_at: None, probe: None, rests_until: now }
    }

    /// It lives. `true` if it was given up before.
    pub fn answered(&mut self) -> bool {
        self.failures = 0;
        self.backoff.reset();
        self.probe_at.take().is_some()
    }

    /// It did not answer. `true` if it is given up with this.
    pub fn failed(&mut self, now: Timestamp) -> bool {
        self.failures = self.failures.saturating_add(1);
        // What was under way when it was given up says nothing new.
        if self.failures < FAILURES_MAX || self.probe_at.is_some_and(|probe_at| now < probe_at) {
            return false;
        }
        let goes_down = self.probe_at.is_none();
        self.probe_at = Some(now + self.backoff.fail());
        goes_down
    }
}
