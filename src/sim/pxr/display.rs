//! How temperatures stand in registers: unit (41017) and decimals (41020), neither of which travels with the number.

use crate::plant::number::{to_i16, to_u8};

/// Unit and decimals of every temperature in the registers. Inside, everything is °C.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Display {
    /// Digits behind the point, 0–2.
    pub decimals: u8,
    /// °F instead of °C.
    pub fahrenheit: bool,
}

impl Display {
    /// From the words of 41017 and 41020.
    pub fn new(unit: i16, decimals: i16) -> Display {
        Display { decimals: to_u8(decimals.clamp(0, 2)), fahrenheit: unit == 1 }
    }

    /// A temperature as it stands in a register; one that does not fit stands at the end of the 16 bits.
    pub fn temperature(self, c: f64) -> i16 {
        to_i16(self.raw(if self.fahrenheit { c * 1.8 + 32.0 } else { c }).round())
    }

    /// The temperature in °C that a register holds.
    pub fn temperature_c(self, raw: i16) -> f64 {
        let shown = f64::from(raw) / self.per_unit();
        if self.fahrenheit { (shown - 32.0) / 1.8 } else { shown }
    }

    /// A difference of temperatures in K as it stands in a register.
    pub fn difference(self, k: f64) -> i16 {
        to_i16(self.raw(if self.fahrenheit { k * 1.8 } else { k }).round())
    }

    /// The difference in K that a register holds.
    pub fn difference_k(self, raw: i16) -> f64 {
        let shown = f64::from(raw) / self.per_unit();
        if self.fahrenheit { shown / 1.8 } else { shown }
    }

    fn raw(self, shown: f64) -> f64 {
        shown * self.per_unit()
    }

    fn per_unit(self) -> f64 {
        [1.0, 10.0, 100.0][usize::from(self.decimals)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_stands_in_its_unit_with_its_decimals() {
        let check = |unit, decimals, c: f64, temperature, difference| {
            let display = Display::new(unit, decimals);
            assert_eq!((display.temperature(c), display.difference(c)), (temperature, difference), "{display:?}");
            let smallest = 1.0 / display.per_unit();
            assert!((display.temperature_c(temperature) - c).abs() < smallest);
            assert!((display.difference_k(difference) - c).abs() < smallest);
        };
        check(0, 0, 70.0, 70, 70);
        check(0, 1, 70.0, 700, 700);
        check(0, 2, -12.34, -1234, -1234);
        check(1, 0, 70.0, 158, 126);
        check(1, 1, 27.0, 806, 486);
        assert_eq!(Display::new(1, 2).temperature(194.25), i16::MAX);
    }
}
