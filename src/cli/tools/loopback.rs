//! `sightglass loopback`: does a unit, or a plug, send back what it is sent.

use jiff::Timestamp;

use super::{UnitArgs, exchange_lines, run};
use crate::{
    bus::{diagnostics::tally_of, frame::hex},
    cli::{CliError, say},
    plant::{
        diagnostics::{Diagnostic, Finding},
        fault::Fault,
        line::Framing,
        time::elapsed,
    },
};

/// Arguments of `loopback`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    of: UnitArgs,
    /// How often
    #[arg(long, short, default_value = "10", value_parser = clap::value_parser!(u16).range(1..=1000))]
    count: u16,
    /// Send patterns that a loopback plug returns (RX joined to TX), instead of asking a unit; at most 500
    #[arg(long, conflicts_with = "unit")]
    plug: bool,
}

/// Diagnostics 08/00 with a number that counts up.
pub fn main(args: Args) -> Result<(), CliError> {
    if args.plug {
        return plug(&args);
    }
    let (line, unit) = args.of.line_and_unit()?;
    say(&format!("loopback 08/00 to unit {} on {}", unit, line.transport));
    let diagnostic = Diagnostic::Loopback { unit, data: 0xA537, count: args.count };
    let run = run(&line, diagnostic, |finding| lines(finding, args.of.verbose))?;
    let refused = |fault: &Fault| matches!(fault, Fault::Exception(_));
    let lost = |finding: &&Finding| matches!(finding, Finding::Failed { fault, .. } if !refused(fault));
    let lost = run.findings.iter().filter(lost).count();
    if lost == 0 { Ok(()) } else { Err(CliError::Failed(format!("{lost} of {} did not come back", args.count))) }
}

/// What is printed of a finding.
fn lines(finding: &Finding, verbose: bool) -> Vec<String> {
    match finding {
        Finding::Exchange(exchange) if verbose => exchange_lines(exchange),
        Finding::Bytes { bytes, .. } if verbose => vec![format!("RX {}", hex(bytes))],
        Finding::Failed { what, fault } if !verbose => vec![format!("{what}: {fault}")],
        Finding::Conclusion(conclusion) => vec![conclusion.to_string()],
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Failed { .. }
        | Finding::Bytes { .. }
        | Finding::Unit { .. }
        | Finding::Object { .. }
        | Finding::Values { .. } => Vec::new(),
    }
}

/// Patterns, each compared with what comes back.
fn plug(args: &Args) -> Result<(), CliError> {
    let line = args.of.port.line()?;
    if line.transport.framing() == Framing::Mbap {
        return Err(CliError::Usage("--plug: Modbus TCP has no loopback plug: this needs a serial line".into()));
    }
    let bits = line.transport.serial().map_or(8, |serial| serial.data_bits);
    let diagnostic = Diagnostic::Pattern { bits, count: args.count };
    diagnostic.check().map_err(CliError::Usage)?;
    say(&format!("{diagnostic} on {}", line.transport));
    let run = run(&line, diagnostic, |finding| lines(finding, args.of.verbose))?;
    let (tally, time) = (tally_of(&run, bits), elapsed(run.started, Timestamp::now()).as_secs_f64());
    let rate = tally.received as f64 / time.max(0.001);
    say(&format!("{time:.1} s, {rate:.0} bytes a second with the pauses between the patterns"));
    match tally.faults() {
        0 => Ok(()),
        faults => Err(CliError::Failed(format!("{faults} bytes did not come back as they were sent"))),
    }
}
