//! One line that says what a request or response is about, by function.

use super::{
    Direction,
    fields::{Fields, Values, coil_state},
    reader::{Reader, bit_words, hex_words},
};
use crate::{
    bus::{
        frame,
        names::{self, comm_status, counted, modicon, span},
        pdu,
    },
    plant::{event::ExceptionCode, number::to_u8},
};

/// Reads the fields behind the function code. Gives the summary, without the unit; `None` if the message is cut short.
/// `asked` is the request message of a response, if it is known to be of the same function.
pub(super) fn read(reader: &mut Reader, function: u8, direction: Direction, asked: Option<&[u8]>) -> Option<String> {
    match (pdu::function(function), direction) {
        (None, Direction::Answer) if 0x80 <= function => exception(reader),
        (None, Direction::Request) if 0x80 <= function => {
            reader.wrong(format!("function {function} / 0x{function:02X} is an exception, not a request"));
            None
        }
        (None, _) => unknown(reader, function),
        (Some(row), Direction::Request) => {
            Some(of_request(row, &Fields::new(reader, function, direction, None).read(row.request)?))
        }
        (Some(row), Direction::Answer) => {
            Some(of_response(row, &Fields::new(reader, function, direction, asked).read(row.response)?))
        }
    }
}

fn exception(reader: &mut Reader) -> Option<String> {
    let words = |code| format!("{code:02X} {}: {}", ExceptionCode(code).label(), names::advice(code));
    let code = reader.byte("exception", words)?;
    Some(format!("exception {code:02X} {}", ExceptionCode(code).label()))
}

/// A function that is not in the standard: its bytes as they are.
fn unknown(reader: &mut Reader, function: u8) -> Option<String> {
    let left = reader.left();
    let bytes = reader.bytes("data", left, |bytes| counted(bytes.len(), "byte"))?;
    Some(format!("function {function} / 0x{function:02X}: {}", frame::hex(bytes)).trim_end_matches(": ").into())
}

/// `41003–41012 (0x03EA, 10)`.
fn range(function: u8, (address, count): (u16, u16)) -> String {
    format!("{} (0x{address:04X}, {count})", span(function, address, count))
}

fn of_request(row: &pdu::Function, values: &Values) -> String {
    let (code, registers) = (row.code, hex_words(&values.registers));
    let parts = values.parts.join(", ");
    match (code, &values.blocks[..], &values.numbers[..]) {
        (0x01..=0x04, [block], _) => format!("{} {}", row.name, range(code, *block)),
        (0x05, [(address, _)], _) => format!("write coil {} (0x{address:04X})", written(values, code)),
        (0x06, [(address, _)], _) => {
            format!("write register {} (0x{address:04X}, 0x{registers})", written(values, code))
        }
        (0x08, _, [code, ..]) => format!("diagnostics {}, {parts}", names::diagnostic(*code)),
        (0x0F, [block], _) => format!("write coils {}: {}", range(code, *block), bit_words(&values.bits)),
        (0x10, [block], _) => format!("write registers {}: {registers}", range(code, *block)),
        (0x14 | 0x15, ..) => format!("{} {parts}", row.name),
        (0x16, [(address, _)], [and, or]) => {
            format!("mask write {} and {and:04X} or {or:04X} (0x{address:04X})", modicon(code, *address))
        }
        (0x17, [read, write], _) => format!("read {}, write {}: {registers}", range(code, *read), range(code, *write)),
        (0x18, [(address, _)], _) => format!("read FIFO queue {} (0x{address:04X})", modicon(code, *address)),
        (0x2B, _, &[code, object]) => {
            let (what, object) = (names::identification(to_u8(code)), names::object(to_u8(object)));
            format!("read device identification, {what} from {object}")
        }
        _ => row.name.to_owned(),
    }
}

/// `00173 on`, `41003 = 50`.
fn written(values: &Values, function: u8) -> String {
    let address = values.blocks.first().map_or_else(String::new, |(address, _)| modicon(function, *address));
    match (values.registers.first(), values.numbers.first()) {
        (Some(value), _) => format!("{address} = {value}"),
        (None, value) => {
            format!("{address} {}", value.and_then(|value| coil_state(*value)).unwrap_or("neither on nor off"))
        }
    }
}

fn of_response(row: &pdu::Function, values: &Values) -> String {
    let (code, registers) = (row.code, hex_words(&values.registers));
    match (code, &values.numbers[..]) {
        (0x01 | 0x02, _) => format!("{}: {}", counted(values.bits.len(), "bit"), bit_words(&values.bits)),
        (0x03 | 0x04 | 0x17, _) => format!("{}: {registers}", counted(values.registers.len(), "register")),
        (0x05, _) => format!("written: coil {}", written(values, code)),
        (0x06, _) => format!("written: {}", written(values, code)),
        (0x07, [status]) => format!("exception status {status:02X} ({status:08b})"),
        (0x0B, [status, events]) => format!("{}, {events} events", comm_status(*status)),
        (0x0C, [status, events, messages]) => {
            format!("{}, {events} events, {messages} messages", comm_status(*status))
        }
        (0x0F | 0x10, _) => {
            format!("written: {}", values.blocks.first().map_or_else(String::new, |block| range(code, *block)))
        }
        (0x11, _) => format!("server id {}", values.parts.join(", ")),
        (0x14, _) => format!("file records {}", values.parts.join(", ")),
        (0x15 | 0x16, _) => format!("done: {}", of_request(row, values)),
        (0x18, [count]) => format!("{count} queued: {registers}"),
        (0x2B, [_, _, _]) => values.parts.join(", "),
        (0x08, _) => of_request(row, values),
        _ => row.name.to_owned(),
    }
}
