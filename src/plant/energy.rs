//! Energy from power or from a counter of energy.

use serde::{Deserialize, Serialize};

/// The units that it can be computed from.
pub const UNITS: [&str; 7] = ["W", "kW", "MW", "Wh", "kWh", "MWh", "GWh"];

/// What a tag measures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Measures {
    /// Power; kilowatts in one of its unit.
    Power(f64),
    /// Energy that was counted; kilowatt hours in one of its unit.
    Energy(f64),
}

/// What a unit measures; `None` for every other than [`UNITS`].
pub fn of_unit(unit: &str) -> Option<Measures> {
    Some(match unit {
        "W" => Measures::Power(1e-3),
        "kW" => Measures::Power(1.0),
        "MW" => Measures::Power(1e3),
        "Wh" => Measures::Energy(1e-3),
        "kWh" => Measures::Energy(1.0),
        "MWh" => Measures::Energy(1e3),
        "GWh" => Measures::Energy(1e6),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_of_the_list_measures_power_or_energy() {
        assert!(UNITS.iter().all(|unit| of_unit(unit).is_some()));
        assert_eq!((of_unit("°C"), of_unit("kvarh")), (None, None));
    }
}
