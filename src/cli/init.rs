//! Notifies the init system: ready, reloading, stopping, alive. Without one this does nothing.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

use crate::{plant::Snapshot, station::liveness::Liveness};

/// The station polls and its socket is open.
pub fn ready(title: &str) {
    notify(&[NotifyState::Ready, NotifyState::Status(title)]);
}

/// The plant file is being reloaded.
pub fn reloading() {
    let states = [Some(NotifyState::Reloading), NotifyState::monotonic_usec_now().ok()];
    notify(&states.into_iter().flatten().collect::<Vec<_>>());
}

/// The orderly end has begun.
pub fn stopping() {
    notify(&[NotifyState::Stopping]);
}

fn notify(states: &[NotifyState]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::warn!(%error, "cannot notify the init system");
    }
}

/// Feeds the watchdog with what the lines report.
pub struct Watchdog {
    /// Half of what the init system waits for; `None` without a watchdog.
    every: Option<Duration>,
    began: Instant,
    fed_at: Option<Instant>,
    liveness: Liveness,
}

impl Watchdog {
    /// Not fed yet.
    pub fn new() -> Watchdog {
        let every = sd_notify::watchdog_enabled().map(|span| span / 2);
        Watchdog { every, began: Instant::now(), fed_at: None, liveness: Liveness::default() }
    }

    /// A snapshot has come: if every line that is connected still reports, the station is alive.
    pub fn see(&mut self, snapshot: &Snapshot) {
        let Some(every) = self.every else { return };
        let alive = self.liveness.check(snapshot, self.began.elapsed());
        if alive && self.fed_at.is_none_or(|at| every / 2 <= at.elapsed()) {
            self.fed_at = Some(Instant::now());
            notify(&[NotifyState::Watchdog]);
        }
    }
}
