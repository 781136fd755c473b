//! `sightglass open PORT`: the registers of any device, live, without a plant file.

use std::{path::Path, sync::Arc, time::Duration};

use clap::Parser;

use super::{
    CliError, TerminalArgs, in_runtime, log, menu,
    open_log::{self, WatchArgs},
    paths, recognition, say,
    tools::{self, PortArgs, scan},
};
use crate::{
    bus::io::{clock::Clock, testing::Bench},
    plant::{
        PlantDef,
        def::{LineDef, Parity, Serial, Transport},
        diagnostics::{Conclusion, Diagnostic, DiagnosticRun, DiagnosticState, Finding, Scan},
    },
    profile::{self, OwnProfiles, Search},
    station::io as station,
    ui::{self, msg::Start},
};

/// The usual baud rates and parities, the most frequent first.
const USUAL: [(u32, Parity); 14] = [
    (9_600, Parity::None),
    (19_200, Parity::Even),
    (9_600, Parity::Even),
    (19_200, Parity::None),
    (115_200, Parity::None),
    (38_400, Parity::None),
    (57_600, Parity::None),
    (38_400, Parity::Even),
    (115_200, Parity::Even),
    (57_600, Parity::Even),
    (4_800, Parity::None),
    (4_800, Parity::Even),
    (9_600, Parity::Odd),
    (19_200, Parity::Odd),
];
/// Units that a device on TCP or its gateway usually has, the most frequent first.
const USUAL_UNITS: [(u8, u8); 7] = [(1, 1), (255, 255), (0, 0), (126, 126), (2, 16), (240, 240), (17, 247)];
/// Units on a serial line and of the usual settings those that they are looked for with, the most frequent first.
const USUAL_SERIAL_UNITS: [(u8, u8, usize); 3] = [(1, 1, USUAL.len()), (2, 16, USUAL.len()), (17, 247, 4)];
/// How long an answer may take while many units or settings are tried, if no time is given.
const TRIAL: Duration = Duration::from_millis(250);

/// Arguments of `open`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    port: PortArgs,
    /// Unit address [default: the first usual one that answers]
    #[arg(long, short, value_parser = clap::value_parser!(u8))]
    unit: Option<u8>,
    #[command(flatten)]
    watched: WatchArgs,
    #[command(flatten)]
    terminal: TerminalArgs,
}

/// Finds settings and unit, and shows the registers.
pub fn main(args: Args) -> Result<(), CliError> {
    if let Some(path) = args.port.log() {
        return show_log(open_log::read(path)?, &args.terminal);
    }
    let line = args.port.line()?;
    args.unit.map_or(Ok(()), |unit| tools::check_unit(&line, unit))?;
    let start = args.watched.start()?;
    ui::io::require_terminal()?;
    let _log = log::start(None, None)?;
    in_runtime(async {
        let (line, unit) = find(line, &args).await?;
        menu::remember(&place(&line, unit));
        let station = recognition::bench_station(line, unit);
        let session = station.session(&paths::operator());
        let options = ui::io::Options {
            start,
            profiles: own_profiles(Path::new("")),
            ..args.terminal.options(ui::Leaving::Bench)
        };
        let result = ui::io::run(session, options).await;
        station.stop().await;
        args.watched.say_written();
        Ok(result?)
    })
}

/// Shows a log, without a line.
fn show_log(start: Start, terminal: &TerminalArgs) -> Result<(), CliError> {
    ui::io::require_terminal()?;
    let _log = log::start(None, None)?;
    in_runtime(async {
        let title = start.shown.as_ref().map(|(file, _)| file.clone()).unwrap_or_default();
        let def = Arc::new(PlantDef { name: "log".into(), title, ..PlantDef::default() });
        let station = station::start_transient(def, Clock::real(), Vec::new(), Box::new(|_| {}));
        let session = station.session(&paths::operator());
        let options = ui::io::Options { start, ..terminal.options(ui::Leaving::Log) };
        let result = ui::io::run(session, options).await;
        station.stop().await;
        Ok(result?)
    })
}

/// The user's device profiles, for a plant file in this folder; says which have errors.
pub fn own_profiles(folder: &Path) -> OwnProfiles {
    let profiles = profile::own_profiles(&Search::usual(), &folder.join("plant.toml"));
    for file in profiles.broken() {
        say(&format!("{file} has errors and is ignored: `sightglass check {file}` lists them"));
    }
    profiles
}

/// The arguments that open this device again at once.
fn place(line: &LineDef, unit: u8) -> String {
    let mode = match profile::line::mode_word(&line.transport) {
        None | Some("rtu" | "tcp") => String::new(),
        Some(mode) => format!(" --mode {mode}"),
    };
    let serial = line.transport.serial().map_or(String::new(), |serial| {
        let stop = if serial.stop_bits == 2 { " --stop 2" } else { "" };
        format!(" --baud {} --parity {}{stop}", serial.baud, serial.parity.word())
    });
    format!("{} --unit {unit}{mode}{serial}", port_of(line))
}

/// `open` and its arguments.
#[derive(Debug, clap::Parser)]
struct Words {
    #[command(flatten)]
    args: Args,
}

impl Args {
    /// The arguments that these words mean, the first of them `open`; `Err` says what is wrong with them.
    pub fn from_words(words: Vec<String>) -> Result<Args, String> {
        Words::try_parse_from(words).map(|words| words.args).map_err(|error| error.to_string())
    }

    /// The line that they describe.
    pub fn line(&self) -> Result<LineDef, CliError> {
        self.port.line()
    }
}

/// The settings and the unit that answer; what is given is taken as it is.
pub async fn find(line: LineDef, args: &Args) -> Result<(LineDef, u8), CliError> {
    if let Some(serial) = line.transport.serial() {
        return find_serial(line, serial, args).await;
    }
    if let Some(unit) = args.unit {
        return Ok((line, unit));
    }
    let (mut came, mut bench) = (String::new(), Bench::new(&line));
    for scan in unit_scans(&line, args) {
        match first_answer(&mut bench, &line, scan).await? {
            Ok((unit, _, words)) => {
                say(&format!("unit {unit} answers: {words}"));
                return Ok((line, unit));
            }
            Err(other) if came.is_empty() => came = other,
            Err(_) => {}
        }
    }
    Err(CliError::Failed(format!(
        "{}: the connection opens, but units 0 to 247 and 255 do not answer{came}. In the order of likelihood:\n\
         no device behind the gateway or not powered, other serial settings in the gateway,\n\
         another protocol on this TCP port, answers that take longer (`--timeout 2000`)",
        port_of(&line)
    )))
}

/// The likeliest units on TCP one by one, each with all the time that an answer may take; then the others.
fn unit_scans(line: &LineDef, args: &Args) -> Vec<Scan> {
    let units = line.transport.units();
    let ranges = USUAL_UNITS.into_iter().filter(|(first, _)| units.contains(first));
    let scan = |(first, last)| {
        let timeout = if first == last { line.timeout } else { trial(line, args) };
        Scan { first, last, serials: Vec::new(), timeout }
    };
    ranges.map(scan).collect()
}

/// How long an answer may take while many units or settings are tried.
fn trial(line: &LineDef, args: &Args) -> Duration {
    if args.port.is_timed() { line.timeout } else { line.timeout.min(TRIAL) }
}

/// Settings and unit on a serial line: unit 1 with every usual setting, then the others.
async fn find_serial(line: LineDef, serial: Serial, args: &Args) -> Result<(LineDef, u8), CliError> {
    if let (true, Some(unit)) = (args.port.is_exact(), args.unit) {
        return Ok((line, unit));
    }
    let serials = |most: usize| -> Vec<Serial> {
        if args.port.is_exact() {
            return vec![serial];
        }
        let usual = USUAL.iter().take(most).map(|(baud, parity)| Serial { baud: *baud, parity: *parity, ..serial });
        usual.filter(|serial| args.port.fits(*serial)).collect()
    };
    // With other settings the line rests for the timeout: no longer than what is tried.
    let trial = LineDef { timeout: trial(&line, args), ..line.clone() };
    let (mut bench, mut came) = (Bench::new(&trial), String::new());
    let stages = args.unit.map_or(USUAL_SERIAL_UNITS.to_vec(), |unit| vec![(unit, unit, USUAL.len())]);
    for (first, last, most) in stages {
        let scan = Scan { first, last, serials: serials(most), timeout: trial.timeout };
        match first_answer(&mut bench, &trial, scan).await? {
            Ok((unit, serial, words)) => {
                let serial = serial.unwrap_or(serial_of(&line));
                say(&format!("unit {unit} answers at {serial}: {words}"));
                return Ok((with_serial(line, serial), unit));
            }
            Err(other) if came.is_empty() => came = other,
            Err(_) => {}
        }
    }
    Err(CliError::Failed(format!(
        "{}: {} at none of the usual settings{came}. In the order of likelihood:\n\
         A and B swapped, the device without power or not set to Modbus RTU,\n\
         no common ground or termination, other settings (`sightglass scan {0} --bauds all --parities all`), another \
         master on the line, answers that take longer (`--timeout 2000`).\n\
         `--baud`, `--parity` and `--unit` together open the line without trying",
        port_of(&line),
        args.unit.map_or("no unit answers".to_owned(), |unit| format!("unit {unit} answers"))
    )))
}

/// The first unit that answers, with the settings that it answers at, and what it has said; `Err` with what came in place
/// of an answer, `, something is there: …`, or empty.
async fn first_answer(
    bench: &mut Bench,
    line: &LineDef,
    scan: Scan,
) -> Result<Result<(u8, Option<Serial>, String), String>, CliError> {
    say(&announced(line, &scan));
    let run = tools::search(bench, Diagnostic::Scan(scan), |run| answer(run).is_some()).await?;
    let deaf = |finding: &&Finding| matches!(finding, Finding::Conclusion(Conclusion::Deaf(_)));
    run.findings.iter().find(deaf).into_iter().flat_map(tools::scan::describe).for_each(|words| say(&words));
    match &run.state {
        DiagnosticState::Failed(why) => Err(why.clone().into()),
        DiagnosticState::Running | DiagnosticState::Done | DiagnosticState::Cancelled => {
            Ok(answer(&run).ok_or_else(|| trace(&run).map_or(String::new(), |trace| format!(", {trace}"))))
        }
    }
}

/// `trying units 2 to 16 at 14 settings, at most 53 s; Ctrl-C ends it`.
fn announced(line: &LineDef, scan: &Scan) -> String {
    let Scan { first, last, serials, .. } = scan;
    let units = if first == last { format!("unit {first}") } else { format!("units {first} to {last}") };
    let settings = match &serials[..] {
        [] => String::new(),
        [one] => format!(" at {one}"),
        many => format!(" at {} settings", many.len()),
    };
    let seconds = scan::time_max(line, scan).1.as_secs_f64().ceil();
    format!("trying {units}{settings}, at most {seconds} s; Ctrl-C ends it")
}

fn answer(run: &DiagnosticRun) -> Option<(u8, Option<Serial>, String)> {
    run.findings.iter().find_map(|finding| match finding {
        Finding::Unit { unit, serial, reply } if reply.is_certain() => Some((*unit, *serial, reply.to_string())),
        // Corrupt bytes at one of the settings fit nothing.
        Finding::Unit { .. }
        | Finding::Exchange(_)
        | Finding::Bytes { .. }
        | Finding::Object { .. }
        | Finding::Values { .. }
        | Finding::Failed { .. }
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Conclusion(_) => None,
    })
}

/// What came that was no answer.
fn trace(run: &DiagnosticRun) -> Option<String> {
    run.findings.iter().find_map(|finding| match finding {
        Finding::Unit { reply, .. } if !reply.is_certain() => Some(reply.to_string()),
        Finding::Failed { fault, .. } => Some(fault.to_string()),
        Finding::Unit { .. }
        | Finding::Exchange(_)
        | Finding::Bytes { .. }
        | Finding::Object { .. }
        | Finding::Values { .. }
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Conclusion(_) => None,
    })
}

fn serial_of(line: &LineDef) -> Serial {
    line.transport.serial().unwrap_or(Serial::USUAL)
}

fn port_of(line: &LineDef) -> String {
    match &line.transport {
        Transport::Serial { port, .. } => port.clone(),
        Transport::Network { host, port, .. } => format!("{host}:{port}"),
    }
}

fn with_serial(line: LineDef, wanted: Serial) -> LineDef {
    let mut line = line;
    if let Transport::Serial { serial, .. } = &mut line.transport {
        *serial = wanted;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{command::CommandId, diagnostics::UnitReply};

    #[test]
    fn units_are_tried_with_the_time_that_is_given() {
        let scans = |words: &str| {
            let args = Args::from_words(words.split(' ').map(str::to_owned).collect()).expect("arguments");
            let line = args.line().expect("a line");
            let tried = unit_scans(&line, &args).into_iter().map(|scan| (scan.first, scan.timeout.as_millis()));
            let announced = unit_scans(&line, &args).iter().map(|scan| announced(&line, scan)).collect::<Vec<_>>();
            (tried.collect::<Vec<_>>(), announced)
        };
        let (tried, announced) = scans("open 10.0.0.7");
        assert_eq!(tried[..5], [(1, 500), (255, 500), (0, 500), (126, 500), (2, 250)]);
        assert_eq!(announced[0], "trying unit 1, at most 6 s; Ctrl-C ends it");
        assert_eq!(announced[6], "trying units 17 to 247, at most 67 s; Ctrl-C ends it");
        assert!(scans("open 10.0.0.7 --timeout 2000").0.iter().all(|(_, timeout)| *timeout == 2_000));
        assert!(scans("open 10.0.0.7 --timeout 100").0.iter().all(|(_, timeout)| *timeout == 100));
    }

    #[test]
    fn corrupt_bytes_at_a_setting_are_no_answer() {
        let job = crate::bus::diagnostics::Job::new(
            CommandId::default(),
            "cli".into(),
            Diagnostic::Identify { unit: 1 },
            jiff::Timestamp::UNIX_EPOCH,
        );
        let found = |reply| {
            let findings = vec![Finding::Unit { unit: 3, serial: None, reply }];
            answer(&DiagnosticRun { findings, ..job.run().clone() }).map(|(unit, ..)| unit)
        };
        let corrupt = UnitReply::Corrupt(crate::plant::fault::Fault::Timeout);
        assert_eq!((found(UnitReply::Register(77)), found(corrupt)), (Some(3), None));
    }
}
