//! How many requests a unit takes at once over Modbus TCP: stepped down where it drops or refuses what is more than it can queue.

use std::collections::BTreeMap;

use crate::plant::line_finding::DeviceFinding;

/// Requests after which their fate is looked at …
const WINDOW: u32 = 40;
/// … and what share of them, one in this many, may be lost as frames are.
const LOST_SHARE: u32 = 10;

/// What was learned of the units of a line.
#[derive(Debug, Clone, Default)]
pub struct InFlight {
    units: BTreeMap<u8, Queue>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Queue {
    /// As found; `None`: as the plant file says.
    most: Option<u16>,
    sent: u32,
    lost: u32,
}

impl InFlight {
    /// How many requests may be under way to a unit of which the plant file says `stated`.
    pub fn limit(&self, unit: u8, stated: u16) -> u16 {
        self.found(unit).map_or(stated, |most| most.min(stated)).max(1)
    }

    /// Less than the plant file says, if that was found.
    pub fn found(&self, unit: u8) -> Option<u16> {
        self.units.get(&unit)?.most
    }

    /// A request has ended that was sent with `beside` others under way; `lost`: without an answer although its block has been
    /// answered before. The new limit, if there is one: half of what was too much.
    pub fn on_end(&mut self, unit: u8, stated: u16, beside: usize, lost: bool) -> Option<u16> {
        let limit = self.limit(unit, stated);
        let queue = self.units.entry(unit).or_default();
        if beside == 0 {
            return None;
        }
        (queue.sent, queue.lost) = (queue.sent + 1, queue.lost + u32::from(lost));
        let too_many = WINDOW / LOST_SHARE < queue.lost;
        if queue.sent < WINDOW && !too_many {
            return None;
        }
        (queue.sent, queue.lost) = (0, 0);
        too_many.then(|| self.step_down(unit, limit))
    }

    /// Remembers what was found of a unit earlier.
    pub fn recall(&mut self, unit: u8, found: DeviceFinding) {
        if let DeviceFinding::InFlight { most, .. } = found {
            self.units.entry(unit).or_default().most = Some(most.max(1));
        }
    }

    /// A unit may be another one: what was found of it no longer holds.
    pub fn forget(&mut self, unit: u8) {
        self.units.remove(&unit);
    }

    /// How many under way were too many.
    pub fn step_down(&mut self, unit: u8, together: u16) -> u16 {
        let queue = self.units.entry(unit).or_default();
        let most = (queue.most.unwrap_or(together).min(together) / 2).max(1);
        queue.most = Some(most);
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends in flights to a unit that drops what is more than it queues; gives the limit that is left.
    fn settle(queues: usize, loses_one_in: usize) -> u16 {
        let mut in_flight = InFlight::default();
        for n in 0..10_000 {
            let limit = usize::from(in_flight.limit(1, 16));
            let beside = n % limit;
            let lost = queues <= beside || n % loses_one_in == 0;
            in_flight.on_end(1, 16, beside, lost);
        }
        in_flight.limit(1, 16)
    }

    #[test]
    fn a_unit_that_queues_few_gets_few() {
        assert_eq!(settle(4, 50), 4, "of sixteen");
        assert_eq!(settle(1, 50), 1);
        assert_eq!(settle(16, 50), 16, "two frames in a hundred are lost");
    }

    #[test]
    fn what_ended_a_connection_is_halved() {
        let mut in_flight = InFlight::default();
        assert_eq!(in_flight.limit(1, 1), 1);
        assert_eq!(in_flight.step_down(1, 16), 8);
        assert_eq!((in_flight.step_down(1, 8), in_flight.found(1), in_flight.found(2)), (4, Some(4), None));
    }

    #[test]
    fn what_was_found_earlier_holds_and_is_never_none_at_all() {
        let mut in_flight = InFlight::default();
        in_flight.recall(1, DeviceFinding::InFlight { most: 3, stated: 8 });
        in_flight.recall(2, DeviceFinding::InFlight { most: 0, stated: 8 });
        assert_eq!([1, 2, 3].map(|unit| in_flight.found(unit)), [Some(3), Some(1), None]);
        assert_eq!([1, 2, 3].map(|unit| in_flight.limit(unit, 8)), [3, 1, 8]);
    }
}
