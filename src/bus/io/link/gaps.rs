//! Units that are left alone for a while: after a write, or after each exchange because they hear nothing sooner.

use std::time::Duration;

use tokio::time::Instant;

use super::Link;
use crate::plant::fault::Fault;

impl Link {
    /// Nothing is sent to a unit for this long (plant time).
    pub fn set_unit_gap(&mut self, unit: u8, plant: Duration) {
        self.leave_alone(unit, self.wire.clock().real_span(plant));
    }

    /// The same in real time. A longer gap that it is kept in stays.
    fn leave_alone(&mut self, unit: u8, real: Duration) {
        let now = Instant::now();
        let until = self.gap_of(unit).unwrap_or(now).max(now + real);
        self.gaps.retain(|(other, until)| *other != unit && now < *until);
        self.gaps.push((unit, until));
    }

    /// A unit wants this gap (plant time) between two requests.
    pub fn state_request_gap(&mut self, unit: u8, plant: Duration) {
        let real = self.wire.clock().real_span(plant);
        self.wire.request_gaps.state(unit, real);
    }

    /// The gap between two requests of a unit (plant time), as stated or as found.
    pub fn request_gap(&self, unit: u8) -> Duration {
        self.wire.clock().plant_span(self.wire.request_gaps.of(unit))
    }

    /// An exchange has ended: the gap of its unit begins, and whether it is long enough shows in time.
    pub(super) fn keep_request_gap<T>(&mut self, message: &[u8], sent_at: Instant, answer: &Result<T, Fault>) {
        let Some(&unit) = message.first().filter(|unit| !self.framing().is_broadcast(**unit)) else { return };
        let now = self.wire.uptime();
        let sent = now.saturating_sub(sent_at.elapsed());
        match answer {
            Err(Fault::Timeout) => {
                if let Some(gap) = self.wire.request_gaps.on_silence(unit, sent) {
                    tracing::warn!(unit, ?gap, "requests soon after a response are lost: a gap is kept");
                    self.allow(unit, 1);
                }
            }
            Ok(_) | Err(_) => self.wire.request_gaps.on_answer(unit, sent, now),
        }
        let gap = self.wire.request_gaps.of(unit);
        if !gap.is_zero() {
            self.leave_alone(unit, gap);
        }
    }

    /// What is sent next waits for the end of its unit's gap.
    pub(super) fn keep_gap(&mut self, unit: Option<u8>) {
        if let Some(until) = unit.and_then(|unit| self.gap_of(unit)) {
            self.wire.hold_off(until.saturating_duration_since(Instant::now()));
        }
    }

    /// The end of the gap that a unit is kept in now.
    pub(super) fn gap_of(&self, unit: u8) -> Option<Instant> {
        let now = Instant::now();
        self.gaps.iter().find(|(resting, until)| *resting == unit && now < *until).map(|(_, until)| *until)
    }

    /// What is left of the gap that a unit is kept in (plant time).
    pub fn gap_left(&self, unit: u8) -> Option<Duration> {
        let left = self.gap_of(unit)?.saturating_duration_since(Instant::now());
        Some(self.wire.clock().plant_span(left))
    }
}
