//! What a diagnostic asks and finds, as facts; their words are in the language of who reads them.

use std::{fmt, sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use super::{super::command::Outcome, Conclusion};
use crate::{
    plant::{
        fault::{ExceptionCode, Fault},
        line::Serial,
        port_signals::PortSignals,
        sweep::SweptRange,
        tag::Table,
        traffic::Exchange,
    },
    t,
};

/// What a diagnostic has found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Finding {
    /// A request with its answer.
    Exchange(Arc<Exchange>),
    /// Bytes that came back for bytes sent as they were; empty if the line stayed silent.
    Bytes {
        /// As they came.
        bytes: Vec<u8>,
        /// From the last byte sent to the first byte received.
        response_time: Option<Duration>,
    },
    /// A unit answers.
    Unit {
        /// Its address.
        unit: u8,
        /// With these serial parameters, if others than the line's own were tried.
        serial: Option<Serial>,
        /// What it answered.
        reply: UnitReply,
    },
    /// Part of a device's identification.
    Object {
        /// Its number; `None`: the server id of function 11.
        id: Option<u8>,
        /// What the device says.
        text: String,
    },
    /// Registers or bits (0 or 1) that were read.
    Values {
        /// Which table.
        table: Table,
        /// Address of the first.
        address: u16,
        /// One a register or bit.
        words: Vec<u16>,
    },
    /// How a write has ended.
    Written(Outcome),
    /// The signals of the port, at first, whenever one has changed, and when it is put back.
    Signals {
        /// So long after it was set.
        after: Duration,
        /// How they stand.
        signals: PortSignals,
    },
    /// Addresses that a sweep has found to have the same outcome.
    Swept(SweptRange),
    /// A step failed.
    Failed {
        /// What was asked.
        what: DiagnosticStep,
        /// Why.
        fault: Fault,
    },
    /// What follows from all of it.
    Conclusion(Conclusion),
}

/// What a unit gave a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum UnitReply {
    /// Register 0.
    #[error("{}", t!("register 0 = {word}", word = .0))]
    Register(u16),
    /// A response without a register.
    #[error("{}", t!("answers"))]
    Answers,
    /// It is there and refuses.
    #[error("{0}")]
    Exception(ExceptionCode),
    /// Only corrupt bytes, which may be a unit with other settings.
    #[error("{}", t!("something is there: {fault}", fault = .0))]
    Corrupt(Fault),
}

impl UnitReply {
    /// A whole frame came.
    pub fn is_certain(self) -> bool {
        !matches!(self, UnitReply::Corrupt(_))
    }
    /// Register 0, where it could be read.
    pub fn register(self) -> Option<u16> {
        match self {
            UnitReply::Register(word) => Some(word),
            UnitReply::Answers | UnitReply::Exception(_) | UnitReply::Corrupt(_) => None,
        }
    }
}

/// What a diagnostic asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum DiagnosticStep {
    /// A request.
    Request {
        /// Who is asked.
        unit: u8,
        /// Function code.
        function: u8,
        /// With these serial parameters, if not the line's own.
        serial: Option<Serial>,
    },
    /// Bytes as they are.
    Bytes,
    /// Addresses of a scan that all gave corrupt bytes.
    Addresses {
        /// How many.
        count: usize,
        /// With these serial parameters, if not the line's own.
        serial: Option<Serial>,
    },
}

/// `unit 3, function 8 / 0x08 at 9600 8N1`.
impl fmt::Display for DiagnosticStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at = |serial: Option<Serial>| serial.map_or(String::new(), |serial| t!(" at {serial}", serial));
        f.write_str(&match *self {
            DiagnosticStep::Request { unit, function, serial } => {
                let hex = format!("{function:02X}");
                t!("unit {unit}, function {function} / 0x{hex}", unit, function, hex) + &at(serial)
            }
            DiagnosticStep::Bytes => t!("bytes as they are").to_owned(),
            DiagnosticStep::Addresses { count, serial } => {
                t!("{count} addresses{at}: something else talks on this line", count, at = at(serial))
            }
        })
    }
}
