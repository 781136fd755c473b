//! The signals of a serial port beside its data.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How they stand: outputs, then inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortSignals(pub u32);

/// Name and bit of each (linux/termios.h).
const NAMES: [(&str, u32); 6] =
    [("RTS", 0x004), ("DTR", 0x002), ("CTS", 0x020), ("DSR", 0x100), ("DCD", 0x040), ("RI", 0x080)];

impl PortSignals {
    /// Each by its name: is it on?
    pub fn all(self) -> [(&'static str, bool); 6] {
        NAMES.map(|(name, bit)| (name, self.0 & bit != 0))
    }
}

/// `RTS on  DTR on   CTS off  DSR off  DCD off  RI off`.
impl fmt::Display for PortSignals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = self.all().map(|(name, on)| format!("{name} {}", if on { "on" } else { "off" }));
        write!(f, "{}   {}", words[..2].join("  "), words[2..].join("  "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_signal_has_its_bit() {
        for (bits, shown) in [
            (0x006, "RTS on  DTR on   CTS off  DSR off  DCD off  RI off"),
            (0x020, "RTS off  DTR off   CTS on  DSR off  DCD off  RI off"),
            (0x1C0, "RTS off  DTR off   CTS off  DSR on  DCD on  RI on"),
        ] {
            assert_eq!(PortSignals(bits).to_string(), shown);
        }
    }
}
