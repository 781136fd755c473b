//! Requests in words, function by function.

use super::reader::{Reader, bit_words, hex_words, text};
use crate::bus::names::{self, counted, place, span};

/// Reads the data of a request behind its function. Gives the summary, without the unit; `None` if it is cut short.
pub(super) fn read(reader: &mut Reader, function: u8) -> Option<String> {
    match function {
        0x01..=0x04 => {
            let (address, count) = block(reader, function, "", "to read")?;
            Some(format!("{} {}", names::function(function)?, range(function, address, count)))
        }
        0x05 => write_coil(reader).map(|(address, what)| format!("write coil {what} (0x{address:04X})")),
        0x06 => write_register(reader)
            .map(|(address, value, what)| format!("write register {what} (0x{address:04X}, 0x{value:04X})")),
        0x0F => write_coils(reader),
        0x10 => {
            let (address, count) = block(reader, function, "", "to write")?;
            let values = counted_registers(reader, address, count)?;
            Some(format!("write registers {}: {}", range(function, address, count), hex_words(&values)))
        }
        0x08 => diagnostics(reader, "data"),
        0x14 | 0x15 => files(reader, function),
        0x16 => mask_write(reader),
        0x17 => read_write(reader),
        0x18 => {
            let address = reader.word("FIFO address", |address| place(function, address))?;
            Some(format!("read FIFO queue {} (0x{address:04X})", names::modicon(function, address)))
        }
        0x2B => identification(reader),
        0x07 | 0x0B | 0x0C | 0x11 => names::function(function).map(str::to_owned),
        0x80.. => {
            reader.wrong(format!("function {function} / 0x{function:02X} is an exception, no request"));
            None
        }
        _ => unknown(reader, function),
    }
}

/// `41003–41012 (0x03EA, 10)`.
pub(super) fn range(function: u8, address: u16, count: u16) -> String {
    format!("{} (0x{address:04X}, {count})", span(function, address, count))
}

/// Address and count.
pub(super) fn block(reader: &mut Reader, function: u8, prefix: &str, what: &str) -> Option<(u16, u16)> {
    let address = reader.word(&format!("{prefix}address"), |address| place(function, address))?;
    let item = if names::table(function).is_bits() { "bit" } else { "register" };
    let count = reader.word(&format!("{prefix}count"), |count| format!("{} {what}", counted(count.into(), item)))?;
    Some((address, count))
}

/// Address and new state; the answer is the echo. Gives `00173 on`.
pub(super) fn write_coil(reader: &mut Reader) -> Option<(u16, String)> {
    let address = reader.word("address", |address| place(0x05, address))?;
    let state = |value| match value {
        0x0000 => "off",
        0xFF00 => "on",
        _ => "neither on nor off",
    };
    let value = reader.word("value", |value| match value {
        0x0000 | 0xFF00 => state(value).into(),
        _ => "neither on (FF00) nor off (0000)".into(),
    })?;
    if !matches!(value, 0x0000 | 0xFF00) {
        reader.wrong(format!("coil value {value:04X}, expected FF00 (on) or 0000 (off)"));
    }
    Some((address, format!("{} {}", names::modicon(0x05, address), state(value))))
}

/// Address and new value; the answer is the echo. Gives `41003 = 50`.
pub(super) fn write_register(reader: &mut Reader) -> Option<(u16, u16, String)> {
    let address = reader.word("address", |address| place(0x06, address))?;
    let value = reader.registers(0x06, Some(address), 1)?[0];
    Some((address, value, format!("{} = {value}", names::modicon(0x06, address))))
}

fn write_coils(reader: &mut Reader) -> Option<String> {
    let (address, count) = block(reader, 0x0F, "", "to write")?;
    let bytes = byte_count(reader, usize::from(count).div_ceil(8))?;
    let bits = reader.bits(0x0F, Some(address), usize::from(count).min(8 * bytes))?;
    Some(format!("write coils {}: {}", range(0x0F, address, count), bit_words(&bits)))
}

/// Words of a byte count.
pub(super) fn follow(count: u8) -> String {
    match count {
        1 => "1 byte follows".into(),
        _ => format!("{count} bytes follow"),
    }
}

/// The byte count, which must be this.
pub(super) fn byte_count(reader: &mut Reader, expected: usize) -> Option<usize> {
    let count = usize::from(reader.byte("byte count", follow)?);
    if count != expected {
        reader.wrong(format!("byte count says {count}, {expected} fit"));
    }
    Some(count)
}

fn counted_registers(reader: &mut Reader, address: u16, count: u16) -> Option<Vec<u16>> {
    let bytes = byte_count(reader, 2 * usize::from(count))?;
    reader.registers(0x10, Some(address), usize::from(count).min(bytes / 2))
}

/// Sub-function and data.
pub(super) fn diagnostics(reader: &mut Reader, data: &str) -> Option<String> {
    let code = reader.word("sub-function", |code| format!("{code} / 0x{code:04X} {}", names::diagnostic(code)))?;
    let words = |bytes: &[u8]| match bytes {
        [high, low] => format!("{}", u16::from_be_bytes([*high, *low])),
        [..] => counted(bytes.len(), "byte"),
    };
    let count = reader.left().max(2);
    let bytes = reader.bytes(data, count, words)?;
    Some(format!("diagnostics {}, {data} {}", names::diagnostic(code), crate::bus::frame::hex(bytes)))
}

/// The answer is the echo.
pub(super) fn mask_write(reader: &mut Reader) -> Option<String> {
    let address = reader.word("address", |address| place(0x16, address))?;
    let and = reader.word("AND mask", |mask| format!("keeps the bits of {mask:016b}"))?;
    let or = reader.word("OR mask", |mask| format!("sets {:016b} of the others", mask & !and))?;
    Some(format!("mask write {} and {and:04X} or {or:04X} (0x{address:04X})", names::modicon(0x16, address)))
}

fn read_write(reader: &mut Reader) -> Option<String> {
    let (from, count) = block(reader, 0x17, "read ", "to read")?;
    let (to, written) = block(reader, 0x17, "write ", "to write")?;
    let values = counted_registers(reader, to, written)?;
    let (read, write) = (range(0x17, from, count), range(0x17, to, written));
    Some(format!("read {read}, write {write}: {}", hex_words(&values)))
}

fn files(reader: &mut Reader, function: u8) -> Option<String> {
    let bytes = usize::from(reader.byte("byte count", follow)?);
    let end = reader.at + bytes;
    let mut groups = Vec::new();
    while reader.at < end {
        groups.push(file_group(reader, function == 0x15)?);
    }
    Some(format!("{} {}", names::function(function)?, groups.join(", ")))
}

/// Reference type, file, record, length; and the registers, if they follow.
pub(super) fn file_group(reader: &mut Reader, with_data: bool) -> Option<String> {
    let kind = reader.byte("reference", |kind| if kind == 6 { "file record" } else { "must be 06" }.into())?;
    if kind != 6 {
        reader.wrong(format!("reference type {kind:02X}, expected 06"));
    }
    let file = reader.word("file", |file| format!("file {file}"))?;
    let record = reader.word("record", |record| format!("from record {record}"))?;
    let length = reader.word("length", |length| counted(length.into(), "register"))?;
    let data = if with_data { reader.registers(0x03, None, usize::from(length))? } else { Vec::new() };
    let data = if data.is_empty() { String::new() } else { format!(": {}", hex_words(&data)) };
    Some(format!("file {file} record {record}, {}{data}", counted(length.into(), "register")))
}

fn identification(reader: &mut Reader) -> Option<String> {
    if mei(reader)? != 0x0E {
        let bytes = reader.left();
        reader.bytes("data", bytes, text)?;
        return Some("encapsulated interface transport".into());
    }
    let code = reader.byte("read code", |code| format!("{code} {}", names::identification(code)))?;
    let object = reader.byte("object", |id| format!("from {id} {}", names::object(id)))?;
    let (what, object) = (names::identification(code), names::object(object));
    Some(format!("read device identification, {what} from {object}"))
}

/// The kind of an encapsulated transport.
pub(super) fn mei(reader: &mut Reader) -> Option<u8> {
    reader.byte("MEI type", |kind| match kind {
        0x0D => "13 / 0x0D CANopen".into(),
        0x0E => "14 / 0x0E read device identification".into(),
        _ => format!("{kind} / 0x{kind:02X} unknown"),
    })
}

/// A function that is not in the standard: its bytes as they are.
pub(super) fn unknown(reader: &mut Reader, function: u8) -> Option<String> {
    let left = reader.left();
    let bytes = reader.bytes("data", left, |bytes| counted(bytes.len(), "byte"))?;
    Some(
        format!("function {function} / 0x{function:02X}: {}", crate::bus::frame::hex(bytes))
            .trim_end_matches(": ")
            .into(),
    )
}
