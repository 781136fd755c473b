//! Addresses as people write them: decimal, hexadecimal, Modicon numbers, and the octal names of DirectLOGIC.

use super::{
    diagnostic::{Problems, Span},
    reader::{At, Node, Value},
};
use crate::plant::{
    address::{TABLES, in_table, of_modicon, table_named, wire},
    keyword::keyword_enum,
    tag::Table,
};

keyword_enum! {
    /// How addresses are written.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub(crate) enum Scheme: "scheme" {
        /// 0-based numbers, as sent.
        #[default]
        Modbus => "modbus",
        /// Octal `V40500`, `Y17`, `X23`, `C54` of KOYO and AutomationDirect.
        DirectLogic => "directlogic",
    }
}

/// An address as written.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Location {
    /// `1002`, `0x03EA` or `"0x03EA"`: 0-based, as sent.
    Wire(u16),
    /// `"holding:1002"`: the same with its table.
    In(Table, u16),
    /// `"V40500"`: what it means depends on the scheme.
    Name(String),
}

/// Where an address leads: the table, if the name of the address says it, and the 0-based number on the wire.
pub(super) type TableAddress = (Option<Table>, u16);

/// Resolves an address. `None` after the problem was added.
pub(super) fn locate(location: &At<Location>, scheme: Scheme, problems: &mut Problems) -> Option<TableAddress> {
    match (&location.value, scheme) {
        (Location::Wire(address), _) => Some((None, *address)),
        (Location::In(table, address), _) => Some((Some(*table), *address)),
        (Location::Name(name), Scheme::DirectLogic) => {
            directlogic(name, location.at, problems).map(|(table, address)| (Some(table), address))
        }
        (Location::Name(name), Scheme::Modbus) => {
            let problem = problems.add(location.at, format!("`{name}` is not an address"));
            problem.label("expected a number, 0-based as on the wire, or with its table such as \"holding:1002\"");
            if memory(name).is_some() {
                problem.help("for octal addresses of KOYO and AutomationDirect write scheme = \"directlogic\" at the top of the profile");
            }
            None
        }
    }
}

/// A kind of memory of a DirectLOGIC PLC.
struct Memory {
    prefix: &'static str,
    table: Table,
    base: u16,
    last: u16,
}

/// DL06 user manual, 3rd edition, chapter 4: the first wire address and the last (octal) number of each memory.
const MEMORIES: &[Memory] = &[
    Memory { prefix: "GX", table: Table::Discrete, base: 0, last: 0o3777 },
    Memory { prefix: "GY", table: Table::Coil, base: 0, last: 0o3777 },
    Memory { prefix: "SP", table: Table::Discrete, base: 3072, last: 0o777 },
    Memory { prefix: "CT", table: Table::Coil, base: 6400, last: 0o177 },
    Memory { prefix: "X", table: Table::Discrete, base: 2048, last: 0o777 },
    Memory { prefix: "Y", table: Table::Coil, base: 2048, last: 0o777 },
    Memory { prefix: "C", table: Table::Coil, base: 3072, last: 0o1777 },
    Memory { prefix: "S", table: Table::Coil, base: 5120, last: 0o1777 },
    Memory { prefix: "T", table: Table::Coil, base: 6144, last: 0o377 },
    Memory { prefix: "V", table: Table::Holding, base: 0, last: 0o41237 },
];

/// The memory whose prefix is followed by a digit.
fn memory(name: &str) -> Option<(&'static Memory, &str)> {
    MEMORIES.iter().find_map(|memory| {
        let digits = name.strip_prefix(memory.prefix)?;
        digits.starts_with(|c: char| c.is_ascii_digit()).then_some((memory, digits))
    })
}

/// The table of a DirectLOGIC address.
pub(super) fn memory_table(name: &str) -> Option<Table> {
    memory(name).map(|(memory, _)| memory.table)
}

fn directlogic(name: &str, at: Span, problems: &mut Problems) -> Option<(Table, u16)> {
    let Some((memory, digits)) = memory(name) else {
        problems
            .add(at, format!("`{name}` is not a DirectLOGIC address"))
            .label("expected V, X, Y, C, S, T, CT, SP, GX or GY and an octal number");
        return None;
    };
    if let Some((index, wrong)) = digits.char_indices().find(|(_, c)| !('0'..='7').contains(c)) {
        let place = at.inside_quotes(memory.prefix.len() + index, wrong.len_utf8());
        problems
            .add(place, format!("`{name}` does not exist: DirectLOGIC counts in octal"))
            .label(format!("`{wrong}` is not an octal digit"))
            .help(format!("digits are 0 to 7: after {0}7 comes {0}10", memory.prefix));
        return None;
    }
    let number = u16::from_str_radix(digits, 8).ok().filter(|number| *number <= memory.last);
    if number.is_none() {
        problems
            .add(at, format!("`{name}` does not exist"))
            .label(format!("the last is {}{:o}", memory.prefix, memory.last));
    }
    number.map(|number| (memory.table, memory.base + number))
}

/// A number of the manual, such as 41003, that is checked against the address.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Modicon(String);

/// Reports a Modicon number that means another address or another table.
pub(super) fn check_modicon(modicon: &At<Modicon>, table: Table, address: u16, problems: &mut Problems) {
    let short = table.modicon(address);
    let long = format!("{}{:05}", table.digit(), u32::from(address) + 1);
    let written = &modicon.value.0;
    if *written == short || *written == long {
        return;
    }
    let problem = problems.add(modicon.at, format!("modicon {written} does not fit address {address}"));
    problem.label(format!("{} {address} (0x{address:04X}) is {short}", table.word()));
    if let Some(meant) = meaning(written) {
        problem.help(format!("{written} is {meant}; one of the two lines is off"));
    }
}

/// `41003` in words: `holding 1002 (0x03EA)`.
fn meaning(modicon: &str) -> Option<String> {
    let digit = modicon.get(..1)?.parse::<u8>().ok()?;
    let number = modicon.get(1..)?.parse::<u32>().ok()?.checked_sub(1)?;
    let table = TABLES.into_iter().find(|table| table.digit() == digit)?;
    Some(format!("{} {number} (0x{number:04X})", table.word()))
}

impl Value for Location {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        match value {
            Node::Text(text) if text.split_once(':').is_some_and(|(word, _)| table_named(word.trim()).is_some()) => {
                let found = in_table(text).map(|(table, address)| Location::In(table, address));
                if found.is_none() {
                    let problem = problems.add(at, format!("`{text}` is not an address"));
                    problem.label("expected TABLE:ADDRESS such as \"holding:1002\", 0 to 65535 as on the wire");
                }
                found
            }
            Node::Text(text) => Some(wire(text).map_or_else(|| Location::Name(text.clone()), Location::Wire)),
            Node::Whole(number) if u16::try_from(*number).is_err() && of_modicon(&number.to_string()).is_some() => {
                let meant = meaning(&number.to_string()).unwrap_or_default();
                let problem = problems.add(at, format!("address {number} is a Modicon number: {meant}"));
                problem.label("expected the address as it is sent, 0 to 65535");
                problem.help(format!("write the address that is sent, and modicon = {number} beside it"));
                None
            }
            Node::Whole(_) | Node::Number(_) | Node::Flag(_) | Node::Time(_) | Node::Array(_) | Node::Table(_) => {
                u16::read(value, at, problems).map(Location::Wire)
            }
        }
    }
}

/// Addresses are always as sent; to say so settles what digits mean that could be a Modicon number.
pub(super) fn check_base(base: Option<At<u8>>, problems: &mut Problems) {
    if let Some(base) = base.filter(|base| base.value != 0) {
        let problem = problems.add(base.at, "addresses are written as they are sent, from 0");
        problem.label("expected 0").help("`modicon` may be added to a tag and is checked against its address");
    }
}

/// Digits that are a Modicon number of their own table as well as an address: `40001` of a holding register. Hexadecimal
/// and an address with its table are never one.
pub(super) fn is_unclear(location: &At<Location>, table: Table, problems: &Problems) -> bool {
    let text = problems.text(location.at.source).get(location.at.start..location.at.end).unwrap_or_default();
    let digits = text.trim_matches(['"', '\'']);
    matches!(location.value, Location::Wire(_)) && of_modicon(digits).is_some_and(|(meant, _)| meant == table)
}

/// Says once for a file how such digits are read.
pub(super) fn warn_unclear(unclear: impl Iterator<Item = (Span, Table, u16)>, problems: &mut Problems) {
    let mut said: Vec<usize> = Vec::new();
    for (at, table, address) in unclear {
        if said.contains(&at.source) {
            continue;
        }
        said.push(at.source);
        let (word, sent) = (table.word(), table.modicon(address));
        let other = meaning(&address.to_string()).unwrap_or_default();
        let problem = problems.warn(at, format!("address {address} is read as sent: {word} {address}, Modicon {sent}"));
        problem.label(format!("as a Modicon number it would be {other}"));
        problem.help(
            "say once for all addresses that they are as sent: address_base = 0 at the top of the profile or in the \
             [[device]]; for a Modicon number write the address that it means, and `modicon` beside it",
        );
    }
}

impl Value for Modicon {
    fn read(value: &Node, at: Span, problems: &mut Problems) -> Option<Self> {
        let digits = match value {
            // TOML integers cannot start with 0, so a coil may also come as 2049.
            Node::Whole(_) => format!("{:05}", u32::read(value, at, problems)?),
            _ => String::read(value, at, problems)?,
        };
        let shape = matches!(digits.len(), 5 | 6) && digits.bytes().all(|b| b.is_ascii_digit());
        if !shape {
            problems.add(at, format!("`{digits}` is not a Modicon number")).label("expected five or six digits");
        }
        shape.then_some(Modicon(digits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nowhere(length: usize) -> Span {
        Span { source: 0, start: 0, end: length }
    }

    #[test]
    fn octal_names_lead_to_the_addresses_of_the_manual() {
        let check = |name: &str, expect: Option<(Table, u16)>| {
            assert_eq!(directlogic(name, nowhere(9), &mut Problems::default()), expect, "{name}");
        };
        check("V40500", Some((Table::Holding, 0x4140)));
        check("V40400", Some((Table::Holding, 0x4100)));
        check("V2000", Some((Table::Holding, 1024)));
        check("V2100", Some((Table::Holding, 1088)));
        check("Y0", Some((Table::Coil, 2048)));
        check("Y20", Some((Table::Coil, 2064)));
        check("C54", Some((Table::Coil, 3116)));
        check("X17", Some((Table::Discrete, 2063)));
        check("X23", Some((Table::Discrete, 2067)));
        check("SP116", Some((Table::Discrete, 3150)));
        check("CT177", Some((Table::Coil, 6527)));
        check("GY0", Some((Table::Coil, 0)));
        check("X8", None);
        check("Y18", None);
        check("V2008", None);
        check("Y1000", None);
        check("V77777777", None);
        check("V", None);
        check("v2000", None);
        check("Q1", None);
    }

    #[test]
    fn a_modicon_number_must_be_the_address_plus_one() {
        let check = |digits: &str, table, address, fits: bool| {
            let mut problems = Problems::default();
            let modicon = At { value: Modicon(digits.to_owned()), at: nowhere(5) };
            check_modicon(&modicon, table, address, &mut problems);
            assert_eq!(problems.finish(()).is_ok(), fits, "{digits} {address}");
        };
        check("41003", Table::Holding, 1002, true);
        check("401003", Table::Holding, 1002, true);
        check("41003", Table::Holding, 1003, false);
        check("31003", Table::Holding, 1002, false);
        check("02049", Table::Coil, 2048, true);
        check("416705", Table::Holding, 0x4140, true);
        check("00000", Table::Coil, 0, false);
    }
}
