//! Another master on a line that this station polls: its requests are heard between ours.

use std::{collections::VecDeque, time::Duration};

use crate::plant::{line_finding::OtherMasterHeard, number::to_u32};

/// Requests are counted for so long; without any in this time it is gone.
const HEARD_FOR: Duration = Duration::from_secs(60);
/// One frame may be chance.
const REQUESTS_MIN: usize = 2;
/// More are not counted.
const REQUESTS_MAX: usize = 1_000;

/// What is heard of it. Times are spans since the line began.
#[derive(Debug, Clone, Default)]
pub struct OtherMaster {
    heard: VecDeque<Duration>,
    unit: u8,
    function: u8,
}

impl OtherMaster {
    /// A whole good request of it came.
    pub fn on_request(&mut self, message: &[u8], now: Duration) {
        let [unit, function, ..] = *message else { return };
        (self.unit, self.function) = (unit, function);
        if self.heard.len() == REQUESTS_MAX {
            self.heard.pop_front();
        }
        self.heard.push_back(now);
    }

    /// `None`: there is none, or it has not been heard for a minute.
    pub fn heard(&mut self, now: Duration) -> Option<OtherMasterHeard> {
        self.heard.retain(|at| now.saturating_sub(*at) < HEARD_FOR);
        let heard = OtherMasterHeard { unit: self.unit, function: self.function, requests: to_u32(self.heard.len()) };
        (REQUESTS_MIN <= self.heard.len()).then_some(heard)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_named_after_two_requests_and_gone_after_a_minute() {
        let (mut other, at) = (OtherMaster::default(), Duration::from_secs);
        other.on_request(&[7, 3, 0, 0, 0, 1], at(1));
        assert_eq!(other.heard(at(1)), None, "one frame may be chance");
        other.on_request(&[8, 4, 0, 0, 0, 1], at(2));
        assert_eq!(other.heard(at(2)), Some(OtherMasterHeard { unit: 8, function: 4, requests: 2 }));
        assert_eq!(other.heard(at(61)), None);
    }
}
