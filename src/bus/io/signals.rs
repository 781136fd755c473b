//! The signals of a serial port beside its data: what the adapter sets, and what it sees.

use std::io;

use tokio_serial::{SerialPort, SerialStream};

use super::{
    transport::serial_stream,
    uart::{self, PortWatch},
};
use crate::plant::{line::Serial, line_state::UartCounters, line_trouble::LineTrouble, port_signals::PortSignals};

/// A port whose signals are set and read.
pub struct SignalPort {
    port: SerialStream,
    watch: Option<PortWatch>,
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

impl SignalPort {
    /// Opens the port; the system raises RTS and DTR with that.
    pub fn open(path: &str, serial: Serial) -> Result<SignalPort, LineTrouble> {
        let port = serial_stream(path, serial)?;
        let watch = PortWatch::new(&port);
        Ok(SignalPort { port, watch })
    }

    /// How the signals stand; `None` for a port that has none: a pseudo-terminal, or a driver without them.
    pub fn read(&self) -> Option<PortSignals> {
        self.watch.as_ref()?.signals()
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
        self.watch.as_ref()?.counters()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
