//! One line that says what a request or response is about, by function.

use super::{
    Direction,
    fields::{Fields, Values, coil_state},
    reader::{Reader, bit_words, hex_words},
};
use crate::{
    bus::{
        frame::{self, Request},
        names::{self, Counted, comm_status, counted},
        pdu::{self, modicon, span},
    },
    plant::{fault::ExceptionCode, number::to_u8},
    t,
    text::translate,
};

/// Reads the fields behind the function code. Gives the summary, without the unit; `None` if the message is cut short.
/// `asked` is the request: the message itself, or that of a response if it is known to be of the same function.
pub(super) fn read(reader: &mut Reader, function: u8, direction: Direction, asked: Option<Request>) -> Option<String> {
    match (pdu::function(function), direction) {
        (None, Direction::Answer) if 0x80 <= function => exception(reader),
        (None, Direction::Request) if 0x80 <= function => {
            reader.wrong(t!("function {code} is an exception, not a request", code = names::code(function)));
            None
        }
        (None, _) => unknown(reader, function),
        (Some(row), Direction::Request) => {
            Some(of_request(row, &Fields::new(reader, function, direction, asked).read(row.request)?))
        }
        (Some(row), Direction::Answer) => {
            Some(of_response(row, &Fields::new(reader, function, direction, asked).read(row.response)?))
        }
    }
}

fn exception(reader: &mut Reader) -> Option<String> {
    let label = |code| format!("{code:02X} {}", translate(ExceptionCode(code).label()));
    let code = reader.byte("exception", |code| format!("{}: {}", label(code), translate(names::advice(code))))?;
    // A word of the protocol, the same in every language.
    Some(format!("exception {}", label(code)))
}

/// A function that is not in the standard: its bytes as they are.
fn unknown(reader: &mut Reader, function: u8) -> Option<String> {
    let left = reader.left();
    let bytes = reader.bytes(t!("data"), left, |bytes| counted(bytes.len(), Counted::Bytes))?;
    let summary = t!("function {code}: {bytes}", code = names::code(function), bytes = frame::hex(bytes));
    Some(summary.trim_end_matches(": ").into())
}

/// `41003–41012 (0x03EA, 10)`.
fn range(function: u8, (address, count): (u16, u16)) -> String {
    format!("{} (0x{address:04X}, {count})", span(function, address, count))
}

fn of_request(row: &pdu::Function, values: &Values) -> String {
    let (code, registers) = (row.code, hex_words(&values.registers));
    let (name, parts) = (translate(row.name), values.parts.join(", "));
    match (code, &values.blocks[..], &values.numbers[..]) {
        (0x01..=0x04, [block], _) => format!("{name} {}", range(code, *block)),
        (0x05, [(address, _)], _) => {
            t!("write coil {written} (0x{hex})", written = written(values, code), hex = hex_words(&[*address]))
        }
        (0x06, [(address, _)], _) => {
            let hex = hex_words(&[*address]);
            t!("write register {written} (0x{hex}, 0x{registers})", written = written(values, code), hex, registers)
        }
        (0x08, _, [code, ..]) => t!("diagnostics {what}, {parts}", what = names::diagnostic(*code), parts),
        (0x0F, [block], _) => {
            t!("write coils {range}: {bits}", range = range(code, *block), bits = bit_words(&values.bits))
        }
        (0x10, [block], _) => t!("write registers {range}: {registers}", range = range(code, *block), registers),
        (0x14 | 0x15, ..) => format!("{name} {parts}"),
        (0x16, [(address, _)], [and, or]) => {
            let [and, or, hex] = [*and, *or, *address].map(|word| hex_words(&[word]));
            t!("mask write {place} and {and} or {or} (0x{hex})", place = modicon(code, *address), and, or, hex)
        }
        (0x17, [read, write], _) => {
            let [read, write] = [*read, *write].map(|block| range(code, block));
            t!("read {read}, write {write}: {registers}", read, write, registers)
        }
        (0x18, [(address, _)], _) => {
            t!("read FIFO queue {place} (0x{hex})", place = modicon(code, *address), hex = hex_words(&[*address]))
        }
        (0x2B, _, &[code, object]) => {
            let (what, object) = (names::identification(to_u8(code)), names::object(to_u8(object)));
            t!("read device identification, {what} from {object}", what, object)
        }
        _ => name.to_owned(),
    }
}

/// `00173 on`, `41003 = 50`.
fn written(values: &Values, function: u8) -> String {
    let address = values.blocks.first().map_or_else(String::new, |(address, _)| modicon(function, *address));
    match (values.registers.first(), values.numbers.first()) {
        (Some(value), _) => format!("{address} = {value}"),
        (None, value) => {
            format!("{address} {}", value.and_then(|value| coil_state(*value)).unwrap_or(t!("neither on nor off")))
        }
    }
}

fn of_response(row: &pdu::Function, values: &Values) -> String {
    let (code, registers) = (row.code, hex_words(&values.registers));
    match (code, &values.numbers[..]) {
        (0x01 | 0x02, _) => format!("{}: {}", counted(values.bits.len(), Counted::Bits), bit_words(&values.bits)),
        (0x03 | 0x04, _) if values.address_words == 2 => {
            let count = counted(values.registers.len() / 2, Counted::Registers);
            t!("{count} of 32 bits: {registers}", count, registers)
        }
        (0x03 | 0x04 | 0x17, _) => format!("{}: {registers}", counted(values.registers.len(), Counted::Registers)),
        (0x05, _) => t!("written: coil {place}", place = written(values, code)),
        (0x06, _) => t!("written: {place}", place = written(values, code)),
        (0x07, [status]) => {
            let [hex, bits] = [format!("{status:02X}"), format!("{status:08b}")];
            t!("exception status {hex} ({bits})", hex, bits)
        }
        (0x0B, [status, events]) => t!("{status}, {events} events", status = comm_status(*status), events),
        (0x0C, [status, events, messages]) => {
            t!("{status}, {events} events, {messages} messages", status = comm_status(*status), events, messages)
        }
        (0x0F | 0x10, _) => {
            let place = values.blocks.first().map_or_else(String::new, |block| range(code, *block));
            t!("written: {place}", place)
        }
        // A device may answer with none.
        (0x11 | 0x14 | 0x2B, _) if values.parts.is_empty() => translate(row.name).to_owned(),
        (0x11, _) => t!("server id {parts}", parts = values.parts.join(", ")),
        (0x14, _) => t!("file records {parts}", parts = values.parts.join(", ")),
        (0x15 | 0x16, _) => t!("done: {request}", request = of_request(row, values)),
        (0x18, [count]) => t!("{count} queued: {registers}", count, registers),
        (0x2B, [_, _, _]) => values.parts.join(", "),
        (0x08, _) => of_request(row, values),
        _ => translate(row.name).to_owned(),
    }
}
