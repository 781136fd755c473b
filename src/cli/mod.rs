//! The command line: one file a subcommand, one place for exit codes.

#![allow(rustdoc::broken_intra_doc_links, reason = "a comment of an argument is its help, whose brackets are no links")]

mod output;
mod client;
mod procedure;
mod init;
mod own_files;
mod paths;
mod log;
mod menu;
mod prompt;
mod times;
mod terminal;
mod mistyped;
mod profiles;
mod source;
mod status;
mod attach;
mod run;
mod sim;
mod report;
mod work_folder;
mod sql;
mod register_map;
mod systemd_unit;
mod progress;
mod export;
mod recognition;
mod tools;
mod profile_choice;
mod list;
mod runs;
mod batches;
mod open_log;
mod open;
mod new;
mod mimic;
mod history;
mod help;
mod experiments;
mod drill;
mod demo;
mod decode;
mod control;
mod check;
mod audit;
mod alarms;
mod ack_write;

use std::{
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{Parser, Subcommand};

use self::{
    output::{all_said, is_read, put_out, put_out_file, say, say_error, say_problems},
    terminal::TerminalArgs,
    times::{span, speed},
};
use crate::{
    access::io::users::UsersError,
    attach::io::serve,
    history::{HistoryError, io::probe},
    plant::{line_trouble::LineTrouble, request_refusal::RequestRefusal, visible::visible},
    profile, ui,
};

const EXIT_CODES: &str = "\
Exit codes:
  0  done, or quit by the operator
  1  failed while running, or what was checked is wrong (the message says why)
  2  wrong arguments, errors in a profile, or bytes that cannot be read
  3  the history is in use by another process, or a station of this plant runs already
  4  no station is running here
  5  the audit log is sound, but could not be compared with the history or with its sealing key;
     or a report agrees with all that is there, but its checksum or the audit log could not be read";

/// The control room of a small plant in a terminal: process mimic, trends, alarms, controllers and shift reports over
/// Modbus RTU and TCP.
#[derive(Debug, Parser)]
#[command(version, after_help = EXIT_CODES, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// A plant file, or the name of a shipped plant: station and terminal in one process, or a terminal at its station if
    /// that runs. Without it: a terminal at the station that runs here
    #[arg(value_name = "PLANT")]
    plant: Option<String>,
    #[command(flatten)]
    terminal: TerminalArgs,
    #[command(flatten)]
    station: StationArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a simulated plant on a real pseudo-terminal line, with station and terminal in one process
    Demo(demo::Args),
    /// Show the registers of any device, live: a port, or HOST[:TCPPORT]; or a log of them: FILE.csv
    Open(open::Args),
    /// Write a plant file by answering questions: lines, units, recognised devices, tags, alarms, shifts
    New(new::Args),
    /// Run the station without a terminal: poll, evaluate alarms, record the history
    Run(run::Args),
    /// Open a terminal at a running station; leaving it stops nothing
    Attach(attach::Args),
    /// Show the state of the running station and its plant, as lines or JSON
    Status(status::Args),
    /// Acknowledge alarms at the running station
    Ack(ack_write::AckArgs),
    /// Write a tag at the running station and wait until it is verified
    Write(ack_write::WriteArgs),
    /// Correct what a counter counted, from now on and with a reason (--note)
    Correct(ack_write::CorrectArgs),
    /// Verify the audit log: `audit verify` names the first line that was changed, `audit key` has it sealed
    Audit(audit::Args),
    /// Stop the running station
    Stop(control::Args),
    /// Reload the plant file of the running station: what has not changed keeps running; a file with errors changes nothing
    Reload(control::Args),
    /// Print the systemd unit that runs stations on a panel PC
    SystemdUnit,
    /// Run a scenario in virtual time and evaluate it; without a name list the scenarios
    Drill(drill::Args),
    /// Serve the simulated devices of a plant to other masters, over a pseudo-terminal or TCP
    Sim(sim::Args),
    /// Run the six control experiments of the thesis on the simulated rig and print them beside its measurements
    Experiments(experiments::Args),
    /// Check a plant or device file: print every error at once, or the read plan of each line
    Check(check::Args),
    /// Draw the mimic of a plant file with made-up values; with --watch again whenever the file is saved
    Mimic(mimic::Args),
    /// List the known profiles, print one, or the page about the format
    Profiles(profiles::Args),
    /// Import a register map of another program as a device profile, or export a profile
    Profile(register_map::Args),
    /// Print a page of the manual, or the options of a command
    Help(help::Args),
    /// Write the report of a shift or period from the history, through the station while it runs
    Report(report::Args),
    /// Write stored values of tags at a fixed interval as CSV
    Export(export::Args),
    /// Answer a SELECT over samples, minutes, hours, alarms and actions of the history
    Sql(sql::Args),
    /// Show what the history holds and where: spans, files, sizes, gaps; verify, compact, back up, restore it, import samples
    History(history::Args),
    /// Show alarm performance in a shift or period: rates, floods, chattering, stale, against their targets
    Alarms(alarms::Args),
    /// List the batches of a period: number, begin, end, phases, energy, figures
    Batches(batches::Args),
    /// List the control runs of a period: when SV was reached, overshoot, offset, rise, energy
    Runs(runs::Args),
    /// List the procedures of the running station; start one, abort one, wait for its end
    Procedure(procedure::Args),
    /// Decode a Modbus frame: every field, its checksum, and what is wrong with it
    Decode(decode::Args),
    /// Scan a line for units: addresses, baud rates, parities
    Scan(tools::scan::Args),
    /// Read the identification or some registers of one unit
    Probe(tools::probe::Args),
    /// Test a line by loopback: a unit, or a plug (--plug), returns what it is sent
    Loopback(tools::loopback::Args),
    /// Send bytes to a line and show everything that comes back
    Send(tools::send::Args),
    /// Set RTS and DTR of a serial port by hand, and show CTS, DSR, DCD, RI and breaks
    Signals(tools::signals::Args),
    /// Listen to the line of another master without sending a byte: frames of both sides, statistics, values
    Listen(tools::listen::Args),
}

/// What every command that starts a station takes.
#[derive(Debug, Clone, Default, clap::Args)]
struct StationArgs {
    /// File of the history [default: one file a plant in the state folder; `demo` keeps none]
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,
    /// Use another port for a line: LINE=/dev/ttyUSB0 or LINE=HOST:TCPPORT
    #[arg(long = "port", value_name = "LINE=PORT")]
    ports: Vec<String>,
    /// File of the log [default: the user's state folder, a file a day, seven days]
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
enum CliError {
    #[error("{0}")]
    Profile(Box<profile::Errors>),
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    History(#[from] HistoryError),
    #[error("{0}\nit is not a station of yours that can be queried; stop it first")]
    InUse(HistoryError),
    #[error(transparent)]
    Users(UsersError),
    #[error(transparent)]
    Listen(#[from] serve::ListenError),
    #[error(transparent)]
    Ui(#[from] ui::io::UiError),
    #[error("{0}")]
    Failed(String),
    #[error(transparent)]
    Refused(#[from] RequestRefusal),
    #[error(transparent)]
    Line(#[from] LineTrouble),
    #[error("{0}\nstart one: `sightglass run PLANT`; or try it out: `sightglass demo`")]
    NotRunning(String),
    #[error("the audit log is intact, but {0}")]
    NotCompared(String),
    #[error("{0}")]
    NotVerified(String),
    #[error("the station stopped unexpectedly, see the log")]
    StationGone,
    #[error("{what}: {error}")]
    Io { what: String, error: std::io::Error },
}

impl CliError {
    /// An error of input or output, with what could not be done.
    fn io(what: impl Into<String>) -> impl Fn(std::io::Error) -> CliError {
        let what = what.into();
        move |error| CliError::Io { what: what.clone(), error }
    }

    fn exit_code(&self) -> u8 {
        match self {
            CliError::Profile(_) | CliError::Usage(_) | CliError::History(HistoryError::Foreign { .. }) => 2,
            CliError::History(HistoryError::Locked { .. }) | CliError::InUse(_) => 3,
            CliError::Listen(serve::ListenError::Running { .. }) => 3,
            CliError::NotRunning(_) => 4,
            CliError::NotCompared(_) | CliError::NotVerified(_) => 5,
            CliError::History(_)
            | CliError::Listen(_)
            | CliError::Users(_)
            | CliError::Ui(_)
            | CliError::StationGone
            | CliError::Failed(_)
            | CliError::Refused(_)
            | CliError::Line(_)
            | CliError::Io { .. } => 1,
        }
    }
}

/// Parses the arguments of this process, does what they say, and names the exit code.
pub fn main() -> ExitCode {
    // Histories, logs and reports are for the user and the group, whatever the shell says.
    let mask = rustix::process::umask(rustix::fs::Mode::empty());
    rustix::process::umask(mask | rustix::fs::Mode::from_raw_mode(0o027));
    if let Some(db) = probe::requested(&std::env::args_os().collect::<Vec<_>>()) {
        return probe::child(db);
    }
    if let Some(message) = std::env::args_os().nth(1).and_then(|word| mistyped::renamed(word.to_str()?)) {
        say_error(&message);
        return ExitCode::from(2);
    }
    let result = menu::completed(std::env::args_os().collect()).and_then(|words| run_command(parse(words)));
    match result.and_then(|()| all_said()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            match &error {
                CliError::Profile(errors) => say_problems(errors),
                _ => say_error(&error.to_string()),
            }
            ExitCode::from(error.exit_code())
        }
    }
}

fn parse(words: Vec<std::ffi::OsString>) -> Args {
    Args::try_parse_from(words).unwrap_or_else(|error| {
        if !error.use_stderr() {
            error.exit();
        }
        // What was typed, or comes out of a script, stands in it.
        let _ = write!(std::io::stderr(), "{}", visible(&error.to_string()));
        std::process::exit(error.exit_code())
    })
}

/// Does what the arguments say.
fn run_command(args: Args) -> Result<(), CliError> {
    match args.command {
        None => match args.plant {
            Some(plant) => run::with_terminal(&plant, &args.station, &args.terminal)
                .map_err(|error| mistyped::meant(&plant, error)),
            None => match attach::terminal(None, &args.terminal) {
                Err(error @ CliError::NotRunning(_)) => match menu::without_station()? {
                    Some(words) => run_command(parse(
                        std::iter::once("sightglass".into()).chain(words.into_iter().map(Into::into)).collect(),
                    )),
                    None => Err(error),
                },
                result => result,
            },
        },
        Some(Command::Demo(args)) => demo::main(args),
        Some(Command::Open(args)) => open::main(args),
        Some(Command::New(args)) => new::main(&args),
        Some(Command::Run(args)) => run::main(args),
        Some(Command::Attach(args)) => attach::main(args),
        Some(Command::Status(args)) => status::main(args),
        Some(Command::Ack(args)) => ack_write::ack(args),
        Some(Command::Write(args)) => ack_write::write(args),
        Some(Command::Correct(args)) => ack_write::correct(args),
        Some(Command::Audit(args)) => audit::main(args),
        Some(Command::Stop(args)) => control::stop(args),
        Some(Command::Reload(args)) => control::reload(args),
        Some(Command::SystemdUnit) => systemd_unit::main(),
        Some(Command::Drill(args)) => drill::main(args),
        Some(Command::Sim(args)) => sim::main(args),
        Some(Command::Experiments(args)) => experiments::main(args),
        Some(Command::Check(args)) => check::main(args),
        Some(Command::Mimic(args)) => mimic::main(&args),
        Some(Command::Profiles(args)) => profiles::main(args),
        Some(Command::Profile(args)) => register_map::main(args),
        Some(Command::Help(args)) => help::main(&args),
        Some(Command::Report(args)) => report::main(args),
        Some(Command::Export(args)) => export::main(args),
        Some(Command::Sql(args)) => sql::main(args),
        Some(Command::History(args)) => history::main(args),
        Some(Command::Alarms(args)) => alarms::main(args),
        Some(Command::Batches(args)) => batches::main(args),
        Some(Command::Runs(args)) => runs::main(args),
        Some(Command::Procedure(args)) => procedure::main(args),
        Some(Command::Decode(args)) => decode::main(args),
        Some(Command::Scan(args)) => match tools::scan::main(args)? {
            Some(words) => open::main(open::Args::from_words(words).map_err(CliError::Usage)?),
            None => Ok(()),
        },
        Some(Command::Probe(args)) => tools::probe::main(args),
        Some(Command::Loopback(args)) => tools::loopback::main(args),
        Some(Command::Send(args)) => tools::send::main(args),
        Some(Command::Signals(args)) => tools::signals::main(args),
        Some(Command::Listen(args)) => tools::listen::main(args),
    }
}

/// A runtime for the tasks of a station: two workers are plenty, and the terminal stays quick.
fn runtime() -> Result<tokio::runtime::Runtime, CliError> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(CliError::io("cannot start"))
}

/// Does the work in a runtime of its own. What a hung disk still holds up when it is done is left behind.
fn in_runtime<T>(work: impl Future<Output = Result<T, CliError>>) -> Result<T, CliError> {
    let runtime = runtime()?;
    let done = runtime.block_on(work);
    runtime.shutdown_timeout(std::time::Duration::from_secs(2));
    done
}

/// Local time of the plant.
fn local(at: jiff::Timestamp, def: &crate::plant::PlantDef) -> String {
    at.to_zoned(def.time_zone.clone()).strftime("%Y-%m-%d %H:%M:%S").to_string()
}

fn load(plant: &str, station: &StationArgs) -> Result<crate::plant::PlantDef, CliError> {
    load_with_file(plant, station).map(|(def, _)| def)
}

/// The plant, and the file that its settings can be saved into.
fn load_with_file(
    plant: &str,
    station: &StationArgs,
) -> Result<(crate::plant::PlantDef, Option<profile::PlantFile>), CliError> {
    let errors = |errors| CliError::Profile(Box::new(errors));
    let (def, file) = profile::load_with_file(Path::new(plant), &profile::Search::usual()).map_err(errors)?;
    let mut def = std::sync::Arc::unwrap_or_clone(def);
    for port in &station.ports {
        paths::replace_port(&mut def, port).map_err(CliError::Usage)?;
    }
    Ok((def, file))
}
