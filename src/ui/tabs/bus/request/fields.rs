//! Fields of a request: numbers, registers, bits and addresses as they are typed.

use super::*;
use crate::ui::tabs::prelude::*;

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

/// The wire address: `41003` is a Modicon number of its table, `1002` and `0x03EA` are as sent. Five digits or more that
/// begin with the digit of a table are a Modicon number; a wire address as great as that is written in hexadecimal.
pub fn address(text: &str, table: Table) -> Result<u16, String> {
    let digits = text.trim();
    let modicon = matches!(digits.len(), 5 | 6) && digits.bytes().all(|byte| byte.is_ascii_digit());
    let named =
        TABLES.into_iter().find(|table| digits.starts_with(char::from(b'0' + table.digit()))).filter(|_| modicon);
    let Some(named) = named else { return number(digits, t!("address"), 0..=65_535).map(to_u16) };
    if named != table {
        return Err(t!(
            "address: {digits} belongs to the table {named}, this is {table}",
            digits,
            named = translate(named.word()),
            table = translate(table.word())
        ));
    }
    let place = digits[1..].parse::<u32>().ok().and_then(|number| u16::try_from(number.checked_sub(1)?).ok());
    place.ok_or_else(|| {
        t!("address: {digits} does not exist, the first is {modicon}", digits, modicon = table.modicon(0))
    })
}

/// All settings that devices are found with; RTU needs eight data bits.
pub(super) fn all_settings(line: &LineDef) -> Vec<Serial> {
    let data_bits = if line.transport.framing() == Framing::Ascii { 7 } else { 8 };
    let of = |baud| CHARACTERS.map(|(parity, stop_bits)| Serial { baud, data_bits, parity, stop_bits });
    BAUDS.into_iter().flat_map(of).collect()
}
