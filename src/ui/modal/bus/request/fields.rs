//! Fields of a request: numbers, registers, bits and addresses as they are typed.

use super::*;
use crate::plant::address::{AddressBase, AddressContext};

/// `123`, `-5`, `0x3EA`.
pub(super) fn number(text: &str, what: &str, range: RangeInclusive<i64>) -> Result<i64, String> {
    let text = text.trim();
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let value = digits.map_or_else(|| text.parse(), |digits| i64::from_str_radix(digits, 16));
    let expected = || {
        t!("{what}: found `{text}`, expected {start} to {end}", what, text, start = range.start(), end = range.end())
    };
    value.ok().filter(|value| range.contains(value)).ok_or_else(expected)
}

pub(super) fn register(text: &str) -> Result<u16, String> {
    number(text, t!("value"), -32_768..=65_535).map(|value| to_u16(value.rem_euclid(0x1_0000)))
}

pub(super) fn bit(text: &str) -> Result<bool, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "1" | "on" => Ok(true),
        "0" | "off" => Ok(false),
        other => Err(t!("value: found `{other}`, expected 1 or 0", other)),
    }
}

/// The wire address: `41003` is a Modicon number of its table, `1002`, `0x03EA` and `holding:41003` are as sent.
pub fn address(text: &str, table: Table) -> Result<u16, String> {
    let digits = text.trim();
    let is_zero = matches!(digits.len(), 5 | 6) && digits.get(1..).is_some_and(|rest| rest.bytes().all(|b| b == b'0'));
    if is_zero && digits.starts_with(char::from(b'0' + table.digit())) {
        return Err(t!("address: {digits} does not exist, the first is {modicon}", digits, modicon = table.modicon(0)));
    }
    match (AddressContext { table, is_stated: false, base: AddressBase::Modicon }).parse(digits) {
        Some((found, address)) if found == table => Ok(address),
        Some((found, _)) => Err(t!(
            "address: {digits} belongs to the table {named}, this is {table}; as sent it is {sent}",
            digits,
            named = translate(found.word()),
            table = translate(table.word()),
            sent = format!("{}:{}", table.word(), digits.rsplit(':').next().unwrap_or_default())
        )),
        None => number(digits, t!("address"), 0..=65_535).map(to_u16),
    }
}

/// All settings that devices are found with; RTU needs eight data bits.
pub(super) fn all_settings(line: &LineDef) -> Vec<Serial> {
    let data_bits = if line.transport.framing() == Framing::Ascii { 7 } else { 8 };
    let of = |baud| CHARACTERS.map(|(parity, stop_bits)| Serial { baud, data_bits, parity, stop_bits });
    BAUDS.into_iter().flat_map(of).collect()
}
