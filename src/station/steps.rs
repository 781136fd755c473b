//! What operators have done with alarms, on its way into the store: no snapshot shows it as done before it is there.

use std::time::Duration;

use tokio::{sync::watch, time::Instant};

/// A snapshot waits so long for the store.
const WAIT_MAX: Duration = Duration::from_secs(1);

/// The steps that were sent, held against those that the store has.
#[derive(Debug)]
pub struct Steps {
    settled: watch::Receiver<u64>,
    sent: u64,
    /// Since when the store is behind.
    behind: Instant,
}

impl Steps {
    /// None sent yet; the store says how many are settled.
    pub fn new(settled: watch::Receiver<u64>) -> Steps {
        Steps { settled, sent: 0, behind: Instant::now() }
    }

    /// So many were sent.
    pub fn sent(&mut self, steps: u64) {
        if *self.settled.borrow() == self.sent {
            self.behind = Instant::now();
        }
        self.sent += steps;
    }

    /// When a snapshot may go out that could have gone at `next`: not before the store has what it shows, but in time.
    pub fn due(&self, next: Instant) -> Instant {
        // A thread that has ended will never store anything any more.
        let alive = self.settled.has_changed().is_ok();
        if alive && *self.settled.borrow() < self.sent { next.max(self.behind + WAIT_MAX) } else { next }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_snapshot_waits_for_the_store_but_not_for_ever_and_not_for_one_that_has_ended() {
        let (store, settled) = watch::channel(0);
        let mut steps = Steps::new(settled);
        let next = Instant::now();
        steps.sent(0);
        assert_eq!(steps.due(next), next, "no operator has done anything");
        steps.sent(2);
        let late = next + Duration::from_secs(2);
        assert!(next + WAIT_MAX <= steps.due(next) && steps.due(late) == late);
        store.send_replace(2);
        assert_eq!(steps.due(next), next);
        steps.sent(1);
        drop(store);
        assert_eq!(steps.due(next), next);
    }
}
