//! The functions of the form, a row each: what they are filled in with, and how that becomes bytes (V1.1b3, 6).

use super::{
    Field,
    fields::{address, bit, number, register},
    typed,
};
use crate::{
    bus::{names, pdu},
    plant::{
        number::{to_u8, to_u16},
        tag::Table,
    },
    t,
};

/// Functions that the form offers, the most used first.
pub const FUNCTIONS: [u8; 16] = [3, 4, 1, 2, 6, 5, 16, 15, 22, 23, 7, 8, 11, 12, 17, 43];
/// Sub-functions of 08.
const SUB_FUNCTIONS: [u16; 15] = [0, 2, 11, 12, 13, 14, 15, 16, 17, 18, 1, 3, 4, 10, 20];
/// Read device identification codes of 43/14.
const READ_CODES: [u8; 4] = [1, 2, 3, 4];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Address in the table of the function.
    Address,
    /// Registers or bits to read, at most so many.
    Count(i64),
    Bit,
    /// Bits with their count.
    Bits,
    Register,
    /// Registers with their count.
    Registers,
    /// Sub-function of 08.
    SubFunction,
    /// Code of 43/14.
    ReadCode,
    /// Identification object.
    Object,
}

/// The fields of a function in the order of its bytes: label, content, and what it begins with.
fn row(function: u8) -> Vec<(&'static str, Kind, &'static str)> {
    let read = |most| vec![(t!("address"), Kind::Address, "40001"), (t!("count"), Kind::Count(most), "1")];
    let write = |label, kind| vec![(t!("address"), Kind::Address, "40001"), (label, kind, "")];
    match function {
        1 | 2 => read(2_000),
        3 | 4 => read(125),
        5 => write(t!("value"), Kind::Bit),
        6 => write(t!("value"), Kind::Register),
        15 => write(t!("values"), Kind::Bits),
        16 => write(t!("values"), Kind::Registers),
        22 => [write(t!("AND mask"), Kind::Register), vec![(t!("OR mask"), Kind::Register, "0x0000")]].concat(),
        23 => [read(125), vec![(t!("write to"), Kind::Address, "40001"), (t!("values"), Kind::Registers, "")]].concat(),
        8 => vec![(t!("function"), Kind::SubFunction, ""), (t!("data"), Kind::Register, "0x0000")],
        43 => vec![(t!("objects"), Kind::ReadCode, ""), (t!("object"), Kind::Object, "0")],
        _ => Vec::new(),
    }
}

fn range(kind: Kind, table: Table) -> String {
    match kind {
        Kind::Address => t!("{first} …, or 0 – 65535 as sent", first = table.modicon(0)),
        Kind::Count(most) => t!("1 – {most}", most),
        Kind::Bit => t!("0 or 1").to_owned(),
        Kind::Register => t!("0 – 65535, -32768 …, 0x…").to_owned(),
        Kind::Registers => t!("1 – 123 numbers, spaces between").to_owned(),
        Kind::Bits => t!("1 – 1968 of 0 and 1, spaces between").to_owned(),
        Kind::Object => t!("0 – 255").to_owned(),
        Kind::SubFunction | Kind::ReadCode => String::new(),
    }
}

/// The fields of a function; what was filled in under the same label before stays, where it can.
pub fn fields(function: u8, before: &dyn Fn(&str) -> Option<String>) -> Vec<Field> {
    let table = pdu::table(function);
    let field = |(label, kind, first): (&'static str, Kind, &str)| match kind {
        Kind::SubFunction => {
            let words = SUB_FUNCTIONS.map(|code| format!("{code} / 0x{code:02X} {}", names::diagnostic(code)));
            Field::choice(label, words, 0)
        }
        Kind::ReadCode => {
            Field::choice(label, READ_CODES.map(|code| format!("{code} {}", names::identification(code))), 0)
        }
        Kind::Address | Kind::Count(_) | Kind::Bit | Kind::Bits | Kind::Register | Kind::Registers | Kind::Object => {
            let kept = before(label).filter(|text| kind != Kind::Address || address(text, table).is_ok());
            let first = if kind == Kind::Address { table.modicon(0) } else { first.to_owned() };
            typed(label, &kept.unwrap_or(first), &range(kind, table))
        }
    };
    row(function).into_iter().map(field).collect()
}

/// Unit and PDU of a request, of what was entered in the fields of its function; of a choice its number.
pub fn message(unit: u8, function: u8, entries: &[String]) -> Result<Vec<u8>, String> {
    let mut message = vec![unit, function];
    if function == 43 {
        message.push(14);
    }
    for ((label, kind, _), text) in row(function).into_iter().zip(entries) {
        let each = || text.split([' ', ',', ';']).filter(|word| !word.is_empty());
        let chosen = text.parse::<usize>().unwrap_or(0);
        match kind {
            Kind::Address => message.extend(address(text, pdu::table(function))?.to_be_bytes()),
            Kind::Count(most) => message.extend(to_u16(number(text, label, 1..=most)?).to_be_bytes()),
            Kind::Bit => message.extend(if bit(text)? { [0xFF, 0] } else { [0, 0] }),
            Kind::Register => message.extend(register(text)?.to_be_bytes()),
            Kind::Object => message.push(to_u8(number(text, label, 0..=255)?)),
            Kind::SubFunction => message.extend(SUB_FUNCTIONS.get(chosen).unwrap_or(&0).to_be_bytes()),
            Kind::ReadCode => message.push(*READ_CODES.get(chosen).unwrap_or(&1)),
            Kind::Bits => {
                let bits = each().map(bit).collect::<Result<Vec<bool>, String>>()?;
                let byte = |part: &[bool]| part.iter().rev().fold(0u8, |byte, on| byte << 1 | u8::from(*on));
                let bytes: Vec<u8> = bits.chunks(8).map(byte).collect();
                message.extend(to_u16(bits.len()).to_be_bytes());
                message.push(to_u8(bytes.len()));
                message.extend(bytes);
            }
            Kind::Registers => {
                let values = each().map(register).collect::<Result<Vec<u16>, String>>()?;
                message.extend(to_u16(values.len()).to_be_bytes());
                message.push(to_u8(2 * values.len()));
                message.extend(values.iter().flat_map(|value| value.to_be_bytes()));
            }
        }
    }
    Ok(message)
}
