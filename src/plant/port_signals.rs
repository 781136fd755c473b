//! The signals of a serial port beside its data: how they stand, and the test that sets one of them.

use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use super::{
    keyword::keyword_enum,
    line::{LineDef, Rs485, Transport},
    number::to_u32,
};
use crate::t;

/// How they stand: outputs, then inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct PortSignals(pub u32);

/// Name and bit of each (linux/termios.h).
const NAMES: [(&str, u32); 6] =
    [("RTS", 0x004), ("DTR", 0x002), ("CTS", 0x020), ("DSR", 0x100), ("DCD", 0x040), ("RI", 0x080)];

keyword_enum! {
    /// A signal that the computer sets.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
    pub enum OutputSignal: "signal" {
        /// Request to send.
        Rts => "RTS",
        /// Data terminal ready.
        Dtr => "DTR",
    }
}

impl OutputSignal {
    /// Its bit.
    pub fn bit(self) -> u32 {
        match self {
            OutputSignal::Rts => 0x004,
            OutputSignal::Dtr => 0x002,
        }
    }
}

/// Sets a signal by hand for a time in which nothing else is sent, and puts it back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SignalTest {
    /// Which.
    pub signal: OutputSignal,
    /// Raised, or lowered.
    pub on: bool,
    /// For how long, in seconds: 1 to [`HOLD_MAX_S`].
    pub seconds: u16,
}

/// The longest that a signal is held: long enough for a meter, and the line is not polled meanwhile.
pub const HOLD_MAX_S: u16 = 60;
/// The other signals are looked at this often.
pub const LOOK: Duration = Duration::from_millis(250);

impl SignalTest {
    /// How often the signals are looked at.
    pub fn looks(&self) -> u32 {
        u32::from(self.seconds) * to_u32(Duration::from_secs(1).as_millis() / LOOK.as_millis())
    }

    /// Can it be done on this line? `Err` says why not.
    pub fn check_on(&self, line: &LineDef) -> Result<(), String> {
        match (&line.transport, self.signal) {
            (Transport::Network { .. }, _) => {
                Err(t!("a network has no RTS and DTR: this needs a serial line").to_owned())
            }
            (Transport::Serial { rs485: Rs485::RtsHigh | Rs485::RtsLow, .. }, OutputSignal::Rts) => {
                Err(t!("the driver switches RTS on this line (rs485 in the plant file): set DTR only").to_owned())
            }
            (Transport::Serial { .. }, _) => Ok(()),
        }
    }
}

/// `RTS on for 10 s`.
impl fmt::Display for SignalTest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (signal, seconds) = (self.signal.word(), self.seconds);
        f.write_str(&if self.on {
            t!("{signal} on for {seconds} s", signal, seconds)
        } else {
            t!("{signal} off for {seconds} s", signal, seconds)
        })
    }
}

impl PortSignals {
    /// Is the signal on?
    pub fn is_on(self, signal: OutputSignal) -> bool {
        self.0 & signal.bit() != 0
    }

    /// Each by its name: is it on?
    pub fn all(self) -> [(&'static str, bool); 6] {
        NAMES.map(|(name, bit)| (name, self.0 & bit != 0))
    }
}

/// `RTS on  DTR on   CTS off  DSR off  DCD off  RI off`.
impl fmt::Display for PortSignals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = self.all().map(|(name, on)| format!("{name} {}", if on { t!("on") } else { t!("off") }));
        write!(f, "{}   {}", words[..2].join("  "), words[2..].join("  "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{
        id::LineId,
        line::{Framing, Serial},
    };

    #[test]
    fn a_signal_is_set_only_where_it_can_be() {
        let on = |transport, signal| {
            let line = LineDef::new(LineId(0), "L1", transport);
            SignalTest { signal, on: true, seconds: 10 }.check_on(&line)
        };
        let serial = |rs485| Transport::Serial {
            port: "/dev/ttyS0".to_owned(),
            serial: Serial::USUAL,
            framing: Framing::Rtu,
            rs485,
        };
        assert_eq!(on(serial(Rs485::Off), OutputSignal::Rts), Ok(()));
        assert_eq!(on(serial(Rs485::RtsHigh), OutputSignal::Dtr), Ok(()));
        for rs485 in [Rs485::RtsHigh, Rs485::RtsLow] {
            let refused = on(serial(rs485), OutputSignal::Rts).expect_err("the driver has it");
            assert!(refused.starts_with("the driver switches RTS"), "{refused}");
        }
        for signal in OutputSignal::ALL {
            assert!(on(Transport::tcp("host", 502), signal).is_err());
            assert!(NAMES.contains(&(signal.word(), signal.bit())));
        }
    }

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
