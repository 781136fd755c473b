//! `sightglass scan`: who is on a line, at which settings.

use std::time::Duration;

use super::{PortArgs, baud, network, parity, run};
use crate::{
    bus::io::testing,
    cli::{CliError, say},
    plant::{
        def::{Framing, LineDef, Serial},
        diagnostics::{Diagnostic, Finding, Scan},
        number::to_u32,
    },
    profile::BAUDS,
};

/// Arguments of `scan`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Unit addresses, FIRST-LAST or one
    #[arg(long, short, value_name = "UNITS", default_value = "1-247", value_parser = units)]
    units: (u8, u8),
    /// Try these baud rates too: a list with commas, or `all`
    #[arg(long, value_name = "LIST")]
    bauds: Option<String>,
    /// Try these parities too: a list of N, E, O with commas, or `all`
    #[arg(long, value_name = "LIST")]
    parities: Option<String>,
    /// Scan a network (10.0.0.0/24 in place of HOST) without asking first, and open nothing
    #[arg(long)]
    yes: bool,
}

/// One request to every unit; who answers, even with a refusal, is there. What of a network is to be opened, in words of
/// `open`.
pub fn main(args: Args) -> Result<Option<Vec<String>>, CliError> {
    if let Some(network) = args.port.network() {
        let (network, port) = network.map_err(CliError::Usage)?;
        return network::main(network, &port.line()?, args.yes);
    }
    let line = args.port.line()?;
    let serials = match line.transport.serial() {
        Some(serial) => serials(&args, serial)?,
        None if args.bauds.is_some() || args.parities.is_some() => {
            return Err(CliError::Usage("--bauds and --parities need a serial port".into()));
        }
        None => Vec::new(),
    };
    let (first, last) = args.units;
    // Time for request and answer on the wire of the slowest setting is added by the link.
    let scan = Scan { first, last, serials, timeout: line.timeout.min(Duration::from_secs(60)) };
    let (requests, most) = time_max(&line, &scan);
    let seconds = most.as_secs_f64().ceil();
    say(&format!("scan on {}: {requests} requests, about {seconds:.0} s if no unit answers", line.transport));
    let run = run(&line, Diagnostic::Scan(scan), describe)?;

    let found = run.findings.iter().any(|finding| matches!(finding, Finding::Unit { .. }));
    if found { Ok(None) } else { Err(CliError::Failed("no unit was found".into())) }
}

/// Requests of a scan, and how long it takes where no unit answers.
pub fn time_max(line: &LineDef, scan: &Scan) -> (usize, Duration) {
    let requests = scan.serials.len().max(1) * (usize::from(scan.last.saturating_sub(scan.first)) + 1);
    // Where nothing answers on several connections at once, it is asked again on one.
    let is_wide = line.transport.framing() == Framing::Mbap && 1 < requests;
    let at_once = if is_wide { requests.div_ceil(testing::SCAN_CONNECTIONS) } else { 0 };
    let deaf = if line.transport.has_connection() { testing::DEAF_MAX } else { Duration::ZERO };
    // With other settings nothing is asked before the answer to what was asked before can no longer come.
    let changes = line.timeout * to_u32(scan.serials.len());
    (requests, deaf + changes + scan.timeout * to_u32(requests + at_once))
}

/// What a scan has found, in words.
pub fn describe(finding: &Finding) -> Vec<String> {
    match finding {
        Finding::Unit { unit, serial, reply } => {
            let settings = serial.map(|serial| format!(" at {serial}")).unwrap_or_default();
            vec![format!("unit {unit:3}{settings}: {reply}")]
        }
        Finding::Conclusion(conclusion) => vec![conclusion.to_string()],
        Finding::Failed { what, fault } => vec![format!("{what} ({fault})")],
        Finding::Exchange(_)
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Bytes { .. }
        | Finding::Object { .. }
        | Finding::Values { .. } => Vec::new(),
    }
}

/// Every combination that is asked for; none: only the settings of the port.
fn serials(args: &Args, usual: Serial) -> Result<Vec<Serial>, CliError> {
    if args.bauds.is_none() && args.parities.is_none() {
        return Ok(Vec::new());
    }
    let bauds: Vec<u32> = match args.bauds.as_deref() {
        None => vec![usual.baud],
        Some("all") => BAUDS.iter().copied().filter(|baud| (1_200..=115_200).contains(baud)).collect(),
        Some(list) => list
            .split(',')
            .map(|word| {
                let number = word.trim().parse().map_err(|_| {
                    CliError::Usage(format!("--bauds: found `{word}`, expected numbers with commas, or all"))
                })?;
                baud(number)
            })
            .collect::<Result<_, _>>()?,
    };
    let parities: Vec<String> = match args.parities.as_deref() {
        None => vec![usual.parity.word().to_string()],
        Some("all") => vec!["N".into(), "E".into(), "O".into()],
        Some(list) => list.split(',').map(|word| word.trim().to_ascii_uppercase()).collect(),
    };
    if let Some(wrong) = parities.iter().find(|word| !matches!(word.as_str(), "N" | "E" | "O")) {
        return Err(CliError::Usage(format!("--parities: found `{wrong}`, expected N, E, O with commas, or all")));
    }
    let with = |baud: u32| parities.iter().map(move |word| Serial { baud, parity: parity(word), ..usual });
    Ok(bauds.into_iter().flat_map(with).collect())
}

/// `1-247` or `17`.
pub fn units(text: &str) -> Result<(u8, u8), String> {
    let wrong = || format!("found `{text}`, expected a unit such as 17 or a range such as 1-32, 1 to 255");
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let number = |word: &str| word.trim().parse::<u8>().map_err(|_| wrong());
    match (number(first)?, number(last)?) {
        (first @ 1.., last) if first <= last => Ok((first, last)),
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_scan_counts_the_rest_at_each_setting() {
        let line = LineDef {
            timeout: Duration::from_millis(200),
            ..LineDef::new(crate::plant::id::LineId(0), "L", crate::plant::def::Transport::rtu("/dev/x", Serial::USUAL))
        };
        let scan =
            |last, settings| Scan { first: 1, last, serials: vec![Serial::USUAL; settings], timeout: line.timeout };
        // Measured: 30 settings took 14.5 s.
        assert_eq!(time_max(&line, &scan(1, 30)), (30, Duration::from_secs(12)));
        assert_eq!(time_max(&line, &scan(8, 0)), (8, Duration::from_millis(1_600)));
    }

    #[test]
    fn units_are_one_or_a_range() {
        assert_eq!(units("17"), Ok((17, 17)));
        assert_eq!(units("1-32"), Ok((1, 32)));
        for wrong in ["0", "0-5", "9-3", "1-256", "all", ""] {
            assert!(units(wrong).is_err_and(|error| error.contains("expected a unit")), "{wrong}");
        }
    }
}
