//! States of lines and devices, and what a line counts.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};

use super::{line_trouble::LineTrouble, port_signals::PortSignals};

/// Whether a device answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum DeviceState {
    /// Not asked yet.
    #[default]
    Unknown,
    /// Its last request was answered.
    Responding,
    /// The last `n` requests failed, not enough to give it up.
    Failing(u32),
    /// Given up, probed now and then.
    Down {
        /// Since when.
        since: Timestamp,
    },
}

/// State of a line. A wait names its end, so that a screen can count down.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum LineState {
    /// The port or connection is being opened.
    #[default]
    Connecting,
    /// Requests are running.
    Connected,
    /// It went away or would not open; the next try is at `retry_at`.
    Waiting {
        /// Why.
        why: LineTrouble,
        /// When it is tried again.
        retry_at: Timestamp,
    },
    /// Closed by an operator.
    Disconnected,
    /// An exclusive diagnostic: no device is polled.
    Testing,
    /// The line of another master is open, and no frame is heard on it.
    NoTraffic,
}

/// Errors that the driver of a serial port has counted since the port was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct UartCounters {
    /// Characters whose parity bit did not fit.
    pub parity: u32,
    /// Characters without their stop bit.
    pub framing: u32,
    /// Characters lost because they were not fetched in time.
    pub overrun: u32,
    /// Breaks: the line held low for longer than a character.
    pub breaks: u32,
}

/// Counters of a line since the start of the station.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LineCounters {
    /// Requests sent.
    pub requests: u64,
    /// Valid normal answers.
    pub ok: u64,
    /// No answer in time.
    pub timeouts: u64,
    /// Corrupt answers.
    pub corrupt: u64,
    /// Exception answers.
    pub exceptions: u64,
    /// Frames or bytes without an outstanding request.
    pub unexpected: u64,
    /// Of these, answers to requests that had been given up.
    pub late: u64,
    /// Frames sent and received, and runs of bytes that were none.
    pub frames: u64,
    /// What the serial port itself has counted, where it does.
    pub uart: Option<UartCounters>,
    /// The signals of the serial port, where it has any.
    pub signals: Option<PortSignals>,
    /// The adapter gives back what it sends (its receiver stays on while it sends).
    pub echoes: bool,
    /// Times the port or connection was opened.
    pub opens: u64,
    /// Polls that could not start in their period and were skipped.
    pub missed: u64,
    /// Bytes sent.
    pub sent_bytes: u64,
    /// Bytes received.
    pub received_bytes: u64,
    /// Share of the last ten seconds in which the line was busy, 0–1.
    pub utilisation: f32,
    /// The same over the last minute.
    pub utilisation_minute: f32,
    /// Last byte sent.
    pub last_tx: Option<Timestamp>,
    /// Last byte received.
    pub last_rx: Option<Timestamp>,
}
