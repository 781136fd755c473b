//! Why a request failed: faults of frames and lines, exceptions of devices.

use serde::{Deserialize, Serialize};

use crate::{t, text::translate};

/// Why a request did not end in a valid normal answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum Fault {
    /// No complete response before the deadline.
    #[error("{}", t!("response timeout"))]
    Timeout,
    /// The check did not fit.
    #[error("{}", t!("CRC error: got {got}, computed {computed}", got = format!("{:04X}", .got), computed = format!("{:04X}", .computed)))]
    Crc {
        /// As received, low byte first on the wire.
        got: u16,
        /// Over the bytes received.
        computed: u16,
    },
    /// The check of an ASCII frame did not fit.
    #[error("{}", t!("LRC error: got {got}, computed {computed}", got = format!("{:02X}", .got), computed = format!("{:02X}", .computed)))]
    Lrc {
        /// As received.
        got: u8,
        /// Over the bytes received.
        computed: u8,
    },
    /// A character that has no place in an ASCII frame.
    #[error("{}", t!("character {what} in an ASCII frame, expected a hexadecimal digit", what = format!("{:02X}", .0)))]
    NotHex(u8),
    /// The frame ended too early.
    #[error("{}", t!("incomplete response: {got} of {expected} bytes", got = .got, expected = .expected))]
    Truncated {
        /// Bytes received.
        got: u16,
        /// Bytes expected.
        expected: u16,
    },
    /// Another unit answered.
    #[error("{}", t!("unit {got} answered in place of unit {asked}", got = .got, asked = .asked))]
    WrongUnit {
        /// Unit in the answer.
        got: u8,
        /// Unit asked.
        asked: u8,
    },
    /// The answer is to another function.
    #[error("{}", t!("response to function {got} / 0x{got_hex}, expected {asked} / 0x{asked_hex}", got = .got, got_hex = format!("{:02X}", .got), asked = .asked, asked_hex = format!("{:02X}", .asked)))]
    WrongFunction {
        /// Function in the answer.
        got: u8,
        /// Function asked.
        asked: u8,
    },
    /// The answer has another length than was asked for.
    #[error("{}", t!("response with {got} data bytes, expected {asked}", got = .got, asked = .asked))]
    WrongLength {
        /// Data bytes in the answer.
        got: u16,
        /// Data bytes asked.
        asked: u16,
    },
    /// Only answers with another transaction id came (Modbus TCP).
    #[error("{}", t!("response has transaction {got}, the request had {asked}", got = .got, asked = .asked))]
    WrongTransaction {
        /// Transaction of the last of them.
        got: u16,
        /// Transaction of the request.
        asked: u16,
    },
    /// The other side closed the connection instead of answering this request.
    #[error("{}", t!("the device closes the connection on this request"))]
    Hangup,
    /// Bytes of a TCP connection that begin no frame.
    #[error("{}", t!("no MBAP header"))]
    NoHeader,
    /// A field that repeats one of the request differs from it: address, value, mask, sub-function, object.
    #[error("{}", t!("the response does not repeat the request"))]
    WrongEcho,
    /// Unsolicited frames came: the answer may be one of them.
    #[error("{}", t!("unsolicited frames: responses are not reliable"))]
    OutOfSync,
    /// The answer is good, but the registers hold no number of the tag's type (a BCD digit above 9, NaN).
    #[error("{}", t!("the registers do not hold a value of this type"))]
    NotANumber,
    /// The device responded with an exception.
    #[error("{0}")]
    Exception(ExceptionCode),
    /// The port or connection is not open.
    #[error("{}", t!("line not connected"))]
    NotConnected,
    /// The device is left alone (it has failed, or is saving its settings); nothing was sent.
    #[error("{}", t!("device in backoff, retry later"))]
    BackedOff,
    /// On the line of another master: it has got its response, which was not heard, or what was heard may be that to
    /// another request.
    #[error("{}", t!("no response heard that is certain to be its own"))]
    NotHeard,
    /// On the line of another master: a response to a request that was never heard before.
    #[error("{}", t!("heard, but not certain to be its own response"))]
    Unproven,
}

/// What a fault proves about the device and the line; what exactly was wrong with a frame makes no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultKind {
    Timeout,
    /// A frame came, but it was no valid response.
    Corrupt,
    OutOfSync,
    Exception(ExceptionCode),
    NotANumber,
    NotConnected,
    BackedOff,
    NotHeard,
    Unproven,
}

impl Fault {
    pub(crate) fn kind(self) -> FaultKind {
        match self {
            Fault::Timeout | Fault::Hangup => FaultKind::Timeout,
            Fault::Crc { .. }
            | Fault::Lrc { .. }
            | Fault::NotHex(_)
            | Fault::Truncated { .. }
            | Fault::WrongUnit { .. }
            | Fault::WrongFunction { .. }
            | Fault::WrongLength { .. }
            | Fault::WrongTransaction { .. }
            | Fault::NoHeader
            | Fault::WrongEcho => FaultKind::Corrupt,
            Fault::OutOfSync => FaultKind::OutOfSync,
            Fault::Exception(code) => FaultKind::Exception(code),
            Fault::NotANumber => FaultKind::NotANumber,
            Fault::NotConnected => FaultKind::NotConnected,
            Fault::BackedOff => FaultKind::BackedOff,
            Fault::NotHeard => FaultKind::NotHeard,
            Fault::Unproven => FaultKind::Unproven,
        }
    }

    /// Frames that came but were corrupt, as opposed to silence and refusals.
    pub fn is_corrupt(self) -> bool {
        self.kind() == FaultKind::Corrupt
    }
}

/// Exception code of an answer (Modbus application protocol V1.1b3, section 7).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error, Serialize, Deserialize)]
#[error("{}", t!("exception {code}, {words}", code = format!("{:02X}", .0), words = translate(self.label())))]
pub struct ExceptionCode(pub u8);

impl ExceptionCode {
    /// A refusal that gives no reason.
    pub const NONE: ExceptionCode = ExceptionCode(0);
    /// The device does not know the function.
    pub const ILLEGAL_FUNCTION: ExceptionCode = ExceptionCode(1);
    /// Nothing is at this address, or it cannot be written.
    pub const ILLEGAL_ADDRESS: ExceptionCode = ExceptionCode(2);
    /// The value or the count is out of range.
    pub const ILLEGAL_VALUE: ExceptionCode = ExceptionCode(3);

    /// The gateway says that the device behind it is away; the device itself has said nothing.
    pub fn is_of_gateway(self) -> bool {
        matches!(self.0, 0x0A | 0x0B)
    }

    /// Certainly without effect, if it answers a write: not so for 04 (failed on the way), 05 (accepted, still working)
    /// and 0B (the device did not respond to the gateway).
    pub fn is_refusal(self) -> bool {
        !matches!(self.0, 0x04 | 0x05 | 0x0B)
    }

    /// The meaning in the words of the standard.
    pub fn label(self) -> &'static str {
        match self.0 {
            0x01 => "illegal function",
            0x02 => "illegal data address",
            0x03 => "illegal data value",
            0x04 => "device failure",
            0x05 => "acknowledge, still working",
            0x06 => "device busy",
            0x08 => "memory parity error",
            0x0A => "gateway path unavailable",
            0x0B => "gateway target does not respond",
            _ => "unknown exception",
        }
    }
}
