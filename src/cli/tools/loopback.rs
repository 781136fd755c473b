//! `sightglass loopback`: does a unit send back what it is sent.

use super::{UnitArgs, exchange_lines, run};
use crate::{
    cli::{CliError, say},
    plant::{
        diagnostics::{Diagnostic, Finding},
        event::Fault,
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
}

/// Diagnostics 08/00 with a number that counts up.
pub fn main(args: Args) -> Result<(), CliError> {
    let (line, unit) = args.of.line_and_unit()?;
    say(&format!("loopback 08/00 to unit {} on {}", unit, line.transport));
    let diagnostic = Diagnostic::Loopback { unit, data: 0xA537, count: args.count };
    let run = run(&line, diagnostic, |finding| match finding {
        Finding::Exchange(exchange) if args.of.verbose => exchange_lines(exchange),
        Finding::Failed { what, fault } if !args.of.verbose => vec![format!("{what}: {fault}")],
        Finding::Conclusion(words) => vec![words.clone()],
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Failed { .. }
        | Finding::Bytes { .. }
        | Finding::Unit { .. }
        | Finding::Object { .. }
        | Finding::Values { .. } => Vec::new(),
    })?;
    let refused = |fault: &Fault| matches!(fault, Fault::Exception(_));
    let lost = |finding: &&Finding| matches!(finding, Finding::Failed { fault, .. } if !refused(fault));
    let lost = run.findings.iter().filter(lost).count();
    if lost == 0 { Ok(()) } else { Err(CliError::Failed(format!("{lost} of {} did not come back", args.count))) }
}
