//! The names of the standard: sub-functions, identification objects, and what to do about an exception.

use crate::t;

/// Name of a sub-function of diagnostics 08 (V1.1b3, 6.8.1).
pub fn diagnostic(code: u16) -> &'static str {
    match code {
        0x00 => t!("return query data (loopback)"),
        0x01 => t!("restart communications option"),
        0x02 => t!("return diagnostic register"),
        0x03 => t!("change ASCII input delimiter"),
        0x04 => t!("force listen only mode"),
        0x0A => t!("clear counters and diagnostic register"),
        0x0B => t!("return bus message count"),
        0x0C => t!("return bus communication error count"),
        0x0D => t!("return bus exception error count"),
        0x0E => t!("return server message count"),
        0x0F => t!("return server no response count"),
        0x10 => t!("return server NAK count"),
        0x11 => t!("return server busy count"),
        0x12 => t!("return bus character overrun count"),
        0x14 => t!("clear overrun counter and flag"),
        _ => t!("reserved sub-function"),
    }
}

/// What a request does to the unit beyond what its name says (V1.1b3, 6.8); `message` is the unit's number and the PDU.
pub fn effect(message: &[u8]) -> Option<&'static str> {
    let [_, 8, high, low, ..] = message else { return None };
    Some(match u16::from_be_bytes([*high, *low]) {
        0x01 => "the unit restarts its port and clears all its counters; it leaves listen only mode",
        0x03 => "from then on its ASCII messages end with another character: this line may not understand it any more",
        0x04 => "the unit listens only: it answers nothing until sub-function 01 or until its power is switched off",
        0x0A => "the unit clears all its counters and its diagnostic register",
        0x14 => "the unit clears its counter of overruns",
        _ => return None,
    })
}

/// Name of a device identification object (V1.1b3, 6.21).
pub fn object(id: u8) -> &'static str {
    match id {
        0x00 => "VendorName",
        0x01 => "ProductCode",
        0x02 => "MajorMinorRevision",
        0x03 => "VendorUrl",
        0x04 => "ProductName",
        0x05 => "ModelName",
        0x06 => "UserApplicationName",
        0x07..=0x7F => t!("reserved object"),
        0x80..=0xFF => t!("private object"),
    }
}

/// Name of a part of an identification; those without a name of their own by number, `None` for the server id of function 11.
pub fn identity(id: Option<u8>) -> String {
    match id {
        None => "ServerId".to_owned(),
        Some(id @ 0..=6) => object(id).to_owned(),
        Some(id @ 7..) => format!("{} {}", object(id), code(id)),
    }
}

/// Name of a read device identification code.
pub fn identification(code: u8) -> &'static str {
    match code {
        1 => t!("basic identification"),
        2 => t!("regular identification"),
        3 => t!("extended identification"),
        4 => t!("one object"),
        _ => t!("unknown read code"),
    }
}

/// The status of functions 0B and 0C.
pub(super) fn comm_status(status: u16) -> &'static str {
    match status {
        0x0000 => t!("ready"),
        0xFFFF => t!("busy"),
        _ => t!("unknown status"),
    }
}

/// What a technician does about an exception.
pub fn advice(code: u8) -> &'static str {
    match code {
        0x01 => "the device does not support this function: use another one (06 instead of 16, 04 instead of 03)",
        0x02 => {
            "no such address, or the block extends past the last one: check the register map and off-by-one, read fewer registers"
        }
        0x03 => "value or count not allowed: check the value range and the device's limit of registers per request",
        0x04 => "the device failed while executing the request: check the device before you repeat a write",
        0x05 => "accepted, still processing: read the result later",
        0x06 => "the device is busy: retry later",
        0x08 => "memory parity error in the device: retry once, then have it serviced",
        0x0A => "the gateway has no path to this unit: check its settings and the unit address",
        0x0B => "the device behind the gateway does not respond: check its power, wiring, unit address and baud rate",
        _ => "not a standard code: see the manual of the device",
    }
}

/// `131 / 0x83`.
pub fn code(function: u8) -> String {
    format!("{function} / 0x{function:02X}")
}

/// What frames have more of than one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    /// `byte`.
    Bytes,
    /// `bit`.
    Bits,
    /// `register`.
    Registers,
    /// `message`.
    Messages,
    /// `object`.
    Objects,
}

/// `1 byte`, `2 bytes`.
pub fn counted(count: usize, what: Counted) -> String {
    match (what, count) {
        (Counted::Bytes, 1) => t!("1 byte").to_owned(),
        (Counted::Bytes, _) => t!("{count} bytes", count),
        (Counted::Bits, 1) => t!("1 bit").to_owned(),
        (Counted::Bits, _) => t!("{count} bits", count),
        (Counted::Registers, 1) => t!("1 register").to_owned(),
        (Counted::Registers, _) => t!("{count} registers", count),
        (Counted::Messages, 1) => t!("1 message").to_owned(),
        (Counted::Messages, _) => t!("{count} messages", count),
        (Counted::Objects, 1) => t!("1 object").to_owned(),
        (Counted::Objects, _) => t!("{count} objects", count),
    }
}
