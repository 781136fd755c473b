//! The time that a line over Modbus TCP is busy.

use std::time::Duration;

use tokio::time::Instant;

use super::Link;

impl Link {
    /// Real time in which the line was busy since this was last asked.
    pub fn take_busy(&mut self) -> Duration {
        if let Some(since) = &mut self.transactions.busy_since {
            self.busy += since.elapsed();
            *since = Instant::now();
        }
        std::mem::take(&mut self.busy)
    }

    pub(super) fn close_busy(&mut self, now: Instant) {
        if self.transactions.under_way.is_empty()
            && let Some(since) = self.transactions.busy_since.take()
        {
            self.busy += now.saturating_duration_since(since);
        }
    }
}
