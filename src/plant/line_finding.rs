//! What a line was found to do other than its plant file says: facts, with their words.

use std::{fmt, time::Duration};

use serde::{Deserialize, Serialize};

use super::{id::DeviceId, tag::Table};
use crate::t;

/// What is heard of another master.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct OtherMasterHeard {
    /// The unit of its latest request.
    pub unit: u8,
    /// The function of that.
    pub function: u8,
    /// Its requests in the last minute.
    pub requests: u32,
}

impl fmt::Display for OtherMasterHeard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OtherMasterHeard { unit, function, requests } = *self;
        f.write_str(&t!(
            "{requests} requests in the last minute, the latest to unit {unit} with function {function}",
            requests,
            unit,
            function
        ))
    }
}

/// A fact about a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceFinding {
    /// It takes fewer requests at once than the plant file says.
    InFlight {
        /// As found.
        most: u16,
        /// As stated.
        stated: u16,
    },
    /// It gives fewer registers or bits at once than it is asked for.
    ReadMost {
        /// The table.
        table: Table,
        /// As found.
        most: u16,
        /// What it has refused.
        refused: u16,
    },
    /// It does not have these, although the plan would read (over) them; none is a boundary that no request may cross.
    Unreadable {
        /// The table.
        table: Table,
        /// The first.
        address: u16,
        /// How many.
        count: u16,
    },
    /// It does not hear a request that comes sooner after its response.
    RequestGap {
        /// As found.
        gap: Duration,
    },
}

/// A fact about a device or a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LineFinding {
    /// About a device.
    Device(DeviceId, DeviceFinding),
    /// The other side ends each connection after this many answers.
    AnswersPerConnection(u64),
    /// The other side does not answer for so long after it was connected.
    DeafAfterConnect(Duration),
}

impl LineFinding {
    /// The device that it is about, if it is about one.
    pub fn device(self) -> Option<DeviceId> {
        match self {
            LineFinding::Device(device, _) => Some(device),
            LineFinding::AnswersPerConnection(_) | LineFinding::DeafAfterConnect(_) => None,
        }
    }
}

/// With the setting of the plant file that says so.
impl fmt::Display for DeviceFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&match *self {
            DeviceFinding::InFlight { most, stated } => {
                t!("takes {most} requests at once, not {stated}: in_flight_max = {most}", most, stated)
            }
            DeviceFinding::ReadMost { table, most, .. } => {
                t!(
                    "returns {most} of table {table} at once: read_registers_max or read_bits_max = {most}",
                    most,
                    table = table.word()
                )
            }
            DeviceFinding::Unreadable { table, address, count: 0 } => {
                t!(
                    "table {table} cannot be read across address {address} with one request",
                    table = table.word(),
                    address
                )
            }
            DeviceFinding::Unreadable { table, address, count } => {
                t!("table {table}: no address {address}, {count} in all", table = table.word(), address, count)
            }
            DeviceFinding::RequestGap { gap } => {
                t!("misses a request sent sooner after its response: request_gap_ms = {ms}", ms = gap.as_millis())
            }
        })
    }
}

/// With the setting of the plant file that says so.
impl fmt::Display for LineFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            LineFinding::Device(_, found) => found.fmt(f),
            LineFinding::AnswersPerConnection(answers) => f.write_str(&t!(
                "each connection is closed after {answers} responses: a new one is opened in time",
                answers
            )),
            LineFinding::DeafAfterConnect(time) => f.write_str(&t!(
                "no response for {ms} ms after each connection: connect_delay_ms = {ms}",
                ms = time.as_millis()
            )),
        }
    }
}
