//! The sequence of a batch: fill, heat, hold, drain, cool, return, and again.

use std::time::Duration;

use super::Outputs;
use crate::{plant::number::to_u16, sim::tank::Readings};

/// A tank counts as empty below this volume, in litres.
const EMPTY_L: f64 = 0.05;
/// The same for TK-1, as a level in cm.
const EMPTY_CM: f64 = 0.1;
/// Steps that last a fixed time.
const HOLD: Duration = Duration::from_secs(180);
const COOL: Duration = Duration::from_secs(60);

/// Where the batch is; the numbers stand in V2000.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Step {
    /// 0: stopped.
    #[default]
    Idle,
    /// 1: TK-2 fills TK-1.
    Fill,
    /// 2: agitate and heat until PV is at SV.
    Heat,
    /// 3: hold it there.
    Hold,
    /// 4: TK-1 empties into TK-3.
    Drain,
    /// 5: the hot water rests.
    Cool,
    /// 6: the pump returns it to TK-2.
    Return,
}

impl Step {
    /// The number in V2000.
    pub fn number(self) -> u8 {
        match self {
            Step::Idle => 0,
            Step::Fill => 1,
            Step::Heat => 2,
            Step::Hold => 3,
            Step::Drain => 4,
            Step::Cool => 5,
            Step::Return => 6,
        }
    }

    fn next(self) -> Step {
        match self {
            Step::Idle | Step::Return => Step::Fill,
            Step::Fill => Step::Heat,
            Step::Heat => Step::Hold,
            Step::Hold => Step::Drain,
            Step::Drain => Step::Cool,
            Step::Cool => Step::Return,
        }
    }

    /// The time after which a step that waits for the plant has failed.
    fn longest(self) -> Duration {
        match self {
            Step::Idle | Step::Hold | Step::Cool => Duration::MAX,
            Step::Return => Duration::from_mins(20),
            // Twenty litres take four times as long as five.
            Step::Fill | Step::Drain => Duration::from_mins(40),
            Step::Heat => Duration::from_mins(90),
        }
    }
}

/// What the sequence waits for.
#[derive(Debug, Clone, Copy)]
pub struct Conditions<'a> {
    /// The controller's signal.
    pub at_sv: bool,
    /// The level of TK-1 that the batch is filled to, in cm.
    pub fill_cm: f64,
    /// The instruments.
    pub readings: &'a Readings,
}

/// The state of the sequence.
#[derive(Debug, Clone, Default)]
pub struct Sequence {
    step: Step,
    in_step: Duration,
    batches: u16,
    fault: bool,
}

impl Sequence {
    /// One scan while running in automatic.
    pub fn advance(&mut self, dt: Duration, conditions: &Conditions) {
        if self.fault {
            return;
        }
        self.in_step += dt;
        if self.done(conditions) {
            self.batches = if self.step == Step::Return { (self.batches + 1) % 10_000 } else { self.batches };
            self.step = self.step.next();
            self.in_step = Duration::ZERO;
        }
        self.fault = self.in_step > self.step.longest();
    }

    /// Back to idle; the fault is cleared, the count of batches stays.
    pub fn stop(&mut self) {
        *self = Sequence { batches: self.batches, ..Sequence::default() };
    }

    /// What the step turns on; nothing after a fault.
    pub fn outputs(&self) -> Outputs {
        let off = Outputs::default();
        if self.fault {
            return off;
        }
        match self.step {
            Step::Idle | Step::Cool => off,
            Step::Fill => Outputs { fill_valve: true, ..off },
            Step::Heat | Step::Hold => Outputs { agitator: true, heater: true, ..off },
            Step::Drain => Outputs { drain_valve: true, ..off },
            Step::Return => Outputs { pump: true, ..off },
        }
    }

    /// Where the batch is.
    pub fn step(&self) -> Step {
        self.step
    }

    /// Whether a step took too long; stop clears it.
    pub fn fault(&self) -> bool {
        self.fault
    }

    /// Batches done, 0–9999 and round again.
    pub fn batches(&self) -> u16 {
        self.batches
    }

    /// Seconds left in a timed step; 0 in a step that waits for the plant.
    pub fn seconds_left(&self) -> u16 {
        let length = match self.step {
            Step::Hold => HOLD,
            Step::Cool => COOL,
            Step::Idle | Step::Fill | Step::Heat | Step::Drain | Step::Return => Duration::ZERO,
        };
        to_u16(length.saturating_sub(self.in_step).as_secs_f64().ceil())
    }

    fn done(&self, conditions: &Conditions) -> bool {
        let readings = conditions.readings;
        match self.step {
            Step::Idle => true,
            // Within a tenth of a millimetre; and a batch can have no more water than there is.
            Step::Fill => readings.level_cm >= conditions.fill_cm - 0.01 || readings.cold_l <= EMPTY_L,
            Step::Heat => conditions.at_sv,
            Step::Hold => self.in_step >= HOLD,
            Step::Drain => readings.level_cm <= EMPTY_CM,
            Step::Cool => self.in_step >= COOL,
            Step::Return => readings.hot_l <= EMPTY_L || readings.cold_full,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF_FULL: Readings = Readings {
        level_cm: 10.2,
        cold_l: 15.0,
        hot_l: 5.0,
        cold_full: false,
        flow_in: 0.0,
        flow_out: 0.0,
        flow_pump: 0.0,
        heater_w: 0.0,
    };

    fn wait(sequence: &mut Sequence, seconds: f64, at_sv: bool, readings: Readings) -> Step {
        for _ in 0..(seconds / 0.1).round() as usize {
            sequence.advance(Duration::from_millis(100), &Conditions { at_sv, fill_cm: 10.19, readings: &readings });
        }
        sequence.step()
    }

    #[test]
    fn each_step_waits_for_its_condition() {
        let batch = &mut Sequence::default();
        let low = Readings { level_cm: 1.0, ..HALF_FULL };
        assert_eq!(wait(batch, 60.0, false, low), Step::Fill);
        assert_eq!(wait(batch, 0.1, false, HALF_FULL), Step::Heat);
        assert_eq!(wait(batch, 600.0, false, HALF_FULL), Step::Heat);
        assert_eq!(wait(batch, 0.1, true, HALF_FULL), Step::Hold);
        assert_eq!(wait(batch, 100.0, true, HALF_FULL), Step::Hold);
        assert_eq!(batch.seconds_left(), 80);
        // A disturbance does not restart the hold.
        assert_eq!(wait(batch, 80.5, false, HALF_FULL), Step::Drain);
        assert_eq!(wait(batch, 0.1, false, Readings { level_cm: 0.05, ..HALF_FULL }), Step::Cool);
        assert_eq!(wait(batch, 60.5, false, HALF_FULL), Step::Return);
        assert_eq!(batch.batches(), 0);
        assert_eq!(wait(batch, 0.1, false, Readings { hot_l: 0.0, ..low }), Step::Fill);
        assert_eq!(batch.batches(), 1);
    }

    #[test]
    fn a_step_that_never_ends_is_a_fault_until_stopped() {
        let batch = &mut Sequence::default();
        let empty = Readings { level_cm: 1.0, ..HALF_FULL };
        assert_eq!(wait(batch, 2401.0, false, empty), Step::Fill);
        assert!(batch.fault());
        assert_eq!(batch.outputs(), Outputs::default());
        assert_eq!(wait(batch, 10.0, false, HALF_FULL), Step::Fill);
        batch.stop();
        assert!(!batch.fault());
        assert_eq!(wait(batch, 0.2, false, empty), Step::Fill);
        assert!(batch.outputs().fill_valve);
    }
}
