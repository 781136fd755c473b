//! Tools for a line without a plant: which port, which settings, and the output of findings.

pub mod listen;
pub mod loopback;
mod network;
pub mod probe;
pub mod send;
pub mod signals;
pub mod scan;

use std::{io::IsTerminal, path::Path, sync::Arc, time::Duration};

use clap::builder::PossibleValuesParser;
use jiff::Timestamp;

use crate::{
    bus::{
        diagnostics::Job,
        dissect,
        frame::hex,
        io::{network::Network, ports, testing::Bench},
    },
    plant::{
        command::CommandId,
        def::{Framing, LineDef, LineId, Parity, Protocol, Rs485, Serial, Transport},
        diagnostics::{Diagnostic, DiagnosticRun, DiagnosticState, Finding},
        traffic::Exchange,
    },
    profile::{self, BAUD_RANGE, BAUDS},
};

use super::{CliError, menu, runtime, say, say_error};

/// How long an answer may take where nothing is said of it.
const TIMEOUT_MS: u64 = 500;

/// The port that a diagnostic works on.
#[derive(Debug, Clone, clap::Args)]
pub struct PortArgs {
    /// A serial port (/dev/ttyUSB0), or HOST, HOST:TCPPORT or [IPV6]:TCPPORT
    #[arg(value_name = "PORT", value_parser = port_text)]
    port: String,
    /// How frames travel [default: rtu on a serial port, else tcp]
    #[arg(long, value_parser = PossibleValuesParser::new(profile::line::polled_modes()))]
    mode: Option<String>,
    /// Baud rate [default: 9600]
    #[arg(long)]
    baud: Option<u32>,
    /// Parity: N, E or O [default: N]
    #[arg(long, ignore_case = true, value_parser = ["N", "E", "O", "M", "S"])]
    parity: Option<String>,
    /// Data bits [default: 8, in ASCII 7]
    #[arg(long, value_name = "BITS", value_parser = clap::value_parser!(u8).range(7..=8))]
    data: Option<u8>,
    /// Stop bits
    #[arg(long, value_name = "BITS", default_value = "1", value_parser = clap::value_parser!(u8).range(1..=2))]
    stop: u8,
    /// How long an answer may take, in milliseconds [default: 500]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(10..=60_000))]
    timeout: Option<u64>,
}

/// A unit on a port.
#[derive(Debug, Clone, clap::Args)]
pub struct UnitArgs {
    #[command(flatten)]
    port: PortArgs,
    /// Unit address
    #[arg(long, short, default_value = "1")]
    unit: u8,
    /// Show every byte
    #[arg(long, short)]
    verbose: bool,
}

impl UnitArgs {
    /// The line, and a unit on it that can answer.
    fn line_and_unit(&self) -> Result<(LineDef, u8), CliError> {
        let line = self.port.line()?;
        check_unit(&line, self.unit)?;
        Ok((line, self.unit))
    }
}

/// Refuses a unit that cannot answer on this line.
pub(super) fn check_unit(line: &LineDef, unit: u8) -> Result<(), CliError> {
    let units = line.transport.units();
    if units.contains(&unit) {
        return Ok(());
    }
    let (least, most) = units.into_inner();
    Err(CliError::Usage(format!("--unit: found {unit}, expected {least} to {most}")))
}

impl PortArgs {
    /// The network that is meant, and the arguments with one of its hosts instead; `None` for a port.
    pub fn network(&self) -> Option<Result<(Network, PortArgs), String>> {
        let (text, tcp_port) = self.port.split_once(':').map_or((self.port.as_str(), ""), |(text, port)| (text, port));
        if self.is_path() || !text.contains('/') {
            return None;
        }
        let colon = if tcp_port.is_empty() { "" } else { ":" };
        let with_host = |network: Network| {
            let host = network.hosts().first().map(ToString::to_string).unwrap_or_default();
            (network, PortArgs { port: format!("{host}{colon}{tcp_port}"), ..self.clone() })
        };
        Some(text.parse().map(with_host))
    }

    /// Is a file of this machine meant, not a host or a network? A name without a folder is one in this folder, if such a file is
    /// there or only a serial port can be meant.
    fn is_path(&self) -> bool {
        let is_serial = matches!(self.mode.as_deref(), Some("rtu" | "ascii"));
        let begins_network = |(address, _): (&str, &str)| {
            address.starts_with(|first: char| first.is_ascii_digit())
                && address.chars().all(|letter| letter.is_ascii_digit() || letter == '.')
        };
        let is_network = self.port.split_once('/').is_some_and(begins_network);
        match self.port.contains('/') {
            true => !is_network,
            false => {
                let is_file = std::fs::metadata(&self.port).is_ok_and(|file| !file.is_dir());
                is_serial && !self.port.contains(':') || is_file
            }
        }
    }

    /// The line that the arguments describe.
    pub fn line(&self) -> Result<LineDef, CliError> {
        if let Some(network) = self.network() {
            network.map_err(CliError::Usage)?;
            let words = format!("port: found a network; `sightglass scan {}` looks for its devices", self.port);
            return Err(CliError::Usage(words));
        }
        let is_path = self.is_path();
        let mode = self.mode.as_deref().unwrap_or(if is_path { "rtu" } else { "tcp" });
        let (protocol, framing) = profile::line::of_mode_word(mode).unwrap_or((Some(Protocol::Tcp), Framing::Mbap));
        if protocol.is_none() != is_path {
            let expected = if protocol.is_none() { "a path such as /dev/ttyUSB0" } else { "HOST or HOST:TCPPORT" };
            return Err(CliError::Usage(format!("port: found `{}`, expected {expected} for {mode}", self.port)));
        }
        let transport = if is_path {
            let path = std::path::absolute(&self.port)
                .map_err(|error| CliError::Usage(format!("port: found `{}`: {error}", self.port)))?;
            let port = path.display().to_string();
            Transport::Serial { port, serial: self.serial(framing)?, framing, rs485: Rs485::Off }
        } else {
            let (host, tcp_port) = Transport::host_and_port(&self.port).ok_or_else(|| {
                let expected = "expected HOST or HOST:TCPPORT with a TCP port up to 65535, or [IPV6]:TCPPORT";
                CliError::Usage(format!("port: found `{}`, {expected}", self.port))
            })?;
            let protocol = protocol.unwrap_or(Protocol::Tcp);
            Transport::Network { protocol, host: host.to_owned(), port: tcp_port.unwrap_or(502), framing }
        };
        Ok(LineDef {
            timeout: Duration::from_millis(self.timeout.unwrap_or(TIMEOUT_MS)),
            ..LineDef::new(LineId(0), "line", transport)
        })
    }

    fn serial(&self, framing: Framing) -> Result<Serial, CliError> {
        let data_bits = self.data.unwrap_or(if framing == Framing::Ascii { 7 } else { 8 });
        if framing == Framing::Rtu && data_bits != 8 {
            return Err(CliError::Usage("--data: found 7, expected 8: Modbus RTU sends whole bytes".into()));
        }
        let parity = self.parity.as_deref().map_or(Parity::None, parity);
        Ok(Serial { baud: baud(self.baud.unwrap_or(Serial::USUAL.baud))?, data_bits, parity, stop_bits: self.stop })
    }

    /// The log of registers that is named instead of a port.
    pub(super) fn log(&self) -> Option<&Path> {
        let path = Path::new(&self.port);
        (menu::is_log(&self.port) || path.is_file()).then_some(path)
    }

    /// Is it given how long an answer may take?
    pub(super) fn is_timed(&self) -> bool {
        self.timeout.is_some()
    }

    /// Are baud rate and parity both given?
    pub(super) fn is_exact(&self) -> bool {
        self.baud.is_some() && self.parity.is_some()
    }

    /// Do these settings agree with what is given?
    pub(super) fn fits(&self, serial: Serial) -> bool {
        self.baud.is_none_or(|baud| baud == serial.baud)
            && self.parity.as_deref().is_none_or(|letter| parity(letter) == serial.parity)
    }
}

/// A port as it is typed; `tcp:` in front of a host says nothing more, and a protocol alone is no host.
fn port_text(text: &str) -> Result<String, String> {
    const PROTOCOLS: [&str; 6] = ["tcp", "udp", "rtu", "ascii", "modbus", "serial"];
    let expected = "expected a serial port such as /dev/ttyUSB0, or HOST or HOST:TCPPORT such as 10.0.0.7:502";
    let rest = text.strip_prefix("tcp:").map(|rest| rest.trim_start_matches("//"));
    let host = rest.unwrap_or(text);
    let is_number = !host.is_empty() && host.chars().all(|letter| letter.is_ascii_digit());
    if host.is_empty() || PROTOCOLS.contains(&host) || is_number && !Path::new(text).is_file() {
        return Err(format!("found `{text}`, {expected}"));
    }
    Ok(host.to_owned())
}

/// `N`, `E`, `O`, `M` or `S`, checked by the arguments.
fn parity(letter: &str) -> Parity {
    match letter.to_ascii_uppercase().as_str() {
        "E" => Parity::Even,
        "O" => Parity::Odd,
        "M" => Parity::Mark,
        "S" => Parity::Space,
        _ => Parity::None,
    }
}

fn baud(baud: u32) -> Result<u32, CliError> {
    let known = || BAUDS.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    if BAUD_RANGE.contains(&baud) {
        return Ok(baud);
    }
    let (least, most) = (BAUD_RANGE.start(), BAUD_RANGE.end());
    Err(CliError::Usage(format!("--baud: found {baud}, expected {least} to {most}, usually one of {}", known())))
}

/// Runs a diagnostic and prints each finding at once. Ctrl-C ends it between two steps.
pub fn run(
    line: &LineDef,
    diagnostic: Diagnostic,
    describe: impl Fn(&Finding) -> Vec<String>,
) -> Result<DiagnosticRun, CliError> {
    let mut printed = 0;
    let mut print = |run: &DiagnosticRun| {
        run.findings.iter().skip(printed).flat_map(&describe).for_each(|text| say(&text));
        printed = run.findings.len();
    };
    let run = runtime()?.block_on(search(&mut Bench::new(line), diagnostic, |run| {
        print(run);
        false
    }))?;
    print(&run);
    match &run.state {
        DiagnosticState::Failed(why) => Err(why.clone().into()),
        DiagnosticState::Running | DiagnosticState::Done | DiagnosticState::Cancelled => Ok(run),
    }
}

/// Runs a diagnostic until something is `found`, and shows how far it has come. Ctrl-C is an error.
pub async fn search(
    bench: &mut Bench,
    diagnostic: Diagnostic,
    mut found: impl FnMut(&DiagnosticRun) -> bool,
) -> Result<DiagnosticRun, CliError> {
    let job = Job::new(CommandId::default(), Arc::from("cli"), diagnostic, Timestamp::now());
    let work = bench.run(job, |run: &DiagnosticRun| {
        let found = found(run);
        if 1 < run.total {
            let now = run.now.map(|now| now.to_string()).unwrap_or_default();
            show_progress(&format!("{} of {}  {now}", run.done, run.total));
        }
        !found
    });
    let run = tokio::select! {
        run = work => Ok(run),
        _ = tokio::signal::ctrl_c() => Err(CliError::Failed("stopped".into())),
    };
    show_progress("");
    if let (Ok(DiagnosticRun { state: DiagnosticState::Done, .. }), Some(port)) = (&run, bench.port())
        && let Some(who) = ports::also_open(port)
    {
        say_error(&format!("{port} is also open in {who}: each takes bytes from the other"));
    }
    run
}

/// Replaces the line of progress, on a terminal.
fn show_progress(text: &str) {
    use std::io::Write;
    if !std::io::stderr().is_terminal() {
        return;
    }
    let _ = write!(std::io::stderr(), "\r\x1b[K{text}");
}

/// Request and answer, byte for byte and in words.
pub fn exchange_lines(exchange: &Exchange) -> Vec<String> {
    let request = dissect::dissect(&exchange.request, Some(exchange.framing), Some(dissect::Direction::Request), None);
    let mut lines =
        vec![format!("TX {}", shown(&exchange.request, exchange.framing)), format!("   {}", request.summary)];
    if exchange.answer.is_empty() {
        lines.push(match exchange.outcome {
            Ok(()) => "   no response is expected".to_owned(),
            Err(fault) => format!("RX {fault}"),
        });
        return lines;
    }
    lines.extend(answer_lines(&exchange.answer, exchange.framing, &request.message));
    let reply =
        exchange.response_time.map(|reply| format!(", after {:.1} ms", reply.as_secs_f64() * 1e3)).unwrap_or_default();
    match exchange.outcome {
        Ok(()) => lines.push(format!("   ok{reply}")),
        Err(fault) => lines.push(format!("   {fault}{reply}")),
    }
    lines
}

/// What came back, byte for byte and in words.
pub fn answer_lines(bytes: &[u8], framing: Framing, request: &[u8]) -> Vec<String> {
    let asked = (!request.is_empty()).then_some(request);
    let answer = dissect::dissect(bytes, Some(framing), Some(dissect::Direction::Answer), asked);
    vec![format!("RX {}", shown(bytes, framing)), format!("   {}", answer.summary)]
}

/// Bytes in hexadecimal digits, an ASCII frame as its characters.
pub fn shown(bytes: &[u8], framing: Framing) -> String {
    match framing {
        Framing::Ascii => bytes.escape_ascii().to_string(),
        Framing::Rtu | Framing::Mbap => hex(bytes),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        port: PortArgs,
    }

    fn line(args: &str) -> Result<String, String> {
        let parsed =
            Line::try_parse_from(std::iter::once("x").chain(args.split(' '))).map_err(|error| error.to_string())?;
        parsed.port.line().map(|line| line.transport.to_string()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_path_is_rtu_and_a_host_is_tcp() {
        for (args, expect) in [
            ("/dev/ttyUSB0", "RTU /dev/ttyUSB0 9600 8N1"),
            ("/dev/ttyUSB0 --mode ascii --parity e --baud 19200", "ASCII /dev/ttyUSB0 19200 7E1"),
            ("plc", "TCP plc:502"),
            ("src", "TCP src:502"),
            ("plc:1502 --mode rtu-over-tcp", "RTU over TCP plc:1502"),
            ("plc:1502 --mode ascii-over-tcp", "ASCII over TCP plc:1502"),
            ("[::1]:1502", "TCP [::1]:1502"),
            ("[fe80::1]", "TCP [fe80::1]:502"),
            ("::1", "TCP [::1]:502"),
        ] {
            assert_eq!(line(args).as_deref(), Ok(expect), "{args}");
        }
        // A path may be relative; plant files get the whole.
        let here = std::env::current_dir().expect("tests run in a folder").display().to_string();
        for (args, port) in [
            ("./ttyV0", "ttyV0"),
            ("pty/ttyV0", "pty/ttyV0"),
            ("Cargo.toml", "Cargo.toml"),
            ("ttyV0 --mode rtu", "ttyV0"),
        ] {
            assert_eq!(line(args), Ok(format!("RTU {here}/{port} 9600 8N1")), "{args}");
        }
    }

    #[test]
    fn wrong_settings_are_reported_with_what_was_expected() {
        for (args, part) in [
            ("/dev/ttyUSB0 --mode tcp", "expected HOST or HOST:TCPPORT for tcp"),
            ("plc:502 --mode rtu", "expected a path such as /dev/ttyUSB0"),
            ("plc:99999", "found `plc:99999`, expected HOST or HOST:TCPPORT with a TCP port"),
            ("[::1]x", "or [IPV6]:TCPPORT"),
            ("10.0.0.0/24", "found a network; `sightglass scan 10.0.0.0/24`"),
            ("10.0.0.0/8", "at most 256 addresses"),
            ("/dev/ttyUSB0 --baud 49", "found 49, expected 50 to 4000000, usually one of 300"),
            ("/dev/ttyUSB0 --data 7", "found 7, expected 8"),
            ("/dev/ttyUSB0 --parity X", "[possible values: N, E, O, M, S]"),
        ] {
            assert!(line(args).is_err_and(|error| error.contains(part)), "{args}: {:?}", line(args));
        }
    }
}
