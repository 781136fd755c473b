//! How long to wait before the next try: 1, 2, 5, 10, then 30 seconds for ever; a port that was pulled is looked for more often.

use std::time::Duration;

const STEPS_S: [u64; 5] = [1, 2, 5, 10, 30];

/// Counts tries in vain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Backoff {
    failures: usize,
    cap: Duration,
}

impl Default for Backoff {
    /// For devices: asking one that is dead costs the others a timeout.
    fn default() -> Self {
        Backoff { failures: 0, cap: Duration::from_secs(30) }
    }
}

impl Backoff {
    /// For ports and connections: trying is cheap, and an operator waits for the cable.
    pub fn for_ports() -> Backoff {
        Backoff { failures: 0, cap: Duration::from_secs(5) }
    }

    /// One more try in vain: how long to wait now.
    pub fn fail(&mut self) -> Duration {
        let step = STEPS_S[self.failures.min(STEPS_S.len() - 1)];
        self.failures = self.failures.saturating_add(1);
        Duration::from_secs(step).min(self.cap)
    }

    /// It worked: the next failure starts from the beginning.
    pub fn reset(&mut self) {
        self.failures = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_to_thirty_seconds_and_stay_there() {
        let mut backoff = Backoff::default();
        let waits: Vec<u64> = (0..8).map(|_| backoff.fail().as_secs()).collect();
        assert_eq!(waits, [1, 2, 5, 10, 30, 30, 30, 30]);
        backoff.reset();
        assert_eq!(backoff.fail(), Duration::from_secs(1));
        let mut port = Backoff::for_ports();
        assert_eq!((0..5).map(|_| port.fail().as_secs()).collect::<Vec<_>>(), [1, 2, 5, 5, 5]);
    }
}
