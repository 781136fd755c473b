//! The signals of a serial port beside its data: what the adapter sets, and what it sees.

use std::{fmt, io};

use tokio_serial::{SerialPort, SerialStream};

use super::{
    transport::{CountUart, serial_stream},
    uart,
};
use crate::plant::{event::UartCounters, line::Serial};

/// A port whose signals are set and read.
pub struct SignalPort {
    port: SerialStream,
    uart: Option<CountUart>,
}

/// Which signal is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Request to send.
    Rts,
    /// Data terminal ready.
    Dtr,
    /// The data line held low for a quarter of a second.
    Break,
}

/// All signals: outputs, then inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signals {
    bits: u32,
}

/// Name and bit of each (linux/termios.h).
const NAMES: [(&str, u32); 6] =
    [("RTS", 0x004), ("DTR", 0x002), ("CTS", 0x020), ("DSR", 0x100), ("DCD", 0x040), ("RI", 0x080)];

impl SignalPort {
    /// Opens the port; the system raises RTS and DTR with that. The error is in words for an operator.
    pub fn open(path: &str, serial: Serial) -> Result<SignalPort, String> {
        let port = serial_stream(path, serial)?;
        let uart = uart::counter(&port);
        Ok(SignalPort { port, uart })
    }

    /// How the signals stand; `None` for a port that has none: a pseudo-terminal, or a driver without them.
    pub fn read(&self) -> Option<Signals> {
        uart::signals(&self.port).map(|bits| Signals { bits })
    }

    /// Sets a signal.
    pub fn set(&mut self, signal: Signal, on: bool) -> io::Result<()> {
        let set = match signal {
            Signal::Rts => self.port.write_request_to_send(on),
            Signal::Dtr => self.port.write_data_terminal_ready(on),
            Signal::Break => return uart::send_break(&self.port),
        };
        set.map_err(io::Error::from)
    }

    /// What the driver has counted since the port was opened; `None` where it does not count.
    pub fn uart(&self) -> Option<UartCounters> {
        self.uart.as_ref().and_then(|uart| uart())
    }
}

/// `RTS on  DTR on   CTS off  DSR off  DCD off  RI off`.
impl fmt::Display for Signals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = |(name, bit): (&str, u32)| format!("{name} {}", if self.bits & bit == 0 { "off" } else { "on" });
        let words = NAMES.map(state);
        write!(f, "{}   {}", words[..2].join("  "), words[2..].join("  "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_signal_has_its_bit() {
        let shown = |bits| Signals { bits }.to_string();
        assert_eq!(shown(0x006), "RTS on  DTR on   CTS off  DSR off  DCD off  RI off");
        assert_eq!(shown(0x020), "RTS off  DTR off   CTS on  DSR off  DCD off  RI off");
        assert_eq!(shown(0x1C0), "RTS off  DTR off   CTS off  DSR on  DCD on  RI on");
    }

    #[tokio::test]
    async fn a_pseudo_terminal_has_no_signals_and_no_counters() {
        let (_master, slave) = SerialStream::pair().expect("a pseudo-terminal is free");
        let path = slave.name().expect("it has a name");
        drop(slave);
        let mut port = SignalPort::open(&path, Serial::USUAL).expect("it opens");
        assert_eq!((port.read(), port.uart()), (None, None));
        assert!(port.set(Signal::Rts, false).is_err());
    }
}
