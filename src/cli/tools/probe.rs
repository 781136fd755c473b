//! `sightglass probe`: what one unit says of itself, and what some of its registers hold.

use super::{UnitArgs, exchange_lines, run};
use crate::{
    bus::{codec, names},
    cli::{CliError, say},
    plant::{
        diagnostics::{Diagnostic, Finding},
        event::Fault,
        number::{to_f32, to_u16},
        tag::{ByteOrder, DataType, Point, Table},
    },
};

/// Arguments of `probe`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    of: UnitArgs,
    /// Read this: TABLE:ADDRESS[:COUNT] with the wire address (holding:1002:10), or a Modicon number (41003:10)
    #[arg(long, short, value_name = "WHERE", value_parser = place)]
    read: Option<Place>,
}

/// Registers or bits of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    table: Table,
    address: u16,
    count: u16,
}

/// Reads what is asked for, else the identification.
pub fn main(args: Args) -> Result<(), CliError> {
    let (line, unit) = args.of.line_and_unit()?;
    say(&format!("unit {} on {}", unit, line.transport));
    let diagnostic = match args.read {
        Some(Place { table, address, count }) => Diagnostic::Read { unit, table, address, count },
        None => Diagnostic::Identify { unit },
    };
    let run = run(&line, diagnostic, |finding| match finding {
        Finding::Exchange(exchange) if args.of.verbose => exchange_lines(exchange),
        Finding::Object { name, text } => vec![format!("{name:20}  {text}")],
        Finding::Values { table, address, words } => value_lines(*table, *address, words),
        Finding::Failed { what, fault } => vec![format!("{what}: {fault}")],
        Finding::Exchange(_) | Finding::Bytes { .. } | Finding::Unit { .. } | Finding::Verdict(_) => Vec::new(),
    })?;
    let found = |finding: &Finding| matches!(finding, Finding::Object { .. } | Finding::Values { .. });
    if run.findings.iter().any(found) {
        return Ok(());
    }
    let faults = || {
        run.findings.iter().filter_map(|finding| match finding {
            Finding::Failed { fault, .. } => Some(*fault),
            _ => None,
        })
    };
    let wrong = faults().find(|fault| fault.is_corrupt());
    Err(CliError::Failed(match (faults().any(|fault| matches!(fault, Fault::Exception(_))), wrong) {
        (true, _) => "the unit responds, but does not support that".to_owned(),
        (false, Some(fault)) => format!("something answers, but wrongly: {fault}"),
        (false, None) => "the unit does not respond".to_owned(),
    }))
}

/// A row a register: both forms of the address, hex, unsigned, signed, and with its neighbour a float in four orders.
fn value_lines(table: Table, address: u16, words: &[u16]) -> Vec<String> {
    if table.is_bits() {
        let row = |(n, bit): (usize, &u16)| {
            let at = address.wrapping_add(to_u16(n));
            format!("{:7} / 0x{at:04X}  {bit}", table.modicon(at))
        };
        return words.iter().enumerate().map(row).collect();
    }
    let heads = "modicon / wire  hex  uint16  int16  float32: ABCD       CDAB       BADC       DCBA";
    let row = |(n, word): (usize, &u16)| {
        let at = address.wrapping_add(to_u16(n));
        let pair = words.get(n..n + 2);
        let float = |order| {
            let point = Point { table, address: at, kind: DataType::F32, order, field: None };
            pair.and_then(|pair| codec::decode(point, pair)).map_or("–".into(), |value| short(to_f32(value)))
        };
        let floats = [ByteOrder::Abcd, ByteOrder::Cdab, ByteOrder::Badc, ByteOrder::Dcba]
            .map(|order| format!("{:>10}", float(order)));
        format!("{:6} / {at:04X}  {word:04X}  {word:6} {:6} {}", table.modicon(at), *word as i16, floats.join(" "))
    };
    std::iter::once(heads.to_owned()).chain(words.iter().enumerate().map(row)).collect()
}

/// A float in at most ten characters.
fn short(value: f32) -> String {
    let plain = format!("{value}");
    if plain.len() <= 10 { plain } else { format!("{value:.3e}") }
}

/// `holding:1002:10` or `41003:10`.
fn place(text: &str) -> Result<Place, String> {
    let wrong = || format!("found `{text}`, expected TABLE:ADDRESS[:COUNT] such as holding:1002:10, or 41003:10");
    let parts: Vec<&str> = text.split(':').collect();
    let number = |word: &str| match word.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).map_err(|_| wrong()),
        None => word.parse::<u16>().map_err(|_| wrong()),
    };
    let tables = [Table::Coil, Table::Discrete, Table::Input, Table::Holding];
    let (table, address, count) = match parts.as_slice() {
        [word, address, count @ ..] if word.parse::<u32>().is_err() => {
            let table = tables.into_iter().find(|table| table.word() == *word).ok_or_else(wrong)?;
            (table, number(address)?, count)
        }
        [modicon, count @ ..] => {
            let found = tables.into_iter().find_map(|table| {
                let digits = modicon.strip_prefix(char::from(b'0' + table.digit()))?;
                let number: u32 = digits.parse().ok().filter(|number| matches!(digits.len(), 4 | 5) && *number != 0)?;
                Some((table, u16::try_from(number - 1).ok()?))
            });
            let (table, address) = found.ok_or_else(wrong)?;
            (table, address, count)
        }
        [] => return Err(wrong()),
    };
    let count = match count {
        [] => 1,
        [count] => number(count)?,
        _ => return Err(wrong()),
    };
    let most = if table.is_bits() { 2_000 } else { 125 };
    if !(1..=most).contains(&count) || u32::from(address) + u32::from(count) > 65_536 {
        let what = names::function(table.read_fc()).unwrap_or("read");
        return Err(format!("found {count} at {address}, expected 1 to {most} below address 65536 ({what})"));
    }
    Ok(Place { table, address, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_told_by_wire_address_or_modicon_number() {
        let holding = |address, count| Ok(Place { table: Table::Holding, address, count });
        assert_eq!(place("holding:1002:10"), holding(1002, 10));
        assert_eq!(place("holding:0x3EA"), holding(1002, 1));
        assert_eq!(place("41003:10"), holding(1002, 10));
        assert_eq!(place("465536"), holding(65_535, 1));
        assert_eq!(place("31001"), Ok(Place { table: Table::Input, address: 1000, count: 1 }));
        for wrong in ["", "41003:0", "holding:5:126", "40000", "register:5", "holding", "holding:65535:2", "1:2:3:4"] {
            assert!(place(wrong).is_err_and(|error| error.contains("expected")), "{wrong}");
        }
    }

    #[test]
    fn registers_are_shown_in_four_orders() {
        let lines = value_lines(Table::Holding, 1002, &[0x4366, 0x3333]);
        assert!(lines[1].contains("41003  / 03EA  4366   17254") && lines[1].contains("230.2"), "{lines:?}");
        assert_eq!(lines.len(), 3);
    }
}
