//! Which parts of the process faults break.

use super::syntax::{InjectedFault, Position, Valve};
use crate::sim::process_faults::ProcessFaults;

/// The broken parts of the process among these faults.
pub fn process_faults(faults: impl Iterator<Item = InjectedFault>) -> ProcessFaults {
    let mut process_faults = ProcessFaults::default();
    for fault in faults {
        match fault {
            InjectedFault::HeaterBurnout => process_faults.heater = true,
            InjectedFault::PumpFailed => process_faults.pump = true,
            InjectedFault::AgitatorFailed => process_faults.agitator = true,
            InjectedFault::ValveStuck(Valve::Drain, position) => {
                process_faults.drain = Some(position == Position::Open)
            }
            InjectedFault::ValveStuck(Valve::Fill, position) => process_faults.fill = Some(position == Position::Open),
            InjectedFault::Leak(ml_per_min) => process_faults.leak_l_per_min = f64::from(ml_per_min) / 1e3,
            // The PLC sees to it.
            InjectedFault::Switch(_) => {}
            // Of the line or of a unit.
            InjectedFault::Noise(_)
            | InjectedFault::Silent
            | InjectedFault::Late(_)
            | InjectedFault::BadCrc
            | InjectedFault::Cut
            | InjectedFault::Exception(_)
            | InjectedFault::Stuck
            | InjectedFault::Torn
            | InjectedFault::WordOrder
            | InjectedFault::SensorBurnout => {}
        }
    }
    process_faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::tank::Actuators;

    const ALL_ON: Actuators =
        Actuators { pump: true, agitator: true, drain_valve: true, fill_valve: true, heater_percent: 80.0 };

    fn check(faults: &[&str], wanted: Actuators, expect: Actuators) {
        let faults = faults.iter().map(|text| text.parse().expect("a fault"));
        assert_eq!(process_faults(faults).apply(wanted), expect);
    }

    #[test]
    fn what_is_broken_does_not_follow_the_outputs() {
        let off = Actuators::default();
        check(&[], ALL_ON, ALL_ON);
        check(&["silent", "leak 2"], ALL_ON, ALL_ON);
        check(&["heater burnout"], ALL_ON, Actuators { heater_percent: 0.0, ..ALL_ON });
        check(&["pump failed", "agitator failed"], ALL_ON, Actuators { pump: false, agitator: false, ..ALL_ON });
        check(&["SV-1 stuck closed"], ALL_ON, Actuators { drain_valve: false, ..ALL_ON });
        check(&["SV-1 stuck open", "SV-2 stuck open"], off, Actuators { drain_valve: true, fill_valve: true, ..off });
        check(&["SV-2 stuck closed"], ALL_ON, Actuators { fill_valve: false, ..ALL_ON });
    }
}
