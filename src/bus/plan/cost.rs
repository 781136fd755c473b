//! What a read costs on its line: characters, silences and gaps on a serial port, a round trip over TCP.

use std::time::Duration;

use super::Block;
use crate::plant::{
    def::{DeviceDef, Framing, LineDef, Transport},
    device_time::DeviceTime,
    tag::Table,
};

/// What a transaction over TCP costs beside its bytes: an estimate for a switched network and a device that answers in its
/// next scan. Only its size against [`TCP_BYTE`] matters for the plan: requests are dear, registers cheap.
pub const TCP_ROUND_TRIP: Duration = Duration::from_millis(1);
/// A byte at 100 Mbit/s. What a serial line behind a gateway adds is not known here.
pub const TCP_BYTE: Duration = Duration::from_nanos(80);
/// How often a read is repeated after a timeout before the schedule goes on: the next period asks again, others come first.
pub const RETRIES: u32 = 0;

/// Bytes of the request message: unit, function, address, count.
const REQUEST: u32 = 6;
/// Bytes of an answer message without its data: unit, function, byte count.
const ANSWER: u32 = 3;

/// What reads of one device cost on its line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wire {
    /// The request on the wire.
    pub request: Duration,
    /// Between the last byte of the request and the first of the answer, with a device that takes no time.
    pub turnaround: Duration,
    /// An answer without data.
    pub answer: Duration,
    /// One byte of data.
    pub byte: Duration,
    /// Silence that is kept after the answer.
    pub silent_interval: Duration,
}

impl Wire {
    /// Modbus over serial line V1.02: 2.5.1 (RTU: two bytes of CRC, silences of 3.5 characters), 2.5.2 (ASCII: `:`, two
    /// characters a byte with the LRC, CR LF, no silences); Modbus messaging on TCP/IP V1.0b, 3.1.3 (six bytes of header).
    pub fn new(line: &LineDef, device: &DeviceDef) -> Wire {
        let framing = line.transport.framing();
        let (fixed, per_byte) = match framing {
            Framing::Rtu => (2, 1),
            Framing::Ascii => (5, 2),
            Framing::Mbap => (6, 1),
        };
        let gap = line.gap.max(device.gap);
        let (character, turnaround, silent_interval) = match &line.transport {
            Transport::Serial { serial, .. } => match framing {
                Framing::Rtu | Framing::Mbap => {
                    (serial.char_time(), serial.silent_interval(), gap.max(serial.silent_interval()))
                }
                Framing::Ascii => (serial.char_time(), Duration::ZERO, gap),
            },
            Transport::Network { .. } => (TCP_BYTE, TCP_ROUND_TRIP, gap),
        };
        let frame = |message: u32| character * (fixed + per_byte * message);
        Wire { request: frame(REQUEST), turnaround, answer: frame(ANSWER), byte: character * per_byte, silent_interval }
    }

    /// The same with a device that takes its own time. The plan does not count it: it is the same for each request.
    pub fn with_device(self, time: DeviceTime) -> Wire {
        Wire { turnaround: self.turnaround.max(time.bound), ..self }
    }

    /// Request and answer of a read, without what lies between and behind them.
    pub fn frames(self, table: Table, count: u32) -> Duration {
        self.request + self.answer + self.byte * data_bytes(table, count)
    }

    /// A good read of a number of words of registers, or bits.
    pub fn read(self, table: Table, count: u32) -> Duration {
        self.frames(table, count) + self.turnaround + self.silent_interval
    }

    /// A read that is not answered, with all its retries.
    pub fn failing(self, timeout: Duration) -> Duration {
        (self.request + timeout + self.silent_interval) * (1 + RETRIES)
    }
}

/// Bytes of data in an answer.
pub fn data_bytes(table: Table, count: u32) -> u32 {
    if table.is_bits() { count.div_ceil(8) } else { 2 * count }
}

/// Worst time that a good read takes on its line, the device's own time, its gap and the silences included.
pub fn cost(block: &Block, line: &LineDef, device: &DeviceDef, time: DeviceTime) -> Duration {
    Wire::new(line, device).with_device(time).read(block.table, block.words())
}
