//! The words for the bits and registers that a function works on.

use super::table;
use crate::t;

/// `41003`.
pub(crate) fn modicon(function: u8, address: u16) -> String {
    table(function).modicon(address)
}

/// `41003–41012`, or `41003` for one.
pub(crate) fn span(function: u8, address: u16, count: u16) -> String {
    match count {
        0 | 1 => modicon(function, address),
        _ => format!("{}–{}", modicon(function, address), modicon(function, address.saturating_add(count - 1))),
    }
}

/// `41003 / 0x03EA, wire address 1002`.
pub(crate) fn place(function: u8, address: u16) -> String {
    t!(
        "{modicon} / 0x{hex}, wire address {address}",
        modicon = modicon(function, address),
        hex = format!("{address:04X}"),
        address
    )
}
