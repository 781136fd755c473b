//! `sightglass probe`: what one unit says of itself, and what some of its registers hold.

use super::{UnitArgs, exchange_lines, run};
use crate::{
    bus::{interpret, names},
    cli::{CliError, in_runtime, recognition, say, say_error},
    plant::{
        def::LineDef,
        diagnostics::{Diagnostic, Finding},
        fault::Fault,
        live::AddressSpan,
        number::to_u16,
        tag::{ByteOrder, Table},
    },
    profile::sunspec::profile_text,
};

/// Arguments of `probe`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    of: UnitArgs,
    /// Read this: TABLE:ADDRESS[:COUNT] with the wire address (holding:1002:10), or a Modicon number (41003:10)
    #[arg(long, short, value_name = "WHERE", value_parser = |text: &str| text.parse::<AddressSpan>())]
    read: Option<AddressSpan>,
    /// Find its SunSpec models, and print the device profile that they make
    #[arg(long, conflicts_with = "read")]
    sunspec: bool,
}

/// Reads what is asked for, else the identification.
pub fn main(args: Args) -> Result<(), CliError> {
    let (line, unit) = args.of.line_and_unit()?;
    if args.sunspec {
        return sunspec(&line, unit);
    }
    say(&format!("unit {} on {}", unit, line.transport));
    let diagnostic = match args.read {
        Some(AddressSpan { table, address, count }) => Diagnostic::Read { unit, table, address, count },
        None => Diagnostic::Identify { unit },
    };
    let run = run(&line, diagnostic, |finding| match finding {
        Finding::Exchange(exchange) if args.of.verbose => exchange_lines(exchange),
        Finding::Object { id, text } => vec![format!("{:20}  {text}", names::identity(*id))],
        Finding::Values { table, address, words } => value_lines(*table, *address, words),
        Finding::Failed { what, fault } => vec![format!("{what}: {fault}")],
        Finding::Conclusion(conclusion) => vec![conclusion.to_string()],
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Bytes { .. }
        | Finding::Unit { .. } => Vec::new(),
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
    let answered = run.findings.iter().any(|finding| match finding {
        Finding::Exchange(exchange) => matches!(exchange.outcome, Ok(()) | Err(Fault::Exception(_))),
        _ => false,
    });
    Err(CliError::Failed(match (answered, wrong) {
        (true, _) => "the unit responds, but does not support that".to_owned(),
        (false, Some(fault)) => format!("something answers, but wrongly: {fault}"),
        (false, None) => "the unit does not respond".to_owned(),
    }))
}

/// The profile on the standard output, what was found on the error output.
fn sunspec(line: &LineDef, unit: u8) -> Result<(), CliError> {
    let found = in_runtime(recognition::sunspec(line, unit))?;
    let Some(device) = found else {
        return Err(CliError::Failed(format!("unit {unit} has no SunSpec models at 0, 40000 or 50000")));
    };
    say_error(&recognition::sunspec_words(unit, &device));
    say(&profile_text(&device));
    Ok(())
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
        let float = |order| pair.and_then(|pair| interpret::float(order, pair, 10)).unwrap_or_else(|| "–".to_owned());
        let floats = [ByteOrder::Abcd, ByteOrder::Cdab, ByteOrder::Badc, ByteOrder::Dcba]
            .map(|order| format!("{:>10}", float(order)));
        format!("{:6} / {at:04X}  {word:04X}  {word:6} {:6} {}", table.modicon(at), *word as i16, floats.join(" "))
    };
    std::iter::once(heads.to_owned()).chain(words.iter().enumerate().map(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_are_shown_in_four_orders() {
        let lines = value_lines(Table::Holding, 1002, &[0x4366, 0x3333]);
        assert!(lines[1].contains("41003  / 03EA  4366   17254") && lines[1].contains("230.2"), "{lines:?}");
        assert_eq!(lines.len(), 3);
    }
}
