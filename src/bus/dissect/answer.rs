//! Answers in words, function by function; with the request, values get their addresses.

use super::{
    reader::{Reader, bit_words, hex_words, text},
    request,
};
use crate::{
    bus::names::{self, counted},
    plant::event::ExceptionCode,
};

/// Reads the data of an answer behind its function. Gives the summary, without the unit; `None` if it is cut short.
/// `asked` is the request message, if it is known to be of the same function.
pub(super) fn read(reader: &mut Reader, function: u8, asked: Option<&[u8]>) -> Option<String> {
    let word = |at: usize| Some(u16::from_be_bytes([*asked?.get(at)?, *asked?.get(at + 1)?]));
    match function {
        0x80.. => exception(reader),
        0x01 | 0x02 => bits(reader, function, word(2), word(4)),
        0x03 | 0x04 | 0x17 => registers(reader, function, word(2)),
        0x05 => request::write_coil(reader).map(|(_, what)| format!("written: coil {what}")),
        0x06 => request::write_register(reader).map(|(.., what)| format!("written: {what}")),
        0x07 => status(reader),
        0x08 => request::diagnostics(reader, "result"),
        0x0B => counters(reader).map(|(status, events)| format!("{status}, {events} events")),
        0x0C => event_log(reader),
        0x0F | 0x10 => {
            let (address, count) = request::block(reader, function, "", "written")?;
            Some(format!("written: {}", request::range(function, address, count)))
        }
        0x11 => server_id(reader),
        0x14 => file_records(reader),
        0x15 => file_echo(reader),
        0x16 => request::mask_write(reader).map(|what| format!("done: {what}")),
        0x18 => fifo(reader),
        0x2B => identification(reader),
        _ => request::unknown(reader, function),
    }
}

fn exception(reader: &mut Reader) -> Option<String> {
    let words = |code| format!("{code:02X} {}: {}", ExceptionCode(code).words(), names::advice(code));
    let code = reader.byte("exception", words)?;
    Some(format!("exception {code:02X} {}", ExceptionCode(code).words()))
}

fn bits(reader: &mut Reader, function: u8, start: Option<u16>, count: Option<u16>) -> Option<String> {
    let bytes = match count.map(|count| usize::from(count).div_ceil(8)) {
        Some(expected) => request::byte_count(reader, expected)?,
        None => usize::from(reader.byte("byte count", request::follow)?),
    };
    let count = count.map_or(8 * bytes, |count| usize::from(count).min(8 * bytes));
    let bits = reader.bits(function, start, count)?;
    Some(format!("{}: {}", counted(count, "bit"), bit_words(&bits)))
}

fn registers(reader: &mut Reader, function: u8, start: Option<u16>) -> Option<String> {
    let bytes = usize::from(reader.byte("byte count", request::follow)?);
    if bytes % 2 == 1 {
        reader.wrong(format!("byte count {bytes} is odd, registers have two bytes"));
    }
    let values = reader.registers(function, start, bytes / 2)?;
    Some(format!("{}: {}", counted(values.len(), "register"), hex_words(&values)))
}

fn status(reader: &mut Reader) -> Option<String> {
    let status =
        reader.byte("status", |status| format!("{status:08b}, highest first: the device says what they mean"))?;
    Some(format!("exception status {status:02X} ({status:08b})"))
}

/// Status and number of events.
fn counters(reader: &mut Reader) -> Option<(&'static str, u16)> {
    let words = |status| match status {
        0x0000 => "ready",
        0xFFFF => "busy",
        _ => "unknown status",
    };
    let status = reader.word("status", |status| words(status).to_owned())?;
    let events = reader.word("event count", |count| format!("{} done", counted(count.into(), "message")))?;
    Some((words(status), events))
}

fn event_log(reader: &mut Reader) -> Option<String> {
    let bytes = usize::from(reader.byte("byte count", request::follow)?);
    let (status, events) = counters(reader)?;
    let messages = reader.word("message count", |count| format!("{} seen", counted(count.into(), "message")))?;
    if bytes < 6 {
        reader.wrong(format!("byte count says {bytes}, expected 6 or more"));
    }
    reader.bytes("events", bytes.saturating_sub(6), |_| "one byte an event, the latest first".into())?;
    Some(format!("{status}, {events} events, {messages} messages"))
}

fn server_id(reader: &mut Reader) -> Option<String> {
    let bytes = usize::from(reader.byte("byte count", request::follow)?);
    let id = reader.bytes("id and run", bytes, |bytes| format!("{}, run state FF on, 00 off", text(bytes)))?;
    Some(format!("server id {}", text(id)))
}

fn file_records(reader: &mut Reader) -> Option<String> {
    let bytes = usize::from(reader.byte("byte count", request::follow)?);
    let end = reader.at + bytes;
    let mut groups = Vec::new();
    while reader.at < end {
        let length = usize::from(reader.byte("group length", request::follow)?);
        let kind = reader.byte("reference", |kind| if kind == 6 { "file record" } else { "must be 06" }.into())?;
        if kind != 6 {
            reader.wrong(format!("reference type {kind:02X}, expected 06"));
        }
        groups.push(hex_words(&reader.registers(0x03, None, length.saturating_sub(1) / 2)?));
    }
    Some(format!("file records {}", groups.join(", ")))
}

/// The answer to 15 is the echo of the request.
fn file_echo(reader: &mut Reader) -> Option<String> {
    request::read(reader, 0x15).map(|what| format!("done: {what}"))
}

fn fifo(reader: &mut Reader) -> Option<String> {
    let bytes = reader.word("byte count", |count| format!("{count} bytes follow"))?;
    let count = reader.word("FIFO count", |count| format!("{} queued", counted(count.into(), "register")))?;
    if u32::from(bytes) != 2 + 2 * u32::from(count) {
        reader.wrong(format!("byte count says {bytes}, {} fit", 2 + 2 * u32::from(count)));
    }
    let values = reader.registers(0x03, None, usize::from(count))?;
    Some(format!("{count} queued: {}", hex_words(&values)))
}

fn identification(reader: &mut Reader) -> Option<String> {
    if request::mei(reader)? != 0x0E {
        let bytes = reader.left();
        reader.bytes("data", bytes, text)?;
        return Some("encapsulated interface transport".into());
    }
    reader.byte("read code", |code| format!("{code} {}", names::identification(code)))?;
    reader.byte("conformity", |level| {
        let one_by_one = if level & 0x80 == 0 { "as a list only" } else { "as a list and one by one" };
        format!("{}, {one_by_one}", names::identification(level & 0x7F))
    })?;
    let more = reader.byte("more follows", |more| if more == 0 { "no" } else { "yes" }.into())?;
    reader.byte("next object", |id| match more {
        0 => "none".into(),
        _ => format!("ask on from {id} {}", names::object(id)),
    })?;
    let count = reader.byte("objects", |count| counted(count.into(), "object"))?;
    let mut objects = Vec::new();
    for _ in 0..count {
        let id = reader.byte("object", |id| format!("{id} {}", names::object(id)))?;
        let length = usize::from(reader.byte("length", |length| counted(length.into(), "byte"))?);
        let value = reader.bytes(names::object(id), length, text)?;
        objects.push(format!("{} {}", names::object(id), text(value)));
    }
    Some(objects.join(", "))
}
