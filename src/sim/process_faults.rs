//! What broken parts of the process do between the outputs of PLC and controller and the water.

use super::tank::Actuators;

/// The parts that are broken now.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ProcessFaults {
    /// The heater stays cold.
    pub heater: bool,
    /// The pump stands.
    pub pump: bool,
    /// The agitator stands.
    pub agitator: bool,
    /// How the valve SV-1 is stuck: open or not.
    pub drain: Option<bool>,
    /// The same of SV-2.
    pub fill: Option<bool>,
    /// Water that TK-1 loses to the floor, in l/min.
    pub leak_l_per_min: f64,
}

impl ProcessFaults {
    /// What moves in the process for these outputs.
    pub fn apply(&self, wanted: Actuators) -> Actuators {
        Actuators {
            pump: wanted.pump && !self.pump,
            agitator: wanted.agitator && !self.agitator,
            drain_valve: self.drain.unwrap_or(wanted.drain_valve),
            fill_valve: self.fill.unwrap_or(wanted.fill_valve),
            heater_percent: if self.heater { 0.0 } else { wanted.heater_percent },
        }
    }
}
