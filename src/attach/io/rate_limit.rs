//! Limits the rate of requests of one terminal, so that none fills the queue of all.

use std::time::Duration;

use tokio::time::{Instant, sleep_until};

/// Requests that may come at once.
const BURST: u32 = 64;
/// Time after which one more may come.
const EVERY: Duration = Duration::from_millis(20);

/// When the next request may be taken.
#[derive(Debug)]
pub struct RateLimit {
    /// The bucket is empty until then, and full [`BURST`] times [`EVERY`] later.
    free_at: Instant,
}

impl RateLimit {
    /// A terminal that has not asked yet.
    pub fn new() -> RateLimit {
        RateLimit { free_at: Instant::now() }
    }

    /// Waits until one more request may be taken.
    pub async fn acquire(&mut self) {
        let now = Instant::now();
        self.free_at = self.free_at.max(now) + EVERY;
        sleep_until(self.free_at.checked_sub(EVERY * BURST).unwrap_or(now)).await;
    }
}
